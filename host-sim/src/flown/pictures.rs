//! Checks the pictures of a coverage mission that was flown. If the mission triggers no camera, it
//! checks instead the places on the lanes where a camera triggered by other means could take them.

use planner_core::Point;
use planner_core::flight::Trigger;
use planner_core::plan::SwarmPlan;

use crate::coverage::check::{self, CoverageFindings, Picture};
use crate::coverage::{CoveragePlan, page, result};
use crate::report::{AreaOutline, Plot};
use crate::result::CoverageResult;
use crate::scenario::Scenario;

/// Result of checking the pictures of a flight.
pub struct FlightFindings {
    /// The coverage section of `result.json`.
    pub result: CoverageResult,
    /// Borders of the area, its holes and no-fly zones, for the report page.
    pub outlines: Vec<AreaOutline>,
    /// Curve of the share of the area that is photographed, over time.
    pub plot: Plot,
    /// Whether every cell of the area that counts is photographed.
    pub complete: bool,
}

/// Every track point at the height of the lanes, as a picture taken there whose heading is the
/// lanes' direction. `None` without an area, or if companions trigger the camera: then there are
/// real pictures to judge.
///
/// Above terrain lanes follow a smoothed field, so over hollows they are higher above the ground
/// than pictures need: a point counts by its height above that field.
///
/// # Errors
/// As [`CoveragePlan::new`].
pub fn track_points_as_pictures(
    scenario: &Scenario,
    tracks: &[Vec<(f32, Point)>],
) -> anyhow::Result<Option<Vec<Picture>>> {
    let area = scenario.area.as_ref().filter(|area| area.trigger == Trigger::None);
    let Some(area) = area else { return Ok(None) };
    let planned = CoveragePlan::plan_as_companions(scenario)?;
    let along = planned.tracks.lane_direction();
    let heading = along.y.atan2(along.x);
    let following = planned.terrain_following;
    // Half of the distance to the lowest transit layer is left for errors of the flight.
    let below_m = area.heights.layer_spacing_m / 2.0;
    let above_m = below_m + following.map_or(0.0, |following| following.tolerance_m);
    let is_on_lanes = |place: &Point| {
        let lane_m = following.map_or(area.picture_height_m, |f| f.min_path_z_m(&place.xy()));
        (lane_m - below_m..=lane_m + above_m).contains(&place.z)
    };
    let places = scenario.vehicles.iter().zip(tracks).flat_map(|(vehicle, track)| {
        let on_lanes = track.iter().filter(|(_, place)| is_on_lanes(place));
        on_lanes.map(|&(t_s, position)| Picture {
            vehicle: Some(vehicle.id),
            t_s,
            position,
            yaw_enu_rad: heading,
        })
    });
    Ok(Some(places.collect()))
}

/// Checks the pictures that were taken in a flight of this scenario. Departures in the result are
/// those of `plan`, which was flown.
///
/// # Errors
/// As [`CoveragePlan::new`].
pub fn judge_pictures<const V: usize, const W: usize>(
    scenario: &Scenario,
    plan: &SwarmPlan<V, W>,
    pictures: Vec<Picture>,
) -> anyhow::Result<FlightFindings> {
    let mut planned = CoveragePlan::plan_as_companions(scenario)?;
    for sortie in &mut planned.sorties {
        sortie.departure_delay_s = plan.flights[usize::from(sortie.route.vehicle_index)].depart_s;
    }
    let findings: CoverageFindings = check::check_pictures(&planned, pictures);
    Ok(FlightFindings {
        result: result::coverage_result(&planned, &findings),
        outlines: page::area_outlines(&planned),
        plot: page::photographed_share_plot(&findings),
        complete: findings.covered_share >= 1.0,
    })
}

#[cfg(test)]
mod tests;
