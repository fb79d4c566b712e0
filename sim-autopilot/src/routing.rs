//! Passing on what is for others, from port to port, as ArduPilot always does and PX4 where
//! `MAV_x_FORWARD` is set: so a ground station on one port reaches a companion on another.
//!
//! A port leads to every component that was heard on it. A message to one goes to the ports that
//! lead there, a message to nobody in particular to all other ports on which a sender was heard;
//! what is for this autopilot alone goes no further.

use super::frame::Frame;
use super::port::{AUTOPILOT_COMPONENT, Port};

/// Offset at which a message names its target system, the component after it: in its payload. Other
/// messages are for every system.
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

/// Passes a frame that came in at `from` on, by the other ports.
pub fn forward_to_other_ports(ports: &mut [Port], from: usize, own_system: u8, frame: &Frame) {
    let sender = (frame.system, frame.component);
    if sender == (own_system, AUTOPILOT_COMPONENT) {
        return;
    }
    ports[from].learn_route(sender);
    let target = target_system_offset(frame.message_id).map_or((0, 0), |at| {
        let payload = frame.padded();
        // SET_MODE names no component.
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
