//! The setpoint of the moment.

use planner_core::{Length, Point};

use super::setpoint::Setpoint;
use super::{Guidance, GuidanceInputs};
use crate::autopilot::AutopilotKind;
use crate::mission::{State, task};

impl Guidance {
    /// The setpoint of this moment.
    pub fn setpoint<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> Setpoint {
        if !state.streams_setpoints() {
            return Setpoint::None;
        }
        let smoother = &self.smoother;
        let still = Point::zeros();
        if scene.telemetry.position_at.is_none() || state == State::PositionLost {
            return Setpoint::Stop(if smoother.has_setpoint() {
                smoother.velocity()
            } else {
                still
            });
        }
        if !smoother.has_setpoint() {
            // The state is newer than the step: the next one begins where the vehicle is.
            return Setpoint::None;
        }
        // Guided is not sent the acceleration: the velocity looks ahead instead, no faster than the
        // setpoint will be.
        let lead_s = scene.telemetry.kind.map_or(0.0, AutopilotKind::velocity_lead_s);
        let velocity = smoother.velocity() + smoother.acceleration() * lead_s;
        let most = smoother.velocity().length().max(smoother.raw_speed_mps());
        let velocity = velocity * (most / velocity.length().max(most).max(1e-6));
        let heading =
            scene.plan.and_then(|plan| task::heading(&plan.task, &plan.path, self.setpoint_m));
        Setpoint::Move(smoother.position(), velocity, self.sent_acceleration, heading)
    }
}
