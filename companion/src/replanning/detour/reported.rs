//! The position that this vehicle reports to the others. After a jump of the autopilot's position
//! estimate it is the place on the path from before the jump, until the estimate is trusted again.

use planner_core::Point;

use super::Detours;
use crate::autopilot::telemetry::Telemetry;
use crate::replanning::view::{DetourView, ReportedPlace};
use crate::state::State;
use crate::time::{Duration, Instant};

/// Age of this vehicle's position above which the velocity reported with it is 0.
const VELOCITY_UNKNOWN_AFTER: Duration = Duration::from_secs(2);

impl Detours {
    /// Position and velocity that this vehicle reports to the others, and when they were measured;
    /// velocity 0 after a jump of the position, and with an old position.
    pub(crate) fn reported_place(&self, telemetry: &Telemetry, now: Instant) -> ReportedPlace {
        let t = telemetry;
        let vague = self.before_jump.is_some() || t.position_age(now) > VELOCITY_UNKNOWN_AFTER;
        let (position, at) =
            self.before_jump.unwrap_or((t.position, t.position_at.unwrap_or_default()));
        ReportedPlace { position, velocity: if vague { Point::zeros() } else { t.velocity }, at }
    }

    /// To be called on entering state `to`. `PositionLost` because of a jump: keeps the reference's
    /// place on the path as the one to report. `Follow` or `WaitPosition`: the position is trusted
    /// again.
    pub(crate) fn save_place_before_jump<const V: usize, const W: usize, const G: usize>(
        &mut self,
        to: State,
        view: &DetourView<'_, V, W, G>,
    ) {
        match to {
            State::PositionLost
                if self.before_jump.is_none() && view.telemetry.is_settling(view.now) =>
            {
                let path = view.mission.plan().map(|plan| &plan.path);
                let on_path = path.and_then(|path| path.point_at(view.guidance.along_m()));
                self.before_jump = Some((on_path.unwrap_or(view.telemetry.position), view.now));
            }
            to if to.trusts_position_again() => self.before_jump = None,
            _ => {}
        }
    }
}
