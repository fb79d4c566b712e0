//! What guidance reads of the plan and of the autopilot in a step.

use planner_core::flight::VehiclePlan;

use crate::autopilot::telemetry::Telemetry;

/// Inputs of guidance beside its own state.
pub struct GuidanceInputs<'a, const W: usize, const G: usize> {
    /// The plan, if there is one with a path.
    pub plan: Option<&'a VehiclePlan<W, G>>,
    /// The autopilot.
    pub telemetry: &'a Telemetry,
    /// Rank in the roster.
    pub rank: u16,
    /// MAVLink system id.
    pub id: u8,
    /// Whether the path is one of its own around something.
    pub detours: bool,
}

impl<'a, const W: usize, const G: usize> GuidanceInputs<'a, W, G> {
    /// The scene of a vehicle of this rank and id; a plan without a path is none.
    pub fn new(
        plan: Option<&'a VehiclePlan<W, G>>,
        telemetry: &'a Telemetry,
        (rank, id): (u16, u8),
        detours: bool,
    ) -> Self {
        let plan = plan.filter(|plan| !plan.path.waypoints().is_empty());
        Self { plan, telemetry, rank, id, detours }
    }
}
