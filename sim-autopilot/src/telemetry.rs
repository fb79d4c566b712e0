//! Telemetry of the simulated autopilots. The stream rates here are those that PX4 1.17 was
//! observed to send on an onboard link without a request; ArduCopter's are in `ardupilot`.
//!
//! A message is encoded only when it is due, from a `Snapshot` that is taken once for all
//! messages of a step.

pub(crate) mod messages;
pub(crate) mod snapshot;

use mavlink::dialects::ardupilotmega as dialect;

use self::messages::to_mavlink_units;
use crate::link::msg;
use crate::link::port::Port;
use crate::telemetry::snapshot::Snapshot;

/// PX4's telemetry streams: message id and default interval in µs; 0: off until requested.
pub const PX4_STREAMS: [(u32, u32); 32] = [
    (0, 1_000_000),   // HEARTBEAT
    (1, 200_000),     // SYS_STATUS
    (2, 1_000_000),   // SYSTEM_TIME
    (4, 1_000_000),   // PING
    (8, 1_000_000),   // LINK_NODE_STATUS
    (24, 125_000),    // GPS_RAW_INT
    (29, 1_000_000),  // SCALED_PRESSURE
    (30, 10_000),     // ATTITUDE
    (31, 20_000),     // ATTITUDE_QUATERNION
    (32, 33_333),     // LOCAL_POSITION_NED
    (33, 20_000),     // GLOBAL_POSITION_INT
    (36, 100_000),    // SERVO_OUTPUT_RAW
    (42, 1_000_000),  // MISSION_CURRENT
    (74, 100_000),    // VFR_HUD
    (83, 100_000),    // ATTITUDE_TARGET
    (85, 100_000),    // POSITION_TARGET_LOCAL_NED
    (105, 20_000),    // HIGHRES_IMU
    (111, 100_000),   // TIMESYNC
    (132, 100_000),   // DISTANCE_SENSOR
    (141, 100_000),   // ALTITUDE
    (147, 2_000_000), // BATTERY_STATUS
    (230, 1_000_000), // ESTIMATOR_STATUS
    (241, 2_000_000), // VIBRATION
    (242, 2_000_000), // HOME_POSITION
    (245, 200_000),   // EXTENDED_SYS_STATE
    (331, 33_333),    // ODOMETRY
    (380, 2_000_000), // TIME_ESTIMATE_TO_TARGET
    (410, 5_000_000), // EVENT: the same recorded event each time
    (411, 3_000_000), // CURRENT_EVENT_SEQUENCE
    (436, 2_000_000), // CURRENT_MODE
    (441, 1_000_000), // GNSS_INTEGRITY
    (49, 0),          // GPS_GLOBAL_ORIGIN: when it changes
];

impl Snapshot {
    /// Queues message `id` at a port; false if there is no such message.
    pub fn send(&self, id: u32, port: &mut Port) -> bool {
        self.send_state(id, port)
            || self.send_attitude(id, port)
            || self.send_position(id, port)
            || self.send_sensor(id, port)
            || self.send_camera(id, port)
    }

    /// Queues a message about the autopilot's identity or state; false for any other id.
    fn send_state(&self, id: u32, port: &mut Port) -> bool {
        match id {
            msg::HEARTBEAT => self.send_heartbeat(port),
            msg::SYS_STATUS => self.send_sys_status(port),
            msg::SYSTEM_TIME => port.send(&dialect::SYSTEM_TIME_DATA {
                time_unix_usec: self.unix_us,
                time_boot_ms: self.boot_ms(),
            }),
            msg::PING => {
                port.pings = port.pings.wrapping_add(1);
                let seq = port.pings;
                port.send_raw(msg::PING, &ping_payload(self.time_us, seq, 0, 0));
            }
            msg::LINK_NODE_STATUS
            | msg::TIME_ESTIMATE_TO_TARGET
            | msg::EVENT
            | msg::CURRENT_EVENT_SEQUENCE
            | msg::GNSS_INTEGRITY => messages::send_recorded(id, port),
            msg::MISSION_CURRENT => {
                let (current, total) = self.mission_item_and_count;
                let [[a, b], [c, d]] =
                    [current.min(total.saturating_sub(1)), total].map(u16::to_le_bytes);
                port.send_raw(msg::MISSION_CURRENT, &[a, b, c, d, 0, 0]);
            }
            msg::TIMESYNC => {
                port.send(&dialect::TIMESYNC_DATA { tc1: 0, ts1: self.time_us as i64 * 1000 });
            }
            msg::AUTOPILOT_VERSION => self.send_version(port),
            msg::EXTENDED_SYS_STATE => {
                // Two bytes: vtol_state undefined (PX4) or multicopter (ArduCopter), then
                // landed_state.
                let vtol = if self.is_px4() { 0 } else { 3 };
                port.send_raw(msg::EXTENDED_SYS_STATE, &[vtol, self.status.landed_state]);
            }
            msg::PROTOCOL_VERSION => {
                // Version 2.00, at least 1.00, at most 2.00; no hashes.
                let mut payload = [0; 22];
                for (at, version) in [(0, 200_u16), (2, 100), (4, 200)] {
                    payload[at..at + 2].copy_from_slice(&version.to_le_bytes());
                }
                port.send_raw(msg::PROTOCOL_VERSION, &payload);
            }
            msg::CURRENT_MODE => {
                let mut payload = [0; 9];
                payload[..4].copy_from_slice(&self.status.custom_mode.to_le_bytes());
                payload[4..8].copy_from_slice(&self.status.intended_mode.to_le_bytes());
                port.send_raw(msg::CURRENT_MODE, &payload);
            }
            _ => return false,
        }
        true
    }

    /// Queues an attitude message; false for any other id.
    fn send_attitude(&self, id: u32, port: &mut Port) -> bool {
        match id {
            msg::ATTITUDE => {
                let [roll, pitch, yaw] = self.attitude().euler;
                port.send(&dialect::ATTITUDE_DATA {
                    time_boot_ms: self.boot_ms(),
                    roll,
                    pitch,
                    yaw,
                    rollspeed: 0.0,
                    pitchspeed: 0.0,
                    yawspeed: self.heading_and_rate.1,
                });
            }
            msg::ATTITUDE_QUATERNION => {
                let [q1, q2, q3, q4] = self.attitude().quaternion;
                port.send(&dialect::ATTITUDE_QUATERNION_DATA {
                    time_boot_ms: self.boot_ms(),
                    q1,
                    q2,
                    q3,
                    q4,
                    rollspeed: 0.0,
                    pitchspeed: 0.0,
                    yawspeed: self.heading_and_rate.1,
                });
            }
            msg::ATTITUDE_TARGET => port.send(&dialect::ATTITUDE_TARGET_DATA {
                time_boot_ms: self.boot_ms(),
                q: self.attitude().quaternion,
                body_roll_rate: 0.0,
                body_pitch_rate: 0.0,
                body_yaw_rate: self.heading_and_rate.1,
                thrust: self.throttle(),
                type_mask: dialect::AttitudeTargetTypemask::empty(),
            }),
            _ => return false,
        }
        true
    }

    /// Queues a message about position, motion or setpoint; false for any other id.
    fn send_position(&self, id: u32, port: &mut Port) -> bool {
        match id {
            // Sent only while the position estimate is valid, as PX4 does.
            msg::LOCAL_POSITION_NED if !self.status.position_known => {}
            msg::LOCAL_POSITION_NED => {
                let (p, v) = (self.ned.cast::<f32>(), self.velocity.cast::<f32>());
                port.send(&dialect::LOCAL_POSITION_NED_DATA {
                    time_boot_ms: self.boot_ms(),
                    x: p.x,
                    y: p.y,
                    z: p.z,
                    vx: v.x,
                    vy: v.y,
                    vz: v.z,
                });
            }
            msg::GLOBAL_POSITION_INT => self.send_global_position(port),
            // Not sent before there is an origin.
            msg::GPS_GLOBAL_ORIGIN if !self.status.origin_known => {}
            msg::GPS_GLOBAL_ORIGIN => {
                let (latitude, longitude, altitude) = to_mavlink_units(&self.ekf_origin);
                port.send(&dialect::GPS_GLOBAL_ORIGIN_DATA { latitude, longitude, altitude });
            }
            msg::VFR_HUD => {
                let v = self.velocity.cast::<f32>();
                port.send(&dialect::VFR_HUD_DATA {
                    airspeed: f32::NAN,
                    groundspeed: libm::sqrtf(v.x * v.x + v.y * v.y),
                    alt: self.geodetic.alt_m as f32,
                    climb: -v.z,
                    heading: self.heading_deg() as i16,
                    throttle: (100.0 * self.throttle()) as u16,
                });
            }
            msg::POSITION_TARGET_LOCAL_NED if !self.status.reports_position_target => {}
            msg::POSITION_TARGET_LOCAL_NED => self.send_target(port),
            msg::ALTITUDE => port.send(&dialect::ALTITUDE_DATA {
                time_usec: self.time_us,
                altitude_monotonic: self.geodetic.alt_m as f32,
                altitude_amsl: self.geodetic.alt_m as f32,
                altitude_local: -self.ned.z as f32,
                altitude_relative: (self.geodetic.alt_m - self.home.0.alt_m) as f32,
                altitude_terrain: -self.ned.z as f32 - self.height_above_ground,
                bottom_clearance: self.height_above_ground,
            }),
            msg::NAV_CONTROLLER_OUTPUT => {
                port.send(&dialect::NAV_CONTROLLER_OUTPUT_DATA::default());
            }
            msg::HOME_POSITION => self.send_home(port),
            msg::ODOMETRY => self.send_odometry(port),
            _ => return false,
        }
        true
    }

    /// Queues a message about sensors, motors, battery or estimator; false for any other id.
    fn send_sensor(&self, id: u32, port: &mut Port) -> bool {
        match id {
            msg::GPS_RAW_INT => self.send_gps(port),
            msg::SCALED_PRESSURE => port.send(&dialect::SCALED_PRESSURE_DATA {
                time_boot_ms: self.boot_ms(),
                press_abs: self.pressure(),
                press_diff: 0.0,
                temperature: 1500,
            }),
            msg::SERVO_OUTPUT_RAW => self.send_servos(port),
            msg::HIGHRES_IMU => self.send_imu(port),
            msg::DISTANCE_SENSOR => self.send_distance(port),
            msg::BATTERY_STATUS => self.send_battery(port),
            msg::EKF_STATUS_REPORT => self.send_ekf_status_report(port),
            msg::ESTIMATOR_STATUS => port.send(&dialect::ESTIMATOR_STATUS_DATA {
                time_usec: self.time_us,
                flags: dialect::EstimatorStatusFlags::from_bits_truncate(
                    if self.gps_error_and_fix.2 { 895 } else { 0x27 },
                ),
                vel_ratio: 0.05,
                pos_horiz_ratio: 0.03,
                pos_vert_ratio: 0.01,
                mag_ratio: 0.07,
                hagl_ratio: 0.004,
                tas_ratio: f32::NAN,
                pos_horiz_accuracy: self.accuracy[0],
                pos_vert_accuracy: self.accuracy[1],
            }),
            msg::VIBRATION => port.send(&dialect::VIBRATION_DATA {
                time_usec: self.time_us,
                vibration_x: 0.0,
                vibration_y: 0.1,
                vibration_z: if self.armed { 1.4 } else { 0.0 },
                clipping_0: 0,
                clipping_1: 0,
                clipping_2: 0,
            }),
            _ => return false,
        }
        true
    }
}

/// Encodes the payload of PING, whose type is deprecated in the crate; system and component are the
/// target's, both 0 in a request.
pub fn ping_payload(time_us: u64, seq: u32, system: u8, component: u8) -> [u8; 14] {
    let mut payload = [0; 14];
    payload[..8].copy_from_slice(&time_us.to_le_bytes());
    payload[8..12].copy_from_slice(&seq.to_le_bytes());
    payload[12..].copy_from_slice(&[system, component]);
    payload
}
