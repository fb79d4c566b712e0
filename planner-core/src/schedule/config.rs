//! Settings of a schedule, and why there is none.

use crate::{ConfigError, all_positive};

/// Tunables of the schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduleConfig {
    /// Distance kept between the paths of two vehicles that move: the safety distance and what both
    /// deviate from their paths, metres.
    pub separation_m: f32,
    /// Distance kept from a vehicle that stands on the ground, metres.
    pub parked_separation_m: f32,
    /// Nominal speed along paths, m/s.
    pub cruise_mps: f32,
    /// Nominal speed of take-off and landing, m/s.
    pub vertical_mps: f32,
}

impl ScheduleConfig {
    /// Whether all are positive and finite; the error names the first that is not.
    pub fn check(&self) -> Result<(), ConfigError> {
        all_positive(&[
            ("separation_m", self.separation_m),
            ("parked_separation_m", self.parked_separation_m),
            ("cruise_mps", self.cruise_mps),
            ("vertical_mps", self.vertical_mps),
        ])
    }
}

/// Reason why a schedule could not be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScheduleError {
    /// A flight has more than [`PIECES`](super::MAX_TIMED_SEGMENTS) timed segments.
    PiecesFull,
    /// A vehicle has more than `G` gates.
    GatesFull,
    /// No delay keeps this vehicle clear of those already scheduled.
    Blocked,
    /// A flight or a node with an index that there is none of.
    BadIndex,
}
