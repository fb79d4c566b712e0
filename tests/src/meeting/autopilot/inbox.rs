//! Handles what the companion sends: setpoints, commands and parameters.

use companion::Instant;
use companion::autopilot::AutopilotKind;
use companion::autopilot::px4;
use mavlink::dialects::ardupilotmega::*;
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::geo::frames;

use super::{Autopilot, PX4_SETPOINT_LOSS_S, Target};

impl Autopilot {
    /// Handles whole frames from the companion; answers are appended to `out`.
    pub fn handle_bytes(&mut self, now: Instant, bytes: &[u8], out: &mut Vec<u8>) {
        let mut input = bytes;
        while let Some(frame) = self.framer.next(now, &mut input) {
            if let Some(data) = frame.decode::<SET_POSITION_TARGET_LOCAL_NED_DATA>() {
                self.handle_setpoint(now, &data);
            } else if let Some(data) = frame.decode::<COMMAND_LONG_DATA>() {
                self.handle_command(now, &data, out);
            } else if let Some(data) = frame.decode::<PARAM_SET_DATA>() {
                self.handle_parameter(&data.param_id, Some(data.param_value), out);
            } else if let Some(data) = frame.decode::<PARAM_REQUEST_READ_DATA>() {
                self.handle_parameter(&data.param_id, None, out);
            }
        }
    }

    fn handle_parameter(
        &mut self,
        id: &mavlink::types::CharArray<16>,
        set: Option<f32>,
        out: &mut Vec<u8>,
    ) {
        let Ok(name) = id.to_str() else { return };
        let known: &[(&str, f32)] = match self.kind {
            AutopilotKind::Px4 => &[
                ("MPC_XY_VEL_MAX", 12.0),
                ("MPC_ACC_HOR", 3.0),
                ("MPC_ACC_UP_MAX", 4.0),
                ("MPC_ACC_DOWN_MAX", 3.0),
                ("MPC_Z_VEL_MAX_UP", 3.0),
                ("MPC_Z_VEL_MAX_DN", 1.5),
                ("MPC_JERK_AUTO", 4.0),
                ("MPC_JERK_MAX", 8.0),
                ("COM_OF_LOSS_T", PX4_SETPOINT_LOSS_S),
            ],
            AutopilotKind::ArduPilot => &[
                ("WPNAV_ACCEL", 250.0),
                ("WPNAV_ACCEL_Z", 100.0),
                ("WPNAV_SPEED", 1000.0),
                ("WPNAV_SPEED_UP", 250.0),
                ("WPNAV_SPEED_DN", 150.0),
                ("PSC_JERK_XY", 5.0),
                ("PSC_JERK_Z", 5.0),
                ("GUID_TIMEOUT", self.guid_timeout_s),
            ],
        };
        let Some(&(_, held)) = known.iter().find(|(known, _)| *known == name) else { return };
        if let (Some(value), "GUID_TIMEOUT") = (set, name) {
            self.guid_timeout_s = value;
        }
        let value = PARAM_VALUE_DATA {
            param_value: set.unwrap_or(held),
            param_id: name.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
            param_count: known.len() as u16,
            ..Default::default()
        };
        self.send(&value, out);
    }

    fn handle_setpoint(&mut self, now: Instant, data: &SET_POSITION_TARGET_LOCAL_NED_DATA) {
        if self.mode != self.kind.setpoint_mode() {
            self.setpoint_check.begin_stream();
        }
        self.setpoint_check.check_setpoint(now.as_micros() as f64 * 1e-6, data);
        let enu = |x: f32, y: f32, z: f32| frames::swap_enu_ned(&Vector3::new(x, y, z));
        let mask = data.type_mask.bits();
        let ned = Vector3::new(f64::from(data.x), f64::from(data.y), f64::from(data.z));
        let position = (mask & 0b111 == 0).then(|| {
            let place = frames::ned_to_geodetic(self.kind.projection(), &self.ekf_origin, &ned);
            frames::geodetic_to_enu(&self.mission_origin, &place)
        });
        let acceleration =
            if mask & 0x1C0 == 0 { enu(data.afx, data.afy, data.afz) } else { Point::zeros() };
        let velocity = enu(data.vx, data.vy, data.vz);
        let fields = velocity.iter().chain(acceleration.iter()).chain(position.iter().flatten());
        if fields.clone().any(|field| !field.is_finite()) {
            return;
        }
        // A setpoint ends a take-off, also before the lift-off.
        self.takeoff_z = None;
        self.target = Some(Target { at: now, position, velocity, acceleration });
        if self.setpoints_lost && self.kind == AutopilotKind::Px4 {
            self.enter_mode(px4::OFFBOARD);
        }
    }

    fn arm(&mut self, now: Instant) -> MavResult {
        if !self.armed {
            self.armed = true;
            self.armings += 1;
            (self.armed_at, self.grounded_since, self.lifted_at) = (now, None, None);
        }
        MavResult::MAV_RESULT_ACCEPTED
    }

    fn disarm(&mut self, now: Instant) -> MavResult {
        if self.armed && self.airborne {
            return match self.kind {
                AutopilotKind::Px4 => MavResult::MAV_RESULT_TEMPORARILY_REJECTED,
                AutopilotKind::ArduPilot => MavResult::MAV_RESULT_FAILED,
            };
        }
        if self.armed {
            self.armed = false;
            (self.armed_at, self.grounded_since, self.lifted_at) = (now, None, None);
        }
        MavResult::MAV_RESULT_ACCEPTED
    }

    fn handle_command(&mut self, now: Instant, data: &COMMAND_LONG_DATA, out: &mut Vec<u8>) {
        use MavResult::*;
        let mut result = MAV_RESULT_ACCEPTED;
        match data.command {
            MavCmd::MAV_CMD_DO_SET_MODE => {
                let mode = match self.kind {
                    AutopilotKind::Px4 => (data.param2 as u32) << 16 | (data.param3 as u32) << 24,
                    AutopilotKind::ArduPilot => data.param2 as u32,
                };
                if self.kind == AutopilotKind::Px4 {
                    // PX4 accepts every mode command at first; a second ack has the result.
                    self.ack(data.command, MAV_RESULT_ACCEPTED, out);
                }
                if mode == px4::OFFBOARD
                    && self.kind == AutopilotKind::Px4
                    && self.airborne
                    && self.setpoint_age_s(now) > 0.5
                {
                    result = MAV_RESULT_TEMPORARILY_REJECTED;
                } else {
                    self.enter_mode(mode);
                    self.landing_commanded = mode == self.kind.land_mode();
                }
            }
            MavCmd::MAV_CMD_NAV_LAND => {
                self.enter_mode(self.kind.land_mode());
                self.landing_commanded = true;
            }
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                result = if data.param1 == 1.0 { self.arm(now) } else { self.disarm(now) };
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => {
                if self.armed && self.mode == self.kind.setpoint_mode() {
                    self.takeoff_z = Some(self.home.z + data.param7);
                    self.target = None;
                } else {
                    result = MAV_RESULT_FAILED;
                }
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                self.streams.insert(data.param1 as u16);
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE if data.param1 == 49.0 => {
                let origin = GPS_GLOBAL_ORIGIN_DATA {
                    latitude: (self.ekf_origin.lat_deg * 1e7).round() as i32,
                    longitude: (self.ekf_origin.lon_deg * 1e7).round() as i32,
                    altitude: (self.ekf_origin.alt_m * 1e3).round() as i32,
                };
                self.send(&origin, out);
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE => {}
            _ => result = MAV_RESULT_UNSUPPORTED,
        }
        self.ack(data.command, result, out);
    }
}
