//! Data for the report page: which vehicle photographs which waypoints in the plan.

use super::CoveragePlan;
use super::SortieFlight;
use super::check::{self, Picture};
use super::flight::{FlightPoint, WaypointAction};
use crate::report::{CoverageLayers, PictureFootprint, ReportDivision, ReportPart};

/// Coverage data of the report page for a plan that was not flown.
pub fn planned_layers(planned: &CoveragePlan<'_>, flights: &[SortieFlight]) -> CoverageLayers {
    let mut parts: Vec<ReportPart> = Vec::new();
    for (sortie, points, _) in flights {
        let photos = |point: &&FlightPoint| matches!(point.action, WaypointAction::Photo(_));
        let photos: Vec<&FlightPoint> = points.iter().filter(photos).collect();
        let lanes = photos.chunk_by(|a, b| a.lane == b.lane);
        let lanes = lanes.flat_map(|lane| [lane[0].position, lane[lane.len() - 1].position]);
        let vehicle = planned.scenario.vehicles[usize::from(sortie.route.vehicle_index)].id;
        let index = parts.iter().position(|part| part.vehicle == vehicle).unwrap_or_else(|| {
            parts.push(ReportPart { vehicle, ..ReportPart::default() });
            parts.len() - 1
        });
        let part = &mut parts[index];
        part.waypoint_count += photos.len() as u32;
        part.path.extend(points.iter().map(|point| point.position));
        part.lane_ends.extend(lanes);
    }
    parts.sort_by_key(|part| part.vehicle);
    let divisions = vec![ReportDivision { parts, ..ReportDivision::default() }];
    let pictures = check::planned_pictures(planned, &check::flights_to_check(planned, flights));
    coverage_layers(planned, divisions, pictures)
}

/// The layers of a plan or a flight, with the rectangle on the ground that each picture is counted
/// to show ([`check::footprints`]).
pub(crate) fn coverage_layers(
    planned: &CoveragePlan<'_>,
    divisions: Vec<ReportDivision>,
    mut pictures: Vec<Picture>,
) -> CoverageLayers {
    pictures.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    let corners = check::footprints(planned, &pictures);
    let footprint = |(picture, corners): (&Picture, [[f32; 2]; 4])| PictureFootprint {
        t_s: picture.t_s,
        vehicle: picture.vehicle.unwrap_or(0),
        corners,
    };
    let footprints = pictures.iter().zip(corners).map(footprint).collect();
    CoverageLayers {
        lane_spacing_m: planned.area_settings.spacing.max_lane_spacing_m,
        divisions,
        footprints,
    }
}
