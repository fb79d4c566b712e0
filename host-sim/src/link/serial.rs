//! Serial links: eight data bits, no parity, one stop bit, no flow control.

use std::io::{self, Read, Write};
use std::net::SocketAddr;
use std::time::Duration;

use serialport::SerialPort;

use super::transport::{ByteLink, is_transient};

/// Most bytes that wait to be written, if the line is slower than its sender: less than a second at
/// 57600 baud. A frame that would exceed it is dropped, since old setpoints are worse than none.
const MAX_QUEUED_BYTES: usize = 4096;
/// Most bytes per write: a device that is ready to write at all takes this many without blocking.
const WRITE_CHUNK: usize = 256;

/// An open serial port.
pub struct OpenSerialPort {
    device: Box<dyn SerialPort>,
    /// Bytes that the device has not accepted yet.
    queue: Vec<u8>,
}

impl OpenSerialPort {
    /// Opens a device exclusively.
    pub fn open(path: &str, baud: u32) -> io::Result<Self> {
        let device = serialport::new(path, baud).timeout(Duration::ZERO).open()?;
        Ok(Self { device, queue: Vec::new() })
    }
}

/// Whether an error only means that no byte can be read or written now.
fn is_timeout_or_transient(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::TimedOut || is_transient(error)
}

impl ByteLink for OpenSerialPort {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.device.read(buffer) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the device is gone")),
            Err(error) if is_timeout_or_transient(&error) => Ok(0),
            result => result,
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.queue.len() + bytes.len() <= MAX_QUEUED_BYTES {
            self.queue.extend_from_slice(bytes);
        }
        let mut sent = 0;
        while sent < self.queue.len() {
            let end = self.queue.len().min(sent + WRITE_CHUNK);
            match self.device.write(&self.queue[sent..end]) {
                Ok(count) => sent += count,
                Err(error) if is_timeout_or_transient(&error) => break,
                Err(error) => return Err(error),
            }
        }
        self.queue.drain(..sent);
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        None
    }
}

#[cfg(test)]
mod tests;
