//! Calls on plans, schedules and detours with extreme and invalid arguments, after those on the
//! roadmap that they need.

use heapless::Vec;
use planner_core::Point;
use planner_core::detour::{self, DetourError, DetourGoal, DetourRequest, KeepOutZone, ZoneKind};
use planner_core::flight::{Flight, Gate, Path, VehiclePlan};
use planner_core::plan::{
    self, AssignedGoals, GoalMode, Objective, PlanError, PlanRequest, PlanWorkspace, SwarmPlan,
    VehicleTask,
};
use planner_core::roadmap::RoadmapView;
use planner_core::roadmap::search::SearchWorkspace;
use planner_core::schedule::sipp::{self, RouteQuery, SippWorkspace};
use planner_core::schedule::{self, ScheduleConfig, ScheduleError, ScheduleWorkspace};

use super::limits_area_flights as area_flights;
use super::limits_field as field;
use super::limits_graph::{
    self as graph, MAX_NODES, NODE_INDICES, NODE_POSITIONS, any_edge_passable,
};
use super::limits_results::{CallListener, EXTREME_NUMBERS, Results, extreme_points};

/// Capacities of these calls: vehicles, waypoints, timed segments, gates.
const VEHICLES: usize = 3;
const WAYPOINTS: usize = 8;
const TIMED_SEGMENTS: usize = 256;
const GATES: usize = 16;

type PlanCallWorkspace = PlanWorkspace<MAX_NODES, VEHICLES, TIMED_SEGMENTS>;
type Plan = SwarmPlan<VEHICLES, WAYPOINTS>;

/// Memory that is lent to the calls.
pub struct RouteWorkspaces {
    ws: PlanCallWorkspace,
    plan: Plan,
    own: VehiclePlan<WAYPOINTS, GATES>,
    file: [u8; 512],
    coverage: area_flights::FlightWorkspaces,
}

impl RouteWorkspaces {
    /// Empty workspaces, whose bytes are all zeros.
    pub const fn new() -> Self {
        Self {
            ws: PlanCallWorkspace::new(),
            plan: Plan::new(),
            own: VehiclePlan::new(),
            file: [0; 512],
            coverage: area_flights::FlightWorkspaces::new(),
        }
    }
}

impl Default for RouteWorkspaces {
    fn default() -> Self {
        Self::new()
    }
}

/// Makes all calls but those of `call_without_roadmap`. Returns the checksum after each part:
/// fields and files, roadmaps, searches, assignments, plans, schedules, detours, coverage.
pub fn call_all(to: &mut Results<'_, impl CallListener>, lent: &mut RouteWorkspaces) -> [u32; 8] {
    field::call_fields(to);
    let len = graph::call_roadmap_files(to, &mut lent.ws.search, &mut lent.file);
    let mut sums = [to.sum(); 8];
    let view = to
        .call("view::RoadmapView::parse", || RoadmapView::parse(&lent.file[..len]))
        .expect("just written");
    graph::call_roadmap_views(to, &view);
    sums[1] = to.sum();
    graph::call_searches(to, &view, &mut lent.ws.search);
    sums[2] = to.sum();
    graph::call_assignments(to);
    sums[3] = to.sum();
    call_plans(to, &view, &mut lent.ws, &mut lent.plan);
    sums[4] = to.sum();
    call_schedules(to, &view, &mut lent.ws, &mut lent.plan, &mut lent.own);
    sums[5] = to.sum();
    call_detours(to, &view, &mut lent.ws.search, &mut lent.own);
    sums[6] = to.sum();
    area_flights::call_area_flights(to, &mut lent.ws.schedule, &mut lent.coverage);
    sums[7] = to.sum();
    sums
}

const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.75,
    cruise_mps: 1.8,
    vertical_mps: 1.0,
};
const TASK: VehicleTask =
    VehicleTask { id: 1, required_clearance_m: 0.8, climb_m: 1.5, goal: Some(0) };
const TASKS: [VehicleTask; 2] = [TASK, VehicleTask { id: 2, goal: Some(1), ..TASK }];

fn request<'a>(vehicles: &'a [VehicleTask], descents_m: &'a [f32]) -> PlanRequest<'a> {
    PlanRequest {
        vehicles,
        goal_descents_m: descents_m,
        mode: GoalMode::Labelled,
        schedule: SCHEDULE,
        max_gates: GATES,
    }
}

fn call_plans(
    to: &mut Results<'_, impl CallListener>,
    view: &RoadmapView<'_>,
    ws: &mut PlanCallWorkspace,
    out: &mut Plan,
) {
    *out = to.call("workspace::SwarmPlan::new", Plan::new);
    to.call("workspace::PlanWorkspace::new", || size_of_val(&PlanWorkspace::<1, 1, 1>::new()));
    let heights = [1.5, 1.5];
    let good = request(&TASKS, &heights);
    let modes = [
        GoalMode::Labelled,
        GoalMode::Unlabelled(Objective::TotalDistance),
        GoalMode::Unlabelled(Objective::Makespan),
    ];
    for mode in modes {
        let request = PlanRequest { mode, ..good };
        assert_eq!(
            to.call("plan::plan_swarm", || plan::plan_swarm(view, &request, ws, out)),
            Ok(())
        );
        assert!(out.flights.iter().all(|flight| flight.task.leaves_pad()));
        let total_m = to.call("workspace::SwarmPlan::total_path_m", || out.total_path_m());
        to.add(total_m as f32);
        to.add_count(out.crc as usize);
    }
    let mut refused = |request: &PlanRequest<'_>, error: PlanError| {
        assert_eq!(to.call("request::PlanRequest::check", || request.check()), Err(error));
        assert_eq!(plan::plan_swarm(view, request, ws, out), Err(error));
    };
    for hard in EXTREME_NUMBERS.into_iter().filter(|&x| !(x >= 0.0 && x.is_finite())) {
        for task in [
            VehicleTask { required_clearance_m: hard, ..TASKS[1] },
            VehicleTask { climb_m: hard, ..TASKS[1] },
        ] {
            // A climb of −0 is not tested: it equals 0 and is valid.
            refused(&request(&[TASK, task], &heights), PlanError::BadTask(2));
        }
        refused(&request(&TASKS, &[1.5, hard]), PlanError::BadDescent(1));
    }
    for hard in EXTREME_NUMBERS.into_iter().filter(|&x| !(x > 0.0 && x.is_finite())) {
        for schedule in [
            ScheduleConfig { separation_m: hard, ..SCHEDULE },
            ScheduleConfig { parked_separation_m: hard, ..SCHEDULE },
            ScheduleConfig { cruise_mps: hard, ..SCHEDULE },
            ScheduleConfig { vertical_mps: hard, ..SCHEDULE },
        ] {
            let error = schedule.check().unwrap_err();
            refused(&PlanRequest { schedule, ..good }, PlanError::Config(error));
        }
    }
    refused(&request(&[TASK; 2], &heights), PlanError::SameId(1));
    let same = [TASK, VehicleTask { goal: Some(0), ..TASKS[1] }];
    refused(&request(&same, &heights), PlanError::SameGoal(2));
    for goal in [2, 3, u16::MAX] {
        let tasks = [TASK, VehicleTask { goal: Some(goal), ..TASKS[1] }];
        assert_eq!(
            plan::plan_swarm(view, &request(&tasks, &heights), ws, out),
            Err(PlanError::BadGoal(2))
        );
    }
    // More or fewer vehicles or goals than the roadmap has starts and goals, and more vehicles than
    // the workspace holds.
    let crowd = [5, 6, 7, 8].map(|id| VehicleTask { id, goal: None, ..TASK });
    for (vehicles, goals) in
        [(&TASKS[..1], 2), (&TASKS[..], 1), (&crowd[..3], 2), (&crowd[..], 4), (&[], 0)]
    {
        let heights = [1.5; 4];
        let request = request(vehicles, &heights[..goals]);
        assert_eq!(
            to.call("plan::compute_costs", || plan::compute_costs(view, &request, ws)),
            Err(PlanError::CountMismatch)
        );
        let mut assigned = AssignedGoals::<VEHICLES>::new();
        let many =
            to.call("plan::assign_goals", || plan::assign_goals(&request, ws, &mut assigned));
        assert!(vehicles.len() <= VEHICLES || many == Err(PlanError::SwarmFull));
        let planned = to.call("plan::schedule_flights", || {
            plan::schedule_flights(view, &request, &assigned, ws, out)
        });
        assert_eq!(planned, Err(PlanError::CountMismatch));
    }
    for (first, second) in
        [(Some(2), None), (None, Some(u16::MAX)), (Some(1), Some(1)), (None, None)]
    {
        let mut assigned = AssignedGoals::<VEHICLES>::new();
        assigned.extend([first, second]);
        let planned = plan::schedule_flights(view, &good, &assigned, ws, out);
        assert_eq!(planned.is_ok(), first.is_none() && second.is_none(), "{first:?} {second:?}");
    }
    let mut short = SwarmPlan::<VEHICLES, 2>::new();
    assert!(plan::plan_swarm(view, &good, ws, &mut short).is_err(), "paths have three nodes");
    for (climb_m, gates_most) in [(0.0, GATES), (1e7, GATES), (1.5, 0)] {
        let tasks = TASKS.map(|task| VehicleTask { climb_m, ..task });
        let request = PlanRequest { max_gates: gates_most, ..request(&tasks, &heights) };
        to.add_count(usize::from(plan::plan_swarm(view, &request, ws, out).is_ok()));
    }
    assert_eq!(plan::plan_swarm(view, &good, ws, out), Ok(()));
}

fn call_schedules(
    to: &mut Results<'_, impl CallListener>,
    view: &RoadmapView<'_>,
    ws: &mut PlanCallWorkspace,
    plan: &mut Plan,
    own: &mut VehiclePlan<WAYPOINTS, GATES>,
) {
    to.call("flight::VehiclePlan::new", || size_of_val(&VehiclePlan::<1, 1>::new()));
    to.call("schedule::ScheduleWorkspace::new", || size_of_val(&ScheduleWorkspace::new()));
    to.call("sipp::SippWorkspace::new", || size_of_val(&SippWorkspace::<1, 1>::new()));
    for index in [0, 1, 2, usize::MAX] {
        let answer = to.call("plan::vehicle_plan", || {
            plan::vehicle_plan(plan, index, &SCHEDULE, &mut ws.schedule, own)
        });
        assert_eq!(answer, if index < 2 { Ok(()) } else { Err(ScheduleError::BadIndex) });
        let mut none: Vec<Gate, 0> = Vec::new();
        let answer = to.call("schedule::gates", || {
            schedule::gates(&SCHEDULE, &plan.flights, index, &mut ws.schedule, &mut none)
        });
        assert!(answer.is_ok() || index > 1 || answer == Err(ScheduleError::GatesFull));
    }
    for (i, hard) in EXTREME_NUMBERS.into_iter().enumerate() {
        let other = EXTREME_NUMBERS[(i * 5) % EXTREME_NUMBERS.len()];
        let cfg = ScheduleConfig { separation_m: other, cruise_mps: hard, ..SCHEDULE };
        let good = |x: f32| x > 0.0 && x.is_finite();
        let checked = to.call("config::ScheduleConfig::check", || cfg.check());
        assert_eq!(checked.is_ok(), good(other) && good(hard));
        let flights = plan.flights.clone();
        for flight in [
            Flight { climb_m: hard, ..flights[0].clone() },
            Flight { descent_m: hard, ..flights[0].clone() },
            Flight { depart_s: hard, ..flights[0].clone() },
            Flight { max_segment_m: hard, ..flights[0].clone() },
            Flight { path: Path::new(), ..flights[0].clone() },
        ] {
            for cfg in [SCHEDULE, cfg] {
                // For NaN or infinite inputs any result is accepted; the call must only return.
                let answer = to.call("schedule::earliest_departure", || {
                    schedule::earliest_departure(
                        &cfg,
                        &flight,
                        hard,
                        flights[1..].iter(),
                        &mut ws.schedule,
                    )
                });
                to.add_count(usize::from(answer.is_ok()));
                let pair = [flight.clone(), flights[1].clone()];
                let answer = schedule::gates(&cfg, &pair, 1, &mut ws.schedule, &mut own.gates);
                to.add_count(usize::from(answer.is_ok()));
                let mut found = flight.clone();
                let route = RouteQuery {
                    cfg: &cfg,
                    from: 0,
                    to: 2,
                    not_before_s: hard,
                    parked: &[Point::new(hard, 0.0, 0.0)],
                    handover_s: hard,
                };
                let answer = to.call("sipp::find_route", || {
                    sipp::find_route(
                        view,
                        &route,
                        any_edge_passable,
                        flights[1..].iter(),
                        &mut ws.sipp,
                        &mut found,
                    )
                });
                to.add_count(usize::from(answer.is_ok()));
            }
        }
    }
    for i in 0..NODE_INDICES.len() * NODE_INDICES.len() {
        let (from, to_node) =
            (NODE_INDICES[i / NODE_INDICES.len()], NODE_INDICES[i % NODE_INDICES.len()]);
        let route = RouteQuery {
            cfg: &SCHEDULE,
            from,
            to: to_node,
            not_before_s: 0.0,
            parked: &[],
            handover_s: 0.0,
        };
        let mut flight = plan.flights[0].clone();
        let answer = to.call("sipp::find_route", || {
            sipp::find_route(view, &route, any_edge_passable, [].iter(), &mut ws.sipp, &mut flight)
        });
        let there = usize::from(from.max(to_node)) < view.node_count();
        assert!(there || answer == Err(ScheduleError::BadIndex));
        to.add_count(usize::from(answer.is_ok()));
    }
}

fn call_detours(
    to: &mut Results<'_, impl CallListener>,
    view: &RoadmapView<'_>,
    ws: &mut SearchWorkspace<MAX_NODES>,
    own: &mut VehiclePlan<WAYPOINTS, GATES>,
) {
    let mut nodes: Vec<u16, WAYPOINTS> = Vec::new();
    let good = DetourRequest {
        land_aside: false,
        here: NODE_POSITIONS[0],
        leg: [NODE_POSITIONS[0], NODE_POSITIONS[4]],
        leg_clearance_m: 1.0,
        goal: DetourGoal::RoadmapGoal(0),
        descent_m: 1.5,
        required_clearance_m: 0.8,
        fence: None,
    };
    let natures = [ZoneKind::Static, ZoneKind::LandingColumn, ZoneKind::Grounded];
    let path = own.path.clone();
    let empty: Path<WAYPOINTS> = Path::new();
    for (i, p) in extreme_points().enumerate() {
        let hard = EXTREME_NUMBERS[i % EXTREME_NUMBERS.len()];
        let thing =
            KeepOutZone { from: p, to: NODE_POSITIONS[5], radius_m: hard, kind: natures[i % 3] };
        for request in [
            good,
            DetourRequest { land_aside: true, ..good },
            DetourRequest { here: p, ..good },
            DetourRequest { leg: [p, p], ..good },
            DetourRequest { descent_m: hard, leg_clearance_m: hard, ..good },
            DetourRequest { required_clearance_m: hard, ..good },
            DetourRequest { goal: DetourGoal::Point { end: p, layer_z_m: hard }, ..good },
            DetourRequest { fence: Some((p, NODE_POSITIONS[5])), ..good },
        ] {
            let bad = [
                to.call("detour::DetourRequest::check", || request.check()).is_err(),
                to.call("detour::KeepOutZone::check", || thing.check()).is_err(),
            ];
            let finite = |places: &[Point]| places.iter().flatten().all(|c| c.is_finite());
            let over = if let DetourGoal::Point { end: over, .. } = request.goal {
                over
            } else {
                request.here
            };
            assert!(finite(&[request.here, request.leg[0], request.leg[1], over]) || bad[0]);
            assert!((finite(&[thing.from, thing.to]) && hard >= 0.0 && hard.is_finite()) != bad[1]);
            let answer = to.call("detour::plan_detour", || {
                detour::plan_detour(view, &request, &mut [thing], ws, &mut nodes, &mut own.path)
            });
            assert_eq!(
                bad.contains(&true),
                matches!(answer, Err(DetourError::Config(_))),
                "{request:?} {thing:?}"
            );
            assert!(
                answer.is_err()
                    || own
                        .path
                        .waypoints()
                        .iter()
                        .all(|w| w.position.iter().all(|c| c.is_finite()))
            );
            to.add_count(usize::from(answer.is_ok()));
            let again = to.call("detour::plan_detour_for_vehicle", || {
                detour::plan_detour_for_vehicle(view, &request, &mut [thing], ws, &mut nodes, own)
            });
            assert_eq!(again, answer);
        }
        for goal in [2, 4, u16::MAX - 1, u16::MAX] {
            let request = DetourRequest { goal: DetourGoal::RoadmapGoal(goal), ..good };
            assert!(
                detour::plan_detour(view, &request, &mut [thing], ws, &mut nodes, &mut own.path)
                    .is_err()
            );
        }
        let holds = to.call("detour::KeepOutZone::contains", || thing.contains(&NODE_POSITIONS[5]));
        assert!(!holds || hard > 0.0 || hard.is_nan());
        for path in [&path, &empty] {
            let blocked = to.call("detour::is_path_blocked", || {
                detour::is_path_blocked(path, hard..f32::INFINITY, p.x, p.y, &p, &thing)
            });
            to.call("detour::is_path_blocked", || {
                detour::is_path_blocked(path, -1.0..hard, p.x, p.y, &p, &thing)
            });
            to.add_count(usize::from(blocked));
            let count = to
                .call("detour::count_segments_ahead", || detour::count_segments_ahead(path, hard));
            assert!(count <= path.waypoints().len() + 2);
        }
    }
}
