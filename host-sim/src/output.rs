//! Result files of the commands that plan or fly a mission (`--out`), and the printed summary.

use std::path::Path;

use planner_core::Point;

use crate::files::ResultFiles;
use crate::mission::{HostPlan, PreparedMission};
use crate::report::{self, MapSurface, ReportData, ReportVehicle, RoadmapLines};
use crate::result::{self, MissionResult, Safety, Timing};
use crate::say;
use crate::scenario::Scenario;

/// Report page of a plan: map, roadmap and planned paths; nothing that was flown.
pub fn planned_page(
    mission: &PreparedMission,
    plan: &HostPlan,
    result: &MissionResult,
) -> anyhow::Result<ReportData> {
    let scenario = &mission.scenario;
    let vehicles = scenario
        .vehicles
        .iter()
        .zip(&plan.flights)
        .map(|(vehicle, flight)| ReportVehicle {
            id: vehicle.id,
            radius_m: vehicle.radius_m,
            color: None,
            goal_index: flight.task.goal().map(usize::from),
            start: vehicle.start,
            goal: flight.task.goal().map(|goal| mission.goals[usize::from(goal)]),
            planned_path: flight.path.waypoints().iter().map(|w| w.position).collect(),
            track: Vec::new(),
            power_lost_at_s: None,
        })
        .collect();
    Ok(ReportData {
        title: scenario.path.clone(),
        command: result.command.to_owned(),
        generated_by: concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")).to_owned(),
        scenario_toml: scenario.text.clone(),
        // A coverage mission has neither an obstacle map nor a roadmap to draw.
        map: (!scenario.covers_area()).then(|| MapSurface::of(&mission.map.grid())),
        roadmap: (!scenario.covers_area()).then(|| RoadmapLines {
            nodes: mission.roadmap.nodes.clone(),
            edges: mission.roadmap.edges.iter().map(|e| [e.a, e.b]).collect(),
        }),
        vehicles,
        result: serde_json::to_value(result)?,
        ..ReportData::default()
    })
}

/// Files in `--out` of every command with a mission result: result, timing, HTML report.
pub const RESULT_FILES: [&str; 3] = ["result.json", "timing.json", "report.html"];

/// Adds the three files of [`RESULT_FILES`] to `results`.
///
/// # Errors
/// A file cannot be written.
pub fn add(
    results: &mut ResultFiles,
    result: &MissionResult,
    timing: &Timing,
    mut page: ReportData,
) -> anyhow::Result<()> {
    results.add(RESULT_FILES[0], result::json(result)?.as_bytes())?;
    results.add(RESULT_FILES[1], result::json(timing)?.as_bytes())?;
    page.timing = Some(serde_json::to_value(timing)?);
    results.add(RESULT_FILES[2], report::page(&page)?.as_bytes())
}

/// The points as text, one `x y z` a line in metres, from which other programs can plan the same
/// problem.
pub fn points_to_text(points: impl Iterator<Item = Point>) -> String {
    points.map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect()
}

/// Prints which vehicles of a coverage mission are slower than its cruise speed.
pub fn print_slow_vehicles(scenario: &Scenario) {
    if !scenario.covers_area() {
        return;
    }
    let cruise_mps = scenario.mission.cruise_mps;
    for vehicle in scenario.vehicles.iter().filter(|v| v.speed_max_mps < cruise_mps) {
        say!(
            "speed      vehicle {} cruises at its speed_max_mps of {:.1} m/s, not at cruise_mps of {cruise_mps:.1}",
            vehicle.id,
            vehicle.speed_max_mps
        );
    }
}

/// Prints the smallest distances, contacts, violations and deadlocks.
fn print_safety(safety: &Safety) {
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |m| format!("{m:.2} m"));
    let under_pilot = match safety.wall_contacts_under_pilot {
        0 => String::new(),
        count => format!(" ({count} under its pilot)"),
    };
    say!(
        "walls      {} contacts{under_pilot}, nearest {}",
        safety.wall_contacts,
        metres(safety.min_clearance_m)
    );
    say!(
        "vehicles   {} violations of {} m, nearest {}, {} deadlocks",
        safety.violations,
        safety.safety_distance_m,
        metres(safety.min_separation_m),
        safety.deadlocks
    );
}

/// Prints the content of `result.json` for a person: a table of vehicles, then totals.
pub fn print_summary(result: &MissionResult, dir: &Path) {
    say!("vehicle  goal  reached  landed   path m  flown m   time s  end");
    let yes = |b: bool| if b { "yes" } else { "no" };
    for v in &result.vehicles {
        say!(
            "{:>7}  {:>4}  {:>7}  {:>6}  {:>7.1}  {:>7.1}  {:>7.1}  {}",
            v.id,
            v.goal.map_or("-".to_owned(), |g| g.to_string()),
            yes(v.reached),
            yes(v.landed),
            v.path_m,
            v.flown_m,
            v.flight_time_s,
            v.end
        );
    }
    for reason in &result.unserved.reasons {
        say!("left       {reason}");
    }
    let safety = &result.safety;
    say!();
    say!("{}", if result.complete { "complete" } else { "NOT COMPLETE" });
    print_safety(safety);
    match &result.coverage {
        Some(coverage) if coverage.trigger == "none" => say!(
            "area       {:.2} % flown over, {} waypoints ({} flown twice, {} left); \
             area.trigger = \"none\": no pictures were asked for",
            100.0 * (coverage.covered_share * 1e4).floor() / 1e4,
            coverage.waypoint_count,
            coverage.repeated_waypoints,
            coverage.missed_waypoints
        ),
        Some(coverage) => say!(
            "area       {:.2} % photographed by {} pictures of {} waypoints ({} flown twice, {} left)",
            100.0 * (coverage.covered_share * 1e4).floor() / 1e4,
            coverage.photos,
            coverage.waypoint_count,
            coverage.repeated_waypoints,
            coverage.missed_waypoints
        ),
        None => say!(
            "roadmap    {} nodes, {} edges, {} bytes",
            result.roadmap.nodes,
            result.roadmap.edges,
            result.roadmap.file_bytes
        ),
    }
    say!("total      {:.1} m, makespan {:.1} s", result.totals.path_m, result.totals.makespan_s);
    say!("report     {}", dir.join("report.html").display());
}
