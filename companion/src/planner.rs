//! Answers a companion's request for a plan from the mission file and the roadmap or height field,
//! by the same code on the host and on a board; the host lends it more memory.
//!
//! Every companion plans the whole swarm from the same files, so all get the same plan; they
//! compare its CRC to be sure.

pub mod coverage;
mod memory;

use heapless::Vec;
use planner_core::detour::{self, DetourRequest};
use planner_core::flight::VehiclePlan;
use planner_core::map::field::FieldView;
use planner_core::plan::{self, PlanError, PlanWorkspace, SwarmPlan};
use planner_core::roadmap::RoadmapView;
use planner_core::roadmap::search::SearchError;
use planner_core::schedule::{ScheduleConfig, ScheduleError, ScheduleWorkspace};

pub use self::memory::{
    AreaWorkspace, LendWorkspace, OwnPlanMemory, PlanFiles, PlanInputs, PlanningMemory,
    RequestedPlan,
};
use crate::config::PlanFailure;
use crate::storage::mission_file::coverage::CoverageView;
use crate::storage::mission_file::{MissionKind, MissionView};
use crate::swarm::fleet::DivisionInputs;

/// A step of the planning of a mission with goals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanStep {
    /// Shortest paths from all starts to all goals.
    Search,
    /// The goal of each vehicle.
    Assignment,
    /// Departure times and the order at shared places.
    Schedule,
}

/// Makes the plan that the companion of vehicle `system_id` has requested, with what it knows for
/// this plan in `memory.own.inputs`: its part of the swarm's plan, or the detour that `requested`
/// holds.
///
/// # Errors
/// [`PlanFailure`]: the reason why there is no plan.
pub fn answer_plan_request<
    'm,
    M,
    const N: usize,
    const V: usize,
    const P: usize,
    const X: usize,
    const L: usize,
    const K: usize,
    const C: usize,
    const W: usize,
    const G: usize,
    const Z: usize,
>(
    files: &PlanFiles<'_>,
    system_id: u8,
    requested: &RequestedPlan,
    memory: &'m mut PlanningMemory<'_, M, V, W, G, Z>,
) -> Result<&'m VehiclePlan<W, G>, PlanFailure>
where
    M: LendWorkspace<N, V, P, X, L, K, C>,
{
    let mission = files.mission.as_ref().ok_or(PlanFailure::RoadmapUnusable)?;
    let index = mission.index_of(system_id).ok_or(PlanFailure::Invalid)?;
    let PlanningMemory { workspaces, swarm, own, max_gates } = memory;
    match (mission.kind(), requested) {
        (MissionKind::Goals, RequestedPlan::Flight) => {
            let roadmap = files.roadmap.as_ref().ok_or(PlanFailure::RoadmapUnusable)?;
            let ws = workspaces.for_goals();
            plan_goal_mission(mission, roadmap, *max_gates, ws, swarm, |_| {})?;
            take_own_plan(
                swarm,
                index,
                &mission.header().schedule,
                &mut ws.schedule,
                &mut own.plan,
            )?;
        }
        (MissionKind::Goals, RequestedPlan::Detour(request)) => {
            let roadmap = files.roadmap.as_ref().ok_or(PlanFailure::RoadmapUnusable)?;
            let ws = &mut workspaces.for_goals().search;
            let zones = own.inputs.zones()?;
            detour::plan_detour_for_vehicle(
                roadmap,
                request,
                zones,
                ws,
                &mut own.nodes,
                &mut own.plan,
            )
            .map_err(|_| PlanFailure::Unreachable)?;
        }
        (MissionKind::Coverage(view), RequestedPlan::Flight) => {
            let PlanInputs { photographed, divisions, .. } = &own.inputs;
            let (field, max_gates) = (files.field, *max_gates);
            let ws = workspaces.for_area();
            let request = coverage::Request { mission, view, field, max_gates, photographed };
            plan_area(&request, index, divisions, ws, swarm, &mut own.plan)?;
        }
        (MissionKind::Coverage(view), RequestedPlan::Detour(request)) => {
            plan_area_detour(view, files.field, request, workspaces.for_area(), own)?;
        }
    }
    Ok(&own.plan)
}

/// Plans a coverage mission and takes vehicle `index`'s flight from it. Not inlined, so that its
/// stack frame is not added to that of roadmap plans.
#[inline(never)]
fn plan_area<
    const X: usize,
    const L: usize,
    const K: usize,
    const C: usize,
    const V: usize,
    const W: usize,
    const G: usize,
>(
    request: &coverage::Request<'_, '_>,
    index: usize,
    divisions: &[DivisionInputs<V>],
    ws: &mut AreaWorkspace<X, L, K, C>,
    swarm: &mut SwarmPlan<V, W>,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), PlanFailure> {
    let divisions = divisions.iter().map(|inputs| &inputs[..]);
    let AreaWorkspace { area, schedule } = ws;
    coverage::plan_flights::<X, L, K, C, V, W>(request, divisions, area, schedule, swarm)?;
    take_own_plan(swarm, index, &request.mission.header().schedule, schedule, out)
}

/// Plans a detour of a coverage mission: home above the area, aside, or back to the vehicle's path.
/// Not inlined, for the reason at [`plan_area`].
#[inline(never)]
fn plan_area_detour<
    const X: usize,
    const L: usize,
    const K: usize,
    const C: usize,
    const V: usize,
    const W: usize,
    const G: usize,
    const Z: usize,
>(
    view: &CoverageView<'_>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    ws: &mut AreaWorkspace<X, L, K, C>,
    own: &mut OwnPlanMemory<V, W, G, Z>,
) -> Result<(), PlanFailure> {
    let zones = own.inputs.zones()?;
    let (ws, out) = (&mut ws.area, &mut own.plan);
    coverage::plan_detour::<X, L, K, C, W, G>(view, field, request, zones, ws, out)
}

/// Takes vehicle `index`'s plan, with its gates, from that of the swarm.
///
/// # Errors
/// [`PlanFailure::Capacity`]: the plan has more than `G` gates, or no such vehicle.
pub fn take_own_plan<const V: usize, const W: usize, const G: usize>(
    swarm: &SwarmPlan<V, W>,
    index: usize,
    schedule: &ScheduleConfig,
    ws: &mut ScheduleWorkspace,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), PlanFailure> {
    plan::vehicle_plan(swarm, index, schedule, ws, out).map_err(|_| PlanFailure::Capacity)
}

/// Plans a mission with goals on its roadmap; no vehicle's plan has more than `gates_most` gates.
/// `done` is called after each step, so that the host can time it.
///
/// # Errors
/// Reason why there is no plan; [`PlanError::SwarmFull`] for a mission with more than `V` vehicles
/// or goals.
pub fn plan_goal_mission<const N: usize, const V: usize, const W: usize, const P: usize>(
    mission: &MissionView<'_>,
    roadmap: &RoadmapView<'_>,
    gates_most: usize,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
    mut done: impl FnMut(PlanStep),
) -> Result<(), PlanError> {
    let (mut tasks, mut descents_m) = (Vec::<_, V>::new(), Vec::<_, V>::new());
    let request = mission
        .plan_request(&mut tasks, &mut descents_m, gates_most)
        .map_err(|_| PlanError::SwarmFull)?;
    let mut goals = plan::AssignedGoals::new();
    plan::compute_costs(roadmap, &request, ws)?;
    done(PlanStep::Search);
    plan::assign_goals(&request, ws, &mut goals)?;
    done(PlanStep::Assignment);
    plan::schedule_flights(roadmap, &request, &goals, ws, out)?;
    done(PlanStep::Schedule);
    Ok(())
}

impl From<PlanError> for PlanFailure {
    /// The failure that a companion handles, for an error of the planner.
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::CountMismatch | PlanError::BadGoal(_) | PlanError::SameId(_) => {
                Self::RoadmapUnusable
            }
            PlanError::Config(_)
            | PlanError::BadTask(_)
            | PlanError::BadDescent(_)
            | PlanError::SameGoal(_) => Self::Invalid,
            PlanError::Search(_, SearchError::PathTooLong | SearchError::WorkspaceTooSmall)
            | PlanError::SwarmFull
            | PlanError::Path(..)
            | PlanError::Schedule(_, ScheduleError::SegmentsFull | ScheduleError::GatesFull) => {
                Self::Capacity
            }
            PlanError::Schedule(_, ScheduleError::Blocked | ScheduleError::BadIndex) => {
                Self::Blocked
            }
            PlanError::Search(..) | PlanError::Assignment(_) => Self::Unreachable,
        }
    }
}

#[cfg(test)]
mod tests;
