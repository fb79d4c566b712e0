//! The calls on roadmaps, assignments, plans and schedules at their limits and beyond.

use heapless::Vec;
use planner_core::Point;
use planner_core::assignment::{self, AssignmentError, AssignmentWorkspace};
use planner_core::detour::{self, DetourError, DetourRequest, KeepOff, Nature};
use planner_core::frames::Geodetic;
use planner_core::path::Path;
use planner_core::plan::{
    self, Goals, Mode, Objective, PlanError, PlanRequest, PlanWorkspace, SwarmPlan, VehicleTask,
};
use planner_core::roadmap::{self, Edge, HalfEdge, LANDMARKS, RoadmapHeader, RoadmapView};
use planner_core::schedule::sipp::{self, Route, SippWorkspace};
use planner_core::schedule::{self, Flight, ScheduleConfig, ScheduleError, ScheduleWorkspace, VehiclePlan};
use planner_core::search::{self, SearchError, SearchWorkspace, WithLengths};

use super::limits::{Answers, HARD, Listener, points};

/// Capacities: nodes, vehicles, waypoints, timed segments, gates.
const NODES: usize = 8;
const VEHICLES: usize = 3;
const WAYPOINTS: usize = 8;
const PIECES: usize = 256;
const GATES: usize = 16;

type Workspace = PlanWorkspace<NODES, VEHICLES, PIECES>;
type Plan = SwarmPlan<VEHICLES, WAYPOINTS>;

/// What the calls are lent.
pub struct Lent {
    ws: Workspace,
    plan: Plan,
    own: VehiclePlan<WAYPOINTS, GATES>,
    file: [u8; 512],
}

impl Lent {
    /// Empty.
    pub const fn new() -> Self {
        Self { ws: Workspace::new(), plan: Plan::new(), own: VehiclePlan::new(), file: [0; 512] }
    }
}

impl Default for Lent {
    fn default() -> Self {
        Self::new()
    }
}

const HEADER: RoadmapHeader = RoadmapHeader {
    origin: Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 },
    edge_min_m: 0.5,
    edge_max_m: 9.0,
    tested_clearance_m: 0.0,
    max_clearance_m: 2.0,
    starts: 2,
    goals: 2,
};

/// Two starts, two goals opposite, two nodes between.
const PLACES: [Point; 6] = [
    Point::new(0.0, 0.0, 2.0),
    Point::new(0.0, 6.0, 2.0),
    Point::new(12.0, 6.0, 2.0),
    Point::new(12.0, 0.0, 2.0),
    Point::new(6.0, 1.0, 2.0),
    Point::new(6.0, 5.0, 2.0),
];

/// Over the ground at 0 m; below the last node there is none.
const HEIGHTS_M: [f32; 6] = [2.0, 2.0, 2.0, 2.0, 2.0, f32::INFINITY];

fn edges() -> Vec<Edge, 9> {
    let pairs = [(0, 4), (0, 5), (1, 4), (1, 5), (2, 4), (2, 5), (3, 4), (3, 5), (4, 5)];
    pairs.iter().map(|&(a, b)| Edge { a, b, clearance_m: 1.0 }).collect()
}

fn any(_: u16, _: &HalfEdge) -> bool {
    true
}

/// Makes all of them; the sum of the answers after each part: files, roadmaps, searches, assignments, plans, schedules,
/// detours.
pub fn routes(to: &mut Answers<'_, impl Listener>, lent: &mut Lent) -> [u32; 7] {
    let len = files(to, &mut lent.ws.search, &mut lent.file);
    let mut sums = [to.sum(); 7];
    let view = to
        .call("roadmap::RoadmapView::parse", || RoadmapView::parse(&lent.file[..len]))
        .expect("just written");
    roadmaps(to, &view);
    sums[1] = to.sum();
    searches(to, &view, &mut lent.ws.search);
    sums[2] = to.sum();
    assignments(to);
    sums[3] = to.sum();
    plans(to, &view, &mut lent.ws, &mut lent.plan);
    sums[4] = to.sum();
    schedules(to, &view, &mut lent.ws, &mut lent.plan, &mut lent.own);
    sums[5] = to.sum();
    detours(to, &view, &mut lent.ws.search, &mut lent.own);
    sums[6] = to.sum();
    sums
}

/// Leaves a good file; returns its length.
fn files(
    to: &mut Answers<'_, impl Listener>,
    ws: &mut SearchWorkspace<NODES>,
    file: &mut [u8; 512],
) -> usize {
    let all = [0, 1, 7, u32::MAX as usize / 4, usize::MAX / 8, usize::MAX];
    for i in 0..all.len() * all.len() {
        let len =
            to.call("write::encoded_len", || roadmap::encoded_len(all[i % 6], all[i / 6], all[(i * 7) % 6]));
        assert!(len.is_none_or(|len| len <= u32::MAX as usize));
    }
    let edges = edges();
    for hard in HARD {
        for header in [
            RoadmapHeader { edge_min_m: hard, ..HEADER },
            RoadmapHeader { edge_max_m: hard, ..HEADER },
            RoadmapHeader { tested_clearance_m: hard, ..HEADER },
            RoadmapHeader { max_clearance_m: hard, ..HEADER },
            RoadmapHeader { starts: hard as u16, goals: u16::MAX, ..HEADER },
            RoadmapHeader { origin: Geodetic { lat_deg: hard.into(), ..HEADER.origin }, ..HEADER },
        ] {
            let written = to.call("write::write", || roadmap::write(&header, &PLACES, &edges, file));
            // What was written can be read.
            let read = written.and_then(|len| RoadmapView::parse(&file[..len]).map(|view| view.crc()));
            assert_eq!(written.is_ok(), read.is_ok(), "{header:?}");
            to.is(written.is_ok());
        }
        let with = [Edge { clearance_m: hard, ..edges[0] }];
        to.is(roadmap::write(&HEADER, &PLACES, &with, file).is_ok());
    }
    for (a, b) in [(0, 0), (0, 6), (u16::MAX, 0)] {
        assert!(roadmap::write(&HEADER, &PLACES, &[Edge { a, b, clearance_m: 1.0 }], file).is_err());
    }
    for p in points() {
        let mut places = PLACES;
        places[5] = p;
        to.is(roadmap::write(&HEADER, &places, &edges, file).is_ok());
    }
    assert!(roadmap::write(&HEADER, &PLACES, &edges, &mut file[..100]).is_err());
    let mut small = SearchWorkspace::<2>::new();
    assert!(roadmap::write_with_landmarks(&HEADER, &PLACES, &edges, &[], &mut small, file).is_err());
    for hard in HARD {
        let heights_m = [2.0, hard, 2.0, 2.0, 2.0, f32::INFINITY];
        let written = roadmap::write_with_landmarks(&HEADER, &PLACES, &edges, &heights_m, ws, file);
        let good = (0.0..=roadmap::MAX_WAY_M).contains(&hard) || hard == f32::INFINITY;
        assert_eq!(written.is_ok(), good, "{hard}");
    }
    assert!(roadmap::write_with_landmarks(&HEADER, &PLACES, &edges, &[1.0; 5], ws, file).is_err());
    let len = to
        .call("write::write_with_landmarks", || {
            roadmap::write_with_landmarks(&HEADER, &PLACES, &edges, &HEIGHTS_M, ws, file)
        })
        .expect("a good roadmap");
    let mut head = [0; roadmap::HEADER_LEN];
    head.copy_from_slice(&file[..roadmap::HEADER_LEN]);
    assert_eq!(to.call("roadmap::declared_len", || roadmap::declared_len(&head)), Ok(len));
    for at in 0..head.len() {
        let mut head = head;
        head[at] ^= 0xff;
        let told = to.call("roadmap::declared_len", || roadmap::declared_len(&head));
        assert!(told == Ok(len) || told.is_err());
    }
    for cut in 0..len {
        assert!(RoadmapView::parse(&file[..cut]).is_err());
    }
    assert_eq!(roadmap::encoded_len(PLACES.len(), edges.len(), LANDMARKS + 1), Some(len));
    len
}

/// Indices of nodes: good ones and ones that there are none of.
const INDICES: [u16; 6] = [0, 1, 5, 6, 8, u16::MAX];

fn roadmaps(to: &mut Answers<'_, impl Listener>, view: &RoadmapView<'_>) {
    let nodes = to.call("roadmap::RoadmapView::node_count", || view.node_count());
    let half_edges = to.call("roadmap::RoadmapView::half_edge_count", || view.half_edge_count());
    assert_eq!((nodes, half_edges), (6, 18));
    let bytes = to.call("roadmap::RoadmapView::byte_len", || view.byte_len());
    to.count(bytes);
    assert!(to.call("roadmap::RoadmapView::has_landmarks", || view.has_landmarks()));
    assert_eq!(to.call("roadmap::RoadmapView::header", || *view.header()), HEADER);
    assert_eq!(to.call("roadmap::RoadmapView::origin", || *view.origin()), HEADER.origin);
    let crc = to.call("roadmap::RoadmapView::crc", || view.crc());
    to.count(crc as usize);
    for i in 0..INDICES.len() * INDICES.len() {
        let (a, b) = (INDICES[i / INDICES.len()], INDICES[i % INDICES.len()]);
        let there = usize::from(a.max(b)) < nodes;
        let place = to.call("roadmap::RoadmapView::node", || view.node(a));
        assert_eq!(place.iter().all(|c| c.is_finite()), usize::from(a) < nodes);
        let length_m = to.call("roadmap::RoadmapView::distance_m", || view.distance_m(a, b));
        assert_eq!(length_m.is_finite(), there);
        let edge = to.call("roadmap::RoadmapView::edge_between", || view.edge_between(a, b));
        assert!(there || edge.is_none());
        let ground_m = to.call("ground::RoadmapView::ground_m", || view.ground_m(a));
        assert_eq!(ground_m, (a < 5).then_some(0.0));
        let degree = to.call("roadmap::RoadmapView::half_edges", || view.half_edges(a).count());
        assert!(usize::from(a) < nodes || degree == 0);
        to.count(degree);
    }
    for p in points() {
        let around = to.call("ground::RoadmapView::ground_around", || view.ground_around(&p));
        assert!(around.is_none_or(|(low_m, high_m)| low_m == 0.0 && high_m == 0.0 && p.z >= 0.0));
        to.is(around.is_some());
    }
    let edge = view.edge_between(0, 4).expect("an edge");
    for hard in HARD {
        let clears = to.call("roadmap::RoadmapView::clears", || view.clears(&edge, hard));
        assert_eq!(clears, hard < 1.0, "{hard}");
    }
}

fn searches(to: &mut Answers<'_, impl Listener>, view: &RoadmapView<'_>, ws: &mut SearchWorkspace<NODES>) {
    let fresh = to.call("search::SearchWorkspace::new", SearchWorkspace::<NODES>::new);
    let mut way: Vec<u16, WAYPOINTS> = Vec::new();
    for node in INDICES {
        // Before the first search nothing is reached.
        assert!(to.call("search::SearchWorkspace::distance_m", || fresh.distance_m(node)).is_infinite());
        assert!(to.call("search::SearchWorkspace::path_to", || fresh.path_to(node, &mut way)).is_err());
    }
    let mut small = SearchWorkspace::<2>::new();
    let mut lengths = [0.0; 18];
    assert!(WithLengths::new(*view, &mut lengths[..17]).is_err());
    let with =
        to.call("search::WithLengths::new", || WithLengths::new(*view, &mut lengths)).expect("18 half-edges");
    for i in 0..INDICES.len() * INDICES.len() {
        let (a, b) = (INDICES[i / INDICES.len()], INDICES[i % INDICES.len()]);
        let there = usize::from(a.max(b)) < view.node_count();
        let found = to.call("search::astar", || search::astar(view, a, b, any, ws, &mut way));
        assert_eq!(found.is_ok(), there);
        assert_eq!(search::astar(&with, a, b, any, ws, &mut way), found);
        to.add(found.unwrap_or(-1.0));
        let closed = search::astar(view, a, b, |_, _| false, ws, &mut way);
        assert_eq!(closed.is_ok(), there && a == b);
        let mut short: Vec<u16, 1> = Vec::new();
        assert!(a == b || search::astar(view, a, b, any, ws, &mut short).is_err());
        assert!(search::astar(view, a, b, any, &mut small, &mut way).is_err());
        let all = to.call("search::dijkstra_all", || search::dijkstra_all(view, a, any, ws));
        assert_eq!(all.is_ok(), usize::from(a) < view.node_count());
        let mut row = [0.0; 2];
        let told =
            to.call("search::dijkstra_row", || search::dijkstra_row(view, a, &[b, 0], any, ws, &mut row));
        assert_eq!(told.is_ok(), there);
        assert_eq!(
            search::dijkstra_row(view, a, &[b, 0], any, ws, &mut row[..1]),
            Err(SearchError::OutputLength)
        );
        let mut costs = [0.0; 4];
        let told = to
            .call("search::cost_matrix", || search::cost_matrix(view, &[a, 0], &[b, 1], any, ws, &mut costs));
        assert_eq!(told.is_ok(), there);
        assert!(search::cost_matrix(view, &[a, 0], &[b, 1], any, ws, &mut costs[..3]).is_err());
    }
    assert_eq!(search::cost_matrix(view, &[], &[1], any, ws, &mut []), Ok(()));
}

fn assignments(to: &mut Answers<'_, impl Listener>) {
    let mut ws = to.call("assignment::AssignmentWorkspace::new", AssignmentWorkspace::<3>::new);
    let mut out = [None; 3];
    let mut both = |costs: &[f32], rows: usize, cols: usize, out: &mut [Option<u16>]| {
        let total = to.call("assignment::assign", || assignment::assign(costs, rows, cols, &mut ws, out));
        let most =
            to.call("assignment::bottleneck", || assignment::bottleneck(costs, rows, cols, &mut ws, out));
        assert_eq!(total.map(|a| a.pairs), most.map(|a| a.pairs));
        to.add(most.map_or(-1.0, |a| a.largest));
        total
    };
    for i in 0..HARD.len() * HARD.len() {
        let (a, b) = (HARD[i / HARD.len()], HARD[i % HARD.len()]);
        let costs = [a, b, a, b, a, 1.0, 2.0, b, a];
        let bad = costs.iter().any(|c| c.is_nan() || *c == f32::NEG_INFINITY);
        for (rows, cols) in [(3, 3), (1, 3), (3, 1), (2, 3)] {
            let found = both(&costs[..rows * cols], rows, cols, &mut out[..rows]);
            assert!(found.is_ok() || bad, "{costs:?}");
        }
    }
    let costs = [1.0; 16];
    assert_eq!(both(&costs, 4, 4, &mut out).unwrap_err(), AssignmentError::WorkspaceTooSmall);
    assert_eq!(both(&costs[..9], 3, 3, &mut out[..2]).unwrap_err(), AssignmentError::OutputLength);
    assert_eq!(both(&costs[..8], 3, 3, &mut out).unwrap_err(), AssignmentError::Shape);
    assert!(both(&[], 0, 0, &mut []).is_err() && both(&[], 3, 0, &mut out).is_err());
    assert!(both(&costs, usize::MAX, 2, &mut out).is_err());
}

const SCHEDULE: ScheduleConfig =
    ScheduleConfig { separation_m: 2.0, parked_separation_m: 1.75, cruise_mps: 1.8, vertical_mps: 1.0 };
const TASK: VehicleTask = VehicleTask { id: 1, required_clearance_m: 0.8, climb_m: 1.5, goal: Some(0) };
const TASKS: [VehicleTask; 2] = [TASK, VehicleTask { id: 2, goal: Some(1), ..TASK }];

fn request<'a>(vehicles: &'a [VehicleTask], descents_m: &'a [f32]) -> PlanRequest<'a> {
    PlanRequest { vehicles, descents_m, mode: Mode::Labelled, schedule: SCHEDULE, gates_most: GATES }
}

fn plans(to: &mut Answers<'_, impl Listener>, view: &RoadmapView<'_>, ws: &mut Workspace, out: &mut Plan) {
    *out = to.call("plan::SwarmPlan::new", Plan::new);
    to.call("plan::PlanWorkspace::new", || size_of_val(&PlanWorkspace::<1, 1, 1>::new()));
    let heights = [1.5, 1.5];
    let good = request(&TASKS, &heights);
    let modes =
        [Mode::Labelled, Mode::Unlabelled(Objective::TotalDistance), Mode::Unlabelled(Objective::Makespan)];
    for mode in modes {
        let request = PlanRequest { mode, ..good };
        assert_eq!(to.call("plan::plan_swarm", || plan::plan_swarm(view, &request, ws, out)), Ok(()));
        assert!(out.flights.iter().all(|flight| flight.goal.is_some()));
        let total_m = to.call("plan::SwarmPlan::total_m", || out.total_m());
        to.add(total_m as f32);
        to.count(out.crc as usize);
    }
    let mut refused = |request: &PlanRequest<'_>, error: PlanError| {
        assert_eq!(to.call("plan::PlanRequest::check", || request.check()), Err(error));
        assert_eq!(plan::plan_swarm(view, request, ws, out), Err(error));
    };
    for hard in HARD.into_iter().filter(|&x| !(x >= 0.0 && x.is_finite())) {
        for task in [
            VehicleTask { required_clearance_m: hard, ..TASKS[1] },
            VehicleTask { climb_m: hard, ..TASKS[1] },
        ] {
            // A height of −0 is 0.
            refused(&request(&[TASK, task], &heights), PlanError::BadTask(2));
        }
        refused(&request(&TASKS, &[1.5, hard]), PlanError::BadDescent(1));
    }
    for hard in HARD.into_iter().filter(|&x| !(x > 0.0 && x.is_finite())) {
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
        assert_eq!(plan::plan_swarm(view, &request(&tasks, &heights), ws, out), Err(PlanError::BadGoal(2)));
    }
    // More or fewer than the roadmap has, and more than the memory.
    let crowd = [5, 6, 7, 8].map(|id| VehicleTask { id, goal: None, ..TASK });
    for (vehicles, goals) in [(&TASKS[..1], 2), (&TASKS[..], 1), (&crowd[..3], 2), (&crowd[..], 4), (&[], 0)]
    {
        let heights = [1.5; 4];
        let request = request(vehicles, &heights[..goals]);
        assert_eq!(to.call("plan::costs", || plan::costs(view, &request, ws)), Err(PlanError::Terminals));
        let mut assigned = Goals::<VEHICLES>::new();
        let many = to.call("plan::assign", || plan::assign(&request, ws, &mut assigned));
        assert!(vehicles.len() <= VEHICLES || many == Err(PlanError::SwarmFull));
        let planned = to.call("plan::schedule", || plan::schedule(view, &request, &assigned, ws, out));
        assert_eq!(planned, Err(PlanError::Terminals));
    }
    for (first, second) in [(Some(2), None), (None, Some(u16::MAX)), (Some(1), Some(1)), (None, None)] {
        let mut assigned = Goals::<VEHICLES>::new();
        assigned.extend([first, second]);
        let planned = plan::schedule(view, &good, &assigned, ws, out);
        assert_eq!(planned.is_ok(), first.is_none() && second.is_none(), "{first:?} {second:?}");
    }
    let mut short = SwarmPlan::<VEHICLES, 2>::new();
    assert!(plan::plan_swarm(view, &good, ws, &mut short).is_err(), "paths have three nodes");
    for (climb_m, gates_most) in [(0.0, GATES), (1e7, GATES), (1.5, 0)] {
        let tasks = TASKS.map(|task| VehicleTask { climb_m, ..task });
        let request = PlanRequest { gates_most, ..request(&tasks, &heights) };
        to.is(plan::plan_swarm(view, &request, ws, out).is_ok());
    }
    assert_eq!(plan::plan_swarm(view, &good, ws, out), Ok(()));
}

fn schedules(
    to: &mut Answers<'_, impl Listener>,
    view: &RoadmapView<'_>,
    ws: &mut Workspace,
    plan: &mut Plan,
    own: &mut VehiclePlan<WAYPOINTS, GATES>,
) {
    to.call("schedule::VehiclePlan::new", || size_of_val(&VehiclePlan::<1, 1>::new()));
    to.call("schedule::ScheduleWorkspace::new", || size_of_val(&ScheduleWorkspace::new()));
    to.call("sipp::SippWorkspace::new", || size_of_val(&SippWorkspace::<1, 1>::new()));
    for index in [0, 1, 2, usize::MAX] {
        let told = to
            .call("plan::vehicle_plan", || plan::vehicle_plan(plan, index, &SCHEDULE, &mut ws.schedule, own));
        assert_eq!(told, if index < 2 { Ok(()) } else { Err(ScheduleError::BadIndex) });
        let mut none: Vec<schedule::Gate, 0> = Vec::new();
        let told = to.call("schedule::gates", || {
            schedule::gates(&SCHEDULE, &plan.flights, index, &mut ws.schedule, &mut none)
        });
        assert!(told.is_ok() || index > 1 || told == Err(ScheduleError::GatesFull));
    }
    for (i, hard) in HARD.into_iter().enumerate() {
        let other = HARD[(i * 5) % HARD.len()];
        let cfg = ScheduleConfig { separation_m: other, cruise_mps: hard, ..SCHEDULE };
        let good = |x: f32| x > 0.0 && x.is_finite();
        let checked = to.call("schedule::ScheduleConfig::check", || cfg.check());
        assert_eq!(checked.is_ok(), good(other) && good(hard));
        let flights = plan.flights.clone();
        for flight in [
            Flight { climb_m: hard, ..flights[0].clone() },
            Flight { descent_m: hard, ..flights[0].clone() },
            Flight { depart_s: hard, ..flights[0].clone() },
            Flight { piece_m: hard, ..flights[0].clone() },
            Flight { path: Path::new(), ..flights[0].clone() },
        ] {
            for cfg in [SCHEDULE, cfg] {
                // A number that is none has no right answer; it must only end.
                let told = to.call("schedule::earliest_departure", || {
                    schedule::earliest_departure(&cfg, &flight, hard, flights[1..].iter(), &mut ws.schedule)
                });
                to.is(told.is_ok());
                let pair = [flight.clone(), flights[1].clone()];
                let told = schedule::gates(&cfg, &pair, 1, &mut ws.schedule, &mut own.gates);
                to.is(told.is_ok());
                let mut found = flight.clone();
                let route =
                    Route { from: 0, to: 2, not_before_s: hard, parked: &[Point::new(hard, 0.0, 0.0)] };
                let told = to.call("sipp::route", || {
                    sipp::route(&cfg, view, &route, any, flights[1..].iter(), &mut ws.sipp, &mut found)
                });
                to.is(told.is_ok());
            }
        }
    }
    for i in 0..INDICES.len() * INDICES.len() {
        let (from, to_node) = (INDICES[i / INDICES.len()], INDICES[i % INDICES.len()]);
        let route = Route { from, to: to_node, not_before_s: 0.0, parked: &[] };
        let mut flight = plan.flights[0].clone();
        let told = to.call("sipp::route", || {
            sipp::route(&SCHEDULE, view, &route, any, [].iter(), &mut ws.sipp, &mut flight)
        });
        let there = usize::from(from.max(to_node)) < view.node_count();
        assert!(there || told == Err(ScheduleError::BadIndex));
        to.is(told.is_ok());
    }
}

fn detours(
    to: &mut Answers<'_, impl Listener>,
    view: &RoadmapView<'_>,
    ws: &mut SearchWorkspace<NODES>,
    own: &mut VehiclePlan<WAYPOINTS, GATES>,
) {
    let mut nodes: Vec<u16, WAYPOINTS> = Vec::new();
    let good = DetourRequest {
        aside: false,
        here: PLACES[0],
        leg: [PLACES[0], PLACES[4]],
        leg_clearance_m: 1.0,
        goal: 0,
        descent_m: 1.5,
        required_clearance_m: 0.8,
    };
    let natures = [Nature::Solid, Nature::Landing, Nature::Lying];
    let path = own.path.clone();
    let empty: Path<WAYPOINTS> = Path::new();
    for (i, p) in points().enumerate() {
        let hard = HARD[i % HARD.len()];
        let thing = KeepOff { from: p, to: PLACES[5], radius_m: hard, nature: natures[i % 3] };
        for request in [
            good,
            DetourRequest { aside: true, ..good },
            DetourRequest { here: p, ..good },
            DetourRequest { leg: [p, p], ..good },
            DetourRequest { descent_m: hard, leg_clearance_m: hard, ..good },
            DetourRequest { required_clearance_m: hard, ..good },
        ] {
            let bad = [
                to.call("detour::DetourRequest::check", || request.check()).is_err(),
                to.call("detour::KeepOff::check", || thing.check()).is_err(),
            ];
            let finite = |places: &[Point]| places.iter().flatten().all(|c| c.is_finite());
            assert!(finite(&[request.here, request.leg[0], request.leg[1]]) || bad[0]);
            assert!((finite(&[thing.from, thing.to]) && hard >= 0.0 && hard.is_finite()) != bad[1]);
            let told = to.call("detour::plan", || {
                detour::plan(view, &request, &mut [thing], ws, &mut nodes, &mut own.path)
            });
            assert_eq!(
                bad.contains(&true),
                matches!(told, Err(DetourError::Config(_))),
                "{request:?} {thing:?}"
            );
            assert!(
                told.is_err()
                    || own.path.waypoints().iter().all(|w| w.position.iter().all(|c| c.is_finite()))
            );
            to.is(told.is_ok());
            let again = to.call("detour::plan_vehicle", || {
                detour::plan_vehicle(view, &request, &mut [thing], ws, &mut nodes, own)
            });
            assert_eq!(again, told);
        }
        for goal in [2, 4, u16::MAX - 1, u16::MAX] {
            let request = DetourRequest { goal, ..good };
            assert!(detour::plan(view, &request, &mut [thing], ws, &mut nodes, &mut own.path).is_err());
        }
        let holds = to.call("detour::KeepOff::holds", || thing.holds(&PLACES[5]));
        assert!(!holds || hard > 0.0 || hard.is_nan());
        for path in [&path, &empty] {
            let blocked =
                to.call("detour::is_blocked", || detour::is_blocked(path, hard, p.x, p.y, &p, &thing));
            to.is(blocked);
            let count = to.call("detour::stretches_ahead", || detour::stretches_ahead(path, hard));
            assert!(count <= path.waypoints().len() + 2);
        }
    }
}
