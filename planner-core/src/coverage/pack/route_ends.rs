//! The two ends of a route.

use crate::coverage::Flat;

/// The waypoints of a route with the lowest (`first`) and the highest number (`last`), east and
/// north, and the length of the path between them, metres.
pub(in crate::coverage) struct RouteEnds {
    pub(super) first: Flat,
    pub(super) last: Flat,
    pub(super) between_m: f32,
}
