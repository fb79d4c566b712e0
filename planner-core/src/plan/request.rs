//! What is asked of the planner, and why there is no plan.

use crate::ConfigError;
use crate::assignment::AssignmentError;
use crate::flight::PathError;
use crate::schedule::{ScheduleConfig, ScheduleError};
use crate::search::SearchError;

/// Objective that an assignment minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The sum of all path lengths.
    TotalDistance,
    /// The longest path.
    Makespan,
}

/// Rule by which goals are assigned to vehicles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Every vehicle has its goal.
    Labelled,
    /// Any vehicle may take any goal.
    Unlabelled(Objective),
}

/// One vehicle of the request; vehicle `i` starts at node `i` of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleTask {
    /// Id of the vehicle, unique in the swarm.
    pub id: u8,
    /// Radius + safety margin, metres: edges must have more clearance.
    pub required_clearance_m: f32,
    /// Height of the start above its pad, metres.
    pub climb_m: f32,
    /// Labelled: index of its goal.
    pub goal: Option<u16>,
}

/// A swarm's task.
#[derive(Clone, Copy, Debug)]
pub struct PlanRequest<'a> {
    /// The vehicles, in the order of the roadmap's starts.
    pub vehicles: &'a [VehicleTask],
    /// Height of each goal above the ground below it, metres; as many as the roadmap has goals.
    pub descents_m: &'a [f32],
    /// Rule by which goals are assigned to vehicles.
    pub mode: Mode,
    /// Separation and nominal speeds.
    pub schedule: ScheduleConfig,
    /// Most gates of one vehicle: the least `G` that [`super::vehicle_plan`] is to be called with.
    pub max_gates: usize,
}

impl PlanRequest<'_> {
    /// Whether every number is one that can be planned with, every id is one vehicle's and,
    /// labelled, every goal as well.
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
            let labelled = self.mode == Mode::Labelled && vehicle.goal.is_some();
            if labelled && before.iter().any(|other| other.goal == vehicle.goal) {
                return Err(PlanError::SameGoal(vehicle.id));
            }
        }
        match self.descents_m.iter().position(|&height_m| !good(height_m)) {
            Some(goal) => Err(PlanError::BadDescent(goal as u16)),
            None => Ok(()),
        }
    }
}

/// Reason why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanError {
    /// The roadmap has other numbers of starts or goals than the request.
    Terminals,
    /// More vehicles or goals than `V`.
    SwarmFull,
    /// A setting of the schedule.
    Config(ConfigError),
    /// Height or clearance of the vehicle with this id is negative, NaN or infinite.
    BadTask(u8),
    /// The height of the goal with this index above its ground is negative, NaN or infinite.
    BadDescent(u16),
    /// Two vehicles have this id.
    SameId(u8),
    /// The vehicle with this id has a goal that is another one's too.
    SameGoal(u8),
    /// A labelled goal that is not in the roadmap, for the vehicle with this id.
    BadGoal(u8),
    /// A search failed for a reason other than "no path", for the vehicle with this id.
    Search(u8, SearchError),
    /// The costs could not be assigned.
    Assignment(AssignmentError),
    /// The path of the vehicle with this id was refused.
    Path(u8, PathError),
    /// The vehicle with this id cannot be scheduled among the others.
    Schedule(u8, ScheduleError),
}
