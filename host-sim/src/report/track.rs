//! A point of a track.

use planner_core::Point;

/// Where a vehicle was at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackPoint {
    /// Time, seconds.
    pub t_s: f32,
    /// True position, metres.
    pub position: Point,
}
