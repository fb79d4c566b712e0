//! What the landing detector's and the HEARTBEAT's reports say now.

use super::{MAX_HEARTBEAT_AGE, MAX_HEARTBEAT_GAP, MAX_POSITION_AGE, Telemetry};
use crate::autopilot::landed::RISEN_M;
use crate::time::{Duration, Instant};

impl Telemetry {
    /// Whether the landing detector last reported flight.
    pub fn last_reported_flight(&self) -> bool {
        self.landed.is_some_and(|report| !report.on_ground)
    }

    /// Whether the landing detector last reported the ground, however long ago.
    pub(crate) fn last_reported_ground(&self) -> bool {
        self.landed.is_some_and(|report| report.on_ground)
    }

    /// Whether the landing detector's last report is of the ground and at most 1.2 s old.
    pub(in crate::autopilot) fn lately_reported_ground(&self, now: Instant) -> bool {
        self.landed.is_some_and(|report| report.is_recent_ground(now))
    }

    /// Whether the landing detector's last report is of the ground and still holds. While the
    /// vehicle rests disarmed it holds however old it is. Else it holds for 3 s while the vehicle
    /// is known not to have risen, or for 0.4 s.
    pub fn reports_ground(&self, now: Instant) -> bool {
        let known = self.position_age(now) < MAX_POSITION_AGE;
        let z_m = if known { self.position.z } else { f32::NAN };
        self.landed.is_some_and(|report| match self.rests_disarmed(now) {
            true => report.on_ground,
            false => report.still_says_ground(z_m, now),
        })
    }

    /// Whether the last HEARTBEAT says that the motors are off, and the vehicle has not flown
    /// since: while HEARTBEAT is silent, neither the landing detector nor the height shows flight.
    pub(crate) fn rests_disarmed(&self, now: Instant) -> bool {
        let heard = self.heartbeat_age(now) < MAX_HEARTBEAT_AGE;
        let risen = self.position.z > self.heartbeat_z_m + RISEN_M;
        !self.armed && (heard || !(risen || self.last_reported_flight()))
    }

    /// Time for which HEARTBEATs have come without a gap of 4.5 s ([`MAX_HEARTBEAT_GAP`]); zero in
    /// such a gap.
    pub(crate) fn heartbeats_heard_for(&self, now: Instant) -> Duration {
        match self.heartbeat_age(now) > MAX_HEARTBEAT_GAP {
            true => Duration::default(),
            false => now - self.heartbeats_since,
        }
    }
}
