//! What the scripted autopilot does with the companion's frames: setpoints, commands with their
//! COMMAND_ACKs, and frames to the radio.

use core::f32::consts::FRAC_PI_2;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::geo::frames;

use super::{Bench, ORIGIN, SYSTEM};
use crate::Link;
use crate::autopilot::AutopilotKind;
use crate::link::frame::{self, Frame, Header, MAX_FRAME_LEN};

/// Bit of a setpoint's `type_mask`: its yaw is ignored.
const YAW_IGNORED: u16 = 0x400;

impl Bench {
    /// Handles a frame that the companion sent on this link.
    pub(super) fn receive(&mut self, link: Link, frame: Frame) {
        let p = frame.padded_payload();
        if frame.message_id == COMMAND_ACK_DATA::ID {
            self.acks.push((u16::from_le_bytes([p[0], p[1]]), p[2], p[8], p[9]));
        }
        if let Some(text) = frame.decode::<STATUSTEXT_DATA>() {
            self.texts.push(text.text.to_str().unwrap().into());
        }
        if link == Link::Swarm {
            self.swarm.push(frame);
            return;
        }
        if let Some(data) = frame.decode() {
            self.handle_setpoint(&data);
        }
        if let Some(t) = frame.decode::<TIMESYNC_DATA>() {
            self.timesyncs.push((t.tc1, t.ts1));
        }
        if let Some(data) = frame.decode() {
            self.handle_command(&data);
        }
    }

    /// Takes a setpoint as the target.
    fn handle_setpoint(&mut self, s: &SET_POSITION_TARGET_LOCAL_NED_DATA) {
        assert_eq!((s.target_system, s.target_component), (SYSTEM, 1));
        assert_eq!(s.coordinate_frame, MavFrame::MAV_FRAME_LOCAL_NED);
        let ned = Vector3::new(f64::from(s.x), f64::from(s.y), f64::from(s.z));
        let place = frames::ned_to_geodetic(self.kind.projection(), &self.origin, &ned);
        let enu = frames::geodetic_to_enu(&ORIGIN, &place) - self.height_error();
        // ArduCopter cancels a take-off at a setpoint that arrives before the lift-off.
        self.took_off &= !self.on_ground();
        assert!(enu.iter().all(|c| c.is_finite()));
        let mask = s.type_mask.bits();
        self.target = (mask | YAW_IGNORED == self.kind.move_type_mask()).then_some(enu);
        self.setpoints.push((self.now, enu, mask));
        self.headings.push((mask & YAW_IGNORED == 0).then_some(FRAC_PI_2 - s.yaw));
    }

    /// Carries out a command, or refuses it.
    fn handle_command(&mut self, c: &COMMAND_LONG_DATA) {
        assert_eq!((c.target_system, c.target_component), (SYSTEM, 1));
        let number = c.command as u16;
        self.commands.push((number, c.param1, c.param2, c.param3));
        if self.silent {
            return;
        }
        // Both autopilot kinds go by their landing detector: a false report lets the vehicle fall.
        let disarms_in_air =
            number == 400 && c.param1 == 0.0 && !self.reports_ground() && self.armed;
        let takes_off_disarmed = number == 22 && !self.armed;
        let refused = self.refused.contains(&number) || disarms_in_air || takes_off_disarmed;
        if !self.mute {
            self.answer(number, if refused { 4 } else { 0 });
        }
        if refused {
            return;
        }
        match c.command {
            MavCmd::MAV_CMD_DO_SET_MODE => {
                self.mode = match self.kind {
                    AutopilotKind::Px4 => (c.param2 as u32) << 16 | (c.param3 as u32) << 24,
                    AutopilotKind::ArduPilot => c.param2 as u32,
                };
            }
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                self.armed = c.param1 == 1.0 && !self.never_arms;
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => {
                assert!(self.kind == AutopilotKind::ArduPilot && self.armed);
                if !self.took_off {
                    self.lifts_at = self.now + self.spool;
                }
                (self.took_off, self.takeoff_m) = (true, c.param7);
                self.target = Some(self.enu + Point::new(0.0, 0.0, c.param7 - 2.0));
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => self.streams.push(c.param1 as u16),
            MavCmd::MAV_CMD_REQUEST_MESSAGE if c.param1 == 49.0 => {
                self.send_origin();
            }
            _ => {}
        }
    }

    /// Sends a COMMAND_ACK for the companion's command.
    pub(crate) fn answer(&mut self, command: u16, result: u8) {
        let [low, high] = command.to_le_bytes();
        let payload = [low, high, result, 0, 0, 0, 0, 0, SYSTEM, crate::COMPANION_COMPONENT];
        let header = Header { system: SYSTEM, component: 1, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut out = [0; MAX_FRAME_LEN];
        let (id, seed) = (COMMAND_ACK_DATA::ID, COMMAND_ACK_DATA::EXTRA_CRC);
        let len = frame::encode_raw(header, id, seed, &payload, &mut out);
        self.companion.handle_bytes(Link::Autopilot, self.now, &out[..len]);
    }
}
