//! A burst: one request that is answered by packets, each as if it had been asked for by itself.

use super::packet::{Request, chunk_len};

/// Packets of one burst; after it the client requests the next burst.
pub const PACKETS_PER_BURST: u8 = 16;

/// A burst that has begun.
#[derive(Clone, Copy, Debug)]
pub struct FtpBurst {
    request: Request,
    offset: u32,
    sequence: u16,
    packets_left: u8,
}

impl FtpBurst {
    /// A burst before its first packet.
    pub fn new(request: &Request) -> Self {
        Self {
            request: *request,
            offset: request.offset,
            sequence: request.sequence,
            packets_left: PACKETS_PER_BURST,
        }
    }

    /// The request that started the burst.
    pub fn first_request(&self) -> Request {
        self.request
    }

    /// The request that its next packet answers.
    fn next_request(&self) -> Request {
        Request { sequence: self.sequence, offset: self.offset, ..self.request }
    }

    /// The burst after a packet of `len` data bytes; `None` where that packet was the last.
    pub fn advanced_by(&self, len: usize) -> Option<Self> {
        let last = self.packets_left == 1 || len < chunk_len(&self.request);
        let (offset, sequence) = (self.offset + len as u32, self.sequence.wrapping_add(1));
        (!last).then_some(Self { offset, sequence, packets_left: self.packets_left - 1, ..*self })
    }
}

/// A request of one packet, or that of the next packet of the burst which it asked for.
pub fn next_request(request: &Request, stream: Option<&FtpBurst>) -> Request {
    stream
        .filter(|stream| stream.request.is_same_request(request))
        .map_or(*request, FtpBurst::next_request)
}
