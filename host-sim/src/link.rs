//! Byte links between processes and devices: link URLs, and nonblocking TCP, UDP and serial ports
//! behind the trait [`ByteLink`].
//!
//! | URL | is |
//! |---|---|
//! | `tcp:HOST:PORT` | a TCP client |
//! | `tcp-listen:HOST:PORT` | a TCP server with one client at a time; a new client replaces the old |
//! | `udp:HOST:PORT` | sends to that peer and receives from it alone, as PX4's SITL does |
//! | `udp-listen:HOST:PORT` | receives from all peers and sends to those heard in the last minute |
//! | `serial:PATH:BAUD` | a serial port, opened exclusively |
//!
//! A TCP client or serial port whose connection is lost is opened again: one attempt per second.
//!
//! A datagram is one or more whole frames, since senders hand whole frames to [`ByteLink::send`]. A
//! stream (TCP, serial) may be split anywhere.

mod reconnect;
mod serial;
mod tcp;
mod transport;
mod udp;

use std::fmt;
use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::str::FromStr;
use std::time::Duration;

pub use self::transport::ByteLink;
use crate::quote::printable;

/// Longest wait for a TCP connection when a link is first opened.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Kind and address of a link.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum LinkUrl {
    /// TCP client of the server at HOST:PORT.
    Tcp(String),
    /// TCP server that listens on HOST:PORT.
    TcpListen(String),
    /// UDP socket with one peer, at HOST:PORT.
    Udp(String),
    /// UDP socket bound to HOST:PORT, for all peers that send to it.
    UdpListen(String),
    /// A serial port at a baud rate.
    Serial {
        /// Path of the device.
        path: String,
        /// Baud rate, bits per second.
        baud: u32,
    },
}

/// Error of parsing a link URL or opening its link. Displays as `WHAT: WHERE: WHY`.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The text is no link URL: the text, and why.
    #[error("bad link URL: {0}: {1}")]
    Url(String, &'static str),
    /// The link could not be opened.
    #[error("cannot open link: {}: {why}", printable(&url.to_string()))]
    Open {
        /// URL of the link.
        url: LinkUrl,
        /// Error of the operating system.
        why: io::Error,
    },
}

impl FromStr for LinkUrl {
    type Err = LinkError;

    fn from_str(text: &str) -> Result<Self, LinkError> {
        let bad = |why| LinkError::Url(printable(text), why);
        let (scheme, rest) = text
            .split_once(':')
            .ok_or_else(|| bad("expected tcp:, tcp-listen:, udp:, udp-listen: or serial:"))?;
        let (head, number) = rest
            .rsplit_once(':')
            .ok_or_else(|| bad("expected HOST:PORT, or PATH:BAUD for serial"))?;
        if head.is_empty() {
            return Err(bad("the host or path is empty"));
        }
        if scheme == "serial" {
            return match number.parse() {
                Ok(baud) if baud > 0 => Ok(Self::Serial { path: head.to_owned(), baud }),
                _ => Err(bad("the baud rate must be a positive whole number")),
            };
        }
        if number.parse::<u16>().is_err() {
            return Err(bad("the port must be a number from 0 to 65535"));
        }
        match scheme {
            "tcp" => Ok(Self::Tcp(rest.to_owned())),
            "tcp-listen" => Ok(Self::TcpListen(rest.to_owned())),
            "udp" => Ok(Self::Udp(rest.to_owned())),
            "udp-listen" => Ok(Self::UdpListen(rest.to_owned())),
            _ => Err(bad("expected tcp:, tcp-listen:, udp:, udp-listen: or serial:")),
        }
    }
}

impl fmt::Display for LinkUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(at) => write!(f, "tcp:{at}"),
            Self::TcpListen(at) => write!(f, "tcp-listen:{at}"),
            Self::Udp(at) => write!(f, "udp:{at}"),
            Self::UdpListen(at) => write!(f, "udp-listen:{at}"),
            Self::Serial { path, baud } => write!(f, "serial:{path}:{baud}"),
        }
    }
}

impl LinkUrl {
    /// Opens the link; a TCP client or serial port reconnects by itself later.
    ///
    /// # Errors
    /// The link cannot be opened: unknown host, port in use, no server listening. The error names
    /// the URL.
    pub fn open(&self) -> Result<Box<dyn ByteLink>, LinkError> {
        let link = self.open_once(CONNECT_TIMEOUT)?;
        Ok(match self {
            Self::Tcp(_) | Self::Serial { .. } => {
                let url = self.clone();
                let open = move || url.open_once(reconnect::RECONNECT_EVERY / 4).ok();
                Box::new(reconnect::ReconnectingLink::new(self.to_string(), link, Box::new(open)))
            }
            _ => link,
        })
    }

    /// For a link that listens, this URL with the address to which `link` is bound: it has the port
    /// that the system chose for port 0. For other kinds of links, this URL unchanged.
    pub fn with_bound_port(&self, link: &dyn ByteLink) -> Self {
        match (self, link.local_address()) {
            (Self::TcpListen(_), Some(at)) => Self::TcpListen(at.to_string()),
            (Self::UdpListen(_), Some(at)) => Self::UdpListen(at.to_string()),
            _ => self.clone(),
        }
    }

    /// Opens the link without reconnecting later; waits at most `timeout` for a TCP connection.
    fn open_once(&self, timeout: Duration) -> Result<Box<dyn ByteLink>, LinkError> {
        let failed = |why| LinkError::Open { url: self.clone(), why };
        match self {
            Self::Tcp(at) => Ok(Box::new(
                tcp::Client::connect(resolve(at).map_err(failed)?, timeout).map_err(failed)?,
            )),
            Self::TcpListen(at) => {
                Ok(Box::new(tcp::Server::bind(resolve(at).map_err(failed)?).map_err(failed)?))
            }
            Self::Udp(at) => {
                Ok(Box::new(udp::UdpPeer::new(resolve(at).map_err(failed)?).map_err(failed)?))
            }
            Self::UdpListen(at) => {
                Ok(Box::new(udp::UdpHub::bind(resolve(at).map_err(failed)?).map_err(failed)?))
            }
            Self::Serial { path, baud } => {
                Ok(Box::new(serial::OpenSerialPort::open(path, *baud).map_err(failed)?))
            }
        }
    }
}

/// The first address of a host and port.
fn resolve(at: &str) -> io::Result<SocketAddr> {
    at.to_socket_addrs()?
        .next()
        .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the host has no address"))
}

#[cfg(test)]
mod tests;
