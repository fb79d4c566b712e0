//! A point of a flown track, and the footprint of a picture on the ground.

use planner_core::Point;

/// True position of a vehicle at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackPoint {
    /// Time, seconds.
    pub t_s: f32,
    /// True position, metres.
    pub position: Point,
}

/// The rectangle on the ground that a picture is counted to show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureFootprint {
    /// When the picture was taken, seconds.
    pub t_s: f32,
    /// Vehicle that took the picture; 0 for a picture of an earlier flight.
    pub vehicle: u8,
    /// Corners of the rectangle in order around it, metres east and north.
    pub corners: [[f32; 2]; 4],
}
