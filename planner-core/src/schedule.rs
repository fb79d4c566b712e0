//! Conflict-free schedules: which vehicle passes first where two paths come close.
//!
//! A flight is cut into timed segments of at most [`PIECE_M`] metres, from the pad over the path to the ground below the goal.
//! Vehicles are scheduled one after the other (prioritised planning, Erdmann and Lozano-Pérez 1987); each waits on its pad
//! for the smallest delay that keeps its segments out of reach of those already scheduled at that time. Waiting on
//! the pad always suffices when each path avoids the pads and landing places of the others (a "well-formed" problem,
//! Čáp et al. 2015).
//!
//! In flight only the *order* of the schedule counts. For each pair of conflicting segments the later vehicle gets a
//! [`Gate`]: it enters its segment once the earlier one has left its own. Why this keeps vehicles apart and lets all of them
//! arrive is in `docs/schedule.md`, claim by claim.
//!
//! Where no delay on the pad helps, as head-on in a corridor, [`sipp`] lets the vehicle wait or step aside on its way.
//!
//! Cost: segments of one path × segments of all others, each a distance between two lines behind a cheap bound.

mod near;
mod pieces;
pub mod sipp;
#[cfg(test)]
pub(crate) mod tests;

use heapless::Vec;
use libm::{fmaxf, fminf};

use self::pieces::{cut, parts};
use crate::path::Path;
use crate::{ConfigError, Point, all_positive};

/// Longest timed segment, metres: finer lets vehicles follow one another closer, coarser costs less.
pub const PIECE_M: f32 = 1.5;
/// Most timed segments of one flight; on a flight that would need more they are longer.
pub const PIECES: usize = 320;
/// A vehicle that stands reports its progress at most this wrong, metres.
pub const PROGRESS_ERROR_M: f32 = 0.25;
/// Most forbidden intervals kept apart while a delay is sought; more are merged, which only forbids more.
const INTERVALS: usize = 128;
/// Timed segments grow at most this often, by two: to 1.5 km.
const DOUBLINGS: usize = 10;
/// A pad is held for at least this long after take-off, seconds: a vehicle that stands on it has not left it.
const OFF_PAD_S: f32 = 0.05;
/// This far above its pad a vehicle has left it at the least, metres.
const OFF_PAD_M: f32 = 0.02;

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

impl ScheduleConfig {
    /// Whether all are positive and finite; the error names the first that is not.
    pub fn check(&self) -> Result<(), ConfigError> {
        all_positive(&[
            ("separation_m", self.separation_m),
            ("parked_separation_m", self.parked_separation_m),
            ("cruise_mps", self.cruise_mps),
            ("vertical_mps", self.vertical_mps),
        ])
    }
}

/// One vehicle's way from its pad to the ground below its goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight<const W: usize> {
    /// Id of the vehicle, unique in the swarm.
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
    /// Longest timed segment of this flight, metres: [`PIECE_M`], or more on a flight that is long.
    pub piece_m: f32,
}

impl<const W: usize> Flight<W> {
    /// Sets the shortest timed segments, of twice as long ones each time, with which the flight has at most [`PIECES`].
    pub(crate) fn fit_pieces(&mut self) {
        self.piece_m = PIECE_M;
        for _ in 0..DOUBLINGS {
            if self.pieces() <= PIECES {
                break;
            }
            self.piece_m *= 2.0;
        }
    }

    /// From take-off to landing, seconds; nothing for a vehicle that stays on its pad.
    pub(crate) fn lasts_s(&self, cfg: &ScheduleConfig) -> f32 {
        let landed_s = |w: &crate::path::Waypoint| w.leave_s + self.descent_m / cfg.vertical_mps;
        self.path.waypoints().last().filter(|_| self.goal.is_some()).map_or(0.0, landed_s)
    }

    /// Timed segments that [`cut`] makes of it.
    pub(crate) fn pieces(&self) -> usize {
        let legs = self.path.waypoints().windows(2).map(|leg| leg[1].along_m - leg[0].along_m);
        let lengths = [self.climb_m, self.descent_m].into_iter().chain(legs);
        let moving = lengths.map(|length_m| parts(length_m, self.piece_m)).fold(0, u32::saturating_add);
        let holds = self.path.waypoints().iter().filter(|w| w.leave_s > w.at_s).count();
        (moving as usize).saturating_add(2 + holds)
    }
}

/// "Before my arc length `at_m`, vehicle `id` must have come past `until_m` of its own path."
///
/// Progress is what opens a gate, so a vehicle must report it by these rules:
/// - On its pad it reports −climb. In the climb it reports what is left of it, negative; in the descent the path's length and
///   how far it has come down.
/// - It reports no more than the reference that it follows has come to, and at most [`PROGRESS_ERROR_M`] less once it stands.
/// - It reports more than the path's length and the descent only when it stands on the ground, disarmed.
///
/// A vehicle that waits where it is sent reports enough to open every gate that waits for what lies behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Where to wait, metres along the own path; −climb is the pad.
    pub at_m: f32,
    /// Which vehicle to wait for: its id.
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

impl<const W: usize, const G: usize> VehiclePlan<W, G> {
    /// One that stays on its pad. All zeros, so a static costs .bss alone.
    pub const fn new() -> Self {
        Self {
            goal: None,
            path: Path::new(),
            climb_m: 0.0,
            descent_m: 0.0,
            depart_s: 0.0,
            gates: Vec::new(),
            plan_crc: 0,
        }
    }
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
    /// A flight or a node with an index that there is none of.
    BadIndex,
}

/// A timed segment: a part of a flight, and when it is held. Times are relative to take-off; the pad is held from −∞, the
/// landing place to +∞.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: Point,
    to: Point,
    /// Where the vehicle waits before this segment, metres along its path: nobody waits within a climb or a descent.
    from_m: f32,
    /// Where it ends, metres.
    to_m: f32,
    /// When it may have to be free: when its vehicle leaves the place where it waits before it.
    from_s: f32,
    /// When the vehicle has left it.
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

/// The differences of take-off times, of `a` after `b`, between which the two flights may meet: one interval, seconds; the
/// first end is the greater one where they never meet.
pub(crate) fn forbidden_differences<const W: usize>(
    cfg: &ScheduleConfig,
    a: &Flight<W>,
    b: &Flight<W>,
    ws: &mut ScheduleWorkspace,
) -> Result<(f32, f32), ScheduleError> {
    cut(cfg, a, &mut ws.own)?;
    cut(cfg, b, &mut ws.other)?;
    let (mut from_s, mut to_s) = (f32::INFINITY, f32::NEG_INFINITY);
    for q in &ws.other {
        for p in &ws.own {
            // What widens nothing need not be looked at.
            let (low, high) = (q.from_s - p.to_s, q.to_s - p.from_s);
            if (low < from_s || high > to_s) && conflict(cfg, p, q) {
                (from_s, to_s) = (fminf(from_s, low), fmaxf(to_s, high));
            }
        }
    }
    Ok((from_s, to_s))
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

/// The progress at which a vehicle counts as out of a timed segment, metres.
///
/// It may have to wait where the segment ends, for a vehicle that it would block if that still counted as inside. The next
/// segment begins there and is either in conflict too, and then counts by itself, or clear, and then so is the place between
/// them. A vehicle has left its pad when it is off it, however low its climb ends, and its descent when it stands on the ground.
fn left_at_m<const W: usize>(q: &Piece, flight: &Flight<W>) -> f32 {
    if q.to_m < flight.path.length_m() + flight.descent_m {
        fmaxf(q.to_m - PROGRESS_ERROR_M, OFF_PAD_M - flight.climb_m)
    } else {
        q.to_m + 0.01
    }
}

/// Where flight `index` waits for the others, in the order along its path. A gate that an earlier one for the same vehicle
/// implies is left out.
///
/// More than `G` are made fewer: a gate then stands for those that follow within 4, 8 or 16 m of it (`MERGED_M`), or for
/// all behind it. Only gates are merged that the schedule has open by the time of the first, so the order of labels stays as it is.
pub fn gates<const W: usize, const G: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    index: usize,
    ws: &mut ScheduleWorkspace,
    out: &mut Vec<Gate, G>,
) -> Result<(), ScheduleError> {
    let merged_m = merged_m(cfg, flights, index, G, ws)?;
    out.clear();
    let mut full = false;
    each_gate(cfg, flights, index, merged_m, ws, |gate| full |= out.push(gate).is_err())?;
    out.sort_unstable_by(|a, b| a.at_m.total_cmp(&b.at_m).then(a.id.cmp(&b.id)));
    if full { Err(ScheduleError::GatesFull) } else { Ok(()) }
}

/// How far gates of flight `index` have to be merged for no more than `most`, metres.
pub(crate) fn merged_m<const W: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    index: usize,
    most: usize,
    ws: &mut ScheduleWorkspace,
) -> Result<f32, ScheduleError> {
    cut(cfg, flights.get(index).ok_or(ScheduleError::BadIndex)?, &mut ws.own)?;
    for merged_m in MERGED_M {
        let mut count = 0;
        each_gate(cfg, flights, index, merged_m, ws, |_| count += 1)?;
        if count <= most {
            return Ok(merged_m);
        }
    }
    Err(ScheduleError::GatesFull)
}

/// How far along the path gates for one vehicle are merged, metres; the first that leaves few enough.
const MERGED_M: [f32; 5] = [0.0, 4.0, 8.0, 16.0, f32::INFINITY];

/// The gates of the flight in `ws.own`, one other vehicle after the other.
fn each_gate<const W: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    index: usize,
    merged_m: f32,
    ws: &mut ScheduleWorkspace,
    mut found: impl FnMut(Gate),
) -> Result<(), ScheduleError> {
    // The vehicle hovers where the segment before ends and the one after begins, so those conflict wherever a hover does.
    let moves = |piece: &&Piece| piece.parked || piece.to_m > piece.from_m;
    let flight = &flights[index];
    for (_, other) in flights.iter().enumerate().filter(|&(i, _)| i != index) {
        cut(cfg, other, &mut ws.other)?;
        // The gate found last, and when it is passed.
        let mut last: Option<(Gate, f32)> = None;
        let mut highest = f32::NEG_INFINITY;
        for p in ws.own.iter().filter(moves) {
            let start_s = flight.depart_s + p.from_s;
            let earlier =
                |q: &&Piece| other.depart_s + 0.5 * (q.from_s + q.to_s) < start_s && conflict(cfg, p, q);
            let (mut until_m, mut open_s) = (highest, f32::NEG_INFINITY);
            for q in ws.other.iter().filter(moves).filter(earlier) {
                let left_m = left_at_m(q, other);
                if left_m > until_m {
                    (until_m, open_s) = (left_m, other.depart_s + q.to_s);
                }
            }
            if until_m <= highest {
                continue;
            }
            highest = until_m;
            match &mut last {
                Some((gate, passed_s))
                    if p.from_m <= gate.at_m || (p.from_m <= gate.at_m + merged_m && open_s <= *passed_s) =>
                {
                    gate.until_m = until_m;
                }
                _ => {
                    let gate = Gate { at_m: p.from_m, id: other.id, until_m };
                    if let Some((before, _)) = last.replace((gate, start_s)) {
                        found(before);
                    }
                }
            }
        }
        if let Some((gate, _)) = last {
            found(gate);
        }
    }
    Ok(())
}
