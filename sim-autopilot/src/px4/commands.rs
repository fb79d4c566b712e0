//! PX4's handling of commands, SET_MODE, message intervals and message requests, and its
//! COMMAND_ACKs.

use crate::link::msg;
use planner_core::geo::frames::Geodetic;

use super::Px4Mode;
use super::software::Px4;
use crate::link::cmd;
use crate::link::command::{
    ACCEPTED, Arming, CUSTOM_MODE, CommandOutcome, DENIED, FAILED, ReceivedCommand,
    TEMPORARILY_REJECTED, UNSUPPORTED, message_id_from_param,
};
use crate::link::port::Sender;
use crate::link::wire::PayloadReader;
use crate::platform::Platform;
use crate::telemetry;

impl Px4 {
    /// Executes a command and queues its COMMAND_ACK.
    pub(crate) fn handle_command(
        &mut self,
        platform: &mut Platform,
        from: Sender,
        command: &ReceivedCommand,
    ) {
        let result = match command.id {
            // DO_SET_MODE gets two COMMAND_ACKs: at once ACCEPTED, and in the next step whether the
            // mode changed.
            cmd::DO_SET_MODE => {
                let mode =
                    mode_of(command.param[0] as u8, command.param[1] as u8, command.param[2] as u8);
                platform.acknowledge(from, cmd::DO_SET_MODE, ACCEPTED);
                self.pending_mode = Some((from, mode));
                return;
            }
            cmd::DO_DIGICAM_CONTROL | cmd::DO_SET_CAM_TRIGG_DIST => {
                return platform.handle_camera_command(from, command);
            }
            cmd::COMPONENT_ARM_DISARM => self.arm_or_disarm(platform, command),
            cmd::NAV_TAKEOFF => self.take_off(platform, command),
            cmd::NAV_LAND => {
                self.change_mode(platform, Px4Mode::Land).result_or(TEMPORARILY_REJECTED)
            }
            cmd::NAV_RETURN_TO_LAUNCH => {
                self.change_mode(platform, Px4Mode::Return).result_or(TEMPORARILY_REJECTED)
            }
            cmd::NAV_LOITER_UNLIM => {
                self.change_mode(platform, Px4Mode::Hold).result_or(TEMPORARILY_REJECTED)
            }
            cmd::DO_REPOSITION => self.reposition(platform, command),
            cmd::DO_CHANGE_SPEED => {
                self.commander.set_cruise_speed(command.param[1]);
                ACCEPTED
            }
            cmd::DO_SET_HOME => platform.handle_set_home(command).result_or(DENIED),
            cmd::DO_PAUSE_CONTINUE if command.param[0] == 0.0 => {
                self.change_mode(platform, Px4Mode::Hold).result_or(TEMPORARILY_REJECTED)
            }
            cmd::DO_PAUSE_CONTINUE => TEMPORARILY_REJECTED,
            cmd::MISSION_START => self.start_mission(platform),
            cmd::PREFLIGHT_STORAGE => ACCEPTED,
            cmd::PREFLIGHT_CALIBRATION => TEMPORARILY_REJECTED,
            cmd::PREFLIGHT_REBOOT_SHUTDOWN if self.commander.armed() => TEMPORARILY_REJECTED,
            cmd::PREFLIGHT_REBOOT_SHUTDOWN => {
                if command.param[0] == 1.0 {
                    platform.schedule_reboot();
                }
                ACCEPTED
            }
            cmd::GET_MESSAGE_INTERVAL => platform.report_interval(from, command.param[0], FAILED),
            cmd::SET_MESSAGE_INTERVAL => {
                platform.set_interval(from, command, &telemetry::PX4_STREAMS, FAILED)
            }
            cmd::REQUEST_MESSAGE => match message_id_from_param(command.param[0]) {
                Some(id) if self.has_message(id) => {
                    platform.ports[from.port].requested_once.push(id);
                    ACCEPTED
                }
                _ => DENIED,
            },
            cmd::REQUEST_PROTOCOL_VERSION | cmd::REQUEST_AUTOPILOT_CAPABILITIES => {
                let id = if command.id == cmd::REQUEST_PROTOCOL_VERSION {
                    msg::PROTOCOL_VERSION
                } else {
                    msg::AUTOPILOT_VERSION
                };
                platform.ports[from.port].requested_once.push(id);
                ACCEPTED
            }
            _ => UNSUPPORTED,
        };
        platform.acknowledge(from, command.id, result);
    }

    /// Handles the message SET_MODE, to which PX4 sends no COMMAND_ACK.
    pub(crate) fn handle_set_mode(&mut self, platform: &Platform, fields: &PayloadReader<'_>) {
        let custom = fields.u32(0);
        if let Some(mode) = mode_of(fields.u8(5), (custom >> 16) as u8, (custom >> 24) as u8) {
            self.change_mode(platform, mode);
        }
    }

    /// Whether PX4 sends this message when REQUEST_MESSAGE asks for it.
    fn has_message(&self, id: u32) -> bool {
        matches!(id, msg::AUTOPILOT_VERSION | msg::PROTOCOL_VERSION)
            || telemetry::PX4_STREAMS.iter().any(|stream| stream.0 == id)
    }

    /// Requests a flight mode.
    fn change_mode(&mut self, platform: &Platform, mode: Px4Mode) -> CommandOutcome {
        let sensors = platform.sensors();
        self.commander.request_mode(mode, &sensors, &self.tuning)
    }

    /// Carries out COMPONENT_ARM_DISARM; returns the MAV_RESULT, as the next functions.
    fn arm_or_disarm(&mut self, platform: &mut Platform, command: &ReceivedCommand) -> u8 {
        let arming = Arming::commanded_by(command);
        if command.param[0] == 1.0 {
            self.arm(platform, arming).result_or(TEMPORARILY_REJECTED)
        } else if command.param[0] == 0.0 {
            self.commander.disarm(arming).result_or(TEMPORARILY_REJECTED)
        } else {
            UNSUPPORTED
        }
    }

    /// Executes MISSION_START: enters AUTO.MISSION and arms. Returns the MAV_RESULT.
    fn start_mission(&mut self, platform: &mut Platform) -> u8 {
        self.commander.note_stored_mission(platform);
        if !platform.has_mission()
            || self.change_mode(platform, Px4Mode::Mission) == CommandOutcome::Refused
        {
            return DENIED;
        }
        self.arm(platform, Arming::Checked).result_or(DENIED)
    }

    /// Arms; sets home if the vehicle was disarmed before.
    fn arm(&mut self, platform: &mut Platform, arming: Arming) -> CommandOutcome {
        let sensors = platform.sensors();
        let was_armed = self.commander.armed();
        let armed = self.commander.arm(&sensors, &self.tuning, arming);
        if armed.is_done() && !was_armed {
            platform.set_home_here_unless_fixed();
        }
        armed
    }

    fn take_off(&mut self, platform: &Platform, command: &ReceivedCommand) -> u8 {
        // The altitude counts from sea level or home; converting it to the mission frame's height
        // needs latitude and longitude, here the vehicle's.
        let up = if command.z.is_finite() && command.z != 0.0 {
            let base = if command.relative_to_home { platform.home.alt_m } else { 0.0 };
            let here = platform.frame.geodetic_from_enu(platform.vehicle.position());
            let target = Geodetic { alt_m: f64::from(command.z) + base, ..here };
            platform.frame.enu_from_geodetic(&target).z as f32
        } else {
            f32::NAN
        };
        let sensors = platform.sensors();
        self.commander.takeoff(up, &sensors, &self.tuning).result_or(TEMPORARILY_REJECTED)
    }

    fn reposition(&mut self, platform: &Platform, command: &ReceivedCommand) -> u8 {
        let Some(to) = platform.reposition_target(command) else { return DENIED };
        let sensors = platform.sensors();
        self.commander.set_cruise_speed(command.param[0]);
        let heading = command.param[3];
        self.commander
            .reposition(&to, heading, &sensors, &self.tuning)
            .result_or(TEMPORARILY_REJECTED)
    }
}

/// The mode of a main and sub mode number; `None` unless `base` has the custom mode flag.
fn mode_of(base: u8, main: u8, sub: u8) -> Option<Px4Mode> {
    if base & CUSTOM_MODE != 0 { Px4Mode::from_main_sub(main, sub) } else { None }
}
