//! The shell's planner on the test bench: it reads a request's inputs when it begins, and answers
//! one request after the other.

extern crate std;
use std::vec::Vec;

use planner_core::Point;
use planner_core::coverage::around;
use planner_core::coverage::transit::TransitGraph;
use planner_core::detour::{DetourGoal, DetourRequest, KeepOutZone};
use planner_core::flight::{Path, VehiclePlan};

use super::{Bench, GOAL, Plan, plan};
use crate::planner::coverage::OPEN_FIELD_CLEARANCE_M;
use crate::{Duration, Instant, PlanFailure, PlanKind};

/// An answer whose plan is made and that is sent when `due`.
pub(super) struct Answer {
    due: Instant,
    /// Which plan was requested.
    wanted: PlanKind,
    plan: Result<Plan, PlanFailure>,
}

impl Bench {
    /// Sends the answer that is due, or begins the next request, with what the companion requests
    /// at that time. Returns false if there was nothing to do.
    pub(super) fn step_planner(&mut self) -> bool {
        if let Some(answer) = self.answer_under_way.take_if(|answer| answer.due <= self.now) {
            self.companion.handle_plan(
                self.now,
                answer.wanted,
                answer.plan.as_ref().map_err(|e| *e),
            );
            return true;
        }
        if self.answer_under_way.is_some() {
            return false;
        }
        let Some(wanted) = self.plan_requests.take() else { return false };
        let plan = match wanted {
            PlanKind::Division => self.division_plan(),
            PlanKind::Detour => match self.detour_request() {
                Some((request, obstacles)) => self.planned_detour(&request, obstacles),
                None => Some(Err(PlanFailure::Unreachable)),
            },
            PlanKind::Mission => self.answer_plan.clone(),
        };
        let takes = match self.planner_takes.len() {
            0 => Duration::default(),
            times => self.planner_takes[self.answer_count % times],
        };
        self.answer_count += 1;
        self.answer_under_way = plan.map(|plan| Answer { due: self.now + takes, wanted, plan });
        true
    }

    /// The detour that the companion requests now, and the keep-out zones for it; `None` if it
    /// requests none any more.
    fn detour_request(&mut self) -> Option<(DetourRequest, Vec<KeepOutZone>)> {
        let mut obstacles = Vec::new();
        let request = self.companion.detour_request(|obstacle| obstacles.push(obstacle))?;
        Some((request, obstacles))
    }

    /// The shell's answer to a request for a detour; `None` for no answer.
    fn planned_detour(
        &mut self,
        request: &DetourRequest,
        mut obstacles: Vec<KeepOutZone>,
    ) -> Option<Result<Plan, PlanFailure>> {
        if !self.companion.detours.is_beside_plan() {
            self.own_plan = self.companion.mission.plan().cloned();
        }
        let found = |()| {
            let mut path = Path::new();
            if matches!(request.goal, DetourGoal::Point { .. }) {
                around::plan_detour(
                    &TransitGraph::<1>::empty(),
                    None,
                    request,
                    &mut obstacles,
                    &mut path,
                )
                .map_err(|_| PlanFailure::Unreachable)?;
                return Ok(VehiclePlan {
                    path,
                    climb_m: 0.0,
                    descent_m: request.descent_m,
                    ..plan()
                });
            }
            path.push(request.here, 1.2).unwrap();
            path.push(Point::new(13.0, 16.0, 2.0), 1.2).unwrap();
            path.push(GOAL, 1.2).unwrap();
            Ok(VehiclePlan { path, climb_m: 0.0, descent_m: request.descent_m, ..plan() })
        };
        self.answer_detour.map(|answer| answer.and_then(found))
    }

    /// The plan after a division: the rest of the vehicle's path from where it holds. `None` for no
    /// answer.
    fn division_plan(&self) -> Option<Result<Plan, PlanFailure>> {
        if self.undividable {
            return Some(Err(PlanFailure::Capacity));
        }
        let rank =
            usize::from(self.companion.config.own_roster_entry().expect("it is in the roster").0);
        let held_dm =
            self.companion.division_inputs().last().map_or(0, |inputs| inputs[rank].along_dm);
        // On a detour beside its path the companion's current plan is the detour.
        let beside = self.companion.detours.is_beside_plan();
        let plan = if beside { self.own_plan.as_ref() } else { self.companion.mission.plan() };
        let mut plan = plan.filter(|_| self.answer_division)?.clone();
        let fleet = self.companion.neighbours.fleet().expect("it divides an area");
        let counted = fleet.division_count() == self.companion.mission.division_count();
        if beside && counted && !fleet.is_division_to_be_computed() {
            return Some(Ok(plan));
        }
        let held_m = f32::from(held_dm) / 10.0;
        let mut path = Path::new();
        path.push(plan.path.point_at(held_m).expect("a path"), OPEN_FIELD_CLEARANCE_M).unwrap();
        for waypoint in plan.path.waypoints().iter().filter(|w| w.along_m > held_m) {
            path.push(waypoint.position, waypoint.leg_clearance_m).unwrap();
        }
        if held_m > 0.0 {
            plan.climb_m = 0.0;
        }
        (plan.path, plan.swarm_plan_crc) = (path, plan.swarm_plan_crc + 1);
        Some(Ok(plan))
    }
}
