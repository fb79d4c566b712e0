//! What every link can do.

use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// A nonblocking link.
pub trait Link: Send {
    /// Moves bytes that have arrived into `buffer` (2 kB fit any datagram of ours); 0 where none
    /// have.
    ///
    /// # Errors
    /// When the link is gone for good. A server without a client, a peer that does not listen, a
    /// connection or device that is lost for now are no errors.
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Sends whole frames. Frames that the receiver does not take in time are dropped.
    ///
    /// # Errors
    /// When the link is gone for good.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// The local address, where there is one: it shows the port when port 0 was asked for.
    fn local_address(&self) -> Option<SocketAddr>;

    /// Now, by the time in which the other end lives: the clock's, unless the link leads into a
    /// simulation.
    fn now(&self) -> Instant {
        Instant::now()
    }

    /// Lets a millisecond pass: nothing has come.
    fn rest(&mut self) {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Whether an error only means that nothing is there now.
pub(super) fn is_would_block(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionRefused, Interrupted, WouldBlock};
    matches!(error.kind(), WouldBlock | Interrupted | ConnectionRefused)
}
