//! The step of the simulation.

/// Physics step, seconds; the autopilot's own step.
pub const STEP_S: f32 = 0.004;
/// Physics step, microseconds.
pub const STEP_US: u64 = 4_000;
