//! The plan of a whole swarm: who flies to which goal, along which path, in which order.
//!
//! Every companion computes this for the whole swarm from the mission's starts and goals, never from live positions, so all
//! agree; the CRC of the plan is what they compare. P3D §3.3: one roadmap, a shortest path per vehicle (labelled) or the
//! assignment of least total length over all pairs (unlabelled); what the paper leaves out is the order at shared stretches,
//! which [`crate::schedule`] settles.
//!
//! Cost: one Dijkstra row per vehicle, one assignment, then at most (vehicles + 1) rounds of one to three A* and one pass
//! over all scheduled pieces per vehicle.

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::Vec;

use crate::Point;
use crate::assignment::{self, AssignmentError, AssignmentWorkspace};
use crate::path::{Path, PathError};
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::schedule::sipp::{self, Route, SippWorkspace};
use crate::schedule::{self, Flight, ScheduleConfig, ScheduleError, ScheduleWorkspace, VehiclePlan};
use crate::search::{self, SearchError, SearchWorkspace};

/// What an assignment makes small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The sum of all path lengths.
    TotalDistance,
    /// The longest path.
    Makespan,
}

/// How goals are given out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Every vehicle has its goal.
    Labelled,
    /// Any vehicle may take any goal.
    Unlabelled(Objective),
}

/// One vehicle of the request; vehicle `i` starts at node `i` of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleTask {
    /// MAVLink system id.
    pub id: u8,
    /// Radius + safety margin, metres: edges must have more clearance.
    pub required_clearance_m: f32,
    /// Height of the start above its pad, metres.
    pub climb_m: f32,
    /// Labelled: index of its goal.
    pub goal: Option<u16>,
}

/// A swarm's task.
#[derive(Clone, Copy, Debug)]
pub struct PlanRequest<'a> {
    /// The vehicles, in the order of the roadmap's starts.
    pub vehicles: &'a [VehicleTask],
    /// Height of each goal above the ground below it, metres; as many as the roadmap has goals.
    pub descents_m: &'a [f32],
    /// How goals are given out.
    pub mode: Mode,
    /// Separation and nominal speeds.
    pub schedule: ScheduleConfig,
}

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanError {
    /// The roadmap has other numbers of starts or goals than the request.
    Terminals,
    /// More vehicles or goals than `V`.
    SwarmFull,
    /// A labelled goal that is not in the roadmap, for the vehicle with this id.
    BadGoal(u8),
    /// A search failed for a reason other than "no path", for the vehicle with this id.
    Search(u8, SearchError),
    /// The costs could not be assigned.
    Assignment(AssignmentError),
    /// The path of the vehicle with this id was refused.
    Path(u8, PathError),
    /// The vehicle with this id cannot be scheduled among the others.
    Schedule(u8, ScheduleError),
}

/// The plan of a whole swarm: flight `i` is vehicle `i` of the request. A vehicle without a goal stays on its pad.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SwarmPlan<const V: usize, const W: usize> {
    /// One flight per vehicle.
    pub flights: Vec<Flight<W>, V>,
    /// CRC-32 over ids, goals, waypoints and departures.
    pub crc: u32,
}

impl<const V: usize, const W: usize> SwarmPlan<V, W> {
    /// Without vehicles.
    pub const fn new() -> Self {
        Self { flights: Vec::new(), crc: 0 }
    }

    /// Sum of the lengths of all paths, metres.
    pub fn total_m(&self) -> f64 {
        self.flights.iter().map(|f| f64::from(f.path.length_m())).sum()
    }
}

/// Scratch of [`plan_swarm`] for roadmaps of `N` nodes, swarms of `V` vehicles and goals, and `P` pieces of flights among
/// which one steps aside.
pub struct PlanWorkspace<const N: usize, const V: usize, const P: usize> {
    search: SearchWorkspace<N>,
    sipp: SippWorkspace<N, P>,
    assignment: AssignmentWorkspace<V>,
    costs: [[f32; V]; V],
    /// Scratch of the schedule, also for [`vehicle_plan`].
    pub schedule: ScheduleWorkspace,
}

impl<const N: usize, const V: usize, const P: usize> PlanWorkspace<N, V, P> {
    /// All zeros.
    pub const fn new() -> Self {
        Self {
            search: SearchWorkspace::new(),
            sipp: SippWorkspace::new(),
            assignment: AssignmentWorkspace::new(),
            costs: [[0.0; V]; V],
            schedule: ScheduleWorkspace::new(),
        }
    }
}

impl<const N: usize, const V: usize, const P: usize> Default for PlanWorkspace<N, V, P> {
    fn default() -> Self {
        Self::new()
    }
}

/// Plans the whole swarm. Vehicles and goals that cannot be served are left out, the rest is served as well as can be.
pub fn plan_swarm<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let (starts, goals) = (request.vehicles.len(), request.descents_m.len());
    let header = view.header();
    if usize::from(header.starts) != starts || usize::from(header.goals) != goals {
        return Err(PlanError::Terminals);
    }
    if starts > V || goals > V {
        return Err(PlanError::SwarmFull);
    }
    let mut assigned: Vec<Option<u16>, V> = Vec::new();
    assign(view, request, ws, &mut assigned)?;
    out.flights.clear();
    for (i, vehicle) in request.vehicles.iter().enumerate() {
        let mut path = Path::new();
        path.push(view.node(i as u16), 0.0).map_err(|e| PlanError::Path(vehicle.id, e))?;
        let descent_m = assigned[i].map_or(0.0, |goal| request.descents_m[usize::from(goal)]);
        let flight = Flight {
            id: vehicle.id,
            goal: assigned[i],
            path,
            climb_m: vehicle.climb_m,
            descent_m,
            depart_s: 0.0,
        };
        // Cannot overflow: `starts` is at most `V`.
        out.flights.push(flight).map_err(|_| PlanError::SwarmFull)?;
    }
    schedule_all(view, request, ws, out)?;
    out.crc = crc(out);
    Ok(())
}

/// What the companion of flight `index` needs of the swarm's plan.
pub fn vehicle_plan<const V: usize, const W: usize, const G: usize>(
    plan: &SwarmPlan<V, W>,
    index: usize,
    cfg: &ScheduleConfig,
    ws: &mut ScheduleWorkspace,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), ScheduleError> {
    let flight = &plan.flights[index];
    out.goal = flight.goal;
    out.path = flight.path.clone();
    out.climb_m = flight.climb_m;
    out.descent_m = flight.descent_m;
    out.plan_crc = plan.crc;
    let others = plan.flights.iter().enumerate().filter(|&(i, _)| i != index).map(|(_, f)| f);
    schedule::gates(cfg, flight, others, ws, &mut out.gates)
}

fn assign<const N: usize, const V: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    assigned: &mut Vec<Option<u16>, V>,
) -> Result<(), PlanError> {
    let (starts, goals) = (request.vehicles.len(), request.descents_m.len());
    let mut targets: Vec<u16, V> = Vec::new();
    // Cannot overflow: `goals` is at most `V`.
    let _ = targets.extend_from_slice(&[0; V][..goals]);
    for (g, target) in targets.iter_mut().enumerate() {
        *target = (starts + g) as u16;
    }
    let _ = assigned.resize(starts, None);
    for (i, vehicle) in request.vehicles.iter().enumerate() {
        let row = &mut ws.costs[i][..goals];
        let passable = |_: u16, edge: &HalfEdge| view.clears(edge, vehicle.required_clearance_m);
        search::dijkstra_row(view, i as u16, &targets, passable, &mut ws.search, row)
            .map_err(|e| PlanError::Search(vehicle.id, e))?;
        if request.mode == Mode::Labelled {
            let Some(goal) = vehicle.goal else { continue };
            let cost = row.get(usize::from(goal)).ok_or(PlanError::BadGoal(vehicle.id))?;
            assigned[i] = cost.is_finite().then_some(goal);
        }
    }
    let Mode::Unlabelled(objective) = request.mode else { return Ok(()) };
    // Pack the rows: the assignment reads a dense matrix.
    let costs = ws.costs.as_flattened_mut();
    for i in 0..starts {
        costs.copy_within(i * V..i * V + goals, i * goals);
    }
    let costs = &costs[..starts * goals];
    let solve = match objective {
        Objective::TotalDistance => assignment::assign,
        Objective::Makespan => assignment::bottleneck,
    };
    solve(costs, starts, goals, &mut ws.assignment, assigned).map_err(PlanError::Assignment)?;
    Ok(())
}

/// Schedules the longest path first; who cannot be fitted in goes first in the next round, or later gets a head start.
fn schedule_all<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let mut order: Vec<u16, V> = Vec::new();
    let mut straight: Vec<f32, V> = Vec::new();
    for (i, flight) in out.flights.iter().enumerate() {
        let mut nodes: Vec<u16, W> = Vec::new();
        let length = match flight.goal {
            Some(goal) => {
                let parked = Parked::<V>::new(view, Avoid::Nothing, &out.flights, &[], i);
                find_path(view, request, i, goal, &parked, &mut ws.search, &mut nodes)?
            }
            None => f32::INFINITY,
        };
        // Cannot overflow: one entry per flight.
        let _ = (order.push(i as u16), straight.push(length));
    }
    // Who stays on its pad comes first: it is in everybody's way. Then the longest; ties go to the higher id (P3D §3.4).
    order.sort_unstable_by(|&a, &b| {
        let (a, b) = (usize::from(a), usize::from(b));
        straight[b].total_cmp(&straight[a]).then(out.flights[b].id.cmp(&out.flights[a].id))
    });
    let mut failed = Ok(());
    let mut rush = Rush { count: 0, head_start_s: 0.0 };
    let reorderings = order.len().min(REORDERINGS);
    for round in 0..=reorderings + HEAD_STARTS {
        let Err((place, error)) = schedule_round(view, request, &order, &rush, ws, out) else {
            return Ok(());
        };
        failed = Err(error);
        let blocked = order.remove(place);
        // Cannot overflow: one was just removed.
        if round < reorderings {
            let front = order.iter().take_while(|&&i| out.flights[usize::from(i)].goal.is_none()).count();
            let _ = order.insert(front, blocked);
        } else {
            rush.count = rush.count.max(order.len() + 1 - place);
            rush.head_start_s += HEAD_START_S;
            let _ = order.push(blocked);
        }
    }
    failed
}

/// Rounds in which who cannot be fitted in goes first, before others are held back for it instead.
const REORDERINGS: usize = 16;
/// Rounds in which others are held back, each by [`HEAD_START_S`] more.
const HEAD_STARTS: usize = 8;
/// What two vehicles head-on need to clear a side room, seconds.
const HEAD_START_S: f32 = 3.0;

/// The last `count` in the order may leave at once, all others only after a head start.
struct Rush {
    count: usize,
    head_start_s: f32,
}

fn schedule_round<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    order: &[u16],
    rush: &Rush,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), (usize, PlanError)> {
    for (place, &index) in order.iter().enumerate() {
        let index = usize::from(index);
        if out.flights[index].goal.is_none() {
            continue;
        }
        let (before, waiting) = (&order[..place], &order[place + 1..]);
        let not_before_s = if place + rush.count < order.len() { rush.head_start_s } else { 0.0 };
        let waits = wait_on_pad(view, request, index, before, waiting, not_before_s, ws, out);
        let flight = match waits.map_err(|error| (place, error))? {
            Some(flight) => flight,
            None => step_aside(view, request, index, before, waiting, not_before_s, ws, out)
                .map_err(|error| (place, PlanError::Schedule(out.flights[index].id, error)))?,
        };
        out.flights[index] = flight;
    }
    Ok(())
}

/// The flight along a shortest path, after a wait on the pad; `None` if no wait is long enough.
#[expect(clippy::too_many_arguments, reason = "the state of one round")]
fn wait_on_pad<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    index: usize,
    before: &[u16],
    waiting: &[u16],
    not_before_s: f32,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &SwarmPlan<V, W>,
) -> Result<Option<Flight<W>>, PlanError> {
    let flight = &out.flights[index];
    let Some(goal) = flight.goal else { return Ok(None) };
    for avoid in [Avoid::WaitingPads, Avoid::AllPlaces, Avoid::Nothing] {
        let parked = Parked::<V>::new(view, avoid, &out.flights, waiting, index);
        let mut nodes: Vec<u16, W> = Vec::new();
        if find_path(view, request, index, goal, &parked, &mut ws.search, &mut nodes)?.is_infinite() {
            continue;
        }
        let mut path = path_of(view, &nodes).map_err(|e| PlanError::Path(flight.id, e))?;
        path.label(flight.climb_m / request.schedule.vertical_mps, request.schedule.cruise_mps);
        let flight = Flight { path, depart_s: 0.0, ..flight.clone() };
        let scheduled = before.iter().map(|&i| &out.flights[usize::from(i)]);
        let cfg = &request.schedule;
        match schedule::earliest_departure(cfg, &flight, not_before_s, scheduled, &mut ws.schedule) {
            Ok(depart_s) => return Ok(Some(Flight { depart_s, ..flight })),
            Err(ScheduleError::Blocked) => {}
            Err(error) => return Err(PlanError::Schedule(flight.id, error)),
        }
    }
    Ok(None)
}

/// The flight that arrives earliest, waiting and stepping aside on its way.
#[expect(clippy::too_many_arguments, reason = "the state of one round")]
fn step_aside<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    index: usize,
    before: &[u16],
    waiting: &[u16],
    not_before_s: f32,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &SwarmPlan<V, W>,
) -> Result<Flight<W>, ScheduleError> {
    let mut flight = out.flights[index].clone();
    let Some(goal) = flight.goal else { return Ok(flight) };
    let required_m = request.vehicles[index].required_clearance_m;
    let passable = |_: u16, edge: &HalfEdge| view.clears(edge, required_m);
    let mut found = Err(ScheduleError::Blocked);
    for avoid in [Avoid::WaitingPads, Avoid::Nothing] {
        let parked = Parked::<V>::new(view, avoid, &out.flights, waiting, index);
        let route = Route {
            from: index as u16,
            to: request.vehicles.len() as u16 + goal,
            not_before_s,
            parked: &parked.pads,
        };
        let scheduled = before.iter().map(|&i| &out.flights[usize::from(i)]);
        found = sipp::route(&request.schedule, view, &route, passable, scheduled, &mut ws.sipp, &mut flight);
        if found != Err(ScheduleError::Blocked) {
            break;
        }
    }
    found.map(|()| flight)
}

/// What a path keeps clear of beyond obstacles.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Avoid {
    /// The pads of vehicles that may still stand there.
    WaitingPads,
    /// The pads and landing places of all others: then waiting on the pad is always enough.
    AllPlaces,
    /// Nothing: somebody has to leave before.
    Nothing,
}

/// Points on the ground where other vehicles stand, before and after their flights.
struct Parked<const V: usize> {
    pads: Vec<Point, V>,
    landed: Vec<Point, V>,
}

impl<const V: usize> Parked<V> {
    fn new<const W: usize>(
        view: &RoadmapView<'_>,
        avoid: Avoid,
        flights: &[Flight<W>],
        waiting: &[u16],
        index: usize,
    ) -> Self {
        let mut parked = Self { pads: Vec::new(), landed: Vec::new() };
        let below = |node: usize, height: f32| view.node(node as u16) - Point::new(0.0, 0.0, height);
        for (j, flight) in flights.iter().enumerate().filter(|&(j, _)| j != index && avoid != Avoid::Nothing)
        {
            // Cannot overflow: at most one entry of each kind per flight.
            if avoid == Avoid::AllPlaces || flight.goal.is_none() || waiting.contains(&(j as u16)) {
                let _ = parked.pads.push(below(j, flight.climb_m));
            }
            if let (Avoid::AllPlaces, Some(goal)) = (avoid, flight.goal) {
                let _ = parked.landed.push(below(flights.len() + usize::from(goal), flight.descent_m));
            }
        }
        parked
    }

    fn clears(&self, a: &Point, b: &Point, distance_m: f32) -> bool {
        let along = b - a;
        let near = |p: &Point| {
            let share = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (a + along * share - p).norm_squared() < distance_m * distance_m
        };
        !self.pads.iter().chain(&self.landed).any(near)
    }
}

/// The shortest path from start `index` to `goal` for that vehicle, clear of `parked`; infinite without one.
fn find_path<const N: usize, const V: usize, const W: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    index: usize,
    goal: u16,
    parked: &Parked<V>,
    search: &mut SearchWorkspace<N>,
    nodes: &mut Vec<u16, W>,
) -> Result<f32, PlanError> {
    let vehicle = &request.vehicles[index];
    let passable = |from: u16, edge: &HalfEdge| {
        view.clears(edge, vehicle.required_clearance_m)
            && parked.clears(&view.node(from), &view.node(edge.target), request.schedule.parked_separation_m)
    };
    let target = request.vehicles.len() as u16 + goal;
    match search::astar(view, index as u16, target, passable, search, nodes) {
        Ok(length_m) => Ok(length_m),
        Err(SearchError::NoPath) => Ok(f32::INFINITY),
        Err(error) => Err(PlanError::Search(vehicle.id, error)),
    }
}

fn path_of<const W: usize>(view: &RoadmapView<'_>, nodes: &[u16]) -> Result<Path<W>, PathError> {
    let mut path = Path::new();
    for (i, &node) in nodes.iter().enumerate() {
        let edge = i.checked_sub(1).and_then(|before| view.edge_between(nodes[before], node));
        // The first waypoint ends no leg.
        let clearance_m = edge.map_or(view.header().max_clearance_m, |e| e.clearance_m);
        path.push(view.node(node), clearance_m)?;
    }
    Ok(path)
}

fn crc<const V: usize, const W: usize>(plan: &SwarmPlan<V, W>) -> u32 {
    const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let mut digest = CRC32.digest();
    for flight in &plan.flights {
        digest.update(&[flight.id]);
        digest.update(&flight.goal.unwrap_or(u16::MAX).to_le_bytes());
        digest.update(&flight.depart_s.to_le_bytes());
        for waypoint in flight.path.waypoints() {
            waypoint.position.iter().for_each(|c| digest.update(&c.to_le_bytes()));
            digest.update(&waypoint.leave_s.to_le_bytes());
        }
    }
    digest.finalize()
}

#[cfg(test)]
mod tests;
