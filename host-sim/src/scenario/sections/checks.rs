//! Checks between several tables of a scenario.

use planner_core::Point;

use crate::margins;
use crate::scenario::reader::{Result, Table, TomlSpan, TomlText};
use crate::scenario::{
    Deconfliction, MissionMode, MissionSection, PositionErrors, RoadmapSection, Simulation,
    VehicleSection,
};

/// Where the keys of a vehicle stand in the scenario, for errors.
pub(super) struct VehicleSpans {
    /// Where `start` stands.
    pub(super) start: TomlSpan,
    /// Where `goal` stands; `None` without a goal.
    pub(super) goal: Option<TomlSpan>,
    /// Where the vehicle's table stands.
    pub(super) table: TomlSpan,
}

/// With `estimator = "recorded"`, refuses a separation that is too small for the estimates' errors;
/// if there is a roadmap, also such a safety margin.
pub(super) fn check_margins(
    text: TomlText<'_>,
    span: &TomlSpan,
    roadmap: Option<&RoadmapSection>,
    deconfliction: &Deconfliction,
    simulation: &Simulation,
    vehicles: &[VehicleSection],
) -> Result<()> {
    if simulation.estimator != PositionErrors::Recorded {
        return Ok(());
    }
    let need = margins::required_distances(simulation, deconfliction.safety_distance_m, vehicles);
    let margin =
        roadmap.map(|r| ("roadmap.safety_margin_m", r.safety_margin_m, need.wall_margin_m));
    let separation = ("deconfliction.separation_m", deconfliction.separation_m, need.separation_m);
    let missing = margin.into_iter().chain([separation]);
    let short = missing.filter(|(_, has_m, need_m)| *has_m < need_m - 1e-3);
    let lacks: Vec<String> = short
        .map(|(key, has_m, need_m)| {
            format!(
                "{key} is {has_m:.2} m, {:.2} m less than the {need_m:.2} m it takes",
                need_m - has_m
            )
        })
        .collect();
    if lacks.is_empty() {
        return Ok(());
    }
    let hint = "docs/simulating.md adds up margin and separation; \"rtk\" errs by 0.1 m";
    let why =
        format!("estimates as wrong as the recorded ones leave no room: {}", lacks.join("; "));
    Err(text.error_with_hint(span, why, hint))
}

/// Refuses starts nearer to each other than the safety distance.
pub(super) fn check_starts_apart(
    text: TomlText<'_>,
    vehicles: &[(VehicleSection, VehicleSpans)],
    safety_distance_m: f32,
) -> Result<()> {
    for (index, (vehicle, spans)) in vehicles.iter().enumerate() {
        for (other, _) in &vehicles[..index] {
            let apart = (vehicle.start - other.start).norm();
            if apart < safety_distance_m {
                let why = format!(
                    "vehicles {} and {} start {apart:.2} m apart, below the safety distance of {safety_distance_m} m",
                    other.id, vehicle.id
                );
                return Err(text.error(&spans.start, why));
            }
        }
    }
    Ok(())
}

/// Refuses goals nearer to each other than the safety distance: vehicles that land below them would
/// stay too near.
pub(super) fn check_goals_apart(
    table: &Table<'_>,
    mission: &MissionSection,
    safety_distance_m: f32,
    simulation: &Simulation,
    vehicles: &[VehicleSection],
) -> Result<()> {
    let goals = &mission.goals;
    for (i, goal) in goals.iter().enumerate() {
        for (j, other) in goals[..i].iter().enumerate() {
            let apart = (goal - other).norm();
            if apart < safety_distance_m {
                let span = goal_span(table, i);
                let why = format!(
                    "goals {j} and {i} are {apart:.2} m apart, below the safety distance of {safety_distance_m} m"
                );
                let needed_m =
                    margins::parked_separation_m(simulation, safety_distance_m, vehicles);
                let hint = format!("vehicles that land at both need {needed_m:.2} m between them");
                return Err(table.text.error_with_hint(&span, why, hint));
            }
        }
    }
    Ok(())
}

/// Refuses a vehicle's start, or a goal, outside the geofence.
pub(super) fn check_inside_geofence(
    table: &Table<'_>,
    vehicles: &[(VehicleSection, VehicleSpans)],
    mission: &MissionSection,
) -> Result<()> {
    let Some(fence) = &mission.geofence else { return Ok(()) };
    let outside = |place: &Point| !fence.contains(place);
    if let Some((vehicle, spans)) = vehicles.iter().find(|(vehicle, _)| outside(&vehicle.start)) {
        let why = format!("vehicle {} starts outside mission.geofence", vehicle.id);
        return Err(table.text.error(&spans.start, why));
    }
    match mission.goals.iter().position(outside) {
        Some(goal) => {
            let why = format!("goal {goal} lies outside mission.geofence");
            Err(table.text.error(&goal_span(table, goal), why))
        }
        None => Ok(()),
    }
}

/// Where a goal stands in the scenario, for errors.
fn goal_span(table: &Table<'_>, index: usize) -> TomlSpan {
    let Some(goals) = table.get("goals") else {
        return table.get("goals_file").map_or(table.span.clone(), |v| v.span);
    };
    let item = goals.items().ok().and_then(|items| items.get(index).map(|item| item.span.clone()));
    item.unwrap_or(goals.span)
}

/// Refuses a labelled mission in which a vehicle has no goal, one that does not exist, or another
/// vehicle's.
pub(super) fn check_labelled_goals(
    text: TomlText<'_>,
    vehicles: &[(VehicleSection, VehicleSpans)],
    mission: &MissionSection,
) -> Result<()> {
    if mission.mode != MissionMode::Labelled {
        return Ok(());
    }
    for (index, (vehicle, spans)) in vehicles.iter().enumerate() {
        let Some(goal) = vehicle.goal_index else {
            let hint = "add `goal = N`, an index into mission.goals from 0";
            let why = format!("vehicle {} has no goal in a labelled mission", vehicle.id);
            return Err(text.error_with_hint(&spans.table, why, hint));
        };
        let span = spans.goal.as_ref().unwrap_or(&spans.table);
        if goal >= mission.goals.len() {
            let last = mission.goals.len() - 1;
            return Err(text.error(
                span,
                format!("vehicle {}: goal {goal} is beyond the last, {last}", vehicle.id),
            ));
        }
        if let Some((other, _)) =
            vehicles[..index].iter().find(|(other, _)| other.goal_index == Some(goal))
        {
            return Err(text.error(
                span,
                format!("vehicles {} and {} have the same goal", other.id, vehicle.id),
            ));
        }
    }
    Ok(())
}
