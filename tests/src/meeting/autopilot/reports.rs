//! What the autopilot sends: answers, and telemetry streams like those of PX4 and ArduCopter.

use companion::autopilot::AutopilotKind;
use companion::link::frame::{self, Header, MAX_FRAME_LEN};
use companion::{AUTOPILOT_COMPONENT, Instant};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::geo::frames;

use super::Autopilot;

impl Autopilot {
    pub(super) fn send<M: MessageData>(&mut self, message: &M, out: &mut Vec<u8>) {
        let mut buffer = [0; MAX_FRAME_LEN];
        let header =
            Header { system: self.id, component: AUTOPILOT_COMPONENT, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let len = frame::encode(header, message, &mut buffer);
        out.extend_from_slice(&buffer[..len]);
    }

    pub(super) fn ack(&mut self, command: MavCmd, result: MavResult, out: &mut Vec<u8>) {
        // With the extension fields that the crate leaves out: progress, second result, and target.
        let mut payload = [0; 10];
        payload[..2].copy_from_slice(&(command as u16).to_le_bytes());
        payload[2] = result as u8;
        payload[8..].copy_from_slice(&[self.id, companion::COMPANION_COMPONENT]);
        let header =
            Header { system: self.id, component: AUTOPILOT_COMPONENT, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME_LEN];
        let (id, extra) = (COMMAND_ACK_DATA::ID, COMMAND_ACK_DATA::EXTRA_CRC);
        let len = frame::encode_raw(header, id, extra, &payload, &mut buffer);
        out.extend_from_slice(&buffer[..len]);
    }

    /// Sends the telemetry that is due at `now`.
    pub(super) fn report(&mut self, now: Instant, out: &mut Vec<u8>) {
        let count = now.as_micros() / 25_000 + self.stream_phase;
        if count.is_multiple_of(40) {
            self.report_each_second(out);
        }
        if count.is_multiple_of(8) {
            self.report_five_times_a_second(out);
        }
        if count.is_multiple_of(2) && self.sends_stream(32) {
            let (ned, v) =
                (self.ned_from_enu(&self.position), frames::swap_enu_ned(&self.velocity));
            let data = LOCAL_POSITION_NED_DATA {
                time_boot_ms: now.as_boot_ms(),
                x: ned.x as f32,
                y: ned.y as f32,
                z: ned.z as f32,
                vx: v.x,
                vy: v.y,
                vz: v.z,
            };
            self.send(&data, out);
        }
    }

    fn ned_from_enu(&self, point: &Point) -> Vector3<f64> {
        let place = frames::enu_to_geodetic(&self.mission_origin, point);
        frames::geodetic_to_ned(self.kind.projection(), &self.ekf_origin, &place)
    }

    /// Whether a stream is sent: by PX4 always, by ArduCopter only if it was requested.
    fn sends_stream(&self, id: u16) -> bool {
        self.kind == AutopilotKind::Px4 || self.streams.contains(&id)
    }

    fn report_each_second(&mut self, out: &mut Vec<u8>) {
        let armed =
            if self.armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
        let heartbeat = HEARTBEAT_DATA {
            custom_mode: self.mode,
            base_mode: armed | MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            autopilot: match self.kind {
                AutopilotKind::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
                AutopilotKind::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            },
            system_status: match (self.in_failsafe, self.armed) {
                (true, _) => MavState::MAV_STATE_CRITICAL,
                (false, true) => MavState::MAV_STATE_ACTIVE,
                (false, false) => MavState::MAV_STATE_STANDBY,
            },
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            mavlink_version: 3,
        };
        self.send(&heartbeat, out);
        if self.sends_stream(1) {
            self.send(&SYS_STATUS_DATA { battery_remaining: 90, ..Default::default() }, out);
        }
        if self.kind == AutopilotKind::Px4 {
            let status = ESTIMATOR_STATUS_DATA {
                pos_horiz_accuracy: 0.03,
                pos_vert_accuracy: 0.04,
                flags: EstimatorStatusFlags::from_bits_truncate(0x33F),
                ..Default::default()
            };
            self.send(&status, out);
        }
    }

    fn report_five_times_a_second(&mut self, out: &mut Vec<u8>) {
        if self.sends_stream(245) {
            let landed_state = if self.airborne {
                MavLandedState::MAV_LANDED_STATE_IN_AIR
            } else {
                MavLandedState::MAV_LANDED_STATE_ON_GROUND
            };
            self.send(&EXTENDED_SYS_STATE_DATA { landed_state, ..Default::default() }, out);
        }
        if self.kind != AutopilotKind::ArduPilot {
            return;
        }
        if self.sends_stream(193) {
            let flags = EkfStatusFlags::from_bits_retain(0x33F);
            self.send(&EKF_STATUS_REPORT_DATA { flags, ..Default::default() }, out);
        }
        if self.sends_stream(33) {
            let relative_alt = ((self.position.z - self.home.z) * 1e3) as i32;
            self.send(&GLOBAL_POSITION_INT_DATA { relative_alt, ..Default::default() }, out);
        }
    }
}
