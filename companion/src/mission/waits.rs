//! Two kinds of waits of a vehicle: for another one that has not started, reported so that the
//! operator sees why the swarm waits; and on its own pad while something bars its start.
//!
//! Each call does constant work.

use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

/// Time for which a vehicle waits for one that has not started before it reports that, and between
/// two reports.
const REPORT_WAIT_AFTER: Duration = Duration::from_secs(30);

/// Time without a vehicle or an obstacle that bars the start after which the start counts as no
/// longer barred.
const UNBARRED_AFTER: Duration = Duration::from_secs(5);

/// The waits of a mission.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Waits {
    /// The wait for another vehicle that has not started.
    pub(super) unstarted: WaitReport,
    /// How long the start of this vehicle has been barred.
    pub(super) barred_start: BarredStart,
}

/// When the wait for a vehicle that has not started is to be reported.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WaitReport {
    /// System id of the vehicle that this one waits for, 0 for none.
    id: u8,
}

impl WaitReport {
    /// To be called each step with the vehicle that has not started and that this one waits for, 0
    /// for none. Returns whether the wait is to be reported now, every 30 s (`REPORT_WAIT_AFTER`).
    pub(crate) fn should_report(&mut self, id: u8, now: Instant, timers: &mut Timers) -> bool {
        if id != self.id {
            self.id = id;
            timers.set(Timer::WaitReport, now + REPORT_WAIT_AFTER);
        }
        id != 0 && timers.take_due(Timer::WaitReport, now, REPORT_WAIT_AFTER)
    }
}

/// Since when the start of this vehicle has been barred, and when it last was. Gaps of up to 5 s
/// (`UNBARRED_AFTER`) do not interrupt it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BarredStart {
    /// When the start was first barred, short gaps included; `None` if it is not barred.
    since: Option<Instant>,
    /// When the start was last barred.
    barred_at: Instant,
}

impl BarredStart {
    /// To be called each step in which a vehicle or an obstacle bars the start.
    pub(crate) fn note_barred(&mut self, now: Instant) {
        self.since.get_or_insert(now);
        self.barred_at = now;
    }

    /// To be called each step in which nothing bars the start.
    pub(crate) fn note_free(&mut self, now: Instant) {
        if now - self.barred_at > UNBARRED_AFTER {
            self.since = None;
        }
    }

    /// Time for which the start has been barred, short gaps included; zero if it is not.
    pub(crate) fn barred_for(&self, now: Instant) -> Duration {
        self.since.map_or(Duration::default(), |since| now - since)
    }
}
