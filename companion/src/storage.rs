//! What flash keeps over a reset: roadmaps, the mission file, parameters and photographed
//! waypoints.

pub mod mission_file;
pub mod store;
