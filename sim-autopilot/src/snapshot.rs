//! Everything that telemetry is made of, at one instant.

use core::cell::OnceCell;

use nalgebra::Vector3;
use planner_core::frames::Geodetic;

use super::status::FirmwareStatus;
use crate::AutopilotKind;

/// Everything telemetry is made of, at one instant.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Microseconds since boot.
    pub time_us: u64,
    /// Microseconds of UTC.
    pub unix_us: u64,
    /// System id.
    pub system_id: u8,
    /// The firmware's state.
    pub status: FirmwareStatus,
    /// Armed.
    pub armed: bool,
    /// The item of the mission under way, and how many there are.
    pub mission: (u16, u16),
    /// Pictures taken since boot.
    pub pictures: u32,
    /// Estimated NED about the EKF origin, metres.
    pub ned: Vector3<f64>,
    /// Estimated NED velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Estimated position.
    pub geodetic: Geodetic,
    /// GPS receiver: position error north and east in metres beyond the estimate's, and whether it
    /// has a fix.
    pub gps: (f32, f32, bool),
    /// Home, and in NED about the EKF origin.
    pub home: (Geodetic, Vector3<f64>),
    /// EKF origin.
    pub ekf_origin: Geodetic,
    /// Thrust over mass, NED, m/s²; points up.
    pub specific_force: Vector3<f32>,
    /// Heading and its change, radians.
    pub heading: (f32, f32),
    /// Position, velocity and acceleration the controller flies, NED.
    pub target: [Vector3<f64>; 3],
    /// Height over ground, metres.
    pub height: f32,
    /// Accuracy that the estimator reports, across and in height, metres.
    pub accuracy: [f32; 2],
    /// Charge left, 0 to 1.
    pub battery: f32,
    /// Filled by the first message that needs it.
    pub attitude: OnceCell<Attitude>,
}

/// Attitude as angles and as a quaternion (w, x, y, z), NED to body.
#[derive(Clone, Copy, Debug)]
pub struct Attitude {
    /// Roll, pitch, yaw, radians.
    pub euler: [f32; 3],
    /// Rotation from the body to NED.
    pub quaternion: [f32; 4],
}

/// The attitude whose thrust axis lies along a specific force (NED, pointing up) at a heading.
pub fn attitude_from_force(force: &Vector3<f32>, heading: f32) -> Attitude {
    let norm = force.norm().max(0.1);
    let (sin, cos) = libm::sincosf(heading);
    // The body's z axis, down, in a frame turned by the heading: (cos φ sin θ, −sin φ, cos φ cos
    // θ).
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
    pub(super) fn attitude(&self) -> &Attitude {
        self.attitude.get_or_init(|| attitude_from_force(&self.specific_force, self.heading.0))
    }

    pub(super) fn is_px4(&self) -> bool {
        self.status.autopilot == AutopilotKind::Px4
    }

    pub(super) fn boot_ms(&self) -> u32 {
        (self.time_us / 1000) as u32
    }

    pub(super) fn battery_volts(&self) -> f32 {
        // Four cells between BAT1_V_EMPTY and BAT1_V_CHARGED.
        4.0 * (3.6 + 0.45 * self.battery)
    }

    pub(super) fn heading_deg(&self) -> f32 {
        let degrees = self.heading.0.to_degrees();
        if degrees < 0.0 { degrees + 360.0 } else { degrees }
    }
}
