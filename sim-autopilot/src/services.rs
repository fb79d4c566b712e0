//! Protocols with stored state: missions, with the flight of an uploaded one, and parameters.

pub(crate) mod itinerary;
pub(crate) mod mission;
pub mod params;
