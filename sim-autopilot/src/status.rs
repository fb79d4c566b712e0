//! State of the autopilot that telemetry reports, and of the motors that it drives.

use crate::SimulatedKind;

/// State of the autopilot in one step, for telemetry.
#[derive(Clone, Copy, Debug)]
pub struct AutopilotStatus {
    /// Which autopilot it is.
    pub autopilot: SimulatedKind,
    /// `custom_mode` of HEARTBEAT.
    pub custom_mode: u32,
    /// `custom_mode` of the mode that was last requested, even while a failsafe flies another.
    pub intended_mode: u32,
    /// `base_mode` of HEARTBEAT (MAV_MODE_FLAG).
    pub base_mode: u8,
    /// `system_status` of HEARTBEAT (MAV_STATE).
    pub system_status: u8,
    /// Whether the arming checks pass.
    pub armable: bool,
    /// MAV_LANDED_STATE.
    pub landed_state: u8,
    /// Whether the mode reports its target by POSITION_TARGET_LOCAL_NED.
    pub reports_position_target: bool,
    /// `flags` of ArduPilot's EKF_STATUS_REPORT.
    pub ekf_flags: u16,
    /// Whether the estimator has an origin.
    pub origin_known: bool,
    /// Whether the estimator has a position.
    pub position_known: bool,
}

/// Whether the motors carry weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotorState {
    /// They idle or are off.
    Idle,
    /// They carry weight.
    Lifting,
}

/// What the autopilot reports of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AutopilotFlags {
    /// Whether it is armed.
    pub armed: bool,
    /// Whether its land detector reports the vehicle on the ground.
    pub landed: bool,
}
