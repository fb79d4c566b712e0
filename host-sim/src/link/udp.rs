//! UDP links. Datagrams nobody takes are lost, as UDP has it.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use super::transport::{Link, is_would_block};

/// Silence after which a client gets nothing more.
const CLIENT_LIFETIME: Duration = Duration::from_secs(60);
/// Most clients of one hub; the one longest unheard makes room.
const MAX_CLIENTS: usize = 16;

fn transmit(socket: &UdpSocket, bytes: &[u8], to: SocketAddr) -> io::Result<()> {
    match socket.send_to(bytes, to) {
        Err(error) if !is_would_block(&error) => Err(error),
        _ => Ok(()),
    }
}

/// One peer, known from the start.
pub struct UdpPeer {
    socket: UdpSocket,
    peer: SocketAddr,
}

impl UdpPeer {
    /// Binds any free port, on the loopback for a peer there.
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

impl Link for UdpPeer {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.socket.recv_from(buffer) {
                Ok((len, from)) if from == self.peer => return Ok(len),
                Ok(_) => {}
                Err(error) if is_would_block(&error) => return Ok(0),
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

/// A bound socket and the peers that sent to it.
pub struct UdpHub {
    socket: UdpSocket,
    clients: Vec<(SocketAddr, Instant)>,
}

impl UdpHub {
    /// Binds.
    pub fn bind(at: SocketAddr) -> io::Result<Self> {
        let socket = UdpSocket::bind(at)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, clients: Vec::new() })
    }

    fn remember_peer(&mut self, from: SocketAddr) {
        let now = Instant::now();
        if let Some(client) = self.clients.iter_mut().find(|client| client.0 == from) {
            client.1 = now;
            return;
        }
        if self.clients.len() == MAX_CLIENTS {
            let oldest = (0..MAX_CLIENTS).min_by_key(|&k| self.clients[k].1).unwrap_or(0);
            self.clients.swap_remove(oldest);
        }
        self.clients.push((from, now));
    }
}

impl Link for UdpHub {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.socket.recv_from(buffer) {
            Ok((len, from)) => {
                self.remember_peer(from);
                Ok(len)
            }
            Err(error) if is_would_block(&error) => Ok(0),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.clients.retain(|client| client.1.elapsed() < CLIENT_LIFETIME);
        for &(to, _) in &self.clients {
            transmit(&self.socket, bytes, to)?;
        }
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.socket.local_addr().ok()
    }
}
