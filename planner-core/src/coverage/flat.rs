//! A place seen from above.

/// East, north, in metres.
pub type Flat = nalgebra::Vector2<f32>;
