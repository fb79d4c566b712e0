//! The desk side of Flockmate: maps, planning, simulated autopilots and swarm simulation.
#![forbid(unsafe_code)]

pub mod autopilot;
pub mod capacity;
pub mod map;
pub mod prm;
pub mod report;
pub mod result;
