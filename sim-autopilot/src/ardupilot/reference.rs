//! The reference that the position controller tracks: a point that moves to the mode's goal within
//! limits of speed, acceleration and jerk, as by ArduPilot's `shape_pos_vel_accel`
//! (`AP_Math/control.cpp`).
//!
//! It does not depend on the vehicle's position: a new goal is approached smoothly, and a velocity
//! that is no longer demanded is reduced smoothly.

use planner_core::Point;

use super::params::CopterTuning;
use super::setpoint::GuidedGoal;
use crate::physics::shaping::approach_rate;

/// Fraction of the acceleration limit that corrections of the position may use.
const CORRECTION_ACCEL_SHARE: f32 = 0.5;

/// Position, velocity and acceleration of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CopterReference {
    /// Position, ENU metres.
    pub position: Point,
    /// Velocity, ENU m/s.
    pub velocity: Point,
    /// Acceleration, ENU m/s².
    pub acceleration: Point,
}

impl CopterReference {
    /// A reference at this position with this velocity, without acceleration.
    pub fn new(position: Point, velocity: Point) -> Self {
        Self { position, velocity, acceleration: Point::zeros() }
    }

    /// Moves the reference for one step of `dt` seconds towards `goal`.
    pub fn advance(&mut self, goal: &GuidedGoal, tuning: &CopterTuning, dt: f32) {
        let error = goal.position.map_or(Point::zeros(), |position| position - self.position);
        // Horizontal axes, limited as one vector.
        let (limit, jerk) = (tuning.acceleration_max, tuning.jerk_max);
        let mut wanted = map_length(error.x, error.y, |e| {
            approach_rate(e, 0.5 * jerk / limit, CORRECTION_ACCEL_SHARE * limit)
        });
        wanted = map_length(wanted.0, wanted.1, |speed| speed.min(tuning.speed_max));
        wanted = (wanted.0 + goal.velocity.x, wanted.1 + goal.velocity.y);
        let lack = (wanted.0 - self.velocity.x, wanted.1 - self.velocity.y);
        let push = map_length(lack.0, lack.1, |e| approach_rate(e, jerk / limit, jerk).min(limit));
        let step = (
            push.0 + goal.acceleration.x - self.acceleration.x,
            push.1 + goal.acceleration.y - self.acceleration.y,
        );
        let step = map_length(step.0, step.1, |change| change.min(jerk * dt));
        self.acceleration.x += step.0;
        self.acceleration.y += step.1;
        // Vertical axis.
        let (limit, jerk) = (tuning.acceleration_max_z, tuning.jerk_max_z);
        let rate = approach_rate(error.z, 0.5 * jerk / limit, CORRECTION_ACCEL_SHARE * limit);
        let rate = rate.max(-tuning.descend_max).min(tuning.climb_max) + goal.velocity.z;
        let push = approach_rate(rate - self.velocity.z, jerk / limit, jerk).max(-limit).min(limit);
        let step = push + goal.acceleration.z - self.acceleration.z;
        self.acceleration.z += step.max(-jerk * dt).min(jerk * dt);
        self.velocity += self.acceleration * dt;
        self.position += self.velocity * dt;
    }
}

/// The vector (x, y) with its length changed by the function `length`.
fn map_length(x: f32, y: f32, length: impl Fn(f32) -> f32) -> (f32, f32) {
    let norm = libm::hypotf(x, y);
    if norm < 1e-6 {
        return (0.0, 0.0);
    }
    let factor = length(norm) / norm;
    (x * factor, y * factor)
}

#[cfg(test)]
mod tests;
