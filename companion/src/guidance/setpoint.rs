//! The setpoint for the autopilot, and the acceleration that holds the vehicle on it.

use planner_core::Point;

use crate::autopilot::telemetry::Telemetry;

/// Acceleration for each metre between vehicle and setpoint, 1/s²: PX4's cascade alone commands
/// `MPC_XY_P` 0.95 · `MPC_XY_VEL_P_ACC` 1.8; this makes the loop 2.8 times as stiff, and a gust
/// carries the vehicle less than half as far.
const POSITION_GAIN_PER_S2: f32 = 3.0;
/// Acceleration for each m/s between the velocities of vehicle and setpoint, 1/s: keeps the stiffer
/// loop damped (ratio 0.76).
const VELOCITY_GAIN_PER_S: f32 = 1.5;
/// Bound on the sum of both accelerations, m/s²: a position estimate that jumps must not throw the
/// vehicle about.
const MAX_CORRECTION_MPS2: f32 = 1.5;

/// Setpoint for the autopilot, in ENU of the mission frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// No setpoint is sent in this state.
    None,
    /// Position, velocity and acceleration, metres, m/s, m/s²; and the heading, radians
    /// counter-clockwise from east, where the task sets one.
    Move(Point, Point, Point, Option<f32>),
    /// A velocity alone, to brake with: the position is unknown.
    Stop(Point),
}

/// Horizontal acceleration from the vehicle towards the setpoint, for an autopilot that adds it to
/// what its own loops command. Vertically its own loops are stiff enough: 0.
pub(super) fn correction_acceleration(
    position: &Point,
    velocity: &Point,
    telemetry: &Telemetry,
) -> Point {
    let off = (position - telemetry.position) * POSITION_GAIN_PER_S2
        + (velocity - telemetry.velocity) * VELOCITY_GAIN_PER_S;
    let across = libm::hypotf(off.x, off.y);
    // A reported velocity near the greatest f32 overflows: then there is no correction.
    if !across.is_finite() {
        return Point::zeros();
    }
    let share = if across > MAX_CORRECTION_MPS2 { MAX_CORRECTION_MPS2 / across } else { 1.0 };
    Point::new(off.x * share, off.y * share, 0.0)
}
