//! UDP links. A datagram that no peer receives is lost without an error.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use super::transport::{ByteLink, is_transient};

/// A peer that has sent nothing for this long is sent nothing any more.
const PEER_TIMEOUT: Duration = Duration::from_secs(60);
/// Most peers of one hub; a further one replaces the peer that was heard longest ago.
const MAX_PEERS: usize = 16;

/// Sends a datagram; one that nobody can receive now is dropped without an error.
fn transmit(socket: &UdpSocket, bytes: &[u8], to: SocketAddr) -> io::Result<()> {
    match socket.send_to(bytes, to) {
        Err(error) if !is_transient(&error) => Err(error),
        _ => Ok(()),
    }
}

/// A UDP socket with one fixed peer; datagrams of other senders are dropped.
pub struct UdpPeer {
    socket: UdpSocket,
    /// Address of the peer.
    peer: SocketAddr,
}

impl UdpPeer {
    /// Binds any free port: of the loopback interface for a peer on this host, else of all
    /// interfaces.
    pub fn new(peer: SocketAddr) -> io::Result<Self> {
        let local: SocketAddr = match (peer, peer.ip().is_loopback()) {
            (SocketAddr::V4(_), true) => (Ipv4Addr::LOCALHOST, 0).into(),
            (SocketAddr::V4(_), false) => (Ipv4Addr::UNSPECIFIED, 0).into(),
            (SocketAddr::V6(_), true) => (Ipv6Addr::LOCALHOST, 0).into(),
            (SocketAddr::V6(_), false) => (Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let socket = UdpSocket::bind(local)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, peer })
    }
}

impl ByteLink for UdpPeer {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.socket.recv_from(buffer) {
                Ok((len, from)) if from == self.peer => return Ok(len),
                Ok(_) => {}
                Err(error) if is_transient(&error) => return Ok(0),
                Err(error) => return Err(error),
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        transmit(&self.socket, bytes, self.peer)
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.socket.local_addr().ok()
    }
}

/// A bound UDP socket that sends to every peer from which it has received lately.
pub struct UdpHub {
    socket: UdpSocket,
    /// Each peer, and when it was last heard.
    clients: Vec<(SocketAddr, Instant)>,
}

impl UdpHub {
    /// Binds an address.
    pub fn bind(at: SocketAddr) -> io::Result<Self> {
        let socket = UdpSocket::bind(at)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, clients: Vec::new() })
    }

    /// Notes that this peer was heard now.
    fn remember_peer(&mut self, from: SocketAddr) {
        let now = Instant::now();
        if let Some(client) = self.clients.iter_mut().find(|client| client.0 == from) {
            client.1 = now;
            return;
        }
        if self.clients.len() == MAX_PEERS {
            let oldest = (0..MAX_PEERS).min_by_key(|&k| self.clients[k].1).unwrap_or(0);
            self.clients.swap_remove(oldest);
        }
        self.clients.push((from, now));
    }
}

impl ByteLink for UdpHub {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.socket.recv_from(buffer) {
            Ok((len, from)) => {
                self.remember_peer(from);
                Ok(len)
            }
            Err(error) if is_transient(&error) => Ok(0),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.clients.retain(|client| client.1.elapsed() < PEER_TIMEOUT);
        for &(to, _) in &self.clients {
            transmit(&self.socket, bytes, to)?;
        }
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.socket.local_addr().ok()
    }
}
