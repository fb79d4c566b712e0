//! Horizontal motion of PX4's automatic modes: stopping and approaching a point
//! (`PositionSmoothing`, `Navigator::preproject_stop_point`).

use planner_core::Point;

use crate::physics::shaping::JerkLimitedRate;

/// Horizontal acceleration of the automatic modes, m/s² (`MPC_ACC_HOR`).
const AUTO_ACCEL_MPS2: f32 = 3.0;
/// Time, seconds: PX4 adds to the braking distance what the vehicle flies in this time at its speed
/// before braking.
const BRAKING_DELAY_S: f32 = 0.6;
/// Longest time step that is simulated, seconds, if the mode was not updated for longer.
const MAX_STEP_S: f32 = 0.1;

/// Horizontal offset from the vehicle to the point at which PX4 stops it, metres, from its velocity
/// (m/s). With 1.85 m/s recorded vehicles moved 0.9 m in the first second and 1.1 to 1.7 m in all.
pub fn stopping_offset(velocity: &Point) -> Point {
    let speed = libm::hypotf(velocity.x, velocity.y);
    Point::new(velocity.x, velocity.y, 0.0) * (speed / (2.0 * AUTO_ACCEL_MPS2) + BRAKING_DELAY_S)
}

/// A setpoint that moves horizontally to a target: it starts with the vehicle's position and
/// velocity and keeps the automatic modes' limits.
#[derive(Clone, Copy, Debug)]
pub struct SmoothedApproach {
    /// Time of the last update, microseconds since boot.
    updated_us: u64,
    /// Position, ENU metres; its height is not used.
    pub position: Point,
    /// Velocity and acceleration east and north.
    pub ramps: [JerkLimitedRate; 2],
}

impl SmoothedApproach {
    /// A setpoint that starts at `position` with `velocity`.
    pub fn new(now_us: u64, position: &Point, velocity: &Point) -> Self {
        let ramp = |rate| JerkLimitedRate { rate, derivative: 0.0 };
        Self {
            updated_us: now_us,
            position: *position,
            ramps: [ramp(velocity.x), ramp(velocity.y)],
        }
    }

    /// Moves the setpoint towards `target` until `now_us`, with at most `speed_max` m/s and `jerk`
    /// m/s³.
    pub fn advance(&mut self, now_us: u64, target: &Point, speed_max: f32, jerk: f32) {
        let since_us = now_us.saturating_sub(core::mem::replace(&mut self.updated_us, now_us));
        let dt = (since_us as f32 * 1e-6).min(MAX_STEP_S);
        let off = [target.x - self.position.x, target.y - self.position.y];
        let away = libm::hypotf(off[0], off[1]);
        // `computeMaxSpeedFromDistance`: the speed from which it can brake over `away`, with a
        // delay that the jerk limit causes.
        let delay = 4.0 * AUTO_ACCEL_MPS2 * AUTO_ACCEL_MPS2 / jerk;
        let from_stop = libm::sqrtf(delay * delay + 8.0 * AUTO_ACCEL_MPS2 * away);
        let speed = (0.5 * (from_stop - delay)).min(speed_max);
        for (axis, ramp) in self.ramps.iter_mut().enumerate() {
            ramp.advance(off[axis] / away.max(1e-3) * speed, AUTO_ACCEL_MPS2, jerk, dt);
            self.position[axis] += ramp.rate * dt;
        }
    }
}

#[cfg(test)]
mod tests;
