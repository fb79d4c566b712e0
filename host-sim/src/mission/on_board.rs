//! Checks whether a board computes the host's plan from the same files. A board searches with less
//! memory, so it may find no plan, or one with another CRC: its vehicle would then not start with
//! the others.

use companion::planner;
use companion::storage::mission_file::MissionKind;
use planner_core::flight::PathError;
use planner_core::plan::{self, PlanError, PlanWorkspace};
use planner_core::schedule::ScheduleError;

use super::ready::{HostPlan, PreparedMission};
use crate::capacity::{BoardCapacity, MAX_WAYPOINTS, NUCLEO_H743, PICO2, on_heap};

impl PreparedMission {
    /// Text about the first capacity of a board that the mission or its plan exceeds; `None` if the
    /// board can fly it.
    pub fn board_limit_exceeded(&self, plan: &HostPlan, board: &BoardCapacity) -> Option<String> {
        let mission = self.mission_view();
        let of_mission = || board.mission_excess(&mission);
        match mission.kind() {
            MissionKind::Goals => board
                .roadmap_excess(&self.roadmap_view())
                .or_else(of_mission)
                .or_else(|| self.plan_mismatch_on_board(plan, board)),
            MissionKind::Coverage(area) => {
                let gates = |i| self.own_plan(plan, i).map_or(usize::MAX, |own| own.gates.len());
                let most = (0..self.tasks.len()).map(gates).max().unwrap_or(0);
                self.area_excess(area, board)
                    .or_else(of_mission)
                    .or_else(|| board.gates_excess(most))
            }
        }
    }

    /// Plans with the capacities of a board: `None` if the plan's CRC equals that of `plan`, else a
    /// text that says why not.
    fn plan_mismatch_on_board(&self, plan: &HostPlan, board: &BoardCapacity) -> Option<String> {
        const H743: BoardCapacity = NUCLEO_H743;
        let planned = if board.nodes == H743.nodes {
            self.plan_crc_on_board::<{ H743.nodes }, { H743.vehicles }, { H743.timed_segments }>(
                board,
            )
        } else {
            self.plan_crc_on_board::<{ PICO2.nodes }, { PICO2.vehicles }, { PICO2.timed_segments }>(
                board,
            )
        };
        let name = board.name;
        match planned {
            Ok(crc) if crc == plan.crc => None,
            Ok(_) => Some(format!("with the memory of {name} another plan is found")),
            Err(PlanError::Schedule(id, ScheduleError::GatesFull)) => Some(format!(
                "vehicle {id} meets too many others, {name} holds {} gates of one vehicle",
                board.gates
            )),
            Err(PlanError::Schedule(id, ScheduleError::SegmentsFull | ScheduleError::Blocked)) => {
                Some(format!(
                    "no schedule for vehicle {id} with the {} timed segments that {name} holds",
                    board.timed_segments
                ))
            }
            Err(PlanError::Path(id, PathError::PathFull)) => Some(format!(
                "the flight of vehicle {id} is too long, {name} holds {MAX_WAYPOINTS} waypoints"
            )),
            Err(other) => Some(format!("{name} finds no plan: {other:?}")),
        }
    }

    /// CRC of the plan that the planner finds with a board's capacities: `N` nodes, `V` vehicles,
    /// `P` timed segments.
    fn plan_crc_on_board<const N: usize, const V: usize, const P: usize>(
        &self,
        board: &BoardCapacity,
    ) -> Result<u32, PlanError> {
        let mut workspace = on_heap(PlanWorkspace::<N, V, P>::new);
        let mut plan = on_heap(plan::SwarmPlan::<V, MAX_WAYPOINTS>::new);
        planner::plan_goal_mission(
            &self.mission_view(),
            &self.roadmap_view(),
            board.gates,
            &mut workspace,
            &mut plan,
            |_| {},
        )?;
        Ok(plan.crc)
    }
}
