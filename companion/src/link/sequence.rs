//! Drops frames that repeat or come late, by MAVLink's sequence number.

use crate::time::{Duration, Instant};

/// Gap between two frames after which any sequence number is accepted.
const SEQUENCE_LIFETIME: Duration = Duration::from_millis(1000);

/// Drops MAVLink frames that repeat or come late: up to 63 numbers behind the last accepted frame,
/// for 1 s after it.
#[derive(Clone, Copy, Debug, Default)]
pub struct SequenceFilter {
    /// Sequence number of the last accepted frame, and when it was received. `None` before the
    /// first.
    last: Option<(u8, Instant)>,
}

impl SequenceFilter {
    /// Whether the frame is new; if so, stores its sequence number as the last.
    pub fn accept_if_new(&mut self, sequence: u8, now: Instant) -> bool {
        if let Some((last, at)) = self.last {
            let behind = last.wrapping_sub(sequence);
            if behind < 64 && now - at < SEQUENCE_LIFETIME {
                return false;
            }
        }
        self.last = Some((sequence, now));
        true
    }
}
