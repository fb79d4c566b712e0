//! The safety filter: the last word on every motion, whatever was planned, commanded or reported.
//!
//! In each step it compares what the vehicle can no longer take back with where each neighbour can
//! be ([`planner_core::safety`]). Where the two come too near, the vehicle stops. It continues once
//! the next metre of its way is free. The vehicle that yields also waits until 3 s of the way of
//! the other one are free, or that one stands. In a descent it flies back up its own column. The
//! filter knows no gates, no progress and no advice: it only asks the gates which vehicle goes
//! first where both have stopped.
//!
//! ENU metres. Cost: a bound for each neighbour, sets for those within it; more than four of those
//! is a stop.

mod conflict;
mod look;

use crate::time::{Duration, Instant};

/// Length of the path ahead that has to be free before a stopped vehicle continues, metres.
const RESUME_CLEAR_M: f32 = 1.0;
/// Time for which the path ahead has to be free before a stopped vehicle continues.
const RESUME_CLEAR_FOR: Duration = Duration::from_millis(300);
/// Depth of the ground between pad and goal below the lower of both, metres: less than a storey.
const GROUND_BELOW_PAD_M: f32 = 2.0;
/// Longest standstill for a vehicle that the roster does not name; after it this vehicle continues
/// slowly.
const MAX_STOP_FOR_STRANGER: Duration = Duration::from_secs(10);
/// Share of its speed at which a vehicle continues after [`MAX_STOP_FOR_STRANGER`].
const PAST_STRANGER_SHARE: f32 = 0.15;
/// Fastest setpoint that may reverse along the path, m/s.
const MAX_TURNING_SETPOINT_MPS: f32 = 0.05;
/// Greatest distance between setpoint and reference at which the setpoint may reverse, metres.
const MAX_TURNING_SETPOINT_M: f32 = 0.03;
/// A stop ahead nearer than this is a standstill, metres: a little more than the distance that
/// advice looks ahead.
const STANDSTILL_WITHIN_M: f32 = 0.6;
/// Time for which whatever kept the vehicle from continuing still does.
const HINDERED_WITHIN: Duration = Duration::from_millis(500);
/// Time of unhindered flight after which a vehicle was not kept from continuing.
const FREE_AFTER: Duration = Duration::from_secs(5);
/// A vehicle that yields in its descent climbs back up its column after it has stood for this long.
const ABORT_DESCENT_AFTER: Duration = Duration::from_secs(1);

/// A neighbour whose reachable set intersects that of the vehicle.
struct FilterConflict {
    id: u8,
    yields: bool,
    stranger: bool,
    rests: bool,
}

/// Result of the filter's check.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SafetyFilter {
    /// Since when it keeps the vehicle stopped.
    stopped_since: Option<Instant>,
    /// Since when the way has been free again.
    clear_since: Option<Instant>,
    /// MAVLink system id of the vehicle that it stops for; 0 for none.
    blocker: u8,
    /// Whether this vehicle is the one that yields.
    yields: bool,
    /// Whether the other one rests for good, or is lost.
    blocker_rests: bool,
    blocker_is_stranger: bool,
    /// Whether the sets met in the last step.
    sets_intersect: bool,
    /// Whether it checked the path backwards: the vehicle is about to fly back.
    scanned_backwards: bool,
    /// Whether the column between vehicle and ground is free of others.
    column_clear: bool,
    /// Since when `column_clear` has had its value.
    column_since: Option<Instant>,
    /// Since when a vehicle that stands for good has been in that column.
    column_blocked_for_good_since: Option<Instant>,
    /// Since when a landing has been waiting for the column; short gaps do not end the wait.
    landing_held_since: Option<Instant>,
    /// Since when it has kept the vehicle from continuing, and when it last did; short gaps do not
    /// count.
    hindered_since: Option<Instant>,
    hindered_at: Instant,
    /// Whether it was to yield then.
    hindered_yields: bool,
    /// Number of times that the filter stopped the vehicle.
    activations: u32,
}

/// Direction in which a vehicle is about to fly.
enum FlightDirection {
    Stands,
    /// Along the path, or back.
    Path {
        back: bool,
    },
    /// Straight up or down.
    Vertical {
        to_m: f32,
        speed_mps: f32,
    },
}

impl SafetyFilter {
    /// Time for which the filter has kept the vehicle stopped.
    pub(crate) fn stopped_for(&self, now: Instant) -> Duration {
        self.stopped_since.map_or(Duration::default(), |at| now - at)
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped_since.is_some()
    }

    /// Time for which the filter has kept the vehicle from continuing although the vehicle goes
    /// first; zero once the filter has not for `free`.
    pub(crate) fn blocked_for(&self, now: Instant, free: Duration) -> Duration {
        let since =
            self.hindered_since.filter(|_| !self.hindered_yields && now - self.hindered_at < free);
        since.map_or(Duration::default(), |at| now - at)
    }

    /// Time for which the filter has kept the vehicle from continuing because of a vehicle that
    /// stands for good.
    pub(crate) fn blocked_for_good_for(&self, now: Instant) -> Duration {
        if self.blocker_rests { self.hindered_for(now) } else { Duration::default() }
    }

    /// Time for which the filter has made the vehicle yield.
    pub(crate) fn yielded_for(&self, now: Instant) -> Duration {
        if self.hindered_yields { self.hindered_for(now) } else { Duration::default() }
    }

    /// Whether it looked back along the path in this step.
    pub(super) fn scans_backwards(&self) -> bool {
        self.scanned_backwards
    }

    /// Whether it stops the vehicle for one that goes first.
    pub(super) fn is_yielding(&self) -> bool {
        self.yields
    }

    /// The vehicle that the filter stops for; 0 for none.
    pub(crate) fn blocker(&self) -> u8 {
        if self.is_stopped() { self.blocker } else { 0 }
    }

    /// The vehicle that it stops for, or stopped for last.
    pub(crate) fn last_blocker(&self) -> u8 {
        self.blocker
    }

    /// Number of times that the filter stopped the vehicle.
    pub(crate) fn activation_count(&self) -> u32 {
        self.activations
    }

    /// Time for which the column has not been free.
    pub(crate) fn column_blocked_for(&self, now: Instant) -> Duration {
        self.column_since.filter(|_| !self.column_clear).map_or(Duration::default(), |at| now - at)
    }

    /// Time for which a vehicle that rests, or is lost, has been in the column.
    pub(crate) fn column_blocked_for_good_for(&self, now: Instant) -> Duration {
        self.column_blocked_for_good_since.map_or(Duration::default(), |at| now - at)
    }

    /// Time for which the column has been free.
    pub(crate) fn column_clear_for(&self, now: Instant) -> Duration {
        self.column_since.filter(|_| self.column_clear).map_or(Duration::default(), |at| now - at)
    }

    /// Time for which a landing has been waiting, with interruptions.
    fn landing_held_for(&self, now: Instant) -> Duration {
        self.landing_held_since.map_or(Duration::default(), |at| now - at)
    }

    /// Time for which the filter has kept the vehicle from continuing, stops and short flights
    /// between them together.
    pub(crate) fn hindered_for(&self, now: Instant) -> Duration {
        let since = self.hindered_since.filter(|_| now - self.hindered_at < HINDERED_WITHIN);
        since.map_or(Duration::default(), |at| now - at)
    }

    /// Whether the column to the ground was free in the last step.
    pub(crate) fn column_clear(&self) -> bool {
        self.column_clear
    }

    pub(super) fn reset(&mut self) {
        *self = Self { activations: self.activations, ..Self::default() };
    }

    /// Whether it stops the vehicle now.
    pub(super) fn is_stopping(&self, now: Instant) -> bool {
        self.is_stopped() && (self.sets_intersect || !self.passes_stranger(now))
    }

    /// Share of the nominal speed that it leaves.
    pub(super) fn speed_scale(&self, now: Instant) -> f32 {
        if self.passes_stranger(now) { PAST_STRANGER_SHARE } else { 1.0 }
    }

    fn passes_stranger(&self, now: Instant) -> bool {
        self.blocker_is_stranger && self.stopped_for(now) >= MAX_STOP_FOR_STRANGER
    }

    /// Whether the vehicle, stopped in its descent, is to climb back up its column.
    pub(super) fn climbs_back(&self, now: Instant) -> bool {
        self.yields && self.stopped_for(now) >= ABORT_DESCENT_AFTER
    }
}

impl SafetyFilter {
    fn note_hindered(&mut self, yields: bool, now: Instant) {
        if now - self.hindered_at > FREE_AFTER {
            self.hindered_since = None;
        }
        self.hindered_since.get_or_insert(now);
        (self.hindered_at, self.hindered_yields) = (now, yields);
    }

    fn note_column(&mut self, found: Option<&FilterConflict>, now: Instant) {
        let clear = found.is_none();
        let rests = found.is_some_and(|found| found.rests);
        self.column_blocked_for_good_since =
            self.column_blocked_for_good_since.or(Some(now)).filter(|_| rests);
        if !clear {
            self.landing_held_since.get_or_insert(now);
        }
        if clear != self.column_clear || self.column_since.is_none() {
            (self.column_clear, self.column_since) = (clear, Some(now));
        }
    }

    fn reset_stop(&mut self) {
        (self.stopped_since, self.clear_since) = (None, None);
        (self.yields, self.blocker_is_stranger, self.blocker_rests) = (false, false, false);
    }
}
