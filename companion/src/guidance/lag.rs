//! The setpoint waits for a vehicle that lags behind it; how long the vehicle has not come to its
//! setpoint.

use super::{ARRIVED_WITHIN_M, Guidance};
use crate::autopilot::telemetry::Telemetry;
use crate::time::{Duration, Instant};
use planner_core::Length;

impl Guidance {
    /// Share of the nominal speed at which the setpoint advances: 1 while its lead over the vehicle
    /// is at most half of the greatest lead, 0 at the greatest lead (`max_lead_m`); never more than
    /// `estimate_speed_share`. To be called each step.
    pub(super) fn lag_speed_share(&mut self, telemetry: &Telemetry, now: Instant) -> f32 {
        let place = self.smoother.position();
        let lead_m = self.distance_to_setpoint_m(telemetry);
        let advance = place - self.setpoint_when_followed;
        // The vehicle's own speed does not count: the wind may carry it away from its setpoint.
        if lead_m < ARRIVED_WITHIN_M || advance.norm_squared() > ARRIVED_WITHIN_M * ARRIVED_WITHIN_M
        {
            (self.followed_or_advanced_at, self.setpoint_when_followed) = (now, place);
        }
        let share = ((self.max_lead_m - lead_m) / (0.5 * self.max_lead_m)).clamp(0.0, 1.0);
        share.min(self.estimate_speed_share)
    }

    /// Share of full speed at which the smoother's clock runs while the vehicle is not to fly on: 0
    /// until the raw point was set back to the setpoint, so that the setpoint brakes; then 1, so
    /// that it holds its place, or before the take-off follows the position estimate.
    pub(super) fn standing_speed_share(&self) -> f32 {
        if self.raw_point_at_setpoint { 1.0 } else { 0.0 }
    }

    /// Time for which the vehicle has not been at its setpoint, and the setpoint has not advanced
    /// either: something holds the vehicle, or the wind carries it away.
    pub(crate) fn unfollowed_for(&self, now: Instant) -> Duration {
        now - self.followed_or_advanced_at
    }

    /// Distance of the vehicle from its setpoint, metres.
    pub(crate) fn distance_to_setpoint_m(&self, telemetry: &Telemetry) -> f32 {
        (telemetry.position - self.smoother.position()).length()
    }
}
