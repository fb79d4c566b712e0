//! The reference: a point that moves along the path ahead of the vehicle.
//!
//! Setpoints for the autopilot are made from the reference. It moves along the path no faster than
//! corners, walls and other vehicles allow, and waits for a vehicle that lags. A corner of angle θ
//! at speed v asks the vehicle for a sudden change of velocity Δv = 2·v·sin(θ/2). A velocity loop
//! with response time τ lets the vehicle stray Δv·τ from the path until it has caught up. So v = e
//! / (τ·2·sin(θ/2)) keeps the vehicle within the deviation e that the clearance of the two legs
//! allows. Between corners the acceleration is sent as feed-forward, so that the vehicle brakes
//! without lag. (Paper P2D §4 reports collisions where a waypoint counted as reached from a metre
//! away.)

pub mod deconflict;
pub mod safety;

use fpu::sqrtf;
use libm::{fabsf, fmaxf, fminf};

use crate::flight::{Path, Waypoint};
use crate::track::deconflict::Advice;
use crate::{Point, SettingError, check_positive};

/// Limits of speed, acceleration and deviation for [`advance`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackConfig {
    /// Nominal speed along the path, m/s.
    pub cruise_mps: f32,
    /// Greatest vertical speed upwards on a sloping leg, m/s.
    pub climb_mps: f32,
    /// Greatest vertical speed downwards on a sloping leg, m/s.
    pub descend_mps: f32,
    /// Horizontal acceleration and braking, m/s².
    pub accel_mps2: f32,
    /// Vertical acceleration and braking, m/s².
    pub accel_z_mps2: f32,
    /// Response time of the autopilot to a change of velocity in a corner, seconds. PX4's velocity
    /// loop takes 0.55 s (`MPC_XY_VEL_P_ACC` = 1.8 1/s) for a sudden change; for smooth setpoints
    /// with their acceleration it is less.
    pub response_s: f32,
    /// Vehicle radius, metres: it is subtracted from an edge's clearance.
    pub radius_m: f32,
    /// Least deviation from the path that is assumed in a corner, metres, where the clearance
    /// allows less: what the autopilot achieves at a crawl.
    pub deviation_min_m: f32,
    /// Largest deviation from the path that a corner may cause, metres, where the clearance allows
    /// more.
    pub deviation_max_m: f32,
    /// Largest distance of the reference ahead of the vehicle, metres: the reference slows from
    /// half of it and stops at it. Between walls the lead is limited to four times the deviation
    /// allowed there, so that a vehicle that lags does not cut the corner. In the open the limit
    /// grows with the speed.
    pub lead_max_m: f32,
}

impl TrackConfig {
    /// Checks that all numbers are positive and finite, and `deviation_min_m` is at most
    /// `deviation_max_m`; the error names the first that is not.
    pub fn check(&self) -> Result<(), SettingError> {
        check_positive(&[
            ("cruise_mps", self.cruise_mps),
            ("climb_mps", self.climb_mps),
            ("descend_mps", self.descend_mps),
            ("accel_mps2", self.accel_mps2),
            ("accel_z_mps2", self.accel_z_mps2),
            ("response_s", self.response_s),
            ("radius_m", self.radius_m),
            ("deviation_min_m", self.deviation_min_m),
            ("deviation_max_m", self.deviation_max_m),
            ("lead_max_m", self.lead_max_m),
        ])?;
        if self.deviation_min_m > self.deviation_max_m {
            return Err(SettingError("deviation_max_m"));
        }
        Ok(())
    }
}

impl Default for TrackConfig {
    /// An indoor vehicle of 2 m/s and 0.3 m radius.
    fn default() -> Self {
        Self {
            cruise_mps: 2.0,
            climb_mps: 2.0,
            descend_mps: 2.0,
            accel_mps2: 1.5,
            accel_z_mps2: 1.5,
            response_s: 0.35,
            radius_m: 0.3,
            deviation_min_m: 0.03,
            deviation_max_m: 0.25,
            lead_max_m: 1.2,
        }
    }
}

/// State of the reference on its path. All zero at the first waypoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceState {
    /// Arc length of the reference on its path, metres.
    pub along_m: f32,
    /// Speed of the reference along the path, m/s; negative where it flies back.
    pub speed_mps: f32,
}

/// The reference after a step: the point that the vehicle is to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Position of the reference, ENU metres in the mission frame.
    pub position: Point,
    /// Arc length of the position, metres.
    pub along_m: f32,
    /// Greatest distance of the vehicle behind the reference that is allowed at this position,
    /// metres.
    pub lead_limit_m: f32,
    /// Whether the reference has reached the end of the path.
    pub finished: bool,
}

/// Least value of [`Reference::lead_limit_m`], metres: an autopilot's lag at walking speed.
const MIN_LEAD_LIMIT_M: f32 = 0.4;
/// Additional lead in the open per m/s above [`WALKING_SPEED_MPS`], seconds: twice the delay of
/// setpoint, response and report together, since the reference slows from half the lead.
pub(crate) const LEAD_PER_SPEED_S: f32 = 0.8;
/// Walking speed, m/s: at this speed [`MIN_LEAD_LIMIT_M`] covers an autopilot's lag.
pub(crate) const WALKING_SPEED_MPS: f32 = 2.0;
/// Distance from the end of the path within which a reference that has almost stopped counts as at
/// the end, metres.
const PATH_END_TOLERANCE_M: f32 = 0.01;

/// Deviation from the path that a leg of this clearance allows: half of what the clearance leaves
/// beyond the vehicle's radius, within the configured bounds, metres.
fn allowed_deviation_m(cfg: &TrackConfig, clearance_m: f32) -> f32 {
    fminf(fmaxf((clearance_m - cfg.radius_m) * 0.5, cfg.deviation_min_m), cfg.deviation_max_m)
}

/// Upward part of a unit vector that still counts as level.
const LEVEL_UP: f32 = 1e-3;

/// Unit vector along the path from one waypoint to the next.
fn unit_direction(from: &Waypoint, to: &Waypoint) -> Point {
    (to.position - from.position) / (to.along_m - from.along_m)
}

/// Greatest speed and acceleration along a direction, with which horizontal and vertical parts stay
/// within their own limits.
fn speed_and_accel_limits(cfg: &TrackConfig, direction: &Point) -> (f32, f32) {
    let up = direction.z;
    if fabsf(up) < LEVEL_UP {
        return (cfg.cruise_mps, cfg.accel_mps2);
    }
    let z_mps = if up > 0.0 { cfg.climb_mps } else { cfg.descend_mps };
    (fminf(cfg.cruise_mps, z_mps / fabsf(up)), accel_limit(cfg, up))
}

/// Greatest acceleration along a unit vector of this upward part, with which horizontal and
/// vertical parts stay within their own limits, m/s².
fn accel_limit(cfg: &TrackConfig, up: f32) -> f32 {
    if fabsf(up) < LEVEL_UP {
        return cfg.accel_mps2;
    }
    let across = sqrtf(fmaxf(1.0 - up * up, 0.0));
    let accel = fminf(cfg.accel_mps2 / fmaxf(across, 1e-3), cfg.accel_z_mps2 / fabsf(up));
    fminf(accel, fmaxf(cfg.accel_mps2, cfg.accel_z_mps2))
}

/// Square of the greatest speed at a corner from unit direction `before` to `after`, m²/s². A
/// square, so that no square root is needed: on a board it is slow.
fn max_corner_speed_sq(cfg: &TrackConfig, clearance_m: f32, before: &Point, after: &Point) -> f32 {
    let change_sq = (after - before).norm_squared();
    let sweep = allowed_deviation_m(cfg, clearance_m) / cfg.response_s;
    fminf(cfg.cruise_mps * cfg.cruise_mps, sweep * sweep / fmaxf(change_sq, 1e-6))
}

/// Greatest speed from which a vehicle can stop within `twice_accel_distance / (2 · accel)` metres
/// if it begins to brake after `later_s`, m/s.
fn max_stoppable_speed(accel: f32, twice_accel_distance: f32, later_s: f32) -> f32 {
    let lost = accel * later_s;
    sqrtf(lost * lost + fmaxf(twice_accel_distance, 0.0)) - lost
}

/// The part of the path ahead of the reference.
struct PathAhead<'a> {
    /// All waypoints of the path, also those behind the reference.
    waypoints: &'a [Waypoint],
    /// Index of the next waypoint ahead.
    next_waypoint: usize,
    /// Arc length of the reference, metres.
    along_m: f32,
    /// Distance from the reference within which it has to stop, metres.
    stop_within_m: f32,
    /// Unit direction of the current leg.
    direction: Point,
    /// Acceleration limit of the current leg, m/s².
    accel: f32,
}

impl PathAhead<'_> {
    /// Square of the greatest speed now from which the reference can brake for every corner ahead,
    /// for the end of the path and for the stop that is required, m²/s². Summed leg by leg, since
    /// each leg has its own acceleration limit.
    fn max_stoppable_speed_sq(&self, cfg: &TrackConfig) -> f32 {
        let mut before = self.direction;
        let mut max_stoppable_speed_sq = f32::INFINITY;
        let (mut room, mut from_m, mut leg_accel) = (0.0, self.along_m, self.accel);
        let enough = 4.0 * (cfg.cruise_mps * cfg.cruise_mps + self.accel * self.accel);
        for (i, waypoint) in self.waypoints.iter().enumerate().skip(self.next_waypoint) {
            let stops_at = self.along_m + self.stop_within_m;
            if stops_at <= waypoint.along_m {
                max_stoppable_speed_sq =
                    fminf(max_stoppable_speed_sq, room + 2.0 * leg_accel * (stops_at - from_m));
                break;
            }
            room += 2.0 * leg_accel * (waypoint.along_m - from_m);
            if room >= enough {
                // With this much room the vehicle can stop before any corner beyond.
                break;
            }
            let corner_sq = match self.waypoints.get(i + 1) {
                Some(end) => {
                    let after = unit_direction(waypoint, end);
                    let clearance_m = fminf(waypoint.leg_clearance_m, end.leg_clearance_m);
                    let (fastest, after_accel) = speed_and_accel_limits(cfg, &after);
                    let corner_sq = max_corner_speed_sq(cfg, clearance_m, &before, &after);
                    (before, leg_accel) = (after, after_accel);
                    fminf(corner_sq, fastest * fastest)
                }
                None => 0.0,
            };
            max_stoppable_speed_sq = fminf(max_stoppable_speed_sq, corner_sq + room);
            from_m = waypoint.along_m;
        }
        max_stoppable_speed_sq
    }
}

/// Moves the reference by one step of `dt_s` (usually 0.01 to 0.2 s; more than 1 s counts as 1 s)
/// and returns it; `None` if the path is empty.
///
/// `advice` limits speed and distance because of neighbours. The speed changes by no more than the
/// leg's acceleration limit allows: a stop that is advised too late is overrun. Work: one pass over
/// the waypoints.
pub fn advance<const W: usize>(
    cfg: &TrackConfig,
    path: &Path<W>,
    reference: &mut ReferenceState,
    advice: &Advice,
    dt_s: f32,
) -> Option<Reference> {
    let points = path.waypoints();
    path.point_at(reference.along_m)?;
    let dt_s = if dt_s > 0.0 { fminf(dt_s, 1.0) } else { 0.0 };
    let length_m = path.length_m();
    let next = points.partition_point(|w| w.along_m <= reference.along_m);
    let leg = next.clamp(1, max_usize(points.len(), 2) - 1);
    let along_leg = |i: usize| match (points.get(i.wrapping_sub(1)), points.get(i)) {
        (Some(from), Some(to)) => unit_direction(from, to),
        _ => Point::zeros(),
    };
    let before = along_leg(leg);
    let (top_mps, accel) = speed_and_accel_limits(cfg, &before);
    // A NaN scale stops the reference.
    let top_mps =
        if advice.speed_scale > 0.0 { top_mps * fminf(advice.speed_scale, 1.0) } else { 0.0 };
    let stop_m = if advice.stop_within_m > 0.0 { advice.stop_within_m } else { 0.0 };
    let ahead = PathAhead {
        waypoints: points,
        next_waypoint: next,
        along_m: reference.along_m,
        stop_within_m: stop_m,
        direction: before,
        accel,
    };
    let max_stoppable_speed_sq = ahead.max_stoppable_speed_sq(cfg);
    let speed_before = reference.speed_mps;
    // No faster than the leg's acceleration can brake from, if braking begins with the next step.
    let most = fminf(top_mps, max_stoppable_speed(accel, max_stoppable_speed_sq, dt_s));
    let change = accel * dt_s;
    reference.speed_mps = fmaxf(fminf(most, speed_before + change), speed_before - change);
    let crawls = most < ABOUT_TO_STOP_MPS && reference.speed_mps >= 0.0;
    reference.along_m = fminf(fmaxf(reference.along_m + reference.speed_mps * dt_s, 0.0), length_m);
    // The last centimetres of braking take many steps; within one centimetre the end counts as
    // reached.
    if crawls
        && length_m - reference.along_m < PATH_END_TOLERANCE_M
        && stop_m >= length_m - reference.along_m
    {
        reference.along_m = length_m;
        reference.speed_mps = 0.0;
    }
    let clearance_m = points.get(leg).map_or(f32::INFINITY, |w| w.leg_clearance_m);
    Some(Reference {
        position: path.point_at(reference.along_m)?,
        along_m: reference.along_m,
        lead_limit_m: lead_limit_m(cfg, clearance_m, reference.speed_mps),
        finished: reference.along_m >= length_m,
    })
}

/// Legs ahead whose own braking [`braking_distance_m`] looks at; beyond them it takes the gentlest.
const BRAKING_LEGS: usize = 6;

/// Distance that the reference still flies if it is to stop now, metres: exact if it stops within
/// six legs, each of which has its own acceleration limit, else an upper bound.
pub fn braking_distance_m<const W: usize>(
    cfg: &TrackConfig,
    path: &Path<W>,
    reference: &ReferenceState,
) -> f32 {
    let points = path.waypoints();
    let next = points.partition_point(|w| w.along_m <= reference.along_m);
    let leg = next.clamp(1, max_usize(points.len(), 2) - 1);
    let speed_mps = fmaxf(reference.speed_mps, 0.0);
    let least_accel = fminf(cfg.accel_mps2, cfg.accel_z_mps2);
    let (mut speed_sq, mut from_m, mut accel) =
        (speed_mps * speed_mps, reference.along_m, f32::INFINITY);
    for (i, ends) in points.windows(2).skip(leg - 1).enumerate() {
        let [from, to] = ends else { break };
        if i == BRAKING_LEGS {
            accel = least_accel;
            break;
        }
        accel = accel_limit(cfg, (to.position.z - from.position.z) / (to.along_m - from.along_m));
        let slowed_sq = speed_sq - 2.0 * accel * (to.along_m - from_m);
        if slowed_sq <= 0.0 {
            break;
        }
        (speed_sq, from_m) = (slowed_sq, to.along_m);
    }
    from_m - reference.along_m + speed_sq / (2.0 * accel)
}

/// Greatest distance of the vehicle behind the reference on a leg of this clearance, at this speed
/// of the reference, metres.
fn lead_limit_m(cfg: &TrackConfig, clearance_m: f32, speed_mps: f32) -> f32 {
    let deviation_m = allowed_deviation_m(cfg, clearance_m);
    let lead_m = fminf(cfg.lead_max_m, fmaxf(4.0 * deviation_m, MIN_LEAD_LIMIT_M));
    // Between walls the lead does not grow with the speed: a vehicle that lags could cut a corner.
    let open = deviation_m >= cfg.deviation_max_m;
    if open {
        lead_m + LEAD_PER_SPEED_S * fmaxf(fabsf(speed_mps) - WALKING_SPEED_MPS, 0.0)
    } else {
        lead_m
    }
}

/// A reference slower than this is about to stop, m/s.
const ABOUT_TO_STOP_MPS: f32 = 0.05;

/// The greater of two numbers.
fn max_usize(a: usize, b: usize) -> usize {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests;
