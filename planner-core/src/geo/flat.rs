//! Horizontal points.

/// A horizontal point or vector, metres: east and north in the mission frame, unless a comment
/// names the lane frame.
pub type Flat = nalgebra::Vector2<f32>;
