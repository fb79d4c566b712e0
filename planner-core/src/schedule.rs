//! Conflict-free schedules: who passes first where two paths come close.
//!
//! Paths are cut into pieces of at most [`PIECE_M`] metres, from the pad over the path to the ground below the goal.
//! Vehicles are scheduled one after the other (prioritised planning, Erdmann and Lozano-Pérez 1987); each waits on its pad
//! for the smallest delay that keeps every piece out of reach of every piece already scheduled at that time. Waiting on
//! the pad always suffices when each path avoids the pads and landing places of the others (a "well-formed" problem,
//! Čáp et al. 2015).
//!
//! In flight only the *order* of the schedule counts. For each pair of conflicting pieces the later vehicle gets a
//! [`Gate`]: it enters its piece once the earlier one has come to the end of its own. So two vehicles are never in
//! conflicting pieces at once, however late either runs; and nobody waits for ever, since every wait is for a vehicle with
//! an earlier label, and the vehicle with the earliest label waits for none (the whole argument: ARCHITECTURE.md).
//!
//! Where no delay on the pad helps, as head-on in a corridor, [`sipp`] lets the vehicle wait or step aside on its way.
//!
//! Cost: pieces of one path × pieces of all others, each a distance between two segments behind a cheap bound.

mod near;
pub mod sipp;

use heapless::Vec;
use libm::{fmaxf, fminf};

use crate::Point;
use crate::path::Path;

/// Longest piece of a path, metres: finer lets vehicles follow one another closer, coarser costs less.
pub const PIECE_M: f32 = 1.5;
/// Most pieces of one flight.
pub const PIECES: usize = 320;
/// Most forbidden intervals kept apart while a delay is sought; more are merged, which only forbids more.
const INTERVALS: usize = 128;

/// Tunables of the schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduleConfig {
    /// Distance kept between the paths of two vehicles that move: the safety distance and what both stray from their
    /// paths, metres.
    pub separation_m: f32,
    /// Distance kept from a vehicle that stands on the ground, metres.
    pub parked_separation_m: f32,
    /// Nominal speed along paths, m/s.
    pub cruise_mps: f32,
    /// Nominal speed of take-off and landing, m/s.
    pub vertical_mps: f32,
}

/// One vehicle's way from its pad to the ground below its goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight<const W: usize> {
    /// MAVLink system id.
    pub id: u8,
    /// Index of the goal flown to; `None` stays on its pad.
    pub goal: Option<u16>,
    /// Air part, start to goal, labelled with seconds after take-off.
    pub path: Path<W>,
    /// Height of the start above the pad, metres.
    pub climb_m: f32,
    /// Height of the goal above the ground there, metres.
    pub descent_m: f32,
    /// Scheduled take-off, seconds after the start at nominal speeds.
    pub depart_s: f32,
}

/// "Before my arc length `at_m`, vehicle `id` must have come past `until_m` of its own path."
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Where to wait, metres along the own path; −climb is the pad.
    pub at_m: f32,
    /// Whom to wait for: MAVLink system id.
    pub id: u8,
    /// Progress of the other that opens the gate, metres along its path.
    pub until_m: f32,
}

/// What one companion needs of the swarm's plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VehiclePlan<const W: usize, const G: usize> {
    /// Index of the goal flown to; `None` when none is left for this vehicle.
    pub goal: Option<u16>,
    /// Air part, start to goal.
    pub path: Path<W>,
    /// Height of the start above the pad, metres.
    pub climb_m: f32,
    /// Height of the goal above the ground there, metres.
    pub descent_m: f32,
    /// Scheduled take-off, seconds after the start. Not needed to keep apart: it waits on the pad instead of in the air.
    pub depart_s: f32,
    /// Where to wait for whom.
    pub gates: Vec<Gate, G>,
    /// CRC-32 over the whole swarm's plan: vehicles that agree on it agree on the order at every gate.
    pub plan_crc: u32,
}

/// Why a schedule could not be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScheduleError {
    /// More than [`PIECES`] pieces in one flight.
    PiecesFull,
    /// More than `G` gates for one vehicle.
    GatesFull,
    /// No delay keeps this vehicle clear of those already scheduled.
    Blocked,
}

/// A stretch of a flight. Times are relative to take-off; the pad is held from −∞, the landing place to +∞.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: Point,
    to: Point,
    from_m: f32,
    to_m: f32,
    from_s: f32,
    to_s: f32,
    parked: bool,
}

/// Scratch of [`earliest_departure`] and [`gates`].
#[derive(Debug, Default)]
pub struct ScheduleWorkspace {
    own: Vec<Piece, PIECES>,
    other: Vec<Piece, PIECES>,
    forbidden: Forbidden,
}

impl ScheduleWorkspace {
    /// Empty.
    pub const fn new() -> Self {
        Self { own: Vec::new(), other: Vec::new(), forbidden: Vec::new() }
    }
}

fn cut<const W: usize>(
    cfg: &ScheduleConfig,
    flight: &Flight<W>,
    out: &mut Vec<Piece, PIECES>,
) -> Result<(), ScheduleError> {
    out.clear();
    let waypoints = flight.path.waypoints();
    let (Some(first), Some(last)) = (waypoints.first(), waypoints.last()) else {
        return Ok(());
    };
    let mut push = |piece| out.push(piece).map_err(|_| ScheduleError::PiecesFull);
    let pad = first.position - Point::new(0.0, 0.0, flight.climb_m);
    let stay = |at: Point, m: f32, from_s: f32, to_s: f32| Piece {
        from: at,
        to: at,
        from_m: m,
        to_m: m,
        from_s,
        to_s,
        parked: true,
    };
    if flight.goal.is_none() {
        return push(stay(pad, -flight.climb_m, f32::NEG_INFINITY, f32::INFINITY));
    }
    push(stay(pad, -flight.climb_m, f32::NEG_INFINITY, 0.0))?;
    let moving =
        |from, to, from_m, to_m, from_s, to_s| Piece { from, to, from_m, to_m, from_s, to_s, parked: false };
    push(moving(pad, first.position, -flight.climb_m, 0.0, 0.0, first.at_s))?;
    for (i, waypoint) in waypoints.iter().enumerate() {
        if waypoint.leave_s > waypoint.at_s {
            let hold = stay(waypoint.position, waypoint.along_m, waypoint.at_s, waypoint.leave_s);
            push(Piece { parked: false, ..hold })?;
        }
        let Some(next) = waypoints.get(i + 1) else { break };
        let parts = parts(next.along_m - waypoint.along_m);
        for part in 0..parts {
            let at = |i: u32| {
                let share = i as f32 / parts as f32;
                let mix = |a: f32, b: f32| a + (b - a) * share;
                let point = waypoint.position + (next.position - waypoint.position) * share;
                (point, mix(waypoint.along_m, next.along_m), mix(waypoint.leave_s, next.at_s))
            };
            let ((from, from_m, from_s), (to, to_m, to_s)) = (at(part), at(part + 1));
            push(moving(from, to, from_m, to_m, from_s, to_s))?;
        }
    }
    let ground = last.position - Point::new(0.0, 0.0, flight.descent_m);
    let end_m = last.along_m + flight.descent_m;
    let landed_s = last.leave_s + flight.descent_m / cfg.vertical_mps;
    push(moving(last.position, ground, last.along_m, end_m, last.leave_s, landed_s))?;
    push(stay(ground, end_m, landed_s, f32::INFINITY))
}

/// Pieces of a stretch of this length.
fn parts(length_m: f32) -> u32 {
    fmaxf(libm::ceilf(length_m / PIECE_M), 1.0) as u32
}

/// Squared distance between two segments (Ericson, Real-Time Collision Detection, 5.1.9).
pub(crate) fn segments_distance_sq(p: (&Point, &Point), q: (&Point, &Point)) -> f32 {
    let (d1, d2, r) = (p.1 - p.0, q.1 - q.0, p.0 - q.0);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let share = |n: f32, d: f32| if d > 0.0 { (n / d).clamp(0.0, 1.0) } else { 0.0 };
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let s = share(b * f - c * e, a * e - b * b);
    let t = share(b * s + f, e);
    // With t clamped, s follows from it again.
    let s = share(b * t - c, a);
    let t = share(b * s + f, e);
    (r + d1 * s - d2 * t).norm_squared()
}

/// Whether two pieces come nearer than may be at the same time.
fn conflict(cfg: &ScheduleConfig, p: &Piece, q: &Piece) -> bool {
    if p.parked && q.parked && p.from_s.is_infinite() == q.from_s.is_infinite() {
        // Two pads, or two landing places: their distance is the mission's, not the schedule's.
        return false;
    }
    let apart = if p.parked || q.parked { cfg.parked_separation_m } else { cfg.separation_m };
    let reach = apart + 0.5 * (p.to_m - p.from_m + q.to_m - q.from_m);
    let middles = (p.from + p.to - q.from - q.to) * 0.5;
    middles.norm_squared() < reach * reach
        && segments_distance_sq((&p.from, &p.to), (&q.from, &q.to)) < apart * apart
}

/// Intervals of time that do not overlap.
type Forbidden = Vec<(f32, f32), INTERVALS>;

fn forbid(forbidden: &mut Forbidden, mut low: f32, mut high: f32) {
    // Swallow what overlaps; when full, swallow the nearest as well.
    while let Some(i) = forbidden.iter().position(|&(l, h)| l <= high && low <= h) {
        let (l, h) = forbidden.swap_remove(i);
        (low, high) = (fminf(low, l), fmaxf(high, h));
    }
    if forbidden.push((low, high)).is_err() {
        let gap = |&(l, h): &(f32, f32)| fmaxf(l - high, low - h);
        let nearest = (0..forbidden.len()).min_by(|&a, &b| gap(&forbidden[a]).total_cmp(&gap(&forbidden[b])));
        if let Some(i) = nearest {
            let (l, h) = forbidden.swap_remove(i);
            forbid(forbidden, fminf(low, l), fmaxf(high, h));
        }
    }
}

/// The smallest take-off time ≥ `not_before_s` at which `flight`, labelled, keeps clear of every flight in `scheduled`,
/// seconds.
pub fn earliest_departure<'a, const W: usize>(
    cfg: &ScheduleConfig,
    flight: &Flight<W>,
    not_before_s: f32,
    scheduled: impl Iterator<Item = &'a Flight<W>>,
    ws: &mut ScheduleWorkspace,
) -> Result<f32, ScheduleError> {
    cut(cfg, flight, &mut ws.own)?;
    ws.forbidden.clear();
    for other in scheduled {
        cut(cfg, other, &mut ws.other)?;
        for q in &ws.other {
            for p in ws.own.iter().filter(|p| conflict(cfg, p, q)) {
                // Held together iff p.from + d < q.to and q.from < p.to + d.
                forbid(
                    &mut ws.forbidden,
                    other.depart_s + q.from_s - p.to_s,
                    other.depart_s + q.to_s - p.from_s,
                );
            }
        }
    }
    first_allowed(&ws.forbidden, not_before_s).ok_or(ScheduleError::Blocked)
}

/// The smallest time ≥ `from_s` outside all of the intervals; `None` if there is none.
fn first_allowed(forbidden: &[(f32, f32)], from_s: f32) -> Option<f32> {
    let mut time_s = from_s;
    // Intervals are disjoint, so each can move the time once.
    for _ in 0..=forbidden.len() {
        match forbidden.iter().find(|&&(low, high)| low < time_s && time_s < high) {
            Some(&(_, f32::INFINITY)) => return None,
            Some(&(_, high)) => time_s = high,
            None => return Some(time_s),
        }
    }
    None
}

/// The largest time ≤ `until_s` outside all of the intervals.
fn last_allowed(forbidden: &[(f32, f32)], until_s: f32) -> f32 {
    let mut time_s = until_s;
    for _ in 0..=forbidden.len() {
        match forbidden.iter().find(|&&(low, high)| low < time_s && time_s < high) {
            Some(&(low, _)) => time_s = low,
            None => break,
        }
    }
    time_s
}

/// What a vehicle that stands at a place may stray from it along its path, metres.
const STANDING_M: f32 = 0.25;

/// The progress at which a vehicle counts as out of a piece. It may have to wait where the piece ends, for somebody whom it
/// would block if that still counted as inside. The next piece begins there and is either in conflict too, and then
/// counts by itself, or clear, and then so is the place between them. Not so where the next keeps a smaller distance: a
/// vehicle has left its descent when it stands on the ground, at `end_m`, and its pad when it is off it.
fn left_at_m(q: &Piece, end_m: f32) -> f32 {
    if q.to_m > q.from_m && q.to_m < end_m { q.to_m - STANDING_M } else { q.to_m + 0.01 }
}

/// Where `flight` waits for the `others`, in the order along its path. A gate that an earlier one implies is left out.
pub fn gates<'a, const W: usize, const G: usize>(
    cfg: &ScheduleConfig,
    flight: &Flight<W>,
    others: impl Iterator<Item = &'a Flight<W>>,
    ws: &mut ScheduleWorkspace,
    out: &mut Vec<Gate, G>,
) -> Result<(), ScheduleError> {
    out.clear();
    cut(cfg, flight, &mut ws.own)?;
    for other in others {
        cut(cfg, other, &mut ws.other)?;
        let end_m = other.path.length_m() + other.descent_m;
        let mut highest = f32::NEG_INFINITY;
        for p in &ws.own {
            let start_s = flight.depart_s + p.from_s;
            let earlier =
                |q: &&Piece| other.depart_s + 0.5 * (q.from_s + q.to_s) < start_s && conflict(cfg, p, q);
            let left = |q: &Piece| left_at_m(q, end_m);
            let until_m = ws.other.iter().filter(earlier).map(left).fold(highest, fmaxf);
            if until_m > highest {
                highest = until_m;
                let gate = Gate { at_m: p.from_m, id: other.id, until_m };
                out.push(gate).map_err(|_| ScheduleError::GatesFull)?;
            }
        }
    }
    out.sort_unstable_by(|a, b| a.at_m.total_cmp(&b.at_m).then(a.id.cmp(&b.id)));
    Ok(())
}

/// The checker of schedules: flies them at any speeds and measures.
#[cfg(test)]
pub(crate) mod checker {
    extern crate std;

    use std::vec::Vec as StdVec;

    use super::*;

    /// Flies all in lock-step along their paths, gates obeyed, vehicle `i` at `speeds[i]`. Returns the smallest distance
    /// between two of which one moves, or who was still under way after `steps` of 50 ms.
    pub fn fly<const W: usize>(
        cfg: &ScheduleConfig,
        flights: &[Flight<W>],
        speeds: &[f32],
        steps: usize,
    ) -> Result<f32, StdVec<u8>> {
        let mut ws = ScheduleWorkspace::new();
        let gates: StdVec<Vec<Gate, 1024>> = (0..flights.len())
            .map(|i| {
                let others = flights.iter().enumerate().filter(|&(j, _)| j != i).map(|(_, f)| f);
                let mut out = Vec::new();
                gates(cfg, &flights[i], others, &mut ws, &mut out).unwrap();
                out
            })
            .collect();
        let end = |f: &Flight<W>| if f.goal.is_some() { f.path.length_m() + f.descent_m } else { -f.climb_m };
        let place = |f: &Flight<W>, m: f32| {
            let below = fmaxf(-m, fmaxf(m - f.path.length_m(), 0.0));
            f.path.point_at(m).unwrap() - Point::new(0.0, 0.0, below)
        };
        let mut along: StdVec<f32> = flights.iter().map(|f| -f.climb_m).collect();
        let mut smallest = f32::INFINITY;
        for _ in 0..steps {
            for i in 0..flights.len() {
                let shut = |g: &&Gate| {
                    let other = flights.iter().position(|f| f.id == g.id).unwrap();
                    g.at_m >= along[i] - 0.01 && along[other] < g.until_m
                };
                let free = gates[i].iter().filter(shut).map(|g| g.at_m).fold(f32::INFINITY, fminf);
                // `until_m` lies a hair beyond the end of the last piece.
                let goal = end(&flights[i]) + if flights[i].goal.is_some() { 0.02 } else { 0.0 };
                along[i] = fmaxf(along[i], fminf(fminf(along[i] + speeds[i] * 0.05, free), goal));
            }
            let moves = |i: usize| along[i] > -flights[i].climb_m && along[i] < end(&flights[i]);
            for i in 0..flights.len() {
                for j in (0..i).filter(|&j| moves(i) || moves(j)) {
                    let apart = place(&flights[i], along[i]) - place(&flights[j], along[j]);
                    smallest = fminf(smallest, apart.norm());
                }
            }
            if (0..flights.len()).all(|i| along[i] >= end(&flights[i])) {
                return Ok(smallest);
            }
        }
        Err((0..flights.len()).filter(|&i| along[i] < end(&flights[i])).map(|i| flights[i].id).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CFG: ScheduleConfig =
        ScheduleConfig { separation_m: 2.0, parked_separation_m: 1.7, cruise_mps: 2.0, vertical_mps: 1.0 };

    fn flight(id: u8, points: &[(f32, f32)]) -> Flight<8> {
        let mut path = Path::new();
        for &(x, y) in points {
            path.push(Point::new(x, y, 1.5), 1.0).unwrap();
        }
        path.label(1.5 / CFG.vertical_mps, CFG.cruise_mps);
        Flight { id, goal: Some(0), path, climb_m: 1.5, descent_m: 1.5, depart_s: 0.0 }
    }

    fn schedule(pair: &mut [Flight<8>; 2]) -> Result<(), ScheduleError> {
        let mut ws = ScheduleWorkspace::new();
        let [first, second] = pair;
        second.depart_s = earliest_departure(&CFG, second, 0.0, [&*first].into_iter(), &mut ws)?;
        Ok(())
    }

    #[test]
    fn far_apart_nobody_waits() {
        let mut pair = [flight(1, &[(0.0, 0.0), (9.0, 0.0)]), flight(2, &[(0.0, 5.0), (9.0, 5.0)])];
        schedule(&mut pair).unwrap();
        assert_eq!(pair[1].depart_s, 0.0);
        let apart = checker::fly(&CFG, &pair, &[2.0, 2.0], 4000).unwrap();
        assert!((apart - 5.0).abs() < 1e-3);
    }

    #[test]
    fn head_on_onto_each_others_pads_is_blocked() {
        let mut pair = [flight(1, &[(0.0, 0.0), (9.0, 0.0)]), flight(2, &[(9.0, 0.0), (0.0, 0.0)])];
        assert_eq!(schedule(&mut pair), Err(ScheduleError::Blocked));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        /// Whatever the speeds, gates keep the pieces apart and let both arrive.
        #[test]
        fn any_speeds_keep_apart_and_arrive(
            xs in proptest::collection::vec((0.0f32..12.0, 0.0f32..12.0), 6),
            speeds in (0.2f32..3.0, 0.2f32..3.0),
        ) {
            let mut pair = [flight(1, &xs[..3]), flight(2, &xs[3..])];
            let near = |a: (f32, f32), b: (f32, f32)| libm::hypotf(a.0 - b.0, a.1 - b.1) < CFG.separation_m;
            prop_assume!(!near(xs[0], xs[3]) && !near(xs[2], xs[5]));
            if schedule(&mut pair).is_ok() {
                let apart = checker::fly(&CFG, &pair, &[speeds.0, speeds.1], 8000);
                prop_assert!(apart.as_ref().is_ok_and(|&d| d >= CFG.parked_separation_m - 1e-3), "{apart:?} {pair:?}");
            }
        }
    }
}
