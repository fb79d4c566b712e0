//! The request for a plan of the swarm, and the reasons why there is none.

use crate::SettingError;
use crate::assignment::AssignmentError;
use crate::flight::PathError;
use crate::roadmap::search::SearchError;
use crate::schedule::{ScheduleConfig, ScheduleError};

/// What the assignment of goals minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The sum of all path lengths.
    TotalDistance,
    /// The length of the longest path.
    Makespan,
}

/// Whether goals are given to vehicles or assigned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GoalMode {
    /// The request names the goal of each vehicle.
    Labelled,
    /// Any vehicle may get any goal; the planner assigns them by this objective.
    Unlabelled(Objective),
}

/// One vehicle of the request; vehicle `i` starts at node `i` of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleTask {
    /// Id of the vehicle, unique in the swarm.
    pub id: u8,
    /// Vehicle radius + safety margin, metres: edges must have more clearance.
    pub required_clearance_m: f32,
    /// Height of the start node above the pad, metres.
    pub climb_m: f32,
    /// Index of the vehicle's goal among the roadmap's goals, `None` if the vehicle stays on its
    /// pad; ignored if goals are not labelled.
    pub goal: Option<u16>,
}

/// The request for a plan of the whole swarm.
#[derive(Clone, Copy, Debug)]
pub struct PlanRequest<'a> {
    /// The vehicles, in the order of the roadmap's starts.
    pub vehicles: &'a [VehicleTask],
    /// Height of each goal above the ground below it, metres; one entry for each goal of the
    /// roadmap.
    pub goal_descents_m: &'a [f32],
    /// Whether goals are given to vehicles or assigned.
    pub mode: GoalMode,
    /// Separations and nominal speeds.
    pub schedule: ScheduleConfig,
    /// Most gates that a vehicle may have: the least capacity `G` with which
    /// [`super::vehicle_plan`] is called.
    pub max_gates: usize,
}

impl PlanRequest<'_> {
    /// Checks that every number is finite and in range, that ids are unique and, if labelled, that
    /// no two vehicles have the same goal.
    pub fn check(&self) -> Result<(), PlanError> {
        self.schedule.check().map_err(PlanError::Config)?;
        let good = |number: f32| number >= 0.0 && number.is_finite();
        for (i, vehicle) in self.vehicles.iter().enumerate() {
            let before = &self.vehicles[..i];
            if !good(vehicle.required_clearance_m) || !good(vehicle.climb_m) {
                return Err(PlanError::BadTask(vehicle.id));
            }
            if before.iter().any(|other| other.id == vehicle.id) {
                return Err(PlanError::SameId(vehicle.id));
            }
            let labelled = self.mode == GoalMode::Labelled && vehicle.goal.is_some();
            if labelled && before.iter().any(|other| other.goal == vehicle.goal) {
                return Err(PlanError::SameGoal(vehicle.id));
            }
        }
        match self.goal_descents_m.iter().position(|&height_m| !good(height_m)) {
            Some(goal) => Err(PlanError::BadDescent(goal as u16)),
            None => Ok(()),
        }
    }
}

/// Reason why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanError {
    /// The numbers of starts and goals in the roadmap are not those of the request; or pads, routes
    /// and lanes of a coverage mission are inconsistent.
    CountMismatch,
    /// More than `V` vehicles or goals.
    SwarmFull,
    /// A setting of the schedule is out of range.
    Config(SettingError),
    /// Climb or required clearance of the vehicle with this id is negative, NaN or infinite.
    BadTask(u8),
    /// The height of the goal with this index above its ground is negative, NaN or infinite.
    BadDescent(u16),
    /// Two vehicles have this id.
    SameId(u8),
    /// Another vehicle has the same labelled goal as the vehicle with this id.
    SameGoal(u8),
    /// The labelled goal of the vehicle with this id is not in the roadmap.
    BadGoal(u8),
    /// The roadmap search for the vehicle with this id failed, for a reason other than "no path".
    /// If one search was for all vehicles, the id is that of the first.
    Search(u8, SearchError),
    /// The goals could not be assigned.
    Assignment(AssignmentError),
    /// The path of the vehicle with this id was refused.
    Path(u8, PathError),
    /// No schedule, or too many gates, for the vehicle with this id.
    Schedule(u8, ScheduleError),
}
