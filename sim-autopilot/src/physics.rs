//! The vehicle and its surroundings: motion, sensors and estimate, the autopilots' projections.

pub mod estimator;
pub mod geodesy;
pub mod noise;
pub(crate) mod shaping;
pub mod vehicle;
