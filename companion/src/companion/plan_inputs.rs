//! What the companion knows for the plan that it has requested.

use super::Companion;
use crate::events::PlanKind;
use crate::planner::{PlanInputs, RequestedPlan};

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Copies what [`crate::planner::answer_plan_request`] needs for the requested plan to `into`:
    /// photographed waypoints, the inputs of the divisions for a division, keep-out zones for a
    /// detour. Returns the plan to make; `None` if the companion no longer wants a detour, or none
    /// can be planned: then the shell is to answer [`crate::PlanFailure::Unreachable`].
    pub fn read_plan_inputs<const Z: usize>(
        &mut self,
        wanted: PlanKind,
        into: &mut PlanInputs<V, Z>,
    ) -> Option<RequestedPlan> {
        into.clear();
        into.add_photographed(self.excluded_waypoints());
        match wanted {
            PlanKind::Mission => Some(RequestedPlan::Flight),
            PlanKind::Division => {
                self.division_inputs().for_each(|inputs| into.add_division(inputs));
                Some(RequestedPlan::Flight)
            }
            PlanKind::Detour => {
                self.detour_request(|zone| into.add_zone(zone)).map(RequestedPlan::Detour)
            }
        }
    }
}
