//! Prioritised planning: one vehicle after the other gets its path and its times in the schedule.
//!
//! Each vehicle keeps clear of those planned before it: by the shortest path and a wait on the pad
//! if that is enough, else by waiting and stepping aside in flight ([`sipp`]). A vehicle for which
//! no times are found is moved to the front in the next round. When that does not help, vehicles
//! planned before it take off later, to give it a head start. If this fails too, all is tried again
//! with the vehicles of the shortest paths first. The number of rounds is bounded.

use heapless::Vec;
use libm::fmaxf;

use super::request::{PlanError, PlanRequest, VehicleTask};
use super::workspace::{PlanWorkspace, SwarmPlan};
use crate::Point;
use crate::flight::{Flight, Path, PathError};
use crate::roadmap::search::{self, SearchError, SearchWorkspace};
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::schedule::sipp::{self, RouteQuery};
use crate::schedule::{self, DEFAULT_MAX_SEGMENT_M, MAX_TIMED_SEGMENTS, ScheduleError};
use crate::sort;

/// Schedules all flights, those with the longest path first; if that fails, those with the shortest
/// path first. The schedule lets a vehicle be at a place `handover_s` after another one has left
/// it.
pub(super) fn schedule_all<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    handover_s: f32,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let mut order: Vec<u16, V> = Vec::new();
    let mut shortest_m: Vec<f32, V> = Vec::new();
    for (i, flight) in out.flights.iter().enumerate() {
        let mut nodes: Vec<u16, W> = Vec::new();
        let length = match flight.task.goal() {
            Some(goal) => {
                let parked =
                    ParkedVehicles::<V>::new(view, AvoidedParking::Nothing, &out.flights, &[], i);
                let ends = PathEnds::new(request, i, goal);
                find_path(view, request, &ends, &parked, &mut ws.search, &mut nodes)?
            }
            None => f32::INFINITY,
        };
        // Cannot overflow: each has one entry per flight.
        let _ = (order.push(i as u16), shortest_m.push(length));
    }
    let mut failed = Ok(());
    for first in [InitialOrder::LongestFirst, InitialOrder::ShortestFirst] {
        // Vehicles that stay on their pads come first, since they block all others. Among equal
        // lengths the higher id is first (paper P3D §3.4).
        sort::heapsort_by(&mut order, |&a, &b| {
            let (a, b) = (usize::from(a), usize::from(b));
            let (goals, ids) = (
                [a, b].map(|i| out.flights[i].task.leaves_pad()),
                (out.flights[b].vehicle_id, out.flights[a].vehicle_id),
            );
            let longer = shortest_m[b].total_cmp(&shortest_m[a]);
            let longer =
                if first == InitialOrder::LongestFirst { longer } else { longer.reverse() };
            goals[0].cmp(&goals[1]).then(longer).then(ids.0.cmp(&ids.1))
        });
        let head_start = HeadStart { early_vehicles: 0, head_start_s: 0.0, handover_s };
        failed = schedule_with_reordering(view, request, (&mut order, head_start), ws, out);
        if failed.is_ok() {
            break;
        }
    }
    failed
}

/// Order in which vehicles are scheduled in the first round, by the lengths of their paths.
#[derive(Clone, Copy, PartialEq, Eq)]
enum InitialOrder {
    LongestFirst,
    ShortestFirst,
}

/// Schedules in this order. In the next round a vehicle for which no times were found is moved to
/// the front; after [`MAX_REORDERINGS`] such rounds, or as many as there are vehicles, it is moved
/// to the end, and gets a head start together with those that were behind it in the order.
fn schedule_with_reordering<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    (order, mut head_start): (&mut Vec<u16, V>, HeadStart),
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let mut failed = Ok(());
    let reorderings = order.len().min(MAX_REORDERINGS);
    for round in 0..=reorderings + MAX_HEAD_START_ROUNDS {
        let Err((place, error)) = schedule_round(view, request, order, &head_start, ws, out) else {
            return shorten_hovers(view, request, (order, &head_start), ws, out);
        };
        failed = Err(error);
        if round < reorderings {
            move_to_front(order, place, &out.flights);
        } else {
            head_start.early_vehicles = head_start.early_vehicles.max(order.len() - place);
            head_start.head_start_s += HEAD_START_STEP_S;
            order[place..].rotate_left(1);
        }
    }
    failed
}

/// Moves the vehicle at `place` of the order to the front, behind those that stay on their pads.
fn move_to_front<const W: usize>(order: &mut [u16], place: usize, flights: &[Flight<W>]) {
    let stays = |&&i: &&u16| !flights[usize::from(i)].task.leaves_pad();
    let front = order.iter().take_while(stays).count();
    order[front..=place].rotate_right(1);
}

/// Schedules in other orders while a vehicle would hover at one place for longer than
/// [`MAX_ACCEPTED_HOVER_S`]. An order is kept only if it at least halves the longest hover, since
/// in exchange the other vehicles wait longer on their pads, and the last one may land later.
///
/// Such a vehicle has to leave its pad because one that was scheduled before it lands there, but
/// its own goal, or the way to the goal, is free only much later. In the next round it is moved to
/// the front, so that the others wait on their pads for it. A vehicle for which no times are found
/// in that round is moved to the front next.
fn shorten_hovers<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    (order, head_start): (&mut Vec<u16, V>, &HeadStart),
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let (mut hovering, mut shortest_s) = longest_hover_s(out);
    let mut best = order.clone();
    let mut has_best = true;
    for _ in 0..MAX_HOVER_REORDERINGS {
        if shortest_s <= MAX_ACCEPTED_HOVER_S {
            break;
        }
        // Cannot fail: the order has every vehicle.
        let place = order.iter().position(|&i| usize::from(i) == hovering).unwrap_or(0);
        move_to_front(order, place, &out.flights);
        has_best = false;
        match schedule_round(view, request, order, head_start, ws, out) {
            Err((blocked, PlanError::Schedule(_, ScheduleError::Blocked))) => {
                hovering = usize::from(order[blocked]);
            }
            // The workspace is too small for this order, as may happen on a board: no further order
            // is tried.
            Err(_) => break,
            Ok(()) => {
                let (vehicle, hover_s) = longest_hover_s(out);
                hovering = vehicle;
                if hover_s <= KEPT_HOVER_SHARE * shortest_s {
                    (shortest_s, has_best) = (hover_s, true);
                    best.clone_from(order);
                }
            }
        }
    }
    if has_best {
        return Ok(());
    }
    schedule_round(view, request, &best, head_start, ws, out).map_err(|(_, error)| error)
}

/// Index of the vehicle that hovers longest at one waypoint, and for how long, seconds.
fn longest_hover_s<const V: usize, const W: usize>(out: &SwarmPlan<V, W>) -> (usize, f32) {
    let hovers = out.flights.iter().map(|flight| longest_and_total_wait_s(flight).0).enumerate();
    hovers.fold((0, 0.0), |longest, hover| if hover.1 > longest.1 { hover } else { longest })
}

/// Longest hover at one place for which no other order is tried, seconds: less than what counts as
/// a standstill (20 s), since the vehicle that is waited for may be late.
const MAX_ACCEPTED_HOVER_S: f32 = 15.0;
/// Another order is kept if its longest hover is at most this share of that of the best order so
/// far.
const KEPT_HOVER_SHARE: f32 = 0.5;
/// Most other orders that are tried for shorter hovers. Twice as many would help few more swarms.
const MAX_HOVER_REORDERINGS: usize = 8;

/// Most rounds after which a vehicle for which no times were found is moved to the front; in later
/// rounds the others depart later instead. Also at most the number of vehicles. So many rounds are
/// needed where many swap places in a crowd: nearly every vehicle has to leave its place before
/// another one comes.
const MAX_REORDERINGS: usize = 64;
/// Most rounds in which the vehicles without a head start depart later, each time by
/// [`HEAD_START_STEP_S`] more.
const MAX_HEAD_START_ROUNDS: usize = 8;
/// Time in which one of two vehicles that meet head-on can step aside into a side room, seconds.
const HEAD_START_STEP_S: f32 = 3.0;

/// Head start: the last `early_vehicles` in the order may take off at once, all others no earlier
/// than `head_start_s` seconds after the mission's start.
struct HeadStart {
    /// Number of vehicles at the end of the order that need not wait for the head start.
    early_vehicles: usize,
    /// Earliest take-off of all other vehicles, seconds after the mission's start.
    head_start_s: f32,
    /// Time from when a vehicle has left a place until another one may be there, seconds.
    handover_s: f32,
}

/// The vehicle to be scheduled next, and those before and after it.
struct SchedulingTurn<'a> {
    /// Index of the vehicle in the request.
    vehicle_index: usize,
    /// Indices of the vehicles that are scheduled already.
    before: &'a [u16],
    /// Indices of the vehicles that are still to be scheduled.
    waiting: &'a [u16],
    /// Earliest take-off of this vehicle, seconds after the mission's start.
    not_before_s: f32,
    /// Time from when a vehicle has left a place until another one may be there, seconds.
    handover_s: f32,
}

/// Schedules all vehicles in this order. The error has the place in `order`, from 0, of the vehicle
/// for which it failed.
fn schedule_round<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    order: &[u16],
    head_start: &HeadStart,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), (usize, PlanError)> {
    for (place, &index) in order.iter().enumerate() {
        let index = usize::from(index);
        if !out.flights[index].task.leaves_pad() {
            continue;
        }
        let (before, waiting) = (&order[..place], &order[place + 1..]);
        let not_before_s = if place + head_start.early_vehicles < order.len() {
            head_start.head_start_s
        } else {
            0.0
        };
        let turn = SchedulingTurn {
            vehicle_index: index,
            before,
            waiting,
            not_before_s,
            handover_s: head_start.handover_s,
        };
        let waits = plan_with_pad_wait(view, request, &turn, ws, out);
        let flight = match waits.map_err(|error| (place, error))? {
            Some(flight) => flight,
            None => plan_with_path_waits(view, request, &turn, ws, out).map_err(|error| {
                (place, PlanError::Schedule(out.flights[index].vehicle_id, error))
            })?,
        };
        out.flights[index] = flight;
    }
    Ok(())
}

/// The vehicle's flight on a shortest path after the shortest wait on its pad that avoids
/// conflicts. Paths clear of parked vehicles are tried first. `None` if there is no path, or no
/// wait on the pad avoids all conflicts.
fn plan_with_pad_wait<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    turn: &SchedulingTurn<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &SwarmPlan<V, W>,
) -> Result<Option<Flight<W>>, PlanError> {
    let &SchedulingTurn { vehicle_index: index, before, waiting, not_before_s, handover_s } = turn;
    let flight = &out.flights[index];
    let Some(goal) = flight.task.goal() else { return Ok(None) };
    let ends = PathEnds::new(request, index, goal);
    for avoid in [AvoidedParking::WaitingPads, AvoidedParking::AllPlaces, AvoidedParking::Nothing] {
        let parked = ParkedVehicles::<V>::new(view, avoid, &out.flights, waiting, index);
        let mut nodes: Vec<u16, W> = Vec::new();
        if find_path(view, request, &ends, &parked, &mut ws.search, &mut nodes)?.is_infinite() {
            continue;
        }
        let mut path =
            path_from_nodes(view, &nodes).map_err(|e| PlanError::Path(flight.vehicle_id, e))?;
        path.set_times_at_speed(
            flight.climb_m / request.schedule.vertical_mps,
            request.schedule.cruise_mps,
        );
        let mut flight = Flight { path, depart_s: 0.0, ..flight.clone() };
        flight.choose_segment_length();
        let scheduled = before.iter().map(|&i| &out.flights[usize::from(i)]);
        let cfg = &request.schedule;
        let from_s = (not_before_s, handover_s);
        match schedule::departure_with_handover(cfg, &flight, from_s, scheduled, &mut ws.schedule) {
            Ok(depart_s) => return Ok(Some(Flight { depart_s, ..flight })),
            Err(ScheduleError::Blocked) => {}
            Err(error) => return Err(PlanError::Schedule(flight.vehicle_id, error)),
        }
    }
    Ok(None)
}

/// The vehicle's flight on a route searched with waits and sidesteps, if possible clear of the pads
/// of waiting vehicles. The flight that arrives earliest may take off only to wait long in the air.
/// Then later take-offs are tried, until no wait is longer than [`MAX_ACCEPTED_WAIT_S`], with at
/// most [`MAX_DEPARTURE_TRIES`] searches for each choice of pads to keep clear of; the flight whose
/// longest wait is shortest is returned.
fn plan_with_path_waits<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    turn: &SchedulingTurn<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &SwarmPlan<V, W>,
) -> Result<Flight<W>, ScheduleError> {
    let &SchedulingTurn { vehicle_index: index, before, waiting, not_before_s, handover_s } = turn;
    let mut flight = out.flights[index].clone();
    let Some(goal) = flight.task.goal() else { return Ok(flight) };
    let PathEnds { from, to, vehicle } = PathEnds::new(request, index, goal);
    let passable = |_: u16, edge: &HalfEdge| view.has_clearance(edge, vehicle.required_clearance_m);
    for avoid in [AvoidedParking::WaitingPads, AvoidedParking::Nothing] {
        let parked = ParkedVehicles::<V>::new(view, avoid, &out.flights, waiting, index);
        let cfg = &request.schedule;
        let mut route =
            RouteQuery { cfg, from, to, not_before_s, parked: &parked.before_flight, handover_s };
        let mut best: Option<Flight<W>> = None;
        flight.max_segment_m = DEFAULT_MAX_SEGMENT_M;
        for _ in 0..MAX_DEPARTURE_TRIES {
            let scheduled = before.iter().map(|&i| &out.flights[usize::from(i)]);
            match sipp::find_route(view, &route, passable, scheduled, &mut ws.sipp, &mut flight) {
                // Searched again with the longer timed segments that the flight needs.
                Ok(()) if flight.segment_count() > MAX_TIMED_SEGMENTS => {
                    flight.choose_segment_length();
                    continue;
                }
                Ok(()) => {}
                Err(ScheduleError::Blocked) => break,
                Err(error) => return Err(error),
            }
            let (longest_s, all_s) = longest_and_total_wait_s(&flight);
            if best.as_ref().is_none_or(|best| longest_s < longest_and_total_wait_s(best).0) {
                best = Some(flight.clone());
            }
            if longest_s <= MAX_ACCEPTED_WAIT_S {
                break;
            }
            route.not_before_s = flight.depart_s + all_s;
        }
        if let Some(best) = best {
            return Ok(best);
        }
    }
    Err(ScheduleError::Blocked)
}

/// Most searches for one vehicle with the same pads to keep clear of: one for each take-off time
/// that is tried, and one for each change to longer timed segments.
const MAX_DEPARTURE_TRIES: usize = 6;
/// Longest wait in the air at one place that the planner accepts without trying a later take-off,
/// seconds: a quarter of what counts as a standstill (20 s), since the vehicle that is waited for
/// may be late.
const MAX_ACCEPTED_WAIT_S: f32 = 5.0;

/// The longest wait of a flight at a waypoint, and the sum of all its waits there, seconds.
fn longest_and_total_wait_s<const W: usize>(flight: &Flight<W>) -> (f32, f32) {
    let waits = flight.path.waypoints().iter().map(|w| w.leave_s - w.arrive_s);
    waits.fold((0.0, 0.0), |(longest, all), wait| (fmaxf(longest, wait), all + wait))
}

/// Parked vehicles that a path keeps clear of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum AvoidedParking {
    /// The pads of vehicles that stay, or that are not scheduled yet and so may still be there.
    WaitingPads,
    /// The pads and landing places of all other vehicles: then waiting on the pad is always enough.
    AllPlaces,
    /// No parked vehicle: the times have to let one whose pad is on the path leave first, and one
    /// whose landing place is on it land afterwards.
    Nothing,
}

/// Points on the ground where other vehicles are parked, before and after their flights.
struct ParkedVehicles<const V: usize> {
    /// Pads of other vehicles.
    before_flight: Vec<Point, V>,
    /// Landing places of other vehicles.
    after_flight: Vec<Point, V>,
}

impl<const V: usize> ParkedVehicles<V> {
    fn new<const W: usize>(
        view: &RoadmapView<'_>,
        avoid: AvoidedParking,
        flights: &[Flight<W>],
        waiting: &[u16],
        index: usize,
    ) -> Self {
        let mut parked = Self { before_flight: Vec::new(), after_flight: Vec::new() };
        let below =
            |node: usize, height: f32| view.node(node as u16) - Point::new(0.0, 0.0, height);
        for (j, flight) in flights
            .iter()
            .enumerate()
            .filter(|&(j, _)| j != index && avoid != AvoidedParking::Nothing)
        {
            // Cannot overflow: at most one entry of each kind per flight.
            if avoid == AvoidedParking::AllPlaces
                || !flight.task.leaves_pad()
                || waiting.contains(&(j as u16))
            {
                let _ = parked.before_flight.push(below(j, flight.climb_m));
            }
            if let (AvoidedParking::AllPlaces, Some(goal)) = (avoid, flight.task.goal()) {
                let _ = parked
                    .after_flight
                    .push(below(flights.len() + usize::from(goal), flight.descent_m));
            }
        }
        parked
    }

    /// Whether the segment from `a` to `b` keeps at least `distance_m` from all parked vehicles.
    fn is_segment_clear(&self, a: &Point, b: &Point, distance_m: f32) -> bool {
        let along = b - a;
        let near = |p: &Point| {
            let share = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (a + along * share - p).norm_squared() < distance_m * distance_m
        };
        !self.before_flight.iter().chain(&self.after_flight).any(near)
    }
}

/// The vehicle that a path is for, and the roadmap nodes of its start and its goal.
struct PathEnds<'a> {
    vehicle: &'a VehicleTask,
    /// Index of the start's node.
    from: u16,
    /// Index of the goal's node.
    to: u16,
}

impl<'a> PathEnds<'a> {
    fn new(request: &PlanRequest<'a>, index: usize, goal: u16) -> Self {
        let vehicles = request.vehicles;
        Self { vehicle: &vehicles[index], from: index as u16, to: vehicles.len() as u16 + goal }
    }
}

/// Finds the shortest path for the vehicle between its ends that keeps `parked_separation_m` from
/// the `parked` vehicles. Returns its length in metres, infinite if there is none.
fn find_path<const N: usize, const V: usize, const W: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ends: &PathEnds<'_>,
    parked: &ParkedVehicles<V>,
    search: &mut SearchWorkspace<N>,
    nodes: &mut Vec<u16, W>,
) -> Result<f32, PlanError> {
    let passable = |from: u16, edge: &HalfEdge| {
        view.has_clearance(edge, ends.vehicle.required_clearance_m)
            && parked.is_segment_clear(
                &view.node(from),
                &view.node(edge.target),
                request.schedule.parked_separation_m,
            )
    };
    match search::astar(view, ends.from, ends.to, passable, search, nodes) {
        Ok(length_m) => Ok(length_m),
        Err(SearchError::NoPath) => Ok(f32::INFINITY),
        Err(error) => Err(PlanError::Search(ends.vehicle.id, error)),
    }
}

/// The path along these nodes, with the clearances of the edges between them.
fn path_from_nodes<const W: usize>(
    view: &RoadmapView<'_>,
    nodes: &[u16],
) -> Result<Path<W>, PathError> {
    let mut path = Path::new();
    for (i, &node) in nodes.iter().enumerate() {
        let edge = i.checked_sub(1).and_then(|before| view.edge_between(nodes[before], node));
        // No leg ends at the first waypoint.
        let clearance_m = edge.map_or(view.header().max_clearance_m, |e| e.clearance_m);
        path.push(view.node(node), clearance_m)?;
    }
    Ok(path)
}
