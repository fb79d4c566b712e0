//! What outlasts a reset: the mission file, parameters and events in flash.

pub mod mission_file;
pub mod store;
