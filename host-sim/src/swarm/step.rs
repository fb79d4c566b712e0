//! The step of the simulation.

/// Physics step, seconds; the autopilot's own.
pub const STEP_S: f32 = 0.004;
/// The same in microseconds.
pub const STEP_US: u64 = 4_000;
