//! The setpoint that is sent to the autopilot now.

use planner_core::{Length, Point};

use super::setpoint::Setpoint;
use super::{Guidance, GuidanceInputs};
use crate::autopilot::AutopilotKind;
use crate::mission::task;
use crate::state::State;

impl Guidance {
    /// The setpoint to be sent in this state: none, a stop where the position is unknown, or a
    /// place with velocity, acceleration and heading.
    pub fn setpoint_to_send<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> Setpoint {
        if !state.streams_setpoints() {
            return Setpoint::None;
        }
        let smoother = &self.smoother;
        let still = Point::zeros();
        let unknown = scene.telemetry.position_at.is_none() || state == State::PositionLost;
        if unknown || (!self.setpoint_has_position && state.needs_fresh_position()) {
            return Setpoint::Stop(if smoother.has_setpoint() {
                smoother.velocity()
            } else {
                still
            });
        }
        if !smoother.has_setpoint() {
            // The state was entered after the last step: the next step begins the setpoint at the
            // vehicle.
            return Setpoint::None;
        }
        // Setpoints to ArduCopter carry no acceleration (`MASK_POSITION_VELOCITY`). Instead their
        // velocity is that of the setpoint `lead_s` ahead, no faster than the setpoint or the raw
        // point, whichever is faster.
        let lead_s = scene.telemetry.kind.map_or(0.0, AutopilotKind::velocity_lead_s);
        let velocity = smoother.velocity() + smoother.acceleration() * lead_s;
        let most = smoother.velocity().length().max(smoother.raw_speed_mps());
        let velocity = velocity * (most / velocity.length().max(most).max(1e-6));
        let heading = scene
            .plan
            .and_then(|plan| task::heading(&plan.task, &plan.path, self.setpoint_along_m));
        Setpoint::Move(smoother.position(), velocity, self.sent_acceleration, heading)
    }

    /// Ends a step whose setpoint, if there is one, carries a place: the place is remembered as
    /// sent.
    pub(super) fn note_place_sent(&mut self) {
        if self.smoother.has_setpoint() {
            self.smoother.mark_sent();
            self.since_sent_s = 0.0;
        }
    }
}
