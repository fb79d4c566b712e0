//! ArduCopter's handling of commands, SET_MODE, message intervals and stream requests, and its
//! COMMAND_ACKs.

use super::setpoint::GuidedGoal;
use super::{Copter, CopterMode, STREAMS};
use crate::link::cmd;
use crate::link::command::{
    ACCEPTED, Arming, CUSTOM_MODE, DENIED, FAILED, ReceivedCommand, UNSUPPORTED,
    message_id_from_param,
};
use crate::link::msg;
use crate::link::port::Sender;
use crate::link::wire::PayloadReader;
use crate::platform::Platform;

/// Id of the message SET_MODE, which its COMMAND_ACK has as the command.
const SET_MODE: u16 = 11;

/// Values of MAV_DATA_STREAM, and the messages that each switches on (`SRn_*`).
const DATA_STREAMS: [(u8, &[u32]); 8] = [
    (1, &[29, 105]),            // RAW_SENSORS
    (2, &[1, 24, 42, 62, 245]), // EXTENDED_STATUS
    (3, &[36]),                 // RC_CHANNELS
    (4, &[83]),                 // RAW_CONTROLLER
    (6, &[32, 33]),             // POSITION
    (10, &[30]),                // EXTRA1
    (11, &[74]),                // EXTRA2
    (12, &[2, 147, 193, 241]),  // EXTRA3
];

impl Copter {
    /// Executes a command and queues its COMMAND_ACK.
    pub(crate) fn handle_command(
        &mut self,
        platform: &mut Platform,
        from: Sender,
        command: &ReceivedCommand,
    ) {
        let sensors = platform.sensors();
        let result = match command.id {
            cmd::DO_SET_MODE => {
                self.change_mode(platform, command.param[0] as u8, command.param[1] as u32)
            }
            cmd::COMPONENT_ARM_DISARM if command.param[0] == 1.0 => {
                self.arm(platform, &sensors, Arming::commanded_by(command)).result_or(FAILED)
            }
            cmd::COMPONENT_ARM_DISARM if command.param[0] == 0.0 => {
                self.disarm(platform, Arming::commanded_by(command)).result_or(FAILED)
            }
            cmd::DO_DIGICAM_CONTROL | cmd::DO_SET_CAM_TRIGG_DIST => {
                return platform.handle_camera_command(from, command);
            }
            // NAV_TAKEOFF's height counts from home.
            cmd::NAV_TAKEOFF => {
                self.take_off(sensors.home.z + command.z, &sensors).result_or(FAILED)
            }
            cmd::NAV_LAND => self.request_mode(CopterMode::Land, &sensors).result_or(FAILED),
            cmd::NAV_RETURN_TO_LAUNCH => {
                self.request_mode(CopterMode::Rtl, &sensors).result_or(FAILED)
            }
            cmd::NAV_LOITER_UNLIM => {
                self.request_mode(CopterMode::Loiter, &sensors).result_or(FAILED)
            }
            cmd::DO_REPOSITION => self.reposition(platform, command),
            cmd::DO_CHANGE_SPEED => {
                self.commanded_speed = (command.param[1] > 0.0).then_some(command.param[1]);
                ACCEPTED
            }
            cmd::DO_SET_HOME => platform.handle_set_home(command).result_or(FAILED),
            cmd::DO_PAUSE_CONTINUE => FAILED,
            cmd::MISSION_START => self.start_mission(platform).result_or(FAILED),
            cmd::PREFLIGHT_STORAGE => ACCEPTED,
            cmd::PREFLIGHT_CALIBRATION | cmd::PREFLIGHT_REBOOT_SHUTDOWN if self.armed => FAILED,
            cmd::PREFLIGHT_CALIBRATION => ACCEPTED,
            cmd::PREFLIGHT_REBOOT_SHUTDOWN => {
                if command.param[0] == 1.0 {
                    platform.schedule_reboot();
                }
                ACCEPTED
            }
            cmd::GET_MESSAGE_INTERVAL => platform.report_interval(from, command.param[0], FAILED),
            cmd::SET_MESSAGE_INTERVAL => platform.set_interval(from, command, &STREAMS, DENIED),
            cmd::REQUEST_MESSAGE => match message_id_from_param(command.param[0]) {
                Some(id) if STREAMS.iter().any(|stream| stream.0 == id) => {
                    platform.ports[from.port].requested_once.push(id);
                    ACCEPTED
                }
                _ => DENIED,
            },
            cmd::REQUEST_AUTOPILOT_CAPABILITIES => {
                platform.ports[from.port].requested_once.push(msg::AUTOPILOT_VERSION);
                ACCEPTED
            }
            _ => UNSUPPORTED,
        };
        platform.acknowledge(from, command.id, result);
    }

    /// Handles the message SET_MODE, to which ArduPilot sends a COMMAND_ACK as to a command.
    pub(crate) fn handle_set_mode(
        &mut self,
        platform: &mut Platform,
        from: Sender,
        fields: &PayloadReader<'_>,
    ) {
        let result = self.change_mode(platform, fields.u8(5), fields.u32(0));
        platform.acknowledge(from, SET_MODE, result);
    }

    /// Enters the mode of this number; returns the MAV_RESULT. `base` must have the custom mode
    /// flag.
    fn change_mode(&mut self, platform: &mut Platform, base: u8, number: u32) -> u8 {
        if base & CUSTOM_MODE == 0 {
            return DENIED;
        }
        let runs = |mode: &CopterMode| *mode != CopterMode::Auto || self.can_enter_auto(platform);
        match CopterMode::from_number(number).filter(runs) {
            Some(mode) => self.request_mode(mode, &platform.sensors()).result_or(FAILED),
            None => FAILED,
        }
    }

    /// Executes DO_REPOSITION: flies to a point in Guided. Returns the MAV_RESULT.
    fn reposition(&mut self, platform: &Platform, command: &ReceivedCommand) -> u8 {
        let sensors = platform.sensors();
        let Some(to) = platform.reposition_target(command) else { return DENIED };
        let changes_mode = command.param[1] as u32 & 1 != 0;
        let guided = self.mode == CopterMode::Guided
            || changes_mode && self.request_mode(CopterMode::Guided, &sensors).is_done();
        if !guided || !to.iter().all(|x| x.is_finite()) {
            return if guided { DENIED } else { FAILED };
        }
        self.set_guided_goal(GuidedGoal::hold(to), &sensors);
        ACCEPTED
    }
}

/// Handles REQUEST_DATA_STREAM, by which ground stations set stream rates before
/// SET_MESSAGE_INTERVAL existed. It is not acknowledged.
pub(crate) fn handle_stream_request(
    platform: &mut Platform,
    from: Sender,
    fields: &PayloadReader<'_>,
) {
    let (rate_hz, stream, start) = (fields.u16(0), fields.u8(4), fields.u8(5) != 0);
    let interval_us = if start && rate_hz > 0 { 1_000_000 / u32::from(rate_hz.min(50)) } else { 0 };
    let now_us = platform.time_us;
    for (_, ids) in DATA_STREAMS.iter().filter(|(id, _)| stream == 0 || *id == stream) {
        for &id in *ids {
            platform.ports[from.port].set_interval(id, interval_us, now_us);
        }
    }
}
