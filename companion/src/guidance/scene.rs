//! What guidance reads of the plan, the autopilot and the roster in a step.

use planner_core::flight::VehiclePlan;

use crate::autopilot::telemetry::{MAX_POSITION_AGE, Telemetry};
use crate::state::State;
use crate::time::Instant;

/// Inputs of guidance in a step, other than its own state.
pub struct GuidanceInputs<'a, const W: usize, const G: usize> {
    /// The path that the vehicle flies, with its gates; `None` without a path.
    pub plan: Option<&'a VehiclePlan<W, G>>,
    /// Telemetry of the vehicle's autopilot.
    pub telemetry: &'a Telemetry,
    /// Index of the vehicle in the roster sorted by id, from 0, for Algorithm 2 of paper P3D.
    pub rank: u16,
    /// MAVLink system id of the vehicle.
    pub id: u8,
    /// Where that path comes from.
    pub path_source: PathSource,
}

/// Where the path that a vehicle flies comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathSource {
    /// From the plan that all vehicles share.
    SharedPlan,
    /// It is a detour of this vehicle alone.
    Detour,
}

impl<'a, const W: usize, const G: usize> GuidanceInputs<'a, W, G> {
    /// Inputs of the vehicle of this rank and id; a plan whose path is empty counts as none.
    pub fn new(
        plan: Option<&'a VehiclePlan<W, G>>,
        telemetry: &'a Telemetry,
        (rank, id): (u16, u8),
        path_source: PathSource,
    ) -> Self {
        let plan = plan.filter(|plan| !plan.path.waypoints().is_empty());
        Self { plan, telemetry, rank, id, path_source }
    }

    /// Whether the vehicle's position is known: once known it counts as such, but in states in
    /// which somebody else may fly the vehicle only while it is new.
    pub(crate) fn is_position_usable(&self, state: State, now: Instant) -> bool {
        match state.needs_fresh_position() {
            true => self.telemetry.position_age(now) < MAX_POSITION_AGE,
            false => self.telemetry.position_at.is_some(),
        }
    }

    /// Whether the path is a detour, not that of the shared plan.
    pub(crate) fn is_on_detour(&self) -> bool {
        self.path_source == PathSource::Detour
    }
}
