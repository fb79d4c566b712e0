//! TCP links. Bytes that the peer does not accept at once wait in a queue; a peer for which more
//! than [`MAX_QUEUED_BYTES`] wait is disconnected.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use super::transport::{ByteLink, is_transient};

/// Most bytes that wait for a peer: about ten seconds of all that a PX4 streams.
const MAX_QUEUED_BYTES: usize = 256 * 1024;

/// A TCP connection, of a client or of the server.
struct Connection {
    stream: TcpStream,
    /// Bytes that the peer has not accepted yet.
    queue: Vec<u8>,
}

impl Connection {
    fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        // Setpoints and acknowledgements are small and must not wait until Nagle's algorithm has
        // gathered more bytes.
        stream.set_nodelay(true)?;
        Ok(Self { stream, queue: Vec::new() })
    }

    /// Reads the bytes that have arrived into `buffer`; returns their number.
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.stream.read(buffer) {
            Ok(0) => Err(io::Error::new(
                io::ErrorKind::UnexpectedEof,
                "the other side closed the connection",
            )),
            Err(error) if is_transient(&error) => Ok(0),
            result => result,
        }
    }

    /// Sends bytes, and keeps what the peer does not accept yet.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.queue.extend_from_slice(bytes);
        let mut sent = 0;
        while sent < self.queue.len() {
            match self.stream.write(&self.queue[sent..]) {
                Ok(0) => break,
                Ok(count) => sent += count,
                Err(error) if is_transient(&error) => break,
                Err(error) => return Err(error),
            }
        }
        self.queue.drain(..sent);
        if self.queue.len() > MAX_QUEUED_BYTES {
            return Err(io::Error::new(io::ErrorKind::TimedOut, "the other side does not read"));
        }
        Ok(())
    }
}

/// A TCP client.
pub struct Client(Connection);

impl Client {
    /// Connects to a server; fails after `timeout`.
    pub fn connect(to: SocketAddr, timeout: Duration) -> io::Result<Self> {
        Ok(Self(Connection::new(TcpStream::connect_timeout(&to, timeout)?)?))
    }
}

impl ByteLink for Client {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.receive(buffer)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.send(bytes)
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.0.stream.local_addr().ok()
    }
}

/// A TCP server that serves one client at a time.
pub struct Server {
    listener: TcpListener,
    /// The connected client; `None` without one.
    client: Option<Connection>,
}

impl Server {
    /// Listens on an address.
    pub fn bind(at: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(at)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, client: None })
    }

    /// Accepts a client that waits, if any; it replaces the current one.
    fn accept(&mut self) {
        // A failed accept (the client has already closed) leaves the current client connected.
        if let Ok((stream, _)) = self.listener.accept()
            && let Ok(connection) = Connection::new(stream)
        {
            self.client = Some(connection);
        }
    }
}

impl ByteLink for Server {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.accept();
        let Some(client) = &mut self.client else { return Ok(0) };
        Ok(client.receive(buffer).unwrap_or_else(|_| {
            self.client = None;
            0
        }))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.accept();
        if let Some(client) = &mut self.client
            && client.send(bytes).is_err()
        {
            self.client = None;
        }
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.listener.local_addr().ok()
    }
}
