//! Checks the heights of flights above terrain. The ground is the height map itself, not the field
//! that planned paths follow.

use planner_core::Point;

use super::CoveragePlan;
use super::flight::{FlightPoint, TimedFlight, WaypointAction};

/// Greatest spacing of the height samples along a leg, metres; a quarter of a cell of the height
/// map where that is less.
const MAX_SAMPLE_SPACING_M: f32 = 1.0;
/// Tolerance for the rounding of heights, metres.
const HEIGHT_ROUNDING_M: f32 = 0.02;

/// Heights and slopes of flights above terrain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightFindings {
    /// Least height of lanes and of the paths between them above the ground, metres.
    pub min_above_ground_m: f32,
    /// Greatest height of lanes and of the paths between them above the ground, metres.
    pub max_above_ground_m: f32,
    /// Slope of the steepest leg on lanes and on the paths between them, metres of height per metre
    /// over ground; legs of at most 1 m over ground are left out.
    pub steepest_slope: f32,
    /// Number of legs, transits in layers included, that are lower above the ground than the height
    /// of the pictures; vertical legs above pads are left out.
    pub legs_too_low: u64,
    /// Number of legs on lanes and on the paths between them that are steeper than their vehicle
    /// climbs or descends at cruise speed.
    pub legs_too_steep: u64,
}

impl HeightFindings {
    /// Whether no leg is too low and none is too steep.
    pub fn is_clean(&self) -> bool {
        self.legs_too_low + self.legs_too_steep == 0
    }
}

/// Checks the heights of flights above the ground; `None` over level ground.
pub fn check_heights(
    planned: &CoveragePlan<'_>,
    flights: &[TimedFlight<'_>],
) -> Option<HeightFindings> {
    let terrain = planned.area_settings.terrain.as_ref()?;
    let sample_m = (terrain.grid.cell_m() / 4.0).min(MAX_SAMPLE_SPACING_M);
    let mut findings = HeightFindings {
        min_above_ground_m: f32::INFINITY,
        max_above_ground_m: 0.0,
        steepest_slope: 0.0,
        legs_too_low: 0,
        legs_too_steep: 0,
    };
    for flight in flights {
        let index =
            planned.scenario.vehicles.iter().position(|vehicle| vehicle.id == flight.vehicle)?;
        let vehicle = &planned.vehicles[index];
        for leg in flight.points.windows(2) {
            if leg.iter().any(|point| point.action == WaypointAction::OnPad) {
                continue;
            }
            let (from, to) = (leg[0].position, leg[1].position);
            let [least_m, most_m] = height_range_above_ground(planned, &from, &to, sample_m);
            findings.legs_too_low +=
                u64::from(least_m < planned.area_settings.picture_height_m - HEIGHT_ROUNDING_M);
            if leg.iter().any(|point| point.action == WaypointAction::Transit) {
                continue;
            }
            findings.min_above_ground_m = findings.min_above_ground_m.min(least_m);
            findings.max_above_ground_m = findings.max_above_ground_m.max(most_m);
            let (way_m, up_m) = ((to - from).xy().norm(), to.z - from.z);
            let most_mps = if up_m > 0.0 { vehicle.climb_mps } else { vehicle.descend_mps };
            let allowed_m = most_mps / vehicle.cruise_mps * way_m;
            findings.legs_too_steep += u64::from(up_m.abs() > allowed_m * 1.01 + HEIGHT_ROUNDING_M);
            if way_m > MAX_SAMPLE_SPACING_M {
                findings.steepest_slope = findings.steepest_slope.max(up_m.abs() / way_m);
            }
        }
    }
    Some(findings)
}

/// Least and greatest height of a leg above the ground, metres.
fn height_range_above_ground(
    planned: &CoveragePlan<'_>,
    from: &Point,
    to: &Point,
    sample_m: f32,
) -> [f32; 2] {
    let step = to - from;
    let parts = (step.xy().norm() / sample_m).ceil().max(1.0) as usize;
    let heights = (0..=parts).map(|part| {
        let at = from + step * (part as f32 / parts as f32);
        at.z - planned.area_settings.ground_height_m(&at.xy())
    });
    heights.fold([f32::INFINITY, f32::NEG_INFINITY], |[least, most], h| [least.min(h), most.max(h)])
}

/// Whether a point is at the height of the lanes: on a lane or on the path from one lane to the
/// next, not on a transit in a layer.
pub fn is_at_lane_height(point: &FlightPoint) -> bool {
    matches!(point.action, WaypointAction::Photo(_) | WaypointAction::AtLaneHeight)
}
