//! Structures of `result.json` (what a command found) and `timing.json` (how long it took). Units
//! are in the keys.
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
    /// Whether there was no contact, violation or deadlock, as many goals were served as vehicles
    /// and goals allow, and every vehicle that no fault disabled did its task and landed. A plan
    /// has only to serve the goals; pictures have to show the whole area.
    pub complete: bool,
    /// One entry per vehicle.
    pub vehicles: Vec<VehicleResult>,
    /// The swarm as a whole.
    pub totals: Totals,
    /// Smallest distances, and counts of contacts, violations and deadlocks.
    pub safety: Safety,
    /// Numbers of nodes, edges and bytes of the roadmap that was planned on.
    pub roadmap: RoadmapCounts,
    /// Goals without a vehicle, and vehicles without a goal.
    #[serde(rename = "left")]
    pub unserved: Unserved,
    /// Results of the coverage; `None` in a mission with goals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage: Option<CoverageResult>,
}

/// Coverage of an area.
#[derive(Clone, Debug, Serialize)]
pub struct CoverageResult {
    /// Share of the area that pictures show, 0 to 1; with `trigger` `none` the pictures are those
    /// that a camera would take all along the lanes that were flown.
    pub covered_share: f64,
    /// Number of waypoints on all lanes.
    #[serde(rename = "waypoints")]
    pub waypoint_count: u32,
    /// Number of lanes.
    #[serde(rename = "lanes")]
    pub lane_count: usize,
    /// Greatest distance from one lane to the next, metres.
    #[serde(rename = "lane_m")]
    pub lane_spacing_m: f64,
    /// Greatest distance from one waypoint to the next, metres.
    #[serde(rename = "waypoint_m")]
    pub waypoint_spacing_m: f64,
    /// Direction of the lanes, degrees counter-clockwise from east.
    #[serde(rename = "angle_deg")]
    pub lane_angle_deg: f64,
    /// Greatest cost of any vehicle's route, seconds.
    pub max_cost_s: f64,
    /// Mean cost of the vehicles' routes, seconds.
    pub mean_cost_s: f64,
    /// Sample standard deviation of the costs of the vehicles' routes, seconds.
    pub sd_cost_s: f64,
    /// Greatest cost of any vehicle's route, metres.
    pub max_cost_m: f64,
    /// Lower bound of `max_cost_s` over all divisions of the area, seconds.
    pub lower_bound_s: f64,
    /// `max_cost_s / lower_bound_s - 1`.
    #[serde(rename = "gap")]
    pub gap_to_lower_bound: f64,
    /// What triggers the camera: `distance`, `waypoint` or `none`.
    pub trigger: &'static str,
    /// Number of pictures planned or, after a flight, taken, those of earlier flights that it
    /// continued included; 0 with `trigger` `none`.
    pub photos: u64,
    /// Number of waypoints photographed (with `trigger` `none`: flown) more than once.
    #[serde(rename = "twice")]
    pub repeated_waypoints: u64,
    /// Number of waypoints that no vehicle photographed (with `trigger` `none`: flew over).
    #[serde(rename = "left")]
    pub missed_waypoints: u64,
    /// Heights above the ground; `None` over level ground.
    #[serde(flatten)]
    pub terrain: Option<TerrainResult>,
    /// Route of each vehicle that flies.
    pub routes: Vec<RouteResult>,
}

/// Heights and slopes of the lanes above terrain, as `coverage::check` found them.
#[derive(Clone, Debug, Serialize)]
pub struct TerrainResult {
    /// Least height above the ground of any lane or leg between lanes, metres.
    #[serde(rename = "ground_least_m")]
    pub min_above_ground_m: f64,
    /// Greatest height above the ground of any lane or leg between lanes, metres.
    #[serde(rename = "ground_most_m")]
    pub max_above_ground_m: f64,
    /// Greatest slope of any lane or leg between lanes: rise divided by horizontal distance.
    #[serde(rename = "steepest")]
    pub steepest_slope: f64,
    /// Number of legs that come too near to the ground.
    #[serde(rename = "too_low")]
    pub legs_too_low: u64,
    /// Number of legs that are steeper than their vehicle flies.
    #[serde(rename = "too_steep")]
    pub legs_too_steep: u64,
}

/// One route.
#[derive(Clone, Debug, Serialize)]
pub struct RouteResult {
    /// MAVLink system id.
    pub vehicle: u8,
    /// Lowest number of the route's waypoints.
    #[serde(rename = "first")]
    pub lowest_waypoint: u32,
    /// Highest number of the route's waypoints.
    #[serde(rename = "last")]
    pub highest_waypoint: u32,
    /// Whether the route's waypoints are flown from the highest number to the lowest.
    pub backward: bool,
    /// Height of the vehicle's transit layer, metres.
    #[serde(rename = "layer_m")]
    pub layer_height_m: f64,
    /// Time at which the vehicle first leaves its pad, seconds after the mission's start.
    pub depart_s: f64,
    /// Cost C_k of the route, seconds: all sorties and the battery swaps between them.
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
    #[serde(rename = "first")]
    pub lowest_waypoint: u32,
    /// Highest number of the sortie's waypoints.
    #[serde(rename = "last")]
    pub highest_waypoint: u32,
    /// Time at which the round of this sortie begins, seconds after the mission's start.
    #[serde(rename = "begin_s")]
    pub round_begin_s: f64,
    /// Time at which the vehicle leaves its pad, seconds after `round_begin_s`.
    #[serde(rename = "depart_s")]
    pub departure_delay_s: f64,
    /// Cost C_k of the sortie, seconds.
    pub cost_s: f64,
    /// Cost of the sortie, metres.
    pub cost_m: f64,
    /// Time from pad to pad, with the descent to the lanes and the climb from them, seconds.
    #[serde(rename = "flown_s")]
    pub flight_duration_s: f64,
}

/// Goals without a vehicle and vehicles without a goal: there are more of one kind than of the
/// other, or the roadmap has no path between them.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Unserved {
    /// Goals, by index.
    pub goals: Vec<u16>,
    /// Vehicles, by id: these stay on their pads.
    pub vehicles: Vec<u8>,
    /// One line each: where the goal or vehicle is, why it is left, and what would help.
    pub reasons: Vec<String>,
}

/// One vehicle.
#[derive(Clone, Debug, Serialize)]
pub struct VehicleResult {
    /// MAVLink system id.
    pub id: u8,
    /// Index of the vehicle's goal; `None` if it has none.
    pub goal: Option<u16>,
    /// Whether the vehicle reached its goal, by its true position; false if nothing was flown.
    pub reached: bool,
    /// Whether the vehicle stood on the ground again, disarmed, after it had left it; false if
    /// nothing was flown.
    pub landed: bool,
    /// Length of the vehicle's planned path, metres.
    pub path_m: f64,
    /// Length of the track that the vehicle flew, metres.
    pub flown_m: f64,
    /// Time from take-off to landing, seconds; in a plan, by nominal speeds.
    pub flight_time_s: f64,
    /// How the flight ended: the last state of the companion's mission, and, if a warning row of
    /// the mission table led there, that row's text. `no goal` if there was no flight to make;
    /// `planned` for a flight of a plan.
    pub end: String,
}

/// The swarm as a whole.
#[derive(Clone, Debug, Serialize)]
pub struct Totals {
    /// Sum of all path lengths, metres.
    pub path_m: f64,
    /// Time from the start command to the last landing, seconds; in a plan, the latest landing by
    /// planned departures and nominal speeds.
    pub makespan_s: f64,
}

/// Smallest distances in the flight, and how often a limit was broken.
#[derive(Clone, Debug, Serialize)]
pub struct Safety {
    /// Number of times a vehicle's body touched an obstacle, a falling vehicle or a wreck, the
    /// floor in a take-off or landing not counted.
    pub wall_contacts: u32,
    /// Number of these contacts in which its pilot flew the vehicle; left out if none.
    #[serde(skip_serializing_if = "is_zero")]
    pub wall_contacts_under_pilot: u32,
    /// Smallest distance from a vehicle's centre to an obstacle between take-off and landing,
    /// metres; in a plan, from the planned paths. `None` if there is no such distance.
    pub min_clearance_m: Option<f64>,
    /// Smallest distance between the centres of two vehicles, at least one of them flying, metres.
    pub min_separation_m: Option<f64>,
    /// Safety distance of the scenario, metres.
    pub safety_distance_m: f64,
    /// Number of times a pair came closer than the safety distance.
    pub violations: u32,
    /// Number of times a flying vehicle made no progress for 20 s with a part of its path left.
    pub deadlocks: u32,
}

/// Whether a count is 0: then it is left out of the file.
fn is_zero(count: &u32) -> bool {
    *count == 0
}

/// Numbers of nodes, edges and bytes of the roadmap that was planned on.
#[derive(Clone, Debug, Serialize)]
pub struct RoadmapCounts {
    /// Number of nodes, starts and goals included.
    pub nodes: usize,
    /// Number of edges, each counted once.
    pub edges: usize,
    /// Length of the roadmap file, bytes; in a coverage mission that of the field file, 0 over
    /// level ground.
    #[serde(rename = "bytes")]
    pub file_bytes: usize,
}

/// `timing.json`: seconds of this machine's clock, `simulated_s` excepted.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Timing {
    /// Reading the map file, or making the built-in map.
    pub map_s: f64,
    /// Checking starts and goals; making the roadmap: nodes, edges, clearances, file.
    pub roadmap_s: f64,
    /// Time of each part of the roadmap's construction.
    pub roadmap_parts: BuildTimes,
    /// Searching the shortest paths that give the cost of each goal for each vehicle; in `cover`,
    /// computing lanes and the paths around no-fly zones.
    pub search_s: f64,
    /// Assigning goals to vehicles; in `cover`, computing the routes.
    pub assignment_s: f64,
    /// The whole plan: search, assignment, schedule.
    pub plan_s: f64,
    /// Simulated time, seconds.
    pub simulated_s: f64,
    /// The whole command.
    pub wall_s: f64,
}

/// Rounds to four decimals, a tenth of a millimetre or millisecond, for `result.json`.
pub fn rounded(value: f32) -> f64 {
    (f64::from(value) * 1e4).round() / 1e4
}

/// A value as indented JSON.
pub fn json(value: &impl Serialize) -> anyhow::Result<String> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    Ok(text)
}
