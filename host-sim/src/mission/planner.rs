//! The planner on the host: answers the companions' requests for plans as a board does, with more
//! memory.

use companion::planner::{
    self, AreaWorkspace, LendWorkspace, OwnPlanMemory, PlanFiles, PlanningMemory,
};
use companion::{PlanFailure, PlanKind};
use planner_core::map::field::FieldView;
use planner_core::plan::PlanWorkspace;
use planner_core::roadmap::RoadmapView;

use super::ready::{HostPlan, OwnPlan, PreparedMission};
use crate::area::MAX_VERTICES;
use crate::capacity::{
    HostCompanion, MAX_GATES, MAX_ROADMAP_NODES, MAX_TIMED_SEGMENTS, MAX_VEHICLES, MAX_WAYPOINTS,
    MAX_ZONES, on_heap,
};
use crate::coverage::{MAX_AREA_VEHICLES, MAX_LANES, MAX_NO_FLY_CORNERS};

/// Workspace for planning a swarm on a roadmap.
pub(super) type GoalsWorkspace = PlanWorkspace<MAX_ROADMAP_NODES, MAX_VEHICLES, MAX_TIMED_SEGMENTS>;
/// Workspace for planning a coverage mission.
pub(super) type HostAreaWorkspace =
    AreaWorkspace<MAX_VERTICES, MAX_LANES, MAX_AREA_VEHICLES, MAX_NO_FLY_CORNERS>;

/// The workspaces that were needed so far.
#[derive(Default)]
struct HostWorkspaces {
    /// Memory of missions with goals; `None` until it is needed.
    goals: Option<Box<GoalsWorkspace>>,
    /// Memory of missions with an area; `None` until it is needed.
    area: Option<Box<HostAreaWorkspace>>,
}

impl
    LendWorkspace<
        MAX_ROADMAP_NODES,
        MAX_VEHICLES,
        MAX_TIMED_SEGMENTS,
        MAX_VERTICES,
        MAX_LANES,
        MAX_AREA_VEHICLES,
        MAX_NO_FLY_CORNERS,
    > for HostWorkspaces
{
    /// The memory of missions with goals, made at the first call.
    fn for_goals(&mut self) -> &mut GoalsWorkspace {
        self.goals.get_or_insert_with(|| on_heap(GoalsWorkspace::new))
    }

    /// The memory of missions with an area, made at the first call.
    fn for_area(&mut self) -> &mut HostAreaWorkspace {
        self.area.get_or_insert_with(|| on_heap(HostAreaWorkspace::new))
    }
}

/// Makes the plans that the companions of a mission request, one after the other in the same
/// memory.
pub struct HostPlanner<'a> {
    mission: &'a PreparedMission,
    /// Plan of the whole mission, which is the same for all companions.
    initial_plan: &'a HostPlan,
    /// The files from which a board would plan.
    files: PlanFiles<'a>,
    workspaces: HostWorkspaces,
    /// Memory for the swarm's plan while a request is answered.
    swarm_plan: Box<HostPlan>,
    /// Memory for the requesting vehicle's inputs and plan.
    own: Box<OwnPlanMemory<MAX_VEHICLES, MAX_WAYPOINTS, MAX_GATES, MAX_ZONES>>,
}

impl<'a> HostPlanner<'a> {
    /// A planner for a mission whose plan before the first take-off is `plan`.
    pub fn new(mission: &'a PreparedMission, plan: &'a HostPlan) -> Self {
        // The file is a roadmap, or a field over terrain, or empty over level ground.
        let file = &mission.roadmap_or_field_file;
        let files = PlanFiles {
            mission: Some(mission.mission_view()),
            roadmap: RoadmapView::parse(file).ok(),
            field: FieldView::parse(file).ok(),
        };
        let (swarm_plan, own) = (on_heap(HostPlan::new), on_heap(OwnPlanMemory::new));
        Self {
            mission,
            initial_plan: plan,
            files,
            workspaces: HostWorkspaces::default(),
            swarm_plan,
            own,
        }
    }

    /// Makes the plan of kind `wanted` that the companion of vehicle `index` requests.
    ///
    /// # Errors
    /// [`PlanFailure`]: the reason why there is no plan.
    pub fn answer(
        &mut self,
        index: usize,
        wanted: PlanKind,
        companion: &mut HostCompanion,
    ) -> Result<&OwnPlan, PlanFailure> {
        let requested = companion.read_plan_inputs(wanted, &mut self.own.inputs);
        let requested = requested.ok_or(PlanFailure::Unreachable)?;
        if wanted == PlanKind::Mission && companion.excluded_waypoints().is_empty() {
            // A board computes this plan; here it is computed once for all vehicles.
            self.own.plan = *self.mission.own_plan(self.initial_plan, index)?;
            return Ok(&self.own.plan);
        }
        let memory = PlanningMemory::new(&mut self.workspaces, &mut self.swarm_plan, &mut self.own);
        let mut memory = PlanningMemory { max_gates: self.mission.max_gates(), ..memory };
        let system_id = self.mission.tasks[index].id;
        planner::answer_plan_request(&self.files, system_id, &requested, &mut memory)?;
        Ok(&self.own.plan)
    }
}
