//! The inputs of decisions about detours, and the place that a vehicle reports to the others.

use planner_core::Point;

use crate::autopilot::telemetry::MAX_POSITION_AGE;
use crate::autopilot::telemetry::Telemetry;
use crate::config::Config;
use crate::guidance::{Guidance, GuidanceInputs};
use crate::margins::MAX_HEIGHT_ERROR_ON_GROUND_M;
use crate::mission::course::Mission;
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::Instant;

/// The inputs of decisions about detours: references to parts of the companion.
pub(crate) struct DetourView<'a, const V: usize, const W: usize, const G: usize> {
    /// Time of the step.
    pub(crate) now: Instant,
    pub(crate) config: &'a Config<V>,
    pub(crate) mission: &'a Mission<W, G>,
    pub(crate) guidance: &'a Guidance,
    pub(crate) telemetry: &'a Telemetry,
    pub(crate) neighbours: &'a Neighbours<V>,
    /// Inputs of guidance in this step.
    pub(crate) guidance_inputs: GuidanceInputs<'a, W, G>,
}

impl<const V: usize, const W: usize, const G: usize> DetourView<'_, V, W, G> {
    /// Estimated height above the ground that the plan gives ([`Guidance::planned_ground_m`]),
    /// metres; NaN while unknown.
    // Not inlined: in each caller it would take a board's flash.
    #[inline(never)]
    pub(crate) fn height_above_ground_m(&self) -> f32 {
        let known = self.telemetry.position_age(self.now) < MAX_POSITION_AGE
            && !self.telemetry.origin_moved;
        match self.mission.plan().filter(|_| known) {
            Some(plan) => self.telemetry.position.z - self.guidance.planned_ground_m(plan),
            None => f32::NAN,
        }
    }

    /// Whether the landing detector reports the ground, and the motors are off or the estimated
    /// height agrees.
    pub(crate) fn is_on_ground(&self) -> bool {
        self.telemetry.reports_ground(self.now)
            && (!self.telemetry.armed
                || self.height_above_ground_m() < MAX_HEIGHT_ERROR_ON_GROUND_M)
    }

    /// Whether a pilot flies the vehicle although its mission is over (`Done`): it is armed and not
    /// on the ground.
    pub(crate) fn is_piloted_after_mission(&self) -> bool {
        self.mission.state() == State::Done && self.telemetry.armed && !self.is_on_ground()
    }
}

/// Position and velocity that this vehicle reports to the others, ENU metres and m/s.
pub(crate) struct ReportedPlace {
    /// Position in the mission frame, ENU metres.
    pub(crate) position: Point,
    /// Velocity in the mission frame, ENU m/s.
    pub(crate) velocity: Point,
    /// When the position was measured; after a jump, when the state `PositionLost` was entered.
    pub(crate) measured_at: Instant,
}
