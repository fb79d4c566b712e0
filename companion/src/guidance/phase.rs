//! Parts of a flight, and how it goes from one to the next, back and on after an interruption.

/// Part of the flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Before the climb.
    Hold,
    /// Straight up to the height of the path's start.
    Climb,
    /// Straight to where the path continues.
    Join,
    /// Along the path.
    Path,
    /// Straight down from its end.
    Descent,
}
