//! What the autopilot is sent.

use planner_core::Point;

use super::{DAMP_PER_S, Guidance, HOLD_MOST_MPS2, HOLD_PER_S2, Scene};
use crate::autopilot::Kind;
use crate::autopilot::telemetry::Telemetry;
use crate::mission::State;

/// What the autopilot is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setpoint {
    /// Nothing: the state streams no setpoints.
    None,
    /// Be there, with this velocity and acceleration: ENU metres, m/s, m/s².
    Move(Point, Point, Point),
    /// Brake with this velocity, wherever that is: no position is known to refer to.
    Stop(Point),
}

/// Horizontal acceleration back to the reference, for an autopilot that adds it to what its own loops ask for. Upwards its
/// loops are stiff enough.
pub(super) fn correction(position: &Point, velocity: &Point, telemetry: &Telemetry) -> Point {
    let off = (position - telemetry.position) * HOLD_PER_S2 + (velocity - telemetry.velocity) * DAMP_PER_S;
    let across = libm::hypotf(off.x, off.y);
    // A reported velocity near the largest number overflows: nothing is corrected by it.
    if !across.is_finite() {
        return Point::zeros();
    }
    let share = if across > HOLD_MOST_MPS2 { HOLD_MOST_MPS2 / across } else { 1.0 };
    Point::new(off.x * share, off.y * share, 0.0)
}

impl Guidance {
    /// The setpoint of this moment.
    pub fn setpoint<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &Scene<'_, W, G>,
    ) -> Setpoint {
        if !state.streams_setpoints() {
            return Setpoint::None;
        }
        let door = &self.door;
        let still = Point::zeros();
        if scene.telemetry.position_at.is_none() || state == State::PositionLost {
            return Setpoint::Stop(if door.is_live() { door.velocity() } else { still });
        }
        if !door.is_live() {
            // The state is newer than the step: the next one begins where the vehicle is.
            return Setpoint::None;
        }
        // Guided is not sent the acceleration: the velocity looks ahead instead, no faster than the setpoint will be.
        let lead_s = scene.telemetry.kind.map_or(0.0, Kind::velocity_lead_s);
        let velocity = door.velocity() + door.acceleration() * lead_s;
        let most = door.velocity().norm().max(door.raw_speed_mps());
        let velocity = velocity * (most / velocity.norm().max(most).max(1e-6));
        Setpoint::Move(door.position(), velocity, self.sent_acceleration)
    }
}
