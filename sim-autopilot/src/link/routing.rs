//! Forwarding of messages between ports, as ArduPilot always does and PX4 if `MAV_x_FORWARD` is
//! set: so a ground station at one port reaches a companion at another.
//!
//! A component is reachable by every port at which it was heard. A message with a target is
//! forwarded to the ports that reach the target, a broadcast to all other ports at which any
//! component was heard. A message for this autopilot alone is not forwarded.

use crate::link::frame::CheckedFrame;
use crate::link::msg;
use crate::link::port::{AUTOPILOT_COMPONENT, Port};

/// Offset of the target system id in the payload of a message; the target component id follows it.
/// `None`: the message has no target, so it is a broadcast.
fn target_system_offset(message_id: u32) -> Option<usize> {
    Some(match message_id {
        msg::PARAM_REQUEST_LIST | msg::MISSION_REQUEST_LIST | msg::MISSION_CLEAR_ALL => 0,
        msg::FILE_TRANSFER_PROTOCOL => 1,
        msg::PARAM_REQUEST_READ
        | msg::MISSION_REQUEST
        | msg::MISSION_SET_CURRENT
        | msg::MISSION_COUNT
        | msg::MISSION_ACK
        | msg::MISSION_REQUEST_INT
        | msg::PARAM_ERROR => 2,
        msg::SET_MODE | msg::PARAM_SET => 4,
        msg::COMMAND_ACK => 8,
        msg::COMMAND_INT | msg::COMMAND_LONG => 30,
        msg::MISSION_ITEM | msg::MISSION_ITEM_INT => 32,
        msg::SET_POSITION_TARGET_LOCAL_NED | msg::SET_POSITION_TARGET_GLOBAL_INT => 50,
        _ => return None,
    })
}

/// Forwards a frame that arrived at port `from` to the other ports that reach its target.
pub fn forward_to_other_ports(
    ports: &mut [Port],
    from: usize,
    own_system: u8,
    frame: &CheckedFrame,
) {
    let sender = (frame.system, frame.component);
    if sender == (own_system, AUTOPILOT_COMPONENT) {
        return;
    }
    ports[from].learn_route(sender);
    let target = target_system_offset(frame.message_id).map_or((0, 0), |at| {
        let payload = frame.padded_payload();
        // SET_MODE has no target component.
        (
            payload[at],
            if frame.message_id == msg::SET_MODE { AUTOPILOT_COMPONENT } else { payload[at + 1] },
        )
    });
    if target == (own_system, AUTOPILOT_COMPONENT) {
        return;
    }
    for (_, port) in ports.iter_mut().enumerate().filter(|(to, _)| *to != from) {
        if port.is_route_to(target) {
            port.forward_frame(frame);
        }
    }
}
