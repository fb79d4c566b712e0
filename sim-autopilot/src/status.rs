//! What a firmware reports of its state.

use crate::AutopilotKind;

/// State of the firmware that telemetry reports.
#[derive(Clone, Copy, Debug)]
pub struct FirmwareStatus {
    /// Which firmware it is.
    pub autopilot: AutopilotKind,
    /// `custom_mode` of HEARTBEAT.
    pub custom_mode: u32,
    /// The mode that was asked for, whatever a failsafe flies.
    pub intended_mode: u32,
    /// MAV_MODE_FLAG.
    pub flags: u8,
    /// MAV_STATE.
    pub system_status: u8,
    /// The arming checks pass.
    pub armable: bool,
    /// MAV_LANDED_STATE.
    pub landed_state: u8,
    /// Follows setpoints.
    pub guided: bool,
    /// ArduPilot's flags of EKF_STATUS_REPORT.
    pub ekf_flags: u16,
    /// The estimator has an origin.
    pub origin_known: bool,
    /// The estimator has a position.
    pub position_known: bool,
}
