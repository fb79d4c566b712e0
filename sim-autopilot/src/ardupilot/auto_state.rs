//! What AUTO remembers.

use planner_core::Point;

use crate::itinerary::MissionLeg;

/// State of AUTO.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Auto {
    /// The vehicle may leave the ground (`auto_armed`).
    pub may_lift: bool,
    /// Leg that is flown now.
    pub leg: Option<MissionLeg>,
    /// Start of that leg.
    pub from: Point,
    /// Place where the vehicle stays without a commanded leg.
    pub stay: Option<Point>,
    /// Commanded heading.
    pub heading: Option<f32>,
}
