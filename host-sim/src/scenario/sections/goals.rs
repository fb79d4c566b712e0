//! Reads the scenario of a mission with goals.

use std::path::Path;

use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::roadmap::MAX_COORDINATE_M;

use super::checks::{
    VehicleSpans, check_goals_apart, check_inside_geofence, check_labelled_goals, check_margins,
    check_starts_apart,
};
use super::{
    AREA_HINT, CommonSettings, DEFAULT_TIME_LIMIT_S, VEHICLES_HINT, check_list_len, empty_table,
    read_common, read_faults, read_fence_and_ground_stations, read_map, read_place, read_roadmap,
    read_unsupported, read_vehicles, unsupported_error,
};
use crate::capacity::MAX_VEHICLES;
use crate::files;
use crate::margins;
use crate::quote::{printable, printable_path};
use crate::scenario::reader::{Result, Table, TomlSpan, TomlText, TomlValue};
use crate::scenario::{AssignmentObjective, MissionMode, MissionSection, Scenario, VehicleSection};

/// Reads the scenario of a mission with goals.
pub(in crate::scenario) fn read_goals_scenario(
    text: TomlText<'_>,
    root: &Table<'_>,
    folder: &Path,
) -> Result<Scenario> {
    refuse_coverage_without_area(text, root)?;
    let mut unsupported = Vec::new();
    let CommonSettings { seed, deconfliction, simulation, estimator_span } =
        read_common(text, root, (margins::PAIR_DEVIATION_M, DEFAULT_TIME_LIMIT_S))?;
    let map_table =
        root.required("map", "add `[map]` with `file = \"builtin:building\"`")?.table()?;
    let (map, has_origin) = read_map(&map_table, folder)?;
    let roadmap = root.get("roadmap").map(|v| v.table()).transpose()?;
    let roadmap = read_roadmap(&roadmap.unwrap_or_else(|| empty_table(text, "roadmap")))?;
    let origin = has_origin.then_some(map.origin);
    let mission_value = root.get("mission");
    let vehicles = root.required("vehicles", VEHICLES_HINT)?;
    let vehicles = read_vehicles(&vehicles, origin.as_ref(), &mut unsupported)?;
    let mission_table = mission_value.as_ref().map(TomlValue::table).transpose()?;
    let mission_table = mission_table.unwrap_or_else(|| empty_table(text, "mission"));
    let (mission, mode_span) = read_mission(&mission_table, folder, origin.as_ref(), &vehicles)?;
    let faults = read_faults(root, &vehicles)?;
    if let Some(area) = root.get("area") {
        unsupported.push(unsupported_error(text, &area.span, "[area] beside [map]"));
    }
    let formation = read_unsupported(root, "formation", &mut unsupported)?;
    if let (Some(span), MissionMode::Formation) = (&mode_span, mission.mode) {
        unsupported.push(unsupported_error(text, span, "this mission.mode"));
    }
    check_starts_apart(text, &vehicles, deconfliction.safety_distance_m)?;
    check_labelled_goals(text, &vehicles, &mission)?;
    check_inside_geofence(&mission_table, &vehicles, &mission)?;
    let vehicle_file_lines =
        vehicles.iter().map(|(_, spans)| text.file_and_line(&spans.start)).collect();
    let vehicles: Vec<VehicleSection> = vehicles.into_iter().map(|(vehicle, _)| vehicle).collect();
    check_goals_apart(
        &mission_table,
        &mission,
        deconfliction.safety_distance_m,
        &simulation,
        &vehicles,
    )?;
    if let Some(span) = &estimator_span {
        check_margins(text, span, Some(&roadmap), &deconfliction, &simulation, &vehicles)?;
    }
    Ok(Scenario {
        path: text.file.to_owned(),
        text: text.text.to_owned(),
        seed,
        map,
        roadmap,
        mission,
        vehicles,
        vehicle_file_lines,
        deconfliction,
        simulation,
        faults,
        area: None,
        formation,
        unsupported,
    })
}

/// Refuses coverage mode in a scenario that is read as one with goals, since it has no `[area]`.
fn refuse_coverage_without_area(text: TomlText<'_>, root: &Table<'_>) -> Result<()> {
    let mission = root.get("mission").and_then(|value| value.table().ok());
    let Some(mode) = mission.and_then(|mission| mission.get("mode")) else { return Ok(()) };
    if mode.str() != Ok("coverage") {
        return Ok(());
    }
    let why = "[area] is missing: mission.mode is \"coverage\"";
    Err(text.error_with_hint(&mode.span, why, AREA_HINT))
}

/// Reads `[mission]`; the span is where its `mode` stands, if it is given.
fn read_mission(
    table: &Table<'_>,
    folder: &Path,
    origin: Option<&Geodetic>,
    vehicles: &[(VehicleSection, VehicleSpans)],
) -> Result<(MissionSection, Option<TomlSpan>)> {
    let mode_span = table.get("mode").map(|v| v.span);
    let mode = table.one_of(
        "mode",
        MissionMode::Unlabelled,
        &[
            ("unlabelled", MissionMode::Unlabelled),
            ("labelled", MissionMode::Labelled),
            ("single-goal", MissionMode::SingleGoal),
            ("coverage", MissionMode::Coverage),
            ("formation", MissionMode::Formation),
            ("unlabeled", MissionMode::Unlabelled),
            ("labeled", MissionMode::Labelled),
        ],
    )?;
    let default = AssignmentObjective::TotalDistance;
    let objectives = [("total", default), ("makespan", AssignmentObjective::Makespan)];
    let objective = table.one_of("objective", default, &objectives)?;
    let cruise_mps = table.f32("cruise_mps", 2.0, 0.01..=100.0)?;
    let (given, file) = (table.get("goals"), table.get("goals_file"));
    let goals = match (&given, &file) {
        (Some(_), Some(file)) => {
            return Err(file.error("cannot stand beside mission.goals: give one of them"));
        }
        (Some(list), None) => {
            let goals = list.items()?;
            check_list_len(list, goals.len(), MAX_VEHICLES, "goals")?;
            goals
                .iter()
                .map(|v| Ok((read_place(v, origin)?, table.text.file_and_line(&v.span))))
                .collect::<Result<_>>()?
        }
        (None, Some(file)) => read_goals_file(file, folder)?,
        (None, None) => Vec::new(),
    };
    let (goals, goal_file_lines): (Vec<Point>, Vec<String>) = goals.into_iter().unzip();
    let takes_goals = !matches!(mode, MissionMode::Coverage | MissionMode::Formation);
    if takes_goals && goals.is_empty() {
        let span = given.or(file).map_or(table.span.clone(), |v| v.span);
        let hint = "add `goals = [[east, north, up], …]` in metres, or `goals_file = \"FILE\"`, to [mission]";
        return Err(table.text.error_with_hint(&span, "mission.goals is missing or empty", hint));
    }
    if mode == MissionMode::SingleGoal && goals.len() != 1 {
        let span = given.or(file).map_or(table.span.clone(), |v| v.span);
        let why = format!("mission.mode \"single-goal\" takes one goal, not {}", goals.len());
        return Err(table.text.error(&span, why));
    }
    let (geofence, ground_stations) = read_fence_and_ground_stations(table, vehicles)?;
    table.refuse_unknown_keys()?;
    let mission = MissionSection {
        mode,
        objective,
        cruise_mps,
        goals,
        goal_file_lines,
        geofence,
        ground_stations,
    };
    Ok((mission, mode_span))
}

/// Reads goals, one `x y z` a line, each with its `FILE:LINE`; skips empty lines and `#` lines.
fn read_goals_file(value: &TomlValue<'_>, folder: &Path) -> Result<Vec<(Point, String)>> {
    let path = folder.join(value.str()?);
    let text = files::read_text(&path).map_err(|error| {
        value.error(&format!("cannot be read: {}: {error}", printable_path(&path)))
    })?;
    let mut goals = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let numbers: Vec<f32> = line.split_whitespace().map_while(|w| w.parse().ok()).collect();
        match numbers.as_slice() {
            &[x, y, z]
                if line.split_whitespace().count() == 3
                    && numbers.iter().all(|n| n.is_finite() && n.abs() <= MAX_COORDINATE_M) =>
            {
                let place = format!("{}:{}", printable_path(&path), index + 1);
                goals.push((Point::new(x, y, z), place));
                check_list_len(value, goals.len(), MAX_VEHICLES, "goals")?;
            }
            _ => {
                let place = format!("{}:{}", printable_path(&path), index + 1);
                return Err(value.error(&format!(
                    "is malformed: {place}: expected `x y z` in metres, found `{}`",
                    printable(line)
                )));
            }
        }
    }
    Ok(goals)
}

#[cfg(test)]
mod tests;
