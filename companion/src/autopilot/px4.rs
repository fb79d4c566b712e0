//! PX4's constants: flight modes, setpoint masks, limit parameters, and the streams that a
//! companion needs. Source: PX4 1.17 `px4_custom_mode.h` and recordings (`docs/autopilots.md`).
//! Another autopilot kind gets a module of the same shape.

use crate::autopilot::limits::{Limit, LimitParameter};

/// Offboard as `custom_mode` of HEARTBEAT: main mode << 16 | sub mode << 24.
pub const OFFBOARD: u32 = 0x0006_0000;
/// AUTO.LAND as `custom_mode`.
pub const LAND: u32 = 0x0604_0000;
/// AUTO.LOITER as `custom_mode`; pilots call it Hold.
pub const HOLD: u32 = 0x0304_0000;
/// AUTO.RTL as `custom_mode`.
pub const RTL: u32 = 0x0504_0000;

/// `type_mask` of a setpoint: position counts, velocity and acceleration are feed-forward; yaw and
/// yaw rate are ignored, so PX4 keeps the heading. For a heading the sender clears the yaw bit.
pub const MASK_POSITION_VELOCITY_ACCELERATION: u16 = 0xC00;

/// Parameters that limit how PX4 flies, with 1.17's defaults; all are floats.
pub const LIMITS: [LimitParameter; 7] = [
    LimitParameter { name: "MPC_XY_VEL_MAX", limit: Limit::SpeedXy, to_si: 1.0, default: 12.0 },
    LimitParameter { name: "MPC_Z_VEL_MAX_UP", limit: Limit::Climb, to_si: 1.0, default: 3.0 },
    LimitParameter { name: "MPC_Z_VEL_MAX_DN", limit: Limit::Descend, to_si: 1.0, default: 1.5 },
    LimitParameter { name: "MPC_ACC_HOR", limit: Limit::AccelXy, to_si: 1.0, default: 3.0 },
    LimitParameter { name: "MPC_ACC_UP_MAX", limit: Limit::AccelUp, to_si: 1.0, default: 4.0 },
    LimitParameter { name: "MPC_ACC_DOWN_MAX", limit: Limit::AccelDown, to_si: 1.0, default: 3.0 },
    LimitParameter { name: "MPC_JERK_AUTO", limit: Limit::JerkXy, to_si: 1.0, default: 4.0 },
];

/// `type_mask` of a setpoint whose velocity alone counts: at velocity 0 PX4 stops where it is.
pub const MASK_VELOCITY: u16 = 0xDC7;

/// Main and sub mode of `custom_mode`: parameters 2 and 3 of DO_SET_MODE.
pub fn mode_params(custom_mode: u32) -> (f32, f32) {
    (((custom_mode >> 16) & 0xFF) as f32, (custom_mode >> 24) as f32)
}

/// Streams to request on connecting: message id and interval in microseconds; −1 switches one off.
/// Without these requests PX4 sends about 18 kB/s, with them about 3 kB/s.
pub const STREAMS: [(u16, f32); 19] = [
    (32, 33_333.0),     // LOCAL_POSITION_NED
    (245, 200_000.0),   // EXTENDED_SYS_STATE
    (1, 1_000_000.0),   // SYS_STATUS, with the battery
    (30, -1.0),         // ATTITUDE
    (31, -1.0),         // ATTITUDE_QUATERNION
    (105, -1.0),        // HIGHRES_IMU
    (331, -1.0),        // ODOMETRY
    (33, -1.0),         // GLOBAL_POSITION_INT
    (36, -1.0),         // SERVO_OUTPUT_RAW
    (65, -1.0),         // RC_CHANNELS
    (74, -1.0),         // VFR_HUD
    (83, -1.0),         // ATTITUDE_TARGET
    (85, -1.0),         // POSITION_TARGET_LOCAL_NED
    (87, -1.0),         // POSITION_TARGET_GLOBAL_INT
    (141, -1.0),        // ALTITUDE
    (230, 1_000_000.0), // ESTIMATOR_STATUS, with the accuracy of the position
    (241, -1.0),        // VIBRATION
    (24, -1.0),         // GPS_RAW_INT
    (4, -1.0),          // PING
];

#[cfg(test)]
mod tests;
