//! Counts the instructions of planner-core's public calls.

use board_bench::calls::{Meter, flight};
use board_bench::cases::{self, StepCase, StepKind, random_below, random_between, random_point};
use companion::planner::LendWorkspace as _;
use firmware::boards::chosen::memory;
use firmware::capacity::{
    GATES, ROADMAP_CUBES, ROADMAP_NODES, TIMED_SEGMENTS, VEHICLES, WAYPOINTS,
};
use firmware::workspace::{PlannerWorkspace, WorkspaceOverlay};
use heapless::Vec;
use planner_core::Point;
use planner_core::assignment::{self, AssignmentWorkspace};
use planner_core::detour::{self, DetourGoal, DetourRequest, KeepOutZone, ZoneKind};
use planner_core::flight::{Flight, Path, Task, VehiclePlan};
use planner_core::geo::frames::{self, Geodetic, Projection};
use planner_core::map::segment;
use planner_core::map::voxel::{Outside, VoxelGrid};
use planner_core::plan::{self, AssignedGoals, SwarmPlan};
use planner_core::roadmap::prm::{self, PrmConfig};
use planner_core::roadmap::search::{self, RoadmapWithLengths, SearchWorkspace};
use planner_core::roadmap::{self, HalfEdge, RoadmapHeader, RoadmapView};
use planner_core::schedule::sipp::{self, RouteQuery, SippWorkspace};
use planner_core::schedule::{self, ScheduleWorkspace};
use planner_core::track::deconflict::{Advice, Method};
use planner_core::track::{self, ReferenceState, TrackConfig};
use rand_core::SeedableRng;
use rand_pcg::Pcg32;
use static_cell::ConstStaticCell;

use super::coverage_calls;

type Plan = SwarmPlan<VEHICLES, WAYPOINTS>;
type Search = SearchWorkspace<ROADMAP_NODES>;

/// Number of random inputs of a call that takes microseconds.
const MANY_CASES: usize = 1000;
/// Number of random inputs of a call that takes milliseconds.
const SOME_CASES: usize = 50;
/// Longest edge of the roadmap, metres.
const MAX_EDGE_M: f32 = 8.0;
/// Nodes of a small roadmap, for calls that only the host makes in normal use.
const SMALL_ROADMAP_NODES: usize = 300;

/// Memory of the bench beside the workspace overlay.
struct BenchMemory {
    plan: Plan,
    small_grid: prm::NodeGrid<SMALL_ROADMAP_NODES, 1024>,
    nodes: [Point; SMALL_ROADMAP_NODES],
    edges: [prm::PrmEdge; 1024],
    kept: Vec<roadmap::Edge, 1024>,
    file: [u8; 12 << 10],
    lengths: [f32; 2048],
}

static WORKSPACE: ConstStaticCell<WorkspaceOverlay> = ConstStaticCell::new(WorkspaceOverlay::new());
static BENCH_MEMORY: ConstStaticCell<BenchMemory> = ConstStaticCell::new(BenchMemory {
    plan: Plan::new(),
    small_grid: prm::NodeGrid::new(),
    nodes: [Point::new(0.0, 0.0, 0.0); SMALL_ROADMAP_NODES],
    edges: [prm::PrmEdge { a: 0, b: 0 }; 1024],
    kept: Vec::new(),
    file: [0; 12 << 10],
    lengths: [0.0; 2048],
});

/// Counts the instructions of all public calls of planner-core. Returns two checksums of coverage
/// results: of its single calls, and of its flights.
#[inline(never)]
pub fn measure_planner_calls(meter: &mut impl Meter) -> [u32; 2] {
    let workspace = WORKSPACE.take();
    let beside = BENCH_MEMORY.take();
    let view = meter
        .call("roadmap::RoadmapView::parse", size_of::<RoadmapView<'_>>(), || {
            RoadmapView::parse(memory::bank2())
        })
        .expect("a roadmap lies in bank 2");
    measure_frames_and_grids(meter);
    measure_searches(meter, &view, workspace.for_goals());
    measure_assignments(meter, &mut workspace.for_goals().assignment);
    measure_plans(meter, &view, workspace.for_goals(), &mut beside.plan);
    measure_largest_swarm(meter, &view, workspace.for_goals(), &mut beside.plan);
    measure_detours(meter, &view, &mut workspace.for_goals().search);
    measure_paths(meter);
    let (head, words) = memory::measurement_map();
    let grid = cases::voxel_map(&head, words);
    let shape = *grid.shape();
    // Cannot fail: `voxel_map` has checked the same shape and words.
    let _ = meter.call("voxel::VoxelGrid::new", size_of::<VoxelGrid<'_>>(), || {
        VoxelGrid::new(shape, Outside::Blocked, words)
    });
    measure_segments(meter, &grid);
    measure_roadmap_builds(meter, &grid, workspace);
    let search = &mut workspace.for_goals().search;
    measure_host_calls(meter, &grid, search, beside);
    coverage_calls::measure_coverage(meter, workspace.for_area(), &mut beside.plan)
}

fn random_geodetic(rng: &mut Pcg32) -> Geodetic {
    Geodetic {
        lat_deg: f64::from(random_between(rng, -70.0, 70.0)),
        lon_deg: f64::from(random_between(rng, -179.0, 179.0)),
        alt_m: f64::from(random_between(rng, 0.0, 4000.0)),
    }
}

fn measure_frames_and_grids(meter: &mut impl Meter) {
    let mut rng = Pcg32::seed_from_u64(1);
    for _ in 0..MANY_CASES {
        let origin = random_geodetic(&mut rng);
        let enu = random_point(&mut rng, 5000.0);
        let place =
            meter.call("frames::enu_to_geodetic", 0, || frames::enu_to_geodetic(&origin, &enu));
        meter.call("frames::geodetic_to_enu", 0, || frames::geodetic_to_enu(&origin, &place));
        meter.call("frames::haversine_m", 0, || frames::haversine_m(&origin, &place));
        for projection in [Projection::Px4, Projection::ArduPilot] {
            let ned = meter.call("frames::geodetic_to_ned", 0, || {
                frames::geodetic_to_ned(projection, &origin, &place)
            });
            meter.call("frames::ned_to_geodetic", 0, || {
                frames::ned_to_geodetic(projection, &origin, &ned)
            });
        }
    }
}

fn measure_searches(meter: &mut impl Meter, view: &RoadmapView<'_>, ws: &mut PlannerWorkspace) {
    let mut rng = Pcg32::seed_from_u64(2);
    let nodes = view.node_count();
    let bytes = size_of::<Search>();
    let passable = |_: u16, edge: &HalfEdge| view.has_clearance(edge, cases::CLEARANCE_M);
    let search = &mut ws.search;
    for _ in 0..SOME_CASES {
        let (from, to) =
            (random_below(&mut rng, nodes) as u16, random_below(&mut rng, nodes) as u16);
        let mut way: Vec<u16, WAYPOINTS> = Vec::new();
        // No path, or more nodes than fit, is a valid result too.
        let _ = meter.call("search::astar", bytes, || {
            search::astar(view, from, to, passable, search, &mut way)
        });
        let _ = meter.call("search::SearchWorkspace::path_to", 0, || search.path_to(to, &mut way));
        meter.call("roadmap::RoadmapView::edge_between", 0, || view.edge_between(from, to));
    }
    let mut draw = || -> Vec<u16, VEHICLES> {
        (0..VEHICLES).map(|_| random_below(&mut rng, nodes) as u16).collect()
    };
    let (starts, goals) = (draw(), draw());
    let mut row = [0.0; VEHICLES];
    let _ = meter.call("search::dijkstra_all", bytes, || {
        search::dijkstra_all(view, starts[0], passable, search)
    });
    let _ = meter.call("search::path_lengths_to, 32 targets", bytes, || {
        search::path_lengths_to(view, starts[0], &goals, passable, search, &mut row)
    });
    let mut costs = [[0.0; VEHICLES]; VEHICLES];
    let _ = meter.call("search::cost_matrix, 32 × 32", bytes, || {
        search::cost_matrix(view, &starts, &goals, passable, search, costs.as_flattened_mut())
    });
}

fn measure_assignments(meter: &mut impl Meter, ws: &mut AssignmentWorkspace<VEHICLES>) {
    let mut rng = Pcg32::seed_from_u64(3);
    let bytes = size_of::<AssignmentWorkspace<VEHICLES>>();
    for case in 0..60 {
        // Four kinds of cost matrix in turn: random metres; few different costs; every third pair
        // infinite; cost growing with row times column.
        let mut cost = |i: usize| match case % 4 {
            0 => random_between(&mut rng, 0.0, 100.0),
            1 => random_below(&mut rng, 4) as f32,
            2 if random_below(&mut rng, 3) == 0 => f32::INFINITY,
            2 => random_between(&mut rng, 0.0, 100.0),
            _ => ((i / VEHICLES + 1) * (i % VEHICLES + 1)) as f32,
        };
        let mut costs = [0.0; VEHICLES * VEHICLES];
        costs.iter_mut().enumerate().for_each(|(i, to)| *to = cost(i));
        let mut out = [None; VEHICLES];
        let _ = meter.call("assignment::assign, 32 × 32", bytes, || {
            assignment::assign(&costs, VEHICLES, VEHICLES, ws, &mut out)
        });
        let _ = meter.call("assignment::assign_bottleneck, 32 × 32", bytes, || {
            assignment::assign_bottleneck(&costs, VEHICLES, VEHICLES, ws, &mut out)
        });
    }
}

/// Counts the instructions of planning for the demo's ten vehicles, as a whole and step by step.
fn measure_plans(
    meter: &mut impl Meter,
    view: &RoadmapView<'_>,
    ws: &mut PlannerWorkspace,
    plan: &mut Plan,
) {
    let bytes = size_of::<PlannerWorkspace>();
    let (vehicles, descents_m) = (cases::vehicle_tasks(view), cases::goal_descents(view));
    let request = cases::plan_request(&vehicles, &descents_m);
    let mut goals = AssignedGoals::new();
    let good = "the demo has a plan";
    meter
        .call("plan::compute_costs, 10 × 10", bytes, || plan::compute_costs(view, &request, ws))
        .expect(good);
    meter
        .call("plan::assign_goals, 10 × 10", bytes, || {
            plan::assign_goals(&request, ws, &mut goals)
        })
        .expect(good);
    meter
        .call("plan::schedule_flights, 10", bytes, || {
            plan::schedule_flights(view, &request, &goals, ws, plan)
        })
        .expect(good);
    meter
        .call("plan::plan_swarm, 10", bytes, || plan::plan_swarm(view, &request, ws, plan))
        .expect(good);
    let bytes = size_of::<SippWorkspace<ROADMAP_NODES, TIMED_SEGMENTS>>();
    for (index, flight) in plan.flights.iter().enumerate() {
        let Some(goal) = flight.task.goal() else { continue };
        let (from, to) = (index as u16, view.header().start_count + goal);
        let route = RouteQuery {
            cfg: &cases::SCHEDULE,
            from,
            to,
            not_before_s: 0.0,
            parked: &[],
            handover_s: 0.0,
        };
        let passable = |_: u16, edge: &HalfEdge| view.has_clearance(edge, cases::CLEARANCE_M);
        let others = plan.flights.iter().filter(|other| other.vehicle_id != flight.vehicle_id);
        let mut own = flight.clone();
        // That no route exists is a valid result too.
        let _ = meter.call("schedule::sipp::find_route, past 9", bytes, || {
            sipp::find_route(view, &route, passable, others, &mut ws.sipp, &mut own)
        });
    }
}

/// Counts the instructions of scheduling the largest swarm, on shortest paths between random nodes.
fn measure_largest_swarm(
    meter: &mut impl Meter,
    view: &RoadmapView<'_>,
    ws: &mut PlannerWorkspace,
    plan: &mut Plan,
) {
    let mut rng = Pcg32::seed_from_u64(4);
    let cfg = &cases::SCHEDULE;
    plan.flights.clear();
    let mut way: Vec<u16, WAYPOINTS> = Vec::new();
    while plan.flights.len() < VEHICLES {
        let (from, to) = (
            random_below(&mut rng, view.node_count()) as u16,
            random_below(&mut rng, view.node_count()) as u16,
        );
        let passable = |_: u16, edge: &HalfEdge| view.has_clearance(edge, cases::CLEARANCE_M);
        if search::astar(view, from, to, passable, &mut ws.search, &mut way).is_err()
            || way.len() < 2
        {
            continue;
        }
        let mut path = Path::new();
        way.iter().for_each(|&node| path.push(view.node(node), 1.0).expect("as long as the nodes"));
        meter.call("flight::Path::set_times_at_speed", 0, || {
            path.set_times_at_speed(1.0, cfg.cruise_mps)
        });
        let id = 1 + plan.flights.len() as u8;
        let (climb_m, descent_m, piece_m) = (1.0, 1.0, schedule::DEFAULT_MAX_SEGMENT_M);
        let flight = Flight {
            vehicle_id: id,
            task: Task::Goto(0),
            path,
            climb_m,
            descent_m,
            depart_s: 0.0,
            max_segment_m: piece_m,
        };
        plan.flights.push(flight).expect("there is room");
    }
    let bytes = size_of::<ScheduleWorkspace>();
    let mut own = VehiclePlan::<WAYPOINTS, GATES>::default();
    for (index, flight) in plan.flights.iter().enumerate() {
        let others = || plan.flights.iter().filter(|other| other.vehicle_id != flight.vehicle_id);
        let _ = meter.call("schedule::earliest_departure, past 31", bytes, || {
            schedule::earliest_departure(cfg, flight, 0.0, others(), &mut ws.schedule)
        });
        let _ = meter.call("schedule::gates, past 31", bytes, || {
            schedule::gates(cfg, &plan.flights, index, &mut ws.schedule, &mut own.gates)
        });
        let _ = meter.call("plan::vehicle_plan, past 31", bytes, || {
            plan::vehicle_plan(plan, index, cfg, &mut ws.schedule, &mut own)
        });
    }
}

fn measure_detours(meter: &mut impl Meter, view: &RoadmapView<'_>, search: &mut Search) {
    let mut rng = Pcg32::seed_from_u64(5);
    let bytes = size_of::<Search>();
    let natures = [ZoneKind::Static, ZoneKind::LandingColumn, ZoneKind::Grounded];
    let mut nodes: Vec<u16, WAYPOINTS> = Vec::new();
    let mut own = VehiclePlan::<WAYPOINTS, GATES>::default();
    for case in 0..2 {
        let mut draw = || view.node(random_below(&mut rng, view.node_count()) as u16);
        let (here, other) = (draw(), draw());
        let mut obstacles: Vec<KeepOutZone, { 4 * VEHICLES }> = (0..4 * VEHICLES)
            .map(|i| {
                let from = draw();
                KeepOutZone {
                    from,
                    to: from - Point::new(0.0, 0.0, 20.0),
                    radius_m: 1.0,
                    kind: natures[i % 3],
                }
            })
            .collect();
        let request = DetourRequest {
            land_aside: case % 2 == 0,
            here,
            leg: [here, other],
            leg_clearance_m: 1.0,
            goal: DetourGoal::RoadmapGoal(0),
            descent_m: 0.5,
            required_clearance_m: cases::CLEARANCE_M,
            fence: None,
        };
        // That no detour exists is a valid result too.
        let _ = meter.call("detour::plan_detour, 128 things", bytes, || {
            detour::plan_detour(view, &request, &mut obstacles, search, &mut nodes, &mut own.path)
        });
        let _ = meter.call("detour::plan_detour_for_vehicle, 128 things", bytes, || {
            detour::plan_detour_for_vehicle(
                view,
                &request,
                &mut obstacles,
                search,
                &mut nodes,
                &mut own,
            )
        });
        meter.call("detour::KeepOutZone::contains", 0, || obstacles[0].contains(&here));
    }
}

fn measure_paths(meter: &mut impl Meter) {
    let mut rng = Pcg32::seed_from_u64(6);
    for case in 0..MANY_CASES {
        let mut path: Path<WAYPOINTS> = Path::new();
        for waypoint in flight::random_path(&mut rng).waypoints() {
            let (next, clearance_m) = (waypoint.position, waypoint.leg_clearance_m);
            meter
                .call("flight::Path::push", 0, || path.push(next, clearance_m))
                .expect("there is room");
        }
        let length_m = path.length_m();
        let along_m = random_between(&mut rng, 0.0, length_m);
        let near = random_point(&mut rng, 30.0);
        meter.call("flight::Path::point_at", 0, || path.point_at(along_m));
        meter.call("flight::Path::points_from, 16", 0, || {
            path.points_from(along_m, 0.5).take(16).count()
        });
        meter.call("flight::Path::project", 0, || path.project(&near, along_m, length_m));
        let track = TrackConfig { cruise_mps: flight::CRUISE_MPS, ..TrackConfig::default() };
        let mut reference =
            ReferenceState { along_m, speed_mps: track.cruise_mps, ..ReferenceState::default() };
        meter.call("track::advance", size_of::<ReferenceState>(), || {
            track::advance(&track, &path, &mut reference, &Advice::FREE, 0.05)
        });
        meter.call("track::braking_distance_m", 0, || {
            track::braking_distance_m(&track, &path, &reference)
        });
        let obstacle = KeepOutZone { from: near, to: near, radius_m: 1.0, kind: ZoneKind::Static };
        meter.call("detour::is_path_blocked", 0, || {
            detour::is_path_blocked(
                &path,
                -1.0..f32::INFINITY,
                1.0,
                1.0,
                &Point::new(500.0, 0.0, 0.0),
                &obstacle,
            )
        });
        let step = StepCase::new(&mut rng, VEHICLES, StepKind::of_case(case));
        meter.call("deconflict::advise, priority", 0, || step.advise(Method::Priority));
        meter.call("deconflict::advise, algorithm2", 0, || step.advise(Method::Algorithm2));
        meter.call("deconflict::has_late_neighbour", 0, || step.has_late_neighbour());
    }
}

fn measure_segments(meter: &mut impl Meter, grid: &VoxelGrid<'_>) {
    let mut rng = Pcg32::seed_from_u64(7);
    let (min, max) = (grid.shape().min, grid.shape().max());
    for _ in 0..MANY_CASES {
        let a = Point::from_fn(|axis, _| random_between(&mut rng, min[axis], max[axis]));
        let way = random_point(&mut rng, 1.0).try_normalize(1e-3).unwrap_or_else(Point::x);
        let b = a + way * MAX_EDGE_M;
        meter.call("voxel::VoxelGrid::is_blocked_at", 0, || grid.is_blocked_at(&a));
        meter.call("segment::segment_is_clear, 0 m", 0, || {
            segment::segment_is_clear(grid, &a, &b, 0.0)
        });
        meter.call("segment::segment_is_clear, 0.8 m", 0, || {
            segment::segment_is_clear(grid, &a, &b, cases::CLEARANCE_M)
        });
        if let (Some(from), Some(to)) =
            (segment::snap(grid.shape(), &a), segment::snap(grid.shape(), &b))
        {
            meter.call("segment::snapped_segment_touches", 0, || {
                segment::snapped_segment_touches(grid, &from, &to)
            });
        }
        meter.call("segment::segment_clearance, to 2 m", 0, || {
            segment::segment_clearance(grid, &a, &b, 2.0)
        });
        meter.call("segment::point_clearance, to 2 m", 0, || {
            segment::point_clearance(grid, &a, 2.0)
        });
        let nodes = [a, b];
        meter.call("prm::edge_clearance, to 2 m", 0, || {
            prm::edge_clearance(grid, &nodes, prm::PrmEdge { a: 0, b: 1 }, 2.0)
        });
    }
}

/// Counts the instructions of each step of building, on board, the roadmap of paper P3D's building,
/// without and with clearance.
fn measure_roadmap_builds(
    meter: &mut impl Meter,
    grid: &VoxelGrid<'_>,
    workspace: &mut WorkspaceOverlay,
) {
    let bytes = size_of::<prm::NodeGrid<ROADMAP_NODES, ROADMAP_CUBES>>();
    let good = "the building has room";
    let builder = workspace.builder();
    meter
        .call("prm::sample_nodes, 2300", 0, || {
            builder.sample_nodes(grid, &[], &cases::ROADMAP_CONFIG)
        })
        .expect(good);
    meter
        .call("prm::NodeGrid::sort_nodes, 2300", bytes, || {
            builder.sort_nodes(&cases::ROADMAP_CONFIG)
        })
        .expect(good);
    meter
        .call("prm::connect_range, 2300", bytes, || {
            builder.connect_nodes(grid, &cases::ROADMAP_CONFIG)
        })
        .expect(good);
    let wide = PrmConfig { clearance_m: cases::CLEARANCE_M, ..cases::ROADMAP_CONFIG };
    meter
        .call("prm::sample_nodes, 2300, 0.8 m", 0, || builder.sample_nodes(grid, &[], &wide))
        .expect(good);
    builder.sort_nodes(&wide).expect(good);
    meter
        .call("prm::connect_range, 2300, 0.8 m", bytes, || builder.connect_nodes(grid, &wide))
        .expect(good);
}

/// Counts the instructions of calls that only the host makes in normal use, on a small roadmap.
fn measure_host_calls(
    meter: &mut impl Meter,
    grid: &VoxelGrid<'_>,
    search: &mut Search,
    beside: &mut BenchMemory,
) {
    let BenchMemory { small_grid, nodes, edges, kept, file, lengths, .. } = beside;
    let config = PrmConfig { random_nodes: SMALL_ROADMAP_NODES, ..cases::ROADMAP_CONFIG };
    let good = "the building has room";
    prm::sample_nodes(grid, None, &[], &config, nodes).expect(good);
    let count = meter
        .call("prm::connect, 300", size_of::<prm::NodeGrid<SMALL_ROADMAP_NODES, 1024>>(), || {
            prm::connect(grid, nodes, &config, small_grid, edges)
        })
        .expect(good);
    let mut pairs = 0;
    meter
        .call("prm::connect_all_pairs, 300", 0, || {
            prm::connect_all_pairs(grid, nodes, &config, |_| pairs += 1)
        })
        .expect(good);
    assert_eq!(pairs, count, "the same edges");
    kept.extend(edges[..count].iter().map(|e| roadmap::Edge { a: e.a, b: e.b, clearance_m: 0.0 }));
    let header = RoadmapHeader {
        origin: Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 },
        edge_min_m: config.edge_min_m,
        edge_max_m: config.edge_max_m,
        tested_clearance_m: 0.0,
        max_clearance_m: 2.0,
        start_count: 0,
        goal_count: 0,
    };
    meter
        .call("roadmap::write, 300", 0, || roadmap::write(&header, nodes, kept, file))
        .expect(good);
    let len = meter
        .call("roadmap::write_with_landmarks, 300", size_of::<Search>(), || {
            roadmap::write_with_landmarks(&header, nodes, kept, &[], search, file)
        })
        .expect(good);
    let view = RoadmapView::parse(&file[..len]).expect(good);
    // Cannot fail: `lengths` has room for all half-edges.
    let _ = meter.call("search::RoadmapWithLengths::new, 300", 4 * view.half_edge_count(), || {
        RoadmapWithLengths::new(view, lengths)
    });
}
