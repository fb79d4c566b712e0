//! A point of a track, and what a picture taken there shows.

use planner_core::Point;

/// Place of a vehicle at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackPoint {
    /// Time, seconds.
    pub t_s: f32,
    /// True position, metres.
    pub position: Point,
}

/// Footprint of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// When it was taken, seconds.
    pub t_s: f32,
    /// Vehicle that took the picture; 0 for a flight before.
    pub vehicle: u8,
    /// Corners of the footprint in turn, metres east and north.
    pub corners: [[f32; 2]; 4],
}
