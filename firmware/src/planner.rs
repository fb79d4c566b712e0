//! The planner on board: [`planner::answer_plan_request`] on the files in flash, in the board's
//! memory. Files whose planning crashed the board in three starts in a row are refused.

use companion::planner::{self, PlanFiles, RequestedPlan};
use companion::{PlanFailure, PlanKind};
use planner_core::flight::VehiclePlan;

use crate::boards;
use crate::capacity::{BoardCompanion, GATES, VEHICLES, WAYPOINTS};
use crate::crash_record::FileWork;
use crate::workspace::WorkspaceOverlay;

/// Most keep-out zones of a detour. A vehicle that fell silent may make a dozen zones, any other
/// vehicle makes one or two. With more zones than these the request fails
/// ([`PlanFailure::Capacity`]): a detour that ignored some zones would not be safe.
const MAX_ZONES: usize = 4 * VEHICLES;

/// Memory that the planner works in; its three parts lie in different RAMs of the chip.
pub type PlanningMemory<'a> =
    planner::PlanningMemory<'a, WorkspaceOverlay, VEHICLES, WAYPOINTS, GATES, MAX_ZONES>;

/// This vehicle's plan, and the inputs that the companion gives for it.
pub type OwnPlanMemory = planner::OwnPlanMemory<VEHICLES, WAYPOINTS, GATES, MAX_ZONES>;

/// Makes one vehicle's plans from the files in flash.
pub struct Planner<'a> {
    /// Mission to plan, and the roadmap or height field that it needs.
    pub files: PlanFiles<'a>,
    /// System id of this vehicle.
    pub system_id: u8,
    /// Checksum of mission and roadmap (or height field), by which the crash record names them.
    pub files_checksum: u32,
    /// Memory that the planner works in.
    pub memory: PlanningMemory<'a>,
}

impl Planner<'_> {
    /// Copies what the companion knows for the requested plan; the result is for [`Self::answer`].
    pub fn read_inputs(
        &mut self,
        wanted: PlanKind,
        companion: &mut BoardCompanion,
    ) -> Option<RequestedPlan> {
        companion.read_plan_inputs(wanted, &mut self.memory.own.inputs)
    }

    /// Makes the requested plan; refuses files whose planning crashed three starts in a row.
    ///
    /// # Errors
    /// [`PlanFailure`]: the reason why there is no plan.
    pub fn answer(
        &mut self,
        requested: Option<&RequestedPlan>,
    ) -> Result<&VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
        let requested = requested.ok_or(PlanFailure::Unreachable)?;
        if !boards::begin_work(FileWork::Plan, self.files_checksum) {
            return Err(PlanFailure::Invalid);
        }
        let outcome = self.plan(requested);
        boards::finish_work();
        outcome
    }

    /// Not inlined, so that a debugger finds the symbol.
    #[inline(never)]
    fn plan(
        &mut self,
        requested: &RequestedPlan,
    ) -> Result<&VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
        planner::answer_plan_request(&self.files, self.system_id, requested, &mut self.memory)
    }
}
