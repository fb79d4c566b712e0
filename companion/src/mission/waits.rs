//! A vehicle of the mission that never starts is named while this one waits for it: the operator sees why the swarm waits.
//!
//! Constant work.

use crate::time::{Duration, Instant};

/// Time for which a vehicle waits for one that has not started before it reports that, and time
/// between two reports.
const REPORT_WAIT_AFTER: Duration = Duration::from_secs(30);

/// The vehicle that this one waits for, and since when, or since the wait was reported last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WaitReport {
    id: u8,
    since: Instant,
}

impl WaitReport {
    /// After each step: it waits for the vehicle `id` that has not started, or for none (0). Returns whether that is to be named.
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
