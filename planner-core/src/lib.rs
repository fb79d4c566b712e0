//! Planning for a swarm of UAVs: maths over borrowed memory.
//!
//! No allocation, no I/O, no clock, no protocol. Lengths are metres, times seconds, angles degrees where a name says
//! `_deg` and radians otherwise. Points are ENU (east, north, up) in the mission frame.
#![no_std]
#![forbid(unsafe_code)]

pub mod assignment;
pub mod coverage;
pub mod deconflict;
pub mod detour;
pub mod file;
pub mod frames;
pub mod path;
pub mod plan;
pub mod prm;
pub mod roadmap;
pub mod safety;
pub mod schedule;
pub mod search;
pub mod segment;
pub mod voxel;

/// A point or vector in the mission frame: east, north, up, in metres.
pub type Point = nalgebra::Vector3<f32>;

/// A setting that is not what it may be: its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConfigError(pub &'static str);

/// Refuses the first of these settings that is not a positive, finite number.
pub(crate) fn all_positive(settings: &[(&'static str, f32)]) -> Result<(), ConfigError> {
    match settings.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
        Some((name, _)) => Err(ConfigError(name)),
        None => Ok(()),
    }
}
