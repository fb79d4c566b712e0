//! Protocols with stored state: missions, with the flight of an uploaded one, and parameters.

pub(crate) mod mission;
pub(crate) mod mission_flight;
pub mod params;
