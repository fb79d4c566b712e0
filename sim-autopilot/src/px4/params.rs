//! Parameters of the simulated PX4: names, types and defaults of 1.17's quadrotor, and the few that
//! have an effect.

use planner_core::Point;

use crate::physics::vehicle::{AirframeParameters, Demand, Gains};
use crate::services::params::Encoding;
use crate::services::params::ParamValue::{self, Int, Real};
use crate::services::params::Params;

/// Default parameters, sorted by name, as PX4 lists them.
const DEFAULTS: &[(&str, ParamValue)] = &[
    ("BAT1_CAPACITY", Real(-1.0)),
    ("BAT1_N_CELLS", Int(4)),
    ("BAT1_V_CHARGED", Real(4.05)),
    ("BAT1_V_EMPTY", Real(3.6)),
    ("BAT_CRIT_THR", Real(0.07)),
    ("BAT_EMERGEN_THR", Real(0.05)),
    ("BAT_LOW_THR", Real(0.15)),
    ("CAL_ACC0_ID", Int(1_310_988)),
    ("CAL_ACC0_PRIO", Int(50)),
    ("CAL_GYRO0_ID", Int(1_310_988)),
    ("CAL_GYRO0_PRIO", Int(50)),
    ("CAL_MAG0_ID", Int(197_388)),
    ("CAL_MAG0_PRIO", Int(50)),
    ("CBRK_SUPPLY_CHK", Int(0)),
    ("CBRK_USB_CHK", Int(197_848)),
    ("COM_ARM_WO_GPS", Int(1)),
    ("COM_DISARM_LAND", Real(2.0)),
    ("COM_DISARM_PRFLT", Real(10.0)),
    ("COM_DL_LOSS_T", Int(10)),
    ("COM_FAIL_ACT_T", Real(5.0)),
    ("COM_HOME_EN", Int(1)),
    ("COM_LOW_BAT_ACT", Int(0)),
    ("COM_OBC_LOSS_T", Real(5.0)),
    ("COM_OBL_RC_ACT", Int(0)),
    ("COM_OF_LOSS_T", Real(1.0)),
    ("COM_RCL_EXCEPT", Int(0)),
    ("COM_RC_IN_MODE", Int(1)),
    ("COM_RC_LOSS_T", Real(0.5)),
    ("COM_SPOOLUP_TIME", Real(1.0)),
    ("EKF2_AID_MASK", Int(1)),
    ("EKF2_EN", Int(1)),
    ("EKF2_GPS_CTRL", Int(7)),
    ("EKF2_HGT_REF", Int(1)),
    ("GF_ACTION", Int(2)),
    ("GF_MAX_HOR_DIST", Real(0.0)),
    ("GF_MAX_VER_DIST", Real(0.0)),
    ("LNDMC_TRIG_TIME", Real(1.0)),
    ("MAV_0_MODE", Int(0)),
    ("MAV_COMP_ID", Int(1)),
    ("MAV_SYS_ID", Int(1)),
    ("MAV_TYPE", Int(2)),
    ("MIS_DIST_1WP", Real(10_000.0)),
    ("MIS_TAKEOFF_ALT", Real(2.5)),
    ("MIS_TKO_LAND_REQ", Int(0)),
    ("MPC_ACC_DOWN_MAX", Real(3.0)),
    ("MPC_ACC_HOR", Real(3.0)),
    ("MPC_ACC_HOR_MAX", Real(5.0)),
    ("MPC_ACC_UP_MAX", Real(4.0)),
    ("MPC_JERK_AUTO", Real(4.0)),
    ("MPC_JERK_MAX", Real(8.0)),
    ("MPC_LAND_ALT1", Real(10.0)),
    ("MPC_LAND_ALT2", Real(5.0)),
    ("MPC_LAND_ALT3", Real(1.0)),
    ("MPC_LAND_CRWL", Real(0.3)),
    ("MPC_LAND_SPEED", Real(0.7)),
    ("MPC_THR_HOVER", Real(0.5)),
    ("MPC_THR_MAX", Real(1.0)),
    ("MPC_THR_MIN", Real(0.12)),
    ("MPC_TILTMAX_AIR", Real(45.0)),
    ("MPC_TILTMAX_LND", Real(12.0)),
    ("MPC_TKO_RAMP_T", Real(3.0)),
    ("MPC_TKO_SPEED", Real(1.5)),
    ("MPC_XY_CRUISE", Real(5.0)),
    ("MPC_XY_P", Real(0.95)),
    ("MPC_XY_VEL_ALL", Real(-10.0)),
    ("MPC_XY_VEL_D_ACC", Real(0.2)),
    ("MPC_XY_VEL_I_ACC", Real(0.4)),
    ("MPC_XY_VEL_MAX", Real(12.0)),
    ("MPC_XY_VEL_P_ACC", Real(1.8)),
    ("MPC_YAWRAUTO_MAX", Real(60.0)),
    ("MPC_Z_P", Real(1.0)),
    ("MPC_Z_VEL_D_ACC", Real(0.0)),
    ("MPC_Z_VEL_I_ACC", Real(2.0)),
    ("MPC_Z_VEL_MAX_DN", Real(1.5)),
    ("MPC_Z_VEL_MAX_UP", Real(3.0)),
    ("MPC_Z_VEL_P_ACC", Real(4.0)),
    ("MPC_Z_V_AUTO_DN", Real(1.5)),
    ("MPC_Z_V_AUTO_UP", Real(3.0)),
    ("NAV_ACC_RAD", Real(2.0)),
    ("NAV_DLL_ACT", Int(0)),
    ("NAV_RCL_ACT", Int(2)),
    ("RTL_CONE_ANG", Int(45)),
    ("RTL_DESCEND_ALT", Real(30.0)),
    ("RTL_LAND_DELAY", Real(0.0)),
    ("RTL_MIN_DIST", Real(10.0)),
    ("RTL_RETURN_ALT", Real(60.0)),
    ("RTL_TYPE", Int(0)),
    ("SDLOG_MODE", Int(0)),
    ("SYS_AUTOSTART", Int(10_040)),
    ("SYS_HAS_BARO", Int(1)),
    ("SYS_HAS_GPS", Int(1)),
    ("SYS_HAS_MAG", Int(1)),
    // Set by the user of a camera: 4 triggers by distance, on command.
    ("TRIG_MODE", Int(4)),
];

/// The defaults, with `system_id` and the airframe's limits in the parameters that hold them.
pub fn default_params(system_id: u8, airframe: &AirframeParameters) -> Params {
    let own = [
        ("MAV_SYS_ID", Int(i32::from(system_id))),
        ("MPC_XY_VEL_MAX", Real(airframe.speed_max_mps)),
        ("MPC_Z_VEL_MAX_UP", Real(airframe.climb_max_mps)),
        ("MPC_Z_VEL_MAX_DN", Real(airframe.descend_max_mps)),
        ("MPC_TILTMAX_AIR", Real(airframe.tilt_max_deg)),
    ];
    Params::new(DEFAULTS, Encoding::Bytewise, &own)
}

/// No demand on any axis.
const NO_DEMAND: Point = Point::new(f32::NAN, f32::NAN, f32::NAN);

/// Values of the parameters that have an effect, each named by its effect. Metres, seconds, m/s.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "each is the parameter it is read from, in `Px4Tuning::new`")]
pub struct Px4Tuning {
    pub gains: Gains,
    /// Horizontal speed limit of manual and Offboard flight, m/s.
    pub speed_max: f32,
    /// Climb limit of manual and Offboard flight, m/s.
    pub climb_max: f32,
    /// Descent limit of manual and Offboard flight, m/s.
    pub descend_max: f32,
    /// Horizontal speed of the automatic modes, m/s.
    pub cruise_speed: f32,
    /// Climb limit of the automatic modes, m/s.
    pub auto_climb_max: f32,
    /// Descent limit of the automatic modes, m/s.
    pub auto_descend_max: f32,
    /// Descent rate below the second height of `land_slow_below`, m/s.
    pub land_speed: f32,
    /// Heights above home between which a landing slows down, the upper first, metres.
    pub land_slow_below: [f32; 2],
    /// Descent rate below `land_crawl_below`, m/s.
    pub land_crawl_speed: f32,
    /// Distance to the ground below which a landing with a distance sensor crawls, metres.
    pub land_crawl_below: f32,
    /// Jerk limit of the automatic modes, m/s³.
    pub auto_jerk: f32,
    /// Downward acceleration limit of the automatic modes, m/s².
    pub auto_acceleration_down: f32,
    pub takeoff_speed: f32,
    /// Duration of the thrust's rise in a take-off, seconds.
    pub takeoff_ramp_s: f32,
    /// Height above home to which a take-off without an altitude climbs, metres.
    pub takeoff_height: f32,
    /// Least time from arming until the thrust rises, seconds.
    pub spool_up_s: f32,
    /// Time on the ground after which the land detector reports a landing, seconds.
    pub land_trigger_s: f32,
    pub offboard_loss_timeout_s: f32,
    /// What lost setpoints start: 4 lands, 5 holds, 6 and 7 disarm, others return.
    pub offboard_loss_action: i32,
    pub disarm_after_landing_s: f32,
    /// Time after which an armed vehicle that never took off disarms, seconds; 0: never.
    pub disarm_preflight_s: f32,
    /// Height above home to which a return climbs, metres.
    pub return_height: f32,
    /// Height above home to which a return descends before it lands, metres.
    pub return_descend_height: f32,
    /// Distance from home within which the cone `return_cone_tan` limits a return's climb, metres.
    pub return_min_distance: f32,
    /// Tangent of `RTL_CONE_ANG`: metres away from home for each metre of a return's height.
    pub return_cone_tan: f32,
    /// What a charge below `battery_critical_charge` starts: 2 lands, 3 returns, others nothing.
    pub low_battery_action: i32,
    /// Charge (0 to 1) below which `low_battery_action` starts.
    pub battery_critical_charge: f32,
    /// Charge (0 to 1) below which the vehicle cannot be armed.
    pub battery_low_charge: f32,
}

impl Px4Tuning {
    /// A demand without position, velocity or heading, with the speed limits of manual and Offboard
    /// flight.
    pub(super) fn default_demand(&self) -> Demand {
        Demand {
            position: NO_DEMAND,
            velocity: NO_DEMAND,
            acceleration: NO_DEMAND,
            heading: f32::NAN,
            heading_rate: f32::NAN,
            speed_max: self.speed_max,
            climb_max: self.climb_max,
            descend_max: self.descend_max,
            lift_off_acceleration: f32::NAN,
            // MPC_THR_MIN 0.12 divided by a hover thrust of 0.49.
            min_thrust_per_weight: 0.245,
            height_rate_weight: 0.0,
        }
    }

    /// Reads the values from the parameter table; to be called after each change of a parameter.
    pub fn new(params: &Params) -> Self {
        Self {
            gains: Gains {
                position: [params.f32_value("MPC_XY_P"), params.f32_value("MPC_Z_P")],
                velocity_p: [
                    params.f32_value("MPC_XY_VEL_P_ACC"),
                    params.f32_value("MPC_Z_VEL_P_ACC"),
                ],
                velocity_i: [
                    params.f32_value("MPC_XY_VEL_I_ACC"),
                    params.f32_value("MPC_Z_VEL_I_ACC"),
                ],
                velocity_d: [
                    params.f32_value("MPC_XY_VEL_D_ACC"),
                    params.f32_value("MPC_Z_VEL_D_ACC"),
                ],
                tilt_max_tan: libm::tanf(
                    params.f32_value("MPC_TILTMAX_AIR").clamp(1.0, 80.0).to_radians(),
                ),
                heading_rate_max: params.f32_value("MPC_YAWRAUTO_MAX").to_radians(),
            },
            speed_max: params.f32_value("MPC_XY_VEL_MAX"),
            climb_max: params.f32_value("MPC_Z_VEL_MAX_UP"),
            descend_max: params.f32_value("MPC_Z_VEL_MAX_DN"),
            cruise_speed: params.f32_value("MPC_XY_CRUISE"),
            auto_climb_max: params.f32_value("MPC_Z_V_AUTO_UP"),
            auto_descend_max: params.f32_value("MPC_Z_V_AUTO_DN"),
            land_speed: params.f32_value("MPC_LAND_SPEED"),
            land_slow_below: [params.f32_value("MPC_LAND_ALT1"), params.f32_value("MPC_LAND_ALT2")],
            land_crawl_speed: params.f32_value("MPC_LAND_CRWL"),
            land_crawl_below: params.f32_value("MPC_LAND_ALT3"),
            auto_jerk: params.f32_value("MPC_JERK_AUTO").max(0.5),
            auto_acceleration_down: params.f32_value("MPC_ACC_DOWN_MAX").max(0.5),
            takeoff_speed: params.f32_value("MPC_TKO_SPEED"),
            takeoff_ramp_s: params.f32_value("MPC_TKO_RAMP_T"),
            takeoff_height: params.f32_value("MIS_TAKEOFF_ALT"),
            spool_up_s: params.f32_value("COM_SPOOLUP_TIME"),
            land_trigger_s: params.f32_value("LNDMC_TRIG_TIME"),
            offboard_loss_timeout_s: params.f32_value("COM_OF_LOSS_T"),
            offboard_loss_action: params.i32_value("COM_OBL_RC_ACT"),
            disarm_after_landing_s: params.f32_value("COM_DISARM_LAND"),
            disarm_preflight_s: params.f32_value("COM_DISARM_PRFLT"),
            return_height: params.f32_value("RTL_RETURN_ALT"),
            return_descend_height: params.f32_value("RTL_DESCEND_ALT"),
            return_min_distance: params.f32_value("RTL_MIN_DIST"),
            return_cone_tan: libm::tanf(
                (params.i32_value("RTL_CONE_ANG").clamp(0, 90) as f32).to_radians(),
            ),
            low_battery_action: params.i32_value("COM_LOW_BAT_ACT"),
            battery_critical_charge: params.f32_value("BAT_CRIT_THR"),
            battery_low_charge: params.f32_value("BAT_LOW_THR"),
        }
    }
}

#[cfg(test)]
mod tests;
