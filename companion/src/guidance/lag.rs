//! The setpoint waits for a vehicle that lags behind it, and how long it has waited in vain.

use super::{ARRIVED_M, AT_REST_MPS, Guidance};
use crate::autopilot::telemetry::Telemetry;
use crate::time::{Duration, Instant};

/// Share of its speed below which a setpoint waits for its vehicle: nearly as far ahead as it may be.
const WAITING_SHARE: f32 = 0.25;

impl Guidance {
    /// Share of its speed at which the setpoint goes on: none where it is as far ahead of the vehicle as it may be.
    /// `moves` for a vehicle that is to fly on.
    pub(super) fn lag_share(&mut self, telemetry: &Telemetry, moves: bool, now: Instant) -> f32 {
        let lead_m = (telemetry.position - self.smoother.position()).norm();
        let share = ((self.lead_m - lead_m) / (0.5 * self.lead_m)).clamp(0.0, 1.0);
        if (lead_m < ARRIVED_M && !(moves && share < WAITING_SHARE))
            || telemetry.velocity.norm() > AT_REST_MPS
        {
            self.followed_at = now;
        }
        match moves {
            true => share.min(self.pace),
            // Settled it holds; before the take-off it follows the estimate.
            false if self.raw_point_at_rest => 1.0,
            false => 0.0,
        }
    }

    /// Time for which the vehicle has stood though its setpoint is ahead: something holds it.
    pub(crate) fn unfollowed_for(&self, now: Instant) -> Duration {
        now - self.followed_at
    }
}
