//! Motion limits of a vehicle: the mission's, lowered to the autopilot's where those are lower.

use libm::{fmaxf, fminf};
use planner_core::track::TrackConfig;
use planner_core::track::deconflict::DeconflictConfig;
use planner_core::track::safety::{Braking, MotionBounds};
use planner_core::{Point, SettingError};

use crate::autopilot::limits::{AutopilotLimits, Limit};
use crate::config::Config;
use crate::margins::UNHEARD_NOTICED_AFTER_S;

/// Greatest jerk of a setpoint, m/s³, unless the autopilot's limit is lower.
pub const MAX_JERK_MPS3: f32 = 4.0;
/// Greatest jerk of a setpoint while the safety filter stops the vehicle, m/s³.
pub const MAX_URGENT_JERK_MPS3: f32 = 8.0;
/// Greatest acceleration of a setpoint as a multiple of the reference's, which corners need, unless
/// the autopilot's limit is lower.
const MAX_SETPOINT_ACCEL_FACTOR: f32 = 1.5;
/// Least horizontal acceleration of a setpoint as a multiple of the reference's: with less the
/// setpoint swings about the reference. Where the autopilot's limit is lower, the reference's is
/// lowered.
const MIN_SETPOINT_ACCEL_FACTOR: f32 = 1.2;
/// Least ratio of the reference's vertical to its horizontal braking with which advice assumes the
/// horizontal braking everywhere; with weaker vertical braking, advice assumes less. Advice looks
/// ahead for twice the braking distance, which covers a stop with two thirds of the braking.
const MIN_VERTICAL_BRAKING_SHARE: f32 = 2.0 / 3.0;
/// Share that a corner takes of the acceleration that a setpoint may have across the reference's
/// own.
const CORNER_SHARE_OF_SPARE_ACCEL: f32 = 0.53;

/// Longest window of the smoother's moving averages, seconds. Where a low jerk limit would need a
/// longer window, the acceleration is lowered.
pub(crate) const MAX_SMOOTHING_WINDOW_S: f32 = 1.2;
/// Shortest window of the smoother's moving averages, seconds.
const MIN_SMOOTHING_WINDOW_S: f32 = 0.4;
/// Factor by which the jerk of the smoother's averages stays below the limit: the rest is for
/// corners and for the smoother's clock, which may run slower.
const JERK_RESERVE_FACTOR: f32 = 1.12;
/// Least time that is assumed from when a vehicle was last heard until it has stopped, seconds.
const MIN_UNHEARD_STOP_TIME_S: f32 = 3.0;
/// Least value of the limit of the speed on a straight leg (climb, way to the path, descent), m/s:
/// a higher climb speed is the limit instead. A vehicle whose speeds are all lower flies slower.
pub(crate) const MIN_LEG_SPEED_LIMIT_MPS: f32 = 1.0;

/// With how much jerk a setpoint may brake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// Outside stops by the safety filter.
    Smooth,
    /// In a stop by the safety filter, with twice the jerk.
    Urgent,
}

/// Limits of a vehicle's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Greatest speed along the path, m/s.
    pub speed_mps: f32,
    /// Greatest speed upwards, m/s.
    pub climb_mps: f32,
    /// Greatest speed downwards, m/s.
    pub descend_mps: f32,
    /// Greatest horizontal acceleration of the reference, m/s².
    pub accel_mps2: f32,
    /// Greatest vertical acceleration of the reference, m/s².
    pub accel_z_mps2: f32,
    /// Greatest acceleration of a setpoint, horizontal and vertical, m/s². It is above that of the
    /// reference: at a corner the change of direction adds to braking and acceleration.
    pub max_setpoint_accel_mps2: [f32; 2],
    /// Greatest jerk of a setpoint, m/s³.
    pub jerk_mps3: f32,
}

impl MotionLimits {
    /// The mission's limits, lowered to the autopilot's.
    pub(crate) fn new<const V: usize>(config: &Config<V>, autopilot: &AutopilotLimits) -> Self {
        let least = |of: &[Limit]| {
            of.iter().fold(f32::INFINITY, |least, l| fminf(least, autopilot.get(*l)))
        };
        let jerk_mps3 = fminf(MAX_JERK_MPS3, least(&[Limit::JerkXy, Limit::JerkZ]));
        // A change from this acceleration to its opposite, spread over the longest average's
        // window, has that jerk.
        let smooth_mps2 = 0.5 * jerk_mps3 * MAX_SMOOTHING_WINDOW_S;
        let accel_mps2 = fminf(config.accel_mps2, smooth_mps2);
        let (across_mps2, vertical_mps2) =
            (least(&[Limit::AccelXy]), least(&[Limit::AccelUp, Limit::AccelDown]));
        Self {
            speed_mps: fminf(config.cruise_mps, least(&[Limit::SpeedXy])),
            climb_mps: fminf(config.climb_mps, least(&[Limit::Climb])),
            descend_mps: fminf(config.descend_mps, least(&[Limit::Descend])),
            accel_mps2: fminf(accel_mps2, across_mps2 / MIN_SETPOINT_ACCEL_FACTOR),
            accel_z_mps2: fminf(accel_mps2, vertical_mps2),
            max_setpoint_accel_mps2: [across_mps2, vertical_mps2]
                .map(|most| fminf(MAX_SETPOINT_ACCEL_FACTOR * accel_mps2, most)),
            jerk_mps3,
        }
    }

    /// Response time that the reference assumes in a corner, seconds: longer than an autopilot's
    /// where the change of velocity, spread over the smoother's window beside the braking before
    /// the corner, would take more acceleration than a setpoint may have.
    fn corner_response_s(&self) -> f32 {
        let usual = TrackConfig::default();
        let most_mps2 = self.max_setpoint_accel_mps2[0];
        let spare_sq = most_mps2 * most_mps2 - self.accel_mps2 * self.accel_mps2;
        let spare_mps2 = CORNER_SHARE_OF_SPARE_ACCEL * libm::sqrtf(fmaxf(spare_sq, 0.0));
        let sweep_mps = spare_mps2 * self.smoothing_window_s();
        fmaxf(usual.response_s, usual.deviation_max_m / fmaxf(sweep_mps, 1e-3))
    }

    /// Window of each of the smoother's moving averages, seconds: long enough for the jerk limit.
    pub(crate) fn smoothing_window_s(&self) -> f32 {
        let jerk_mps3 = self.jerk(Urgency::Smooth);
        let window_s = 2.0 * JERK_RESERVE_FACTOR * self.accel_mps2 / jerk_mps3;
        window_s.clamp(MIN_SMOOTHING_WINDOW_S, MAX_SMOOTHING_WINDOW_S)
    }

    /// Greatest jerk of a setpoint, m/s³; higher where the safety filter stops the vehicle.
    pub(crate) fn jerk(&self, urgency: Urgency) -> f32 {
        match urgency {
            Urgency::Smooth => self.jerk_mps3,
            Urgency::Urgent => fminf(MAX_URGENT_JERK_MPS3, 2.0 * self.jerk_mps3),
        }
    }

    /// Greatest acceleration of the reference along a direction (a unit vector, or nearly zero),
    /// m/s².
    pub(crate) fn accel_along(&self, direction: &Point) -> f32 {
        let (across, up) = (libm::hypotf(direction.x, direction.y), libm::fabsf(direction.z));
        let least =
            fminf(self.accel_mps2 / fmaxf(across, 1e-3), self.accel_z_mps2 / fmaxf(up, 1e-3));
        fminf(least, fmaxf(self.accel_mps2, self.accel_z_mps2))
    }

    /// The acceleration, limited horizontally and vertically to that of a setpoint, m/s².
    pub(crate) fn clamp_accel(&self, accel: &Point) -> Point {
        let across = libm::hypotf(accel.x, accel.y);
        let [most, most_z] = self.max_setpoint_accel_mps2;
        let share = most / fmaxf(across, most);
        let z = fmaxf(fminf(accel.z, most_z), -most_z);
        Point::new(accel.x * share, accel.y * share, z)
    }

    /// The greatest of the speed limits along the path, upwards and downwards, m/s.
    pub(crate) fn max_speed_mps(&self) -> f32 {
        fmaxf(self.speed_mps, fmaxf(self.climb_mps, self.descend_mps))
    }
}

/// Limits that guidance passes to the calls of planner-core.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GuidanceLimits {
    /// Limits of the reference along the path.
    pub(crate) track: TrackConfig,
    /// Limits of the reference along a straight leg: climb, way to the path, or descent.
    pub(crate) leg_track: TrackConfig,
    /// Settings of the advice on speed and stops for neighbours.
    pub(crate) deconflict: DeconflictConfig,
    /// Speed that neighbours are assumed to fly at most, m/s.
    pub(crate) fastest_vehicle_mps: f32,
}

impl GuidanceLimits {
    /// The limits by the mission's settings and the autopilot's limits.
    pub(crate) fn new<const V: usize>(config: &Config<V>, autopilot: &AutopilotLimits) -> Self {
        let limits = MotionLimits::new(config, autopilot);
        let track = TrackConfig {
            cruise_mps: limits.speed_mps,
            climb_mps: autopilot.get(Limit::Climb),
            descend_mps: autopilot.get(Limit::Descend),
            accel_mps2: limits.accel_mps2,
            accel_z_mps2: limits.accel_z_mps2,
            radius_m: config.radius_m,
            response_s: limits.corner_response_s(),
            ..TrackConfig::default()
        };
        let leg_track = TrackConfig {
            cruise_mps: limits.max_speed_mps().min(MIN_LEG_SPEED_LIMIT_MPS.max(limits.climb_mps)),
            climb_mps: limits.climb_mps,
            descend_mps: limits.descend_mps,
            ..track
        };
        let deconflict = DeconflictConfig {
            method: config.method,
            safety_distance_m: config.safety_distance_m,
            cruise_mps: config.cruise_mps,
            // The reference has to stop where advice says so.
            accel_mps2: fminf(
                config.accel_mps2,
                fminf(limits.accel_mps2, limits.accel_z_mps2 / MIN_VERTICAL_BRAKING_SHARE),
            ),
        };
        Self { track, leg_track, deconflict, fastest_vehicle_mps: config.fastest_vehicle_mps }
    }

    /// Whether planner-core accepts these limits, and the safety filter's that follow from them.
    pub(crate) fn check(&self) -> Result<(), SettingError> {
        self.track.check()?;
        self.leg_track.check()?;
        self.deconflict.check()?;
        neighbour_motion_bounds(&self.track, self.fastest_vehicle_mps).check()
    }
}

/// Limits within which neighbours are expected to fly and stop: the speed of the mission's fastest
/// vehicle, which may be another vehicle, and the braking of this vehicle.
pub(crate) fn neighbour_motion_bounds(
    track: &TrackConfig,
    fastest_vehicle_mps: f32,
) -> MotionBounds {
    let braking = Braking { accel_mps2: track.accel_mps2, jerk_mps3: MAX_URGENT_JERK_MPS3 };
    let speed_max_mps = fmaxf(track.cruise_mps, fastest_vehicle_mps);
    // Distance that an unheard vehicle flies until it has stopped, divided by its full speed.
    let stopped_s =
        UNHEARD_NOTICED_AFTER_S + braking.stop_distance_m(speed_max_mps) / speed_max_mps;
    MotionBounds {
        braking,
        speed_max_mps,
        stopped_when_unheard_for_s: fmaxf(MIN_UNHEARD_STOP_TIME_S, stopped_s),
    }
}

#[cfg(test)]
mod tests;
