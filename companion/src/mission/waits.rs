//! Waits that somebody is to know of: for a vehicle that never starts, which is named so that the
//! operator sees why the swarm waits, and of this one, which something keeps on its pad.
//!
//! Constant work.

use crate::time::{Duration, Instant};

/// Time for which a vehicle waits for one that has not started before it reports that, and time
/// between two reports.
const REPORT_WAIT_AFTER: Duration = Duration::from_secs(30);

/// Time without anything in its way after which a start was not barred.
const FREE_AFTER: Duration = Duration::from_secs(5);

/// The waits of a mission.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Waits {
    /// For a vehicle that has not started.
    pub(crate) report: WaitReport,
    /// On the pad.
    pub(crate) barred_start: BarredStart,
}

/// The vehicle that this one waits for, and since when, or since the wait was reported last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WaitReport {
    id: u8,
    since: Instant,
}

impl WaitReport {
    /// After each step: it waits for the vehicle `id` that has not started, or for none (0).
    /// Returns whether that is to be named.
    pub(crate) fn update(&mut self, id: u8, now: Instant) -> bool {
        if id != self.id || id == 0 {
            *self = Self { id, since: now };
        }
        let named = id != 0 && now - self.since >= REPORT_WAIT_AFTER;
        if named {
            self.since = now;
        }
        named
    }
}

/// Since when something has barred the start of this vehicle, and when it last did; short gaps do
/// not count.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BarredStart {
    since: Option<Instant>,
    barred_at: Instant,
}

impl BarredStart {
    /// One step; whether something bars the start.
    pub(crate) fn update(&mut self, barred: bool, now: Instant) {
        if barred {
            self.since.get_or_insert(now);
            self.barred_at = now;
        } else if now - self.barred_at > FREE_AFTER {
            self.since = None;
        }
    }

    /// Time for which the start has been barred.
    pub(crate) fn lasts_for(&self, now: Instant) -> Duration {
        self.since.map_or(Duration::default(), |since| now - since)
    }
}
