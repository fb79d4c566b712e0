//! The margins that the host plans with, and their sums. The companion's own margins are in
//! [`companion::margins`].
//!
//! | what | value |
//! |---|---|
//! | margin to walls, beyond the hull | tracking + estimate + gust |
//! | separation of two paths | safety distance + 2 (tracking + estimate) |
//! | separation to parked vehicle | safety distance + [`DEVIATION_BESIDE_PARKED_M`] + estimate + gust |
//! | tracking | [`companion::margins::CRUISE_TRACKING_ERROR_M`] |
//! | beside parked vehicles, large swarms | `MAX_EXTRA_BESIDE_PARKED_M` more, where there is room |
//! | estimate, `rtk` | part of the tracking: at most 0.1 m |
//! | estimate, `recorded`, PX4 | 0.65 m |
//! | estimate, `recorded`, ArduPilot | 0.12 m: the greatest recorded error |
//! | height | `rtk` 0.15 m; `recorded` PX4 1.1 m, ArduPilot 0.3 m: a lower camera shows less |
//! | gust | [`DEVIATION_PER_GUST_S`] × `gust_mps`: how far gusts push a vehicle off its path |
//! | touchdown, PX4 | 0.5 m + [`DEVIATION_PER_GUST_S`] × `gust_mps` |
//! | usable footprint | from the lowest height, less 2 × margin, along lanes also less 2 × delay |
//!
//! - Tracking is the deviation of a vehicle's estimated position from its path; estimate is the
//!   error of the estimated position. Two vehicles in the air may deviate towards each other. A
//!   parked vehicle does not move, but it stands off its pad by the error of its estimate at
//!   touchdown.
//! - The default margin and [`PAIR_DEVIATION_M`] were measured with the estimator `rtk`.
//! - With `recorded` a PX4 reports an accuracy of 0.2 m: 0.65 m is three times that and a reserve.
//!   Its errors were up to 0.75 m horizontally and 1.1 m in height, rarely, and not together with a
//!   tracking error.
//! - PX4 touched down up to 0.7 m off its pad without wind, and up to 1.1 m in gusts of 3 m/s; two
//!   vehicles rarely touched down towards each other.
//! - Pictures are taken up to the margin beside their waypoints, and [`TRIGGER_DELAY_S`] after
//!   passing them: the delay is the distance flown meanwhile.

use companion::autopilot::AutopilotKind;
use companion::margins::CRUISE_TRACKING_ERROR_M;
use planner_core::Point;
use planner_core::coverage::footprint::{Footprint, Spacing};

use crate::scenario::{PositionErrors, Simulation, VehicleSection};

/// Sum of the deviations of two vehicles from their paths, which the default separation adds to the
/// safety distance, metres.
pub const PAIR_DEVIATION_M: f32 = 0.5;
/// As [`PAIR_DEVIATION_M`], for coverage missions, metres: greater, since there is room, and for
/// receivers without RTK.
pub const PAIR_DEVIATION_COVERAGE_M: f32 = 2.4;
/// Deviation of a flying vehicle from its path that is added to the separation from a parked
/// vehicle, metres.
pub const DEVIATION_BESIDE_PARKED_M: f32 = 0.25;
/// Further distance from parked vehicles in swarms of more than [`MAX_VEHICLES_WITHOUT_EXTRA`],
/// where pads and goals leave room for it, metres. In gusts of 3 m/s vehicles were up to 0.5 m off
/// their paths, and in a large swarm many pass beside parked ones.
const MAX_EXTRA_BESIDE_PARKED_M: f32 = 0.1;
/// Most vehicles of a swarm for which [`MAX_EXTRA_BESIDE_PARKED_M`] is not added.
const MAX_VEHICLES_WITHOUT_EXTRA: usize = 12;
/// Distance that has to remain between pads and goals beyond the separation from a parked vehicle,
/// metres.
const MIN_REMAINING_PAD_GAP_M: f32 = 0.1;
/// Further deviation of one vehicle from its path, metres per m/s of peak gust, that is seconds.
/// Gusts do not push two vehicles towards each other at the same time, so it is added only for one
/// vehicle beside a parked one or a wall.
pub const DEVIATION_PER_GUST_S: f32 = 0.05;

/// Greatest horizontal distance of a position estimate from the truth, beyond the part that the
/// tracking margin covers, metres.
pub fn estimate_error_margin_m(estimator: PositionErrors, autopilot: AutopilotKind) -> f32 {
    match (estimator, autopilot) {
        (PositionErrors::Perfect | PositionErrors::Rtk, _) => 0.0,
        (PositionErrors::Recorded, AutopilotKind::Px4) => 0.65,
        (PositionErrors::Recorded, AutopilotKind::ArduPilot) => 0.12,
    }
}

/// Distances that a scenario has to leave for errors, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequiredDistances {
    /// Distance between the hull of a vehicle and walls, metres.
    pub wall_margin_m: f32,
    /// Distance between the paths of two vehicles, centre to centre, metres.
    pub separation_m: f32,
}

/// The distances required by the vehicles with the greatest errors: the worst one beside a wall,
/// the worst two beside each other.
pub fn required_distances(
    simulation: &Simulation,
    safety_distance_m: f32,
    vehicles: &[VehicleSection],
) -> RequiredDistances {
    let mut errors: Vec<f32> = vehicles
        .iter()
        .map(|v| {
            CRUISE_TRACKING_ERROR_M + estimate_error_margin_m(simulation.estimator, v.autopilot)
        })
        .collect();
    errors.sort_by(|a, b| b.total_cmp(a));
    let worst = |k: usize| errors.get(k).copied().unwrap_or(0.0);
    RequiredDistances {
        wall_margin_m: worst(0) + DEVIATION_PER_GUST_S * simulation.gust_peak_mps,
        separation_m: safety_distance_m + worst(0) + worst(1),
    }
}

/// Delay from passing a waypoint to its picture, seconds: one step of the companion, transmission
/// of the command, and one check of the autopilot.
pub const TRIGGER_DELAY_S: f32 = 0.15;

/// Least distance between two pads, centre to centre, metres: one vehicle lands beside another that
/// has landed, and both touch down off their pads.
pub fn min_pad_distance_m(
    simulation: &Simulation,
    safety_distance_m: f32,
    vehicles: &[VehicleSection],
) -> f32 {
    let own = |v: &VehicleSection| {
        estimate_error_margin_m(simulation.estimator, v.autopilot)
            + touchdown_extra_m(simulation.gust_peak_mps, v.autopilot)
    };
    parked_separation_m(simulation, safety_distance_m, vehicles)
        + vehicles.iter().map(own).fold(0.0, f32::max)
}

/// Greatest horizontal distance from its pad at which a vehicle touches down, metres.
pub fn max_touchdown_offset_m(simulation: &Simulation, vehicle: &VehicleSection) -> f32 {
    DEVIATION_BESIDE_PARKED_M
        + DEVIATION_PER_GUST_S * simulation.gust_peak_mps
        + estimate_error_margin_m(simulation.estimator, vehicle.autopilot)
        + touchdown_extra_m(simulation.gust_peak_mps, vehicle.autopilot)
}

/// Distance by which a touchdown may be further off the pad than a flying vehicle off its path,
/// metres. A PX4 that arrives over its pad fast, or in wind, has wound up the integrator of its
/// controller, which carries it on once the companion stops holding it.
fn touchdown_extra_m(gust_mps: f32, autopilot: AutopilotKind) -> f32 {
    match autopilot {
        AutopilotKind::Px4 => 0.5 + DEVIATION_PER_GUST_S * gust_mps,
        AutopilotKind::ArduPilot => 0.0,
    }
}

/// Greatest amount by which a vehicle's estimated height exceeds its true height, metres.
pub fn max_height_error_m(estimator: PositionErrors, autopilot: AutopilotKind) -> f32 {
    match (estimator, autopilot) {
        (PositionErrors::Perfect | PositionErrors::Rtk, _) => 0.15,
        (PositionErrors::Recorded, AutopilotKind::Px4) => 1.1,
        (PositionErrors::Recorded, AutopilotKind::ArduPilot) => 0.3,
    }
}

/// The spacing with its footprint reduced to the part that the plan counts on, for pictures from
/// `height_m` above ground: they may be taken beside their waypoints, from lower, and late. The
/// footprint stays at least as large as the spacings: a smaller one would be refused as leaving
/// gaps.
pub fn with_usable_footprint(
    spacing: &Spacing,
    height_m: f32,
    cruise_mps: f32,
    simulation: &Simulation,
    vehicles: &[VehicleSection],
) -> Spacing {
    let error_m = required_distances(simulation, 0.0, vehicles).wall_margin_m;
    let lower_m = vehicles
        .iter()
        .map(|v| max_height_error_m(simulation.estimator, v.autopilot))
        .fold(0.0, f32::max);
    let share = (1.0 - lower_m / height_m).max(0.0);
    let fastest_mps = vehicles.iter().map(|vehicle| vehicle.speed_max_mps).fold(0.0, f32::max);
    let late_m = TRIGGER_DELAY_S * cruise_mps.min(fastest_mps);
    let along_m = spacing.footprint.along_m * share - 2.0 * (error_m + late_m);
    let across_m = spacing.footprint.across_m * share - 2.0 * error_m;
    let footprint = Footprint {
        along_m: along_m.max(spacing.max_waypoint_spacing_m),
        across_m: across_m.max(spacing.max_lane_spacing_m),
    };
    Spacing { footprint, ..*spacing }
}

/// Distance that is added to `parked_m`, the separation from a parked vehicle, in a mission whose
/// vehicles stand at `pads` and land at `landed`, metres. Places nearer to each other than
/// `parked_m` are never both taken.
pub fn extra_beside_parked_m(parked_m: f32, pads: &[Point], landed: &[Point]) -> f32 {
    if pads.len() <= MAX_VEHICLES_WITHOUT_EXTRA {
        return 0.0;
    }
    let places = [pads, landed].concat();
    let pairs = (0..places.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
    let apart_m = pairs
        .map(|(j, i)| (places[i] - places[j]).norm())
        .filter(|apart_m| *apart_m >= parked_m)
        .fold(f32::INFINITY, f32::min);
    (apart_m - MIN_REMAINING_PAD_GAP_M - parked_m).clamp(0.0, MAX_EXTRA_BESIDE_PARKED_M)
}

/// Least distance between a flight path and a vehicle parked on the ground, centre to centre,
/// metres.
pub fn parked_separation_m(
    simulation: &Simulation,
    safety_distance_m: f32,
    vehicles: &[VehicleSection],
) -> f32 {
    let estimates =
        vehicles.iter().map(|v| estimate_error_margin_m(simulation.estimator, v.autopilot));
    safety_distance_m
        + DEVIATION_BESIDE_PARKED_M
        + DEVIATION_PER_GUST_S * simulation.gust_peak_mps
        + estimates.fold(0.0, f32::max)
}

#[cfg(test)]
mod tests;
