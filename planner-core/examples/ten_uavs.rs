//! Plans ten UAVs past a wall: map, roadmap, goals, paths, schedule, gates.
//! `cargo run -p planner-core --example ten_uavs`

use planner_core::map::voxel::{GridShape, Outside, VoxelGrid};
use planner_core::plan::{self, GoalMode, Objective, PlanRequest, SwarmPlan, VehicleTask};
use planner_core::roadmap::{self, Edge, RoadmapHeader, RoadmapView};
use planner_core::{Point, flight, geo::frames::Geodetic, roadmap::prm, schedule::ScheduleConfig};

fn main() {
    // A hall of 40 m × 24 m × 6 m in cells of 0.5 m. A wall at x = 20 m leaves a gap at each end.
    let shape = GridShape { dims: [80, 48, 12], min: Point::zeros(), resolution_m: 0.5 };
    let mut words = vec![0; shape.word_count()];
    for (y, z) in (6..42).flat_map(|y| (0..12).map(move |z| (y, z))) {
        let (word, bit) = shape.word_and_mask([40, y, z]);
        words[word] |= bit;
    }
    let grid = VoxelGrid::new(shape, Outside::Blocked, &words).expect("as many words as needed");

    // Starts, then goals: the first nodes of the roadmap.
    let row = |x| (0..10u8).map(move |i| Point::new(x, 2.0 + 2.2 * f32::from(i), 2.0));
    let terminals: Vec<Point> = row(4.0).chain(row(36.0)).collect();
    let (nodes, seed, sampling) = (400, 1, prm::Sampling::Uniform);
    let (edge_min_m, edge_max_m, clearance_m, max_clearance_m) = (0.5, 8.0, 0.8, 4.0);
    let build =
        prm::PrmConfig { random_nodes: nodes, edge_min_m, edge_max_m, clearance_m, seed, sampling };
    let mut points = vec![Point::zeros(); terminals.len() + nodes];
    prm::sample_nodes(&grid, None, &terminals, &build, &mut points).expect("the hall is free");
    let (mut edges, clear) = (Vec::new(), prm::edge_clearance);
    let connected = prm::connect_all_pairs(&grid, &points, &build, |prm::PrmEdge { a, b }| {
        let measured = clear(&grid, &points, prm::PrmEdge { a, b }, max_clearance_m);
        edges.push(Edge { a, b, clearance_m: measured.expect("two nodes") });
    });
    connected.expect("the settings are sound");

    // The file that a board reads in place.
    let origin = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
    let (start_count, goal_count, tested_clearance_m) = (10, 10, clearance_m);
    #[rustfmt::skip]
    let header = RoadmapHeader {
        origin, edge_min_m, edge_max_m, tested_clearance_m, max_clearance_m,
        start_count, goal_count,
    };
    let mut file = vec![0; roadmap::encoded_len(points.len(), edges.len(), 0).expect("small")];
    roadmap::write(&header, &points, &edges, &mut file).expect("it fits");
    let view = RoadmapView::parse(&file).expect("it was just written");

    let task = |id| VehicleTask { id, required_clearance_m: clearance_m, climb_m: 2.0, goal: None };
    let (vehicles, descents_m): (Vec<_>, _) = ((1..=10).map(task).collect(), &[2.0; 10]);
    let (mode, max_gates) = (GoalMode::Unlabelled(Objective::TotalDistance), 64);
    let (separation_m, parked_separation_m, cruise_mps, vertical_mps) = (2.0, 1.6, 2.0, 1.0);
    let schedule = ScheduleConfig { separation_m, parked_separation_m, cruise_mps, vertical_mps };
    let request =
        PlanRequest { vehicles: &vehicles, goal_descents_m: descents_m, mode, schedule, max_gates };
    let mut memory = Box::new(plan::PlanWorkspace::<512, 10, 2048>::new());
    let (mut swarm, mut own) = (SwarmPlan::<10, 64>::new(), flight::VehiclePlan::<64, 64>::new());
    plan::plan_swarm(&view, &request, &mut memory, &mut swarm).expect("all goals are reached");
    for i in 0..swarm.flights.len() {
        let made = plan::vehicle_plan(&swarm, i, &schedule, &mut memory.schedule, &mut own);
        made.expect("the gates fit");
        println!("{}: {:?}, {:.1} m", i + 1, own.task.goal(), own.path.length_m());
    }
}
