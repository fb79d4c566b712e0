//! Computes the plan that a mission file describes, by the same code on the host and on a board;
//! the host lends it more memory.
//!
//! Every companion plans the whole swarm from the same file, so all get the same plan; they compare
//! its CRC to be sure.

pub mod coverage;

use heapless::Vec;
use planner_core::plan::{self, PlanError, PlanWorkspace, SwarmPlan};
use planner_core::roadmap::RoadmapView;
use planner_core::roadmap::search::SearchError;
use planner_core::schedule::ScheduleError;

use crate::config::PlanFailure;
use crate::storage::mission_file::MissionView;

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

/// Plans a mission with goals on its roadmap; no vehicle's plan has more than `gates_most` gates.
/// `done` is called after each step, so that the host can time it.
///
/// # Errors
/// Reason why there is no plan; [`PlanError::SwarmFull`] for a mission with more than `V` vehicles
/// or goals.
pub fn plan_goals<const N: usize, const V: usize, const W: usize, const P: usize>(
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
    let mut goals = plan::Goals::new();
    plan::compute_costs(roadmap, &request, ws)?;
    done(PlanStep::Search);
    plan::assign_goals(&request, ws, &mut goals)?;
    done(PlanStep::Assignment);
    plan::schedule_flights(roadmap, &request, &goals, ws, out)?;
    done(PlanStep::Schedule);
    Ok(())
}

impl From<PlanError> for PlanFailure {
    fn from(error: PlanError) -> Self {
        plan_failure(&error)
    }
}

/// The failure that a companion handles, for an error of the planner.
fn plan_failure(error: &PlanError) -> PlanFailure {
    match error {
        PlanError::Terminals | PlanError::BadGoal(_) | PlanError::SameId(_) => {
            PlanFailure::RoadmapUnusable
        }
        PlanError::Config(_)
        | PlanError::BadTask(_)
        | PlanError::BadDescent(_)
        | PlanError::SameGoal(_) => PlanFailure::Invalid,
        PlanError::Search(_, SearchError::PathTooLong | SearchError::WorkspaceTooSmall)
        | PlanError::SwarmFull
        | PlanError::Path(..)
        | PlanError::Schedule(_, ScheduleError::SegmentsFull | ScheduleError::GatesFull) => {
            PlanFailure::Capacity
        }
        PlanError::Schedule(_, ScheduleError::Blocked | ScheduleError::BadIndex) => {
            PlanFailure::Blocked
        }
        PlanError::Search(..) | PlanError::Assignment(_) => PlanFailure::Unreachable,
    }
}
