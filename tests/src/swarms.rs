//! Random swarms, each with a random roadmap, for tests of schedules.

use host_sim::capacity::on_heap;
use planner_core::Point;
use planner_core::flight::{Flight, VehiclePlan};
use planner_core::geo::frames::Geodetic;
use planner_core::plan::{
    self, GoalMode, Objective, PlanError, PlanRequest, PlanWorkspace, SwarmPlan, VehicleTask,
};
use planner_core::roadmap::{self, Edge, RoadmapHeader, RoadmapView};
use planner_core::schedule::{ScheduleConfig, ScheduleError, ScheduleWorkspace};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Capacities of a board: nodes and vehicles here, gates and timed segments below.
const NODES: usize = 4096;
const VEHICLES: usize = 32;
/// Most waypoints of a path.
pub const WAYPOINTS: usize = 64;
const GATES: usize = 128;
const TIMED_SEGMENTS: usize = 2048;
/// Distance that the schedule keeps between centres beyond the safety distance, metres.
const SEPARATION_MARGIN_M: f32 = 0.5;

/// The plan of a whole swarm, with a board's capacities.
pub type Plan = SwarmPlan<VEHICLES, WAYPOINTS>;
/// One vehicle's part of the plan, with its gates.
pub type OwnPlan = VehiclePlan<WAYPOINTS, GATES>;

/// A seeded generator of random numbers.
#[derive(Debug)]
pub struct Random(Pcg32);

impl Random {
    /// A generator that starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(Pcg32::seed_from_u64(seed))
    }

    /// A uniformly distributed random number from `low` to `high`.
    pub fn uniform(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.0.next_u32() as f32 / u32::MAX as f32)
    }

    /// A random whole number from 0 to below a bound.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.0.next_u32() as usize) % bound
    }

    /// Whether a random event of probability 1 / `count` occurs.
    pub fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }
}

/// Free space as the union of overlapping boxes.
#[derive(Debug)]
struct Space {
    /// Least and greatest corner of each box, metres.
    boxes: Vec<(Point, Point)>,
    /// Longest edge of a roadmap in this space, metres.
    edge_max_m: f32,
}

impl Space {
    /// Random free space: a room, a corridor with up to two side rooms, a shaft with rooms beside
    /// it, or a long hall.
    fn random(rng: &mut Random) -> Self {
        let height = rng.uniform(1.0, 3.0);
        let boxes = match rng.below(13) {
            // A room; every other one is high.
            0..4 => {
                let height = if rng.one_in(2) { rng.uniform(3.0, 32.0) } else { height };
                let size = Point::new(rng.uniform(8.0, 35.0), rng.uniform(8.0, 35.0), height);
                vec![(Point::zeros(), size)]
            }
            // A corridor, with up to two side rooms.
            4..8 => {
                let (length, width) = (rng.uniform(15.0, 45.0), rng.uniform(0.5, 3.5));
                let mut boxes = vec![(Point::zeros(), Point::new(length, width, height))];
                for _ in 0..rng.below(3) {
                    let (at, wide) = (rng.uniform(2.0, length - 6.0), rng.uniform(1.5, 4.0));
                    boxes.push((
                        Point::new(at, 0.0, 0.0),
                        Point::new(at + wide, width + 5.0, height),
                    ));
                }
                boxes
            }
            // A shaft, with rooms beside it at the bottom and at the top.
            8..12 => {
                let size = Point::new(
                    rng.uniform(1.0, 5.0),
                    rng.uniform(1.0, 5.0),
                    rng.uniform(8.0, 35.0),
                );
                let (low, high) = (Point::new(-10.0, -4.0, 0.0), Point::new(10.0, 8.0, 2.0));
                let lift = Point::new(0.0, 0.0, size.z - 2.0);
                vec![(Point::zeros(), size), (low, high), (low + lift, high + lift)]
            }
            // A hall so long that timed segments have to be longer than usual.
            _ => {
                let size =
                    Point::new(rng.uniform(200.0, 1500.0), rng.uniform(2.0, 60.0), 3.0 * height);
                return Self { boxes: vec![(Point::zeros(), size)], edge_max_m: 80.0 };
            }
        };
        Self { boxes, edge_max_m: 8.0 }
    }

    /// Small random free space: a room, or a corridor with a side room.
    fn small(rng: &mut Random) -> Self {
        let height = rng.uniform(0.2, 2.0);
        let boxes = if rng.one_in(2) {
            vec![(Point::zeros(), Point::new(rng.uniform(4.0, 9.0), rng.uniform(4.0, 9.0), height))]
        } else {
            let (length, width) = (rng.uniform(6.0, 11.0), rng.uniform(0.3, 2.5));
            let at = rng.uniform(0.0, length - 3.0);
            let room = (Point::new(at, 0.0, 0.0), Point::new(at + 3.0, width + 4.0, height));
            vec![(Point::zeros(), Point::new(length, width, height)), room]
        };
        Self { boxes, edge_max_m: 8.0 }
    }

    /// A random place in one of the boxes.
    fn point(&self, rng: &mut Random) -> Point {
        let (low, high) = self.boxes[rng.below(self.boxes.len())];
        Point::new(
            rng.uniform(low.x, high.x),
            rng.uniform(low.y, high.y),
            rng.uniform(low.z, high.z),
        )
    }

    /// Whether a place is in one of the boxes.
    fn contains(&self, p: &Point) -> bool {
        let inside =
            |(low, high): &(Point, Point)| (0..3).all(|a| low[a] <= p[a] && p[a] <= high[a]);
        self.boxes.iter().any(inside)
    }

    /// Whether the straight line between two points stays in the space, tested each half metre.
    fn sees_straight(&self, a: &Point, b: &Point) -> bool {
        let steps = ((b - a).norm() / 0.5).ceil() as usize;
        (1..steps).all(|i| self.contains(&(a + (b - a) * (i as f32 / steps as f32))))
    }
}

/// A swarm, and the roadmap that it is planned on.
#[derive(Debug)]
pub struct Swarm {
    /// The roadmap file.
    roadmap: Vec<u8>,
    /// Tasks of its vehicles.
    pub tasks: Vec<VehicleTask>,
    /// Height of each goal above the ground below it, metres.
    descents_m: Vec<f32>,
    mode: GoalMode,
    /// Separation and speeds of the schedule.
    pub schedule: ScheduleConfig,
    /// Safety distance between centres, metres.
    pub safety_distance_m: f32,
}

/// Parameters of a random swarm.
struct SwarmParameters {
    space: Space,
    vehicles: usize,
    goals: usize,
    /// Greatest height of a climb or descent, metres.
    max_climb_m: f32,
    /// Safety distance, metres.
    safety_m: f32,
}

impl Swarm {
    /// Any swarm: in rooms, corridors with side rooms, shafts or long halls; now and then with more
    /// vehicles than goals, or fewer.
    pub fn random(rng: &mut Random) -> Self {
        let space = Space::random(rng);
        let vehicles = if rng.one_in(20) { 9 + rng.below(24) } else { 2 + rng.below(7) };
        let goals =
            if rng.one_in(8) { 1 + rng.below(vehicles + 2).min(VEHICLES - 1) } else { vehicles };
        let highest_m = [1.5, 8.0, 30.0][rng.below(3)];
        let safety_m = if rng.one_in(2) { 1.5 } else { rng.uniform(0.8, 3.0) };
        Self::draw(
            &SwarmParameters { space, vehicles, goals, max_climb_m: highest_m, safety_m },
            rng,
        )
    }

    /// A small swarm in a small space, where vehicles often meet.
    pub fn small(count: usize, rng: &mut Random) -> Self {
        let space = Space::small(rng);
        let highest_m = [1.5, 3.0][rng.below(2)];
        Self::draw(
            &SwarmParameters {
                space,
                vehicles: count,
                goals: count,
                max_climb_m: highest_m,
                safety_m: 1.5,
            },
            rng,
        )
    }

    fn draw(draw: &SwarmParameters, rng: &mut Random) -> Self {
        let safety_m = draw.safety_m;
        let parked_separation_m = safety_m + [0.25, 0.25, 0.4, 0.8][rng.below(4)];
        // Distance between vehicles that stand: mostly so large that a plan can be expected.
        let apart_m = safety_m + [-0.6, 0.3, 0.55, 0.85, 1.1, 1.5][rng.below(6)];
        let one_floor = rng.one_in(2);
        let mut places = |wanted: usize| {
            let (mut places, mut heights): (Vec<Point>, Vec<f32>) = Default::default();
            for _ in 0..40 * wanted {
                let place = draw.space.point(rng);
                let height = rng.uniform(0.5, draw.max_climb_m);
                let height = if one_floor { place.z + 0.5 } else { height };
                let ground = place - Point::new(0.0, 0.0, height);
                let apart = |(p, h): (&Point, &f32)| {
                    (p - Point::new(0.0, 0.0, *h) - ground).norm() >= apart_m
                };
                if height <= 30.0 && places.iter().zip(&heights).all(apart) {
                    places.push(place);
                    heights.push(height);
                }
                if places.len() == wanted {
                    break;
                }
            }
            (places, heights)
        };
        let (mut nodes, climbs_m) = places(draw.vehicles);
        let (goals, descents_m) = places(draw.goals);
        let (starts, goal_count) = (nodes.len(), goals.len());
        nodes.extend(goals);
        nodes.extend((0..40 + rng.below(80)).map(|_| draw.space.point(rng)));
        let one_size = rng.one_in(2);
        let mut edges = Vec::new();
        for a in 0..nodes.len() {
            for b in a + 1..nodes.len() {
                let length = (nodes[a] - nodes[b]).norm();
                if (0.1..draw.space.edge_max_m).contains(&length)
                    && draw.space.sees_straight(&nodes[a], &nodes[b])
                {
                    let clearance_m = if one_size { 1.0 } else { rng.uniform(0.6, 2.0) };
                    edges.push(Edge { a: a as u16, b: b as u16, clearance_m });
                }
            }
        }
        let header = RoadmapHeader {
            origin: Geodetic::default(),
            edge_min_m: 0.1,
            edge_max_m: draw.space.edge_max_m,
            tested_clearance_m: 0.0,
            max_clearance_m: 4.0,
            start_count: starts as u16,
            goal_count: goal_count as u16,
        };
        let mut bytes = vec![0; roadmap::encoded_len(nodes.len(), edges.len(), 0).unwrap()];
        roadmap::write(&header, &nodes, &edges, &mut bytes).unwrap();
        let labelled = rng.one_in(2);
        let last_id = 1 + rng.below(200) as u8;
        let task = |(i, &climb_m): (usize, &f32)| VehicleTask {
            // Ids rise or fall with the index, by chance.
            id: if last_id.is_multiple_of(2) { last_id + i as u8 } else { last_id + 32 - i as u8 },
            required_clearance_m: if one_size { 0.8 } else { [0.5, 0.8, 1.0][i % 3] },
            climb_m,
            goal: (labelled && i < goal_count).then_some(i as u16),
        };
        let tasks = climbs_m.iter().enumerate().map(task).collect();
        let objective = if rng.one_in(3) { Objective::Makespan } else { Objective::TotalDistance };
        let mode = if labelled { GoalMode::Labelled } else { GoalMode::Unlabelled(objective) };
        let schedule = ScheduleConfig {
            separation_m: safety_m + SEPARATION_MARGIN_M,
            parked_separation_m,
            cruise_mps: rng.uniform(0.5, 5.0),
            vertical_mps: rng.uniform(0.5, 2.0),
        };
        Self { roadmap: bytes, tasks, descents_m, mode, schedule, safety_distance_m: safety_m }
    }

    /// Plans the swarm.
    ///
    /// # Errors
    /// The error of the planner.
    pub fn plan(&self) -> Result<Box<Plan>, PlanError> {
        let view = RoadmapView::parse(&self.roadmap).expect("written here");
        let request = PlanRequest {
            vehicles: &self.tasks,
            goal_descents_m: &self.descents_m,
            mode: self.mode,
            schedule: self.schedule,
            max_gates: GATES,
        };
        let mut ws = on_heap(PlanWorkspace::<NODES, VEHICLES, TIMED_SEGMENTS>::new);
        let mut out = Box::new(Plan::new());
        plan::plan_swarm(&view, &request, &mut ws, &mut out).map(|()| out)
    }

    /// Each vehicle's part of `plan`, with its gates.
    ///
    /// # Errors
    /// A part does not fit into a vehicle's memory.
    pub fn vehicle_plans(&self, plan: &Plan) -> Result<Vec<OwnPlan>, ScheduleError> {
        let mut ws = ScheduleWorkspace::default();
        let own = |index: usize| {
            let mut own = OwnPlan::default();
            plan::vehicle_plan(plan, index, &self.schedule, &mut ws, &mut own).map(|()| own)
        };
        (0..plan.flights.len()).map(own).collect()
    }
}

/// Position of a vehicle at an arc length; before 0 and beyond the path's end below its ends.
pub fn position_at(flight: &Flight<WAYPOINTS>, along_m: f32) -> Point {
    let below_m = (-along_m).max(along_m - flight.path.length_m()).max(0.0);
    flight.path.point_at(along_m).unwrap() - Point::new(0.0, 0.0, below_m)
}

/// Arc length at which a vehicle's flight ends, metres: its landing, or its pad if it stays there.
pub fn end_arc_length_m(flight: &Flight<WAYPOINTS>) -> f32 {
    if flight.task.leaves_pad() {
        flight.path.length_m() + flight.descent_m
    } else {
        -flight.climb_m
    }
}
