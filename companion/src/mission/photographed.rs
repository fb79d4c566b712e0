//! Which waypoints of an area are photographed: over flights, restarts and vehicles, so that a new
//! start flies the rest.
//!
//! A set of numbers that only grows: lost, repeated and reordered reports do no harm. Before it
//! starts a vehicle takes in what all others on the ground know, so that all plan the rest of the
//! same set; where others fly already it takes the set of theirs. A start waits while another plan
//! is heard. In flight it notes what it photographs, and what it hears of others, for the start
//! after. An area that is whole is begun again: that is another round, and what is known of a round
//! before does not count.

use planner_core::flight::{Path, PicturePlan, WaypointRange, WaypointSet};

use crate::link::done::{DoneReport, MAX_RANGES, RANGE_LEN, decode_range, encode_range};
use crate::storage::store::{self, MAX_PROGRAM};
use crate::time::{Duration, Instant};

/// Most ranges of waypoints that are known to be photographed; a waypoint outside them is
/// photographed again.
pub const MAX_DONE_RANGES: usize = 40;
/// Newly photographed waypoints after which the ranges are stored in flash again.
const STORE_EVERY_WAYPOINTS: u32 = 10;
/// Time for which the ranges reported by vehicles in flight count, instead of what vehicles on the
/// ground know: reports in flight come at least this often.
const FLIGHT_REPORT_LIFETIME: Duration = Duration::from_secs(25);
/// Bytes before the ranges: mission CRC and round.
const HEADER_LEN: usize = 5;
const _: () = assert!(HEADER_LEN + MAX_DONE_RANGES * RANGE_LEN <= MAX_PROGRAM);

/// The photographed waypoints of an area.
#[derive(Clone, Debug, Default)]
pub(crate) struct PhotographedWaypoints {
    /// Number of times that the area was begun again.
    round: u8,
    /// Waypoints that the plan leaves out, or will.
    left_out_by_plan: WaypointSet<MAX_DONE_RANGES>,
    /// All that is known.
    known: WaypointSet<MAX_DONE_RANGES>,
    /// Number of waypoints that the flash has.
    stored_count: u32,
    /// Whether `before` has changed since a plan was requested.
    outdated: bool,
    /// Round of the plan.
    planned_round: u8,
    /// Whether it has flown since.
    has_flown: bool,
    /// When one in flight last reported what its plan leaves out.
    followed_at: Option<Instant>,
    /// With this range the next report begins.
    next_range: usize,
    /// Whether that is of what its plan leaves out.
    reports_plan: bool,
}

impl PhotographedWaypoints {
    /// Restores the record of this mission from flash.
    pub(crate) fn restore(&mut self, kept: &[u8], mission_crc: u32) {
        let Some((head, ranges)) = kept.split_at_checked(HEADER_LEN) else { return };
        if head[..4] != mission_crc.to_le_bytes() {
            return;
        }
        self.round = head[4];
        let (ranges, _) = ranges.as_chunks::<RANGE_LEN>();
        ranges.iter().for_each(|bytes| _ = self.known.insert(decode_range(bytes)));
        self.stored_count = self.known.count();
        self.left_out_by_plan = self.known.clone();
    }

    /// The record for the flash, if it is worth one: at once where no further waypoint is to come.
    pub(crate) fn record_to_store(
        &mut self,
        mission_crc: u32,
        at_once: bool,
    ) -> Option<store::Photographed> {
        let count = self.known.count();
        let least =
            if at_once { self.stored_count + 1 } else { self.stored_count + STORE_EVERY_WAYPOINTS };
        // Fewer than before: another round.
        if (self.stored_count..least).contains(&count) {
            return None;
        }
        self.stored_count = count;
        let mut kept = store::Photographed::new();
        // Both fit: `HEADER_LEN` and `MAX_DONE_RANGES` ranges are no more than a block.
        let _ = kept.extend_from_slice(&mission_crc.to_le_bytes());
        let _ = kept.push(self.round);
        self.known
            .ranges()
            .iter()
            .for_each(|range| _ = kept.extend_from_slice(&encode_range(range)));
        Some(kept)
    }

    /// A plan is requested: it leaves out what is known, or nothing.
    pub(crate) fn begin_plan(&mut self, resumes: bool) {
        if !resumes {
            self.begin_round();
            self.left_out_by_plan.clear();
        } else if self.has_flown {
            self.left_out_by_plan = self.known.clone();
        }
        (self.planned_round, self.has_flown, self.outdated) = (self.round, false, false);
    }

    /// Waypoints that the plan leaves out.
    pub(crate) fn waypoints_left_out(&self) -> &[WaypointRange] {
        self.left_out_by_plan.ranges()
    }

    /// Whether more is known to be done than the plan leaves out.
    pub(crate) fn is_outdated(&self) -> bool {
        self.outdated
    }

    /// Number of waypoints that are known to be photographed.
    pub(crate) fn count(&self) -> u32 {
        self.known.count()
    }

    /// The vehicle leaves its pad. Where the area was whole the plan is for all of it again:
    /// another round, unless one that left before has said so.
    pub(crate) fn leave_pad(&mut self, photographs: &PicturePlan) {
        self.has_flown = true;
        let whole = photographs.area() > 0 && self.left_out_by_plan.count() >= photographs.area();
        if whole && self.round == self.planned_round {
            self.begin_round();
        }
    }

    /// Begins a new round: waypoints of an earlier round do not count any more.
    fn begin_round(&mut self) {
        self.round = self.round.wrapping_add(1);
        self.known.clear();
    }

    /// Notes these pictures of the path.
    pub(crate) fn note_pictures<const W: usize>(
        &mut self,
        photographs: &PicturePlan,
        path: &Path<W>,
        pictures: WaypointRange,
    ) {
        // A waypoint that does not fit is photographed again.
        photographs.shown_waypoints(path, pictures).for_each(|range| _ = self.known.insert(range));
    }

    /// Handles a report of photographed waypoints from another vehicle. `waits`: this one stands on
    /// the ground, and is to plan as others do.
    pub(crate) fn handle_report(&mut self, report: &DoneReport, waits: bool, now: Instant) {
        if report.is_left_out_by_plan {
            if waits {
                self.adopt_plan_of(report, now);
            }
            return;
        }
        let newer = report.round.wrapping_sub(self.round);
        if newer > 127 {
            return;
        }
        let follows = self.followed_at.is_some_and(|at| now - at <= FLIGHT_REPORT_LIFETIME);
        let plans = waits && !report.flies && !follows;
        if newer > 0 {
            self.round = report.round;
            self.known.clear();
            if plans {
                self.outdated |= !self.left_out_by_plan.is_empty();
                self.left_out_by_plan.clear();
            }
        }
        for range in &report.ranges {
            let _ = self.known.insert(*range);
            if plans {
                self.outdated |= self.left_out_by_plan.insert(*range) == Ok(true);
            }
        }
    }

    /// Adopts the plan inputs of a vehicle that has already started.
    fn adopt_plan_of(&mut self, report: &DoneReport, now: Instant) {
        self.followed_at = Some(now);
        if self.left_out_by_plan.ranges() != &report.ranges[..] {
            self.left_out_by_plan.clear();
            report.ranges.iter().for_each(|range| _ = self.left_out_by_plan.insert(*range));
            self.outdated = true;
        }
    }

    /// The report to other vehicles, one part after the other; in flight, in turn, the waypoints
    /// that the plan leaves out, if one report holds them.
    pub(crate) fn report(&mut self, waits: bool, flies: bool) -> DoneReport {
        let plan =
            flies && !self.reports_plan && self.left_out_by_plan.ranges().len() <= MAX_RANGES;
        self.reports_plan = plan;
        if plan {
            let ranges = self.left_out_by_plan.ranges().iter().copied().collect();
            return DoneReport {
                round: self.round,
                flies,
                is_left_out_by_plan: plan,
                ranges,
                ..DoneReport::default()
            };
        }
        let done = if waits { &self.left_out_by_plan } else { &self.known };
        let first = if self.next_range < done.ranges().len() { self.next_range } else { 0 };
        self.next_range = first + MAX_RANGES;
        let ranges = done.ranges().iter().skip(first).take(MAX_RANGES).copied().collect();
        DoneReport { round: self.round, flies, ranges, ..DoneReport::default() }
    }
}
