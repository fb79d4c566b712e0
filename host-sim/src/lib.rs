//! The desk side of Flockmate: maps, planning, simulated autopilots and swarm simulation.
#![forbid(unsafe_code)]

pub mod map;
pub mod scenario;
