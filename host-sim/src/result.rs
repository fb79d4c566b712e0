//! `result.json` and `timing.json`: what a command found, and what the clock said. Units are in the
//! keys.
//!
//! `result.json` is the same for the same scenario and seed, whatever the machine or the build;
//! nothing timed goes in it.

use serde::Serialize;

use crate::roadmap::BuildTimes;

/// `result.json`.
#[derive(Clone, Debug, Serialize)]
pub struct MissionResult {
    /// The command that wrote it.
    pub command: &'static str,
    /// The scenario's name.
    pub scenario: String,
    /// The seed used.
    pub seed: u64,
    /// Whether every vehicle that no fault took out did its task and landed clean.
    pub complete: bool,
    /// One entry per vehicle.
    pub vehicles: Vec<VehicleResult>,
    /// The swarm as a whole.
    pub totals: Totals,
    /// Least distances that were kept, or not.
    pub safety: Safety,
    /// The roadmap planned on.
    pub roadmap: RoadmapSize,
    /// Goals and vehicles that the assignment could not serve.
    pub left: Left,
    /// Coverage of the area, in a coverage mission.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage: Option<CoverageResult>,
}

/// Coverage of an area.
#[derive(Clone, Debug, Serialize)]
pub struct CoverageResult {
    /// Share of the area that pictures show.
    pub covered_share: f64,
    /// Waypoints of all routes.
    pub waypoints: u32,
    /// Lanes.
    pub lanes: usize,
    /// Greatest distance from one lane to the next, metres.
    pub lane_m: f64,
    /// Greatest distance from one waypoint to the next, metres.
    pub waypoint_m: f64,
    /// Direction of the lanes, degrees from east to the left.
    pub angle_deg: f64,
    /// The greatest cost, seconds.
    pub max_cost_s: f64,
    /// Mean of the costs, seconds.
    pub mean_cost_s: f64,
    /// Standard deviation of the costs, seconds.
    pub sd_cost_s: f64,
    /// The greatest cost, metres.
    pub max_cost_m: f64,
    /// No division can cost less, seconds.
    pub lower_bound_s: f64,
    /// Excess of the greatest cost over that, as a share.
    pub gap: f64,
    /// Pictures.
    pub photos: u64,
    /// Waypoints photographed more than once.
    pub twice: u64,
    /// Waypoints photographed by nobody.
    pub left: u64,
    /// Heights above the ground, where there is terrain.
    #[serde(flatten)]
    pub terrain: Option<TerrainResult>,
    /// Route of each vehicle that flies.
    pub routes: Vec<RouteResult>,
}

/// How lanes lie above terrain, as the checker found it.
#[derive(Clone, Debug, Serialize)]
pub struct TerrainResult {
    /// The least height above the ground of any lane or way between, metres.
    pub ground_least_m: f64,
    /// The greatest, metres.
    pub ground_most_m: f64,
    /// The steepest leg among them, metres for each metre over ground.
    pub steepest: f64,
    /// Legs that come too near to the ground.
    pub too_low: u64,
    /// Legs steeper than their vehicle flies.
    pub too_steep: u64,
}

/// One route.
#[derive(Clone, Debug, Serialize)]
pub struct RouteResult {
    /// MAVLink system id.
    pub vehicle: u8,
    /// Lowest number of the route's waypoints.
    pub first: u32,
    /// Highest number of the route's waypoints.
    pub last: u32,
    /// Whether it is flown from the last to the first.
    pub backward: bool,
    /// Height of its transit, metres.
    pub layer_m: f64,
    /// When it leaves its pad, seconds.
    pub depart_s: f64,
    /// C_k, seconds: of all sorties and the swaps between them.
    pub cost_s: f64,
    /// Cost of the route, metres.
    pub cost_m: f64,
    /// Sorties of the route, one for each battery, in turn.
    pub sorties: Vec<SortieResult>,
}

/// Flight of a vehicle on one battery.
#[derive(Clone, Debug, Serialize)]
pub struct SortieResult {
    /// Lowest number of the sortie's waypoints.
    pub first: u32,
    /// Highest number of the sortie's waypoints.
    pub last: u32,
    /// When its round begins, seconds.
    pub begin_s: f64,
    /// When it leaves its pad after that, seconds.
    pub depart_s: f64,
    /// C_k of it, seconds.
    pub cost_s: f64,
    /// Cost of the sortie, metres.
    pub cost_m: f64,
    /// Time from pad to pad, down to the lanes and up again too, seconds.
    pub flown_s: f64,
}

/// Goals and vehicles that the assignment could not serve: more of one than of the other, or no
/// path between them.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Left {
    /// Goals, by index.
    pub goals: Vec<u16>,
    /// Vehicles, by id; they stay on their pads.
    pub vehicles: Vec<u8>,
    /// A line for each: where it is, why it is left, and what would help.
    pub reasons: Vec<String>,
}

/// One vehicle.
#[derive(Clone, Debug, Serialize)]
pub struct VehicleResult {
    /// MAVLink system id.
    pub id: u8,
    /// Index of its goal, if it got one.
    pub goal: Option<u16>,
    /// Whether it came to its goal.
    pub reached: bool,
    /// Whether it stands on the ground, disarmed, after its flight.
    pub landed: bool,
    /// Length of its path, metres.
    pub path_m: f64,
    /// Way flown, metres.
    pub flown_m: f64,
    /// Time from take-off to landing, seconds.
    pub flight_time_s: f64,
    /// How it ended: a state of the companion's mission, and the text of the row that led there
    /// where it is a warning.
    pub end: String,
}

/// The swarm as a whole.
#[derive(Clone, Debug, Serialize)]
pub struct Totals {
    /// Sum of all path lengths, metres.
    pub path_m: f64,
    /// Time from the start command to the last landing, seconds; in a plan, the longest nominal
    /// flight.
    pub makespan_s: f64,
}

/// Distances kept.
#[derive(Clone, Debug, Serialize)]
pub struct Safety {
    /// Times a body touched an obstacle; the floor while taking off or landing is none.
    pub wall_contacts: u32,
    /// Smallest distance from a vehicle's centre to an obstacle between take-off and landing,
    /// metres.
    pub min_clearance_m: Option<f64>,
    /// Smallest distance between two centres, one of them flying, metres.
    pub min_separation_m: Option<f64>,
    /// Safety distance of the scenario, metres.
    pub safety_distance_m: f64,
    /// Times a pair came closer than that.
    pub violations: u32,
    /// Times a flying vehicle made no progress for 20 s though a way was left.
    pub deadlocks: u32,
}

/// The roadmap planned on.
#[derive(Clone, Debug, Serialize)]
pub struct RoadmapSize {
    /// Nodes, terminals among them.
    pub nodes: usize,
    /// Edges, each counted once.
    pub edges: usize,
    /// Length of the roadmap file.
    pub bytes: usize,
}

/// `timing.json`, seconds of this machine's clock.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Timing {
    /// Reading or making the map.
    pub map_s: f64,
    /// Starts and goals checked; the roadmap: nodes, edges and their clearances, file.
    pub roadmap_s: f64,
    /// Time of each part of the roadmap's construction.
    pub roadmap_parts: BuildTimes,
    /// The shortest paths that give what each goal would cost each vehicle.
    pub search_s: f64,
    /// Which vehicle flies to which goal.
    pub assignment_s: f64,
    /// The whole plan: search, assignment, schedule.
    pub plan_s: f64,
    /// Time that passed in the simulation.
    pub simulated_s: f64,
    /// The whole command.
    pub wall_s: f64,
}

/// Rounds to a tenth of a millimetre (or of a millisecond): what `result.json` states, it means.
pub fn rounded(value: f32) -> f64 {
    (f64::from(value) * 1e4).round() / 1e4
}

/// A value as indented JSON.
pub fn json(value: &impl Serialize) -> anyhow::Result<String> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    Ok(text)
}
