extern crate std;

use std::boxed::Box;
use std::collections::BTreeSet;
use std::vec::Vec as StdVec;

use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::Point;
use crate::geo::frames::Geodetic;
use crate::roadmap::{self, Edge, RoadmapHeader};
use crate::schedule::tests::checker;

const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.7,
    cruise_mps: 2.0,
    vertical_mps: 1.0,
};
/// Height of all starts and goals above the ground below them, metres.
const HEIGHT_M: f32 = 1.5;

/// A roadmap over open ground: terminals first, then random nodes, edges up to 8 m.
fn open_roadmap(terminals: &[Point], starts: usize, nodes: usize, seed: u64) -> StdVec<u8> {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut uniform = |scale: f32| rng.next_u32() as f32 / u32::MAX as f32 * scale;
    let mut points = terminals.to_vec();
    while points.len() < terminals.len() + nodes {
        points.push(Point::new(uniform(40.0), uniform(40.0), HEIGHT_M + uniform(10.0)));
    }
    let mut edges = StdVec::new();
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            if (0.5..8.0).contains(&(points[a] - points[b]).norm()) {
                edges.push(Edge { a: a as u16, b: b as u16, clearance_m: 1.0 });
            }
        }
    }
    let header = RoadmapHeader {
        origin: Geodetic::default(),
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        tested_clearance_m: 0.0,
        max_clearance_m: 4.0,
        start_count: starts as u16,
        goal_count: (terminals.len() - starts) as u16,
    };
    let mut bytes = std::vec![0; roadmap::encoded_len(points.len(), edges.len(), 0).unwrap()];
    roadmap::write(&header, &points, &edges, &mut bytes).unwrap();
    bytes
}

fn tasks(count: usize) -> StdVec<VehicleTask> {
    (0..count)
        .map(|i| VehicleTask {
            id: i as u8 + 1,
            required_clearance_m: 0.8,
            climb_m: HEIGHT_M,
            goal: None,
        })
        .collect()
}

/// Tasks of vehicles that each have a goal of their own.
fn labelled_tasks(count: usize) -> StdVec<VehicleTask> {
    let mut tasks = tasks(count);
    tasks.iter_mut().zip(0..).for_each(|(task, goal)| task.goal = Some(goal));
    tasks
}

fn plan(
    bytes: &[u8],
    vehicles: &[VehicleTask],
    goals: usize,
    mode: GoalMode,
) -> Result<SwarmPlan<16, 64>, PlanError> {
    let view = RoadmapView::parse(bytes).unwrap();
    let mut ws = Box::new(PlanWorkspace::<1024, 16, 2048>::new());
    let mut out = SwarmPlan::new();
    let descents = std::vec![HEIGHT_M; goals];
    let request = PlanRequest {
        vehicles,
        goal_descents_m: &descents,
        mode,
        schedule: SCHEDULE,
        max_gates: 1024,
    };
    plan_swarm(&view, &request, &mut ws, &mut out).map(|()| out)
}

/// `count` points at least 4 m apart.
fn spread(count: usize, seed: u64) -> StdVec<Point> {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut uniform = |scale: f32| rng.next_u32() as f32 / u32::MAX as f32 * scale;
    let mut points: StdVec<Point> = StdVec::new();
    while points.len() < count {
        let p = Point::new(uniform(40.0), uniform(40.0), HEIGHT_M);
        if points.iter().all(|q| (p - q).norm() > 4.0) {
            points.push(p);
        }
    }
    points
}

/// Nodes that can be reached from node 0.
fn connected(view: &RoadmapView<'_>) -> BTreeSet<u16> {
    let (mut reached, mut open) = (BTreeSet::from([0]), std::vec![0]);
    while let Some(node) = open.pop() {
        open.extend(
            view.half_edges(node).map(|edge| edge.target).filter(|target| reached.insert(*target)),
        );
    }
    reached
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    /// Ten vehicles over open ground, at any speeds: all arrive, and no two come near each other.
    #[test]
    fn swarms_arrive_apart_at_any_speeds(
        seed in any::<u64>(),
        labelled in any::<bool>(),
        speeds in proptest::collection::vec(0.3f32..3.0, 10),
    ) {
        let terminals = spread(20, seed);
        let bytes = open_roadmap(&terminals, 10, 300, seed);
        let view = RoadmapView::parse(&bytes).unwrap();
        // A terminal in a corner may have no node within reach, or none that leads to the others.
        let connected = connected(&view);
        prop_assume!((0..20).all(|terminal| connected.contains(&terminal)));
        let (tasks, mode) =
            if labelled {
                (labelled_tasks(10), GoalMode::Labelled)
            } else {
                (tasks(10), GoalMode::Unlabelled(Objective::TotalDistance))
            };
        let plan = plan(&bytes, &tasks, 10, mode).unwrap();
        prop_assert!(plan.flights.iter().all(|f| f.task.leaves_pad()));
        let apart = checker::fly(&SCHEDULE, &plan.flights, &speeds, 40_000);
        prop_assert!(
            apart.as_ref().is_ok_and(|&d| d >= SCHEDULE.parked_separation_m - 1e-3),
            "{apart:?}"
        );
    }
}

/// A corridor along x with one side room off its middle; nodes by hand, every vehicle at one
/// height.
fn corridor(length_m: f32, side_at_m: f32, depth_m: f32) -> StdVec<u8> {
    let p = |x: f32, y: f32| Point::new(x, y, HEIGHT_M);
    // Two starts, two goals over each other's pads, the corridor, the side room.
    let mut nodes = std::vec![p(0.0, 0.0), p(length_m, 0.0), p(length_m, 0.0), p(0.0, 0.0)];
    let steps = (length_m / 2.0) as usize;
    nodes.extend((1..steps).map(|i| p(i as f32 * 2.0, 0.0)));
    nodes.push(p(side_at_m, depth_m));
    let mut edges = StdVec::new();
    for a in 0..nodes.len() {
        for b in a + 1..nodes.len() {
            let d = nodes[b] - nodes[a];
            let along = d.y == 0.0 && (0.1..2.5).contains(&d.x.abs());
            let aside = d.x == 0.0 && d.y.abs() > 1.0;
            if along || aside {
                edges.push(Edge { a: a as u16, b: b as u16, clearance_m: 1.0 });
            }
        }
    }
    let header = RoadmapHeader {
        origin: Geodetic::default(),
        edge_min_m: 0.1,
        edge_max_m: 8.0,
        tested_clearance_m: 0.0,
        max_clearance_m: 4.0,
        start_count: 2,
        goal_count: 2,
    };
    let mut bytes = std::vec![0; roadmap::encoded_len(nodes.len(), edges.len(), 0).unwrap()];
    roadmap::write(&header, &nodes, &edges, &mut bytes).unwrap();
    bytes
}

#[test]
fn head_on_in_a_corridor_one_steps_into_the_side_room() {
    // Just deep enough to keep clear of the corridor, and deeper.
    let depths = [2.1, 2.2, 2.4, 2.6, 2.8, 3.0, 3.2, 4.0];
    for (side_at_m, depth_m) in
        [8.0, 14.0, 16.0, 22.0].into_iter().flat_map(|at| depths.map(|depth| (at, depth)))
    {
        let bytes = corridor(30.0, side_at_m, depth_m);
        let plan = plan(&bytes, &labelled_tasks(2), 2, GoalMode::Labelled).unwrap();
        let aside = |f: &Flight<64>| f.path.waypoints().iter().any(|w| w.position.y > 2.0);
        assert!(plan.flights.iter().any(aside), "side room at {side_at_m}, {depth_m} deep");
        let waits =
            plan.flights.iter().flat_map(|f| f.path.waypoints()).map(|w| w.leave_s - w.arrive_s);
        // The vehicle that steps aside waits in the side room only while the other passes.
        assert!(waits.fold(0.0, f32::max) < 2.1, "side room at {side_at_m}, {depth_m} deep");
        for speeds in [[1.0, 1.0], [0.3, 2.0], [2.0, 0.3]] {
            let apart = checker::fly(&SCHEDULE, &plan.flights, &speeds, 20_000);
            let kept = apart.as_ref().is_ok_and(|&d| d >= SCHEDULE.parked_separation_m - 1e-3);
            assert!(kept, "side room at {side_at_m}, {depth_m} deep: {apart:?}");
        }
    }
}

#[test]
fn antipodal_swaps_over_a_circle_are_planned() {
    // Five pairs of vehicles swap ends across a circle of 20 m radius.
    let place = |i: usize| {
        let angle = i as f32 * core::f32::consts::TAU / 10.0;
        Point::new(20.0 + 20.0 * libm::cosf(angle), 20.0 + 20.0 * libm::sinf(angle), HEIGHT_M)
    };
    let terminals: StdVec<Point> =
        (0..10).map(place).chain((0..10).map(|i| place(i + 5))).collect();
    for seed in 0..4 {
        let bytes = open_roadmap(&terminals, 10, 400, seed);
        let plan = plan(&bytes, &labelled_tasks(10), 10, GoalMode::Labelled).unwrap();
        let apart = checker::fly(&SCHEDULE, &plan.flights, &[1.5; 10], 40_000);
        assert!(
            apart.as_ref().is_ok_and(|&d| d >= SCHEDULE.parked_separation_m - 1e-3),
            "{seed}: {apart:?}"
        );
    }
}

#[test]
fn unlabelled_is_no_longer_than_labelled_and_makespan_no_later() {
    for seed in 0..10 {
        let bytes = open_roadmap(&spread(16, seed), 8, 300, seed);
        let longest =
            |p: &SwarmPlan<16, 64>| p.flights.iter().map(|f| f.path.length_m()).fold(0.0, f32::max);
        let labelled = plan(&bytes, &labelled_tasks(8), 8, GoalMode::Labelled).unwrap();
        let total =
            plan(&bytes, &tasks(8), 8, GoalMode::Unlabelled(Objective::TotalDistance)).unwrap();
        let makespan =
            plan(&bytes, &tasks(8), 8, GoalMode::Unlabelled(Objective::Makespan)).unwrap();
        // Detours around pads and landing places may lengthen a path a little.
        assert!(total.total_path_m() <= labelled.total_path_m() * 1.05, "seed {seed}");
        assert!(longest(&makespan) <= longest(&total) * 1.05, "seed {seed}");
    }
}

#[test]
fn a_vehicle_without_a_goal_stays_and_a_goal_without_a_way_is_left() {
    let mut terminals = spread(5, 3);
    terminals.push(Point::new(500.0, 500.0, HEIGHT_M)); // out of reach
    let bytes = open_roadmap(&terminals, 4, 300, 3);
    let plan = plan(&bytes, &tasks(4), 2, GoalMode::Unlabelled(Objective::TotalDistance)).unwrap();
    let flying: StdVec<_> = plan.flights.iter().filter_map(|f| f.task.goal()).collect();
    assert_eq!(flying, [0], "one goal in reach, one vehicle flies to it");
    checker::fly(&SCHEDULE, &plan.flights, &[1.0; 4], 10_000).unwrap();
}

#[test]
fn the_same_request_gives_the_same_plan_and_another_gives_another_crc() {
    let terminals = spread(8, 5);
    let bytes = open_roadmap(&terminals, 4, 200, 5);
    let mode = GoalMode::Unlabelled(Objective::TotalDistance);
    let first = plan(&bytes, &tasks(4), 4, mode).unwrap();
    assert_eq!(first, plan(&bytes, &tasks(4), 4, mode).unwrap());
    let other = plan(&open_roadmap(&terminals, 4, 200, 6), &tasks(4), 4, mode).unwrap();
    assert_ne!(first.crc, other.crc);
}

#[test]
fn wrong_requests_are_refused_by_name() {
    let bytes = open_roadmap(&spread(4, 7), 2, 50, 7);
    let unlabelled = GoalMode::Unlabelled(Objective::TotalDistance);
    assert_eq!(plan(&bytes, &tasks(3), 2, unlabelled).unwrap_err(), PlanError::CountMismatch);
    let mut twice = tasks(2);
    twice[1].id = 1;
    assert_eq!(plan(&bytes, &twice, 2, unlabelled).unwrap_err(), PlanError::SameId(1));
    let mut labelled = labelled_tasks(2);
    labelled[1].goal = Some(9);
    assert_eq!(plan(&bytes, &labelled, 2, GoalMode::Labelled).unwrap_err(), PlanError::BadGoal(2));
}

/// A corridor along x that vehicles cross one behind the other, starts on its left and goals on its
/// right.
fn queue(
    length_m: f32,
    vehicles: usize,
    edge_m: f32,
    seed: u64,
) -> (StdVec<u8>, StdVec<VehicleTask>) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut uniform =
        |low: f32, high: f32| low + (high - low) * (rng.next_u32() as f32 / u32::MAX as f32);
    let mut nodes = StdVec::new();
    for side in [0.0, length_m] {
        for i in 0..vehicles {
            let away = 3.0 * (1 + i / 2) as f32 * if side == 0.0 { -1.0 } else { 1.0 };
            nodes.push(Point::new(side + away, 5.0 * (i % 2) as f32 - 2.5, HEIGHT_M));
        }
    }
    // Two steps of the corridor are an edge.
    let step_m = 0.49 * edge_m;
    let steps = (length_m / step_m) as usize;
    nodes.extend((0..=steps).map(|i| Point::new(i as f32 * step_m, uniform(-0.4, 0.4), HEIGHT_M)));
    let mut edges = StdVec::new();
    for a in 0..nodes.len() {
        for b in a + 1..nodes.len() {
            if (0.1..edge_m).contains(&(nodes[a] - nodes[b]).norm()) {
                edges.push(Edge { a: a as u16, b: b as u16, clearance_m: 1.0 });
            }
        }
    }
    let header = RoadmapHeader {
        origin: Geodetic::default(),
        edge_min_m: 0.1,
        edge_max_m: edge_m,
        tested_clearance_m: 0.0,
        max_clearance_m: 4.0,
        start_count: vehicles as u16,
        goal_count: vehicles as u16,
    };
    let mut bytes = std::vec![0; roadmap::encoded_len(nodes.len(), edges.len(), 0).unwrap()];
    roadmap::write(&header, &nodes, &edges, &mut bytes).unwrap();
    (bytes, labelled_tasks(vehicles))
}

/// Whether every vehicle's plan fits `G` gates, and the result of planning with that limit.
fn fits<const G: usize>(bytes: &[u8], vehicles: &[VehicleTask]) -> (bool, Result<(), PlanError>) {
    let view = RoadmapView::parse(bytes).unwrap();
    let mut ws = Box::new(PlanWorkspace::<1024, 16, 4096>::new());
    let mut out = SwarmPlan::<16, 64>::new();
    let descents = std::vec![HEIGHT_M; vehicles.len()];
    let mode = GoalMode::Labelled;
    let request = PlanRequest {
        vehicles,
        goal_descents_m: &descents,
        mode,
        schedule: SCHEDULE,
        max_gates: G,
    };
    let planned = plan_swarm(&view, &request, &mut ws, &mut out);
    let mut own = VehiclePlan::<64, G>::default();
    let all = (0..vehicles.len())
        .all(|i| vehicle_plan(&out, i, &SCHEDULE, &mut ws.schedule, &mut own).is_ok());
    (all, planned)
}

#[test]
fn eight_through_a_corridor_fit_the_gates_of_a_board_or_are_refused() {
    let mut flyable = 0;
    for seed in 0..12 {
        let (bytes, vehicles) = queue(26.0, 8, 8.0, seed);
        let (all, planned) = fits::<128>(&bytes, &vehicles);
        assert_eq!(all, planned.is_ok(), "seed {seed}: {planned:?}");
        flyable += usize::from(all);
        let (all, planned) = fits::<12>(&bytes, &vehicles);
        assert_eq!(all, planned.is_ok(), "seed {seed}, few gates: {planned:?}");
    }
    assert!(flyable >= 9, "{flyable} of 12");
}

#[test]
fn flights_of_four_kilometres_are_scheduled_and_flown() {
    let (bytes, vehicles) = queue(4000.0, 3, 99.0, 1);
    let plan = plan(&bytes, &vehicles, 3, GoalMode::Labelled).unwrap();
    for flight in &plan.flights {
        assert!(
            flight.path.length_m() > 4000.0
                && flight.max_segment_m > schedule::DEFAULT_MAX_SEGMENT_M
        );
    }
    for speeds in [[10.0, 10.0, 10.0], [4.0, 10.0, 7.0]] {
        let apart = checker::fly(&SCHEDULE, &plan.flights, &speeds, 100_000);
        assert!(
            apart.as_ref().is_ok_and(|&d| d >= SCHEDULE.parked_separation_m - 0.3),
            "{apart:?}"
        );
    }
}
