//! MAVLink framing: bytes in, checked frames out, and messages back into bytes.
//!
//! Source: MAVLink guide, "Packet Serialization" and "Message Signing". The `mavlink` crate gives the message types and
//! their CRC seeds; framing is ours, because its reader drops unknown ids and then searches their payload for a start
//! byte: one false 0xFD there holds back every frame behind it.
//!
//! A frame whose id the dialect does not know cannot be checked. It is skipped whole, by its length, when the byte
//! after it is a start byte (or nothing follows within [`PARTIAL_LIFETIME`]); if another byte follows, the start was
//! false and the search goes on one byte later. The same search follows a bad CRC, over bytes that are all still in
//! the buffer, so no good frame behind a bad one is lost. Each byte costs O(1), and O(280) where starts are false.

use crc::{CRC_16_MCRF4XX, Crc, Table};
use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MavlinkVersion, Message, MessageData};

use crate::time::{Duration, Instant};

/// A frame not complete this long after its first byte is given up.
pub const PARTIAL_LIFETIME: Duration = Duration::from_millis(100);
/// The longest frame: 10 bytes of header, 255 of payload, 2 of CRC, 13 of signature.
pub const MAX_FRAME: usize = 280;
/// The longest frame we send: no signature.
pub const MAX_SENT: usize = 267;

const V1_START: u8 = 0xFE;
const V2_START: u8 = 0xFD;
/// A deprecated message; the only one whose CRC seed is 0.
const COMPONENT_INFORMATION: u32 = 395;
const SIGNED: u8 = 0x01;
const SIGNATURE_LEN: usize = 13;
/// One byte more than a frame, to see what follows an unknown one.
const BUFFER: usize = MAX_FRAME + 1;

/// A frame whose CRC is right.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Wire version.
    pub version: MavlinkVersion,
    /// Sequence number of the sender's link.
    pub sequence: u8,
    /// System id of the sender.
    pub system: u8,
    /// Component id of the sender.
    pub component: u8,
    /// Message id.
    pub message_id: u32,
    /// Whether a signature followed; it is not checked.
    pub signed: bool,
    len: u8,
    payload: [u8; 255],
}

impl Frame {
    /// The payload as received: V2 senders cut trailing zeros.
    pub fn payload(&self) -> &[u8] {
        &self.payload[..usize::from(self.len)]
    }

    /// The payload with the zeros that were cut put back, at any length up to 255.
    pub fn padded(&self) -> &[u8; 255] {
        &self.payload
    }

    /// Writes it as a V2 frame with the sender and sequence number it came with, to pass it on; the bytes written, or 0 where
    /// `out` is too small. A signature is left out.
    pub fn encode(&self, out: &mut [u8]) -> usize {
        let Some(extra) = extra_crc(self.message_id) else { return 0 };
        let header = Header { system: self.system, component: self.component, sequence: self.sequence };
        encode_raw(header, self.message_id, extra, self.payload(), out)
    }

    /// The message, if the frame is one of type `M` and its enum values are known to the crate.
    pub fn decode<M: MessageData>(&self) -> Option<M> {
        if self.message_id != M::ID {
            return None;
        }
        M::deser(self.version, self.payload()).ok()
    }
}

/// What passed through a [`Framer`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames given out.
    pub frames: u32,
    /// Frames of a known id whose CRC was wrong; a false start byte in noise may count here too.
    pub bad_crc: u32,
    /// Frames of unknown id, skipped.
    pub unknown: u32,
    /// Partial frames given up after [`PARTIAL_LIFETIME`].
    pub expired: u32,
    /// Bytes that belonged to no frame.
    pub noise_bytes: u32,
}

/// The decoder of one link. 296 bytes; all zero when new, so it may live in .bss.
#[derive(Clone, Debug)]
pub struct Framer {
    buf: [u8; BUFFER],
    len: usize,
    since: Instant,
    last_byte: Instant,
    counters: Counters,
}

/// What the bytes at the front of the buffer are.
enum Front {
    /// Too few bytes to tell; this many are needed in all.
    Needs(usize),
    /// Not a frame.
    False,
    /// A checked frame of this many bytes.
    Good(usize),
    /// Whole, of known id, wrong CRC.
    BadCrc,
    /// Whole, of unknown id and this many bytes.
    Unknown(usize),
}

impl Default for Framer {
    fn default() -> Self {
        Self::new()
    }
}

impl Framer {
    /// An empty decoder.
    pub const fn new() -> Self {
        Self {
            buf: [0; BUFFER],
            len: 0,
            since: Instant::ZERO,
            last_byte: Instant::ZERO,
            counters: Counters { frames: 0, bad_crc: 0, unknown: 0, expired: 0, noise_bytes: 0 },
        }
    }

    /// What passed so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// When the partial frame held now expires, if one is held.
    pub fn expires_at(&self) -> Option<Instant> {
        (self.len > 0).then(|| self.since + PARTIAL_LIFETIME)
    }

    /// The next frame. Takes bytes off the front of `input` (all received at `now`) until a frame is whole or `input`
    /// is empty; call until `None`. With an empty `input` it lets a partial frame expire.
    pub fn next(&mut self, now: Instant, input: &mut &[u8]) -> Option<Frame> {
        while let Some(due) = self.expires_at() {
            if now <= due {
                break;
            }
            if let Front::Good(total) = self.front() {
                return Some(self.take(total, now));
            }
            if let Front::Unknown(total) = self.front() {
                self.skip_unknown(total);
            } else {
                self.counters.expired += 1;
                self.drop_start();
            }
            self.since = self.last_byte;
        }
        loop {
            let needed = match self.front() {
                Front::Good(total) => return Some(self.take(total, now)),
                Front::Needs(needed) => needed,
                Front::Unknown(total) if self.len == total => total + 1,
                Front::Unknown(total) if is_start(self.buf[total]) => {
                    self.skip_unknown(total);
                    self.since = now;
                    continue;
                }
                Front::BadCrc => {
                    self.counters.bad_crc = self.counters.bad_crc.wrapping_add(1);
                    self.drop_start();
                    continue;
                }
                Front::False | Front::Unknown(_) => {
                    self.drop_start();
                    continue;
                }
            };
            if input.is_empty() {
                return None;
            }
            if self.len == 0 {
                let noise = input.iter().position(|&b| is_start(b)).unwrap_or(input.len());
                self.counters.noise_bytes = self.counters.noise_bytes.wrapping_add(noise as u32);
                *input = &input[noise..];
                self.since = now;
            }
            let count = input.len().min(needed - self.len);
            self.buf[self.len..self.len + count].copy_from_slice(&input[..count]);
            self.len += count;
            *input = &input[count..];
            self.last_byte = now;
        }
    }

    fn front(&self) -> Front {
        let b = &self.buf[..self.len];
        let (header, crc_at, total, id) = match b {
            [] | [V1_START | V2_START] => return Front::Needs(self.len + 1),
            [V1_START, len, ..] => {
                let crc_at = 6 + usize::from(*len);
                let id = b.get(5).map(|&id| u32::from(id));
                (6, crc_at, crc_at + 2, id)
            }
            [V2_START, _] => return Front::Needs(3),
            [V2_START, _, incompat, ..] if incompat & !SIGNED != 0 => return Front::False,
            [V2_START, len, incompat, ..] => {
                let crc_at = 10 + usize::from(*len);
                let signature = if incompat & SIGNED != 0 { SIGNATURE_LEN } else { 0 };
                let id = b.get(7..10).map(|id| u32::from_le_bytes([id[0], id[1], id[2], 0]));
                (10, crc_at, crc_at + 2 + signature, id)
            }
            _ => return Front::False,
        };
        let Some(id) = id else { return Front::Needs(header) };
        if self.len < total {
            return Front::Needs(total);
        }
        let Some(extra) = extra_crc(id) else { return Front::Unknown(total) };
        let crc = u16::from_le_bytes([b[crc_at], b[crc_at + 1]]);
        if calculate_crc(&b[1..crc_at], extra) == crc { Front::Good(total) } else { Front::BadCrc }
    }

    /// Copies the good frame at the front out and removes it.
    fn take(&mut self, total: usize, now: Instant) -> Frame {
        let b = &self.buf;
        let len = b[1];
        let (version, at, sequence, system, component, message_id) = if b[0] == V1_START {
            (MavlinkVersion::V1, 6, b[2], b[3], b[4], u32::from(b[5]))
        } else {
            (MavlinkVersion::V2, 10, b[4], b[5], b[6], u32::from_le_bytes([b[7], b[8], b[9], 0]))
        };
        let signed = version == MavlinkVersion::V2 && b[2] & SIGNED != 0;
        let mut payload = [0; 255];
        payload[..usize::from(len)].copy_from_slice(&b[at..at + usize::from(len)]);
        self.counters.frames = self.counters.frames.wrapping_add(1);
        self.remove(total);
        self.since = now;
        Frame { version, sequence, system, component, message_id, signed, len, payload }
    }

    fn skip_unknown(&mut self, total: usize) {
        self.counters.unknown = self.counters.unknown.wrapping_add(1);
        self.remove(total);
    }

    /// Drops a false start byte and everything up to the next start byte in the buffer.
    fn drop_start(&mut self) {
        let rest = &self.buf[1..self.len];
        let next = 1 + rest.iter().position(|&b| is_start(b)).unwrap_or(rest.len());
        self.counters.noise_bytes = self.counters.noise_bytes.wrapping_add(next as u32);
        self.remove(next);
    }

    fn remove(&mut self, count: usize) {
        self.buf.copy_within(count..self.len, 0);
        self.len -= count;
    }
}

fn is_start(byte: u8) -> bool {
    byte == V1_START || byte == V2_START
}

/// The X.25 checksum of MAVLink over a frame without its start byte, closed by the seed of its message. By table, 16 bytes at
/// a time (8 kB): checking is most of what a crowded radio costs, and the `mavlink` crate goes byte by byte.
fn calculate_crc(frame: &[u8], extra_crc: u8) -> u16 {
    const CRC: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_MCRF4XX);
    let mut digest = CRC.digest();
    digest.update(frame);
    digest.update(&[extra_crc]);
    digest.finalize()
}

/// The CRC seed of a message id, or `None` where the dialect does not know the id. The crate answers 0 for those, which
/// is also the true seed of COMPONENT_INFORMATION.
pub fn extra_crc(message_id: u32) -> Option<u8> {
    let extra = MavMessage::extra_crc(message_id);
    (extra != 0 || message_id == COMPONENT_INFORMATION).then_some(extra)
}

/// Who sends a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// System id of the sender.
    pub system: u8,
    /// Component id of the sender.
    pub component: u8,
    /// Sequence number of the link.
    pub sequence: u8,
}

/// Writes one message as a V2 frame, trailing zeros cut; the bytes written, or 0 where `out` is too small
/// ([`MAX_SENT`] is always enough).
pub fn encode<M: MessageData>(header: Header, message: &M, out: &mut [u8]) -> usize {
    let mut payload = [0; 255];
    let len = message.ser(MavlinkVersion::V2, &mut payload);
    encode_raw(header, M::ID, M::EXTRA_CRC, &payload[..len], out)
}

/// As [`encode`], for a message of the whole dialect. Pulls in every message's encoder: not for the board.
pub fn encode_message(header: Header, message: &MavMessage, out: &mut [u8]) -> usize {
    let mut payload = [0; 255];
    let len = message.ser(MavlinkVersion::V2, &mut payload);
    let id = message.message_id();
    encode_raw(header, id, MavMessage::extra_crc(id), &payload[..len], out)
}

/// As [`encode`], for a payload laid out by the caller: what the crate's enums cannot hold (TUNNEL with a private
/// payload type). `payload` is at most 255 bytes; its trailing zeros are cut.
pub fn encode_raw(header: Header, message_id: u32, extra_crc: u8, payload: &[u8], out: &mut [u8]) -> usize {
    let used = payload.iter().rposition(|&b| b != 0).map_or(1, |last| last + 1).min(payload.len());
    let total = 12 + used;
    if used > 255 || out.len() < total {
        return 0;
    }
    let id = message_id.to_le_bytes();
    let Header { system, component, sequence } = header;
    out[..10]
        .copy_from_slice(&[V2_START, used as u8, 0, 0, sequence, system, component, id[0], id[1], id[2]]);
    out[10..10 + used].copy_from_slice(&payload[..used]);
    let crc = calculate_crc(&out[1..10 + used], extra_crc);
    out[10 + used..total].copy_from_slice(&crc.to_le_bytes());
    total
}

#[cfg(test)]
#[path = "frame_tests.rs"]
mod tests;
