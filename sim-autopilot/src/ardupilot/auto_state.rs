//! State of the mode AUTO.

use planner_core::Point;

use crate::services::mission_flight::MissionLeg;

/// State of the mode AUTO.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Auto {
    /// Whether the vehicle may take off (`auto_armed`).
    pub(super) may_lift: bool,
    /// Leg of the mission that is flown now.
    pub(super) leg: Option<MissionLeg>,
    /// Start of that leg, ENU metres.
    pub(super) leg_start: Point,
    /// Point at which the vehicle holds while no leg moves it, ENU metres.
    pub(super) hold_point: Option<Point>,
    /// Heading of the last leg, radians clockwise from north.
    pub(super) heading: Option<f32>,
}
