//! Starts, goals and the roadmap between them, from a scenario and its map.

use std::time::Instant;

use anyhow::bail;
use planner_core::Point;
use planner_core::map::segment::segment_is_clear;
use planner_core::plan::VehicleTask;
use planner_core::roadmap::prm::PrmConfig;
use planner_core::roadmap::{MAX_EDGE_M, RoadmapHeader};
use planner_core::schedule::ScheduleConfig;

use crate::map::VoxelMap;
use crate::map::column::{ColumnError, ground_below_clear_column, nearest_clear_column};
use crate::roadmap::passages::WantedConnection;
use crate::roadmap::{self, BuildTimes, BuiltRoadmap};
use crate::scenario::{self, Scenario, TerminalEdges};

/// Spacing of the grid on which slots around a single goal are searched, metres.
const SLOT_GRID_M: f32 = 0.25;

/// Height of a start or goal above the hull centre of a vehicle of `radius_m` that stands on the
/// ground below it, metres. Fails if the vertical flight between the two is nearer to an obstacle
/// than the required clearance; the error then suggests the nearest place that has the clearance.
/// Errors call the start or goal `what`, and name its `place` in the scenario, `FILE:LINE`.
pub(super) fn climb_height_m(
    scenario: &Scenario,
    map: &VoxelMap,
    what: &str,
    place: Option<&String>,
    point: &Point,
    radius_m: f32,
) -> anyhow::Result<f32> {
    let required_m = radius_m + scenario.roadmap.safety_margin_m;
    let error = match ground_below_clear_column(map, point, radius_m, required_m) {
        Ok(ground_m) => return Ok(point.z - ground_m - radius_m),
        Err(error) => error,
    };
    let at =
        format!("{}: [{}, {}, {}]", place.unwrap_or(&scenario.path), point.x, point.y, point.z);
    let why = match error {
        ColumnError::NotFree => {
            format!(
                "{what} is not free: {at} lies in an obstacle, in unknown space or outside the map"
            )
        }
        ColumnError::NoGround => format!("{what} has no ground below it: {at} is over nothing"),
        ColumnError::UnknownBelow { top_m } => {
            format!(
                "{what} has no ground below it: {at} is over unknown space, which reaches up to {top_m:.2} m"
            )
        }
        ColumnError::TooLow { ground_m } => bail!(
            "{what} is too low: {at} is {:.2} m above the ground, less than the radius of {radius_m} m\n\
             hint: give it a height of at least {:.2} m",
            point.z - ground_m,
            ground_m + radius_m
        ),
        ColumnError::TooNear { obstacle_point: place, distance_m, unknown } => {
            let obstacle = if unknown { "unknown space" } else { "an obstacle" };
            format!(
                "{what} has too little room between it and the ground: {at} needs {required_m:.2} m around its column, \
                 and {obstacle} at [{:.2}, {:.2}, {:.2}] is {distance_m:.2} m from it",
                place.x, place.y, place.z
            )
        }
    };
    match nearest_clear_column(map, point, radius_m, required_m) {
        Some(place) => {
            bail!(
                "{why}\nhint: the nearest place that would do is [{}, {}, {}]",
                place.x,
                place.y,
                place.z
            )
        }
        None => {
            bail!(
                "{why}\nhint: no place near it would do; `host-sim map info` shows the map's extent"
            )
        }
    }
}

/// The task of each vehicle, in the scenario's order. Fails as [`climb_height_m`] does for a start.
pub(super) fn vehicle_tasks(
    scenario: &Scenario,
    map: &VoxelMap,
) -> anyhow::Result<Vec<VehicleTask>> {
    let task = |(i, vehicle): (usize, &scenario::VehicleSection)| {
        let place = scenario.vehicle_file_lines.get(i);
        let what = format!("start of vehicle {}", vehicle.id);
        Ok(VehicleTask {
            id: vehicle.id,
            required_clearance_m: vehicle.radius_m + scenario.roadmap.safety_margin_m,
            climb_m: climb_height_m(scenario, map, &what, place, &vehicle.start, vehicle.radius_m)?,
            goal: vehicle.goal_index.map(|goal| goal as u16),
        })
    };
    scenario.vehicles.iter().enumerate().map(task).collect()
}

/// The goals of the scenario. In mode `"single-goal"`: as many slots around the one goal as there
/// are vehicles, far enough apart that vehicles can stand on all of them.
pub(super) fn goal_points(
    scenario: &Scenario,
    map: &VoxelMap,
    schedule: &ScheduleConfig,
) -> anyhow::Result<Vec<Point>> {
    let given = &scenario.mission.goals;
    if scenario.mission.mode != scenario::MissionMode::SingleGoal {
        return Ok(given.clone());
    }
    let (goal, wanted) = (given[0], scenario.vehicles.len());
    let (largest_m, required_m) =
        (scenario.largest_radius_m(), scenario.max_required_clearance_m());
    // A vehicle that has landed in one slot must not keep another from landing in the next.
    let apart_m = schedule.separation_m.max(schedule.parked_separation_m);
    // Half the side of the square that is searched, metres: the square fits the slots wanted, with
    // room to spare for walls.
    let reach_m = apart_m * (2.0 + (wanted as f32).sqrt() * 2.0);
    let steps = (reach_m / SLOT_GRID_M) as i32;
    let mut offsets: Vec<(i32, i32)> =
        (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i, j))).collect();
    offsets.sort_by_key(|&(i, j)| (i * i + j * j, i, j));
    let mut slots: Vec<Point> = Vec::new();
    for (i, j) in offsets {
        let slot = goal + Point::new(i as f32, j as f32, 0.0) * SLOT_GRID_M;
        let apart = slots.iter().all(|s| (s - slot).norm() >= apart_m);
        if apart
            && scenario.mission.geofence.as_ref().is_none_or(|fence| fence.contains(&slot))
            && segment_is_clear(&map.grid(), &goal, &slot, required_m)
            && ground_below_clear_column(map, &slot, largest_m, required_m).is_ok()
        {
            slots.push(slot);
            if slots.len() == wanted {
                return Ok(slots);
            }
        }
    }
    bail!(
        "no room at the single goal: {}: only {} of {wanted} vehicles find a place {apart_m} m apart in sight of it\n\
         hint: a goal with {reach_m:.0} m of free floor around it has room for all; fewer vehicles or a smaller \
         deconfliction.safety_distance_m need less",
        scenario.mission.goal_file_lines.first().unwrap_or(&scenario.path),
        slots.len()
    )
}

/// Shortest and longest edge of the roadmap, metres; lengths given as shares are of the map's
/// longest side.
fn edge_length_limits_m(scenario: &Scenario, map: &VoxelMap) -> anyhow::Result<(f32, f32)> {
    let settings = &scenario.roadmap;
    let size_m = (map.shape.max() - map.shape.min).max();
    let metres = |share: Option<f32>, metres: f32| share.map_or(metres, |share| share * size_m);
    let min_m = metres(settings.edge_min_share, settings.edge_min_m);
    let max_m = metres(settings.edge_max_share, settings.edge_max_m);
    if !(min_m < max_m && max_m <= MAX_EDGE_M) {
        bail!(
            "roadmap edges cannot be from {min_m} to {max_m} m long: {}: the map's longest side is {size_m} m, \
             and the longest edge must be above the shortest and at most {MAX_EDGE_M} m",
            scenario.path
        );
    }
    Ok((min_m, max_m))
}

/// Pairs of start and goal that the roadmap should join, with the clearance they need: each
/// vehicle's start with its own goal, or with every goal where none is its own.
fn wanted_connections(scenario: &Scenario, goals: usize) -> Vec<WantedConnection> {
    let vehicles = scenario.vehicles.len();
    let pairs = scenario.vehicles.iter().enumerate().flat_map(|(start, vehicle)| {
        let required_m = vehicle.radius_m + scenario.roadmap.safety_margin_m;
        let own = move |goal: &usize| vehicle.goal_index.is_none_or(|own| own == *goal);
        (0..goals).filter(own).map(move |goal| WantedConnection {
            start_node: start,
            goal_node: vehicles + goal,
            required_clearance_m: required_m,
        })
    });
    pairs.collect()
}

/// Builds the roadmap between starts and goals; also returns the header of its file, and how long
/// each part of the construction took.
pub(super) fn build_roadmap(
    scenario: &Scenario,
    map: &VoxelMap,
    goals: &[Point],
) -> anyhow::Result<(BuiltRoadmap, RoadmapHeader, BuildTimes)> {
    let starts = scenario.vehicles.iter().map(|v| v.start);
    let terminals: Vec<Point> = starts.chain(goals.iter().copied()).collect();
    let settings = &scenario.roadmap;
    // Edges are tested with the clearance of the smallest vehicle; the search of a larger one skips
    // edges whose stored clearance is too small for it.
    let smallest_m = scenario.vehicles.iter().map(|v| v.radius_m).fold(f32::INFINITY, f32::min);
    let (edge_min_m, edge_max_m) = edge_length_limits_m(scenario, map)?;
    // Nodes keep `safety_margin_m` from the geofence: a vehicle beyond the fence lands. The fence
    // is a box, so an edge between two nodes inside lies inside.
    let room = Point::repeat(settings.safety_margin_m);
    let fence = scenario.mission.geofence.as_ref();
    let fenced = fence.map(|f| map.with_nodes_inside(&(f.min + room), &(f.max - room)));
    let map = fenced.as_ref().unwrap_or(map);
    let config = PrmConfig {
        random_nodes: settings.random_nodes as usize,
        edge_min_m,
        edge_max_m,
        clearance_m: smallest_m + settings.safety_margin_m,
        seed: scenario.seed,
        sampling: settings.sampling,
    };
    let (mut roadmap, mut parts) = roadmap::build(map, &terminals, &config)?;
    // Removes the edges that join two terminals, if the scenario forbids them.
    let drop_terminal_edges = |roadmap: &mut BuiltRoadmap| {
        if settings.terminal_edges == TerminalEdges::Forbidden {
            let is_terminal = |node: u16| usize::from(node) < terminals.len();
            roadmap.edges.retain(|edge| !(is_terminal(edge.a) && is_terminal(edge.b)));
        }
    };
    drop_terminal_edges(&mut roadmap);
    if settings.adds_passages {
        let searching = Instant::now();
        roadmap::add_passages(
            map,
            &mut roadmap,
            &config,
            &wanted_connections(scenario, goals.len()),
        )?;
        drop_terminal_edges(&mut roadmap);
        parts.passages_s = searching.elapsed().as_secs_f64();
    }
    let header = roadmap::header(
        &config,
        scenario.map.origin,
        scenario.vehicles.len() as u16,
        goals.len() as u16,
    );
    Ok((roadmap, header, parts))
}
