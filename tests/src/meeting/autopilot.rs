//! A light autopilot: PX4 or ArduCopter as far as a companion sees it, and a vehicle with a lag and bounded acceleration.
//!
//! It is not the simulated autopilot of `host-sim`, which is truer and slower. ENU metres, steps of [`STEP_S`].

use std::collections::BTreeSet;

use companion::autopilot::Kind;
use companion::frame::{self, Framer, Header, MAX_SENT};
use companion::{AUTOPILOT, Instant, ardupilot, px4};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::frames::{self, Geodetic};

use crate::setpoints::SetpointCheck;

/// Physics and telemetry advance by this, seconds.
pub const STEP_S: f32 = 0.025;
/// The pilot's mode: POSCTL.
const PX4_POSITION: u32 = 0x0003_0000;
/// The pilot's mode: LOITER.
const ARDUPILOT_LOITER: u32 = 5;
/// Setpoints older than this are lost, seconds (`COM_OF_LOSS_T`).
const PX4_LOSS_S: f32 = 1.0;
/// Height over home that a return climbs to, metres.
const RETURN_M: f32 = 6.0;

/// What the autopilot does by itself after a loss of setpoints, or in a failsafe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failsafe {
    /// Lands where it is.
    Land,
    /// Flies home and lands.
    Return,
}

/// What flies the vehicle at this moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flown {
    /// The companion, by setpoints.
    Setpoints,
    /// The autopilot, by a command of the companion: a landing or a take-off.
    Commanded,
    /// The pilot, or the autopilot by itself.
    Other,
}

#[derive(Clone, Copy, Debug)]
struct Target {
    at: Instant,
    position: Option<Point>,
    velocity: Point,
    acceleration: Point,
}

/// One autopilot with its vehicle.
#[derive(Clone, Debug)]
pub struct Autopilot {
    /// Which it is.
    pub kind: Kind,
    id: u8,
    mission_origin: Geodetic,
    ekf_origin: Geodetic,
    /// Truth.
    pub position: Point,
    /// Truth.
    pub velocity: Point,
    acceleration: Point,
    home: Point,
    /// Custom mode of HEARTBEAT.
    pub mode: u32,
    /// Motors on.
    pub armed: bool,
    critical: bool,
    /// The companion asked for the mode of landing.
    landing_commanded: bool,
    /// What a loss of setpoints leads to.
    pub on_loss: Failsafe,
    lost: bool,
    /// Velocity that the pilot asks for.
    pub pilot: Point,
    target: Option<Target>,
    takeoff_z: Option<f32>,
    airborne: bool,
    lifted_at: Option<Instant>,
    grounded_since: Option<Instant>,
    armed_at: Instant,
    guid_timeout_s: f32,
    streams: BTreeSet<u16>,
    sequence: u8,
    framer: Framer,
    phase: u64,
    /// What it was sent.
    pub check: SetpointCheck,
    /// Times it was armed.
    pub armings: u32,
}

impl Autopilot {
    /// On its pad, disarmed. `phase` shifts its streams in time.
    pub fn new(
        kind: Kind,
        id: u8,
        origins: (Geodetic, Geodetic),
        pad: Point,
        phase: u64,
        check: SetpointCheck,
    ) -> Self {
        Self {
            kind,
            id,
            mission_origin: origins.0,
            ekf_origin: origins.1,
            position: pad,
            velocity: Point::zeros(),
            acceleration: Point::zeros(),
            home: pad,
            mode: if kind == Kind::Px4 { px4::HOLD } else { 0 },
            armed: false,
            critical: false,
            landing_commanded: false,
            on_loss: Failsafe::Land,
            lost: false,
            pilot: Point::zeros(),
            target: None,
            takeoff_z: None,
            airborne: false,
            lifted_at: None,
            grounded_since: None,
            armed_at: Instant::ZERO,
            guid_timeout_s: 3.0,
            streams: BTreeSet::new(),
            sequence: 0,
            framer: Framer::new(),
            phase,
            check,
            armings: 0,
        }
    }

    /// Off the ground.
    pub fn is_airborne(&self) -> bool {
        self.airborne
    }

    /// What flies it.
    pub fn flown(&self) -> Flown {
        if self.mode == self.kind.setpoint_mode() {
            if self.takeoff_z.is_some() { Flown::Commanded } else { Flown::Setpoints }
        } else if self.mode == self.kind.land_mode() && self.landing_commanded && !self.critical {
            Flown::Commanded
        } else {
            Flown::Other
        }
    }

    /// Where the last setpoint asked it to be.
    pub fn asked(&self) -> Option<Point> {
        self.target?.position
    }

    /// The pilot's switch.
    pub fn take_over(&mut self, velocity: Point) {
        self.enter(if self.kind == Kind::Px4 { PX4_POSITION } else { ARDUPILOT_LOITER });
        self.pilot = velocity;
    }

    /// The pilot gives Offboard or Guided back; PX4 only while setpoints come.
    pub fn give_back(&mut self, now: Instant) {
        if self.kind == Kind::ArduPilot || self.age_s(now) < 0.5 {
            self.enter(self.kind.setpoint_mode());
        }
    }

    /// The pilot lands it.
    pub fn pilot_lands(&mut self) {
        self.enter(self.kind.land_mode());
    }

    /// A failsafe of its own.
    pub fn fail(&mut self, how: Failsafe) {
        self.enter(match how {
            Failsafe::Land => self.kind.land_mode(),
            Failsafe::Return if self.kind == Kind::Px4 => px4::RTL,
            Failsafe::Return => ardupilot::RTL,
        });
        self.critical = true;
    }

    fn enter(&mut self, mode: u32) {
        if mode != self.mode {
            // What was sent before was not followed.
            self.check.restart();
        }
        (self.mode, self.critical, self.lost, self.landing_commanded) = (mode, false, false, false);
        self.takeoff_z = None;
    }

    fn age_s(&self, now: Instant) -> f32 {
        self.target.map_or(f32::INFINITY, |target| (now - target.at).secs_f32())
    }

    fn ned(&self, point: &Point) -> Vector3<f64> {
        let place = frames::enu_to_geodetic(&self.mission_origin, point);
        frames::geodetic_to_ned(self.kind.projection(), &self.ekf_origin, &place)
    }

    fn tell<M: MessageData>(&mut self, message: &M, out: &mut Vec<u8>) {
        let mut buffer = [0; MAX_SENT];
        let header = Header { system: self.id, component: AUTOPILOT, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let len = frame::encode(header, message, &mut buffer);
        out.extend_from_slice(&buffer[..len]);
    }

    fn ack(&mut self, command: MavCmd, result: MavResult, out: &mut Vec<u8>) {
        // With the extensions, which the crate leaves out: progress, a second result, and to whom.
        let mut payload = [0; 10];
        payload[..2].copy_from_slice(&(command as u16).to_le_bytes());
        payload[2] = result as u8;
        payload[8..].copy_from_slice(&[self.id, companion::COMPONENT]);
        let header = Header { system: self.id, component: AUTOPILOT, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut buffer = [0; MAX_SENT];
        let (id, extra) = (COMMAND_ACK_DATA::ID, COMMAND_ACK_DATA::EXTRA_CRC);
        let len = frame::encode_raw(header, id, extra, &payload, &mut buffer);
        out.extend_from_slice(&buffer[..len]);
    }

    /// Takes what the companion sent, whole frames; answers go to `out`.
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

    fn handle_parameter(&mut self, id: &mavlink::types::CharArray<16>, set: Option<f32>, out: &mut Vec<u8>) {
        let Ok(name) = id.to_str() else { return };
        let known: &[(&str, f32)] = match self.kind {
            Kind::Px4 => &[
                ("MPC_XY_VEL_MAX", 12.0),
                ("MPC_ACC_HOR", 3.0),
                ("MPC_ACC_UP_MAX", 4.0),
                ("MPC_ACC_DOWN_MAX", 3.0),
                ("MPC_Z_VEL_MAX_UP", 3.0),
                ("MPC_Z_VEL_MAX_DN", 1.5),
                ("MPC_JERK_AUTO", 4.0),
                ("MPC_JERK_MAX", 8.0),
                ("COM_OF_LOSS_T", PX4_LOSS_S),
            ],
            Kind::ArduPilot => &[
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
        self.tell(&value, out);
    }

    fn handle_setpoint(&mut self, now: Instant, data: &SET_POSITION_TARGET_LOCAL_NED_DATA) {
        if self.mode != self.kind.setpoint_mode() {
            self.check.restart();
        }
        self.check.take(now.micros() as f64 * 1e-6, data);
        let enu = |x: f32, y: f32, z: f32| frames::swap_enu_ned(&Vector3::new(x, y, z));
        let mask = data.type_mask.bits();
        let ned = Vector3::new(f64::from(data.x), f64::from(data.y), f64::from(data.z));
        let position = (mask & 0b111 == 0).then(|| {
            let place = frames::ned_to_geodetic(self.kind.projection(), &self.ekf_origin, &ned);
            frames::geodetic_to_enu(&self.mission_origin, &place)
        });
        let acceleration = if mask & 0x1C0 == 0 { enu(data.afx, data.afy, data.afz) } else { Point::zeros() };
        let velocity = enu(data.vx, data.vy, data.vz);
        let fields = velocity.iter().chain(acceleration.iter()).chain(position.iter().flatten());
        if fields.clone().any(|field| !field.is_finite()) {
            return;
        }
        // A setpoint ends a take-off, before the lift-off too.
        self.takeoff_z = None;
        self.target = Some(Target { at: now, position, velocity, acceleration });
        if self.lost && self.kind == Kind::Px4 {
            self.enter(px4::OFFBOARD);
        }
    }

    fn handle_command(&mut self, now: Instant, data: &COMMAND_LONG_DATA, out: &mut Vec<u8>) {
        use MavResult::*;
        let mut result = MAV_RESULT_ACCEPTED;
        match data.command {
            MavCmd::MAV_CMD_DO_SET_MODE => {
                let mode = match self.kind {
                    Kind::Px4 => (data.param2 as u32) << 16 | (data.param3 as u32) << 24,
                    Kind::ArduPilot => data.param2 as u32,
                };
                if self.kind == Kind::Px4 {
                    // The first answer is always yes.
                    self.ack(data.command, MAV_RESULT_ACCEPTED, out);
                }
                if mode == px4::OFFBOARD && self.kind == Kind::Px4 && self.airborne && self.age_s(now) > 0.5 {
                    result = MAV_RESULT_TEMPORARILY_REJECTED;
                } else {
                    self.enter(mode);
                    self.landing_commanded = mode == self.kind.land_mode();
                }
            }
            MavCmd::MAV_CMD_NAV_LAND => {
                self.enter(self.kind.land_mode());
                self.landing_commanded = true;
            }
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                let arm = data.param1 == 1.0;
                if arm == self.armed {
                } else if !arm && self.airborne {
                    result = if self.kind == Kind::Px4 {
                        MAV_RESULT_TEMPORARILY_REJECTED
                    } else {
                        MAV_RESULT_FAILED
                    };
                } else {
                    self.armed = arm;
                    self.armings += u32::from(arm);
                    (self.armed_at, self.grounded_since, self.lifted_at) = (now, None, None);
                }
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
                self.tell(&origin, out);
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE => {}
            _ => result = MAV_RESULT_UNSUPPORTED,
        }
        self.ack(data.command, result, out);
    }

    /// The acceleration that its controllers ask for.
    fn wanted(&self, now: Instant, floor_z: f32) -> Vector3<f32> {
        let kind = self.kind;
        let (position_gain, velocity_gain) = match kind {
            Kind::Px4 => (Point::new(0.95, 0.95, 1.0), Point::new(1.8, 1.8, 4.0)),
            Kind::ArduPilot => (Point::new(1.0, 1.0, 1.0), Point::new(2.5, 2.5, 4.0)),
        };
        let mut feed_forward = Point::zeros();
        let mut velocity = Point::zeros();
        let stale_s = if kind == Kind::Px4 { f32::INFINITY } else { self.guid_timeout_s };
        if self.mode == kind.setpoint_mode() {
            if let Some(z) = self.takeoff_z {
                velocity.z = (z - self.position.z).clamp(-0.5, 1.2);
            } else if let Some(target) = self.target.filter(|_| self.age_s(now) < stale_s) {
                velocity = target.velocity;
                if let Some(place) = target.position {
                    velocity += (place - self.position).component_mul(&position_gain);
                    feed_forward = target.acceleration;
                }
            }
            if kind == Kind::Px4 {
                // The ramp of a take-off.
                let lifted_s = self.lifted_at.map_or(0.0, |at| (now - at).secs_f32());
                velocity.z = velocity.z.min(0.4 + 0.4 * lifted_s);
            }
        } else if self.mode == kind.land_mode() {
            velocity.z = -self.landing_mps(floor_z);
        } else if self.mode == px4::RTL && kind == Kind::Px4
            || self.mode == ardupilot::RTL && kind == Kind::ArduPilot
        {
            let away = self.home - self.position;
            let across = away.xy();
            if across.norm() < 0.3 {
                velocity.z = -self.landing_mps(floor_z);
            } else if self.position.z < self.home.z + RETURN_M - 0.3 && across.norm() > 1.0 {
                velocity.z = 1.0;
            } else {
                let speed = across.norm().min(3.0) / across.norm();
                velocity = Point::new(across.x * speed, across.y * speed, 0.0);
            }
        } else if self.mode == PX4_POSITION && kind == Kind::Px4
            || self.mode == ARDUPILOT_LOITER && kind == Kind::ArduPilot
        {
            velocity = self.pilot;
            if self.position.z < floor_z + 0.6 {
                velocity.z = velocity.z.max(0.3);
            }
        }
        let across = velocity.xy().norm();
        if across > 5.0 {
            (velocity.x, velocity.y) = (velocity.x * 5.0 / across, velocity.y * 5.0 / across);
        }
        velocity.z = velocity.z.clamp(-1.5, 2.5);
        let mut wanted = (velocity - self.velocity).component_mul(&velocity_gain) + feed_forward;
        let (across_most, up_most, down_most) = match kind {
            Kind::Px4 => (5.0, 4.0, 3.0),
            Kind::ArduPilot => (2.5, 1.1, 1.1),
        };
        let across = wanted.xy().norm();
        if across > across_most {
            (wanted.x, wanted.y) = (wanted.x * across_most / across, wanted.y * across_most / across);
        }
        wanted.z = wanted.z.clamp(-down_most, up_most);
        wanted
    }

    fn landing_mps(&self, floor_z: f32) -> f32 {
        let height = self.position.z - floor_z;
        match self.kind {
            Kind::Px4 if height > 7.0 => 1.5,
            Kind::Px4 if height > 3.0 => 1.05,
            Kind::Px4 => 0.8,
            Kind::ArduPilot if height > 10.0 => 0.9,
            Kind::ArduPilot => 0.5,
        }
    }

    fn fly(&mut self, now: Instant, floor_z: f32) {
        if !self.armed {
            (self.velocity, self.acceleration) = (Point::zeros(), Point::zeros());
            return;
        }
        let wanted = self.wanted(now, floor_z);
        self.acceleration += (wanted - self.acceleration) * (STEP_S / 0.12);
        self.velocity += self.acceleration * STEP_S;
        self.position += self.velocity * STEP_S;
        // A floor is met from above only.
        if self.position.z <= floor_z && self.position.z > floor_z - 0.3 {
            self.position.z = floor_z;
            self.velocity = Point::new(0.0, 0.0, self.velocity.z.max(0.0));
            self.acceleration = Point::new(0.0, 0.0, self.acceleration.z.max(0.0));
        }
        let height = self.position.z - floor_z;
        if height > 0.12 && !self.airborne {
            self.airborne = true;
            self.lifted_at = Some(now);
        }
        let rests = (-0.3..0.03).contains(&height) && self.velocity.z < 0.05;
        self.grounded_since = if rests { self.grounded_since.or(Some(now)) } else { None };
        let rested_s = self.grounded_since.map_or(0.0, |at| (now - at).secs_f32());
        if rested_s > 0.6 {
            self.airborne = false;
        }
        let flew = self.lifted_at.is_some();
        let after_s = match self.kind {
            Kind::Px4 if flew => 2.8,
            Kind::ArduPilot if flew && self.mode != ardupilot::GUIDED => 1.4,
            _ => 10.0,
        };
        if rested_s > after_s && (now - self.armed_at).secs_f32() > after_s {
            self.armed = false;
        }
    }

    /// One step of flight and telemetry; what it says goes to `out`.
    pub fn step(&mut self, now: Instant, floor_z: f32, out: &mut Vec<u8>) {
        if self.kind == Kind::Px4 && self.mode == px4::OFFBOARD && self.armed && self.age_s(now) > PX4_LOSS_S
        {
            self.fail(self.on_loss);
            self.lost = true;
        }
        self.fly(now, floor_z);
        let count = now.micros() / 25_000 + self.phase;
        if count.is_multiple_of(40) {
            self.say_each_second(out);
        }
        if count.is_multiple_of(8) {
            self.say_often(out);
        }
        if count.is_multiple_of(2) && self.says(32) {
            let (ned, v) = (self.ned(&self.position), frames::swap_enu_ned(&self.velocity));
            let data = LOCAL_POSITION_NED_DATA {
                time_boot_ms: now.boot_ms(),
                x: ned.x as f32,
                y: ned.y as f32,
                z: ned.z as f32,
                vx: v.x,
                vy: v.y,
                vz: v.z,
            };
            self.tell(&data, out);
        }
    }

    fn says(&self, id: u16) -> bool {
        self.kind == Kind::Px4 || self.streams.contains(&id)
    }

    fn say_each_second(&mut self, out: &mut Vec<u8>) {
        let armed = if self.armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
        if self.kind == Kind::Px4 {
            let (pos_horiz_accuracy, pos_vert_accuracy) = (0.02, 0.03);
            self.tell(
                &ESTIMATOR_STATUS_DATA { pos_horiz_accuracy, pos_vert_accuracy, ..Default::default() },
                out,
            );
        }
        let heartbeat = HEARTBEAT_DATA {
            custom_mode: self.mode,
            base_mode: armed | MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            autopilot: match self.kind {
                Kind::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
                Kind::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            },
            system_status: match (self.critical, self.armed) {
                (true, _) => MavState::MAV_STATE_CRITICAL,
                (false, true) => MavState::MAV_STATE_ACTIVE,
                (false, false) => MavState::MAV_STATE_STANDBY,
            },
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            mavlink_version: 3,
        };
        self.tell(&heartbeat, out);
        if self.says(1) {
            self.tell(&SYS_STATUS_DATA { battery_remaining: 90, ..Default::default() }, out);
        }
        if self.kind == Kind::Px4 {
            let status = ESTIMATOR_STATUS_DATA {
                pos_horiz_accuracy: 0.03,
                pos_vert_accuracy: 0.04,
                flags: EstimatorStatusFlags::from_bits_truncate(0x33F),
                ..Default::default()
            };
            self.tell(&status, out);
        }
    }

    fn say_often(&mut self, out: &mut Vec<u8>) {
        if self.says(245) {
            let landed_state = if self.airborne {
                MavLandedState::MAV_LANDED_STATE_IN_AIR
            } else {
                MavLandedState::MAV_LANDED_STATE_ON_GROUND
            };
            self.tell(&EXTENDED_SYS_STATE_DATA { landed_state, ..Default::default() }, out);
        }
        if self.kind != Kind::ArduPilot {
            return;
        }
        if self.says(193) {
            let flags = EkfStatusFlags::from_bits_retain(0x33F);
            self.tell(&EKF_STATUS_REPORT_DATA { flags, ..Default::default() }, out);
        }
        if self.says(33) {
            let relative_alt = ((self.position.z - self.home.z) * 1e3) as i32;
            self.tell(&GLOBAL_POSITION_INT_DATA { relative_alt, ..Default::default() }, out);
        }
    }
}
