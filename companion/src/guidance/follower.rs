//! The last stage of the smoother: a point that follows the curve and never exceeds the limits of
//! acceleration and jerk.
//!
//! The curve is within the limits except for rare moments: corners that come close together, a
//! clock that changes its speed in a corner. There the follower lags the curve by centimetres and
//! then catches up. It integrates a jerk that is constant within a step, so the jerk of the
//! *positions* is bounded too. Its acceleration moves towards a wanted one, inside a convex set of
//! accelerations (a disc horizontally, an interval vertically), by no more than the jerk allows: it
//! cannot leave that set.
//!
//! The wanted acceleration is the curve's, plus the feedback that leads back to the curve's place
//! and velocity: a critically damped loop. The loop's rate ([`LOOP_RATE_SHARE`]) is low enough that
//! an error of velocity is removed, starting from the greatest acceleration, without more jerk than
//! allowed: so the limits do not make the loop oscillate. Where the deviation from the curve would
//! lead out of the geofence, the follower brakes before the fence, by the same limits
//! ([`super::fence`]).
//!
//! ENU metres, seconds. Constant work.

use libm::fmaxf;

use super::fence::Fence;
use super::motion::{Motion, clamp_length};
use crate::config::limits::MotionLimits;

/// Rate of the follower's loop, as a share of jerk over acceleration: a change of velocity dies
/// away at twice this rate.
const LOOP_RATE_SHARE: f32 = 0.45;

impl Motion {
    /// Moves the point by `dt_s` towards `to`, the curve's state at the end of the step, with at
    /// most `jerk_mps3`, and stops it before the fence.
    pub(super) fn follow(
        &mut self,
        to: &Self,
        limits: &MotionLimits,
        fence: Option<&Fence>,
        jerk_mps3: f32,
        dt_s: f32,
    ) {
        let (velocity, before) = (self.velocity, self.acceleration);
        // Place and velocity at the end of the step if the acceleration changes to the curve's.
        let place = self.position
            + velocity * dt_s
            + (before * 2.0 + to.acceleration) * (dt_s * dt_s / 6.0);
        let speed = velocity + (before + to.acceleration) * (0.5 * dt_s);
        let rate = LOOP_RATE_SHARE * jerk_mps3 / fmaxf(limits.accel_mps2, limits.accel_z_mps2);
        let back = to.velocity + (to.position - place) * (0.5 * rate);
        let wanted =
            to.acceleration + (clamp_length(back, limits.max_speed_mps()) - speed) * (2.0 * rate);
        let change = limits.clamp_accel(&wanted) - before;
        let jerk = clamp_length(change / dt_s, jerk_mps3);
        let jerk =
            fence.map_or(jerk, |fence| fence.limit_jerk(self, jerk, limits, jerk_mps3, dt_s));
        self.acceleration = before + jerk * dt_s;
        self.velocity = velocity + (before + jerk * (0.5 * dt_s)) * dt_s;
        self.position += (velocity + (before * 0.5 + jerk * (dt_s / 6.0)) * dt_s) * dt_s;
    }
}
