//! What the autopilot is sent.

use planner_core::Point;

use crate::autopilot::telemetry::Telemetry;

/// Acceleration for each metre off the reference, 1/s²: PX4's cascade alone commands `MPC_XY_P`
/// 0.95 · `MPC_XY_VEL_P_ACC` 1.8; this makes the loop 2.8 times as stiff, and a gust carries the
/// vehicle less than half as far.
const HOLD_PER_S2: f32 = 3.0;
/// Acceleration for each m/s beside the reference's velocity, 1/s: keeps the stiffer loop damped
/// (ratio 0.76).
const DAMP_PER_S: f32 = 1.5;
/// Bound on the sum of both accelerations, m/s²: a position that jumps must not throw the vehicle
/// about.
const MAX_HOLD_MPS2: f32 = 1.5;

/// Setpoint for the autopilot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// No setpoint: the state streams none.
    None,
    /// Be there, with this velocity and acceleration: ENU metres, m/s, m/s². And look there,
    /// radians from east to the left, where the task says so.
    Move(Point, Point, Point, Option<f32>),
    /// Brake with this velocity, wherever that is: no position is known to refer to.
    Stop(Point),
}

/// Horizontal acceleration back to the reference, for an autopilot that adds it to what its own
/// loops ask for. Upwards its loops are stiff enough.
pub(super) fn position_correction(
    position: &Point,
    velocity: &Point,
    telemetry: &Telemetry,
) -> Point {
    let off = (position - telemetry.position) * HOLD_PER_S2
        + (velocity - telemetry.velocity) * DAMP_PER_S;
    let across = libm::hypotf(off.x, off.y);
    // A reported velocity near the largest number overflows: nothing is corrected by it.
    if !across.is_finite() {
        return Point::zeros();
    }
    let share = if across > MAX_HOLD_MPS2 { MAX_HOLD_MPS2 / across } else { 1.0 };
    Point::new(off.x * share, off.y * share, 0.0)
}
