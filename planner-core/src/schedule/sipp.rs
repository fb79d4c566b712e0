//! Safe-interval path planning on the roadmap (Phillips and Likhachev 2011): the route of earliest
//! arrival past flights that are already scheduled, with waits and sidesteps at nodes. The route's
//! departures are as late as that arrival allows.
//!
//! Each node has *safe intervals*: times in which a vehicle that hovers there is in no conflict
//! with a scheduled timed segment. A search state is a node with one of its intervals. Reaching a
//! state earlier is never worse, so A* over the states finds the earliest arrival. An edge may be
//! flown at departures outside the intervals that the timed segments near the edge forbid.
//!
//! Cost: states reached × their edges × scheduled segments, most of which a cheap bound rules out.
//! When the memory for states is full, the search may miss a route that exists.

use heapless::Vec;
use libm::{fmaxf, fminf};

use super::config::{ScheduleConfig, ScheduleError};
use super::near::SegmentGrid;
use super::timed_segments::{
    DEFAULT_MAX_SEGMENT_M, Leg, MAX_TIMED_SEGMENTS, MIN_PAD_HOLD_S, TimedSegment,
    cut_into_segments, is_conflict, leg_at_time_zero, leg_segment_count, parked_segment,
};
use super::{ForbiddenIntervals, add_forbidden_interval, first_allowed_departure};
use crate::flight::{Flight, Path};
use crate::roadmap::search::heap::{Heap, SETTLED};
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::sort;
use crate::{Length, Point};

/// A search state: one node in one of its safe intervals. Times are after the mission's start.
#[derive(Clone, Copy)]
struct SippState {
    node: u16,
    /// Index plus one of the next state of the same node; 0 ends the list.
    next_of_node: u16,
    /// Index of the state from which this one is reached; its own index if it is reached by the
    /// climb from the pad.
    parent: u16,
    /// Time at which the vehicle leaves the parent's node (the first state: the pad), seconds.
    left_parent_s: f32,
    /// Earliest arrival, seconds; infinite while the state is not reached.
    arrive_s: f32,
    /// End of the safe interval, seconds.
    safe_until_s: f32,
    /// Start of the safe interval, seconds.
    safe_from_s: f32,
}

const NO_STATE: SippState = SippState {
    node: 0,
    next_of_node: 0,
    parent: 0,
    left_parent_s: 0.0,
    arrive_s: 0.0,
    safe_until_s: 0.0,
    safe_from_s: 0.0,
};

/// Memory for roadmaps of up to `N` nodes, `N` states, and `P` timed segments of scheduled flights.
/// All zero when new.
pub struct SippWorkspace<const N: usize, const P: usize> {
    /// The scheduled timed segments, with times after the mission's start; sorted by the cells of
    /// `cells`.
    segments: Vec<TimedSegment, P>,
    cells: SegmentGrid,
    states: [SippState; N],
    state_count: usize,
    /// Index plus one of each node's first state; 0 if its states have not been made.
    first_state: [u16; N],
    /// Indices of reached states, by arrival plus the heuristic.
    heap: Heap<N>,
    /// Timed segments of the scheduled flight that is being loaded.
    cut_segments: Vec<TimedSegment, MAX_TIMED_SEGMENTS>,
    /// Departures forbidden on the leg that is being examined.
    forbidden: ForbiddenIntervals,
    /// Time from when another vehicle has left a place until this route may use it, seconds.
    handover_s: f32,
}

impl<const N: usize, const P: usize> SippWorkspace<N, P> {
    /// Creates an empty workspace: all zeros.
    pub const fn new() -> Self {
        Self {
            segments: Vec::new(),
            cells: SegmentGrid::new(),
            states: [NO_STATE; N],
            state_count: 0,
            first_state: [0; N],
            heap: Heap::new(),
            cut_segments: Vec::new(),
            forbidden: Vec::new(),
            handover_s: 0.0,
        }
    }
}

impl<const N: usize, const P: usize> Default for SippWorkspace<N, P> {
    fn default() -> Self {
        Self::new()
    }
}

/// The route to find: ends, earliest take-off and what to keep clear of.
#[derive(Clone, Copy, Debug)]
pub struct RouteQuery<'a> {
    /// Separation and nominal speeds.
    pub cfg: &'a ScheduleConfig,
    /// Node above the vehicle's pad.
    pub from: u16,
    /// Node of the vehicle's goal.
    pub to: u16,
    /// Earliest take-off, seconds after the mission's start.
    pub not_before_s: f32,
    /// Points at which other vehicles are parked at all times.
    pub parked: &'a [Point],
    /// Time from when a vehicle has left a place until another one may be there, seconds.
    pub handover_s: f32,
}

/// The climb from the pad to the first node.
struct Climb {
    up: Leg,
    /// Latest take-off, seconds: after it, another vehicle needs the space of the pad.
    latest_take_off_s: f32,
}

/// The descent from the goal's node to the ground.
struct Landing {
    down: Leg,
    /// Time from which no other vehicle needs the landing place, seconds.
    free_from_s: f32,
}

/// A flight from one state, or from the pad, to another node.
struct StateTransition {
    to_node: u16,
    /// Index of the state from which it starts; `None` from the pad.
    parent: Option<u16>,
    /// First and last time of departure, seconds.
    leave_s: (f32, f32),
    duration_s: f32,
}

/// Finds the route of earliest arrival that is in no conflict with the flights `scheduled`. Reads
/// climb, descent and segment length of `flight`; writes its path and its take-off time.
pub fn find_route<'a, const N: usize, const P: usize, const W: usize>(
    view: &RoadmapView<'_>,
    route: &RouteQuery<'_>,
    passable: impl Fn(u16, &HalfEdge) -> bool,
    scheduled: impl Iterator<Item = &'a Flight<W>>,
    ws: &mut SippWorkspace<N, P>,
    flight: &mut Flight<W>,
) -> Result<(), ScheduleError> {
    let cfg = route.cfg;
    check_inputs::<N, W>(view, route, flight)?;
    load_scheduled_segments(route, scheduled, ws)?;
    ws.first_state[..view.node_count()].fill(0);
    ws.heap.clear(N);
    ws.state_count = 0;

    let start = view.node(route.from);
    let pad = start - Point::new(0.0, 0.0, flight.climb_m);
    let goal = view.node(route.to);
    let up = Leg::vertical_leg(pad, start, flight.climb_m / cfg.vertical_mps);
    let climb =
        Climb { up, latest_take_off_s: ws.latest_take_off_s(cfg, pad, &up, flight.max_segment_m) };
    let landing = ws.plan_landing(cfg, goal, flight.descent_m)?;
    let max_segment_m = flight.max_segment_m;
    // Lower bound of the time from `there` to the goal, seconds: the heuristic of A*.
    let left_s = |there: &Point| (goal - there).length() / cfg.cruise_mps;

    ws.add_states(cfg, view, route.from);
    ws.forbid_departures(cfg, &up, max_segment_m, (route.not_before_s, climb.latest_take_off_s));
    let leave_s = (route.not_before_s, climb.latest_take_off_s);
    let hop = StateTransition { to_node: route.from, parent: None, leave_s, duration_s: up.to_s };
    ws.relax_intervals(&hop, left_s(&start));
    while let Some(state) = ws.heap.pop() {
        let reached = ws.states[usize::from(state)];
        let leave_s = (reached.arrive_s, reached.safe_until_s);
        if reached.node == route.to {
            ws.forbid_departures(cfg, &landing.down, max_segment_m, leave_s);
            let from_s = fmaxf(reached.arrive_s, landing.free_from_s);
            let land_s = first_allowed_departure(&ws.forbidden, from_s)
                .filter(|&t| t <= reached.safe_until_s);
            if let Some(land_s) = land_s {
                return write_flight(route, view, &climb, ws, (state, land_s), flight);
            }
        }
        let here = view.node(reached.node);
        for edge in view.half_edges(reached.node) {
            if !passable(reached.node, &edge) {
                continue;
            }
            let there = view.node(edge.target);
            let duration_s = (there - here).length() / cfg.cruise_mps;
            ws.add_states(cfg, view, edge.target);
            let hop =
                StateTransition { to_node: edge.target, parent: Some(state), leave_s, duration_s };
            if ws.may_improve(&hop) {
                let leg = leg_at_time_zero(here, there, duration_s);
                ws.forbid_departures(cfg, &leg, max_segment_m, leave_s);
                ws.relax_intervals(&hop, left_s(&there));
            }
        }
    }
    Err(ScheduleError::Blocked)
}

/// Checks that the workspace holds the roadmap and the flight, and that both ends are nodes.
fn check_inputs<const N: usize, const W: usize>(
    view: &RoadmapView<'_>,
    route: &RouteQuery<'_>,
    flight: &Flight<W>,
) -> Result<(), ScheduleError> {
    if view.node_count() > N {
        return Err(ScheduleError::SegmentsFull);
    }
    if usize::from(route.from.max(route.to)) >= view.node_count() {
        return Err(ScheduleError::BadIndex);
    }
    let vertical = [flight.climb_m, flight.descent_m]
        .map(|length_m| leg_segment_count(length_m, flight.max_segment_m) as usize);
    let whole = flight.max_segment_m >= DEFAULT_MAX_SEGMENT_M && flight.max_segment_m.is_finite();
    if !whole || vertical[0].max(vertical[1]) > MAX_TIMED_SEGMENTS {
        return Err(ScheduleError::SegmentsFull);
    }
    Ok(())
}

/// Cuts all scheduled flights into timed segments with times after the mission's start, each held
/// `handover_s` longer; adds parked vehicles.
fn load_scheduled_segments<'a, const N: usize, const P: usize, const W: usize>(
    route: &RouteQuery<'_>,
    scheduled: impl Iterator<Item = &'a Flight<W>>,
    ws: &mut SippWorkspace<N, P>,
) -> Result<(), ScheduleError> {
    let &RouteQuery { cfg, parked, handover_s, .. } = route;
    ws.handover_s = handover_s;
    const { assert!(P <= u16::MAX as usize, "cells count segments in 16 bits") };
    ws.segments.clear();
    for other in scheduled {
        cut_into_segments(cfg, other, &mut ws.cut_segments)?;
        for q in &ws.cut_segments {
            let absolute = TimedSegment {
                held_from_s: q.held_from_s + other.depart_s,
                held_until_s: q.held_until_s + other.depart_s + handover_s,
                ..*q
            };
            ws.segments.push(absolute).map_err(|_| ScheduleError::SegmentsFull)?;
        }
    }
    for &place in parked {
        let for_ever = TimedSegment {
            held_from_s: f32::NEG_INFINITY,
            held_until_s: f32::INFINITY,
            ..parked_segment(place)
        };
        ws.segments.push(for_ever).map_err(|_| ScheduleError::SegmentsFull)?;
    }
    ws.cells.sort_into_cells(&mut ws.segments);
    Ok(())
}

impl<const N: usize, const P: usize> SippWorkspace<N, P> {
    fn conflicting_segments<'s>(
        &'s self,
        cfg: &'s ScheduleConfig,
        own: &'s TimedSegment,
    ) -> impl Iterator<Item = &'s TimedSegment> {
        self.cells.conflicting_segments(&self.segments, cfg, own)
    }

    /// Creates the states of a node, one for each safe interval, unless it has them already.
    fn add_states(&mut self, cfg: &ScheduleConfig, view: &RoadmapView<'_>, node: u16) {
        if self.first_state[usize::from(node)] != 0 {
            return;
        }
        let hover = TimedSegment { parked: false, ..parked_segment(view.node(node)) };
        self.forbidden.clear();
        for q in self.cells.conflicting_segments(&self.segments, cfg, &hover) {
            add_forbidden_interval(&mut self.forbidden, q.held_from_s, q.held_until_s);
        }
        sort::heapsort_by(&mut self.forbidden, |a, b| a.0.total_cmp(&b.0));
        let mut from_s = f32::NEG_INFINITY;
        for i in 0..=self.forbidden.len() {
            let (low, high) =
                self.forbidden.get(i).copied().unwrap_or((f32::INFINITY, f32::INFINITY));
            if low > from_s && self.state_count < N {
                let first = &mut self.first_state[usize::from(node)];
                let state = SippState {
                    node,
                    next_of_node: *first,
                    arrive_s: f32::INFINITY,
                    safe_from_s: from_s,
                    safe_until_s: low,
                    ..NO_STATE
                };
                self.states[self.state_count] = state;
                self.state_count += 1;
                *first = self.state_count as u16;
            }
            from_s = high;
        }
    }

    /// The latest take-off, seconds, before another vehicle needs the space of the pad.
    fn latest_take_off_s(
        &self,
        cfg: &ScheduleConfig,
        pad: Point,
        up: &Leg,
        max_segment_m: f32,
    ) -> f32 {
        // Held from −∞, so that it is not in conflict with another vehicle's pad.
        let on_pad = TimedSegment { held_from_s: f32::NEG_INFINITY, ..parked_segment(pad) };
        // The pad is held until the vehicle has flown the first timed segment of its climb.
        let off_pad_s =
            fmaxf(up.first_segment_length_and_duration(max_segment_m).1, MIN_PAD_HOLD_S)
                + self.handover_s;
        let needed_s = self
            .conflicting_segments(cfg, &on_pad)
            .map(|q| q.held_from_s)
            .fold(f32::INFINITY, fminf);
        needed_s - off_pad_s
    }

    /// The descent from the goal. Fails if another vehicle holds the landing place forever.
    fn plan_landing(
        &self,
        cfg: &ScheduleConfig,
        goal: Point,
        descent_m: f32,
    ) -> Result<Landing, ScheduleError> {
        let ground = goal - Point::new(0.0, 0.0, descent_m);
        // The landing place is held from the beginning of the descent, so the descent begins only
        // when other vehicles have left that place.
        let standing = parked_segment(ground);
        let after_s = self
            .conflicting_segments(cfg, &standing)
            .map(|q| q.held_until_s)
            .fold(f32::NEG_INFINITY, fmaxf);
        if after_s == f32::INFINITY {
            return Err(ScheduleError::Blocked);
        }
        Ok(Landing {
            down: Leg::vertical_leg(goal, ground, descent_m / cfg.vertical_mps),
            free_from_s: after_s,
        })
    }

    /// Whether the transition might reach some state of its node earlier than it is reached now:
    /// checked without the scheduled segments on the way.
    fn may_improve(&self, hop: &StateTransition) -> bool {
        let &StateTransition { to_node, leave_s: (from_s, until_s), duration_s, .. } = hop;
        let mut at = self.first_state[usize::from(to_node)];
        while at != 0 {
            let index = at - 1;
            let state = &self.states[usize::from(index)];
            at = state.next_of_node;
            let leave_s = fmaxf(from_s, state.safe_from_s - duration_s);
            let fits = leave_s <= until_s && leave_s + duration_s <= state.safe_until_s;
            if fits
                && leave_s + duration_s < state.arrive_s
                && self.heap.node_mark(index) != SETTLED
            {
                return true;
            }
        }
        false
    }

    /// Sets `forbidden` to the departures at which a flight along `leg` would be in conflict with a
    /// scheduled one. Those that do not matter from `leave_s.0` to `leave_s.1` may be missing.
    fn forbid_departures(
        &mut self,
        cfg: &ScheduleConfig,
        leg: &Leg,
        max_segment_m: f32,
        leave_s: (f32, f32),
    ) {
        self.forbidden.clear();
        let whole = TimedSegment {
            from: leg.from,
            to: leg.to,
            wait_at_m: 0.0,
            end_m: leg.length_m,
            held_from_s: 0.0,
            held_until_s: leg.to_s,
            parked: false,
        };
        let apart_m = fmaxf(cfg.separation_m, cfg.parked_separation_m);
        let held_s = self.handover_s;
        for q in self.cells.candidates_near(&self.segments, &whole, apart_m) {
            // A segment that ends before, or begins after, all times in question forbids none.
            if q.held_until_s < leave_s.0
                || q.held_from_s - held_s - leg.to_s > leave_s.1
                || !is_conflict(cfg, &whole, q)
            {
                continue;
            }
            for p in leg.segments(0.0, leg.length_m, max_segment_m) {
                if is_conflict(cfg, &p, q) {
                    add_forbidden_interval(
                        &mut self.forbidden,
                        q.held_from_s - held_s - p.held_until_s,
                        q.held_until_s - p.held_from_s,
                    );
                }
            }
        }
    }

    /// Lowers the arrival in each state of the transition's node that the transition reaches
    /// earlier. From that node the flight to the goal takes at least `left_s`.
    fn relax_intervals(&mut self, hop: &StateTransition, left_s: f32) {
        let &StateTransition { to_node, parent, leave_s: (from_s, until_s), duration_s } = hop;
        let mut at = self.first_state[usize::from(to_node)];
        while at != 0 {
            let index = at - 1;
            let state = self.states[usize::from(index)];
            at = state.next_of_node;
            if self.heap.node_mark(index) == SETTLED {
                continue;
            }
            let leave_s = first_allowed_departure(
                &self.forbidden,
                fmaxf(from_s, state.safe_from_s - duration_s),
            );
            let Some(leave_s) =
                leave_s.filter(|&t| t <= until_s && t + duration_s <= state.safe_until_s)
            else {
                continue;
            };
            let arrive_s = leave_s + duration_s;
            if arrive_s < state.arrive_s {
                let reached = &mut self.states[usize::from(index)];
                reached.parent = parent.unwrap_or(index);
                (reached.left_parent_s, reached.arrive_s) = (leave_s, arrive_s);
                self.heap.push(index, arrive_s + left_s);
            }
        }
    }
}

/// Writes the route that ends with `end` (last state, and time at which the vehicle leaves it for
/// the descent), with times after take-off. Every wait is moved as near to the pad as the safe
/// intervals allow: a vehicle that waits in the air blocks others, and drains its battery.
fn write_flight<const N: usize, const P: usize, const W: usize>(
    route: &RouteQuery<'_>,
    view: &RoadmapView<'_>,
    climb: &Climb,
    ws: &mut SippWorkspace<N, P>,
    end: (u16, f32),
    flight: &mut Flight<W>,
) -> Result<(), ScheduleError> {
    let mut way: Vec<(u16, f32, f32), W> = Vec::new();
    let cfg = route.cfg;
    let (mut at, mut leave_s) = end;
    loop {
        let reached = ws.states[usize::from(at)];
        let first = reached.parent == at;
        let before = ws.states[usize::from(reached.parent)];
        let here = view.node(reached.node);
        let (leg, until_s) = if first {
            (climb.up, climb.latest_take_off_s)
        } else {
            let from = view.node(before.node);
            (
                leg_at_time_zero(from, here, (here - from).length() / cfg.cruise_mps),
                before.safe_until_s,
            )
        };
        let duration_s = leg.to_s;
        let earliest_s = reached.left_parent_s;
        let latest_s = fminf(leave_s - duration_s, until_s);
        ws.forbid_departures(cfg, &leg, flight.max_segment_m, (earliest_s, latest_s));
        // Not before the departure that the search found free: forbidden intervals that were merged
        // for want of room may cover that time.
        let left_s = fmaxf(super::last_allowed_departure(&ws.forbidden, latest_s), earliest_s);
        way.push((reached.node, left_s + duration_s, leave_s))
            .map_err(|_| ScheduleError::SegmentsFull)?;
        leave_s = left_s;
        if first {
            break;
        }
        at = reached.parent;
    }
    // `leave_s` of the first state's leg is the take-off.
    flight.depart_s = leave_s;
    flight.path = Path::new();
    let mut before = None;
    for &(node, arrive_s, leave_s) in way.iter().rev() {
        let edge = before.and_then(|before| view.edge_between(before, node));
        let clearance_m = edge.map_or(view.header().max_clearance_m, |edge| edge.clearance_m);
        flight.path.push(view.node(node), clearance_m).map_err(|_| ScheduleError::SegmentsFull)?;
        let at_s = if before.is_none() { climb.up.to_s } else { arrive_s - flight.depart_s };
        flight.path.set_last_waypoint_times(at_s, fmaxf(leave_s - flight.depart_s, at_s));
        before = Some(node);
    }
    Ok(())
}
