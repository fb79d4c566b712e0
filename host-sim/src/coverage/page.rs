//! The report of a coverage plan: area and routes in the scene, cells photographed over time.

use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::area::RingKind;

use super::check::Findings;
use super::flight::Stop;
use super::{Flight, Planned, parts};
use crate::report::{Curve, Outline, OutlineKind, Plot, ReportData, TrackPoint, VehicleTrack};

/// What the page shows.
pub fn page(
    planned: &Planned<'_>,
    flights: &[Flight],
    findings: &Findings,
    result: serde_json::Value,
) -> ReportData {
    let scenario = planned.scenario;
    let vehicles = scenario.vehicles.iter().enumerate().map(|(index, vehicle)| {
        let own = flights.iter().filter(|(sortie, _, _)| usize::from(sortie.route.vehicle) == index);
        let passed = own.flat_map(|(_, stops, times)| stops.iter().zip(times));
        let at = |(stop, time): (&Stop, &f32)| TrackPoint { t_s: *time, position: stop.position };
        let track: Vec<TrackPoint> = passed.map(at).collect();
        VehicleTrack {
            id: vehicle.id,
            radius_m: vehicle.radius_m,
            color: None,
            goal_index: None,
            start: vehicle.start,
            goal: None,
            planned: track.iter().map(|point| point.position).collect(),
            track,
        }
    });
    ReportData {
        title: scenario.path.clone(),
        command: "cover".to_owned(),
        generated_by: concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")).to_owned(),
        scenario_toml: scenario.text.clone(),
        vehicles: vehicles.collect(),
        outlines: outlines(planned),
        coverage: Some(parts::planned(planned, flights)),
        plots: vec![photographed(findings)],
        result,
        ..ReportData::default()
    }
}

/// Borders of the area.
pub(super) fn outlines(planned: &Planned<'_>) -> Vec<Outline> {
    let kinds = [
        (RingKind::Outer, OutlineKind::Area),
        (RingKind::Hole, OutlineKind::Hole),
        (RingKind::NoFly, OutlineKind::NoFly),
    ];
    let outline = |ring: &[Flat], kind| Outline {
        kind,
        points: ring.iter().map(|v| Point::new(v.x, v.y, 0.0)).collect(),
    };
    let shown = |(kind, shown)| planned.wanted.rings_of(kind).map(move |ring| outline(ring, shown));
    kinds.into_iter().flat_map(shown).collect()
}

/// Share of the area that pictures show, over time.
pub(super) fn photographed(findings: &Findings) -> Plot {
    let mut cells = 0;
    let mut curve = Curve { name: "photographed".to_owned(), ..Curve::default() };
    for (time, new) in &findings.over_time {
        cells += new;
        curve.t_s.push(*time);
        curve.values.push(100.0 * cells as f32 / findings.cells.max(1) as f32);
    }
    Plot { title: "Area photographed".to_owned(), unit: "%".to_owned(), limit: None, curves: vec![curve] }
}
