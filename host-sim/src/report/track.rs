//! A point of a track, and what a picture taken there shows.

use planner_core::Point;

/// Where a vehicle was at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackPoint {
    /// Time, seconds.
    pub t_s: f32,
    /// True position, metres.
    pub position: Point,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// When it was taken, seconds.
    pub t_s: f32,
    /// Who took it; 0 for a flight before.
    pub vehicle: u8,
    /// Its corners in turn, metres east and north.
    pub corners: [[f32; 2]; 4],
}
