//! Coordinate frames, and distances of segments.

pub(crate) mod distance;
pub mod frames;

pub use distance::{Length, Point};
