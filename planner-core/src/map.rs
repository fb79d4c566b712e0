//! Maps, read in place: a grid of occupied cells, clear segments in it, and heights of the ground.

pub mod field;
pub mod segment;
pub mod voxel;
