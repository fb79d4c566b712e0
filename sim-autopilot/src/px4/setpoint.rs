//! Offboard setpoints: reads SET_POSITION_TARGET_LOCAL_NED (84) and _GLOBAL_INT (86) as PX4 does
//! (`MavlinkReceiver::handle_message_set_position_target_*`).
//!
//! An axis that the type mask leaves out becomes NaN. A message without any demand, with the force
//! bit, or in a frame that PX4 does not support, is ignored without an error; if only such messages
//! come, the setpoint stream counts as lost after `COM_OF_LOSS_T`.

use nalgebra::Vector3;
use planner_core::geo::frames::Geodetic;

use crate::link::wire::PayloadReader;
use crate::physics::geodesy::LocalFrame;
use planner_core::Point;

// Values of MAV_FRAME, then bits of the type mask: a set bit leaves its field out, and the force
// bit makes the acceleration a force.
const FRAME_LOCAL_NED: u8 = 1;
const FRAME_BODY_NED: u8 = 8;
const FRAME_GLOBAL: u8 = 0;
const FRAME_GLOBAL_RELATIVE_ALT: u8 = 3;
const FRAME_GLOBAL_INT: u8 = 5;
const FRAME_GLOBAL_RELATIVE_ALT_INT: u8 = 6;
const MASK_FORCE: u16 = 0x200;
const MASK_YAW: u16 = 0x400;
const MASK_YAW_RATE: u16 = 0x800;
const MASK_ALL_AXES: u16 = 0x1ff;

/// A setpoint in the mission frame; NaN: no demand on that axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffboardSetpoint {
    /// Position, ENU metres.
    pub position: Point,
    /// Velocity, ENU m/s.
    pub velocity: Point,
    /// Acceleration, ENU m/s².
    pub acceleration: Point,
    /// Heading, radians clockwise from north.
    pub heading: f32,
    /// Rate of turn, rad/s clockwise.
    pub heading_rate: f32,
}

/// What is needed to convert a setpoint to the mission frame.
pub struct FrameContext<'a> {
    /// Conversion between the autopilot's local NED frame and the mission frame.
    pub frame: &'a LocalFrame,
    /// Heading of the vehicle, radians clockwise from north.
    pub heading: f32,
    /// Altitude of home above sea level, metres.
    pub home_alt_m: f64,
}

/// Reads the payload of SET_POSITION_TARGET_LOCAL_NED; `None` if PX4 would ignore it.
pub fn read_local_ned(
    fields: &PayloadReader<'_>,
    context: &FrameContext<'_>,
) -> Option<OffboardSetpoint> {
    let frame = fields.u8(52);
    if frame != FRAME_LOCAL_NED && frame != FRAME_BODY_NED {
        return None;
    }
    let mask = fields.u16(48);
    let mut position = read_masked_vector(fields, 4, mask);
    let mut velocity = read_masked_vector(fields, 16, mask >> 3);
    let mut acceleration = read_masked_vector(fields, 28, mask >> 6);
    if frame == FRAME_BODY_NED {
        // In the body frame PX4 rotates velocity and acceleration by the heading and ignores the
        // position.
        position = Vector3::repeat(f64::NAN);
        velocity = rotated_by_heading(velocity, context.heading);
        acceleration = rotated_by_heading(acceleration, context.heading);
    }
    let position = map_keeping_nan(position, |ned| context.frame.enu_from_ned(ned));
    setpoint_from_fields(fields, mask, position, velocity, acceleration, context)
}

/// Reads the payload of SET_POSITION_TARGET_GLOBAL_INT; `None` if PX4 would ignore it.
pub fn read_global_int(
    fields: &PayloadReader<'_>,
    context: &FrameContext<'_>,
) -> Option<OffboardSetpoint> {
    let base = match fields.u8(52) {
        FRAME_GLOBAL | FRAME_GLOBAL_INT => 0.0,
        FRAME_GLOBAL_RELATIVE_ALT | FRAME_GLOBAL_RELATIVE_ALT_INT => context.home_alt_m,
        _ => return None,
    };
    let mask = fields.u16(48);
    let given = |bit: u16| mask & bit == 0;
    let mut position = Vector3::repeat(f64::NAN);
    let asked = Geodetic {
        lat_deg: f64::from(fields.i32(4)) * 1e-7,
        lon_deg: f64::from(fields.i32(8)) * 1e-7,
        alt_m: f64::from(fields.f32(12)) + base,
    };
    let here = context.frame.ekf_origin();
    let whole = Geodetic {
        lat_deg: if given(1) { asked.lat_deg } else { here.lat_deg },
        lon_deg: if given(2) { asked.lon_deg } else { here.lon_deg },
        alt_m: if given(4) { asked.alt_m } else { here.alt_m },
    };
    if !whole.is_valid() {
        return None;
    }
    let enu = context.frame.enu_from_geodetic(&whole);
    if given(1) && given(2) {
        (position.x, position.y) = (enu.x, enu.y);
    }
    if given(4) {
        position.z = enu.z;
    }
    let velocity = read_masked_vector(fields, 16, mask >> 3);
    let acceleration = read_masked_vector(fields, 28, mask >> 6);
    setpoint_from_fields(fields, mask, position, velocity, acceleration, context)
}

/// Reads the vector at offset `at`; an axis whose bit of `mask` is set (bit 0: x) is NaN.
fn read_masked_vector(fields: &PayloadReader<'_>, at: usize, mask: u16) -> Vector3<f64> {
    let axis = |k: usize| {
        if mask >> k & 1 == 0 { f64::from(fields.f32(at + 4 * k)) } else { f64::NAN }
    };
    Vector3::new(axis(0), axis(1), axis(2))
}

/// Rotates a vector from forward, right, down to NED.
fn rotated_by_heading(v: Vector3<f64>, heading: f32) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(f64::from(heading));
    Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z)
}

/// Converts a NED vector to ENU by `map`. NaN stays NaN: east and north need both horizontal axes,
/// up needs only down.
fn map_keeping_nan(ned: Vector3<f64>, map: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Vector3<f64> {
    let across = ned.x.is_finite() && ned.y.is_finite();
    let mapped = map(&ned.map(|x| if x.is_finite() { x } else { 0.0 }));
    let nan = f64::NAN;
    Vector3::new(
        if across { mapped.x } else { nan },
        if across { mapped.y } else { nan },
        if ned.z.is_finite() { mapped.z } else { nan },
    )
}

/// The setpoint of a message: `position` is ENU already, velocity and acceleration are NED. `None`
/// if PX4 would ignore it.
fn setpoint_from_fields(
    fields: &PayloadReader<'_>,
    mask: u16,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
    context: &FrameContext<'_>,
) -> Option<OffboardSetpoint> {
    if mask & MASK_ALL_AXES == MASK_ALL_AXES || mask & MASK_FORCE != 0 {
        return None;
    }
    let velocity = map_keeping_nan(velocity, |ned| context.frame.enu_velocity_from_ned(ned));
    let acceleration =
        map_keeping_nan(acceleration, |ned| context.frame.enu_velocity_from_ned(ned));
    let any = |v: &Vector3<f64>| v.iter().any(|x| x.is_finite());
    if !any(&position) && !any(&velocity) && !any(&acceleration) {
        return None;
    }
    let optional = |bit: u16, at: usize| {
        let value = fields.f32(at);
        if mask & bit == 0 && value.is_finite() { value } else { f32::NAN }
    };
    Some(OffboardSetpoint {
        position: position.cast::<f32>(),
        velocity: velocity.cast::<f32>(),
        acceleration: acceleration.cast::<f32>(),
        heading: wrap_angle(optional(MASK_YAW, 40)),
        heading_rate: optional(MASK_YAW_RATE, 44),
    })
}

/// Wraps any finite angle to ±π; NaN stays NaN.
fn wrap_angle(angle: f32) -> f32 {
    angle - core::f32::consts::TAU * libm::roundf(angle / core::f32::consts::TAU)
}
