//! Guided setpoints: reads SET_POSITION_TARGET_LOCAL_NED (84) and _GLOBAL_INT (86) as ArduCopter
//! does (`GCS_MAVLINK_Copter::handle_message_set_position_target_*`).
//!
//! If the type mask leaves out one axis, the whole vector is left out. A message without any
//! demand, in an unsupported frame, with force, with position and acceleration but no velocity, or
//! with acceleration alone (which ArduCopter would fly, but this simulation does not) is not
//! refused: the vehicle stops.

use nalgebra::Vector3;
use planner_core::Point;
use planner_core::geo::frames::Geodetic;

use crate::link::wire::PayloadReader;
use crate::platform::Platform;

// Values of MAV_FRAME, then bits of the type mask: a set bit leaves its field out, and the force
// bit makes the acceleration a force.
const FRAME_LOCAL_NED: u8 = 1;
const FRAME_LOCAL_OFFSET_NED: u8 = 7;
const FRAME_BODY_NED: u8 = 8;
const FRAME_BODY_OFFSET_NED: u8 = 9;
const MASK_POSITION: u16 = 0x007;
const MASK_VELOCITY: u16 = 0x038;
const MASK_ACCELERATION: u16 = 0x1C0;
const MASK_FORCE: u16 = 0x200;
const MASK_YAW: u16 = 0x400;
const MASK_YAW_RATE: u16 = 0x800;

/// Goal of the reference, in the mission frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidedGoal {
    /// Position, ENU metres; `None`: only the velocity is flown.
    pub position: Option<Point>,
    /// Velocity, ENU m/s; feed-forward if there is a position.
    pub velocity: Point,
    /// Acceleration feed-forward, ENU m/s².
    pub acceleration: Point,
    /// Heading, radians clockwise from north; NaN keeps the current heading.
    pub heading: f32,
    /// Rate of turn, rad/s clockwise; NaN: none.
    pub heading_rate: f32,
    /// Whether velocity and acceleration become zero after `GUID_TIMEOUT`.
    pub expires: bool,
}

impl GuidedGoal {
    /// Stop and hold.
    pub const STOP: Self = Self {
        position: None,
        velocity: Point::new(0.0, 0.0, 0.0),
        acceleration: Point::new(0.0, 0.0, 0.0),
        heading: f32::NAN,
        heading_rate: f32::NAN,
        expires: false,
    };

    /// Fly to `position` and hold it for ever.
    pub fn hold(position: Point) -> Self {
        Self { position: Some(position), ..Self::STOP }
    }
}

/// Reads the payload of SET_POSITION_TARGET_LOCAL_NED.
pub fn read_local_ned(fields: &PayloadReader<'_>, platform: &Platform) -> GuidedGoal {
    let frame = fields.u8(52);
    let in_body = matches!(frame, FRAME_BODY_NED | FRAME_BODY_OFFSET_NED);
    if frame != FRAME_LOCAL_NED && frame != FRAME_LOCAL_OFFSET_NED && !in_body {
        return GuidedGoal::STOP;
    }
    let (sin, cos) = libm::sincos(f64::from(platform.vehicle.state().heading_rad));
    let turned = |v: Vector3<f64>| match in_body {
        true => Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z),
        false => v,
    };
    let mut ned = turned(read_vector(fields, 4));
    if frame != FRAME_LOCAL_NED {
        ned += platform.frame.ned_from_enu(&platform.sensors().position.cast::<f64>());
    }
    let position = platform.frame.enu_from_ned(&ned).cast::<f32>();
    let rate =
        |at| platform.frame.enu_velocity_from_ned(&turned(read_vector(fields, at))).cast::<f32>();
    goal_from_fields(fields, position, rate(16), rate(28))
}

/// Reads the payload of SET_POSITION_TARGET_GLOBAL_INT.
pub fn read_global_int(fields: &PayloadReader<'_>, platform: &Platform) -> GuidedGoal {
    let base = match fields.u8(52) {
        0 | 5 => 0.0,
        3 | 6 => platform.home.alt_m,
        _ => return GuidedGoal::STOP,
    };
    let asked = Geodetic {
        lat_deg: f64::from(fields.i32(4)) * 1e-7,
        lon_deg: f64::from(fields.i32(8)) * 1e-7,
        alt_m: f64::from(fields.f32(12)) + base,
    };
    if !asked.is_valid() {
        return GuidedGoal::STOP;
    }
    let rate = |at| platform.frame.enu_velocity_from_ned(&read_vector(fields, at)).cast::<f32>();
    goal_from_fields(
        fields,
        platform.frame.enu_from_geodetic(&asked).cast::<f32>(),
        rate(16),
        rate(28),
    )
}

fn read_vector(fields: &PayloadReader<'_>, at: usize) -> Vector3<f64> {
    Vector3::new(fields.f32(at), fields.f32(at + 4), fields.f32(at + 8)).cast::<f64>()
}

/// The goal of a setpoint message: of position, velocity and acceleration (ENU) those that its type
/// mask does not leave out.
fn goal_from_fields(
    fields: &PayloadReader<'_>,
    position: Point,
    velocity: Point,
    acceleration: Point,
) -> GuidedGoal {
    let mask = fields.u16(48);
    let given = |bits: u16| mask & bits == 0;
    let has = (given(MASK_POSITION), given(MASK_VELOCITY), given(MASK_ACCELERATION));
    let sound = |v: &Point| v.iter().all(|x| x.is_finite());
    let usable = (!has.0 || sound(&position))
        && (!has.1 || sound(&velocity))
        && (!has.2 || sound(&acceleration));
    if !usable || (mask & MASK_FORCE != 0 && has.2) {
        return GuidedGoal::STOP;
    }
    let optional = |bit: u16, at: usize| {
        let value = fields.f32(at);
        if given(bit) && value.is_finite() { value } else { f32::NAN }
    };
    let turn = core::f32::consts::TAU;
    let heading = optional(MASK_YAW, 40);
    let goal = GuidedGoal {
        heading: heading - turn * libm::roundf(heading / turn),
        heading_rate: optional(MASK_YAW_RATE, 44),
        ..GuidedGoal::STOP
    };
    let acceleration = if has.2 { acceleration } else { Point::zeros() };
    match has {
        (true, true, _) => {
            GuidedGoal { position: Some(position), velocity, acceleration, expires: true, ..goal }
        }
        (false, true, _) => GuidedGoal { velocity, acceleration, expires: true, ..goal },
        (true, false, false) => GuidedGoal { position: Some(position), ..goal },
        _ => GuidedGoal::STOP,
    }
}
