//! The data of a recorded flight.

use nalgebra::Vector3;
use planner_core::geo::frames::Geodetic;
use sim_autopilot::SimulatedKind;

/// Position and velocity of a vehicle at one time, estimated or true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time, seconds of the wall clock.
    pub t_s: f64,
    /// Position in NED from the EKF origin, metres.
    pub position: Vector3<f64>,
    /// Velocity, NED m/s.
    pub velocity: Vector3<f64>,
}

/// A setpoint that the recorded companion sent: NED from the EKF origin, metres and seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setpoint {
    /// Time at which it was sent, seconds.
    pub(super) t_s: f64,
    /// `type_mask`: which numbers do not count.
    pub(super) mask: u16,
    pub(super) position: [f32; 3],
    pub(super) velocity: [f32; 3],
    pub(super) acceleration: [f32; 3],
    /// Heading, radians clockwise from north.
    pub(super) yaw: f32,
}

/// A recorded message to the autopilot that a replay sends again.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Message {
    /// COMMAND_LONG: sender's system and component, command number, and its parameters.
    Command(u8, u8, u16, [f32; 7]),
    /// PARAM_SET of GUID_TIMEOUT, seconds.
    GuidedTimeout(f32),
}

/// The recorded flight of one vehicle.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of the run.
    pub run: String,
    /// MAVLink system id.
    pub vehicle: u8,
    /// Which autopilot flew the vehicle.
    pub autopilot: SimulatedKind,
    /// EKF origin of the autopilot.
    pub ekf_origin: Geodetic,
    /// Positions and velocities that the autopilot estimated.
    pub estimate: Vec<Sample>,
    /// True positions and velocities.
    pub truth: Vec<Sample>,
    /// When the vehicle armed for its flight, and when it disarmed, seconds.
    pub armed_span_s: (f64, f64),
    /// When the mission began to follow its path, and when it began to land, seconds.
    pub follow_span_s: (f64, f64),
    /// The setpoints, in order of time.
    pub(super) setpoints: Vec<Setpoint>,
    /// Each with the time at which it was sent, seconds.
    pub(super) messages: Vec<(f64, Message)>,
}
