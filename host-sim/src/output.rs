//! What a planning or flying command leaves in its `--out` directory.

use std::path::Path;

use anyhow::Context;
use planner_core::Point;

use crate::mission::{Mission, SwarmPlan};
use crate::report::{self, MapSurface, ReportData, RoadmapLines, VehicleTrack};
use crate::result::{self, MissionResult, Timing};

/// The page without a flight: map, roadmap, paths.
pub fn planned_page(mission: &Mission, plan: &SwarmPlan, result: &MissionResult) -> anyhow::Result<ReportData> {
    let scenario = &mission.scenario;
    let vehicles = scenario
        .vehicles
        .iter()
        .zip(&plan.flights)
        .map(|(vehicle, flight)| VehicleTrack {
            id: vehicle.id,
            radius_m: vehicle.radius_m,
            color: None,
            goal_index: flight.goal.map(usize::from),
            start: vehicle.start,
            goal: flight.goal.map(|goal| mission.goals[usize::from(goal)]),
            planned: flight.path.waypoints().iter().map(|w| w.position).collect(),
            track: Vec::new(),
        })
        .collect();
    Ok(ReportData {
        title: scenario.name.clone(),
        command: result.command.to_owned(),
        generated_by: concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")).to_owned(),
        scenario_toml: scenario.text.clone(),
        map: Some(MapSurface::of(&mission.map.grid())),
        roadmap: Some(RoadmapLines {
            nodes: mission.roadmap.nodes.clone(),
            edges: mission.roadmap.edges.iter().map(|e| [e.a, e.b]).collect(),
        }),
        vehicles,
        result: serde_json::to_value(result)?,
        ..ReportData::default()
    })
}

/// Writes `result.json`, `timing.json` and `report.html`.
pub fn write(dir: &Path, result: &MissionResult, timing: &Timing, mut page: ReportData) -> anyhow::Result<()> {
    std::fs::create_dir_all(dir).with_context(|| format!("cannot make {}", dir.display()))?;
    result::write_json(&dir.join("result.json"), result)?;
    result::write_json(&dir.join("timing.json"), timing)?;
    page.timing = Some(serde_json::to_value(timing)?);
    report::write(&dir.join("report.html"), &page)
}

/// Writes one `x y z` a line, metres, for other programs to be given the same work.
pub fn write_points(path: &Path, points: impl Iterator<Item = Point>) -> anyhow::Result<()> {
    let text: String = points.map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect();
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
