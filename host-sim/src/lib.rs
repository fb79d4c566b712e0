//! The desktop side of Flockmate: maps, planning, simulated autopilots and swarm simulation.
#![forbid(unsafe_code)]

pub mod area;
pub mod boards;
pub mod capacity;
pub mod commands;
pub mod coverage;
pub mod files;
pub mod flash;
pub mod flown;
pub mod link;
pub mod map;
pub mod margins;
pub mod mission;
pub mod output;
pub mod paper;
pub mod progress;
pub mod quote;
pub mod report;
pub mod result;
pub mod roadmap;
pub mod scenario;
pub mod shortage;
pub mod swarm;
pub mod terrain;
pub mod upload;
