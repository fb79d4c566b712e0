//! The interface of every link.

use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// A nonblocking byte link.
pub trait ByteLink: Send {
    /// Copies bytes that have arrived into `buffer` and returns their number, 0 if none have. A
    /// buffer of 2 kB holds any datagram that Flockmate sends.
    ///
    /// # Errors
    /// The link is permanently lost. Not an error: a server without a client, a peer that does not
    /// listen, a connection or device that is lost for now.
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Sends whole frames. Frames that the receiver does not accept in time are dropped.
    ///
    /// # Errors
    /// The link is permanently lost.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// The local address, with the port that the system chose for port 0; `None` for a serial port.
    fn local_address(&self) -> Option<SocketAddr>;

    /// Current time of the other end: the system's clock, or simulated time if the link leads into
    /// a simulation.
    fn now(&self) -> Instant {
        Instant::now()
    }

    /// Waits a millisecond, or lets a simulation behind the link run; called when nothing was
    /// received.
    fn wait_briefly(&mut self) {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Whether an error only means that nothing can be read or written now. A refused connection counts
/// too: UDP reports it while the peer does not listen.
pub(super) fn is_transient(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionRefused, Interrupted, WouldBlock};
    matches!(error.kind(), WouldBlock | Interrupted | ConnectionRefused)
}
