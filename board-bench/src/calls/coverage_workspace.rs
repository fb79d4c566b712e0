//! The memory that the separate steps of coverage planning are lent.

use firmware::capacity::{AREA_VERTICES, LANES, VEHICLES};
use planner_core::coverage::pack::RoutePlan;
use planner_core::coverage::tracks::{self, Tracks};
use planner_core::coverage::{losses, powell};
use planner_core::schedule::ScheduleWorkspace;

/// Workspaces of the separate steps of coverage planning, at a board's capacities.
pub struct CoverageWorkspace {
    /// All lanes of the area, along one path.
    pub tracks: Tracks<LANES>,
    /// Lanes that are not photographed after a vehicle was lost.
    pub remaining: Tracks<LANES>,
    /// Workspace for computing lanes.
    pub lane_workspace: tracks::LaneWorkspace<AREA_VERTICES>,
    /// Workspace for dividing lanes among vehicles.
    pub powell: powell::PowellWorkspace<VEHICLES>,
    /// Each vehicle's route over its lanes.
    pub plan: RoutePlan<VEHICLES>,
    /// Workspace for lost vehicles and the lanes left after them.
    pub losses: losses::LossesWorkspace<LANES, VEHICLES>,
    /// Workspace for scheduling the flights.
    pub schedule: ScheduleWorkspace,
}

impl CoverageWorkspace {
    /// Empty; its bytes are all zeros.
    pub const fn new() -> Self {
        Self {
            tracks: Tracks::new(),
            remaining: Tracks::new(),
            lane_workspace: tracks::LaneWorkspace::new(),
            powell: powell::PowellWorkspace::new(),
            plan: RoutePlan::new(),
            losses: losses::LossesWorkspace::new(),
            schedule: ScheduleWorkspace::new(),
        }
    }
}

impl Default for CoverageWorkspace {
    fn default() -> Self {
        Self::new()
    }
}
