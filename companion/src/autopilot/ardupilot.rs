//! ArduCopter's constants: flight modes, setpoint masks, limit parameters, the estimator's flags,
//! and the streams that a companion needs. Source: ArduCopter 4.6 `mode.h`,
//! `GCS_MAVLink_Copter.cpp` and a recording (`docs/autopilots.md`). The module has the shape of
//! `px4`.

use crate::autopilot::limits::{Limit, LimitParameter};

/// GUIDED as `custom_mode` of HEARTBEAT.
pub const GUIDED: u32 = 4;
/// LAND as `custom_mode`.
pub const LAND: u32 = 9;
/// RTL as `custom_mode`.
pub const RTL: u32 = 6;
/// BRAKE as `custom_mode`: the vehicle stops and holds its position, whatever the sticks command.
pub const BRAKE: u32 = 17;

/// `type_mask` of a setpoint: position counts, velocity is feed-forward, acceleration is ignored.
/// 0xC00, with acceleration, is not used: no recording shows that ArduCopter flies it.
pub const MASK_POSITION_VELOCITY: u16 = 0xDC0;

/// Time, seconds, by which the velocity in a setpoint leads the smoothed setpoint: the velocity
/// sent is the smoothed setpoint's plus its acceleration times this. It replaces the acceleration
/// that the mask leaves out. Guided corrects an error of velocity with the time constant
/// `WPNAV_ACCEL` / `PSC_JERK_XY`, and flew the recorded circle 0.6 s late.
pub const VELOCITY_LEAD_S: f32 = 0.5;

/// Parameters that limit how ArduCopter flies, with 4.6's defaults; their units are centimetres,
/// those of the jerks metres.
pub const LIMITS: [LimitParameter; 8] = [
    LimitParameter { name: "WPNAV_SPEED", limit: Limit::SpeedXy, to_si: 0.01, default: 1000.0 },
    LimitParameter { name: "WPNAV_SPEED_UP", limit: Limit::Climb, to_si: 0.01, default: 250.0 },
    LimitParameter { name: "WPNAV_SPEED_DN", limit: Limit::Descend, to_si: 0.01, default: 150.0 },
    LimitParameter { name: "WPNAV_ACCEL", limit: Limit::AccelXy, to_si: 0.01, default: 250.0 },
    LimitParameter { name: "WPNAV_ACCEL_Z", limit: Limit::AccelUp, to_si: 0.01, default: 100.0 },
    LimitParameter { name: "WPNAV_ACCEL_Z", limit: Limit::AccelDown, to_si: 0.01, default: 100.0 },
    LimitParameter { name: "PSC_JERK_XY", limit: Limit::JerkXy, to_si: 1.0, default: 5.0 },
    LimitParameter { name: "PSC_JERK_Z", limit: Limit::JerkZ, to_si: 1.0, default: 5.0 },
];

/// `type_mask` of a setpoint whose velocity alone counts: at velocity 0 ArduCopter stops where it
/// is.
pub const MASK_VELOCITY: u16 = 0xDC7;

/// Parameters 2 and 3 of DO_SET_MODE that switch to the mode `custom_mode`.
pub fn mode_params(custom_mode: u32) -> (f32, f32) {
    (custom_mode as f32, 0.0)
}

/// Flags of EKF_STATUS_REPORT: the horizontal position is known, relative (0x08) and absolute
/// (0x10).
const EKF_POSITION_KNOWN: u16 = 0x18;
/// Flag of EKF_STATUS_REPORT: the estimator was never initialised.
const EKF_UNINITIALISED: u16 = 0x400;

/// Whether the flags of EKF_STATUS_REPORT allow the autopilot to arm and to fly Guided.
pub fn estimator_ready(flags: u16) -> bool {
    flags & EKF_POSITION_KNOWN == EKF_POSITION_KNOWN && flags & EKF_UNINITIALISED == 0
}

/// Variance ratio of EKF_STATUS_REPORT from which on the estimate counts as unsound: an innovation
/// as a share of the largest that the filter accepts. `FS_EKF_THRESH` is 0.8.
const MAX_VARIANCE_RATIO: f32 = 0.8;

/// Whether a variance ratio of EKF_STATUS_REPORT is that of a sound estimate; false for NaN.
pub(crate) fn is_variance_ratio_good(ratio: f32) -> bool {
    ratio < MAX_VARIANCE_RATIO
}

/// Streams to request on connecting: message id and interval in microseconds. Without these
/// requests ArduCopter sends HEARTBEAT alone.
pub const STREAMS: [(u16, f32); 5] = [
    (32, 33_333.0),   // LOCAL_POSITION_NED
    (245, 200_000.0), // EXTENDED_SYS_STATE
    (193, 200_000.0), // EKF_STATUS_REPORT
    (33, 200_000.0), // GLOBAL_POSITION_INT, with the height above home that NAV_TAKEOFF counts from
    (1, 1_000_000.0), // SYS_STATUS, with the battery
];

#[cfg(test)]
mod tests;
