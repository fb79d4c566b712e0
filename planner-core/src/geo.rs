//! Coordinate frames, horizontal points, and distances of segments.

pub(crate) mod distance;
mod flat;
pub mod frames;

pub use distance::{Length, Point};
pub use flat::Flat;
