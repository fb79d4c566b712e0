//! How many bytes go to the swarm's radio, which all vehicles share: the state that keeps them
//! apart always goes out, what is asked for beside it only as far as [`ARMED_BYTES_PER_S`] or
//! [`DISARMED_BYTES_PER_S`] let it.
//!
//! State is made at a fixed rate ([`state_bytes_per_s`]). All else (acks, texts, parameters, files,
//! and what a REQUEST_MESSAGE asks for) spends from an account that fills with time. So in any span
//! of t seconds the radio gets at most t times both, and [`MAX_SAVED_BYTES`] and a frame more,
//! whatever is asked.

use crate::link::frame::MAX_FRAME_LEN;
use crate::time::Instant;

/// Bytes a second beside the vehicle's state while it is armed: 32 vehicles add a quarter to their
/// state.
pub const ARMED_BYTES_PER_S: u32 = 250;
/// Bytes a second beside the vehicle's state while it is disarmed, when a person reads and writes
/// files: with one vehicle's state it is a radio of 57 600 baud.
pub const DISARMED_BYTES_PER_S: u32 = 4500;
/// Most bytes that the token bucket saves up: a list of all parameters, or five texts.
pub const MAX_SAVED_BYTES: u32 = 1000;
/// Bytes of a position with its frame; no other message that is requested and made fresh is longer.
pub(crate) const POSITION_BYTES: usize = 40;
/// Bytes of a position and of the longest intent, each with its frame.
const STATE_BYTES: u32 = POSITION_BYTES as u32 + 145;
/// Bytes of a heartbeat with its frame.
const HEARTBEAT_BYTES: u32 = 21;

/// Most bytes a second of one vehicle's state, sent so many times a second.
pub const fn state_bytes_per_s(swarm_hz: u8) -> u32 {
    STATE_BYTES * swarm_hz as u32 + HEARTBEAT_BYTES
}

/// The account. In millionths of a byte, so that no time is too short to count.
#[derive(Clone, Debug)]
pub(crate) struct RateLimit {
    tokens: i64,
    at: Instant,
}

const MICROBYTES_PER_BYTE: i64 = 1_000_000;

impl Default for RateLimit {
    fn default() -> Self {
        Self { tokens: i64::from(MAX_SAVED_BYTES) * MICROBYTES_PER_BYTE, at: Instant::ZERO }
    }
}

impl RateLimit {
    /// Whether another frame may go out by now. It may be longer than what is left; then it is
    /// owed.
    pub fn may_send(&mut self, now: Instant, armed: bool) -> bool {
        let rate = i64::from(if armed { ARMED_BYTES_PER_S } else { DISARMED_BYTES_PER_S });
        // An hour fills it in any case.
        let passed_us = (now - self.at).as_micros().min(3_600_000_000) as i64;
        self.at = now;
        self.tokens =
            (self.tokens + passed_us * rate).min(i64::from(MAX_SAVED_BYTES) * MICROBYTES_PER_BYTE);
        self.tokens > 0
    }

    /// Whether half of what may be saved up is left, as of the last question whether a frame may go
    /// out.
    pub(crate) fn is_half_full(&self) -> bool {
        self.tokens > i64::from(MAX_SAVED_BYTES / 2) * MICROBYTES_PER_BYTE
    }

    /// Counts the bytes of a sent frame.
    pub fn count_bytes(&mut self, bytes: usize) {
        self.tokens -= bytes.min(MAX_FRAME_LEN) as i64 * MICROBYTES_PER_BYTE;
    }
}

#[cfg(test)]
mod tests;
