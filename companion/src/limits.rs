//! What a vehicle can fly: the mission's limits, and the autopilot's where it has lower ones.
//!
//! The autopilot's own limits are parameters, read on connecting. A value that did not come, or that no vehicle has, counts
//! as the default of its kind. Source: PX4 1.17 `mc_pos_control` parameters, ArduCopter 4.6 `WPNAV_*` and `PSC_*`.

use libm::fminf;

use crate::autopilot::Kind;
use crate::config::Config;
use crate::guidance::SMOOTH_MOST_S;

/// Greatest jerk of a setpoint, m/s³; autopilots with a lower limit get that.
pub const JERK_MPS3: f32 = 4.0;
/// The same while the safety filter stops a vehicle, m/s³.
pub const URGENT_JERK_MPS3: f32 = 8.0;

/// Up and down no vehicle is accelerated more than ArduCopter manages by default, m/s²: 1.03 m wide of a corner with 1.5.
const VERTICAL_MPS2: f32 = 1.0;

/// What the autopilot's parameters allow. Names as in [`Limits`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutopilotLimits {
    pub speed_mps: f32,
    pub climb_mps: f32,
    pub descend_mps: f32,
    pub accel_mps2: f32,
    pub accel_z_mps2: f32,
    pub jerk_mps3: f32,
}

impl AutopilotLimits {
    /// The defaults of a kind.
    pub fn default_of(kind: Kind) -> Self {
        match kind {
            Kind::Px4 => Self {
                speed_mps: 12.0,
                climb_mps: 3.0,
                descend_mps: 1.5,
                accel_mps2: 3.0,
                accel_z_mps2: 3.0,
                jerk_mps3: 4.0,
            },
            Kind::ArduPilot => Self {
                speed_mps: 10.0,
                climb_mps: 2.5,
                descend_mps: 1.5,
                accel_mps2: 2.5,
                accel_z_mps2: 1.0,
                jerk_mps3: 5.0,
            },
        }
    }
}

/// Limits of one vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Along the path, m/s.
    pub speed_mps: f32,
    /// Upwards, m/s.
    pub climb_mps: f32,
    /// Downwards, m/s.
    pub descend_mps: f32,
    /// Across, m/s².
    pub accel_mps2: f32,
    /// Upwards and downwards, m/s².
    pub accel_z_mps2: f32,
    /// Of a setpoint, m/s³.
    pub jerk_mps3: f32,
}

impl Limits {
    /// The mission's limits, lowered to what the autopilot flies.
    pub fn new<const V: usize>(config: &Config<V>, autopilot: &AutopilotLimits) -> Self {
        let a = autopilot;
        let jerk_mps3 = fminf(JERK_MPS3, a.jerk_mps3);
        // What the door's longest average smooths to that jerk.
        let smooth_mps2 = 0.5 * jerk_mps3 * SMOOTH_MOST_S;
        Self {
            speed_mps: fminf(config.cruise_mps, a.speed_mps),
            climb_mps: fminf(config.climb_mps, a.climb_mps),
            descend_mps: fminf(config.climb_mps, a.descend_mps),
            accel_mps2: fminf(fminf(config.accel_mps2, a.accel_mps2), smooth_mps2),
            accel_z_mps2: fminf(fminf(config.accel_mps2, VERTICAL_MPS2), fminf(a.accel_z_mps2, smooth_mps2)),
            jerk_mps3,
        }
    }

    /// Greatest jerk, m/s³.
    pub fn jerk(&self, urgent: bool) -> f32 {
        if urgent { fminf(URGENT_JERK_MPS3, 2.0 * self.jerk_mps3) } else { self.jerk_mps3 }
    }

    /// No setpoint moves faster, m/s.
    pub fn fastest_mps(&self) -> f32 {
        libm::fmaxf(self.speed_mps, libm::fmaxf(self.climb_mps, self.descend_mps))
    }
}
