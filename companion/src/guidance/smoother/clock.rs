//! The clock of the smoother: how fast it carries the setpoint along its curve.

use fpu::sqrtf;
use libm::{fabsf, fmaxf, fminf};
use planner_core::Length;

use super::super::motion::clamp_to;
use super::{ClockPace, END_JERK_SHARE, STOP_DECAY_PER_S, SetpointSmoother, TICK_S};

/// Share of the jerk limit that curve and clock together may use in a step: the rest is for the
/// next raw point, which is not known yet.
const PLANNED_JERK_SHARE: f32 = 0.9;
/// Share of the jerk limit with which the clock's speeding up ends: small, since nothing depends on
/// how soon the clock runs at 1 again.
const SPEED_UP_END_JERK_SHARE: f32 = 0.15;
/// Least speed of the curve by which the clock's acceleration is divided, m/s.
const MIN_CURVE_MPS: f32 = 0.2;

impl SetpointSmoother {
    /// Sets the clock's speed after `dt_s`: as near to the pace as acceleration and jerk allow.
    /// With s the curve's speed, f its acceleration along it and σ the clock, the setpoint's speed
    /// is s·σ, its acceleration f·σ² + s·σ̇, and the clock's part of its jerk 3·f·σ·σ̇ + s·σ̈.
    pub(super) fn run_clock(&mut self, pace: ClockPace, dt_s: f32) {
        let limits = &self.limits;
        let (_, slope, bend) = self.curve_motion();
        let true_speed = slope.length();
        let speed = fmaxf(true_speed, MIN_CURVE_MPS);
        let along = bend.dot(&slope) / speed;
        let third = (self.average_steps[2] - self.average_steps[1] * 2.0 + self.average_steps[0])
            / (TICK_S * TICK_S * TICK_S);
        let clock = self.clock_speed;
        let accel = limits.accel_along(&(slope / fmaxf(true_speed, 1e-3)));
        // Wanted change of the speed: towards the pace, and such that the change ends without a
        // step of the acceleration.
        let lack = (pace.speed_share.clamp(0.0, 1.0) - clock) * speed;
        let size = fmaxf(fabsf(lack) - fabsf(self.clock_acceleration) * speed * dt_s, 0.0);
        let end_share = if lack > 0.0 { SPEED_UP_END_JERK_SHARE } else { END_JERK_SHARE };
        let end_jerk = end_share * limits.jerk(pace.urgency);
        let rate = fminf(fminf(accel, sqrtf(2.0 * end_jerk * size)), STOP_DECAY_PER_S * size);
        let wanted = if lack < 0.0 { -rate } else { rate };
        let own = along * clock * clock;
        // The clock speeds up only by the acceleration that the curve leaves; the curve's part
        // counts twice, since it may grow meanwhile.
        let [least, most] = [fminf(-accel - own, 0.0), fmaxf(accel - 2.0 * fabsf(own), 0.0)];
        let wanted = clamp_to(wanted, least, most) / speed;
        // The rates σ̇ at which the acceleration, bend · σ² + slope · σ̇, changes by no more than
        // the jerk allows; where the curve alone takes all of it, the rate that adds the least.
        let ahead = bend + third * (clock * dt_s);
        let next = (clock + self.clock_acceleration * dt_s).clamp(0.0, 1.0);
        let change = ahead * (next * next) - self.curve_acceleration;
        let most = PLANNED_JERK_SHARE * limits.jerk(pace.urgency) * dt_s;
        let slope_sq = fmaxf(slope.norm_squared(), MIN_CURVE_MPS * MIN_CURVE_MPS);
        let middle = -change.dot(&slope) / slope_sq;
        let left = most * most - change.norm_squared() + middle * middle * slope_sq;
        let half = sqrtf(fmaxf(left, 0.0) / slope_sq);
        let rate = clamp_to(wanted, middle - half, middle + half);
        let next = (clock + rate * dt_s).clamp(0.0, 1.0);
        let done = fabsf(lack) < 1e-3 * speed && fabsf(rate) < 0.02;
        self.clock_speed = if done { pace.speed_share.clamp(0.0, 1.0) } else { next };
        self.clock_acceleration = if done { 0.0 } else { (next - clock) / dt_s };
    }
}
