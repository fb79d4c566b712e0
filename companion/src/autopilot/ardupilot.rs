//! ArduCopter's numbers: flight modes, setpoint masks, the estimator's flags and the streams a
//! companion needs. Source: ArduCopter 4.6 `mode.h`, `GCS_MAVLink_Copter.cpp` and what its
//! recording shows. The shape is that of `px4`.

use crate::autopilot::limits::{Limit, LimitParameter};

/// GUIDED, `custom_mode` of HEARTBEAT.
pub const GUIDED: u32 = 4;
/// LAND.
pub const LAND: u32 = 9;
/// RTL.
pub const RTL: u32 = 6;
/// BRAKE: stops and holds, whatever the sticks say.
pub const BRAKE: u32 = 17;

/// Position, with velocity as feed-forward. Acceleration is left out: 0xC00 was not seen to fly.
pub const MASK_POSITION_VELOCITY: u16 = 0xDC0;

/// Lead of a setpoint's velocity, seconds: Guided closes an error of velocity with `WPNAV_ACCEL` /
/// `PSC_JERK_XY`, and the recording's circle is flown 0.6 s behind. Acceleration over this time
/// replaces the acceleration that is left out.
pub const VELOCITY_LEAD_S: f32 = 0.5;

/// Parameters that limit what it flies, with 4.6's defaults; centimetres but for the jerk.
pub const LIMITS: [LimitParameter; 8] = [
    LimitParameter { name: "WPNAV_SPEED", limit: Limit::Speed, unit: 0.01, default: 1000.0 },
    LimitParameter { name: "WPNAV_SPEED_UP", limit: Limit::Climb, unit: 0.01, default: 250.0 },
    LimitParameter { name: "WPNAV_SPEED_DN", limit: Limit::Descend, unit: 0.01, default: 150.0 },
    LimitParameter { name: "WPNAV_ACCEL", limit: Limit::Accel, unit: 0.01, default: 250.0 },
    LimitParameter { name: "WPNAV_ACCEL_Z", limit: Limit::AccelUp, unit: 0.01, default: 100.0 },
    LimitParameter { name: "WPNAV_ACCEL_Z", limit: Limit::AccelDown, unit: 0.01, default: 100.0 },
    LimitParameter { name: "PSC_JERK_XY", limit: Limit::Jerk, unit: 1.0, default: 5.0 },
    LimitParameter { name: "PSC_JERK_Z", limit: Limit::JerkZ, unit: 1.0, default: 5.0 },
];

/// Velocity alone: with zero, stop wherever that is.
pub const MASK_VELOCITY: u16 = 0xDC7;

/// Parameters 2 and 3 of DO_SET_MODE.
pub fn mode_params(custom_mode: u32) -> (f32, f32) {
    (custom_mode as f32, 0.0)
}

/// EKF_STATUS_REPORT: horizontal position known, relative and absolute.
const EKF_POSITION_KNOWN: u16 = 0x18;
/// EKF_STATUS_REPORT: never initialised.
const EKF_UNINITIALISED: u16 = 0x400;

/// Whether the estimator's flags let it arm and fly Guided.
pub fn estimator_ready(flags: u16) -> bool {
    flags & EKF_POSITION_KNOWN == EKF_POSITION_KNOWN && flags & EKF_UNINITIALISED == 0
}

/// Variance ratio from which an estimate counts as unsound: EKF_STATUS_REPORT gives innovations as
/// a share of the largest that the filter accepts, and `FS_EKF_THRESH` is 0.8.
const MAX_VARIANCE_RATIO: f32 = 0.8;

/// Whether a variance ratio is sound; NaN is not.
pub(crate) fn is_variance_ratio_good(ratio: f32) -> bool {
    ratio < MAX_VARIANCE_RATIO
}

/// Streams to ask for: message id and interval in microseconds. Unasked it sends HEARTBEAT alone.
pub const STREAMS: [(u16, f32); 5] = [
    (32, 33_333.0),   // LOCAL_POSITION_NED
    (245, 200_000.0), // EXTENDED_SYS_STATE
    (193, 200_000.0), // EKF_STATUS_REPORT
    (33, 200_000.0), // GLOBAL_POSITION_INT, with the height above home that NAV_TAKEOFF counts from
    (1, 1_000_000.0), // SYS_STATUS, with the battery
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_estimator_is_ready_as_it_was_seen_to_be() {
        // Uninitialised, without GPS, flying, and dead reckoning after a loss.
        for (flags, ready) in
            [(0x400, false), (0xA7, false), (0x33F, true), (0x73F, false), (0x0A7, false)]
        {
            assert_eq!(estimator_ready(flags), ready, "{flags:#x}");
        }
        assert_eq!(mode_params(GUIDED), (4.0, 0.0));
    }
}
