//! A whole swarm on the desk: companions and simulated autopilots joined by emulated serial links and a radio.

pub mod radio;
pub mod serial;
