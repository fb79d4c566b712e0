//! PX4's answers: commands and their acks, modes by SET_MODE, message intervals and requests.

use planner_core::Point;
use planner_core::frames::Geodetic;

use super::Mode;
use crate::autopilot::Autopilot;
use crate::autopilot::inbox::Sender;
use crate::autopilot::port::Ack;
use crate::autopilot::telemetry;
use crate::autopilot::wire::Fields;

const ACCEPTED: u8 = 0;
const TEMPORARILY_REJECTED: u8 = 1;
const DENIED: u8 = 2;
const UNSUPPORTED: u8 = 3;
const FAILED: u8 = 4;

/// Parameter 2 of COMPONENT_ARM_DISARM that forces it.
const FORCE: f32 = 21_196.0;
/// MAV_MODE_FLAG_CUSTOM_MODE_ENABLED.
const CUSTOM_MODE: u8 = 1;

const AUTOPILOT_VERSION: u32 = 148;
const PROTOCOL_VERSION: u32 = 300;
const MESSAGE_INTERVAL: u32 = 244;

/// A command as COMMAND_LONG and COMMAND_INT carry it alike.
struct Command {
    id: u16,
    param: [f32; 4],
    /// Latitude and longitude in degrees, where given.
    place: [f64; 2],
    z: f32,
    /// z is above home, not above the sea.
    relative: bool,
}

impl Autopilot {
    /// Takes COMMAND_LONG.
    pub(crate) fn handle_command_long(&mut self, from: Sender, fields: &Fields<'_>) {
        let param = [fields.f32(0), fields.f32(4), fields.f32(8), fields.f32(12)];
        let place = [f64::from(fields.f32(16)), f64::from(fields.f32(20))];
        let command = Command { id: fields.u16(28), param, place, z: fields.f32(24), relative: false };
        self.handle_command(from, &command);
    }

    /// Takes COMMAND_INT.
    pub(crate) fn handle_command_int(&mut self, from: Sender, fields: &Fields<'_>) {
        let degrees = |at: usize| match fields.i32(at) {
            i32::MAX => f64::NAN,
            scaled => f64::from(scaled) * 1e-7,
        };
        let param = [fields.f32(0), fields.f32(4), fields.f32(8), fields.f32(12)];
        let relative = matches!(fields.u8(32), 3 | 6);
        let place = [degrees(16), degrees(20)];
        let command = Command { id: fields.u16(28), param, place, z: fields.f32(24), relative };
        self.handle_command(from, &command);
    }

    fn handle_command(&mut self, from: Sender, command: &Command) {
        let result = match command.id {
            // DO_SET_MODE is acknowledged twice: that it was understood, then whether the mode changed.
            176 => {
                let mode = mode_of(command.param[0] as u8, command.param[1] as u8, command.param[2] as u8);
                self.acknowledge(from, 176, ACCEPTED);
                let changed = mode.is_some_and(|mode| self.change_mode(mode));
                let result = if changed { ACCEPTED } else { TEMPORARILY_REJECTED };
                self.ports[from.port].later.push(Ack { command: 176, result, to: from.id() });
                return;
            }
            400 => self.arm_or_disarm(command),
            22 => self.take_off(command),
            21 => accept(self.change_mode(Mode::Land)),
            20 => accept(self.change_mode(Mode::Return)),
            17 => accept(self.change_mode(Mode::Hold)),
            192 => self.reposition(command),
            178 => {
                self.commander.set_cruise(command.param[1]);
                ACCEPTED
            }
            179 => self.set_home(command),
            193 if command.param[0] == 0.0 => accept(self.change_mode(Mode::Hold)),
            // No mission is stored, so none can be started or continued.
            193 | 300 => TEMPORARILY_REJECTED,
            245 => ACCEPTED,
            241 => TEMPORARILY_REJECTED,
            246 if self.commander.armed() => TEMPORARILY_REJECTED,
            246 => {
                self.acknowledge(from, 246, ACCEPTED);
                if command.param[0] == 1.0 {
                    self.reboot();
                }
                return;
            }
            510 => self.report_interval(from, command.param[0]),
            511 => self.set_interval(from, command.param[0], command.param[1]),
            512 => match message_id(command.param[0]) {
                Some(id) if self.send_message(from.port, id) => ACCEPTED,
                _ => DENIED,
            },
            519 if self.send_message(from.port, PROTOCOL_VERSION) => ACCEPTED,
            520 if self.send_message(from.port, AUTOPILOT_VERSION) => ACCEPTED,
            _ => UNSUPPORTED,
        };
        self.acknowledge(from, command.id, result);
    }

    /// Takes the old SET_MODE, which is not acknowledged.
    pub(crate) fn handle_set_mode(&mut self, fields: &Fields<'_>) {
        let custom = fields.u32(0);
        if let Some(mode) = mode_of(fields.u8(5), (custom >> 16) as u8, (custom >> 24) as u8) {
            self.change_mode(mode);
        }
    }

    fn acknowledge(&mut self, from: Sender, command: u16, result: u8) {
        self.ports[from.port].send_ack(Ack { command, result, to: from.id() });
    }

    fn change_mode(&mut self, mode: Mode) -> bool {
        let sense = self.sense();
        self.commander.set_mode(mode, &sense, &self.tuning)
    }

    fn arm_or_disarm(&mut self, command: &Command) -> u8 {
        let force = command.param[1] == FORCE;
        if command.param[0] == 1.0 {
            let sense = self.sense();
            let was_armed = self.commander.armed();
            let armed = self.commander.arm(&sense, &self.tuning, force);
            if armed && !was_armed {
                self.set_home_here();
            }
            accept(armed)
        } else if command.param[0] == 0.0 {
            accept(self.commander.disarm(force))
        } else {
            UNSUPPORTED
        }
    }

    fn take_off(&mut self, command: &Command) -> u8 {
        // The altitude is above the sea; how high that is in the mission frame depends on where it is asked for.
        let up = if command.z.is_finite() && command.z != 0.0 {
            let base = if command.relative { self.home().alt_m } else { 0.0 };
            let here = self.frame.geodetic(self.vehicle.position());
            let target = Geodetic { alt_m: f64::from(command.z) + base, ..here };
            self.frame.enu_of_geodetic(&target).z as f32
        } else {
            f32::NAN
        };
        let sense = self.sense();
        accept(self.commander.takeoff(up, &sense, &self.tuning))
    }

    fn reposition(&mut self, command: &Command) -> u8 {
        let here = self.frame.geodetic(self.vehicle.position());
        let [lat_deg, lon_deg] = command.place;
        let base = if command.relative { self.home().alt_m } else { 0.0 };
        let across = lat_deg.is_finite() && lon_deg.is_finite();
        let asked = Geodetic {
            lat_deg: if across { lat_deg } else { here.lat_deg },
            lon_deg: if across { lon_deg } else { here.lon_deg },
            alt_m: if command.z.is_finite() { f64::from(command.z) + base } else { here.alt_m },
        };
        if !asked.is_valid() {
            return DENIED;
        }
        let enu = self.frame.enu_of_geodetic(&asked).cast::<f32>();
        let to = Point::new(
            if across { enu.x } else { f32::NAN },
            if across { enu.y } else { f32::NAN },
            if command.z.is_finite() { enu.z } else { f32::NAN },
        );
        let sense = self.sense();
        self.commander.set_cruise(command.param[0]);
        accept(self.commander.reposition(&to, command.param[3], &sense, &self.tuning))
    }

    fn set_home(&mut self, command: &Command) -> u8 {
        let [lat_deg, lon_deg] = command.place;
        let home = if command.param[0] == 1.0 {
            self.frame.geodetic(self.vehicle.position())
        } else {
            Geodetic { lat_deg, lon_deg, alt_m: f64::from(command.z) }
        };
        if !home.is_valid() {
            return DENIED;
        }
        self.set_fixed_home(home);
        ACCEPTED
    }

    fn set_interval(&mut self, from: Sender, id: f32, interval_us: f32) -> u8 {
        let Some(id) = message_id(id) else { return FAILED };
        let interval = if interval_us == 0.0 {
            telemetry::default_interval(id)
        } else if interval_us < 0.0 {
            0
        } else {
            interval_us as u32
        };
        let now = self.time_us;
        if self.ports[from.port].set_interval(id, interval, now) { ACCEPTED } else { FAILED }
    }

    fn report_interval(&mut self, from: Sender, id: f32) -> u8 {
        let port = &mut self.ports[from.port];
        let Some(stream) = message_id(id).and_then(|id| port.streams.iter().find(|stream| stream.id == id))
        else {
            return FAILED;
        };
        let interval_us = if stream.interval_us == 0 { -1 } else { stream.interval_us as i32 };
        let mut payload = [0; 6];
        payload[..4].copy_from_slice(&interval_us.to_le_bytes());
        payload[4..].copy_from_slice(&(stream.id as u16).to_le_bytes());
        port.send_raw(MESSAGE_INTERVAL, &payload);
        ACCEPTED
    }
}

fn accept(done: bool) -> u8 {
    if done { ACCEPTED } else { TEMPORARILY_REJECTED }
}

fn mode_of(base: u8, main: u8, sub: u8) -> Option<Mode> {
    if base & CUSTOM_MODE != 0 { Mode::from_main_sub(main, sub) } else { None }
}

/// A message id that came in a float.
fn message_id(value: f32) -> Option<u32> {
    (0.0..16_777_216.0).contains(&value).then_some(value as u32)
}
