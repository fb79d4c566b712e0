//! Dispatches each received message.
//!
//! Fields are read at their offsets in wire order ([`PayloadReader`]). A message for another system
//! or component, or with an id not listed here, has no effect and no answer, as in PX4 and
//! ArduPilot.

use mavlink::dialects::ardupilotmega as dialect;

use crate::link::command::ReceivedCommand;
use crate::link::frame::CheckedFrame;
use crate::link::msg;
use crate::link::port::{AUTOPILOT_COMPONENT, Sender};
use crate::link::wire::PayloadReader;
use crate::services::params::Encoding;
use crate::{Autopilot, telemetry};

impl Autopilot {
    /// Handles a message that arrived at `port`, and queues its answer, if it has one.
    pub(super) fn handle_frame(&mut self, port: usize, frame: &CheckedFrame) {
        let fields = PayloadReader::new(frame);
        let system_id = self.platform.config.system_id;
        let from = Sender { port, system: frame.system, component: frame.component };
        let for_us = |system: usize, component: usize| {
            let (system, component) = (fields.u8(system), fields.u8(component));
            (system == 0 || system == system_id)
                && (component == 0 || component == AUTOPILOT_COMPONENT)
        };
        let (software, platform) = (&mut self.software, &mut self.platform);
        match frame.message_id {
            msg::HEARTBEAT => software.handle_heartbeat(platform, from),
            msg::PING if fields.u8(12) == 0 && fields.u8(13) == 0 => {
                let answer = telemetry::ping_payload(
                    fields.u64(0),
                    fields.u32(8),
                    from.system,
                    from.component,
                );
                platform.ports[port].send_raw(msg::PING, &answer);
            }
            msg::SET_MODE if fields.u8(4) == system_id => {
                software.handle_set_mode(platform, from, &fields);
            }
            msg::PARAM_REQUEST_READ if for_us(2, 3) => self.handle_param_read(port, &fields),
            msg::PARAM_REQUEST_LIST if for_us(0, 1) => platform.ports[port].param_cursor = Some(0),
            msg::PARAM_SET if for_us(4, 5) => self.handle_param_set(port, &fields),
            // Messages of the mission protocol, by the offsets of their target system and
            // component.
            msg::MISSION_REQUEST_LIST | msg::MISSION_CLEAR_ALL if for_us(0, 1) => {
                platform.handle_mission(from, frame.message_id, &fields);
            }
            msg::MISSION_REQUEST
            | msg::MISSION_SET_CURRENT
            | msg::MISSION_COUNT
            | msg::MISSION_ACK
            | msg::MISSION_REQUEST_INT
                if for_us(2, 3) =>
            {
                platform.handle_mission(from, frame.message_id, &fields);
            }
            msg::MISSION_ITEM | msg::MISSION_ITEM_INT if for_us(32, 33) => {
                platform.handle_mission(from, frame.message_id, &fields);
            }
            msg::REQUEST_DATA_STREAM if for_us(2, 3) => {
                software.handle_stream_request(platform, from, &fields);
            }
            msg::COMMAND_INT if for_us(30, 31) => {
                software.handle_command(
                    platform,
                    from,
                    &ReceivedCommand::from_command_int(&fields),
                );
            }
            msg::COMMAND_LONG if for_us(30, 31) => {
                software.handle_command(
                    platform,
                    from,
                    &ReceivedCommand::from_command_long(&fields),
                );
            }
            msg::SET_POSITION_TARGET_LOCAL_NED | msg::SET_POSITION_TARGET_GLOBAL_INT
                if for_us(50, 51) =>
            {
                software.handle_setpoint(platform, frame.message_id, &fields);
            }
            msg::TIMESYNC if fields.i64(0) == 0 => {
                let message = dialect::TIMESYNC_DATA {
                    tc1: platform.time_us as i64 * 1000,
                    ts1: fields.i64(8),
                };
                platform.ports[port].send(&message);
            }
            _ => {}
        }
    }

    /// Handles PARAM_REQUEST_READ: by index, or by name if the index is negative.
    fn handle_param_read(&mut self, port: usize, fields: &PayloadReader<'_>) {
        let index = fields.u16(0) as i16;
        match usize::try_from(index) {
            Ok(index) => self.send_param(port, index, index as u16),
            Err(_) => self.send_named_param(port, fields.text::<16>(4)),
        }
    }

    fn handle_param_set(&mut self, port: usize, fields: &PayloadReader<'_>) {
        let name = fields.text::<16>(6);
        if let Some(name) = name {
            self.software.set_param(name, fields.f32(0), fields.u8(22));
        }
        // A refused value is answered by a PARAM_VALUE with the unchanged value.
        self.send_named_param(port, name);
    }

    /// Sends a parameter by its name; an unknown name gets no answer. ArduPilot then reports 65535
    /// instead of the index.
    fn send_named_param(&mut self, port: usize, name: Option<&str>) {
        let params = self.software.params();
        if let Some(index) = name.and_then(|name| params.index(name)) {
            let reported =
                if params.encoding() == Encoding::Cast { u16::MAX } else { index as u16 };
            self.send_param(port, index, reported);
        }
    }

    /// Queues PARAM_VALUE of the parameter at `index`, with `reported` as its `param_index`.
    pub(super) fn send_param(&mut self, port: usize, index: usize, reported: u16) {
        let params = self.software.params();
        let Some((name, value)) = params.get(index) else { return };
        // Encoded by hand: value, count, index, name, type.
        let mut payload = [0; 25];
        payload[..4].copy_from_slice(&params.to_wire(value).to_le_bytes());
        payload[4..6].copy_from_slice(&(params.len() as u16).to_le_bytes());
        payload[6..8].copy_from_slice(&reported.to_le_bytes());
        payload[8..8 + name.len()].copy_from_slice(name.as_bytes());
        payload[24] = value.wire_type();
        self.platform.ports[port].send_raw(msg::PARAM_VALUE, &payload);
    }
}
