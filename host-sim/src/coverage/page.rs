//! Data of the report page of a coverage plan: area and routes in the 3D scene, share photographed
//! over time.

use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::area::RingKind;

use super::check::CoverageFindings;
use super::flight::FlightPoint;
use super::{CoveragePlan, SortieFlight, report_layers};
use crate::report::{AreaOutline, Curve, OutlineKind, Plot, ReportData, ReportVehicle, TrackPoint};

/// Spacing of the points of a height profile along a path, metres.
const PROFILE_SPACING_M: f32 = 5.0;

/// All data of the report page of a coverage plan.
pub fn report_data(
    planned: &CoveragePlan<'_>,
    flights: &[SortieFlight],
    findings: &CoverageFindings,
    result: serde_json::Value,
) -> ReportData {
    let scenario = planned.scenario;
    let vehicles = scenario.vehicles.iter().enumerate().map(|(index, vehicle)| {
        let own = flights
            .iter()
            .filter(|(sortie, _, _)| usize::from(sortie.route.vehicle_index) == index);
        let passed = own.flat_map(|(_, points, times)| points.iter().zip(times));
        let at = |(point, time): (&FlightPoint, &f32)| TrackPoint {
            t_s: *time,
            position: point.position,
        };
        let track: Vec<TrackPoint> = passed.map(at).collect();
        ReportVehicle {
            id: vehicle.id,
            radius_m: vehicle.radius_m,
            color: None,
            goal_index: None,
            start: vehicle.start,
            goal: None,
            planned_path: track.iter().map(|point| point.position).collect(),
            track,
            power_lost_at_s: None,
        }
    });
    ReportData {
        title: scenario.path.clone(),
        command: "cover".to_owned(),
        generated_by: concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")).to_owned(),
        scenario_toml: scenario.text.clone(),
        vehicles: vehicles.collect(),
        outlines: area_outlines(planned),
        coverage: Some(report_layers::planned_layers(planned, flights)),
        plots: coverage_plots(planned, flights, findings),
        result,
        ..ReportData::default()
    }
}

/// Plots of the share photographed and, over terrain, of the heights.
fn coverage_plots(
    planned: &CoveragePlan<'_>,
    flights: &[SortieFlight],
    findings: &CoverageFindings,
) -> Vec<Plot> {
    let mut plots = vec![photographed_share_plot(findings)];
    if planned.terrain_following.is_some() {
        plots.push(height_profile_plot(planned, flights));
    }
    plots
}

/// Plot with two curves for each flight: the height of its path and that of the ground below it,
/// metres, over time.
fn height_profile_plot(planned: &CoveragePlan<'_>, flights: &[SortieFlight]) -> Plot {
    let mut curves = Vec::new();
    for (sortie, points, times_s) in flights {
        let id = planned.scenario.vehicles[usize::from(sortie.route.vehicle_index)].id;
        let mut path =
            Curve { name: format!("vehicle {id}"), vehicle: Some(id), ..Curve::default() };
        let mut ground = Curve { name: format!("ground below {id}"), ..Curve::default() };
        for (leg, times) in points.windows(2).zip(times_s.windows(2)) {
            let step = leg[1].position - leg[0].position;
            let parts = (step.xy().norm() / PROFILE_SPACING_M).ceil().max(1.0) as usize;
            for share in (0..=parts).map(|part| part as f32 / parts as f32) {
                let (at, t_s) =
                    (leg[0].position + step * share, times[0] + (times[1] - times[0]) * share);
                for (curve, height_m) in [
                    (&mut path, at.z),
                    (&mut ground, planned.area_settings.ground_height_m(&at.xy())),
                ] {
                    curve.t_s.push(t_s);
                    curve.values.push(height_m);
                }
            }
        }
        curves.extend([path, ground]);
    }
    Plot { title: "Height along the path".to_owned(), unit: "m".to_owned(), limit: None, curves }
}

/// Outlines of the area, its holes and no-fly zones, at the height of the ground.
pub(crate) fn area_outlines(planned: &CoveragePlan<'_>) -> Vec<AreaOutline> {
    let kinds = [
        (RingKind::Outer, OutlineKind::Area),
        (RingKind::Hole, OutlineKind::Hole),
        (RingKind::NoFly, OutlineKind::NoFly),
    ];
    let outline = |ring: &[Flat], kind| AreaOutline {
        kind,
        points: ring
            .iter()
            .map(|v| Point::new(v.x, v.y, planned.area_settings.ground_height_m(v)))
            .collect(),
    };
    let shown =
        |(kind, shown)| planned.area_settings.rings_of(kind).map(move |ring| outline(ring, shown));
    kinds.into_iter().flat_map(shown).collect()
}

/// Plot of the share of the area that pictures show, per cent, over time.
pub(crate) fn photographed_share_plot(findings: &CoverageFindings) -> Plot {
    let mut cells = 0;
    let mut curve = Curve { name: "photographed".to_owned(), ..Curve::default() };
    for (time, new) in &findings.new_cells_over_time {
        cells += new;
        curve.t_s.push(*time);
        curve.values.push(100.0 * cells as f32 / findings.cells_to_cover.max(1) as f32);
    }
    Plot {
        title: "Area photographed".to_owned(),
        unit: "%".to_owned(),
        limit: None,
        curves: vec![curve],
    }
}
