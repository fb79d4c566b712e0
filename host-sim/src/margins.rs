//! The margins that the desk plans with, added up in one place; the companion's are in
//! [`companion::margins`].
//!
//! | what | value | reason |
//! |---|---|---|
//! | margin to walls | tracking + estimate + gust | beyond the hull: what a path's edge is tested at |
//! | separation of paths | safety distance + 2 (tracking + estimate) | both vehicles err towards each other |
//! | separation from one that stands | safety distance + tracking + estimate + gust | it stands where the referee sees it, but its path ended where it believed to be |
//! | tracking | [`companion::margins::TRACKING_M`] | beside the path by the own estimate |
//! | estimate, `rtk` | part of the tracking | at most 0.1 m; the default margin and [`PAIR_STRAY_M`] are measured with it |
//! | estimate, `recorded`, PX4 | 0.65 m | three times the 0.2 m it reports, and a reserve; errors were up to 0.75 m across and 1.1 m in height, rarely and not beside an error of tracking |
//! | estimate, `recorded`, ArduPilot | 0.12 m | the greatest recorded error |
//! | touchdown, PX4 | 0.5 m, and [`STRAY_PER_GUST_S`] × `gust_mps` | pads: up to 0.7 m beside them without wind, 1.1 m in gusts of 3 m/s, rarely two towards each other |
//! | part of a picture that counts | what it shows less twice the margin, and what [`TRIGGER_DELAY_S`] at cruise is along the lanes | the camera is not where the waypoint is |
//! | height, `recorded` | PX4 1.1 m, ArduPilot 0.3 m | a lower camera shows less |
//! | gust | [`STRAY_PER_GUST_S`] × `gust_mps` | what a vehicle gives way to gusts that blow it |

use companion::margins::TRACKING_M;
use planner_core::coverage::footprint::{Footprint, Spacing};
use sim_autopilot::{AutopilotKind, Estimator};

use crate::scenario::{Simulation, Vehicle};

/// Stray of two vehicles from their paths, together, beyond the safety distance, metres.
pub const PAIR_STRAY_M: f32 = 0.5;
/// Stray of two vehicles together over fields, where there is room, and receivers without RTK,
/// metres.
pub const PAIR_STRAY_OVER_FIELDS_M: f32 = 2.4;
/// Stray of one vehicle beside another that stands on the ground, metres.
pub const STRAY_BESIDE_PARKED_M: f32 = 0.25;
/// Further stray of one vehicle in gusts, for each m/s of their peak, seconds. Two vehicles are not
/// carried towards each other at once, so this is for one beside another that stands, or a wall.
pub const STRAY_PER_GUST_S: f32 = 0.05;

/// Greatest distance of an estimate from the truth, beyond the part that tracking covers, metres.
pub fn max_estimate_error_m(estimator: Estimator, autopilot: AutopilotKind) -> f32 {
    match (estimator, autopilot) {
        (Estimator::Perfect | Estimator::Rtk, _) => 0.0,
        (Estimator::Recorded, AutopilotKind::Px4) => 0.65,
        (Estimator::Recorded, AutopilotKind::Ardupilot) => 0.12,
    }
}

/// Distances that a scenario has to keep, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequiredDistances {
    /// Distance to walls, beyond the hull.
    pub margin_m: f32,
    /// Between the paths of two vehicles, centre to centre.
    pub separation_m: f32,
}

/// Distances that a swarm has to keep: those of its worst vehicles.
pub fn required_distances(
    simulation: &Simulation,
    safety_distance_m: f32,
    vehicles: &[Vehicle],
) -> RequiredDistances {
    let mut errors: Vec<f32> = vehicles
        .iter()
        .map(|v| TRACKING_M + max_estimate_error_m(simulation.estimator, v.personality))
        .collect();
    errors.sort_by(|a, b| b.total_cmp(a));
    let worst = |k: usize| errors.get(k).copied().unwrap_or(0.0);
    RequiredDistances {
        margin_m: worst(0) + STRAY_PER_GUST_S * simulation.gust_mps,
        separation_m: safety_distance_m + worst(0) + worst(1),
    }
}

/// Delay from passing a waypoint to its picture, seconds: a step of the companion, a command, and a
/// check of the autopilot's.
pub const TRIGGER_DELAY_S: f32 = 0.15;

/// Least distance between pads, metres: a vehicle comes down beside one that came down, and both
/// err.
pub fn min_pad_distance_m(
    simulation: &Simulation,
    safety_distance_m: f32,
    vehicles: &[Vehicle],
) -> f32 {
    let own = |v: &Vehicle| {
        max_estimate_error_m(simulation.estimator, v.personality)
            + touchdown_extra_m(simulation.gust_mps, v.personality)
    };
    parked_separation_m(simulation, safety_distance_m, vehicles)
        + vehicles.iter().map(own).fold(0.0, f32::max)
}

/// Distance by which a vehicle touches down further beside its pad than it flies beside its path,
/// metres. A PX4 that comes over its pad fast, or is blown, has its integrator against it, which
/// carries it on once the companion no longer holds it.
fn touchdown_extra_m(gust_mps: f32, autopilot: AutopilotKind) -> f32 {
    match autopilot {
        AutopilotKind::Px4 => 0.5 + STRAY_PER_GUST_S * gust_mps,
        AutopilotKind::Ardupilot => 0.0,
    }
}

/// Greatest depth of a vehicle below where it believes to be, metres.
pub fn max_height_error_m(estimator: Estimator, autopilot: AutopilotKind) -> f32 {
    match (estimator, autopilot) {
        (Estimator::Perfect | Estimator::Rtk, _) => 0.15,
        (Estimator::Recorded, AutopilotKind::Px4) => 1.1,
        (Estimator::Recorded, AutopilotKind::Ardupilot) => 0.3,
    }
}

/// Part of a picture taken at `height_m` that the plan counts on: the picture is taken beside its
/// waypoint, lower and late. No less than the spacings: where these leave no overlap there is none
/// to plan with.
pub fn usable_footprint(
    spacing: &Spacing,
    height_m: f32,
    cruise_mps: f32,
    simulation: &Simulation,
    vehicles: &[Vehicle],
) -> Spacing {
    let stray_m = required_distances(simulation, 0.0, vehicles).margin_m;
    let lower_m = vehicles
        .iter()
        .map(|v| max_height_error_m(simulation.estimator, v.personality))
        .fold(0.0, f32::max);
    let share = (1.0 - lower_m / height_m).max(0.0);
    let along_m =
        spacing.footprint.along_m * share - 2.0 * (stray_m + TRIGGER_DELAY_S * cruise_mps);
    let across_m = spacing.footprint.across_m * share - 2.0 * stray_m;
    let footprint = Footprint {
        along_m: along_m.max(spacing.waypoint_m),
        across_m: across_m.max(spacing.lane_m),
    };
    Spacing { footprint, ..*spacing }
}

/// Distance that a path keeps from a vehicle that stands on the ground, metres.
pub fn parked_separation_m(
    simulation: &Simulation,
    safety_distance_m: f32,
    vehicles: &[Vehicle],
) -> f32 {
    let estimates =
        vehicles.iter().map(|v| max_estimate_error_m(simulation.estimator, v.personality));
    safety_distance_m
        + STRAY_BESIDE_PARKED_M
        + STRAY_PER_GUST_S * simulation.gust_mps
        + estimates.fold(0.0, f32::max)
}
