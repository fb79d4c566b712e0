//! The two ends of a route.

use crate::coverage::Flat;

/// First and last waypoint of a route, and the length of the path between them, metres.
pub(in crate::coverage) struct RouteEnds {
    pub(super) first: Flat,
    pub(super) last: Flat,
    pub(super) between_m: f32,
}
