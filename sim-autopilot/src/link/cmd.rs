//! Numbers of the MAVLink commands that the simulated autopilots know, `MAV_CMD`, by their names in
//! MAVLink's definitions.
#![allow(missing_docs)]

pub const NAV_WAYPOINT: u16 = 16;
pub const NAV_LOITER_UNLIM: u16 = 17;
pub const NAV_RETURN_TO_LAUNCH: u16 = 20;
pub const NAV_LAND: u16 = 21;
pub const NAV_TAKEOFF: u16 = 22;
pub const NAV_DELAY: u16 = 93;
pub const DO_SET_MODE: u16 = 176;
pub const DO_CHANGE_SPEED: u16 = 178;
pub const DO_SET_HOME: u16 = 179;
pub const DO_REPOSITION: u16 = 192;
pub const DO_PAUSE_CONTINUE: u16 = 193;
pub const DO_DIGICAM_CONTROL: u16 = 203;
pub const DO_SET_CAM_TRIGG_DIST: u16 = 206;
pub const PREFLIGHT_CALIBRATION: u16 = 241;
pub const PREFLIGHT_STORAGE: u16 = 245;
pub const PREFLIGHT_REBOOT_SHUTDOWN: u16 = 246;
pub const MISSION_START: u16 = 300;
pub const COMPONENT_ARM_DISARM: u16 = 400;
pub const GET_MESSAGE_INTERVAL: u16 = 510;
pub const SET_MESSAGE_INTERVAL: u16 = 511;
pub const REQUEST_MESSAGE: u16 = 512;
pub const REQUEST_PROTOCOL_VERSION: u16 = 519;
pub const REQUEST_AUTOPILOT_CAPABILITIES: u16 = 520;
