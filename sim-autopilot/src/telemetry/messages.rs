//! Encodes the larger telemetry messages from a [`Snapshot`].

use mavlink::dialects::ardupilotmega as dialect;
use planner_core::geo::frames::Geodetic;

use crate::link::msg::HEARTBEAT;
use crate::link::port::Port;
use crate::physics::vehicle::GRAVITY;
use crate::telemetry::snapshot::Snapshot;

/// `capabilities` that PX4 1.17 reports, without FTP (32), which is not simulated.
const PX4_CAPABILITIES: u64 = 0xE8DF;
/// `capabilities` that ArduCopter 4.6 reports, without FTP (32), terrain (0x200) and compass
/// calibration (0x1000).
const ARDUPILOT_CAPABILITIES: u64 = 0xE9CF;
/// PX4 1.17.0, release, in the encoding of AUTOPILOT_VERSION.
const PX4_VERSION: u32 = 17_891_583;
/// ArduCopter 4.6.2, release, in the encoding of AUTOPILOT_VERSION.
const ARDUPILOT_VERSION: u32 = 0x0406_02FF;
/// Sensor bits of SYS_STATUS: present, enabled, healthy.
const PX4_SENSORS: [u32; 3] = [50_348_079, 50_413_615, 52_480_063];
/// As [`PX4_SENSORS`]; bit PREARM is set as healthy only while the arming checks pass.
const ARDUPILOT_SENSORS: [u32; 3] = [1_399_979_055, 1_382_128_687, 1_467_063_343 & !PREARM];
/// Bit MAV_SYS_STATUS_PREARM_CHECK of SYS_STATUS.
const PREARM: u32 = 0x1000_0000;
/// Bit MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL of SYS_STATUS.
const XY_POSITION_CONTROL: u32 = 0x4000;

/// Messages that many dialects do not have: id, CRC_EXTRA and payload as recorded from PX4 1.17.
/// Their contents do not matter; they test that receivers skip unknown messages.
const RECORDED_MESSAGES: [(u32, u8, &[u8]); 5] = [
    (8, 117, &[0xA0, 0x6F, 0x6D, 0, 0, 0, 0, 0, 0x29, 0x60, 0, 0, 0, 0, 0, 0, 0xAB, 9]),
    (
        380,
        232,
        &[
            0, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255,
            255,
        ],
    ),
    (
        410,
        160,
        &[0x27, 0x37, 0x1D, 1, 0x5C, 0x18, 0, 0, 0x0D, 0, 0, 0, 0x88, 0, 0x0A, 0x0C, 2, 0x38],
    ),
    (411, 106, &[13]),
    (441, 169, &[0, 0, 0, 0, 255, 255, 255, 255, 4, 0, 0, 0, 0, 255, 255, 255, 255]),
];

/// Sends message `id` of [`RECORDED_MESSAGES`].
pub(crate) fn send_recorded(id: u32, port: &mut Port) {
    if let Some(&(_, seed, payload)) = RECORDED_MESSAGES.iter().find(|message| message.0 == id) {
        port.send_with_crc_extra(id, seed, payload);
    }
}

impl Snapshot {
    /// Throttle, 0 to 1: a hover takes half; 0 while disarmed.
    pub(crate) fn throttle(&self) -> f32 {
        if self.armed { (0.5 * self.specific_force.norm() / GRAVITY).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Pressure of the standard atmosphere at the estimated altitude, hPa.
    pub(crate) fn pressure(&self) -> f32 {
        let ratio = 1.0 - 2.255_77e-5 * self.geodetic.alt_m as f32;
        1013.25 * libm::powf(ratio.max(0.1), 5.255_88)
    }

    pub(crate) fn send_heartbeat(&self, port: &mut Port) {
        let status = &self.status;
        let [a, b, c, d] = status.custom_mode.to_le_bytes();
        // Encoded by hand: MAV_TYPE_QUADROTOR 2, MAV_AUTOPILOT_PX4 12 or _ARDUPILOTMEGA 3, protocol
        // version 3.
        let autopilot = if self.is_px4() { 12 } else { 3 };
        port.send_raw(
            HEARTBEAT,
            &[a, b, c, d, 2, autopilot, status.base_mode, status.system_status, 3],
        );
    }

    pub(crate) fn send_sys_status(&self, port: &mut Port) {
        let [present, enabled, mut health] =
            if self.is_px4() { PX4_SENSORS } else { ARDUPILOT_SENSORS };
        if self.status.armable {
            health |= PREARM;
        }
        if !self.gps_error_and_fix.2 {
            health &= !(XY_POSITION_CONTROL | 0x20);
        }
        let bits = dialect::MavSysStatusSensor::from_bits_retain;
        port.send(&dialect::SYS_STATUS_DATA {
            onboard_control_sensors_present: bits(present),
            onboard_control_sensors_enabled: bits(enabled),
            onboard_control_sensors_health: bits(health),
            load: 300,
            voltage_battery: (1000.0 * self.battery_volts()) as u16,
            current_battery: -100,
            drop_rate_comm: 0,
            errors_comm: 0,
            errors_count1: 0,
            errors_count2: 0,
            errors_count3: 0,
            errors_count4: 0,
            battery_remaining: (100.0 * self.battery) as i8,
        });
    }

    pub(crate) fn send_gps(&self, port: &mut Port) {
        let (north, east, fix) = self.gps_error_and_fix;
        let cos = libm::cos(self.geodetic.lat_deg.to_radians()).max(0.01);
        let at = Geodetic {
            lat_deg: self.geodetic.lat_deg + f64::from(north) / 111_195.0,
            lon_deg: self.geodetic.lon_deg + f64::from(east) / (111_195.0 * cos),
            ..self.geodetic
        };
        let (lat, lon, alt) = to_mavlink_units(&at);
        let v = self.velocity.cast::<f32>();
        let course = libm::atan2f(v.y, v.x).to_degrees();
        port.send(&dialect::GPS_RAW_INT_DATA {
            time_usec: self.time_us,
            lat,
            lon,
            alt,
            eph: 70,
            epv: 110,
            vel: (100.0 * libm::sqrtf(v.x * v.x + v.y * v.y)) as u16,
            cog: (100.0 * if course < 0.0 { course + 360.0 } else { course }) as u16,
            fix_type: if fix {
                dialect::GpsFixType::GPS_FIX_TYPE_3D_FIX
            } else {
                dialect::GpsFixType::GPS_FIX_TYPE_NO_FIX
            },
            satellites_visible: if fix { 10 } else { 0 },
        });
    }

    pub(crate) fn send_global_position(&self, port: &mut Port) {
        let unknown = Geodetic::default();
        let known = self.status.origin_known;
        let (lat, lon, alt) = to_mavlink_units(if known { &self.geodetic } else { &unknown });
        let above_home = if known { self.geodetic.alt_m - self.home.0.alt_m } else { 0.0 };
        let centimetres = |v: f64| (100.0 * v) as i16;
        port.send(&dialect::GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.boot_ms(),
            lat,
            lon,
            alt,
            relative_alt: libm::round(1000.0 * above_home) as i32,
            vx: centimetres(self.velocity.x),
            vy: centimetres(self.velocity.y),
            vz: centimetres(self.velocity.z),
            hdg: ((100.0 * self.heading_deg()) as u16).min(35_999),
        });
    }

    pub(crate) fn send_servos(&self, port: &mut Port) {
        let idle = if self.is_px4() { 900 } else { 1000 };
        let motor = if self.armed { 1000 + (1000.0 * self.throttle()) as u16 } else { idle };
        let unused = if self.is_px4() { 900 } else { 0 };
        port.send(&dialect::SERVO_OUTPUT_RAW_DATA {
            time_usec: self.time_us as u32,
            servo1_raw: motor,
            servo2_raw: motor,
            servo3_raw: motor,
            servo4_raw: motor,
            servo5_raw: unused,
            servo6_raw: unused,
            servo7_raw: unused,
            servo8_raw: unused,
            port: 0,
        });
    }

    pub(crate) fn send_target(&self, port: &mut Port) {
        let [p, v, a] = self.target.map(nalgebra::Vector3::cast::<f32>);
        port.send(&dialect::POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: self.boot_ms(),
            x: p.x,
            y: p.y,
            z: p.z,
            vx: v.x,
            vy: v.y,
            vz: v.z,
            afx: a.x,
            afy: a.y,
            afz: a.z,
            yaw: self.heading_and_rate.0,
            yaw_rate: 0.0,
            type_mask: dialect::PositionTargetTypemask::empty(),
            coordinate_frame: dialect::MavFrame::MAV_FRAME_LOCAL_NED,
        });
    }

    pub(crate) fn send_imu(&self, port: &mut Port) {
        // Thrust acts along the body's z axis, so the accelerometer measures it on z alone.
        port.send(&dialect::HIGHRES_IMU_DATA {
            time_usec: self.time_us,
            xacc: 0.0,
            yacc: 0.0,
            zacc: -self.specific_force.norm(),
            xgyro: 0.0,
            ygyro: 0.0,
            zgyro: self.heading_and_rate.1,
            xmag: 0.21,
            ymag: 0.0,
            zmag: 0.39,
            abs_pressure: self.pressure(),
            diff_pressure: 0.0,
            pressure_alt: self.geodetic.alt_m as f32,
            temperature: 15.0,
            fields_updated: dialect::HighresImuUpdatedFlags::from_bits_retain(6719),
        });
    }

    pub(crate) fn send_distance(&self, port: &mut Port) {
        port.send(&dialect::DISTANCE_SENSOR_DATA {
            time_boot_ms: self.boot_ms(),
            min_distance: 0,
            max_distance: 10_000,
            current_distance: (100.0 * self.height_above_ground).clamp(0.0, 10_000.0) as u16,
            mavtype: dialect::MavDistanceSensor::MAV_DISTANCE_SENSOR_LASER,
            id: 0,
            orientation: dialect::MavSensorOrientation::MAV_SENSOR_ROTATION_PITCH_270,
            covariance: 0,
        });
    }

    pub(crate) fn send_battery(&self, port: &mut Port) {
        let mut voltages = [u16::MAX; 10];
        voltages[0] = (1000.0 * self.battery_volts()) as u16;
        port.send(&dialect::BATTERY_STATUS_DATA {
            current_consumed: (5000.0 * (1.0 - self.battery)) as i32,
            energy_consumed: -1,
            temperature: i16::MAX,
            voltages,
            current_battery: -100,
            id: 0,
            battery_function: dialect::MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL,
            mavtype: dialect::MavBatteryType::MAV_BATTERY_TYPE_LIPO,
            battery_remaining: (100.0 * self.battery) as i8,
        });
    }

    pub(crate) fn send_version(&self, port: &mut Port) {
        let git = [0, 0, 0, 196, 209, 42, 241, 214];
        let (capabilities, version) = if self.is_px4() {
            (PX4_CAPABILITIES, PX4_VERSION)
        } else {
            (ARDUPILOT_CAPABILITIES, ARDUPILOT_VERSION)
        };
        port.send(&dialect::AUTOPILOT_VERSION_DATA {
            capabilities: dialect::MavProtocolCapability::from_bits_retain(capabilities),
            uid: 5_283_920_058_631_409_000 + u64::from(self.system_id),
            flight_sw_version: version,
            middleware_sw_version: version,
            os_sw_version: 101_854_463,
            board_version: 1,
            vendor_id: 0,
            product_id: 0,
            flight_custom_version: git,
            middleware_custom_version: git,
            os_custom_version: [0; 8],
        });
    }

    pub(crate) fn send_ekf_status_report(&self, port: &mut Port) {
        port.send(&dialect::EKF_STATUS_REPORT_DATA {
            velocity_variance: 0.01,
            pos_horiz_variance: 0.02,
            pos_vert_variance: 0.01,
            compass_variance: 0.03,
            terrain_alt_variance: 0.0,
            flags: dialect::EkfStatusFlags::from_bits_retain(self.status.ekf_flags),
        });
    }

    pub(crate) fn send_home(&self, port: &mut Port) {
        let (home, ned) = &self.home;
        let (latitude, longitude, altitude) = to_mavlink_units(home);
        let ned = ned.cast::<f32>();
        port.send(&dialect::HOME_POSITION_DATA {
            latitude,
            longitude,
            altitude,
            x: ned.x,
            y: ned.y,
            z: ned.z,
            // ArduCopter does not report the attitude at home.
            q: if self.is_px4() { [1.0, 0.0, 0.0, 0.0] } else { [f32::NAN; 4] },
            approach_x: 0.0,
            approach_y: 0.0,
            approach_z: 0.0,
        });
    }

    pub(crate) fn send_odometry(&self, port: &mut Port) {
        // Only the diagonal of the covariance (upper triangle, row by row) is known; the rest is
        // NaN.
        let mut pose_covariance = [f32::NAN; 21];
        let mut velocity_covariance = [f32::NAN; 21];
        for (at, variance) in
            [(0, 0.043), (6, 0.043), (11, 0.08), (15, 4e-4), (18, 4e-4), (20, 0.03)]
        {
            pose_covariance[at] = variance;
        }
        for (at, variance) in [(0, 0.009), (6, 0.009), (11, 0.005)] {
            velocity_covariance[at] = variance;
        }
        let (p, v) = (self.ned.cast::<f32>(), self.velocity.cast::<f32>());
        port.send(&dialect::ODOMETRY_DATA {
            time_usec: self.time_us,
            x: p.x,
            y: p.y,
            z: p.z,
            q: self.attitude().quaternion,
            vx: v.x,
            vy: v.y,
            vz: v.z,
            rollspeed: 0.0,
            pitchspeed: 0.0,
            yawspeed: self.heading_and_rate.1,
            pose_covariance,
            velocity_covariance,
            frame_id: dialect::MavFrame::MAV_FRAME_LOCAL_NED,
            child_frame_id: dialect::MavFrame::MAV_FRAME_LOCAL_NED,
        });
    }
}

/// Converts to latitude and longitude in 1e-7 degrees and altitude in millimetres, rounded.
pub(crate) fn to_mavlink_units(position: &Geodetic) -> (i32, i32, i32) {
    (
        libm::round(position.lat_deg * 1e7) as i32,
        libm::round(position.lon_deg * 1e7) as i32,
        libm::round(position.alt_m * 1e3) as i32,
    )
}
