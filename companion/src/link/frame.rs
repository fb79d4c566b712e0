//! MAVLink framing: checked frames from received bytes, and bytes to send from messages.
//!
//! Source: MAVLink guide, "Packet Serialization" and "Message Signing". The `mavlink` crate gives
//! the message types and their CRC_EXTRA bytes. Framing is our own: the crate's reader drops a
//! frame of unknown id and then searches its payload for a start byte, and one false 0xFD there
//! holds back every frame behind it.
//!
//! One rule finds the frames of any stream. A candidate is a start byte with a plausible header
//! whose message id the dialect knows. Of candidates that overlap, the first one with a correct
//! checksum is the frame. A candidate with a wrong checksum costs only its start byte: the search
//! continues with the next byte. So no garbage hides a whole frame behind it. Bytes that no known
//! CRC covers are searched too: a frame of unknown id, and a signature, which is not verified. They
//! do not count as noise.
//!
//! An incomplete candidate holds back the bytes behind it for at most nine eighths of
//! [`PARTIAL_LIFETIME`] after its own first byte. Each byte costs O(1), after false start bytes
//! O(267).

mod encode;
mod received;

use heapless::Vec;
use mavlink::MavlinkVersion;

pub use self::encode::{Header, encode, encode_message, encode_raw, extra_crc};
use self::encode::{V2_START, calculate_crc};
pub use self::received::Frame;
use crate::time::{Duration, Instant};

/// The companion's component id, `MAV_COMP_ID_ONBOARD_COMPUTER`.
pub const COMPANION_COMPONENT: u8 = 191;
/// The autopilot's component id, `MAV_COMP_ID_AUTOPILOT1`.
pub const AUTOPILOT_COMPONENT: u8 = 1;
/// Time after its first byte was received at which an incomplete frame is dropped.
pub const PARTIAL_LIFETIME: Duration = Duration::from_millis(100);
/// Longest frame without its signature, bytes: 10 of header, 255 of payload, 2 of CRC.
pub const MAX_FRAME_LEN: usize = 267;

/// Start byte of a MAVLink 1 frame.
const V1_START: u8 = 0xFE;
/// Bit of a MAVLink 2 frame's `incompat_flags`: the frame has a signature.
const FLAG_SIGNED: u8 = 0x01;
/// Length of a signature, bytes.
const SIGNATURE_LEN: usize = 13;
/// Resolution of the times of arrival, microseconds: bytes received within one step count as
/// received with the last of them.
const ARRIVAL_STEP_US: u64 = PARTIAL_LIFETIME.as_micros() / 8;
/// Most different times of arrival in the buffer: the steps within [`PARTIAL_LIFETIME`], and two
/// more.
const MAX_ARRIVALS: usize = 10;

/// Counters of a [`Framer`] since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames returned by [`Framer::next`].
    pub frames: u32,
    /// Candidates with a wrong CRC; a false start byte in noise may count here too.
    pub bad_crc: u32,
    /// Candidates with an unknown message id; a false start byte in noise may count here too.
    pub unknown_id: u32,
    /// Incomplete frames dropped after [`PARTIAL_LIFETIME`].
    pub expired_partial: u32,
    /// Bytes that belong to no frame, of known or unknown id, and to no signature.
    pub noise_bytes: u32,
}

/// Time of arrival: the bytes before `until` in the buffer were received at `at` or earlier.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    /// Index in the buffer of the first byte that was received later.
    until: usize,
    /// Time by which the bytes were received.
    at: Instant,
}

/// Framer of one link's received bytes. At most 480 bytes, all zero when new, so that it may live
/// in .bss.
#[derive(Clone, Debug)]
pub struct Framer {
    /// Bytes received and not handled yet; in use are the first `len`.
    buf: [u8; MAX_FRAME_LEN],
    /// Number of bytes in the buffer.
    len: usize,
    /// Times of arrival of the bytes in the buffer, oldest first; the last one covers the whole
    /// buffer.
    arrivals: Vec<Arrival, MAX_ARRIVALS>,
    /// Number of the next bytes that belong to a frame of unknown id or to a signature, so that
    /// they are not noise.
    not_noise_len: usize,
    /// Counts of frames and faults since the framer was made.
    counters: Counters,
}

const _: () = assert!(size_of::<Framer>() <= 480);

/// Result of parsing the bytes at the front of the receive buffer.
enum ParseStatus {
    /// An incomplete candidate; it needs this many bytes in all for the next decision.
    NeedsBytes(usize),
    /// No frame begins at the first byte.
    FalseStart,
    /// A frame of this many bytes with a correct CRC, its signature not counted.
    ValidFrame(usize),
    /// A complete candidate of known id with a wrong CRC.
    BadCrc,
    /// A header with an unknown id; the frame would have this many bytes, its signature counted.
    Unknown(usize),
}

impl Default for Framer {
    fn default() -> Self {
        Self::new()
    }
}

impl Framer {
    /// A framer with an empty buffer.
    pub const fn new() -> Self {
        Self {
            buf: [0; MAX_FRAME_LEN],
            len: 0,
            arrivals: Vec::new(),
            not_noise_len: 0,
            counters: Counters {
                frames: 0,
                bad_crc: 0,
                unknown_id: 0,
                expired_partial: 0,
                noise_bytes: 0,
            },
        }
    }

    /// Counters of frames, errors and noise so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// When the incomplete frame at the front of the buffer expires; `None` if the buffer is empty.
    pub fn expires_at(&self) -> Option<Instant> {
        self.arrivals.first().map(|oldest| oldest.at + PARTIAL_LIFETIME)
    }

    /// The next frame. Takes bytes off the front of `input`, all received at `now`, until a frame
    /// is complete. `None` once `input` is empty; call it until then. A call with an empty `input`
    /// lets an incomplete frame expire.
    pub fn next(&mut self, now: Instant, input: &mut &[u8]) -> Option<Frame> {
        loop {
            let needed = match self.parse_front() {
                ParseStatus::ValidFrame(total) => return Some(self.take_frame(total)),
                ParseStatus::NeedsBytes(_) if self.expires_at().is_some_and(|due| now > due) => {
                    let counted = u32::from(self.not_noise_len == 0);
                    self.counters.expired_partial =
                        self.counters.expired_partial.wrapping_add(counted);
                    self.drop_false_start();
                    continue;
                }
                ParseStatus::NeedsBytes(needed) => needed,
                ParseStatus::Unknown(total) => {
                    if self.not_noise_len == 0 {
                        self.counters.unknown_id = self.counters.unknown_id.wrapping_add(1);
                        self.not_noise_len = total;
                    }
                    self.drop_false_start();
                    continue;
                }
                ParseStatus::BadCrc => {
                    let counted = u32::from(self.not_noise_len == 0);
                    self.counters.bad_crc = self.counters.bad_crc.wrapping_add(counted);
                    self.drop_false_start();
                    continue;
                }
                ParseStatus::FalseStart => {
                    self.drop_false_start();
                    continue;
                }
            };
            if input.is_empty() {
                return None;
            }
            if self.len == 0 {
                let noise = input.iter().position(|&b| is_start(b)).unwrap_or(input.len());
                self.count_noise(noise);
                *input = &input[noise..];
            }
            let count = input.len().min(needed - self.len);
            self.buf[self.len..self.len + count].copy_from_slice(&input[..count]);
            self.len += count;
            *input = &input[count..];
            if count > 0 {
                self.note_arrival(now);
            }
        }
    }

    /// What the bytes at the front of the buffer are.
    fn parse_front(&self) -> ParseStatus {
        let b = &self.buf[..self.len];
        let (header, crc_at, signature, id) = match b {
            [] | [V1_START | V2_START] => return ParseStatus::NeedsBytes(self.len + 1),
            [V1_START, len, ..] => {
                let id = b.get(5).map(|&id| u32::from(id));
                (6, 6 + usize::from(*len), 0, id)
            }
            [V2_START, _] => return ParseStatus::NeedsBytes(3),
            [V2_START, _, incompat, ..] if incompat & !FLAG_SIGNED != 0 => {
                return ParseStatus::FalseStart;
            }
            [V2_START, len, incompat, ..] => {
                let signature = if incompat & FLAG_SIGNED != 0 { SIGNATURE_LEN } else { 0 };
                let id = b.get(7..10).map(|id| u32::from_le_bytes([id[0], id[1], id[2], 0]));
                (10, 10 + usize::from(*len), signature, id)
            }
            _ => return ParseStatus::FalseStart,
        };
        let Some(id) = id else { return ParseStatus::NeedsBytes(header) };
        let total = crc_at + 2;
        let Some(extra) = extra_crc(id) else { return ParseStatus::Unknown(total + signature) };
        if self.len < total {
            return ParseStatus::NeedsBytes(total);
        }
        let crc = u16::from_le_bytes([b[crc_at], b[crc_at + 1]]);
        if calculate_crc(&b[1..crc_at], extra) == crc {
            ParseStatus::ValidFrame(total)
        } else {
            ParseStatus::BadCrc
        }
    }

    /// Removes the checked frame of `total` bytes at the front of the buffer, and returns it.
    fn take_frame(&mut self, total: usize) -> Frame {
        let b = &self.buf;
        let len = b[1];
        let (version, at, sequence, system, component, message_id) = if b[0] == V1_START {
            (MavlinkVersion::V1, 6, b[2], b[3], b[4], u32::from(b[5]))
        } else {
            (MavlinkVersion::V2, 10, b[4], b[5], b[6], u32::from_le_bytes([b[7], b[8], b[9], 0]))
        };
        let signed = version == MavlinkVersion::V2 && b[2] & FLAG_SIGNED != 0;
        let mut payload = [0; 255];
        payload[..usize::from(len)].copy_from_slice(&b[at..at + usize::from(len)]);
        self.counters.frames = self.counters.frames.wrapping_add(1);
        self.remove_front(total);
        self.not_noise_len = if signed { SIGNATURE_LEN } else { 0 };
        self.drop_to_start(0);
        Frame { version, sequence, system, component, message_id, signed, len, payload }
    }

    /// Drops the false start byte at the front, and the bytes behind it up to the next start byte.
    fn drop_false_start(&mut self) {
        self.drop_to_start(1);
    }

    /// Drops the bytes up to the next start byte that is at `from` or later.
    fn drop_to_start(&mut self, from: usize) {
        let rest = &self.buf[from..self.len];
        let next = from + rest.iter().position(|&b| is_start(b)).unwrap_or(rest.len());
        self.count_noise(next);
        self.remove_front(next);
    }

    /// Counts `count` dropped bytes as noise, without those that belong to a frame of unknown id or
    /// to a signature.
    fn count_noise(&mut self, count: usize) {
        let noise = count.saturating_sub(self.not_noise_len);
        self.not_noise_len = self.not_noise_len.saturating_sub(count);
        self.counters.noise_bytes = self.counters.noise_bytes.wrapping_add(noise as u32);
    }

    /// Removes the first `count` bytes from the buffer.
    fn remove_front(&mut self, count: usize) {
        self.buf.copy_within(count..self.len, 0);
        self.len -= count;
        self.arrivals.retain_mut(|arrival| {
            arrival.until = arrival.until.saturating_sub(count);
            arrival.until > 0
        });
    }

    /// Notes that the bytes up to the end of the buffer were received at `now`.
    fn note_arrival(&mut self, now: Instant) {
        let arrival = Arrival { until: self.len, at: now };
        let step = |at: Instant| at.as_micros() / ARRIVAL_STEP_US;
        if let Some(last) = self.arrivals.last_mut().filter(|last| step(last.at) == step(now)) {
            *last = arrival;
        } else if let Err(arrival) = self.arrivals.push(arrival)
            && let Some(last) = self.arrivals.last_mut()
        {
            *last = arrival;
        }
    }
}

/// Whether a frame may begin with this byte.
fn is_start(byte: u8) -> bool {
    byte == V1_START || byte == V2_START
}

#[cfg(test)]
mod tests;
