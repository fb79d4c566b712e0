//! A recorded flight.

use nalgebra::Vector3;
use planner_core::frames::Geodetic;
use sim_autopilot::AutopilotKind;

/// One recorded row that says where something was or shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds.
    pub t_s: f64,
    /// NED about the EKF origin, metres.
    pub position: Vector3<f64>,
    /// NED, m/s.
    pub velocity: Vector3<f64>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Setpoint {
    pub(super) t_s: f64,
    pub(super) mask: u16,
    pub(super) position: [f32; 3],
    pub(super) velocity: [f32; 3],
    pub(super) acceleration: [f32; 3],
    pub(super) yaw: f32,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Message {
    /// System, component, command and its parameters.
    Command(u8, u8, u16, [f32; 7]),
    /// GUID_TIMEOUT.
    GuidedTimeout(f32),
}

/// One vehicle's recorded flight.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of the run.
    pub run: String,
    /// System id.
    pub vehicle: u8,
    /// What flew it.
    pub autopilot: AutopilotKind,
    /// Its EKF origin.
    pub origin: Geodetic,
    /// What it believed.
    pub estimate: Vec<Sample>,
    /// Where it was.
    pub truth: Vec<Sample>,
    /// First arming that held, and disarming, seconds.
    pub armed_s: (f64, f64),
    /// From where the mission followed its path, and from where it landed, seconds.
    pub follow_s: (f64, f64),
    pub(super) setpoints: Vec<Setpoint>,
    pub(super) messages: Vec<(f64, Message)>,
}
