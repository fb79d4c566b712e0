//! The time step of the simulation.

/// Time step of the simulation, seconds: one physics step of the simulated autopilot.
pub const STEP_S: f32 = 0.004;
/// Time step of the simulation, microseconds.
pub const STEP_US: u64 = 4_000;
