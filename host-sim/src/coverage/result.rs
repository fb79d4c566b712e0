//! The `result.json` of a coverage plan, and its coverage section.

use planner_core::coverage::pack::Route;
use planner_core::flight::Trigger;
use serde::Serialize;

use super::CoveragePlan;
use super::check::CoverageFindings;
use super::sorties::Sortie;
use crate::result::{
    CoverageResult, RoadmapCounts, RouteResult, Safety, SortieResult, TerrainResult, Totals,
    VehicleResult, rounded,
};

/// The `result.json` of `host-sim cover`.
#[derive(Debug, Serialize)]
pub struct CoverResult {
    /// `"cover"`.
    pub command: &'static str,
    /// Path of the scenario.
    pub scenario: String,
    /// Seed of the scenario.
    pub seed: u64,
    /// Name of the method that divided the area.
    pub method: &'static str,
    /// Whether the check of the plan found no fault.
    pub complete: bool,
    /// A row for each vehicle of the scenario.
    pub vehicles: Vec<VehicleResult>,
    /// Length and duration of all flights.
    pub totals: Totals,
    /// Separation of the planned flights.
    pub safety: Safety,
    /// Always empty: a coverage mission has no roadmap.
    pub roadmap: RoadmapCounts,
    /// The coverage section.
    pub coverage: CoverageResult,
}

/// The `result.json` of a plan and its check.
pub fn cover_result(planned: &CoveragePlan<'_>, findings: &CoverageFindings) -> CoverResult {
    let scenario = planned.scenario;
    let routes = &planned.plan.routes;
    let makespan_s = planned.sorties.iter().map(Sortie::landing_s).fold(0.0, f32::max);
    let least_m = planned.closest_approach_m;
    CoverResult {
        command: "cover",
        scenario: scenario.path.clone(),
        seed: scenario.seed,
        method: planned.method.name(),
        complete: findings.is_clean(),
        totals: Totals {
            path_m: rounded(routes.iter().map(|route| planned.sorties_cost_m(route)).sum()),
            makespan_s: rounded(makespan_s),
        },
        safety: Safety {
            wall_contacts: 0,
            wall_contacts_under_pilot: 0,
            min_clearance_m: None,
            min_separation_m: least_m.is_finite().then(|| rounded(least_m)),
            safety_distance_m: rounded(scenario.deconfliction.safety_distance_m),
            violations: u32::from(least_m < scenario.deconfliction.safety_distance_m * 0.999),
            deadlocks: 0,
        },
        roadmap: RoadmapCounts { nodes: 0, edges: 0, file_bytes: 0 },
        coverage: coverage_result(planned, findings),
        vehicles: vehicle_results(planned),
    }
}

/// Results of all vehicles, in the scenario's order.
fn vehicle_results(planned: &CoveragePlan<'_>) -> Vec<VehicleResult> {
    let vehicles = planned.scenario.vehicles.iter().enumerate().map(|(index, vehicle)| {
        let route =
            planned.plan.routes.iter().find(|route| usize::from(route.vehicle_index) == index);
        VehicleResult {
            id: vehicle.id,
            goal: None,
            reached: false,
            landed: false,
            path_m: route.map_or(0.0, |route| rounded(planned.sorties_cost_m(route))),
            flown_m: 0.0,
            flight_time_s: route.map_or(0.0, |route| {
                rounded(planned.sorties_of(route).map(|sortie| sortie.route.cost_s).sum())
            }),
            end: if route.is_some() { "planned" } else { "stays on the ground" }.to_owned(),
        }
    });
    vehicles.collect()
}

/// Makes the coverage section from a plan and from the check of its pictures.
pub fn coverage_result(planned: &CoveragePlan<'_>, findings: &CoverageFindings) -> CoverageResult {
    let routes = &planned.plan.routes;
    let max_cost_s = planned.max_sorties_and_swaps_cost_s();
    let costs: Vec<f64> =
        routes.iter().map(|route| f64::from(planned.sorties_and_swaps_cost_s(route))).collect();
    let (mean, sd) = mean_and_sd(&costs);
    let along = planned.tracks.lane_direction();
    let trigger = planned.area_settings.trigger;
    CoverageResult {
        covered_share: findings.covered_share,
        waypoint_count: planned.tracks.waypoint_count(),
        lane_count: planned.tracks.lanes().len(),
        lane_spacing_m: rounded(planned.area_settings.spacing.max_lane_spacing_m),
        waypoint_spacing_m: rounded(planned.area_settings.spacing.max_waypoint_spacing_m),
        lane_angle_deg: rounded(along.y.atan2(along.x).to_degrees()),
        max_cost_s: rounded(max_cost_s),
        mean_cost_s: rounded(mean as f32),
        sd_cost_s: rounded(sd as f32),
        max_cost_m: rounded(
            routes.iter().map(|route| planned.sorties_cost_m(route)).fold(0.0, f32::max),
        ),
        lower_bound_s: rounded(planned.lower_bound_s),
        gap_to_lower_bound: rounded(max_cost_s / planned.lower_bound_s - 1.0),
        trigger: match trigger {
            Trigger::Distance => "distance",
            Trigger::Waypoint => "waypoint",
            Trigger::None => "none",
        },
        photos: if trigger == Trigger::None { 0 } else { findings.photos },
        repeated_waypoints: findings.repeated_waypoints,
        missed_waypoints: findings.missed_waypoints,
        terrain: findings.heights.as_ref().map(|heights| TerrainResult {
            min_above_ground_m: rounded(heights.min_above_ground_m),
            max_above_ground_m: rounded(heights.max_above_ground_m),
            steepest_slope: rounded(heights.steepest_slope),
            legs_too_low: heights.legs_too_low,
            legs_too_steep: heights.legs_too_steep,
        }),
        routes: route_results(planned),
    }
}

/// Results of all routes, in the plan's order.
fn route_results(planned: &CoveragePlan<'_>) -> Vec<RouteResult> {
    let heights = planned.area_settings.heights;
    let sortie = |sortie: &Sortie| SortieResult {
        lowest_waypoint: sortie.route.lowest_waypoint,
        highest_waypoint: sortie.route.waypoint_end - 1,
        round_begin_s: rounded(sortie.round_begin_s),
        departure_delay_s: rounded(sortie.departure_delay_s),
        cost_s: rounded(sortie.route.cost_s),
        cost_m: rounded(sortie.route.cost_m),
        flight_duration_s: rounded(sortie.flight_duration_s),
    };
    let route = |route: &Route| RouteResult {
        depart_s: planned
            .sorties_of(route)
            .next()
            .map_or(0.0, |sortie| rounded(sortie.departure_delay_s)),
        vehicle: planned.scenario.vehicles[usize::from(route.vehicle_index)].id,
        lowest_waypoint: route.lowest_waypoint,
        highest_waypoint: route.waypoint_end - 1,
        backward: route.first_and_last().0 != route.lowest_waypoint,
        layer_height_m: rounded(
            heights.max_picture_height_m + f32::from(route.layer) * heights.layer_spacing_m,
        ),
        cost_s: rounded(planned.sorties_and_swaps_cost_s(route)),
        cost_m: rounded(planned.sorties_cost_m(route)),
        sorties: planned.sorties_of(route).map(sortie).collect(),
    };
    planned.plan.routes.iter().map(route).collect()
}

/// Mean and sample standard deviation; the deviation of a single value is 0.
fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count.max(1.0);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, if values.len() > 1 { (squares / (count - 1.0)).sqrt() } else { 0.0 })
}
