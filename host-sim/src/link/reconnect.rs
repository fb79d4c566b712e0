//! A link that is opened again after it was lost: a simulator that restarts, an adapter that is
//! plugged in again.

use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::transport::ByteLink;

/// Time between two attempts to open a lost link.
pub(super) const RECONNECT_EVERY: Duration = Duration::from_secs(1);

/// Tries to open the link; `None` if that fails now.
type OpenLink = Box<dyn Fn() -> Option<Box<dyn ByteLink>> + Send>;

/// A link that reconnects. While it is lost, it receives nothing and drops what is sent.
pub struct ReconnectingLink {
    /// URL of the link, for messages.
    name: String,
    /// Opens the link again.
    open: OpenLink,
    /// The open link; `None` while it is lost.
    link: Option<Box<dyn ByteLink>>,
    /// When the next attempt to open a lost link is due.
    retry_at: Instant,
}

impl ReconnectingLink {
    /// Wraps an open link; `open` opens it again after a loss.
    pub fn new(name: String, link: Box<dyn ByteLink>, open: OpenLink) -> Self {
        Self { name, open, link: Some(link), retry_at: Instant::now() }
    }

    /// The open link; if it is lost and an attempt is due, tries to open it first.
    fn reopen(&mut self) -> Option<&mut Box<dyn ByteLink>> {
        if self.link.is_none() && Instant::now() >= self.retry_at {
            self.link = (self.open)();
            self.retry_at = Instant::now() + RECONNECT_EVERY;
            if self.link.is_some() {
                eprintln!("link is back: {}", self.name);
            }
        }
        self.link.as_mut()
    }

    /// Reports that the link is lost, closes it, and makes the next attempt due in a second.
    fn handle_loss(&mut self, why: &io::Error) {
        eprintln!("link lost: {}: {why}; trying again every second", self.name);
        self.link = None;
        self.retry_at = Instant::now() + RECONNECT_EVERY;
    }
}

impl ByteLink for ReconnectingLink {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.reopen().map_or(Ok(0), |link| link.receive(buffer)) {
            Err(why) => {
                self.handle_loss(&why);
                Ok(0)
            }
            received => received,
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if let Err(why) = self.reopen().map_or(Ok(()), |link| link.send(bytes)) {
            self.handle_loss(&why);
        }
        Ok(())
    }

    fn local_address(&self) -> Option<SocketAddr> {
        self.link.as_ref().and_then(|link| link.local_address())
    }
}
