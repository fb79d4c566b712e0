//! What AUTO remembers.

use planner_core::Point;

use crate::itinerary::Leg;

/// What AUTO is about.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Auto {
    /// It may leave the ground (`auto_armed`).
    pub may_lift: bool,
    /// What it flies now.
    pub leg: Option<Leg>,
    /// Where that began.
    pub from: Point,
    /// Where it stays when nothing is asked for.
    pub stay: Option<Point>,
    /// Where it looks.
    pub heading: Option<f32>,
}
