//! The coverage section of `result.json`.

use planner_core::coverage::pack::Route;
use planner_core::flight::Trigger;

use super::CoveragePlan;
use super::check::CoverageFindings;
use super::sorties::Sortie;
use crate::result::{CoverageResult, RouteResult, SortieResult, TerrainResult, rounded};

/// Makes the coverage section from a plan and from the check of its pictures.
pub fn coverage_result(planned: &CoveragePlan<'_>, findings: &CoverageFindings) -> CoverageResult {
    let routes = &planned.plan.routes;
    let max_cost_s = planned.max_cost_s();
    let costs: Vec<f64> = routes.iter().map(|route| f64::from(planned.cost_s(route))).collect();
    let (mean, sd) = mean_and_sd(&costs);
    let along = planned.tracks.lane_direction();
    let trigger = planned.area_settings.trigger;
    CoverageResult {
        covered_share: findings.covered_share,
        waypoints: planned.tracks.waypoint_count(),
        lanes: planned.tracks.lanes().len(),
        lane_m: rounded(planned.area_settings.spacing.lane_m),
        waypoint_m: rounded(planned.area_settings.spacing.waypoint_m),
        angle_deg: rounded(along.y.atan2(along.x).to_degrees()),
        max_cost_s: rounded(max_cost_s),
        mean_cost_s: rounded(mean as f32),
        sd_cost_s: rounded(sd as f32),
        max_cost_m: rounded(routes.iter().map(|route| planned.cost_m(route)).fold(0.0, f32::max)),
        lower_bound_s: rounded(planned.lower_bound_s),
        gap: rounded(max_cost_s / planned.lower_bound_s - 1.0),
        trigger: match trigger {
            Trigger::Distance => "distance",
            Trigger::Waypoint => "waypoint",
            Trigger::None => "none",
        },
        photos: if trigger == Trigger::None { 0 } else { findings.photos },
        twice: findings.repeated_waypoints,
        left: findings.missed_waypoints,
        terrain: findings.heights.as_ref().map(|heights| TerrainResult {
            ground_least_m: rounded(heights.least_m),
            ground_most_m: rounded(heights.most_m),
            steepest: rounded(heights.steepest),
            too_low: heights.too_low,
            too_steep: heights.too_steep,
        }),
        routes: route_results(planned),
    }
}

fn route_results(planned: &CoveragePlan<'_>) -> Vec<RouteResult> {
    let heights = planned.area_settings.heights;
    let sortie = |sortie: &Sortie| SortieResult {
        first: sortie.route.first,
        last: sortie.route.end - 1,
        begin_s: rounded(sortie.begin_s),
        depart_s: rounded(sortie.depart_s),
        cost_s: rounded(sortie.route.cost_s),
        cost_m: rounded(sortie.route.cost_m),
        flown_s: rounded(sortie.flown_s),
    };
    let route = |route: &Route| RouteResult {
        depart_s: planned.sorties_of(route).next().map_or(0.0, |sortie| rounded(sortie.depart_s)),
        vehicle: planned.scenario.vehicles[usize::from(route.vehicle)].id,
        first: route.first,
        last: route.end - 1,
        backward: route.end_waypoints().0 != route.first,
        layer_m: rounded(heights.mission_m + f32::from(route.layer) * heights.layer_m),
        cost_s: rounded(planned.cost_s(route)),
        cost_m: rounded(planned.cost_m(route)),
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
