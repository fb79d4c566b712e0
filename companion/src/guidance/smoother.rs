//! The setpoint smoother: it makes every setpoint with a position or a velocity.
//!
//! Guidance moves a *raw* point within limits of speed and acceleration, one step each [`TICK_S`].
//! The raw point changes its velocity at once in a corner and its acceleration at once where it
//! begins to brake. The smoother makes a setpoint of it that the vehicle can fly:
//!
//! - Two moving averages over T = `average_ticks` · [`TICK_S`] each, then a uniform cubic B-spline
//!   through the averages. Position, velocity and acceleration are derivatives of one curve. The
//!   curve stays in the convex hull of the raw points: a straight leg stays exact, a stop is not
//!   overshot, a corner is rounded by at most Δv·T/6, and points inside the geofence (a box) give
//!   setpoints inside it.
//! - Its jerk is the second difference of the raw velocity over T, divided by T²: Δv / T² for a
//!   sudden change of velocity, at most 2·a / T where braking turns into speeding up. T follows
//!   from that, with some room: 0.85 s for 1.5 m/s² and 4 m/s³.
//! - A *clock* carries the setpoint along that curve. It runs at 1, and slows to wait for a vehicle
//!   that lags, to pause, or to stop for the safety filter. A slower clock changes nothing of the
//!   curve's shape. The speed of the clock obeys its own limits of acceleration and jerk, so a late
//!   step, a stop and a resume are all smooth.
//! - A *follower* ([`super::follower`]) goes where the curve leads, and holds the limits of
//!   acceleration and jerk exactly, beside the geofence too ([`super::fence`]).
//!
//! ENU metres, seconds. Work: 2·[`MAX_WINDOW_TICKS`] vector sums for each tick, at most
//! [`MAX_TICKS_PER_STEP`] ticks a step.

mod clock;

use fpu::sqrtf;
use libm::{fmaxf, fminf};
use planner_core::{Length, Point};

use super::fence::Fence;
use super::motion::{Motion, clamp_length};
use crate::config::limits::{MAX_SMOOTHING_WINDOW_S, MotionLimits, Urgency};

/// Time between two raw points, seconds: the period of the setpoints.
pub const TICK_S: f32 = 0.05;
/// Maximum number of raw points taken in one step: a step that comes later moves the setpoint no
/// further.
pub const MAX_TICKS_PER_STEP: u8 = 4;
/// Longest window of each moving average, in ticks of [`TICK_S`].
const MAX_WINDOW_TICKS: usize = (MAX_SMOOTHING_WINDOW_S / TICK_S + 0.5) as usize;
/// Number of raw steps that enter one value of both averages.
const HISTORY_LEN: usize = 2 * MAX_WINDOW_TICKS - 1;
/// Share of the jerk limit with which a stop by the clock is assumed to begin: the curve may need
/// the rest.
const STOP_BEGIN_JERK_SHARE: f32 = 0.7;
/// Share of the jerk limit with which the end of a change of speed is planned: the curve may need
/// the rest.
const END_JERK_SHARE: f32 = 0.4;
/// A setpoint slower than this counts as standing, m/s.
const FULL_STOP_MPS: f32 = 0.01;
/// Rate of decay at the end of a stop, 1/s: the deceleration is at most this times the speed that
/// is left.
const STOP_DECAY_PER_S: f32 = 4.0;
/// Distance by which the predicted length of a stop exceeds that of its formula, metres.
const STOP_MARGIN_M: f32 = 0.02;
/// Greatest speed of a setpoint that follows a vehicle under other control, m/s: a position that
/// moves faster is an estimate that jumps.
const MAX_FOLLOWED_MPS: f32 = 15.0;
/// Longest gap between setpoints during which the vehicle still flies by the last one, seconds.
const MAX_CONTINUED_GAP_S: f32 = 0.3;
/// Weight of the newest step in the velocity of a followed vehicle: its position is reported in
/// steps.
const FOLLOWED_VELOCITY_GAIN: f32 = 0.25;
/// Greatest velocity after following a vehicle, as a multiple of the followed velocity.
const MAX_SPEED_TO_FOLLOWED_RATIO: f32 = 1.5;
/// Distance outside the fence up to which a raw point is moved inside and still counts as sound,
/// metres: beyond it `make_setpoint` returns false.
const FENCE_SLACK_M: f32 = 0.01;
/// Distance by which a raw step may exceed the speed limit, metres: rounding at a kilometre from
/// the origin.
const STEP_SLACK_M: f32 = 2e-3;

/// Speed at which the smoother's clock is to run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockPace {
    /// 1 runs at full speed, 0 stops.
    pub speed_share: f32,
    /// Whether the safety filter stops the vehicle: then the clock brakes with the higher jerk.
    pub urgency: Urgency,
}

/// Statistics of the setpoints since the start: greatest values, and number of steps in which the
/// smoother held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SetpointStats {
    /// Setpoints made.
    pub setpoint_count: u32,
    /// Greatest distance between two setpoints, divided by the time between them, m/s.
    pub max_speed_mps: f32,
    /// Greatest acceleration, m/s².
    pub max_accel_mps2: f32,
    /// Greatest jerk outside stops by the safety filter, m/s³.
    pub max_jerk_mps3: f32,
    /// Greatest jerk in a stop by the safety filter, m/s³.
    pub max_urgent_jerk_mps3: f32,
    /// Steps with a raw point that was not finite or too far from the last, which the smoother did
    /// not follow, or more than 1 cm outside the geofence, which it moved inside; or with a curve
    /// that was not finite.
    pub hold_count: u32,
}

/// The setpoint, and the curve along which it moves.
#[derive(Clone, Debug)]
pub struct SetpointSmoother {
    /// Limits of the setpoint's speed, acceleration and jerk.
    limits: MotionLimits,
    /// The geofence; `None` without one.
    fence: Option<Fence>,
    /// Window of each of the two averages, ticks.
    average_ticks: usize,
    /// Newest raw point.
    newest_raw_point: Point,
    /// The last differences between raw points, a ring; `newest_step_index` is the newest.
    raw_steps: [Point; HISTORY_LEN],
    /// Index in `raw_steps` of the newest difference.
    newest_step_index: usize,
    /// Newest value of the averages.
    averaged_point: Point,
    /// The last three steps of the averages, oldest first.
    average_steps: [Point; 3],
    /// Time since the last tick, as a share of a tick.
    tick_fraction: f32,
    /// Speed of the clock, 1 for real time.
    clock_speed: f32,
    /// Change of `clock_speed` each second.
    clock_acceleration: f32,
    /// Whether there is a setpoint, from which the next one continues.
    has_setpoint: bool,
    /// Place of the setpoint that was sent last; `None` before the first.
    last_sent_position: Option<Point>,
    /// Whether the setpoint continues after a short gap, for which the next step makes up.
    resumes_after_gap: bool,
    /// Velocity with which setpoints follow a vehicle that its pilot or autopilot flies.
    followed_velocity: Point,
    /// Length of the step under way, seconds.
    dt_s: f32,
    /// Whether the step under way brakes for the safety filter.
    urgency: Urgency,
    /// Whether all raw points of the step under way were sound.
    raw_points_valid: bool,
    /// Acceleration with which the clock moved along the curve at the last setpoint; `run_clock`
    /// limits the change from it.
    curve_acceleration: Point,
    /// Place, velocity and acceleration of the setpoint.
    motion: Motion,
    /// Statistics since the companion's start.
    pub stats: SetpointStats,
}

impl SetpointSmoother {
    pub(crate) fn new(limits: MotionLimits, fence: Option<(Point, Point)>) -> Self {
        Self {
            limits,
            fence: fence.map(Fence::new),
            average_ticks: ticks_per_average(&limits),
            newest_raw_point: Point::zeros(),
            raw_steps: [Point::zeros(); HISTORY_LEN],
            newest_step_index: 0,
            averaged_point: Point::zeros(),
            average_steps: [Point::zeros(); 3],
            tick_fraction: 0.0,
            clock_speed: 1.0,
            clock_acceleration: 0.0,
            has_setpoint: false,
            last_sent_position: None,
            resumes_after_gap: false,
            followed_velocity: Point::zeros(),
            dt_s: 0.0,
            urgency: Urgency::Smooth,
            raw_points_valid: true,
            curve_acceleration: Point::zeros(),
            motion: Motion::at_rest(Point::zeros()),
            stats: SetpointStats::default(),
        }
    }

    /// Sets the limits and the fence, and restarts the curve at the setpoint; to be called only
    /// while the setpoint stands still.
    pub(crate) fn set_limits(&mut self, limits: MotionLimits, fence: Option<(Point, Point)>) {
        (self.limits, self.fence, self.average_ticks) =
            (limits, fence.map(Fence::new), ticks_per_average(&limits));
        self.restart_curve_at_setpoint();
    }

    /// Whether there is a setpoint, from which the next one continues.
    pub(crate) fn has_setpoint(&self) -> bool {
        self.has_setpoint
    }

    /// Ends the setpoint stream: the next setpoint begins at the place given then, unless it
    /// follows after a short gap ([`Self::resume_at`]).
    pub(crate) fn end_stream(&mut self) {
        self.has_setpoint = false;
    }

    /// Place of the last setpoint.
    pub(crate) fn position(&self) -> Point {
        self.motion.position
    }

    /// Velocity of the setpoint.
    pub(crate) fn velocity(&self) -> Point {
        self.motion.velocity
    }

    /// Acceleration of the setpoint.
    pub(crate) fn acceleration(&self) -> Point {
        self.motion.acceleration
    }

    /// The raw point. It is ahead of the setpoint by the steps that the averages still hold.
    pub(crate) fn raw_point(&self) -> Point {
        self.newest_raw_point
    }

    /// Speed of the newest raw step at the speed of the clock, m/s: the setpoint has it T later.
    pub(crate) fn raw_speed_mps(&self) -> f32 {
        self.raw_steps[self.newest_step_index].length() / TICK_S * self.clock_speed
    }

    /// Greatest jerk of a setpoint, m/s³.
    pub(crate) fn max_jerk_mps3(&self, urgency: Urgency) -> f32 {
        self.limits.jerk(urgency)
    }

    /// Whether the setpoint is in a stop by the safety filter, until it no longer brakes.
    pub(crate) fn is_in_urgent_stop(&self) -> bool {
        self.has_setpoint && self.urgency == Urgency::Urgent
    }

    /// Distance of the setpoint from its curve, metres.
    #[cfg(test)]
    pub(crate) fn off_curve_m(&self) -> f32 {
        (self.curve_motion().0 - self.motion.position).length()
    }

    /// Whether the setpoint stands: it is slower than 0.01 m/s (`FULL_STOP_MPS`).
    pub(crate) fn is_standing(&self) -> bool {
        self.velocity().norm_squared() < FULL_STOP_MPS * FULL_STOP_MPS
    }

    /// Length of a stop of the setpoint that begins now, metres: while the braking builds up, and
    /// while the setpoint brakes.
    pub(crate) fn stop_distance_m(&self, urgency: Urgency) -> f32 {
        let velocity = self.velocity();
        let speed = sqrtf(velocity.norm_squared());
        if speed < FULL_STOP_MPS {
            return 0.0;
        }
        let accel = self.limits.accel_along(&(velocity / speed));
        let jerk = STOP_BEGIN_JERK_SHARE * self.limits.jerk(urgency);
        let ahead = fmaxf(self.acceleration().dot(&velocity) / speed, 0.0);
        let build_up_s = (accel + ahead) / jerk + TICK_S;
        let end_s =
            0.5 * accel / (END_JERK_SHARE * self.limits.jerk(urgency)) + 0.5 / STOP_DECAY_PER_S;
        speed * speed / (2.0 * accel)
            + speed * build_up_s
            + fminf(speed, accel * end_s) * end_s
            + STOP_MARGIN_M
    }

    /// Begins setpoints at a place, `since_sent_s` after one was sent last. After a gap shorter
    /// than [`MAX_CONTINUED_GAP_S`] the last setpoint continues instead, as the autopilot has done.
    pub(crate) fn resume_at(&mut self, place: Point, since_sent_s: f32) {
        if !self.has_setpoint
            && self.last_sent_position == Some(self.position())
            && since_sent_s < MAX_CONTINUED_GAP_S
        {
            (self.has_setpoint, self.resumes_after_gap) = (true, true);
            self.restart_curve_at_setpoint();
        } else {
            self.begin_at(place, since_sent_s);
        }
    }

    /// Begins at rest at a place, no further from the place sent last than a followed vehicle flies
    /// in `since_sent_s`: an estimate that jumps is no motion.
    pub(crate) fn begin_at(&mut self, place: Point, since_sent_s: f32) {
        let place = if place.iter().all(|c| c.is_finite()) {
            self.nearest_inside_fence(place)
        } else {
            self.position()
        };
        let place = self.last_sent_position.map_or(place, |sent| {
            sent + clamp_length(place - sent, MAX_FOLLOWED_MPS * since_sent_s)
        });
        self.motion = Motion::at_rest(place);
        (self.has_setpoint, self.resumes_after_gap, self.followed_velocity) =
            (true, false, Point::zeros());
        self.restart_curve_at_setpoint();
    }

    /// Sets the setpoint to the place of a vehicle that its pilot or autopilot flies,
    /// `since_sent_s` after a setpoint was sent last, and estimates its velocity.
    pub(crate) fn follow_vehicle(&mut self, place: Point, since_sent_s: f32) {
        let (here, was_live, followed) =
            (self.position(), self.has_setpoint, self.followed_velocity);
        self.begin_at(place, since_sent_s);
        if was_live && since_sent_s > 0.0 {
            self.followed_velocity = followed
                + ((self.position() - here) / since_sent_s - followed) * FOLLOWED_VELOCITY_GAIN;
        }
    }

    /// Whether the next step makes up for a gap, and is as long as the time since the last sending.
    pub(crate) fn makes_up_for_gap(&self) -> bool {
        self.resumes_after_gap
    }

    /// Notes that the setpoint was sent.
    pub(crate) fn mark_sent(&mut self) {
        self.last_sent_position = Some(self.position());
    }

    /// Gives the setpoint the vehicle's velocity: the setpoint brakes from that, and returns to its
    /// place. The velocity is limited to 1.5 times the followed velocity
    /// ([`MAX_SPEED_TO_FOLLOWED_RATIO`]), to the speed limit, and so that the setpoint can stop
    /// inside the fence.
    pub(crate) fn brake_from_velocity(&mut self, velocity: &Point) {
        let most_mps = fminf(
            self.limits.max_speed_mps(),
            MAX_SPEED_TO_FOLLOWED_RATIO * self.followed_velocity.length(),
        );
        let velocity = clamp_length(*velocity, most_mps);
        if velocity.iter().all(|c| c.is_finite()) {
            self.motion.velocity = velocity;
            if let Some(fence) = &self.fence {
                self.motion.velocity = fence.limit_velocity(&self.motion, &self.limits);
            }
        }
    }

    /// Restarts the curve at the setpoint, which has to be slow: the follower brings it to rest
    /// within its own limits.
    pub(crate) fn restart_curve_at_setpoint(&mut self) {
        self.raw_steps = [Point::zeros(); HISTORY_LEN];
        self.average_steps = [Point::zeros(); 3];
        (self.newest_raw_point, self.averaged_point) = (self.position(), self.position());
        (self.tick_fraction, self.clock_speed, self.clock_acceleration) = (0.0, 1.0, 0.0);
        self.curve_acceleration = Point::zeros();
    }

    /// The place inside the fence that is nearest to `place`.
    pub(crate) fn nearest_inside_fence(&self, place: Point) -> Point {
        self.fence.as_ref().map_or(place, |fence| fence.nearest_inside(place))
    }

    /// Whether a place is inside the fence, or at most 1 cm outside.
    pub(crate) fn is_within_fence_slack(&self, place: &Point) -> bool {
        (self.nearest_inside_fence(*place) - place).norm_squared() <= FENCE_SLACK_M * FENCE_SLACK_M
    }

    /// Runs the clock for `dt_s`. Returns the number of raw points that are due:
    /// [`Self::push_raw_point`] takes each, then [`Self::make_setpoint`] makes the setpoint.
    pub(crate) fn begin_step(&mut self, pace: ClockPace, dt_s: f32) -> u8 {
        if !(self.has_setpoint && dt_s > 0.0) {
            self.dt_s = 0.0;
            return 0;
        }
        let resumes = core::mem::take(&mut self.resumes_after_gap);
        self.dt_s = fminf(
            dt_s,
            if resumes { MAX_CONTINUED_GAP_S } else { f32::from(MAX_TICKS_PER_STEP) * TICK_S },
        );
        // A stop by the safety filter keeps its higher jerk until it no longer brakes.
        let brakes =
            self.clock_acceleration < 0.0 || self.acceleration().dot(&self.velocity()) < 0.0;
        self.urgency = match pace.urgency {
            Urgency::Smooth if brakes => self.urgency,
            urgency => urgency,
        };
        let pace = ClockPace { urgency: self.urgency, ..pace };
        let clock_before = self.clock_speed;
        self.run_clock(pace, self.dt_s);
        self.tick_fraction += 0.5 * (clock_before + self.clock_speed) * self.dt_s / TICK_S;
        let due = (self.tick_fraction as u8).min(MAX_TICKS_PER_STEP);
        // After a gap the curve is one point.
        self.tick_fraction =
            if resumes { 0.0 } else { fmaxf(self.tick_fraction - f32::from(due), 0.0) };
        due
    }

    /// Takes the next raw point. One outside the fence is moved inside; one too far from the last,
    /// or not finite, leaves the raw point where it is. Either makes [`Self::make_setpoint`] return
    /// false.
    pub(crate) fn push_raw_point(&mut self, next: Point) {
        let step = self.nearest_inside_fence(next) - self.newest_raw_point;
        let furthest = self.limits.max_speed_mps() * TICK_S + STEP_SLACK_M;
        // False for NaN.
        let near = step.norm_squared() <= furthest * furthest;
        self.raw_points_valid &= near
            && (self.nearest_inside_fence(next) - next).norm_squared()
                <= FENCE_SLACK_M * FENCE_SLACK_M;
        self.push_raw_step(if near { step } else { Point::zeros() });
    }

    /// Makes the setpoint of this step. Returns false where a raw point or the curve was not sound.
    pub(crate) fn make_setpoint(&mut self) -> bool {
        let dt_s = self.dt_s;
        let sound = core::mem::replace(&mut self.raw_points_valid, true);
        if dt_s <= 0.0 {
            return sound;
        }
        let (place, slope, bend) = self.curve_motion();
        let velocity = slope * self.clock_speed;
        let acceleration =
            bend * (self.clock_speed * self.clock_speed) + slope * self.clock_acceleration;
        let to = Motion { position: place, velocity, acceleration };
        self.stats.setpoint_count = self.stats.setpoint_count.saturating_add(1);
        if !(sound && to.is_finite()) {
            self.stats.hold_count = self.stats.hold_count.saturating_add(1);
        }
        if !to.is_finite() {
            self.restart_curve_at_setpoint();
            return false;
        }
        self.curve_acceleration = acceleration;
        let before = self.motion;
        let jerk_mps3 = self.limits.jerk(self.urgency);
        self.motion.follow(&to, &self.limits, self.fence.as_ref(), jerk_mps3, dt_s);
        self.clamp_inside_fence();
        let step_m = (self.motion.position - before.position).length();
        let jerk_mps3 = (self.motion.acceleration - before.acceleration).length() / dt_s;
        let worst = match self.urgency {
            Urgency::Smooth => &mut self.stats.max_jerk_mps3,
            Urgency::Urgent => &mut self.stats.max_urgent_jerk_mps3,
        };
        *worst = fmaxf(*worst, jerk_mps3);
        self.stats.max_speed_mps = fmaxf(self.stats.max_speed_mps, (step_m - STEP_SLACK_M) / dt_s);
        self.stats.max_accel_mps2 =
            fmaxf(self.stats.max_accel_mps2, self.motion.acceleration.length());
        sound
    }

    /// The follower stops before the fence. If rounding of uneven steps still leads outside, the
    /// setpoint is set back inside at once: the fence comes before smoothness.
    fn clamp_inside_fence(&mut self) {
        let place = self.nearest_inside_fence(self.motion.position);
        for axis in 0..3 {
            if place[axis] != self.motion.position[axis] {
                (self.motion.velocity[axis], self.motion.acceleration[axis]) = (0.0, 0.0);
            }
        }
        self.motion.position = place;
    }

    /// Adds a raw step, and computes the new value of the averages.
    fn push_raw_step(&mut self, step: Point) {
        self.newest_raw_point += step;
        self.newest_step_index =
            if self.newest_step_index == 0 { HISTORY_LEN - 1 } else { self.newest_step_index - 1 };
        self.raw_steps[self.newest_step_index] = step;
        // Both averages at once: a triangle of 2n − 1 weights.
        let n = self.average_ticks;
        let scale = 1.0 / (n * n) as f32;
        let (mut slope, mut behind) = (Point::zeros(), Point::zeros());
        let mut tail = 1.0;
        for i in 0..2 * n - 1 {
            let at = if self.newest_step_index + i < HISTORY_LEN {
                self.newest_step_index + i
            } else {
                self.newest_step_index + i - HISTORY_LEN
            };
            let weight = (if i < n { i + 1 } else { 2 * n - 1 - i }) as f32 * scale;
            slope += self.raw_steps[at] * weight;
            tail -= weight;
            behind += self.raw_steps[at] * tail;
        }
        self.average_steps = [self.average_steps[1], self.average_steps[2], slope];
        self.averaged_point = self.newest_raw_point - behind;
    }

    /// Place, velocity and acceleration of the curve at the clock's place in the tick.
    fn curve_motion(&self) -> (Point, Point, Point) {
        let [e0, e1, e2] = &self.average_steps;
        let (x, y) = (self.tick_fraction, 1.0 - self.tick_fraction);
        let second = self.averaged_point - e2 - e1;
        let place = second
            + (e1 * (1.0 + 3.0 * x + 3.0 * x * x - 2.0 * x * x * x) + e2 * (x * x * x)
                - e0 * (y * y * y))
                / 6.0;
        let slope = (e0 * (y * y) + e1 * (1.0 + 2.0 * x - 2.0 * x * x) + e2 * (x * x)) * 0.5;
        let bend = (e1 - e0) * y + (e2 - e1) * x;
        (place, slope / TICK_S, bend / (TICK_S * TICK_S))
    }
}

/// Number of ticks in each average's window.
fn ticks_per_average(limits: &MotionLimits) -> usize {
    let n = libm::ceilf(limits.smoothing_window_s() / TICK_S - 1e-3) as usize;
    n.clamp(1, MAX_WINDOW_TICKS)
}

#[cfg(test)]
mod tests;
