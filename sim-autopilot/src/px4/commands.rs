//! PX4's answers: commands and their acks, modes by SET_MODE, message intervals and requests.

use planner_core::frames::Geodetic;

use super::{Mode, Px4};
use crate::body::Body;
use crate::command::{
    ACCEPTED, AUTOPILOT_VERSION, CUSTOM_MODE, Command, DENIED, DO_DIGICAM_CONTROL, DO_SET_CAM_TRIGG_DIST,
    DO_SET_MODE, FAILED, FORCE, PROTOCOL_VERSION, TEMPORARILY_REJECTED, UNSUPPORTED, accept, message_id,
};
use crate::port::Sender;
use crate::telemetry;
use crate::wire::Fields;

impl Px4 {
    /// Takes a command and acknowledges it.
    pub(crate) fn handle_command(&mut self, body: &mut Body, from: Sender, command: &Command) {
        let result = match command.id {
            // DO_SET_MODE is acknowledged twice: that it was understood, then whether the mode changed.
            DO_SET_MODE => {
                let mode = mode_of(command.param[0] as u8, command.param[1] as u8, command.param[2] as u8);
                body.acknowledge(from, DO_SET_MODE, ACCEPTED);
                self.asked = Some((from, mode));
                return;
            }
            DO_DIGICAM_CONTROL | DO_SET_CAM_TRIGG_DIST => return body.control_camera(from, command),
            400 => self.arm_or_disarm(body, command),
            22 => self.take_off(body, command),
            21 => accept(self.change_mode(body, Mode::Land)),
            20 => accept(self.change_mode(body, Mode::Return)),
            17 => accept(self.change_mode(body, Mode::Hold)),
            192 => self.reposition(body, command),
            178 => {
                self.commander.set_cruise(command.param[1]);
                ACCEPTED
            }
            179 if body.set_home(command) => ACCEPTED,
            179 => DENIED,
            193 if command.param[0] == 0.0 => accept(self.change_mode(body, Mode::Hold)),
            193 => TEMPORARILY_REJECTED,
            300 => self.start_mission(body),
            245 => ACCEPTED,
            241 => TEMPORARILY_REJECTED,
            246 if self.commander.armed() => TEMPORARILY_REJECTED,
            246 => {
                if command.param[0] == 1.0 {
                    body.reboot_soon();
                }
                ACCEPTED
            }
            510 => body.report_interval(from, command.param[0], FAILED),
            511 => body.set_interval(from, command, &telemetry::STREAMS, FAILED),
            512 => match message_id(command.param[0]) {
                Some(id) if self.has_message(id) => {
                    body.ports[from.port].once.push(id);
                    ACCEPTED
                }
                _ => DENIED,
            },
            519 | 520 => {
                let id = if command.id == 519 { PROTOCOL_VERSION } else { AUTOPILOT_VERSION };
                body.ports[from.port].once.push(id);
                ACCEPTED
            }
            _ => UNSUPPORTED,
        };
        body.acknowledge(from, command.id, result);
    }

    /// Takes the old SET_MODE, which is not acknowledged.
    pub(crate) fn handle_set_mode(&mut self, body: &Body, fields: &Fields<'_>) {
        let custom = fields.u32(0);
        if let Some(mode) = mode_of(fields.u8(5), (custom >> 16) as u8, (custom >> 24) as u8) {
            self.change_mode(body, mode);
        }
    }

    fn has_message(&self, id: u32) -> bool {
        matches!(id, AUTOPILOT_VERSION | PROTOCOL_VERSION)
            || telemetry::STREAMS.iter().any(|stream| stream.0 == id)
    }

    fn change_mode(&mut self, body: &Body, mode: Mode) -> bool {
        let sense = body.sense();
        self.commander.set_mode(mode, &sense, &self.tuning)
    }

    fn arm_or_disarm(&mut self, body: &mut Body, command: &Command) -> u8 {
        let force = command.param[1] == FORCE;
        if command.param[0] == 1.0 {
            accept(self.arm(body, force))
        } else if command.param[0] == 0.0 {
            accept(self.commander.disarm(force))
        } else {
            UNSUPPORTED
        }
    }

    /// MISSION_START: changes the mode and arms.
    fn start_mission(&mut self, body: &mut Body) -> u8 {
        self.commander.set_mission_ready(body.has_mission());
        if !body.has_mission() || !self.change_mode(body, Mode::Mission) {
            return DENIED;
        }
        if self.arm(body, false) { ACCEPTED } else { DENIED }
    }

    fn arm(&mut self, body: &mut Body, force: bool) -> bool {
        let sense = body.sense();
        let was_armed = self.commander.armed();
        let armed = self.commander.arm(&sense, &self.tuning, force);
        if armed && !was_armed {
            body.set_home_here();
        }
        armed
    }

    fn take_off(&mut self, body: &Body, command: &Command) -> u8 {
        // The altitude is above the sea; how high that is in the mission frame depends on where it is asked for.
        let up = if command.z.is_finite() && command.z != 0.0 {
            let base = if command.relative { body.home.alt_m } else { 0.0 };
            let here = body.frame.geodetic(body.vehicle.position());
            let target = Geodetic { alt_m: f64::from(command.z) + base, ..here };
            body.frame.enu_of_geodetic(&target).z as f32
        } else {
            f32::NAN
        };
        let sense = body.sense();
        accept(self.commander.takeoff(up, &sense, &self.tuning))
    }

    fn reposition(&mut self, body: &Body, command: &Command) -> u8 {
        let Some(to) = body.reposition_target(command) else { return DENIED };
        let sense = body.sense();
        self.commander.set_cruise(command.param[0]);
        accept(self.commander.reposition(&to, command.param[3], &sense, &self.tuning))
    }
}

fn mode_of(base: u8, main: u8, sub: u8) -> Option<Mode> {
    if base & CUSTOM_MODE != 0 { Mode::from_main_sub(main, sub) } else { None }
}
