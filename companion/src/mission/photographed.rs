//! The waypoints of an area that are known to be photographed, by any vehicle, in earlier flights
//! and before restarts, so that a new start flies the rest.
//!
//! Their set only grows, so lost, repeated and reordered reports do no harm. Before it starts, a
//! vehicle adds the waypoints that all others on the ground know, so that all plan the same rest of
//! the area. Where others already fly, it takes the set that their plans leave out. A start waits
//! while another plan is heard. In flight the vehicle notes what it photographs and what others
//! report, for its next start. An area that is photographed as a whole is begun again: that is
//! another round, and waypoints of earlier rounds do not count.

use planner_core::flight::{Path, PicturePlan, WaypointRange, WaypointSet};

use crate::link::photographed::{
    MAX_RANGES, PhotographedReport, RANGE_LEN, decode_range, encode_range,
};
use crate::storage::store::{self, MAX_PROGRAM_LEN};
use crate::time::{Duration, Instant};

/// Most ranges of waypoints known to be photographed; a waypoint that fits into none is
/// photographed again.
pub const MAX_PHOTOGRAPHED_RANGES: usize = 40;
/// Number of newly photographed waypoints after which the ranges are written to flash again in
/// flight.
const STORE_EVERY_WAYPOINTS: u32 = 10;
/// Time for which a set reported by vehicles in flight, as what their plans leave out, has priority
/// over reports from vehicles on the ground. Vehicles in flight report more often than this.
const FLIGHT_REPORT_LIFETIME: Duration = Duration::from_secs(25);
/// Bytes of a flash record before its ranges: mission CRC and round.
const HEADER_LEN: usize = 5;
const _: () = assert!(HEADER_LEN + MAX_PHOTOGRAPHED_RANGES * RANGE_LEN <= MAX_PROGRAM_LEN);

/// How far the flight of this vehicle is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FlightStage {
    /// On its pad before it prepares its take-off, where it has to compute the same plan as the
    /// others.
    OnPad,
    /// It prepares its take-off or has taken off, and has not finished: it may photograph further
    /// waypoints.
    UnderWay,
    /// Finished or given up.
    Over,
}

/// Whose plans the next plan of this vehicle has to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PlanningPartners {
    /// Nobody's: it has its plan, and flies it or has flown it.
    Nobody,
    /// Those of the vehicles in flight.
    ThoseInFlight,
    /// Those of all other vehicles, in flight and on the ground.
    All,
}

/// The photographed waypoints of an area.
#[derive(Clone, Debug, Default)]
pub(crate) struct PhotographedWaypoints {
    /// Number of times that the area was begun again from its first waypoint.
    round: u8,
    /// Waypoints that this vehicle's plan leaves out, or its next plan will.
    left_out_by_plan: WaypointSet<MAX_PHOTOGRAPHED_RANGES>,
    /// Waypoints of this round that are known to be photographed.
    known: WaypointSet<MAX_PHOTOGRAPHED_RANGES>,
    /// Number of known waypoints in the last flash record.
    stored_count: u32,
    /// Whether `left_out_by_plan` has changed since the plan was requested.
    left_out_set_changed: bool,
    /// Round for which the plan was requested.
    planned_round: u8,
    /// Whether the vehicle has left its pad since the plan was requested.
    has_left_pad: bool,
    /// When a vehicle in flight last reported what its plan leaves out; `None` before.
    flight_report_at: Option<Instant>,
    /// Index of the first range of the next report, in the set that is reported.
    next_range: usize,
    /// Whether the last report was of the waypoints that the plan leaves out.
    last_report_was_left_out: bool,
}

impl PhotographedWaypoints {
    /// Restores the waypoints from a flash record, if that is of this mission.
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

    /// The flash record to be written now. `None` unless at least 10 more waypoints
    /// (`STORE_EVERY_WAYPOINTS`; on the ground one more) are known than in the last record, or
    /// fewer than in it.
    pub(crate) fn record_to_store(
        &mut self,
        mission_crc: u32,
        stage: FlightStage,
    ) -> Option<store::PhotographedRecord> {
        let count = self.known.count();
        let new = if stage == FlightStage::UnderWay { STORE_EVERY_WAYPOINTS } else { 1 };
        // Fewer waypoints than in the last record belong to another round.
        if (self.stored_count..self.stored_count + new).contains(&count) {
            return None;
        }
        self.stored_count = count;
        let mut kept = store::PhotographedRecord::new();
        // All fit: mission CRC, round and the most ranges are no longer than a block.
        let _ = kept.extend_from_slice(&mission_crc.to_le_bytes());
        let _ = kept.push(self.round);
        self.known
            .ranges()
            .iter()
            .for_each(|range| _ = kept.extend_from_slice(&encode_range(range)));
        Some(kept)
    }

    /// Prepares the request for a plan of the rest of the area: it leaves out the known waypoints,
    /// or, if the vehicle has not flown since its last request, those agreed on the ground.
    pub(crate) fn prepare_plan_of_rest(&mut self) {
        if self.has_left_pad {
            self.left_out_by_plan = self.known.clone();
        }
        self.note_plan_requested();
    }

    /// Prepares the request for a plan of a new round: it leaves out no waypoint.
    pub(crate) fn prepare_plan_of_new_round(&mut self) {
        self.begin_round();
        self.left_out_by_plan.clear();
        self.note_plan_requested();
    }

    /// Notes that a plan of the present round is requested, for a flight from the pad.
    fn note_plan_requested(&mut self) {
        (self.planned_round, self.has_left_pad, self.left_out_set_changed) =
            (self.round, false, false);
    }

    /// Waypoints that the vehicle's plan leaves out.
    pub(crate) fn waypoints_left_out(&self) -> &[WaypointRange] {
        self.left_out_by_plan.ranges()
    }

    /// Whether the waypoints that the plan is to leave out have changed since the plan was
    /// requested.
    pub(crate) fn has_left_out_set_changed(&self) -> bool {
        self.left_out_set_changed
    }

    /// Number of waypoints known to be photographed.
    pub(crate) fn count(&self) -> u32 {
        self.known.count()
    }

    /// Notes that the vehicle leaves its pad. If the waypoints to be left out were the whole area,
    /// the plan covers all of it again and a new round begins, unless a vehicle that left before
    /// has reported that round.
    pub(crate) fn note_pad_left(&mut self, photographs: &PicturePlan) {
        self.has_left_pad = true;
        let whole = photographs.area_waypoint_count() > 0
            && self.left_out_by_plan.count() >= photographs.area_waypoint_count();
        if whole && self.round == self.planned_round {
            self.begin_round();
        }
    }

    /// Begins a new round: the known waypoints, of the earlier round, no longer count.
    fn begin_round(&mut self) {
        self.round = self.round.wrapping_add(1);
        self.known.clear();
    }

    /// Adds the waypoints that these pictures of the path show.
    pub(crate) fn note_pictures<const W: usize>(
        &mut self,
        photographs: &PicturePlan,
        path: &Path<W>,
        pictures: WaypointRange,
    ) {
        // A waypoint for which no range is left is photographed again.
        photographs
            .waypoints_of_pictures(path, pictures)
            .for_each(|range| _ = self.known.insert(range));
    }

    /// Handles another vehicle's report of photographed waypoints; `planning`: whose plans that of
    /// this vehicle has to fit.
    pub(crate) fn handle_report(
        &mut self,
        report: &PhotographedReport,
        planning: PlanningPartners,
        now: Instant,
    ) {
        if report.are_ranges_left_out_by_plan {
            if planning != PlanningPartners::Nobody {
                self.adopt_left_out_waypoints(report, now);
            }
            return;
        }
        let newer = report.round.wrapping_sub(self.round);
        if newer > 127 {
            return;
        }
        let follows = self.flight_report_at.is_some_and(|at| now - at <= FLIGHT_REPORT_LIFETIME);
        let plans = planning == PlanningPartners::All && !report.flies && !follows;
        if newer > 0 {
            self.round = report.round;
            self.known.clear();
            if plans {
                self.left_out_set_changed |= !self.left_out_by_plan.is_empty();
                self.left_out_by_plan.clear();
            }
        }
        for range in &report.ranges {
            let _ = self.known.insert(*range);
            if plans {
                self.left_out_set_changed |= self.left_out_by_plan.insert(*range) == Ok(true);
            }
        }
    }

    /// Leaves out of the next plan the waypoints that are left out by the plan of a vehicle that
    /// has already started.
    fn adopt_left_out_waypoints(&mut self, report: &PhotographedReport, now: Instant) {
        self.flight_report_at = Some(now);
        if self.left_out_by_plan.ranges() != &report.ranges[..] {
            self.left_out_by_plan.clear();
            report.ranges.iter().for_each(|range| _ = self.left_out_by_plan.insert(*range));
            self.left_out_set_changed = true;
        }
    }

    /// This vehicle's next report: 19 ranges (`MAX_RANGES`) of the known waypoints in turn; on the
    /// pad, of the waypoints that the plan leaves out. In flight every other report has the
    /// waypoints that the plan leaves out, if they fit into one report.
    pub(crate) fn next_report(&mut self, stage: FlightStage) -> PhotographedReport {
        let flies = stage == FlightStage::UnderWay;
        let plan = flies
            && !self.last_report_was_left_out
            && self.left_out_by_plan.ranges().len() <= MAX_RANGES;
        self.last_report_was_left_out = plan;
        if plan {
            let ranges = self.left_out_by_plan.ranges().iter().copied().collect();
            return PhotographedReport {
                round: self.round,
                flies,
                are_ranges_left_out_by_plan: plan,
                ranges,
                ..PhotographedReport::default()
            };
        }
        let done = if stage == FlightStage::OnPad { &self.left_out_by_plan } else { &self.known };
        let first = if self.next_range < done.ranges().len() { self.next_range } else { 0 };
        self.next_range = first + MAX_RANGES;
        let ranges = done.ranges().iter().skip(first).take(MAX_RANGES).copied().collect();
        PhotographedReport { round: self.round, flies, ranges, ..PhotographedReport::default() }
    }
}
