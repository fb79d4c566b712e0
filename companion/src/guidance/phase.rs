//! The phases of a flight.

/// Phase of a flight; the phases follow in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Before the climb: no leg and no path moves the raw point.
    Hold,
    /// Straight up to the height of the path's start.
    Climb,
    /// Straight to the place on the path where the flight continues.
    Join,
    /// Along the path.
    Path,
    /// Straight down from the path's end, or in a guided landing.
    Descent,
}
