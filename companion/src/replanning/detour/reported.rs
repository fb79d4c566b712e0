//! What this vehicle reports of itself: whether it is out of the plan, and its position. After a
//! jump of the autopilot's position estimate it is the place on the path from before the jump,
//! until the estimate is trusted again.

use planner_core::Point;

use super::Detours;
use crate::autopilot::telemetry::Telemetry;
use crate::margins::PILOTED_OUT_OF_PLAN_AFTER;
use crate::replanning::view::{DetourView, ReportedPlace};
use crate::state::State;
use crate::time::{Duration, Instant};

/// Age of this vehicle's position above which the velocity reported with it is 0.
const VELOCITY_UNKNOWN_AFTER: Duration = Duration::from_secs(2);

/// Time in `Aborted` after which a vehicle that reports no landing is out of the plan.
const OUT_OF_PLAN_AFTER_ABORT: Duration = Duration::from_secs(5);

impl Detours {
    /// Position and velocity that this vehicle reports to the others, and when they were measured;
    /// velocity 0 after a jump of the position, and with an old position.
    pub(crate) fn reported_place(&self, telemetry: &Telemetry, now: Instant) -> ReportedPlace {
        let t = telemetry;
        let vague =
            self.place_before_jump.is_some() || t.position_age(now) > VELOCITY_UNKNOWN_AFTER;
        let (position, measured_at) =
            self.place_before_jump.unwrap_or((t.position, t.position_at.unwrap_or_default()));
        ReportedPlace {
            position,
            velocity: if vague { Point::zeros() } else { t.velocity },
            measured_at,
        }
    }

    /// To be called on entering state `to`. `PositionLost` because of a jump: keeps the reference's
    /// place on the path as the place to report. `Follow` or `WaitPosition`, where the position is
    /// trusted again: forgets that place. Other states change nothing.
    pub(crate) fn update_place_before_jump<const V: usize, const W: usize, const G: usize>(
        &mut self,
        to: State,
        view: &DetourView<'_, V, W, G>,
    ) {
        match to {
            State::PositionLost
                if self.place_before_jump.is_none()
                    && view.telemetry.is_position_settling(view.now) =>
            {
                let path = view.mission.plan().map(|plan| &plan.path);
                let on_path =
                    path.and_then(|path| path.point_at(view.guidance.reference_along_m()));
                self.place_before_jump =
                    Some((on_path.unwrap_or(view.telemetry.position), view.now));
            }
            to if to.trusts_position_again() => self.place_before_jump = None,
            _ => {}
        }
    }

    /// Whether this vehicle is out of the plan: done away from its goal or after leaving the plan,
    /// aborted, or flown by its pilot for [`PILOTED_OUT_OF_PLAN_AFTER`].
    pub(crate) fn is_own_vehicle_out_of_plan<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let lasted = view.mission.time_in_state(view.now);
        match view.mission.state() {
            State::Done => {
                !view.guidance.is_reference_at_goal(&view.guidance_inputs)
                    || self.left_plan
                    || view.is_piloted_after_mission()
            }
            State::Aborted => view.is_on_ground() || lasted >= OUT_OF_PLAN_AFTER_ABORT,
            state if state.is_left_to_pilot() => {
                view.mission.time_since_pilot_takeover(view.now) >= PILOTED_OUT_OF_PLAN_AFTER
            }
            _ => false,
        }
    }
}
