//! The state from which all telemetry messages of one step are made.

use core::cell::OnceCell;

use nalgebra::Vector3;
use planner_core::geo::frames::Geodetic;

use crate::SimulatedKind;
use crate::status::AutopilotStatus;

/// The state of one step from which telemetry messages are made.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Time since boot, microseconds.
    pub time_us: u64,
    /// UTC, microseconds since 1970.
    pub unix_us: u64,
    /// MAVLink system id.
    pub system_id: u8,
    /// State of the autopilot's mode logic.
    pub status: AutopilotStatus,
    /// Whether the motors are armed.
    pub armed: bool,
    /// Mission: number of the current item (the first is 0), and how many items are stored.
    pub mission_item_and_count: (u16, u16),
    /// Number of pictures since boot.
    pub pictures: u32,
    /// Estimated position, NED about the EKF origin, metres.
    pub ned: Vector3<f64>,
    /// Estimated velocity, NED m/s.
    pub velocity: Vector3<f64>,
    /// Estimated latitude, longitude and altitude above mean sea level.
    pub geodetic: Geodetic,
    /// GPS receiver: position error north and east beyond the estimate's (metres), and whether it
    /// has a fix.
    pub gps_error_and_fix: (f32, f32, bool),
    /// Home as latitude, longitude and altitude, and as NED about the EKF origin (metres).
    pub home: (Geodetic, Vector3<f64>),
    /// EKF origin.
    pub ekf_origin: Geodetic,
    /// Acceleration by thrust alone, NED m/s²: in a hover (0, 0, −9.8).
    pub specific_force: Vector3<f32>,
    /// Heading (radians clockwise from north) and rate of turn (rad/s).
    pub heading_and_rate: (f32, f32),
    /// Position, velocity and acceleration setpoints of the controller, NED; while disarmed NaN,
    /// and 100 m/s² down.
    pub target: [Vector3<f64>; 3],
    /// Height of the body above where it would rest on the ground, metres.
    pub height_above_ground: f32,
    /// Horizontal and vertical accuracy that the estimator reports, metres.
    pub accuracy: [f32; 2],
    /// Remaining battery charge, 0 to 1.
    pub battery: f32,
    /// Attitude of the body, computed when the first message needs it.
    pub attitude: OnceCell<Attitude>,
}

/// Attitude as Euler angles and as a quaternion (w, x, y, z).
#[derive(Clone, Copy, Debug)]
pub struct Attitude {
    /// Roll, pitch, yaw, radians.
    pub euler: [f32; 3],
    /// Rotation from the body to NED.
    pub quaternion: [f32; 4],
}

/// The attitude at this heading whose thrust axis points along `force` (specific force, NED,
/// upward).
pub fn attitude_from_specific_force(force: &Vector3<f32>, heading: f32) -> Attitude {
    let norm = force.norm().max(0.1);
    let (sin, cos) = libm::sincosf(heading);
    // The body's downward axis in a level frame turned by the heading: (cos φ sin θ, −sin φ, cos φ
    // cos θ).
    let (ahead, right) = (cos * force.x + sin * force.y, cos * force.y - sin * force.x);
    let axis = [-ahead / norm, -right / norm, -force.z / norm];
    let roll = libm::asinf((-axis[1]).clamp(-1.0, 1.0));
    let pitch = libm::atan2f(axis[0], axis[2]);
    let (sr, cr) = libm::sincosf(0.5 * roll);
    let (sp, cp) = libm::sincosf(0.5 * pitch);
    let (sy, cy) = libm::sincosf(0.5 * heading);
    let quaternion = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ];
    Attitude { euler: [roll, pitch, heading], quaternion }
}

impl Snapshot {
    /// The attitude, computed at the first call.
    pub(crate) fn attitude(&self) -> &Attitude {
        self.attitude.get_or_init(|| {
            attitude_from_specific_force(&self.specific_force, self.heading_and_rate.0)
        })
    }

    pub(crate) fn is_px4(&self) -> bool {
        self.status.autopilot == SimulatedKind::Px4
    }

    /// Time since boot, milliseconds.
    pub(crate) fn boot_ms(&self) -> u32 {
        (self.time_us / 1000) as u32
    }

    /// Voltage of the battery.
    pub(crate) fn battery_volts(&self) -> f32 {
        // Four cells, each from BAT1_V_EMPTY (3.6 V) to BAT1_V_CHARGED (4.05 V).
        4.0 * (3.6 + 0.45 * self.battery)
    }

    /// Heading, degrees from 0 to 360.
    pub(crate) fn heading_deg(&self) -> f32 {
        let degrees = self.heading_and_rate.0.to_degrees();
        if degrees < 0.0 { degrees + 360.0 } else { degrees }
    }
}
