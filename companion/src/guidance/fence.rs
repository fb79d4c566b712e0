//! The geofence of the smoother: a box that no setpoint leaves. The follower stops inside.
//!
//! A point stays inside smoothly if it can always still stop: in each axis the stopping distance,
//! with a part of the vehicle's acceleration and jerk, is no longer than the distance to the wall.
//! A step that would break this is replaced, in that axis, by the nearest one that does not
//! ([`Fence::limit_jerk`]). The part is such that all three axes can brake at once: 1/√3 of the
//! jerk for each, 1/√2 of the horizontal acceleration; stops are planned with a little less, which
//! pays for steps of finite length.
//!
//! ENU metres, seconds. Constant work.

use fpu::sqrtf;
use libm::{fabsf, fmaxf, fminf};
use planner_core::Point;

use super::motion::{Motion, clamp_length};
use crate::config::limits::{MotionLimits, Urgency};

/// Distance by which setpoints stay inside the fence, metres: the autopilot's frame rounds a
/// setpoint by up to 1.4 mm, 30 km from its origin.
const FRAME_ROUNDING_M: f32 = 2e-3;
/// Distance before the fence at which the follower turns, metres: steps of finite length overshoot
/// by millimetres.
const FOLLOWER_FENCE_MARGIN_M: f32 = 0.02;
/// Share of the jerk limit with which an axis may brake, and share with which its stops are
/// planned.
const BRAKE_PLAN_JERK_SHARES: [f32; 2] = [0.577, 0.48];
/// Share of the acceleration limit with which an axis may brake, and share with which its stops are
/// planned: horizontally, then vertically.
const BRAKE_PLAN_ACCEL_SHARES: [[f32; 2]; 2] = [[0.7, 0.65], [1.0, 0.9]];
/// Number of bisection steps between a jerk that is safe and one that is not.
const JERK_HALVINGS: usize = 8;

/// A box that setpoints do not leave.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fence {
    /// Least corner, ENU metres in the mission frame.
    low: Point,
    /// Greatest corner, ENU metres in the mission frame.
    high: Point,
}

/// Acceleration and jerk with which an axis brakes.
#[derive(Clone, Copy)]
struct BrakingLimits {
    /// Greatest deceleration, m/s².
    accel_mps2: f32,
    /// Jerk with which the deceleration begins and ends, m/s³.
    jerk_mps3: f32,
}

impl Fence {
    /// The mission's box, made smaller on each side by the rounding of the autopilot's frame, but
    /// by no more than a quarter of its size.
    pub(super) fn new((low, high): (Point, Point)) -> Self {
        let slack = (high - low).map(|size| fminf(FRAME_ROUNDING_M, 0.25 * size));
        Self { low: low + slack, high: high - slack }
    }

    /// The place inside the fence that is nearest to `place`.
    pub(super) fn nearest_inside(&self, mut place: Point) -> Point {
        for axis in 0..3 {
            place[axis] = fmaxf(fminf(place[axis], self.high[axis]), self.low[axis]);
        }
        place
    }

    /// The velocity, as near as possible to the motion's own, from which it can stop inside the
    /// fence.
    pub(super) fn limit_velocity(&self, motion: &Motion, limits: &MotionLimits) -> Point {
        let mut velocity = motion.velocity;
        for axis in 0..3 {
            let place = motion.position[axis];
            let walls = self.axis_walls(axis, place, axis_brake(limits, axis));
            let is_safe = |speed: f32| walls.can_stop_between(place, speed, 0.0);
            if !is_safe(velocity[axis]) {
                velocity[axis] = nearest_safe(velocity[axis], 0.0, is_safe);
            }
        }
        velocity
    }

    /// The jerk nearest to `wanted`, of no more than `most_mps3`, after which the motion at the end
    /// of the step can still stop inside the fence.
    pub(super) fn limit_jerk(
        &self,
        motion: &Motion,
        wanted: Point,
        limits: &MotionLimits,
        most_mps3: f32,
        dt_s: f32,
    ) -> Point {
        let mut jerk = wanted;
        let mut brakes = [false; 3];
        let mut hardest = Point::zeros();
        for _ in 0..3 {
            let mut changed = false;
            for axis in 0..3 {
                let (place, speed, accel) =
                    (motion.position[axis], motion.velocity[axis], motion.acceleration[axis]);
                let walls = self.axis_walls(axis, place, axis_brake(limits, axis));
                let next = |jerk: f32| {
                    let place = place + (speed + (accel * 0.5 + jerk * (dt_s / 6.0)) * dt_s) * dt_s;
                    let speed = speed + (accel + jerk * (0.5 * dt_s)) * dt_s;
                    (place, speed, accel + jerk * dt_s)
                };
                let is_safe = |jerk: f32| {
                    let (place, speed, accel) = next(jerk);
                    walls.can_stop_between(place, speed, accel)
                };
                if brakes[axis] || is_safe(jerk[axis]) {
                    continue;
                }
                (brakes[axis], changed) = (true, true);
                // The hardest jerk away from the wall ahead: it reaches the greatest acceleration
                // that braking may use, if one step can; else it is the greatest jerk of an axis.
                let (ahead, pace, push) = next(jerk[axis]);
                let away = if walls.can_stop_below_high(ahead, pace, push) { 1.0 } else { -1.0 };
                let part = BRAKE_PLAN_JERK_SHARES[0] * most_mps3;
                let accel_most =
                    limits.max_setpoint_accel_mps2[axis / 2] * BRAKE_PLAN_ACCEL_SHARES[axis / 2][0];
                hardest[axis] =
                    away * fmaxf(fminf(part, (accel_most - away * accel) / dt_s), -part);
                let wanted = fmaxf(fminf(jerk[axis], part), -part);
                jerk[axis] = nearest_safe(wanted, hardest[axis], is_safe);
            }
            if !changed {
                break;
            }
            distribute_remaining_jerk(
                &mut jerk,
                brakes,
                &motion.acceleration,
                limits,
                most_mps3,
                dt_s,
            );
        }
        let across = (motion.acceleration + jerk * dt_s).xy().norm_squared();
        if brakes[0]
            && brakes[1]
            && across > limits.max_setpoint_accel_mps2[0] * limits.max_setpoint_accel_mps2[0]
        {
            (jerk.x, jerk.y) = (hardest.x, hardest.y);
            let left = sqrtf(fmaxf(most_mps3 * most_mps3 - hardest.xy().norm_squared(), 0.0));
            jerk.z = fmaxf(fminf(jerk.z, left), -left);
        }
        jerk
    }

    /// Bounds of an axis for a motion at `place`: the fence less 2 cm. A motion that is beyond them
    /// comes no nearer to the fence.
    fn axis_walls(&self, axis: usize, place: f32, brake: BrakingLimits) -> AxisBounds {
        let (low, high) = (self.low[axis], self.high[axis]);
        let before_m = fminf(FOLLOWER_FENCE_MARGIN_M, 0.25 * (high - low));
        AxisBounds { low: fminf(low + before_m, place), high: fmaxf(high - before_m, place), brake }
    }
}

/// Interval of an axis in which a motion has to stop, and its braking.
struct AxisBounds {
    /// Lower end of the interval, metres.
    low: f32,
    /// Upper end of the interval, metres.
    high: f32,
    /// Acceleration and jerk with which the axis brakes.
    brake: BrakingLimits,
}

impl AxisBounds {
    /// Whether a motion along the axis can still stop between `low` and `high`.
    fn can_stop_between(&self, place: f32, speed: f32, accel: f32) -> bool {
        self.can_stop_below_high(place, speed, accel)
            && place - stop_distance_m(-speed, -accel, self.brake) >= self.low
    }

    /// Whether a motion along the axis can still stop at `high` or lower.
    fn can_stop_below_high(&self, place: f32, speed: f32, accel: f32) -> bool {
        place + stop_distance_m(speed, accel, self.brake) <= self.high
    }
}

/// Acceleration and jerk with which the stops of an axis are planned.
fn axis_brake(limits: &MotionLimits, axis: usize) -> BrakingLimits {
    BrakingLimits {
        accel_mps2: BRAKE_PLAN_ACCEL_SHARES[axis / 2][1] * limits.max_setpoint_accel_mps2[axis / 2],
        jerk_mps3: BRAKE_PLAN_JERK_SHARES[1] * limits.jerk(Urgency::Smooth),
    }
}

/// The number nearest to `wanted` for which `is_safe` holds, by bisection between it and `safe`.
fn nearest_safe(wanted: f32, safe: f32, is_safe: impl Fn(f32) -> bool) -> f32 {
    let (mut good, mut bad) = (safe, wanted);
    for _ in 0..JERK_HALVINGS {
        let middle = 0.5 * (good + bad);
        if is_safe(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

/// Limits the jerk of the axes that do not have to brake to what the braking axes leave of the jerk
/// and of the horizontal acceleration.
fn distribute_remaining_jerk(
    jerk: &mut Point,
    brakes: [bool; 3],
    accel: &Point,
    limits: &MotionLimits,
    most_mps3: f32,
    dt_s: f32,
) {
    let other = |axis: usize| if brakes[axis] { 0.0 } else { 1.0 };
    let free = Point::new(other(0), other(1), other(2));
    let mut others = jerk.component_mul(&free);
    let braking = *jerk - others;
    let left = |braking: &Point| sqrtf(fmaxf(most_mps3 * most_mps3 - braking.norm_squared(), 0.0));
    others = clamp_length(others, left(&braking));
    if brakes[0] != brakes[1] {
        let (axis, beside) = if brakes[0] { (0, 1) } else { (1, 0) };
        let taken = accel[axis] + jerk[axis] * dt_s;
        let across = limits.max_setpoint_accel_mps2[0];
        let room = sqrtf(fmaxf(across * across - taken * taken, 0.0));
        let next = accel[beside] + others[beside] * dt_s;
        let next = fmaxf(fminf(next, room), -room);
        // The braking axes take their jerk first, then the other horizontal axis, then the vertical
        // one.
        let most = left(&braking);
        others[beside] = fmaxf(fminf((next - accel[beside]) / dt_s, most), -most);
        let most = sqrtf(fmaxf(most * most - others[beside] * others[beside], 0.0));
        others.z = fmaxf(fminf(others.z, most), -most);
    }
    *jerk = braking + others;
}

/// Distance of a stop towards a wall, metres, from this speed and acceleration: the acceleration
/// falls to −a at the greatest jerk, stays there, and returns to 0 as the speed does.
fn stop_distance_m(speed: f32, accel: f32, brake: BrakingLimits) -> f32 {
    let BrakingLimits { accel_mps2: most, jerk_mps3: jerk } = brake;
    let accel = fmaxf(accel, -most);
    // If bringing the acceleration back to 0 already stops the motion, no further braking is
    // needed.
    if speed + accel * fabsf(accel) / (2.0 * jerk) <= 0.0 {
        if speed <= 0.0 {
            return 0.0;
        }
        let turns_s = (-accel - sqrtf(fmaxf(accel * accel - 2.0 * jerk * speed, 0.0))) / jerk;
        return (speed + (accel * 0.5 + jerk * turns_s / 6.0) * turns_s) * turns_s;
    }
    let peak = fminf(sqrtf(fmaxf(jerk * speed + 0.5 * accel * accel, 0.0)), most);
    let falls_s = fmaxf(accel + peak, 0.0) / jerk;
    let reached = speed + (accel - 0.5 * jerk * falls_s) * falls_s;
    let end = peak * peak / (2.0 * jerk);
    let holds_s = fmaxf(reached - end, 0.0) / fmaxf(peak, 1e-6);
    let falls_m = (speed + (accel * 0.5 - jerk * falls_s / 6.0) * falls_s) * falls_s;
    fmaxf(falls_m + 0.5 * (reached + end) * holds_s + peak * end / (3.0 * jerk), 0.0)
}

#[cfg(test)]
mod tests;
