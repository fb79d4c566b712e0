//! The landing detector's last report (EXTENDED_SYS_STATE), and how long it holds: its stream may
//! end while the vehicle stands on its pad.

use crate::time::{Duration, Instant};

/// Rise of the estimated height, since the vehicle was last known to be on the ground, from which
/// it counts as risen, whatever the landing detector reports, metres. An error that both heights
/// share cancels out.
pub(super) const RISEN_M: f32 = 0.25;
/// Age up to which a report of the ground holds whatever the position: reports come at 5 Hz.
const SURELY_VALID_FOR: Duration = Duration::from_millis(400);
/// Age up to which a report of the ground holds while the vehicle has not risen since.
const VALID_UNLESS_RISEN_FOR: Duration = Duration::from_millis(3000);

/// Greatest age of the last report of a stream at 1 Hz, the default of PX4 where a request for 5 Hz
/// is lost.
const MAX_SLOW_STREAM_REPORT_AGE: Duration = Duration::from_millis(1200);

/// What the landing detector reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LandedReport {
    /// Whether the vehicle is on the ground.
    pub(super) on_ground: bool,
    /// When the report was received.
    pub(super) received_at: Instant,
    /// Estimated height in the mission frame at that time, metres.
    pub(super) z_m: f32,
}

impl LandedReport {
    /// Whether the report says that the vehicle is on the ground, and is no older than one of a
    /// slow stream.
    pub(super) fn is_recent_ground(&self, now: Instant) -> bool {
        self.on_ground && now - self.received_at <= MAX_SLOW_STREAM_REPORT_AGE
    }

    /// Whether the report says that the vehicle is on the ground, and still holds: it is at most
    /// 0.4 s old, or at most 3 s old and the vehicle, at the estimated height `z_m` now, has not
    /// risen since. NaN is an unknown height and counts as risen.
    pub(super) fn still_says_ground(&self, z_m: f32, now: Instant) -> bool {
        let rests = z_m < self.z_m + RISEN_M;
        self.on_ground
            && now - self.received_at
                <= if rests { VALID_UNLESS_RISEN_FOR } else { SURELY_VALID_FOR }
    }
}
