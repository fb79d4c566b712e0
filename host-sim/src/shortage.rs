//! Explains what a mission is short of: goals without a vehicle, vehicles without a goal, and what
//! would help.
//!
//! Whether the roadmap or the building lacks a path is read from the map itself: the widest path
//! from a start to a goal over the centres of the cells, found by a flood that always continues
//! from the widest cell it has reached. The width of a path is the distance to the nearest obstacle
//! at its narrowest cell. Cost: all cells once a vehicle, and a search of the neighbourhood of each
//! cell near a wall; only missions that fall short pay it.

use std::collections::BTreeMap;

use planner_core::Point;
use planner_core::map::segment::point_clearance;
use planner_core::roadmap::RoadmapView;

use crate::map::VoxelMap;
use crate::mission::{HostPlan, PreparedMission};

/// Step in which path widths are measured, metres.
const WIDTH_STEP_M: f32 = 0.05;
/// Largest map that is flooded, cells: the queues take up to 12 bytes a cell.
const MAX_FLOODED_CELLS: usize = 1 << 25;
/// Most goals and vehicles together that get a line of their own; `and N more` counts the rest.
const MAX_SHORTAGE_LINES: usize = 8;

/// One line for each goal without a vehicle and each vehicle without a goal: its position, the
/// reason and what would help.
pub fn shortage_lines(mission: &PreparedMission, plan: &HostPlan) -> Vec<String> {
    let left = mission.unserved(plan);
    let all = left.goals.len() + left.vehicles.len();
    if all == 0 {
        return Vec::new();
    }
    let mut asked = ShortageFindings {
        mission,
        reachability: Reachability::new(mission),
        widest_clearances_m: BTreeMap::new(),
    };
    let mut lines = Vec::new();
    for &goal in left.goals.iter().take(MAX_SHORTAGE_LINES) {
        lines.push(goal_line(&mut asked, usize::from(goal)));
    }
    let remedy = if left.goals.is_empty() { RemedyStatus::Unnamed } else { RemedyStatus::Named };
    for &id in left.vehicles.iter().take(MAX_SHORTAGE_LINES.max(lines.len()) - lines.len()) {
        lines.push(vehicle_line(&mut asked, id, remedy));
    }
    if all > lines.len() {
        lines.push(format!("and {} more", all - lines.len()));
    }
    lines
}

/// The mission, and what was found about it so far.
struct ShortageFindings<'a> {
    mission: &'a PreparedMission,
    /// Which goals the vehicles reach.
    reachability: Reachability,
    /// By vehicle index: [`widest_path_clearances_m`] from its start to all goals, computed on
    /// demand.
    widest_clearances_m: BTreeMap<usize, Option<Vec<f32>>>,
}

/// The line about a goal that no vehicle flies to.
fn goal_line(asked: &mut ShortageFindings<'_>, goal: usize) -> String {
    let (mission, reach) = (asked.mission, &asked.reachability);
    let (at, vehicles) = (&mission.goals[goal], mission.tasks.len());
    let what = format!("goal {goal} at [{}, {}, {}]", at.x, at.y, at.z);
    let place = mission
        .scenario
        .mission
        .goal_file_lines
        .get(goal)
        .map_or(String::new(), |p| format!(" ({p})"));
    let bound = mission
        .tasks
        .iter()
        .enumerate()
        .find(|(_, task)| task.goal.is_some_and(|g| usize::from(g) == goal));
    let reachable = match bound {
        Some((vehicle, _)) => reach.are_connected(vehicle, goal),
        None => (0..vehicles).any(|vehicle| reach.are_connected(vehicle, goal)),
    };
    let labelled = mission.tasks.iter().any(|task| task.goal.is_some());
    let why = match (reachable, bound, labelled) {
        (false, bound, _) => {
            let vehicle = bound.map_or_else(|| smallest_vehicle(mission), |(vehicle, _)| vehicle);
            format!("no way in the roadmap leads there; {}", path_remedy_text(asked, vehicle, goal))
        }
        (true, _, true) => "no vehicle names it as its goal".to_owned(),
        (true, _, false) if vehicles < mission.goals.len() => {
            format!("{vehicles} vehicles serve at most {vehicles} of {} goals", mission.goals.len())
        }
        (true, ..) => {
            "the vehicles that a way leads to it for serve other goals; more roadmap.nodes may help"
                .to_owned()
        }
    };
    format!("{what}{place}: {why}")
}

/// Whether goals have lines, which name a remedy where the roadmap has no path: then vehicles'
/// lines do not repeat it.
#[derive(Clone, Copy)]
enum RemedyStatus {
    /// The goals' lines name the remedy.
    Named,
    /// No line has named it.
    Unnamed,
}

/// The line about a vehicle that stays on its pad.
fn vehicle_line(asked: &mut ShortageFindings<'_>, id: u8, remedy: RemedyStatus) -> String {
    let (mission, reach) = (asked.mission, &asked.reachability);
    let vehicle = mission.tasks.iter().position(|task| task.id == id).unwrap_or_default();
    let at = &mission.scenario.vehicles[vehicle].start;
    let place = mission
        .scenario
        .vehicle_file_lines
        .get(vehicle)
        .map_or(String::new(), |p| format!(" ({p})"));
    let goals = mission.goals.len();
    let why = if !(0..goals).any(|goal| reach.are_connected(vehicle, goal)) {
        let goal = mission.tasks[vehicle].goal.map_or(0, usize::from);
        let helps = match remedy {
            RemedyStatus::Named => String::new(),
            RemedyStatus::Unnamed => format!("; {}", path_remedy_text(asked, vehicle, goal)),
        };
        format!("no way in the roadmap leads from it to a goal{helps}")
    } else if goals < mission.tasks.len() {
        format!("{goals} goals are for at most {goals} of {} vehicles", mission.tasks.len())
    } else {
        "the goals that a way leads to from it are served by others, or not its own".to_owned()
    };
    format!("vehicle {id} at [{}, {}, {}]{place}: {why}", at.x, at.y, at.z)
}

/// The vehicle with the smallest radius: it fits through the most passages.
fn smallest_vehicle(mission: &PreparedMission) -> usize {
    let radius = |i: &usize| mission.scenario.vehicles[*i].radius_m;
    (0..mission.tasks.len()).min_by(|a, b| radius(a).total_cmp(&radius(b))).unwrap_or_default()
}

/// Text that says what would give this vehicle a path to this goal, or that nothing would.
fn path_remedy_text(asked: &mut ShortageFindings<'_>, vehicle: usize, goal: usize) -> String {
    let mission = asked.mission;
    let settings = &mission.scenario.vehicles[vehicle];
    let (radius_m, required_m) = (settings.radius_m, mission.tasks[vehicle].required_clearance_m);
    let widths = asked.widest_clearances_m.entry(vehicle).or_insert_with(|| {
        let field = mission.clearance_field();
        widest_path_clearances_m(
            &mission.map,
            |p| field.lower_bound_m(p),
            &settings.start,
            &mission.goals,
            required_m,
        )
    });
    let Some(widest_m) = widths.as_ref().map(|widths| widths[goal]) else {
        return "more roadmap.nodes or a smaller roadmap.safety_margin_m may help".to_owned();
    };
    let half_m = mission.map.shape.resolution_m / 2.0;
    if widest_m >= required_m {
        let settings = &mission.scenario.roadmap;
        let passages = if settings.adds_passages { "" } else { ", or roadmap.passages = true," };
        format!(
            "the map has one with the {required_m:.2} m to the nearest obstacle that are needed: \
             more roadmap.nodes ({}){passages} would help",
            settings.random_nodes
        )
    } else if widest_m > radius_m {
        let margin_m = ((widest_m - radius_m - half_m).max(0.0) * 100.0).floor() / 100.0;
        format!(
            "the widest on the map leaves {widest_m:.2} m to the nearest obstacle and {required_m:.2} m are needed: \
             a roadmap.safety_margin_m of at most {margin_m} leaves it open"
        )
    } else if widest_m > 0.0 {
        format!(
            "the widest on the map leaves {widest_m:.2} m, less than the radius of {radius_m} m: nothing helps"
        )
    } else {
        "the map has none: it is walled off".to_owned()
    }
}

/// Which goals are connected to each vehicle's start by edges that are wide enough for it.
struct Reachability {
    /// Whether each vehicle's start is connected to each goal, by their indices.
    joined: Vec<Vec<bool>>,
}

impl Reachability {
    fn new(mission: &PreparedMission) -> Self {
        let view = mission.roadmap_view();
        let vehicles = mission.tasks.len();
        let row = |vehicle: usize| {
            let seen =
                connected_component(&view, vehicle, mission.tasks[vehicle].required_clearance_m);
            (0..mission.goals.len()).map(|goal| seen[vehicles + goal]).collect()
        };
        Self { joined: (0..vehicles).map(row).collect() }
    }

    /// Whether the roadmap has a path from the vehicle to the goal; both by index.
    fn are_connected(&self, vehicle: usize, goal: usize) -> bool {
        self.joined[vehicle][goal]
    }
}

/// Marks the nodes that edges of at least this clearance connect to `from`.
fn connected_component(view: &RoadmapView<'_>, from: usize, required_m: f32) -> Vec<bool> {
    let mut seen = vec![false; view.node_count()];
    let mut open = vec![from as u16];
    seen[from] = true;
    while let Some(node) = open.pop() {
        for edge in view.half_edges(node).filter(|edge| view.has_clearance(edge, required_m)) {
            if !std::mem::replace(&mut seen[usize::from(edge.target)], true) {
                open.push(edge.target);
            }
        }
    }
    seen
}

/// Clearance of the widest path from `from` to each goal, metres: the distance to the nearest
/// obstacle at its narrowest cell, capped at `most_m` rounded up to a step; 0 where no path exists.
/// `None` if the map is too large to be flooded. `at_least_m` is a cheap lower bound of a point's
/// clearance.
fn widest_path_clearances_m(
    map: &VoxelMap,
    at_least_m: impl Fn(&Point) -> f32,
    from: &Point,
    goals: &[Point],
    most_m: f32,
) -> Option<Vec<f32>> {
    let (shape, grid) = (&map.shape, map.grid());
    let steps = (most_m / WIDTH_STEP_M).ceil() as usize;
    let [nx, ny, nz] = shape.dims.map(|d| d as usize);
    let cells = nx.checked_mul(ny)?.checked_mul(nz)?;
    if cells > MAX_FLOODED_CELLS {
        return None;
    }
    let steps_at = |place: &Point| {
        let most_m = WIDTH_STEP_M * steps as f32;
        if at_least_m(place) >= most_m {
            return steps;
        }
        ((point_clearance(&grid, place, most_m) / WIDTH_STEP_M + 1e-3) as usize).min(steps)
    };
    // A start or goal may be nearer to an obstacle than the centre of its cell, above all to the
    // ground, so its own clearance counts too.
    let (at_start, at_goals) = (steps_at(from), goals.iter().map(steps_at).collect::<Vec<_>>());
    let from = shape.cell_of(from)?;
    let goals: Vec<_> = goals.iter().map(|goal| shape.cell_of(goal)).collect();
    let mut widths = vec![0.0; goals.len()];
    let mut missing = goals.len();
    let at = |[i, j, k]: [u32; 3]| (k as usize * ny + j as usize) * nx + i as usize;
    let step = |[i, j, k]: [u32; 3]| {
        let r = shape.resolution_m;
        steps_at(&(shape.min + Point::new(i as f32 + 0.5, j as f32 + 0.5, k as f32 + 0.5) * r))
    };
    let mut seen = vec![0u64; cells.div_ceil(64)];
    let mut open: Vec<Vec<[u32; 3]>> = vec![Vec::new(); steps + 1];
    let mut width = step(from).min(at_start);
    open[width].push(from);
    seen[at(from) / 64] |= 1 << (at(from) % 64);
    while width > 0 && missing > 0 {
        let Some(cell) = open[width].pop() else {
            width -= 1;
            continue;
        };
        for goal in (0..goals.len()).filter(|&goal| goals[goal] == Some(cell)) {
            widths[goal] = width.min(at_goals[goal]) as f32 * WIDTH_STEP_M;
            missing -= 1;
        }
        for axis in 0..3 {
            for next in [
                cell[axis].checked_sub(1),
                cell[axis].checked_add(1).filter(|&c| c < shape.dims[axis]),
            ] {
                let Some(next) = next else { continue };
                let mut place = cell;
                place[axis] = next;
                let (word, mask) = (at(place) / 64, 1 << (at(place) % 64));
                if seen[word] & mask != 0 || grid.is_occupied(place) {
                    continue;
                }
                seen[word] |= mask;
                // The width of a path is that of its narrowest cell so far.
                open[step(place).min(width)].push(place);
            }
        }
    }
    Some(widths)
}

#[cfg(test)]
mod tests;
