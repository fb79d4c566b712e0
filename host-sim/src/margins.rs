//! The margins that the desk plans with, added up in one place; the companion's are in [`companion::margins`].
//!
//! | what | value | reason |
//! |---|---|---|
//! | margin to walls | tracking + estimate + gust | beyond the hull: what a path's edge is tested at |
//! | separation of paths | safety distance + 2 (tracking + estimate) | both vehicles err towards each other |
//! | separation from one that stands | safety distance + tracking + estimate + gust | it stands where the referee sees it, but its path ended where it believed to be |
//! | tracking | [`companion::margins::TRACKING_M`] | beside the path by the own estimate |
//! | estimate, `rtk` | part of the tracking | at most 0.1 m; the default margin and [`STRAY_M`] are measured with it |
//! | estimate, `recorded`, PX4 | 0.65 m | three times the 0.2 m it reports, and a reserve; errors were up to 0.75 m across and 1.1 m in height, seldom and not beside an error of tracking |
//! | estimate, `recorded`, ArduPilot | 0.12 m | the greatest recorded error |
//! | gust | [`STRAY_PER_GUST_S`] × `gust_mps` | what a vehicle gives way to gusts that blow it |

use companion::margins::TRACKING_M;

use crate::scenario::{Estimator, Personality, Simulation, Vehicle};

/// What two vehicles together may stray from their paths, beyond the safety distance, metres.
pub const STRAY_M: f32 = 0.5;
/// What one vehicle may stray beside another that stands on the ground, metres.
pub const STRAY_BESIDE_PARKED_M: f32 = 0.25;
/// How much further gusts carry one vehicle, for each m/s of their peak, seconds. Two are not carried towards each other
/// at once, so this is for one beside another that stands, or a wall.
pub const STRAY_PER_GUST_S: f32 = 0.05;

/// How far an estimate may be from the truth, beyond what tracking covers, metres.
pub fn estimate_m(estimator: Estimator, autopilot: Personality) -> f32 {
    match (estimator, autopilot) {
        (Estimator::Perfect | Estimator::Rtk, _) => 0.0,
        (Estimator::Recorded, Personality::Px4) => 0.65,
        (Estimator::Recorded, Personality::Ardupilot) => 0.12,
    }
}

/// What a scenario has to keep, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Needed {
    /// To walls, beyond the hull.
    pub margin_m: f32,
    /// Between the paths of two vehicles, centre to centre.
    pub separation_m: f32,
}

/// What a swarm has to keep: that of its worst vehicles.
pub fn needed(simulation: &Simulation, safety_distance_m: f32, vehicles: &[Vehicle]) -> Needed {
    let mut errors: Vec<f32> =
        vehicles.iter().map(|v| TRACKING_M + estimate_m(simulation.estimator, v.personality)).collect();
    errors.sort_by(|a, b| b.total_cmp(a));
    let worst = |k: usize| errors.get(k).copied().unwrap_or(0.0);
    Needed {
        margin_m: worst(0) + STRAY_PER_GUST_S * simulation.gust_mps,
        separation_m: safety_distance_m + worst(0) + worst(1),
    }
}

/// What a path keeps from a vehicle that stands on the ground, metres.
pub fn parked_separation_m(simulation: &Simulation, safety_distance_m: f32, vehicles: &[Vehicle]) -> f32 {
    let estimates = vehicles.iter().map(|v| estimate_m(simulation.estimator, v.personality));
    safety_distance_m
        + STRAY_BESIDE_PARKED_M
        + STRAY_PER_GUST_S * simulation.gust_mps
        + estimates.fold(0.0, f32::max)
}
