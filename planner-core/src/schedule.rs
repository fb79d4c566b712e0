//! Conflict-free schedules: which vehicle flies first where two paths come close.
//!
//! A flight is cut into timed segments of at most [`DEFAULT_MAX_SEGMENT_M`] metres (more on a long
//! flight), from the pad along the path to the ground below the goal. Vehicles are scheduled one
//! after the other (prioritised planning, Erdmann and Lozano-Pérez 1987). Each waits on its pad for
//! the shortest time after which its segments are never too near to those that vehicles scheduled
//! before it hold at the same time. Waiting on the pad always suffices if each path keeps away from
//! the pads and landing places of the others (a "well-formed" problem, Čáp et al. 2015).
//!
//! In flight only the *order* of the schedule counts. For each pair of conflicting segments the
//! later vehicle gets a [`Gate`]: it enters its segment only when the earlier vehicle has left its
//! own. Claim by claim, `docs/schedule.md` proves that this keeps vehicles apart and lets all of
//! them arrive.
//!
//! Where no wait on the pad helps, as for two vehicles head-on in a corridor, [`sipp`] lets the
//! vehicle wait or step aside on its way.
//!
//! Cost: segments of one path × segments of all others. Most pairs are ruled out by a cheap bound,
//! the others take a distance between two lines.

mod blocks;
mod config;
mod near;
pub mod sipp;
#[cfg(test)]
pub(crate) mod tests;
mod timed_segments;

use heapless::Vec;
use libm::{fmaxf, fminf};

use self::blocks::{
    BlockSet, MAX_BLOCKS, OwnBlocks, SEGMENTS_PER_BLOCK, segments_in_blocks, set_bit_indices,
};
pub use self::config::{ScheduleConfig, ScheduleError};
pub use self::timed_segments::{DEFAULT_MAX_SEGMENT_M, MAX_TIMED_SEGMENTS};
use self::timed_segments::{TimedSegment, cut_into_segments, is_conflict};
use crate::flight::{Flight, Gate, MAX_REPORTED_PROGRESS_LAG_M};
use crate::sort;

/// Most forbidden intervals that are kept apart during the search for a take-off time. Any further
/// interval is merged with the nearest one, which only forbids more.
const MAX_INTERVALS: usize = 128;
/// Height above its pad from which a vehicle counts as having left the pad, metres.
const OFF_PAD_HEIGHT_M: f32 = 0.02;
/// Distance beyond the end of its descent from which a vehicle counts as having left the descent,
/// metres: only one that stands on the ground reports that progress.
const BEYOND_DESCENT_END_M: f32 = 0.01;

/// Memory of [`earliest_departure`] and [`gates`].
#[derive(Debug, Default)]
pub struct ScheduleWorkspace {
    /// Timed segments of the flight that is scheduled, or whose gates are sought.
    own: Vec<TimedSegment, MAX_TIMED_SEGMENTS>,
    /// Timed segments of one other flight.
    other: Vec<TimedSegment, MAX_TIMED_SEGMENTS>,
    /// The segments of `own`, in blocks.
    blocks: OwnBlocks,
    /// Take-off times at which the flight would be in conflict.
    forbidden: ForbiddenIntervals,
}

impl ScheduleWorkspace {
    /// Creates an empty workspace.
    pub const fn new() -> Self {
        Self { own: Vec::new(), other: Vec::new(), blocks: OwnBlocks::new(), forbidden: Vec::new() }
    }
}

/// Forbidden intervals of take-off times, seconds, which do not overlap.
type ForbiddenIntervals = Vec<(f32, f32), MAX_INTERVALS>;

/// Adds the interval from `low` to `high`, seconds.
fn add_forbidden_interval(forbidden: &mut ForbiddenIntervals, mut low: f32, mut high: f32) {
    // The new interval is merged with all that overlap it; if there is no room, with the nearest as
    // well.
    while let Some(i) = forbidden.iter().position(|&(l, h)| l <= high && low <= h) {
        let (l, h) = forbidden.swap_remove(i);
        (low, high) = (fminf(low, l), fmaxf(high, h));
    }
    if forbidden.push((low, high)).is_err() {
        let gap = |&(l, h): &(f32, f32)| fmaxf(l - high, low - h);
        let nearest =
            (0..forbidden.len()).min_by(|&a, &b| gap(&forbidden[a]).total_cmp(&gap(&forbidden[b])));
        if let Some(i) = nearest {
            let (l, h) = forbidden.swap_remove(i);
            add_forbidden_interval(forbidden, fminf(low, l), fmaxf(high, h));
        }
    }
}

/// The earliest take-off time ≥ `not_before_s`, seconds, at which `flight`, whose waypoints have
/// their times, has no conflict with any flight in `scheduled`. A place counts as free as soon as
/// its vehicle has left it.
pub fn earliest_departure<'a, const W: usize>(
    cfg: &ScheduleConfig,
    flight: &Flight<W>,
    not_before_s: f32,
    scheduled: impl Iterator<Item = &'a Flight<W>>,
    ws: &mut ScheduleWorkspace,
) -> Result<f32, ScheduleError> {
    departure_with_handover(cfg, flight, (not_before_s, 0.0), scheduled, ws)
}

/// As [`earliest_departure`], but a place counts as free only `handover_s` after its vehicle has
/// left it. `times` are `(not_before_s, handover_s)`.
pub(crate) fn departure_with_handover<'a, const W: usize>(
    cfg: &ScheduleConfig,
    flight: &Flight<W>,
    times: (f32, f32),
    mut scheduled: impl Iterator<Item = &'a Flight<W>>,
    ws: &mut ScheduleWorkspace,
) -> Result<f32, ScheduleError> {
    departure_with_conflict_counts(cfg, flight, times, &mut scheduled, ws, &mut |_, _| {})
}

/// As [`departure_with_handover`]. Calls `met` for each flight of `scheduled`, with its index and
/// two counts: the timed segments of `flight` in conflict with it, and its timed segments in
/// conflict with `flight`. Neither vehicle has more gates for the other than its count.
#[inline(never)]
pub(crate) fn departure_with_conflict_counts<const W: usize>(
    cfg: &ScheduleConfig,
    flight: &Flight<W>,
    (not_before_s, handover_s): (f32, f32),
    scheduled: &mut dyn Iterator<Item = &Flight<W>>,
    ws: &mut ScheduleWorkspace,
    met: &mut dyn FnMut(usize, [u32; 2]),
) -> Result<f32, ScheduleError> {
    cut_into_segments(cfg, flight, &mut ws.own)?;
    let ScheduleWorkspace { own, blocks, forbidden, .. } = ws;
    blocks.rebuild(cfg, own);
    forbidden.clear();
    let mut near_own = Vec::<u16, MAX_TIMED_SEGMENTS>::new();
    for (nth, other) in scheduled.enumerate() {
        let (mut own_in_conflict, mut others_in_conflict) =
            ([0u64; MAX_TIMED_SEGMENTS.div_ceil(64)], 0);
        for (part, near) in blocks.parts_near(cfg, other) {
            part.check_segment_count(other.max_segment_m, MAX_TIMED_SEGMENTS)?;
            let mut compare = |some: &[TimedSegment]| {
                let (Some(first), Some(last)) = (some.first(), some.last()) else { return };
                blocks.segments_near_line(near, own, (first.from, last.to), &mut near_own);
                for q in some {
                    let mut meets = false;
                    let near = near_own.iter().map(|&i| (usize::from(i), &own[usize::from(i)]));
                    for (i, p) in near.filter(|(_, p)| is_conflict(cfg, p, q)) {
                        // For a take-off at `d` both segments are held at once iff p.held_from + d
                        // < q.held_until and q.held_from < p.held_until + d, with the times of `q`
                        // after the mission's start.
                        let from_s = other.depart_s + q.held_from_s - handover_s - p.held_until_s;
                        let to_s = other.depart_s + q.held_until_s + handover_s - p.held_from_s;
                        add_forbidden_interval(forbidden, from_s, to_s);
                        own_in_conflict[i / 64] |= 1 << (i % 64);
                        meets = true;
                    }
                    others_in_conflict += u32::from(meets);
                }
            };
            let mut block = Vec::<TimedSegment, SEGMENTS_PER_BLOCK>::new();
            part.for_each_segment(other.max_segment_m, &mut |segment| {
                if block.is_full() {
                    compare(&block);
                    block.clear();
                }
                // Cannot overflow: a full block was emptied.
                let _ = block.push(segment);
            });
            compare(&block);
        }
        met(nth, [own_in_conflict.iter().map(|bits| bits.count_ones()).sum(), others_in_conflict]);
    }
    first_allowed_departure(forbidden, not_before_s).ok_or(ScheduleError::Blocked)
}

/// The interval of differences in take-off time, `a` minus `b`, outside which the two flights have
/// no conflict, seconds. If they never conflict, the first end is greater than the second. A place
/// counts as free `handover_s` after its vehicle has left it.
pub(crate) fn forbidden_departure_differences_s<const W: usize>(
    cfg: &ScheduleConfig,
    a: &Flight<W>,
    b: &Flight<W>,
    handover_s: f32,
    ws: &mut ScheduleWorkspace,
) -> Result<(f32, f32), ScheduleError> {
    cut_into_segments(cfg, a, &mut ws.own)?;
    cut_into_segments(cfg, b, &mut ws.other)?;
    let (mut from_s, mut to_s) = (f32::INFINITY, f32::NEG_INFINITY);
    for q in &ws.other {
        for p in &ws.own {
            // A pair of segments that would not widen the interval need not be compared.
            let (low, high) = (
                q.held_from_s - handover_s - p.held_until_s,
                q.held_until_s + handover_s - p.held_from_s,
            );
            if (low < from_s || high > to_s) && is_conflict(cfg, p, q) {
                (from_s, to_s) = (fminf(from_s, low), fmaxf(to_s, high));
            }
        }
    }
    Ok((from_s, to_s))
}

/// The earliest time ≥ `from_s` outside all forbidden intervals; `None` if there is none.
fn first_allowed_departure(forbidden: &[(f32, f32)], from_s: f32) -> Option<f32> {
    let mut time_s = from_s;
    // Intervals do not overlap, so each moves the time at most once.
    for _ in 0..=forbidden.len() {
        match forbidden.iter().find(|&&(low, high)| low < time_s && time_s < high) {
            Some(&(_, f32::INFINITY)) => return None,
            Some(&(_, high)) => time_s = high,
            None => return Some(time_s),
        }
    }
    None
}

/// The latest time ≤ `until_s` outside all forbidden intervals.
fn last_allowed_departure(forbidden: &[(f32, f32)], until_s: f32) -> f32 {
    let mut time_s = until_s;
    for _ in 0..=forbidden.len() {
        match forbidden.iter().find(|&&(low, high)| low < time_s && time_s < high) {
            Some(&(low, _)) => time_s = low,
            None => break,
        }
    }
    time_s
}

/// The reported progress from which a vehicle counts as having left timed segment `q`, metres.
///
/// At the segment's end the vehicle may have to wait at a gate for another one, which itself waits
/// until this segment is left. So [`MAX_REPORTED_PROGRESS_LAG_M`], by which a standing vehicle may
/// report too little, is subtracted. The next segment begins at that end: either it is in conflict
/// too and counts by itself, or it is clear, and then so is the end. A vehicle has left its pad no
/// earlier than [`OFF_PAD_HEIGHT_M`] above the pad, even where the subtracted lag would give less.
/// It has left its descent when it stands on the ground.
fn progress_when_left_m<const W: usize>(q: &TimedSegment, flight: &Flight<W>) -> f32 {
    if q.end_m < flight.path.length_m() + flight.descent_m {
        fmaxf(q.end_m - MAX_REPORTED_PROGRESS_LAG_M, OFF_PAD_HEIGHT_M - flight.climb_m)
    } else {
        q.end_m + BEYOND_DESCENT_END_M
    }
}

/// The gates of flight `index` for all other flights, in order along its path. A gate that an
/// earlier one for the same vehicle implies is left out.
///
/// If there are more than `G`, gates for one vehicle are merged: one gate then stands for those
/// that follow within 4, 8 or 16 m of it (`GATE_MERGE_M`), or for all that follow. Only gates are
/// merged that are open in the schedule by the time the vehicle passes the first, so the order of
/// times is kept.
pub fn gates<const W: usize, const G: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    index: usize,
    ws: &mut ScheduleWorkspace,
    out: &mut Vec<Gate, G>,
) -> Result<(), ScheduleError> {
    let merged_m = gate_merge_distance_m(cfg, flights, index, G, ws)?;
    out.clear();
    let mut full = false;
    for_each_gate(cfg, flights, index, merged_m, ws, |gate| full |= out.push(gate).is_err())?;
    sort::heapsort_by(out, |a, b| {
        a.at_m.total_cmp(&b.at_m).then(a.wait_for_id.cmp(&b.wait_for_id))
    });
    if full { Err(ScheduleError::GatesFull) } else { Ok(()) }
}

/// The distance along the path within which the gates of flight `index` have to be merged so that
/// at most `most` remain, metres: the first of `GATE_MERGE_M` that suffices.
pub(crate) fn gate_merge_distance_m<const W: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    index: usize,
    most: usize,
    ws: &mut ScheduleWorkspace,
) -> Result<f32, ScheduleError> {
    cut_into_segments(cfg, flights.get(index).ok_or(ScheduleError::BadIndex)?, &mut ws.own)?;
    ws.blocks.rebuild(cfg, &ws.own);
    for merged_m in GATE_MERGE_M {
        let mut count = 0;
        for_each_gate(cfg, flights, index, merged_m, ws, |_| count += 1)?;
        if count <= most {
            return Ok(merged_m);
        }
    }
    Err(ScheduleError::GatesFull)
}

/// Distances along the path within which gates for one vehicle are merged, metres: the first that
/// leaves few enough gates is used.
const GATE_MERGE_M: [f32; 5] = [0.0, 4.0, 8.0, 16.0, f32::INFINITY];

/// For each block of `ws.own` the blocks of `ws.other` that may be in conflict with it, a bit each;
/// `None` if there are none.
#[inline(never)]
fn conflicting_blocks(ws: &ScheduleWorkspace) -> Option<[BlockSet; MAX_BLOCKS]> {
    let mut near = [0; MAX_BLOCKS];
    let mut some = false;
    for (bit, block) in ws.other.chunks(SEGMENTS_PER_BLOCK).enumerate() {
        for own in set_bit_indices(ws.blocks.blocks_near(block)) {
            near[own] |= 1 << bit;
            some = true;
        }
    }
    some.then_some(near)
}

/// Passes the gates of flight `index`, whose segments are in `ws.own`, to `found`, one other
/// vehicle after the other. Gates for one vehicle are merged within `merged_m` along the path, as
/// [`gates`] describes.
fn for_each_gate<const W: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    index: usize,
    merged_m: f32,
    ws: &mut ScheduleWorkspace,
    mut found: impl FnMut(Gate),
) -> Result<(), ScheduleError> {
    // Hovers are left out: wherever a hover conflicts, so do the segments that end and begin there.
    let moves = |segment: &&TimedSegment| segment.parked || segment.end_m > segment.wait_at_m;
    let flight = &flights[index];
    for (_, other) in flights.iter().enumerate().filter(|&(i, _)| i != index) {
        if ws.blocks.parts_near(cfg, other).next().is_none() {
            continue;
        }
        cut_into_segments(cfg, other, &mut ws.other)?;
        let Some(near) = conflicting_blocks(ws) else { continue };
        // The gate found last, and when this vehicle passes it in the schedule.
        let mut last: Option<(Gate, f32)> = None;
        let mut highest = f32::NEG_INFINITY;
        let own = ws.own.iter().enumerate().map(|(i, p)| (near[i / SEGMENTS_PER_BLOCK], p));
        for (near, p) in own.filter(|(near, p)| *near != 0 && moves(p)) {
            let start_s = flight.depart_s + p.held_from_s;
            let earlier = |q: &&TimedSegment| {
                other.depart_s + 0.5 * (q.held_from_s + q.held_until_s) < start_s
                    && is_conflict(cfg, p, q)
            };
            let (mut until_m, mut open_s) = (highest, f32::NEG_INFINITY);
            for q in
                segments_in_blocks(near, &ws.other).map(|(_, q)| q).filter(moves).filter(earlier)
            {
                let left_m = progress_when_left_m(q, other);
                if left_m > until_m {
                    (until_m, open_s) = (left_m, other.depart_s + q.held_until_s);
                }
            }
            if until_m <= highest {
                continue;
            }
            highest = until_m;
            match &mut last {
                Some((gate, passed_s))
                    if p.wait_at_m <= gate.at_m
                        || (p.wait_at_m <= gate.at_m + merged_m && open_s <= *passed_s) =>
                {
                    gate.open_from_progress_m = until_m;
                }
                _ => {
                    let gate = Gate {
                        at_m: p.wait_at_m,
                        wait_for_id: other.vehicle_id,
                        open_from_progress_m: until_m,
                    };
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
