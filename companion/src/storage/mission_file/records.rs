//! The vehicles and goals of a mission file.

use planner_core::Point;
use planner_core::plan::VehicleTask;
use planner_core::roadmap::MAX_COORDINATE_M;

use super::numbers::{
    MAX_SPEED_MPS, f32_at, in_range, is_positive_up_to, point_at, put_numbers, u16_at,
};

/// Bytes of a vehicle in the file.
pub const VEHICLE_LEN: usize = 32;
/// Bytes of a goal in the file.
pub const GOAL_LEN: usize = 16;
/// Goal index of a vehicle that has no goal of its own.
pub const NO_GOAL: u16 = u16::MAX;

/// One vehicle of a mission; vehicle `i`, in the file's order, starts at node `i` of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionVehicle {
    /// System id, required clearance, height of the path's start above the pad, and goal.
    pub task: VehicleTask,
    /// First point of the vehicle's path, above its pad, in the mission frame.
    pub path_start: Point,
    /// Radius of the vehicle's hull, metres.
    pub radius_m: f32,
    /// Greatest speed of the vehicle, m/s.
    pub speed_max_mps: f32,
}

/// One goal of a mission; goal `i` is node `vehicles + i` of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionGoal {
    /// Position of the goal in the mission frame.
    pub position: Point,
    /// Height of the goal above the place where a vehicle stands after landing below it, metres.
    pub descent_m: f32,
}

impl MissionVehicle {
    /// Whether all numbers are in range, and the goal is one of `goals`.
    pub(super) fn is_valid(&self, goals: usize) -> bool {
        let task = &self.task;
        task.id != 0
            && task.goal.is_none_or(|goal| usize::from(goal) < goals)
            && in_range(&self.path_start)
            && (0.0..=MAX_COORDINATE_M).contains(&task.climb_m)
            && is_positive_up_to(task.required_clearance_m, MAX_COORDINATE_M)
            && is_positive_up_to(self.radius_m, MAX_COORDINATE_M)
            && is_positive_up_to(self.speed_max_mps, MAX_SPEED_MPS)
    }

    /// The vehicle in these bytes of the file.
    pub(super) fn from_bytes(b: &[u8; VEHICLE_LEN]) -> Self {
        let goal = u16_at(b, 2);
        Self {
            task: VehicleTask {
                id: b[0],
                required_clearance_m: f32_at(b, 20),
                climb_m: f32_at(b, 24),
                goal: (goal != NO_GOAL).then_some(goal),
            },
            path_start: point_at(b, 4),
            radius_m: f32_at(b, 16),
            speed_max_mps: f32_at(b, 28),
        }
    }

    /// The vehicle as in the file.
    pub(super) fn to_bytes(self) -> [u8; VEHICLE_LEN] {
        let mut b = [0; VEHICLE_LEN];
        b[0] = self.task.id;
        b[2..4].copy_from_slice(&self.task.goal.unwrap_or(NO_GOAL).to_le_bytes());
        let numbers =
            [self.radius_m, self.task.required_clearance_m, self.task.climb_m, self.speed_max_mps];
        put_numbers(&mut b, 4, self.path_start.iter().copied().chain(numbers));
        b
    }
}

impl MissionGoal {
    /// Whether all numbers are in range.
    pub(super) fn is_valid(&self) -> bool {
        in_range(&self.position) && (0.0..=MAX_COORDINATE_M).contains(&self.descent_m)
    }

    /// The goal in these bytes of the file.
    pub(super) fn from_bytes(b: &[u8; GOAL_LEN]) -> Self {
        Self { position: point_at(b, 0), descent_m: f32_at(b, 12) }
    }
}
