//! From a scenario to what is flown: the map on the planning grid, the roadmap, the mission file,
//! and the plan that the host and every companion compute from them.

mod coverage;
mod on_board;
mod places;
pub mod planner;
mod ready;
pub mod stretches;

use std::time::Instant;

use anyhow::{anyhow, bail};
use companion::planner::{PlanStep, plan_goal_mission};
use companion::storage::mission_file::{MissionBlock, MissionGoal};
use planner_core::Point;
use planner_core::flight::{PathError, Task};
use planner_core::plan::PlanError;
use planner_core::schedule::ScheduleError;

pub use self::coverage::flight_by_companion_s;
use self::planner::GoalsWorkspace;
use self::ready::schedule_config;
pub use self::ready::{HostPlan, OwnPlan, PreparedMission, VERTICAL_MPS};
use crate::capacity::{
    BoardCapacity, MAX_GATES, MAX_TIMED_SEGMENTS, MAX_VEHICLES, MAX_WAYPOINTS, on_heap,
};
use crate::coverage::check_starts_on_ground;
use crate::map::{self, VoxelMap};
use crate::margins;
use crate::progress::Progress;
use crate::result::{Timing, Unserved};
use crate::roadmap::{self};
use crate::scenario::Scenario;

/// Length of the landing at each goal, metres: from the goal down to the hull centre of a vehicle
/// that stands on the ground below it, computed for the largest radius of all vehicles.
fn descents_m(scenario: &Scenario, map: &VoxelMap, goals: &[Point]) -> anyhow::Result<Vec<f32>> {
    let largest_m = scenario.largest_radius_m();
    goals
        .iter()
        .enumerate()
        .map(|(i, goal)| {
            // An error at a slot around a single goal names that goal's line of the scenario.
            let places = &scenario.mission.goal_file_lines;
            let place = places.get(i).or(places.first());
            places::climb_height_m(scenario, map, &format!("goal {i}"), place, goal, largest_m)
        })
        .collect()
}

impl PreparedMission {
    /// Reads the map, builds the roadmap and encodes the mission file.
    ///
    /// # Errors
    /// The map cannot be read, or a start or goal lies in an obstacle or has no ground below it.
    pub fn prepare(scenario: Scenario, progress: &Progress) -> anyhow::Result<Self> {
        Self::prepare_for(scenario, None, progress)
    }

    /// As [`Self::prepare`]; with a board, the roadmap is thinned so that the files fit that board.
    ///
    /// # Errors
    /// As [`Self::prepare`]; also more vehicles, goals or nodes than the board holds.
    pub fn prepare_for(
        scenario: Scenario,
        board: Option<&'static BoardCapacity>,
        progress: &Progress,
    ) -> anyhow::Result<Self> {
        if scenario.covers_area() {
            check_starts_on_ground(&scenario)?;
            return coverage::prepare(scenario, board);
        }
        let mut timing = Timing::default();
        let begun = Instant::now();
        let stage = progress.begin_stage("map");
        let map = map::load(&scenario.map.file, scenario.map.resolution_m)?
            .to_voxel_map(scenario.map.unknown);
        timing.map_s = begun.elapsed().as_secs_f64();
        drop(stage);

        let begun = Instant::now();
        let stage = progress.begin_stage("roadmap");
        let mut schedule = schedule_config(&scenario);
        let goals = places::goal_points(&scenario, &map, &schedule)?;
        let tasks = places::vehicle_tasks(&scenario, &map)?;
        let descents_m = descents_m(&scenario, &map, &goals)?;
        let below = |(place, height_m): (&Point, f32)| place - Point::new(0.0, 0.0, height_m);
        let starts = scenario.vehicles.iter().map(|vehicle| &vehicle.start);
        let pads: Vec<Point> =
            starts.zip(tasks.iter().map(|task| task.climb_m)).map(below).collect();
        let landed: Vec<Point> = goals.iter().zip(descents_m.iter().copied()).map(below).collect();
        schedule.parked_separation_m +=
            margins::extra_beside_parked_m(schedule.parked_separation_m, &pads, &landed);
        if let Some(BoardCapacity { name, vehicles, .. }) =
            board.filter(|b| b.vehicles < tasks.len().max(goals.len()))
        {
            bail!(
                "the mission does not fit {name}: {}: {name} holds {vehicles} vehicles and goals",
                scenario.path
            );
        }
        let (mut roadmap, header, parts) = places::build_roadmap(&scenario, &map, &goals)?;
        timing.roadmap_parts = parts;
        let capping = Instant::now();
        if let Some(board) = board {
            roadmap = roadmap.fit_to_board(board)?;
            timing.roadmap_parts.edge_cap_s = capping.elapsed().as_secs_f64();
        }
        let encoding = Instant::now();
        let roadmap_file = roadmap::encode(&roadmap, &header)?;
        timing.roadmap_parts.encoding_s = encoding.elapsed().as_secs_f64();
        let mut mission = Self {
            goals,
            roadmap,
            roadmap_or_field_file: roadmap_file,
            descents_m,
            timing,
            ..Self::new(scenario, map, tasks, schedule, board)
        };
        mission.mission_file = mission.encode_goals_mission()?;
        mission.timing.roadmap_s = begun.elapsed().as_secs_f64();
        drop(stage);
        Ok(mission)
    }

    /// Encodes the mission file of a mission with goals.
    fn encode_goals_mission(&self) -> anyhow::Result<Vec<u8>> {
        let goals: Vec<_> = self
            .goals
            .iter()
            .zip(&self.descents_m)
            .map(|(&position, &descent_m)| MissionGoal { position, descent_m })
            .collect();
        self.encode(&MissionBlock::Goals(&goals))
    }

    /// Replaces the scenario's separation between paths and its separation from parked vehicles,
    /// metres. Plans are computed from the mission file, so it is encoded again.
    ///
    /// # Errors
    /// The mission file cannot hold one of the values.
    pub fn set_separation(
        &mut self,
        separation_m: f32,
        parked_separation_m: f32,
    ) -> anyhow::Result<()> {
        (self.schedule.separation_m, self.schedule.parked_separation_m) =
            (separation_m, parked_separation_m);
        self.mission_file = self.encode_goals_mission()?;
        Ok(())
    }

    /// Plans the whole swarm with the planner that companions use, and records the times it took.
    pub fn plan(&mut self) -> anyhow::Result<Box<HostPlan>> {
        let begun = Instant::now();
        if self.scenario.covers_area() {
            let plan = self.plan_coverage()?;
            self.timing.plan_s = begun.elapsed().as_secs_f64();
            return Ok(plan);
        }
        let view = self.roadmap_view();
        let mission = self.mission_view();
        let mut workspace = on_heap(GoalsWorkspace::new);
        let mut plan = on_heap(HostPlan::new);
        let (mut step_begun, mut search_s, mut assignment_s) = (Instant::now(), 0.0, 0.0);
        plan_goal_mission(&mission, &view, self.max_gates(), &mut workspace, &mut plan, |step| {
            let took_s =
                core::mem::replace(&mut step_begun, Instant::now()).elapsed().as_secs_f64();
            match step {
                PlanStep::Search => search_s = took_s,
                PlanStep::Assignment => assignment_s = took_s,
                PlanStep::Schedule => {}
            }
        })
        .map_err(|e| self.describe_plan_error(&e))?;
        (self.timing.search_s, self.timing.assignment_s) = (search_s, assignment_s);
        self.timing.plan_s = begun.elapsed().as_secs_f64();
        Ok(plan)
    }

    /// Most gates of one vehicle: the board's capacity, or the host's where no board is given.
    fn max_gates(&self) -> usize {
        self.board.map_or(MAX_GATES, |board| board.gates)
    }

    /// The error for the user, with a hint.
    fn describe_plan_error(&self, error: &PlanError) -> anyhow::Error {
        let path = &self.scenario.path;
        match error {
            PlanError::Schedule(id, ScheduleError::Blocked) => anyhow!(
                "vehicle {id} cannot pass the others: {path}: no order and no side-step lets it by\nhint: {}",
                self.describe_too_near_goals().unwrap_or_else(|| {
                    "move its start or goal out of their way, or give the \
                                                   roadmap more nodes"
                        .into()
                })
            ),
            PlanError::Schedule(id, ScheduleError::GatesFull) => {
                let most = self.max_gates();
                anyhow!(
                    "vehicle {id} meets too many others: {path}: its plan holds at most {most} gates"
                )
            }
            PlanError::Schedule(id, ScheduleError::SegmentsFull) => {
                anyhow!(
                    "vehicle {id} meets too many others: {path}: the swarm has at most {MAX_TIMED_SEGMENTS} timed segments"
                )
            }
            PlanError::Path(id, PathError::PathFull) => {
                anyhow!(
                    "the flight of vehicle {id} is too long: {path}: a path holds at most {MAX_WAYPOINTS} waypoints\n\
                     hint: a larger roadmap.edge_max_m makes fewer of them"
                )
            }
            PlanError::SwarmFull => {
                anyhow!("too many vehicles or goals: {path}: at most {MAX_VEHICLES}")
            }
            PlanError::Search(id, error) => {
                anyhow!("no search for vehicle {id}: {path}: {error:?}")
            }
            other => anyhow!("no plan: {path}: {other:?}"),
        }
    }

    /// If two goals are too near for vehicles to stand landed at both: a text with their distance
    /// and the distance needed. `None` if there is no such pair.
    fn describe_too_near_goals(&self) -> Option<String> {
        let scenario = &self.scenario;
        let needed_m = self.schedule.parked_separation_m;
        let landed = |i: usize| self.goals[i] - Point::new(0.0, 0.0, self.descents_m[i]);
        let place = |i: usize| {
            scenario.mission.goal_file_lines.get(i).map_or(&*scenario.path, String::as_str)
        };
        let mut pairs = (0..self.goals.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
        let (j, i) = pairs.find(|&(j, i)| (landed(i) - landed(j)).norm() < needed_m)?;
        Some(format!(
            "vehicles that land at goals {j} ({}) and {i} ({}) are {:.2} m apart: they need {needed_m:.2} m",
            place(j),
            place(i),
            (landed(i) - landed(j)).norm()
        ))
    }

    /// Goals that no vehicle flies to, and vehicles that the plan leaves on their pads; both empty
    /// for a coverage mission.
    pub fn unserved(&self, plan: &HostPlan) -> Unserved {
        if self.scenario.covers_area() {
            // In a coverage plan a vehicle that stays on its pad is no shortage: its flight would
            // not shorten the mission.
            return Unserved::default();
        }
        let flown = |goal: &u16| plan.flights.iter().any(|f| f.task == Task::Goto(*goal));
        Unserved {
            goals: (0..self.goals.len() as u16).filter(|goal| !flown(goal)).collect(),
            vehicles: plan
                .flights
                .iter()
                .filter(|f| !f.task.leaves_pad())
                .map(|f| f.vehicle_id)
                .collect(),
            reasons: Vec::new(),
        }
    }
}
