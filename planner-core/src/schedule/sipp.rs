//! Safe-interval path planning on the roadmap (Phillips and Likhachev 2011): the earliest way past
//! flights that are already scheduled, with waiting and stepping aside at nodes. Of the ways that
//! arrive then, the one found leaves as late as it can.
//!
//! A node's time falls into *safe intervals*, in which hovering there is clear of every scheduled
//! piece. One search state is a node with one of its intervals; reaching it earlier is always
//! better, so A* over these states finds the earliest arrival. Flying an edge is clear from
//! departures outside the intervals that the pieces near it forbid.
//!
//! Cost: states reached × their edges × scheduled pieces, each a cheap bound. When the states are
//! used up the search ends without a way, as if there were none.

use heapless::Vec;
use libm::{fmaxf, fminf};

use super::config::{ScheduleConfig, ScheduleError};
use super::near::SegmentGrid;
use super::pieces::{
    Leg, MAX_TIMED_SEGMENT_M, MAX_TIMED_SEGMENTS, OFF_PAD_S, TimedSegment, WaitingPlaces,
    cut_into_segments, is_conflict, segment_count,
};
use super::{Forbidden, add_forbidden_interval, first_allowed, last_allowed};
use crate::flight::{Flight, Path};
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::search::heap::{Heap, SETTLED};
use crate::sort;
use crate::{Length, Point};

/// One node in one of its safe intervals.
#[derive(Clone, Copy)]
struct SippState {
    node: u16,
    /// The next state of the same node, plus one; 0 ends the list.
    next: u16,
    /// The state flown from; its own index at the start.
    parent: u16,
    /// When the parent was left, seconds.
    left_parent_s: f32,
    /// Earliest arrival, seconds; infinite while unreached.
    arrive_s: f32,
    /// End of the safe interval, seconds.
    until_s: f32,
    /// Start of the safe interval, seconds.
    from_s: f32,
}

const NO_STATE: SippState = SippState {
    node: 0,
    next: 0,
    parent: 0,
    left_parent_s: 0.0,
    arrive_s: 0.0,
    until_s: 0.0,
    from_s: 0.0,
};

/// Scratch for roadmaps of up to `N` nodes, as many states, and `P` scheduled pieces. All zero when
/// new.
pub struct SippWorkspace<const N: usize, const P: usize> {
    /// Times are absolute here; sorted into `cells`.
    pieces: Vec<TimedSegment, P>,
    cells: SegmentGrid,
    states: [SippState; N],
    len: usize,
    /// First state of each node, plus one.
    first: [u16; N],
    heap: Heap<N>,
    cut: Vec<TimedSegment, MAX_TIMED_SEGMENTS>,
    forbidden: Forbidden,
    /// Handover time of the route that is sought.
    handover_s: f32,
}

impl<const N: usize, const P: usize> SippWorkspace<N, P> {
    /// Creates it empty: all zeros.
    pub const fn new() -> Self {
        Self {
            pieces: Vec::new(),
            cells: SegmentGrid::new(),
            states: [NO_STATE; N],
            len: 0,
            first: [0; N],
            heap: Heap::new(),
            cut: Vec::new(),
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

/// The route to find.
#[derive(Clone, Copy, Debug)]
pub struct RouteQuery<'a> {
    /// Separation and nominal speeds.
    pub cfg: &'a ScheduleConfig,
    /// Node above the pad.
    pub from: u16,
    /// Node of the goal.
    pub to: u16,
    /// Take-off no earlier than this, seconds.
    pub not_before_s: f32,
    /// Places where others stand all the time.
    pub parked: &'a [Point],
    /// Time from when a vehicle has left a place until another one may be there, seconds.
    pub handover_s: f32,
}

/// The way from the pad up to the first node.
struct Climb {
    up: Leg,
    /// Latest take-off before another vehicle needs the pad's place, seconds.
    leave_by_s: f32,
}

/// The descent.
struct Landing {
    down: Leg,
    /// The landing place is held until then, seconds.
    after_s: f32,
}

/// A flight from one state to a node.
struct StateTransition {
    node: u16,
    /// The state flown from; none from the pad.
    parent: Option<u16>,
    /// The first and the last departure, seconds.
    leave_s: (f32, f32),
    duration_s: f32,
}

/// A leg of the path, flown from time 0.
fn leg_from_start(from: Point, to: Point, duration_s: f32) -> Leg {
    let length_m = (to - from).length();
    Leg { from, to, length_m, from_s: 0.0, to_s: duration_s, stops: WaitingPlaces::Anywhere }
}

/// Finds the earliest way for `flight` (its climb, descent and length of timed segments are taken,
/// its path and departure are written) that keeps clear of `scheduled`.
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
    ws.first[..view.node_count()].fill(0);
    ws.heap.clear(N);
    ws.len = 0;

    let start = view.node(route.from);
    let pad = start - Point::new(0.0, 0.0, flight.climb_m);
    let goal = view.node(route.to);
    let up = Leg::climb(pad, start, flight.climb_m / cfg.vertical_mps);
    let climb = Climb { up, leave_by_s: ws.leave_pad_by_s(cfg, pad, &up, flight.segment_m) };
    let landing = ws.plan_landing(cfg, goal, flight.descent_m)?;
    let piece_m = flight.segment_m;
    // At most so early, seconds from a place to the goal.
    let left_s = |there: &Point| (goal - there).length() / cfg.cruise_mps;

    ws.add_states(cfg, view, route.from);
    ws.forbid_departures(cfg, &up, piece_m, (route.not_before_s, climb.leave_by_s));
    let leave_s = (route.not_before_s, climb.leave_by_s);
    let hop = StateTransition { node: route.from, parent: None, leave_s, duration_s: up.to_s };
    ws.relax_intervals(&hop, left_s(&start));
    while let Some(state) = ws.heap.pop() {
        let reached = ws.states[usize::from(state)];
        let leave_s = (reached.arrive_s, reached.until_s);
        if reached.node == route.to {
            ws.forbid_departures(cfg, &landing.down, piece_m, leave_s);
            let from_s = fmaxf(reached.arrive_s, landing.after_s);
            let land_s = first_allowed(&ws.forbidden, from_s).filter(|&t| t <= reached.until_s);
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
                StateTransition { node: edge.target, parent: Some(state), leave_s, duration_s };
            if ws.may_improve(&hop) {
                ws.forbid_departures(
                    cfg,
                    &leg_from_start(here, there, duration_s),
                    piece_m,
                    leave_s,
                );
                ws.relax_intervals(&hop, left_s(&there));
            }
        }
    }
    Err(ScheduleError::Blocked)
}

/// Whether the memory is enough for the roadmap and the flight, and the ends are nodes.
fn check_inputs<const N: usize, const W: usize>(
    view: &RoadmapView<'_>,
    route: &RouteQuery<'_>,
    flight: &Flight<W>,
) -> Result<(), ScheduleError> {
    if view.node_count() > N {
        return Err(ScheduleError::PiecesFull);
    }
    if usize::from(route.from.max(route.to)) >= view.node_count() {
        return Err(ScheduleError::BadIndex);
    }
    let vertical = [flight.climb_m, flight.descent_m]
        .map(|length_m| segment_count(length_m, flight.segment_m) as usize);
    let whole = flight.segment_m >= MAX_TIMED_SEGMENT_M && flight.segment_m.is_finite();
    if !whole || vertical[0].max(vertical[1]) > MAX_TIMED_SEGMENTS {
        return Err(ScheduleError::PiecesFull);
    }
    Ok(())
}

/// Cuts all scheduled flights into pieces with absolute times.
fn load_scheduled_segments<'a, const N: usize, const P: usize, const W: usize>(
    route: &RouteQuery<'_>,
    scheduled: impl Iterator<Item = &'a Flight<W>>,
    ws: &mut SippWorkspace<N, P>,
) -> Result<(), ScheduleError> {
    let &RouteQuery { cfg, parked, handover_s, .. } = route;
    ws.handover_s = handover_s;
    const { assert!(P <= u16::MAX as usize, "cells count pieces in 16 bits") };
    ws.pieces.clear();
    for other in scheduled {
        cut_into_segments(cfg, other, &mut ws.cut)?;
        for q in &ws.cut {
            let absolute = TimedSegment {
                from_s: q.from_s + other.depart_s,
                to_s: q.to_s + other.depart_s + handover_s,
                ..*q
            };
            ws.pieces.push(absolute).map_err(|_| ScheduleError::PiecesFull)?;
        }
    }
    for &place in parked {
        let for_ever = TimedSegment {
            from_s: f32::NEG_INFINITY,
            to_s: f32::INFINITY,
            ..stationary_segment(place, true)
        };
        ws.pieces.push(for_ever).map_err(|_| ScheduleError::PiecesFull)?;
    }
    ws.cells.sort_into_cells(&mut ws.pieces);
    Ok(())
}

/// The pieces in conflict with `own`.
fn conflicting_segments<'s>(
    cells: &'s SegmentGrid,
    pieces: &'s [TimedSegment],
    cfg: &'s ScheduleConfig,
    own: &'s TimedSegment,
) -> impl Iterator<Item = &'s TimedSegment> {
    let apart_m = fmaxf(cfg.separation_m, cfg.parked_separation_m);
    cells.candidates_near(pieces, own, apart_m).filter(|q| is_conflict(cfg, own, q))
}

/// Timed segment of a vehicle that stays at one place; the caller sets the times.
fn stationary_segment(at: Point, parked: bool) -> TimedSegment {
    TimedSegment { from: at, to: at, from_m: 0.0, to_m: 0.0, from_s: 0.0, to_s: 0.0, parked }
}

impl<const N: usize, const P: usize> SippWorkspace<N, P> {
    fn conflicting_segments<'s>(
        &'s self,
        cfg: &'s ScheduleConfig,
        own: &'s TimedSegment,
    ) -> impl Iterator<Item = &'s TimedSegment> {
        conflicting_segments(&self.cells, &self.pieces, cfg, own)
    }

    /// Makes the states of a node, one for each safe interval, unless they are there.
    fn add_states(&mut self, cfg: &ScheduleConfig, view: &RoadmapView<'_>, node: u16) {
        if self.first[usize::from(node)] != 0 {
            return;
        }
        let hover = stationary_segment(view.node(node), false);
        self.forbidden.clear();
        for q in conflicting_segments(&self.cells, &self.pieces, cfg, &hover) {
            add_forbidden_interval(&mut self.forbidden, q.from_s, q.to_s);
        }
        sort::sort_by(&mut self.forbidden, |a, b| a.0.total_cmp(&b.0));
        let mut from_s = f32::NEG_INFINITY;
        for i in 0..=self.forbidden.len() {
            let (low, high) =
                self.forbidden.get(i).copied().unwrap_or((f32::INFINITY, f32::INFINITY));
            if low > from_s && self.len < N {
                let first = &mut self.first[usize::from(node)];
                let state = SippState {
                    node,
                    next: *first,
                    arrive_s: f32::INFINITY,
                    from_s,
                    until_s: low,
                    ..NO_STATE
                };
                self.states[self.len] = state;
                self.len += 1;
                *first = self.len as u16;
            }
            from_s = high;
        }
    }

    /// The latest take-off before another vehicle needs the pad's place, seconds.
    fn leave_pad_by_s(&self, cfg: &ScheduleConfig, pad: Point, up: &Leg, piece_m: f32) -> f32 {
        // Held from −∞, so that it is no conflict with another pad.
        let on_pad = TimedSegment { from_s: f32::NEG_INFINITY, ..stationary_segment(pad, true) };
        // The pad is held until the first part of the climb is behind the vehicle.
        let off_pad_s = fmaxf(up.first_segment(piece_m).1, OFF_PAD_S) + self.handover_s;
        let needed_s =
            self.conflicting_segments(cfg, &on_pad).map(|q| q.from_s).fold(f32::INFINITY, fminf);
        needed_s - off_pad_s
    }

    /// The descent below a goal. Fails where another vehicle is parked on that place for good.
    fn plan_landing(
        &self,
        cfg: &ScheduleConfig,
        goal: Point,
        descent_m: f32,
    ) -> Result<Landing, ScheduleError> {
        let ground = goal - Point::new(0.0, 0.0, descent_m);
        // The landing place is held from the beginning of the descent.
        let standing = stationary_segment(ground, true);
        let after_s = self
            .conflicting_segments(cfg, &standing)
            .map(|q| q.to_s)
            .fold(f32::NEG_INFINITY, fmaxf);
        if after_s == f32::INFINITY {
            return Err(ScheduleError::Blocked);
        }
        Ok(Landing { down: Leg::climb(goal, ground, descent_m / cfg.vertical_mps), after_s })
    }

    /// Whether some interval of the hop's node would be reached earlier if no vehicle were on it.
    fn may_improve(&self, hop: &StateTransition) -> bool {
        let &StateTransition { node, leave_s: (from_s, until_s), duration_s, .. } = hop;
        let mut at = self.first[usize::from(node)];
        while at != 0 {
            let index = at - 1;
            let state = &self.states[usize::from(index)];
            at = state.next;
            let leave_s = fmaxf(from_s, state.from_s - duration_s);
            let fits = leave_s <= until_s && leave_s + duration_s <= state.until_s;
            if fits
                && leave_s + duration_s < state.arrive_s
                && self.heap.entry_index(index) != SETTLED
            {
                return true;
            }
        }
        false
    }

    /// Collects the departures on which a flight along `leg_from_start` would meet a scheduled one,
    /// as far as they matter for leaving between the two times of `leave_s`.
    fn forbid_departures(
        &mut self,
        cfg: &ScheduleConfig,
        leg: &Leg,
        piece_m: f32,
        leave_s: (f32, f32),
    ) {
        self.forbidden.clear();
        let whole = TimedSegment {
            from: leg.from,
            to: leg.to,
            from_m: 0.0,
            to_m: leg.length_m,
            from_s: 0.0,
            to_s: leg.to_s,
            parked: false,
        };
        let apart_m = fmaxf(cfg.separation_m, cfg.parked_separation_m);
        let held_s = self.handover_s;
        for q in self.cells.candidates_near(&self.pieces, &whole, apart_m) {
            // A segment that ends before or begins after cannot even touch the times in question.
            if q.to_s < leave_s.0
                || q.from_s - held_s - leg.to_s > leave_s.1
                || !is_conflict(cfg, &whole, q)
            {
                continue;
            }
            for p in leg.segments(0.0, leg.length_m, piece_m) {
                if is_conflict(cfg, &p, q) {
                    add_forbidden_interval(
                        &mut self.forbidden,
                        q.from_s - held_s - p.to_s,
                        q.to_s - p.from_s,
                    );
                }
            }
        }
    }

    /// Reaches every interval of the hop's node as early as it can be; from there the goal is at
    /// least `left_s` away.
    fn relax_intervals(&mut self, hop: &StateTransition, left_s: f32) {
        let &StateTransition { node, parent, leave_s: (from_s, until_s), duration_s } = hop;
        let mut at = self.first[usize::from(node)];
        while at != 0 {
            let index = at - 1;
            let state = self.states[usize::from(index)];
            at = state.next;
            if self.heap.entry_index(index) == SETTLED {
                continue;
            }
            let leave_s = first_allowed(&self.forbidden, fmaxf(from_s, state.from_s - duration_s));
            let Some(leave_s) =
                leave_s.filter(|&t| t <= until_s && t + duration_s <= state.until_s)
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

/// Writes the way that ends in a state, left for the descent at a time (`end`), labelled with
/// seconds after take-off. Every wait is moved as near to the pad as the safe intervals allow: a
/// vehicle that waits in the air blocks others, and its battery drains.
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
            (climb.up, climb.leave_by_s)
        } else {
            let from = view.node(before.node);
            (leg_from_start(from, here, (here - from).length() / cfg.cruise_mps), before.until_s)
        };
        let duration_s = leg.to_s;
        let earliest_s = reached.left_parent_s;
        let latest_s = fminf(leave_s - duration_s, until_s);
        ws.forbid_departures(cfg, &leg, flight.segment_m, (earliest_s, latest_s));
        // Not before the way was found to be free: intervals that are merged for want of room may
        // swallow that time.
        let left_s = fmaxf(last_allowed(&ws.forbidden, latest_s), earliest_s);
        way.push((reached.node, left_s + duration_s, leave_s))
            .map_err(|_| ScheduleError::PiecesFull)?;
        leave_s = left_s;
        if first {
            break;
        }
        at = reached.parent;
    }
    // The remaining time is the departure from the pad.
    flight.depart_s = leave_s;
    flight.path = Path::new();
    let mut before = None;
    for &(node, arrive_s, leave_s) in way.iter().rev() {
        let edge = before.and_then(|before| view.edge_between(before, node));
        let clearance_m = edge.map_or(view.header().max_clearance_m, |edge| edge.clearance_m);
        flight.path.push(view.node(node), clearance_m).map_err(|_| ScheduleError::PiecesFull)?;
        let at_s = if before.is_none() { climb.up.to_s } else { arrive_s - flight.depart_s };
        flight.path.set_last_times(at_s, fmaxf(leave_s - flight.depart_s, at_s));
        before = Some(node);
    }
    Ok(())
}
