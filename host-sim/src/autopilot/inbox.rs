//! What the simulated autopilot does with each message that comes in.
//!
//! Read by field ([`Fields`]): offsets are those of the wire order. What is for another system or component, or of an id
//! not listed here, changes nothing and is not answered, as on PX4.

use companion::frame::Frame;
use mavlink::dialects::ardupilotmega as dialect;

use super::port::AUTOPILOT_COMPONENT;
use super::px4::params::{self, Params};
use super::px4::setpoint;
use super::wire::Fields;
use super::{Autopilot, telemetry};

/// Who sent a frame, and through which port.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sender {
    pub(crate) port: usize,
    pub(crate) system: u8,
    pub(crate) component: u8,
}

impl Sender {
    pub(crate) fn id(self) -> (u8, u8) {
        (self.system, self.component)
    }
}

impl Autopilot {
    pub(super) fn handle_frame(&mut self, port: usize, frame: &Frame) {
        let fields = Fields::new(frame);
        let from = Sender { port, system: frame.system, component: frame.component };
        let for_us = |system: usize, component: usize| {
            let (system, component) = (fields.u8(system), fields.u8(component));
            (system == 0 || system == self.config.system_id)
                && (component == 0 || component == AUTOPILOT_COMPONENT)
        };
        match frame.message_id {
            4 if fields.u8(12) == 0 && fields.u8(13) == 0 => {
                let answer = telemetry::ping(fields.u64(0), fields.u32(8), from.system, from.component);
                self.ports[port].send_raw(4, &answer);
            }
            11 if fields.u8(4) == self.config.system_id => self.handle_set_mode(&fields),
            20 if for_us(2, 3) => self.handle_param_read(port, &fields),
            21 if for_us(0, 1) => self.ports[port].param_cursor = Some(0),
            23 if for_us(4, 5) => self.handle_param_set(port, &fields),
            // No mission, geofence or rally points are stored: 0 of each kind; none is taken either.
            43 if for_us(0, 1) => {
                self.ports[port].send_raw(44, &[0, 0, from.system, from.component, fields.u8(2)]);
            }
            44 if for_us(2, 3) => {
                let refused = if fields.u16(0) == 0 { 0 } else { 3 };
                self.ports[port].send_raw(47, &[from.system, from.component, refused, fields.u8(4)]);
            }
            45 if for_us(0, 1) => {
                self.ports[port].send_raw(47, &[from.system, from.component, 0, fields.u8(2)]);
            }
            75 if for_us(30, 31) => self.handle_command_int(from, &fields),
            76 if for_us(30, 31) => self.handle_command_long(from, &fields),
            84 | 86 if for_us(50, 51) => {
                let context = setpoint::Context {
                    frame: &self.frame,
                    heading: self.vehicle.state().heading_rad,
                    home_alt_m: self.home.alt_m,
                };
                let setpoint = if frame.message_id == 84 {
                    setpoint::local_ned(&fields, &context)
                } else {
                    setpoint::global_int(&fields, &context)
                };
                if let Some(setpoint) = setpoint {
                    self.commander.handle_setpoint(setpoint, self.time_us);
                }
            }
            111 if fields.i64(0) == 0 => {
                let message = dialect::TIMESYNC_DATA { tc1: self.time_us as i64 * 1000, ts1: fields.i64(8) };
                self.ports[port].send(&message);
            }
            _ => {}
        }
    }

    fn handle_param_read(&mut self, port: usize, fields: &Fields<'_>) {
        let index = fields.u16(0) as i16;
        let index = match usize::try_from(index) {
            Ok(index) => Some(index),
            Err(_) => fields.text::<16>(4).and_then(Params::index),
        };
        if let Some(index) = index {
            self.send_param(port, index);
        }
    }

    fn handle_param_set(&mut self, port: usize, fields: &Fields<'_>) {
        let Some(name) = fields.text::<16>(6) else { return };
        if self.params.set(name, fields.f32(0), fields.u8(22)).is_some() {
            self.tuning = self.params.tuning();
        }
        // What was refused is answered with the value that stands.
        if let Some(index) = Params::index(name) {
            self.send_param(port, index);
        }
    }

    pub(super) fn send_param(&mut self, port: usize, index: usize) {
        let Some((name, value)) = self.params.get(index) else { return };
        let message = dialect::PARAM_VALUE_DATA {
            param_value: value.wire(),
            param_count: self.params.len() as u16,
            param_index: index as u16,
            param_id: name.into(),
            param_type: match value {
                params::Value::Int(_) => dialect::MavParamType::MAV_PARAM_TYPE_INT32,
                params::Value::Real(_) => dialect::MavParamType::MAV_PARAM_TYPE_REAL32,
            },
        };
        self.ports[port].send(&message);
    }
}
