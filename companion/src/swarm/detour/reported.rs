//! The place that the vehicle reports: that of before its position jumped, while it may be wrong.

use planner_core::Point;

use super::Detours;
use crate::autopilot::telemetry::Telemetry;
use crate::mission::State;
use crate::swarm::view::{DetourView, ReportedPlace};
use crate::time::{Duration, Instant};

/// Age of this vehicle's position from which it reports no velocity with it.
const MAX_POSITION_AGE: Duration = Duration::from_secs(2);

impl Detours {
    /// Position and velocity that this vehicle reports to the others, and when they were measured.
    pub(crate) fn reported_place(&self, telemetry: &Telemetry, now: Instant) -> ReportedPlace {
        let t = telemetry;
        let vague = self.before_jump.is_some() || t.position_age(now) > MAX_POSITION_AGE;
        let (position, at) =
            self.before_jump.unwrap_or((t.position, t.position_at.unwrap_or_default()));
        ReportedPlace { position, velocity: if vague { Point::zeros() } else { t.velocity }, at }
    }

    /// On entering the state `to`, remembers the place from before a jump of the position, which
    /// may be wrong since; or forgets it.
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
            State::Follow | State::WaitPosition => self.before_jump = None,
            _ => {}
        }
    }
}
