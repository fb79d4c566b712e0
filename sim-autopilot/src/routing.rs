//! Forwarding of messages between ports, as ArduPilot always does and PX4 if `MAV_x_FORWARD` is
//! set: so a ground station at one port reaches a companion at another.
//!
//! A component is reachable by every port at which it was heard. A message with a target is
//! forwarded to the ports that reach the target, a broadcast to all other ports at which any
//! component was heard. A message for this autopilot alone is not forwarded.

use super::frame::CheckedFrame;
use super::port::{AUTOPILOT_COMPONENT, Port};

/// Offset of the target system id in the payload of a message; the target component id follows it.
/// `None`: the message has no target, so it is a broadcast.
fn target_system_offset(message_id: u32) -> Option<usize> {
    Some(match message_id {
        21 | 43 | 45 => 0,
        110 => 1,
        20 | 40 | 41 | 44 | 47 | 51 | 345 => 2,
        11 | 23 => 4,
        77 => 8,
        75 | 76 => 30,
        39 | 73 => 32,
        84 | 86 => 50,
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
        (payload[at], if frame.message_id == 11 { AUTOPILOT_COMPONENT } else { payload[at + 1] })
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
