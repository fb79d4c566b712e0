//! A vehicle that stands says that it will continue standing, so that others may pass it closely.
//!
//! Of a vehicle that was heard to stand half a second ago others must assume that it has begun to
//! fly since. Two that stopped for one another would therefore never continue. So a vehicle that
//! was stopped reports no way ahead of its setpoint, and does not move before the others have heard
//! of a way again: [`HOLD_REPORT_LIFETIME`] after it last reported none, and the time that its
//! messages take. The vehicle that yields reports so at once, the other one only when it has stood
//! for a while ([`FIRST_STANDSTILL`]), so that it goes first.
//!
//! ENU metres.

use crate::time::{Duration, Instant};

/// Time for which a reported hold counts: longer than three reports in a row are lost.
const HOLD_REPORT_LIFETIME: Duration = Duration::from_millis(1000);
/// Standstill after which a vehicle that yields reports that it holds.
const YIELDING_STANDSTILL: Duration = Duration::from_millis(300);
/// Standstill after which a vehicle that goes first reports that it holds: the others have this
/// long to stand.
const FIRST_STANDSTILL: Duration = Duration::from_secs(4);

/// Hold state of the vehicle, and when it was reported.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Hold {
    since: Option<Instant>,
    on: bool,
    /// When that was last sent to others, and how late they hear it.
    reported_at: Option<Instant>,
    message_delay: Duration,
}

impl Hold {
    /// One step; `stands` for a vehicle that stands and is not to move, `yields` if another one
    /// goes first. Messages are `late_s` late. Returns whether the vehicle begins or ends to hold.
    pub(super) fn step(&mut self, stands: bool, yields: bool, late_s: f32, now: Instant) -> bool {
        if stands {
            self.message_delay = Duration::from_micros((late_s * 1e6) as u64);
        }
        self.since = self.since.or(Some(now)).filter(|_| stands);
        let patience = if yields { YIELDING_STANDSTILL } else { FIRST_STANDSTILL };
        let on = self.since.is_some_and(|since| now - since >= patience || self.on);
        core::mem::replace(&mut self.on, on) != on
    }

    /// Whether the vehicle's intents report the hold.
    pub(crate) fn is_on(&self) -> bool {
        self.on
    }

    /// Notes that the hold was reported.
    pub(crate) fn note_reported(&mut self, now: Instant) {
        self.reported_at = Some(now);
    }

    /// Whether other vehicles may still rely on the hold.
    pub(super) fn is_binding(&self, now: Instant) -> bool {
        self.reported_at.is_some_and(|at| now < (at + HOLD_REPORT_LIFETIME) + self.message_delay)
    }
}
