//! A burst: one request that is answered by several packets, each as if it had been requested
//! alone.

use super::packet::{FtpRequest, chunk_len};

/// Packets of one burst; after the last one the client requests the next burst.
pub const PACKETS_PER_BURST: u8 = 16;

/// A burst under way: the request, and offset and sequence number of its next packet.
#[derive(Clone, Copy, Debug)]
pub struct FtpBurst {
    /// The client's request for the burst.
    request: FtpRequest,
    /// Offset in the file of the next packet, bytes.
    offset: u32,
    /// FTP sequence number that a request for the next packet alone would have: that of the burst's
    /// request, plus one for each packet read so far.
    sequence: u16,
    /// Number of packets still to be sent.
    packets_left: u8,
}

impl FtpBurst {
    /// The burst that a request asks for, before its first packet.
    pub fn new(request: &FtpRequest) -> Self {
        Self {
            request: *request,
            offset: request.offset,
            sequence: request.sequence,
            packets_left: PACKETS_PER_BURST,
        }
    }

    /// The request that the client sent for the burst.
    pub fn first_request(&self) -> FtpRequest {
        self.request
    }

    /// The request that the client would have sent for the next packet alone.
    fn next_request(&self) -> FtpRequest {
        FtpRequest { sequence: self.sequence, offset: self.offset, ..self.request }
    }

    /// The burst after a packet with `len` bytes of data was read; `None` if that packet was its
    /// last.
    pub fn advanced_by(&self, len: usize) -> Option<Self> {
        let last = self.packets_left == 1 || len < chunk_len(&self.request);
        let (offset, sequence) = (self.offset + len as u32, self.sequence.wrapping_add(1));
        (!last).then_some(Self { offset, sequence, packets_left: self.packets_left - 1, ..*self })
    }
}

/// The request that the next packet answers: that of the burst's next packet if `request` started
/// the burst, else `request` itself.
pub fn request_of_next_packet(request: &FtpRequest, stream: Option<&FtpBurst>) -> FtpRequest {
    stream
        .filter(|stream| stream.request.is_same_request(request))
        .map_or(*request, FtpBurst::next_request)
}
