//! Parameters of the simulated ArduCopter: names, types and defaults of 4.6, and the few that have
//! an effect.

use planner_core::Point;

use crate::physics::vehicle::{AirframeParameters, Demand, Gains};
use crate::services::params::ParamValue::{self, Int, Int8, Int16, Real};
use crate::services::params::{Encoding, Params};

/// Default parameters, sorted by name.
const DEFAULTS: &[(&str, ParamValue)] = &[
    ("ACRO_TRAINER", Int8(2)),
    ("ANGLE_MAX", Int16(3000)),
    ("ARMING_CHECK", Int(1)),
    ("ATC_SLEW_YAW", Real(6000.0)),
    ("BATT_ARM_MAH", Int(0)),
    ("BATT_CAPACITY", Int(3300)),
    ("BATT_CRT_MAH", Real(0.0)),
    ("BATT_FS_CRT_ACT", Int8(0)),
    ("BATT_FS_LOW_ACT", Int8(0)),
    ("BATT_LOW_MAH", Real(0.0)),
    ("BATT_MONITOR", Int8(4)),
    // Set by the user of a camera: 1 triggers by servo.
    ("CAM1_TYPE", Int8(1)),
    ("DISARM_DELAY", Int8(10)),
    ("EK3_ENABLE", Int8(1)),
    ("EK3_SRC1_POSXY", Int8(3)),
    ("FENCE_ACTION", Int8(1)),
    ("FENCE_ENABLE", Int8(0)),
    ("FLTMODE1", Int8(7)),
    ("FLTMODE6", Int8(0)),
    ("FRAME_CLASS", Int8(1)),
    ("FRAME_TYPE", Int8(0)),
    ("FS_EKF_ACTION", Int8(1)),
    ("FS_GCS_ENABLE", Int8(0)),
    ("FS_GCS_TIMEOUT", Real(5.0)),
    ("FS_OPTIONS", Int(16)),
    ("FS_THR_ENABLE", Int8(1)),
    ("GUID_OPTIONS", Int(0)),
    ("GUID_TIMEOUT", Real(3.0)),
    ("LAND_ALT_LOW", Int16(1000)),
    ("LAND_SPEED", Int16(50)),
    ("LAND_SPEED_HIGH", Int16(0)),
    ("LOIT_SPEED", Real(1250.0)),
    ("MOT_THST_HOVER", Real(0.39)),
    ("PILOT_SPEED_DN", Int16(0)),
    ("PILOT_SPEED_UP", Int16(250)),
    ("PSC_JERK_XY", Real(5.0)),
    ("PSC_JERK_Z", Real(5.0)),
    ("PSC_POSXY_P", Real(1.0)),
    ("PSC_POSZ_P", Real(1.0)),
    ("PSC_VELXY_D", Real(0.25)),
    ("PSC_VELXY_I", Real(1.0)),
    ("PSC_VELXY_P", Real(2.0)),
    ("PSC_VELZ_I", Real(1.0)),
    ("PSC_VELZ_P", Real(5.0)),
    ("RTL_ALT", Int(1500)),
    ("RTL_ALT_FINAL", Int16(0)),
    ("RTL_CONE_SLOPE", Real(3.0)),
    ("RTL_LOIT_TIME", Int(5000)),
    ("RTL_SPEED", Int16(0)),
    ("SR0_POSITION", Int16(0)),
    ("STAT_RUNTIME", Int(0)),
    ("SYSID_MYGCS", Int16(255)),
    ("SYSID_THISMAV", Int16(1)),
    ("WPNAV_ACCEL", Real(250.0)),
    ("WPNAV_ACCEL_Z", Real(100.0)),
    ("WPNAV_SPEED", Real(1000.0)),
    ("WPNAV_SPEED_DN", Real(150.0)),
    ("WPNAV_SPEED_UP", Real(250.0)),
    ("WP_YAW_BEHAVIOR", Int8(2)),
];

/// The defaults, with `system_id` and the airframe's speed limit in the parameters that hold them.
pub fn default_params(system_id: u8, airframe: &AirframeParameters) -> Params {
    let own = [
        ("SYSID_THISMAV", Int16(i16::from(system_id))),
        ("WPNAV_SPEED", Real(100.0 * airframe.speed_max_mps.min(10.0))),
    ];
    Params::new(DEFAULTS, Encoding::Cast, &own)
}

/// No demand on any axis.
const NO_DEMAND: Point = Point::new(f32::NAN, f32::NAN, f32::NAN);

/// Values of the parameters that have an effect, each named by its effect. Metres, seconds, m/s.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "each is the parameter it is read from, in `CopterTuning::new`")]
pub struct CopterTuning {
    pub gains: Gains,
    /// Horizontal speed limit, m/s.
    pub speed_max: f32,
    /// Climb limit, m/s.
    pub climb_max: f32,
    /// Descent limit, m/s.
    pub descend_max: f32,
    /// Horizontal acceleration limit, m/s².
    pub acceleration_max: f32,
    /// Vertical acceleration limit, m/s².
    pub acceleration_max_z: f32,
    /// Horizontal jerk limit, m/s³.
    pub jerk_max: f32,
    /// Vertical jerk limit, m/s³.
    pub jerk_max_z: f32,
    /// Descent rate of a landing near the ground, m/s.
    pub land_speed: f32,
    /// Height above home at which a landing has slowed down to `land_speed`, metres.
    pub land_slow_below: f32,
    /// Descent rate in modes flown by stick, whose throttle is simulated as low, m/s.
    pub low_stick_descent_rate: f32,
    pub guided_timeout_s: f32,
    pub disarm_delay_s: f32,
    /// Height above home to which a return climbs, metres.
    pub return_height: f32,
    /// Most height of a return for each metre of horizontal distance from home.
    pub return_cone_slope: f32,
    /// Time for which a return waits above home before it lands, seconds.
    pub return_loiter_s: f32,
    pub gcs_failsafe: bool,
    pub gcs_timeout_s: f32,
    /// MAVLink system id of the ground station whose silence starts the failsafe.
    pub gcs_system: u8,
    pub estimator_failsafe: bool,
    /// What a charge below `battery_low_charge` starts: 1 lands, more returns, 0 nothing.
    pub low_battery_action: i32,
    /// Charge (0 to 1) below which the battery is low.
    pub battery_low_charge: f32,
    /// Charge (0 to 1) below which the vehicle cannot be armed.
    pub battery_to_arm_charge: f32,
    pub arming_checks_enabled: bool,
}

impl CopterTuning {
    /// A demand without position, velocity or heading.
    pub(super) fn default_demand(&self) -> Demand {
        Demand {
            position: NO_DEMAND,
            velocity: NO_DEMAND,
            acceleration: NO_DEMAND,
            heading: f32::NAN,
            heading_rate: f32::NAN,
            // 1.5 times the limits that the reference keeps: room to correct errors.
            speed_max: 1.5 * self.speed_max,
            climb_max: 1.5 * self.climb_max,
            descend_max: 1.5 * self.descend_max.max(self.low_stick_descent_rate),
            lift_off_acceleration: f32::NAN,
            min_thrust_per_weight: 0.15,
            height_rate_weight: 0.0,
        }
    }

    /// Reads the values from the parameter table; to be called after each change of a parameter.
    pub fn new(params: &Params) -> Self {
        let cm = |name| 0.01 * params.f32_value(name);
        let whole_cm = |name| 0.01 * params.i32_value(name) as f32;
        let capacity = params.i32_value("BATT_CAPACITY").max(1) as f32;
        let or = |first: f32, second: f32| if first > 0.0 { first } else { second };
        Self {
            gains: Gains {
                position: [params.f32_value("PSC_POSXY_P"), params.f32_value("PSC_POSZ_P")],
                velocity_p: [params.f32_value("PSC_VELXY_P"), params.f32_value("PSC_VELZ_P")],
                velocity_i: [params.f32_value("PSC_VELXY_I"), params.f32_value("PSC_VELZ_I")],
                velocity_d: [params.f32_value("PSC_VELXY_D"), 0.0],
                tilt_max_tan: libm::tanf((whole_cm("ANGLE_MAX")).clamp(10.0, 80.0).to_radians()),
                heading_rate_max: cm("ATC_SLEW_YAW").to_radians(),
            },
            speed_max: cm("WPNAV_SPEED"),
            climb_max: cm("WPNAV_SPEED_UP"),
            descend_max: cm("WPNAV_SPEED_DN"),
            acceleration_max: cm("WPNAV_ACCEL").max(0.5),
            acceleration_max_z: cm("WPNAV_ACCEL_Z").max(0.5),
            jerk_max: params.f32_value("PSC_JERK_XY").max(1.0),
            jerk_max_z: params.f32_value("PSC_JERK_Z").max(1.0),
            land_speed: whole_cm("LAND_SPEED"),
            land_slow_below: whole_cm("LAND_ALT_LOW"),
            low_stick_descent_rate: or(whole_cm("PILOT_SPEED_DN"), whole_cm("PILOT_SPEED_UP")),
            guided_timeout_s: params.f32_value("GUID_TIMEOUT").max(0.1),
            disarm_delay_s: params.i32_value("DISARM_DELAY") as f32,
            return_height: whole_cm("RTL_ALT"),
            return_cone_slope: params.f32_value("RTL_CONE_SLOPE"),
            return_loiter_s: 0.001 * params.i32_value("RTL_LOIT_TIME") as f32,
            gcs_failsafe: params.i32_value("FS_GCS_ENABLE") != 0,
            gcs_timeout_s: params.f32_value("FS_GCS_TIMEOUT"),
            gcs_system: params.i32_value("SYSID_MYGCS") as u8,
            estimator_failsafe: params.i32_value("FS_EKF_ACTION") != 0,
            low_battery_action: params.i32_value("BATT_FS_LOW_ACT"),
            battery_low_charge: params.f32_value("BATT_LOW_MAH") / capacity,
            battery_to_arm_charge: params.i32_value("BATT_ARM_MAH") as f32 / capacity,
            arming_checks_enabled: params.i32_value("ARMING_CHECK") != 0,
        }
    }
}

#[cfg(test)]
mod tests;
