//! What others know of a vehicle's way: it lands where they look for it, though gates may have led
//! it further.

use crate::time::Instant;

/// What others know of a vehicle's way, by what they acknowledge, metres along its path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct KnownWay {
    /// Place that they at least heard of; ∞ where they heard of none.
    pub from_m: f32,
    /// End of the points of the last intent that is known to have arrived; −∞ where none is.
    pub to_m: f32,
    /// When the path was begun: earlier intents were of another one.
    pub since: Instant,
}

impl KnownWay {
    /// They know nothing of a path that begins now.
    pub const fn of_new_path(now: Instant) -> Self {
        Self { from_m: f32::INFINITY, to_m: f32::NEG_INFINITY, since: now }
    }
}
