//! Settings of a schedule, and reasons why none can be made.

use crate::{SettingError, check_positive};

/// Separations and nominal speeds of a schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduleConfig {
    /// Distance that the centres of two moving vehicles keep, metres: the safety distance plus the
    /// deviations of both from their paths.
    pub separation_m: f32,
    /// Distance that a vehicle's centre keeps from that of one that stands on the ground, metres.
    pub parked_separation_m: f32,
    /// Nominal speed along the path, m/s.
    pub cruise_mps: f32,
    /// Nominal speed of climb and descent, m/s.
    pub vertical_mps: f32,
}

impl ScheduleConfig {
    /// Checks that all numbers are positive and finite; the error names the first that is not.
    pub fn check(&self) -> Result<(), SettingError> {
        check_positive(&[
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
    /// A flight has more timed segments than [`MAX_TIMED_SEGMENTS`](super::MAX_TIMED_SEGMENTS), or
    /// all flights more than the workspace holds; or the roadmap has more nodes, or the path more
    /// waypoints, than there is room for.
    SegmentsFull,
    /// A vehicle has more than `G` gates, even merged.
    GatesFull,
    /// At every take-off time this vehicle is in conflict with those already scheduled; or
    /// [`sipp`](super::sipp) found no route without conflict.
    Blocked,
    /// A flight or a node with this index does not exist.
    BadIndex,
}
