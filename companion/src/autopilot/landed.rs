//! The landing detector's last report (EXTENDED_SYS_STATE), and how long it holds: its stream may
//! end while the vehicle stands on its pad.

use crate::autopilot::arming::RISEN_M;
use crate::autopilot::telemetry::{MAX_POSITION_AGE, Telemetry};
use crate::time::{Duration, Instant};

/// Age up to which a report of the ground holds whatever the position: reports come at 5 Hz.
const SURELY_VALID_FOR: Duration = Duration::from_millis(400);
/// Age up to which a report of the ground holds while the vehicle has not risen since.
const VALID_ON_PAD_FOR: Duration = Duration::from_millis(3000);

/// What the landing detector reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LandedReport {
    /// Whether the vehicle is on the ground.
    pub(super) on_ground: bool,
    /// When the report was received.
    pub(super) at: Instant,
    /// Estimated height then, metres.
    pub(super) z_m: f32,
}

impl Telemetry {
    /// Whether the landing detector last reported flight.
    pub fn reports_flight(&self) -> bool {
        self.landed.is_some_and(|report| !report.on_ground)
    }

    /// Whether the landing detector reports the ground: its last report says so, and is new, or the
    /// vehicle has not risen since.
    pub fn reports_ground(&self, now: Instant) -> bool {
        let Some(report) = self.landed.filter(|report| report.on_ground) else { return false };
        let rests =
            self.position_age(now) < MAX_POSITION_AGE && self.position.z < report.z_m + RISEN_M;
        now - report.at <= if rests { VALID_ON_PAD_FOR } else { SURELY_VALID_FOR }
    }
}
