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
fn is_idle(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::TimedOut || is_transient(error)
}

impl ByteLink for OpenSerialPort {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.device.read(buffer) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the device is gone")),
            Err(error) if is_idle(&error) => Ok(0),
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
                Err(error) if is_idle(&error) => break,
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
mod tests {
    use serialport::TTYPort;

    use super::super::tests::hear;
    use super::*;

    /// One end of a pair of pseudo terminals, and a link opened at the other.
    fn pair() -> (OpenSerialPort, OpenSerialPort) {
        let (mut near, far) = TTYPort::pair().unwrap();
        let path = far.name().unwrap();
        // Closed, since a port that is open cannot be opened again.
        drop(far);
        let far = OpenSerialPort::open(&path, 921_600).unwrap();
        near.set_timeout(Duration::ZERO).unwrap();
        (OpenSerialPort { device: Box::new(near), queue: Vec::new() }, far)
    }

    #[test]
    fn bytes_pass_a_pair_of_terminals_both_ways_unchanged() {
        let (mut near, mut far) = pair();
        assert_eq!(far.receive(&mut [0; 16]).unwrap(), 0, "nothing sent yet");
        // Every byte: a terminal not set raw would change some and act on others.
        let all: Vec<u8> = (0..=255).collect();
        near.send(&all).unwrap();
        assert_eq!(hear(&mut far), all);
        far.send(&all).unwrap();
        assert_eq!(hear(&mut near), all);
    }

    #[test]
    fn a_device_that_goes_away_ends_the_link() {
        let (near, mut far) = pair();
        drop(near);
        assert!(far.receive(&mut [0; 16]).is_err());
    }

    #[test]
    fn a_device_that_is_not_there_is_named() {
        let error =
            "serial:/dev/no-such-device:57600".parse::<super::super::LinkUrl>().unwrap().open();
        assert!(error.err().unwrap().to_string().contains("serial:/dev/no-such-device:57600"));
    }
}
