//! What other vehicles know of this vehicle's way along its path: once no vehicle hears it, it
//! lands where they expect it, though gates may have let it fly further.

use crate::time::Instant;

/// Part of a vehicle's path that others know by the intents that they acknowledged, metres along
/// it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AcknowledgedPath {
    /// Place where the others surely heard the vehicle last; ∞ where they heard it nowhere on this
    /// path.
    pub from_m: f32,
    /// Place to which the points of the last acknowledged intent lead; −∞ where none was
    /// acknowledged.
    pub to_m: f32,
    /// When the path was begun: intents sent earlier are of another path.
    pub since: Instant,
}

impl AcknowledgedPath {
    /// For a path that begins now, of which others know nothing.
    pub const fn of_new_path(now: Instant) -> Self {
        Self { from_m: f32::INFINITY, to_m: f32::NEG_INFINITY, since: now }
    }
}
