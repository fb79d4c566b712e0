//! Random test cases that a board and the host compute alike: tests compare the results bit by bit
//! and count the board's instructions.
//!
//! Each case comes from a seed and is the same everywhere: PCG random numbers, f32 arithmetic, no
//! clock.

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use firmware::capacity::{GATES, ROADMAP_NODES, VEHICLES, WAYPOINTS};
use heapless::Vec;
use planner_core::Point;
use planner_core::assignment::{self, AssignmentWorkspace};
use planner_core::flight::{Gate, Path};
use planner_core::map::voxel::{GridShape, Outside, VoxelGrid};
use planner_core::plan::{GoalMode, Objective, PlanRequest, VehicleTask};
use planner_core::roadmap::prm::{PrmConfig, Sampling};
use planner_core::roadmap::search::{self, SearchWorkspace};
use planner_core::roadmap::{Edge, HalfEdge, RoadmapView};
use planner_core::schedule::ScheduleConfig;
use planner_core::track::deconflict::{
    self, Advice, DeconflictConfig, Method, Neighbour, OwnVehicle,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Number of [`PlanCase`]s in which a test compares the board's results with the host's.
pub const PLAN_CASES: u64 = 200;
/// Number of [`StepCase`]s whose instructions are counted; the largest count is reported.
pub const STEP_CASES: usize = 10_000;
/// Most vehicles of a [`PlanCase`], so that its cost matrix is at most 10 × 10.
const MAX_SWARM_VEHICLES: usize = 10;
/// Number of points along each path of a [`PlanCase`] at which [`deconflict::advise`] is called
/// with random neighbours.
const ADVICE_PER_PATH: usize = 4;
const CRC32: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Speeds and separations by which the flights of these cases are scheduled.
pub const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.75,
    cruise_mps: 2.0,
    vertical_mps: 1.0,
};
/// Required clearance of every vehicle of these cases (radius and safety margin), metres.
pub const CLEARANCE_M: f32 = 0.8;
/// How goals are assigned to vehicles in these cases: any vehicle to any goal, least total
/// distance.
pub const ASSIGNMENT_MODE: GoalMode = GoalMode::Unlabelled(Objective::TotalDistance);

/// The tasks of a swarm with one vehicle at each start of the roadmap, at most [`VEHICLES`].
pub fn vehicle_tasks(view: &RoadmapView<'_>) -> Vec<VehicleTask, VEHICLES> {
    let starts = view.header().start_count.min(VEHICLES as u16);
    let task = |i: u16| VehicleTask {
        id: 1 + i as u8,
        required_clearance_m: CLEARANCE_M,
        climb_m: 1.0,
        goal: Some(i),
    };
    (0..starts).map(task).collect()
}

/// Descent at each goal of the roadmap, from the path's end to the ground: 1 m.
pub fn goal_descents(view: &RoadmapView<'_>) -> Vec<f32, VEHICLES> {
    (0..view.header().goal_count.min(VEHICLES as u16)).map(|_| 1.0).collect()
}

/// The plan request for the vehicles of [`vehicle_tasks`] and the descents of [`goal_descents`].
pub fn plan_request<'a>(vehicles: &'a [VehicleTask], descents_m: &'a [f32]) -> PlanRequest<'a> {
    PlanRequest {
        vehicles,
        goal_descents_m: descents_m,
        mode: ASSIGNMENT_MODE,
        schedule: SCHEDULE,
        max_gates: GATES,
    }
}

/// Workspace of [`plan_case`].
pub struct PlanCaseWorkspace {
    search: SearchWorkspace<ROADMAP_NODES>,
    assignment: AssignmentWorkspace<VEHICLES>,
}

impl PlanCaseWorkspace {
    /// Empty; its bytes are all zeros.
    pub const fn new() -> Self {
        Self { search: SearchWorkspace::new(), assignment: AssignmentWorkspace::new() }
    }
}

impl Default for PlanCaseWorkspace {
    fn default() -> Self {
        Self::new()
    }
}

/// Results of one planning case: CRC-32 over every bit of each kind of result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanCase {
    /// CRC of the cost matrix.
    pub costs_crc: u32,
    /// CRC of the assignment of vehicles to goals, and of its total cost.
    pub assignment_crc: u32,
    /// CRC of all paths: nodes, positions, arc lengths, clearances.
    pub paths_crc: u32,
    /// CRC of the advice among random neighbours, by both methods: speed scale, stop distance, the
    /// vehicle waited for.
    pub advice_crc: u32,
}

/// Computes case `number`: cost matrix, assignment and paths of up to ten vehicles between random
/// nodes, some edges blocked at random; then advice among random neighbours along every path.
pub fn plan_case(view: &RoadmapView<'_>, number: u64, ws: &mut PlanCaseWorkspace) -> PlanCase {
    let mut rng = Pcg32::seed_from_u64(number);
    let nodes = view.node_count();
    let swarm = 1 + random_below(&mut rng, MAX_SWARM_VEHICLES);
    let draw = |rng: &mut Pcg32| -> Vec<u16, MAX_SWARM_VEHICLES> {
        (0..swarm).map(|_| random_below(rng, nodes) as u16).collect()
    };
    let (starts, goals) = (draw(&mut rng), draw(&mut rng));
    let required_m = random_between(&mut rng, 0.1, 1.0);
    let blocked = random_below(&mut rng, nodes) as u16;
    let passable = |from: u16, edge: &HalfEdge| {
        view.has_clearance(edge, required_m) && from % 97 != blocked % 97 && edge.target != blocked
    };
    let mut case = [CRC32.digest(), CRC32.digest(), CRC32.digest(), CRC32.digest()];
    let [costs_crc, assignment_crc, paths_crc, scales_crc] = &mut case;
    let mut costs = [0.0; MAX_SWARM_VEHICLES * MAX_SWARM_VEHICLES];
    let costs = &mut costs[..swarm * swarm];
    let found = search::cost_matrix(view, &starts, &goals, passable, &mut ws.search, costs);
    costs_crc.update(&[u8::from(found.is_ok())]);
    costs.iter().for_each(|cost| costs_crc.update(&cost.to_bits().to_le_bytes()));
    let mut assigned = [None; MAX_SWARM_VEHICLES];
    let assigned = &mut assigned[..swarm];
    if let Ok(assignment) = assignment::assign(costs, swarm, swarm, &mut ws.assignment, assigned) {
        assignment_crc.update(&assignment.total_cost.to_bits().to_le_bytes());
    }
    for (&start, goal) in starts.iter().zip(assigned.iter()) {
        assignment_crc.update(&goal.unwrap_or(u16::MAX).to_le_bytes());
        let Some(goal) = goal else { continue };
        let mut way: Vec<u16, WAYPOINTS> = Vec::new();
        let target = goals[usize::from(*goal)];
        let length = search::astar(view, start, target, passable, &mut ws.search, &mut way);
        paths_crc.update(&length.unwrap_or(f32::INFINITY).to_bits().to_le_bytes());
        let mut path: Path<WAYPOINTS> = Path::new();
        for &node in &way {
            paths_crc.update(&node.to_le_bytes());
            // Cannot fail: a path has room for as many waypoints as `way` has nodes.
            let _ = path.push(view.node(node), CLEARANCE_M);
        }
        for waypoint in path.waypoints() {
            let numbers =
                waypoint.position.iter().chain([&waypoint.along_m, &waypoint.leg_clearance_m]);
            numbers.for_each(|number| paths_crc.update(&number.to_bits().to_le_bytes()));
        }
        (0..ADVICE_PER_PATH).for_each(|_| add_advice_along_path(&mut rng, &path, scales_crc));
    }
    let [costs, assignment, paths, scales] = case.map(digest_value);
    PlanCase { costs_crc: costs, assignment_crc: assignment, paths_crc: paths, advice_crc: scales }
}

/// Finalizes a digest of this type; the crate has a digest type for each width, and `map` needs
/// one.
fn digest_value(digest: Digest<'_, u32, Table<1>>) -> u32 {
    digest.finalize()
}

/// Adds the advice at a random place of the path, among random neighbours, to the digest.
fn add_advice_along_path(
    rng: &mut Pcg32,
    path: &Path<WAYPOINTS>,
    scales: &mut Digest<'_, u32, Table<1>>,
) {
    let along_m = random_between(rng, 0.0, path.length_m());
    let Some(position) = path.point_at(along_m) else { return };
    let neighbours: Vec<Neighbour, VEHICLES> =
        (0..VEHICLES).map(|k| random_neighbour(rng, k, &position, 12.0)).collect();
    let own = OwnVehicle { rank: 3, position, along_m, path, on_detour: false };
    for method in [Method::Priority, Method::Algorithm2] {
        let cfg =
            DeconflictConfig { method, safety_distance_m: 1.5, cruise_mps: 2.0, accel_mps2: 1.5 };
        let advice = deconflict::advise(&cfg, &own, &[], &neighbours);
        scales.update(&advice.speed_scale.to_bits().to_le_bytes());
        scales.update(&advice.stop_within_m.to_bits().to_le_bytes());
        scales.update(&[advice.waiting_for_id]);
    }
}

/// A neighbour of id 2 + `k` and rank 1 + `k` within `reach_m` per axis of `around`, no progress
/// sent.
fn random_neighbour(rng: &mut Pcg32, k: usize, around: &Point, reach_m: f32) -> Neighbour {
    Neighbour {
        id: 2 + k as u8,
        rank: 1 + k as u16,
        position: around + random_point(rng, reach_m),
        velocity: random_point(rng, 3.0),
        age_s: random_between(rng, 0.0, 2.0),
        ..Neighbour::default()
    }
}

/// Input of [`deconflict::advise`] at one moment of a flight: own vehicle, its gates, its
/// neighbours.
pub struct StepCase {
    cfg: DeconflictConfig,
    /// Own position, ENU metres.
    position: Point,
    /// Own progress along `path`, metres.
    along_m: f32,
    path: Path<WAYPOINTS>,
    gates: Vec<Gate, GATES>,
    neighbours: Vec<Neighbour, VEHICLES>,
}

/// Kind of a [`StepCase`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepKind {
    /// Neighbours, their progress and the gates are anywhere.
    Spread,
    /// All neighbours are near, all gates are within 3 m ahead, and either all neighbours have
    /// passed all gates or none sends its progress.
    Hard,
}

impl StepKind {
    /// Kind of case `number`: every second one is hard.
    pub fn of_case(number: usize) -> Self {
        if number.is_multiple_of(2) { Self::Hard } else { Self::Spread }
    }
}

impl StepCase {
    /// A random case of this kind beside `neighbours` neighbours, at most [`VEHICLES`].
    pub fn new(rng: &mut Pcg32, neighbours: usize, kind: StepKind) -> Self {
        let hard = kind == StepKind::Hard;
        let cfg = DeconflictConfig {
            method: Method::Priority,
            safety_distance_m: random_between(rng, 0.5, 3.0),
            cruise_mps: random_between(rng, 0.5, 5.0),
            accel_mps2: 1.5,
        };
        let mut path = Path::new();
        let mut at = Point::zeros();
        for _ in 0..2 + random_below(rng, WAYPOINTS - 1) {
            path.push(at, 1.0).expect("there is room");
            at += random_point(rng, 5.0);
        }
        let along_m = random_between(rng, -1.0, path.length_m());
        let position = path.point_at(along_m).expect("a path") + random_point(rng, 0.2);
        let reach_m = if hard { 3.0 } else { path.length_m() };
        let gate = |rng: &mut Pcg32| Gate {
            at_m: along_m + random_between(rng, 0.0, reach_m),
            wait_for_id: 2 + random_below(rng, neighbours.max(1)) as u8,
            open_from_progress_m: random_between(rng, 0.0, 60.0),
        };
        let mut gates: Vec<_, GATES> =
            (0..random_below(rng, GATES + 1)).map(|_| gate(rng)).collect();
        gates.sort_unstable_by(|a, b| a.at_m.total_cmp(&b.at_m));
        let unplanned = if hard { 1.0 } else { random_between(rng, 0.0, 1.0) };
        // Half of the hard cases: every neighbour's progress lies behind all gates. Other half: no
        // neighbour sends its progress.
        let passed = hard && rng.next_u32().is_multiple_of(2);
        let neighbours = (0..neighbours.min(VEHICLES))
            .map(|k| Neighbour {
                progress_m: match passed {
                    true => Some(100.0),
                    false => (random_between(rng, 0.0, 1.0) > unplanned)
                        .then(|| random_between(rng, 0.0, 60.0)),
                },
                grounded: !hard && rng.next_u32().is_multiple_of(8),
                ..random_neighbour(rng, k, &position, if hard { 12.0 } else { 40.0 })
            })
            .collect();
        Self { cfg, position, along_m, path, gates, neighbours }
    }

    /// Calls [`deconflict::advise`] on this case; the call whose instructions are counted.
    pub fn advise(&self, method: Method) -> Advice {
        let Self { position, along_m, path, .. } = self;
        let own =
            OwnVehicle { rank: 0, position: *position, along_m: *along_m, path, on_detour: false };
        deconflict::advise(
            &DeconflictConfig { method, ..self.cfg },
            &own,
            &self.gates,
            &self.neighbours,
        )
    }

    /// Calls [`deconflict::has_late_neighbour`] on this case; the call whose instructions are
    /// counted.
    pub fn has_late_neighbour(&self) -> bool {
        let Self { cfg, path, gates, neighbours, .. } = self;
        deconflict::has_late_neighbour(cfg, cfg.cruise_mps, path, gates, neighbours)
    }
}

/// A random number below `limit`.
pub fn random_below(rng: &mut Pcg32, limit: usize) -> usize {
    rng.next_u32() as usize % limit
}

/// A random number from `low` up to `high`.
pub fn random_between(rng: &mut Pcg32, low: f32, high: f32) -> f32 {
    low + (rng.next_u32() >> 8) as f32 / (1u32 << 24) as f32 * (high - low)
}

/// A random point in the cube about the origin whose sides are 2 · `reach_m` long.
pub fn random_point(rng: &mut Pcg32, reach_m: f32) -> Point {
    Point::from_fn(|_, _| random_between(rng, -reach_m, reach_m))
}

/// Settings of the roadmap that is built on board: 2300 nodes in paper P3D's building.
pub const ROADMAP_CONFIG: PrmConfig = PrmConfig {
    random_nodes: 2300,
    edge_min_m: 0.5,
    edge_max_m: 8.0,
    clearance_m: 0.0,
    seed: 1,
    sampling: Sampling::Uniform,
};

/// The occupancy map that lies in a board's memory, from its header (three dimensions, minimum
/// corner's three coordinates, resolution) and its words.
///
/// # Panics
/// Header and words make no valid map.
pub fn voxel_map<'a>(head: &[u8; 32], words: &'a [u64]) -> VoxelGrid<'a> {
    let word = |i: usize| {
        u32::from_le_bytes([head[4 * i], head[4 * i + 1], head[4 * i + 2], head[4 * i + 3]])
    };
    let shape = GridShape {
        dims: [word(0), word(1), word(2)],
        min: Point::new(f32::from_bits(word(3)), f32::from_bits(word(4)), f32::from_bits(word(5))),
        resolution_m: f32::from_bits(word(6)),
    };
    VoxelGrid::new(shape, Outside::Blocked, words).expect("a map lies there")
}

/// CRC-32 over every bit of a roadmap's node positions, and the node numbers of its edges.
pub fn roadmap_crc(nodes: &[Point], edges: &[Edge]) -> u32 {
    let mut digest = CRC32.digest();
    nodes.iter().flatten().for_each(|c| digest.update(&c.to_bits().to_le_bytes()));
    edges
        .iter()
        .for_each(|e| [e.a, e.b].iter().for_each(|node| digest.update(&node.to_le_bytes())));
    digest.finalize()
}
