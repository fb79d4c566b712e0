//! The safety filter: it stops any motion that may bring two vehicles together, whatever was
//! planned, commanded or reported.
//!
//! In each step it compares the places that this vehicle can no longer avoid with those where each
//! neighbour can be ([`planner_core::track::safety`]). Where the two come too near, the vehicle
//! stops. It continues once the next metre of its path is free. If it is the one of the two that
//! yields, it also waits until the part of the neighbour's path flown in 3 s is free, or the
//! neighbour stands. In a descent the vehicle that yields climbs back up its own column. The filter
//! trusts no gates, progress or advice: gates only decide which of two stopped vehicles goes first.
//!
//! ENU metres. Cost: a cheap bound for each neighbour, a reachable set for each one that may be
//! within reach; more than four of those stop the vehicle.

mod conflict;
mod step;

use crate::config::limits::Urgency;
use crate::time::{Duration, Instant};

/// Length of the path ahead that has to be free before a stopped vehicle continues, metres.
const RESUME_CLEAR_M: f32 = 1.0;
/// Time for which the path ahead has to be free before a stopped vehicle continues.
const RESUME_CLEAR_FOR: Duration = Duration::from_millis(300);
/// Greatest depth of the ground between pad and goal below the lower of both, metres: less than a
/// storey.
const MAX_GROUND_BELOW_PAD_M: f32 = 2.0;
/// Longest stop for a stranger, a vehicle that the roster does not name; after it this vehicle
/// continues slowly.
const PASS_STRANGER_AFTER: Duration = Duration::from_secs(10);
/// Share of its speed at which a vehicle continues after [`PASS_STRANGER_AFTER`].
const PASS_STRANGER_SPEED_SHARE: f32 = 0.15;
/// Greatest speed of the setpoint at which the reference, not the setpoint, decides whether the
/// vehicle flies back along its path, m/s.
const MAX_SETPOINT_WHEN_TURNING_MPS: f32 = 0.05;
/// A setpoint that is further than this behind the reference still flies forward along the path,
/// metres.
const MAX_LAG_WHEN_TURNING_M: f32 = 0.03;
/// A vehicle nearer than this to its advised stop counts as standing there, metres: a little more
/// than the distance that advice looks ahead. A gate no further than this before or behind the
/// reference counts as the one that the vehicle waits at.
const AT_ADVISED_STOP_M: f32 = 0.6;
/// A vehicle that the filter kept from continuing within this time still counts as hindered.
const HINDERED_WITHIN: Duration = Duration::from_millis(500);
/// Time without a hindrance by the filter after which the next one begins a new count.
const UNHINDERED_AFTER: Duration = Duration::from_secs(5);
/// A vehicle that yields in its descent climbs back up its column after standing for this long.
const ABORT_DESCENT_AFTER: Duration = Duration::from_secs(1);

/// A neighbour that may come nearer to this vehicle than the distance to be kept from it.
struct FilterConflict {
    /// System id of the neighbour.
    id: u8,
    /// Whether this vehicle yields to the neighbour.
    own_yields: bool,
    /// Whether the roster does not name the neighbour.
    stranger: bool,
    /// Whether the neighbour is on the ground, or has been silent for so long that it counts as
    /// lost.
    is_grounded_or_lost: bool,
}

/// State of the safety filter after the last step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SafetyFilter {
    /// Since when the filter has kept the vehicle stopped; `None` while it does not.
    stopped_since: Option<Instant>,
    /// Since when, in this stop, the path ahead has been free; `None` while it is not, or without a
    /// stop.
    path_clear_since: Option<Instant>,
    /// MAVLink system id of the neighbour that the filter stops for; 0 for none.
    blocker_id: u8,
    /// Whether this vehicle yields to the neighbour that the filter stops for.
    yields_to_blocker: bool,
    /// Whether the neighbour that the filter stops for is on the ground, or lost.
    blocker_is_grounded_or_lost: bool,
    /// Whether the neighbour that the filter stops for is a stranger.
    blocker_is_stranger: bool,
    /// Whether this vehicle's reachable set conflicted with that of a neighbour in the last step.
    sets_conflict: bool,
    /// Whether the filter checked the path backwards in the last step: the vehicle flies back or is
    /// about to.
    scanned_backwards: bool,
    /// Whether no other vehicle may be in the column to the ground, or before take-off to the top
    /// of the climb; true where no column is checked.
    column_clear: bool,
    /// Since when `column_clear` has had its value; `None` before the first check.
    column_clear_changed_at: Option<Instant>,
    /// Since when a vehicle that is on the ground, or lost, has been in that column; `None` while
    /// none is.
    column_blocked_for_good_since: Option<Instant>,
    /// Since when this landing has been waiting for a free column; times at which the column was
    /// free do not end the wait.
    column_wait_since: Option<Instant>,
    /// Since when the filter has kept the vehicle from continuing; gaps shorter than
    /// [`UNHINDERED_AFTER`] count as part of that time.
    hindered_since: Instant,
    /// When the filter last kept the vehicle from continuing.
    last_hindered_at: Instant,
    /// Whether this vehicle was to yield when the filter last kept it from continuing.
    yielded_when_hindered: bool,
    /// When the filter last kept the vehicle from continuing because of a neighbour that comes down
    /// unheard.
    blocked_by_unheard_descent_at: Instant,
    /// Number of times that the filter stopped the vehicle.
    stop_count: u32,
}

/// Direction in which this vehicle flies or is about to fly.
#[derive(Clone, Copy, PartialEq)]
enum FlightDirection {
    /// The vehicle keeps its place.
    Stands,
    /// Along the path.
    Ahead,
    /// Back along the path.
    Back,
    /// Straight up or down, to the height `to_m`.
    Vertical { to_m: f32, speed_mps: f32 },
}

impl SafetyFilter {
    /// Time for which the filter has kept the vehicle stopped.
    pub(crate) fn stopped_for(&self, now: Instant) -> Duration {
        self.stopped_since.map_or(Duration::default(), |at| now - at)
    }

    /// Whether the filter keeps the vehicle stopped, or lets it only pass a stranger slowly.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped_since.is_some()
    }

    /// Time for which the filter has kept the vehicle from continuing although the vehicle goes
    /// first; zero if it has not done so within the last `free`.
    pub(crate) fn blocked_with_priority_for(&self, now: Instant, free: Duration) -> Duration {
        let blocked = !self.yielded_when_hindered && now - self.last_hindered_at < free;
        if blocked { now - self.hindered_since } else { Duration::default() }
    }

    /// Time for which the filter has kept the vehicle from continuing because of a neighbour that
    /// is on the ground, or lost.
    pub(crate) fn blocked_for_good_for(&self, now: Instant) -> Duration {
        if self.blocker_is_grounded_or_lost { self.hindered_for(now) } else { Duration::default() }
    }

    /// Time for which the filter has kept the vehicle from continuing so that another one goes
    /// first.
    pub(crate) fn yielded_for(&self, now: Instant) -> Duration {
        if self.yielded_when_hindered { self.hindered_for(now) } else { Duration::default() }
    }

    /// Whether the filter checked the path backwards in this step.
    pub(super) fn scans_backwards(&self) -> bool {
        self.scanned_backwards
    }

    /// Whether the filter stops the vehicle for a neighbour that goes first.
    pub(super) fn is_yielding(&self) -> bool {
        self.yields_to_blocker
    }

    /// System id of the neighbour that the filter stops for; 0 for none.
    pub(crate) fn blocker_id(&self) -> u8 {
        if self.is_stopped() { self.blocker_id } else { 0 }
    }

    /// System id of the neighbour that the filter stops for, or stopped for last.
    pub(crate) fn last_blocker_id(&self) -> u8 {
        self.blocker_id
    }

    /// Number of times that the filter stopped the vehicle.
    pub(crate) fn stop_count(&self) -> u32 {
        self.stop_count
    }

    /// Time for which another vehicle may have been in the column to the ground, or before take-off
    /// to the top of the climb.
    pub(crate) fn column_blocked_for(&self, now: Instant) -> Duration {
        self.column_clear_changed_at
            .filter(|_| !self.column_clear)
            .map_or(Duration::default(), |at| now - at)
    }

    /// Time for which a vehicle that is on the ground, or lost, has been in the column to the
    /// ground, or before take-off to the top of the climb.
    pub(crate) fn column_blocked_for_good_for(&self, now: Instant) -> Duration {
        self.column_blocked_for_good_since.map_or(Duration::default(), |at| now - at)
    }

    /// Time for which the column to the ground, or before take-off to the top of the climb, has
    /// been free of other vehicles.
    pub(crate) fn column_clear_for(&self, now: Instant) -> Duration {
        self.column_clear_changed_at
            .filter(|_| self.column_clear)
            .map_or(Duration::default(), |at| now - at)
    }

    /// Time since this landing first had to wait for a free column; times at which the column was
    /// free do not end the wait.
    fn column_wait_for(&self, now: Instant) -> Duration {
        self.column_wait_since.map_or(Duration::default(), |at| now - at)
    }

    /// Time for which the filter has kept the vehicle from continuing, stops and short flights
    /// between them together.
    pub(crate) fn hindered_for(&self, now: Instant) -> Duration {
        let hindered = now - self.last_hindered_at < HINDERED_WITHIN;
        if hindered { now - self.hindered_since } else { Duration::default() }
    }

    /// Time since the filter last kept the vehicle from continuing because of a neighbour that
    /// comes down unheard, and so is soon out of this vehicle's path.
    pub(crate) fn time_since_blocked_by_unheard_descent(&self, now: Instant) -> Duration {
        now - self.blocked_by_unheard_descent_at
    }

    /// Whether in the last step no other vehicle could be in the column to the ground, or before
    /// take-off to the top of the climb; true where no column is checked.
    pub(crate) fn column_clear(&self) -> bool {
        self.column_clear
    }

    /// Forgets all but the number of stops.
    pub(super) fn reset(&mut self) {
        *self = Self { stop_count: self.stop_count, ..Self::default() };
    }

    /// [`Urgency::Urgent`] in a step in which the filter stops the vehicle. Once it may pass a
    /// stranger slowly, that is only while its reachable set conflicts with a neighbour's: else it
    /// flies on.
    pub(super) fn urgency(&self, now: Instant) -> Urgency {
        match self.is_stopped() && (self.sets_conflict || !self.passes_stranger(now)) {
            true => Urgency::Urgent,
            false => Urgency::Smooth,
        }
    }

    /// Share of the nominal speed at which the vehicle may fly: less than 1 past a stranger.
    pub(super) fn speed_scale(&self, now: Instant) -> f32 {
        if self.passes_stranger(now) { PASS_STRANGER_SPEED_SHARE } else { 1.0 }
    }

    /// Whether the vehicle, stopped for a stranger for long enough, flies slowly past it.
    fn passes_stranger(&self, now: Instant) -> bool {
        self.blocker_is_stranger && self.stopped_for(now) >= PASS_STRANGER_AFTER
    }

    /// Whether the vehicle, stopped in its descent, is to climb back up its column.
    pub(super) fn climbs_back(&self, now: Instant) -> bool {
        self.yields_to_blocker && self.stopped_for(now) >= ABORT_DESCENT_AFTER
    }
}

impl SafetyFilter {
    /// Notes that a neighbour keeps the vehicle from continuing, and whether the vehicle yields to
    /// it (`yields_to_blocker`).
    fn note_hindered(&mut self, now: Instant) {
        if now - self.last_hindered_at > UNHINDERED_AFTER {
            self.hindered_since = now;
        }
        (self.last_hindered_at, self.yielded_when_hindered) = (now, self.yields_to_blocker);
    }

    /// Updates since when the column has been free or occupied; `found`: a neighbour that may be in
    /// it.
    fn update_column(&mut self, found: Option<&FilterConflict>, now: Instant) {
        let clear = found.is_none();
        let rests = found.is_some_and(|found| found.is_grounded_or_lost);
        self.column_blocked_for_good_since =
            self.column_blocked_for_good_since.or(Some(now)).filter(|_| rests);
        if !clear {
            self.column_wait_since.get_or_insert(now);
        }
        if clear != self.column_clear || self.column_clear_changed_at.is_none() {
            (self.column_clear, self.column_clear_changed_at) = (clear, Some(now));
        }
    }

    /// Ends the stop; the times of hindrances stay.
    fn reset_stop(&mut self) {
        (self.stopped_since, self.path_clear_since) = (None, None);
        (self.yields_to_blocker, self.blocker_is_stranger, self.blocker_is_grounded_or_lost) =
            (false, false, false);
    }
}
