//! How many bytes a vehicle sends to the radio, which the whole swarm shares. The vehicle's state,
//! which keeps vehicles apart, is always sent. Everything else is sent only as far as
//! [`ARMED_EXTRA_BYTES_PER_S`] or [`DISARMED_EXTRA_BYTES_PER_S`] allow.
//!
//! State is sent at a fixed rate ([`state_bytes_per_s`]; in a coverage mission also
//! [`COVERAGE_STATE_BYTES_PER_S`]). Everything else (acks, texts, parameters, files, messages
//! requested by REQUEST_MESSAGE) takes tokens from a bucket that fills with time. So in any t
//! seconds the radio gets at most t times the sum of these rates, plus [`MAX_BURST_BYTES`], plus
//! one frame, whatever is requested.

use crate::link::frame::MAX_FRAME_LEN;
use crate::time::Instant;

/// Bytes a second that an armed vehicle may send beside its state; for 32 vehicles that adds a
/// quarter to their state.
pub const ARMED_EXTRA_BYTES_PER_S: u32 = 250;
/// Bytes a second that a disarmed vehicle may send beside its state, when an operator reads and
/// writes files; with the state of one vehicle this fills a radio of 57 600 baud.
pub const DISARMED_EXTRA_BYTES_PER_S: u32 = 4500;
/// Most bytes a second that a coverage mission of 32 vehicles adds to a vehicle's state, each with
/// its frame: five roster reports while dividing, of 145 and 85 bytes in turn, NAMED_VALUE_FLOAT,
/// and on the ground a report of photographed waypoints.
pub const COVERAGE_STATE_BYTES_PER_S: u32 = 5 * (145 + 85) / 2 + 30 + 141;
/// Capacity of the token bucket, bytes: a list of all parameters, or five texts.
pub const MAX_BURST_BYTES: u32 = 1000;
/// Bytes of a GLOBAL_POSITION_INT with its frame: the tokens that a requested message takes when it
/// is requested. AUTOPILOT_VERSION is longer, and takes its own length when it is sent.
pub(crate) const POSITION_BYTES: usize = 40;
/// Bytes of a GLOBAL_POSITION_INT and of the longest intent, each with its frame.
const STATE_BYTES: u32 = POSITION_BYTES as u32 + 145;
/// Bytes of a HEARTBEAT with its frame.
const HEARTBEAT_BYTES: u32 = 21;

/// Most bytes a second of one vehicle's state: position and intent `swarm_hz` times, and one
/// HEARTBEAT.
pub const fn state_bytes_per_s(swarm_hz: u8) -> u32 {
    STATE_BYTES * swarm_hz as u32 + HEARTBEAT_BYTES
}

/// The token bucket of the radio. Its tokens are millionths of a byte, so that a microsecond adds
/// some.
#[derive(Clone, Debug)]
pub(crate) struct RadioTokenBucket {
    /// Millionths of a byte; negative after a frame that took more than there were.
    tokens: i64,
    /// When `tokens` was last increased.
    filled_at: Instant,
}

/// Tokens for one byte.
const MICROBYTES_PER_BYTE: i64 = 1_000_000;

impl Default for RadioTokenBucket {
    fn default() -> Self {
        Self { tokens: i64::from(MAX_BURST_BYTES) * MICROBYTES_PER_BYTE, filled_at: Instant::ZERO }
    }
}

impl RadioTokenBucket {
    /// Fills the bucket up to `now`, by `bytes_per_s`, and returns whether another frame may be
    /// sent: whether any token is left. The frame may take more tokens than there are; the bucket
    /// is then negative.
    pub fn may_send(&mut self, now: Instant, bytes_per_s: u32) -> bool {
        let rate = i64::from(bytes_per_s);
        // An hour fills the bucket in any case; the cap keeps the product below from overflowing.
        let passed_us = (now - self.filled_at).as_micros().min(3_600_000_000) as i64;
        self.filled_at = now;
        self.tokens =
            (self.tokens + passed_us * rate).min(i64::from(MAX_BURST_BYTES) * MICROBYTES_PER_BYTE);
        self.tokens > 0
    }

    /// Whether the bucket is more than half full, as of the last call of [`Self::may_send`].
    pub(crate) fn is_half_full(&self) -> bool {
        self.tokens > i64::from(MAX_BURST_BYTES / 2) * MICROBYTES_PER_BYTE
    }

    /// Takes the tokens of a sent frame.
    pub fn take_tokens(&mut self, bytes: usize) {
        self.tokens -= bytes.min(MAX_FRAME_LEN) as i64 * MICROBYTES_PER_BYTE;
    }
}

#[cfg(test)]
mod tests;
