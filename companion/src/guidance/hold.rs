//! A vehicle that stands reports that it will stay there, so that others may pass it closely.
//!
//! Others must assume that a vehicle that stood half a second ago has begun to fly since. Two
//! vehicles that stopped for each other would never continue. So a stopped vehicle reports no
//! points ahead of its setpoint. It does not move again until [`MIN_REPORT_LIFETIME`], or
//! [`REPORTS_BEFORE_MOVING`] periods of its reports if that is longer, and the delay of its
//! messages have passed since the last such report, by when the others have heard new points. The
//! vehicle that yields reports its hold at once, the other one only after standing for
//! [`HOLD_AFTER_IF_FIRST`], so that it goes first.
//!
//! ENU metres.

use crate::time::{Duration, Instant};

/// Least time after its last report of a hold for which others rely on it and this vehicle must not
/// move, besides the messages' delay.
const MIN_REPORT_LIFETIME: Duration = Duration::from_millis(1000);
/// Number of periods of reports in that time, at any `FLK_SWARM_HZ`: longer than three lost
/// reports.
const REPORTS_BEFORE_MOVING: u64 = 5;
/// Time of standing after which a vehicle that yields reports that it holds.
pub(super) const HOLD_AFTER_IF_YIELDING: Duration = Duration::from_millis(300);
/// Time of standing after which a vehicle that goes first reports that it holds: time for the
/// others to stop.
pub(super) const HOLD_AFTER_IF_FIRST: Duration = Duration::from_secs(4);

/// Whether the vehicle reports that it holds its place, and when it last reported that.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Hold {
    /// Since when the vehicle has been standing, not to move; `None` while it moves.
    standing_since: Option<Instant>,
    /// Whether the hold has begun: from then on the vehicle's intents report it.
    active: bool,
    /// Until when others rely on the hold that was last sent in an intent, besides the delay of
    /// messages; `None` before.
    relied_on_until: Option<Instant>,
    /// Delay with which others hear an intent.
    message_delay: Duration,
}

impl Hold {
    /// One step in which the vehicle stands and is not to move; after `patience` of standing the
    /// hold begins. `delay_s`: delay of messages, seconds. Returns whether the hold begins.
    pub(super) fn note_standing(&mut self, patience: Duration, delay_s: f32, now: Instant) -> bool {
        self.message_delay = Duration::from_micros((delay_s * 1e6) as u64);
        let since = *self.standing_since.get_or_insert(now);
        let on = now - since >= patience || self.active;
        core::mem::replace(&mut self.active, on) != on
    }

    /// Ends the hold: the vehicle moves, or guidance no longer moves it. Returns whether it had
    /// begun.
    pub(super) fn end(&mut self) -> bool {
        self.standing_since = None;
        core::mem::take(&mut self.active)
    }

    /// Whether the hold has begun: the vehicle's intents then report that it stops at its setpoint.
    pub(crate) fn is_reported(&self) -> bool {
        self.active
    }

    /// Notes that an intent with the hold was sent, `report_hz` of which are sent each second.
    pub(crate) fn note_reported(&mut self, now: Instant, report_hz: u8) {
        let reports = Duration::from_millis(1000 * REPORTS_BEFORE_MOVING / u64::from(report_hz));
        self.relied_on_until = Some(now + reports.max(MIN_REPORT_LIFETIME));
    }

    /// Whether other vehicles may still rely on the hold, so that this one must not move.
    pub(super) fn is_binding(&self, now: Instant) -> bool {
        self.relied_on_until.is_some_and(|until| now < until + self.message_delay)
    }
}
