//! The two ends of a route.

use crate::coverage::Flat;

/// The waypoints of a route with the lowest and the highest number, east and north,
/// and the length of the path between them, metres.
pub(in crate::coverage) struct RouteEnds {
    pub(super) lowest: Flat,
    pub(super) highest: Flat,
    pub(super) between_m: f32,
}
