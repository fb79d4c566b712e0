//! A mission ready to be planned and flown: data that missions with goals and with an area share,
//! and the encoding of the mission file.

use std::sync::OnceLock;

use anyhow::anyhow;
use companion::PlanFailure;
use companion::planner;
use companion::storage::mission_file::{
    self, MissionBlock, MissionHeader, MissionVehicle, MissionView,
};
use planner_core::Point;
use planner_core::flight::VehiclePlan;
use planner_core::geo::frames::{Geodetic, enu_to_geodetic};
use planner_core::plan::{self, GoalMode, Objective, VehicleTask};
use planner_core::roadmap::RoadmapView;
use planner_core::schedule::ScheduleConfig;

use crate::capacity::{BoardCapacity, MAX_GATES, MAX_VEHICLES, MAX_WAYPOINTS};
use crate::map::{ClearanceField, VoxelMap};
use crate::margins;
use crate::result::{RoadmapCounts, Timing};
use crate::roadmap::BuiltRoadmap;
use crate::scenario::{self, Scenario};

/// The swarm's plan, with the host's capacities.
pub type HostPlan = plan::SwarmPlan<MAX_VEHICLES, MAX_WAYPOINTS>;
/// One vehicle's part of the swarm's plan, with its gates.
pub type OwnPlan = VehiclePlan<MAX_WAYPOINTS, MAX_GATES>;

/// Nominal speed of take-off and landing in the plan of a mission with goals, m/s.
pub const VERTICAL_MPS: f32 = 1.0;
/// Mean speed along a path that the schedule assumes, as a share of cruise speed: corners, braking
/// and gusts take the rest.
const MEAN_SPEED_SHARE: f32 = 0.9;

/// A mission ready to be planned and flown.
pub struct PreparedMission {
    /// The scenario that the mission was made from.
    pub scenario: Scenario,
    /// The map on the planning grid.
    pub map: VoxelMap,
    /// Goals of the scenario, or the slots around its single goal, metres ENU.
    pub goals: Vec<Point>,
    /// The roadmap of a mission with goals; empty for an area.
    pub roadmap: BuiltRoadmap,
    /// Bytes of the roadmap file for a board; in a coverage mission those of the field file, empty
    /// over level ground.
    pub roadmap_or_field_file: Vec<u8>,
    /// Bytes of the mission file for a board.
    pub mission_file: Vec<u8>,
    /// The vehicles' tasks, in the order of the scenario.
    pub tasks: Vec<VehicleTask>,
    /// Length of the landing at each goal, metres: from the goal down to the hull centre of a
    /// vehicle that stands on the ground below it, computed for the largest radius of all vehicles.
    pub descents_m: Vec<f32>,
    /// Separations and nominal speeds by which flights are scheduled.
    pub(super) schedule: ScheduleConfig,
    /// Computing times of the steps done so far.
    pub timing: Timing,
    /// The board that the files have to fit; `None` if they are for the host.
    pub(super) board: Option<&'static BoardCapacity>,
    /// Made by the method of this name at its first call.
    pub(super) clearance_field: OnceLock<ClearanceField>,
}

/// Separations and nominal speeds by which the scenario's flights are scheduled.
pub(super) fn schedule_config(scenario: &Scenario) -> ScheduleConfig {
    ScheduleConfig {
        separation_m: scenario.deconfliction.separation_m,
        parked_separation_m: margins::parked_separation_m(
            &scenario.simulation,
            scenario.deconfliction.safety_distance_m,
            &scenario.vehicles,
        ),
        cruise_mps: MEAN_SPEED_SHARE * scenario.mission.cruise_mps,
        vertical_mps: VERTICAL_MPS,
    }
}

impl PreparedMission {
    /// A mission with empty goals, roadmap and files, for its caller to fill in.
    pub(super) fn new(
        scenario: Scenario,
        map: VoxelMap,
        tasks: Vec<VehicleTask>,
        schedule: ScheduleConfig,
        board: Option<&'static BoardCapacity>,
    ) -> Self {
        Self {
            scenario,
            map,
            goals: Vec::new(),
            roadmap: BuiltRoadmap {
                nodes: Vec::new(),
                edges: Vec::new(),
                heights_above_ground_m: Vec::new(),
            },
            roadmap_or_field_file: Vec::new(),
            mission_file: Vec::new(),
            tasks,
            descents_m: Vec::new(),
            schedule,
            timing: Timing::default(),
            board,
            clearance_field: OnceLock::new(),
        }
    }

    /// Lower bounds of the distance from the map's cells to the nearest obstacle; computed at the
    /// first call, since only a flight needs them.
    pub fn clearance_field(&self) -> &ClearanceField {
        self.clearance_field.get_or_init(|| ClearanceField::new(&self.map.grid()))
    }

    /// Separations and nominal speeds of the mission file; [`PreparedMission::set_separation`]
    /// changes the separations.
    pub fn schedule(&self) -> &ScheduleConfig {
        &self.schedule
    }

    /// The part of `plan` that vehicle `index` flies, with its gates.
    ///
    /// # Errors
    /// As [`planner::take_own_plan`].
    pub fn own_plan(&self, plan: &HostPlan, index: usize) -> Result<Box<OwnPlan>, PlanFailure> {
        let mut workspace = Default::default();
        let mut own = Box::new(OwnPlan::default());
        planner::take_own_plan(plan, index, &self.schedule, &mut workspace, &mut own)?;
        Ok(own)
    }

    /// The roadmap file, parsed as on a board: each call checks the whole file. Panics in a
    /// coverage mission, which has none.
    pub fn roadmap_view(&self) -> RoadmapView<'_> {
        parse_roadmap(&self.roadmap_or_field_file)
    }

    /// Height of the ground on which a vehicle that sinks vertically from `place` would come to
    /// stand, metres ENU; `None` where the map has no ground below. In a coverage mission it is the
    /// height of the terrain, or the top of an obstacle of the area's map where that is higher.
    pub fn ground_z_below_m(&self, place: &Point) -> Option<f32> {
        let below_m = self.map.ground_z_below_m(place)?;
        let Some(area) = &self.scenario.area else { return Some(below_m) };
        let terrain_m = area.terrain.as_ref().and_then(|t| t.grid.height_at(&place.xy()));
        let top_m = area.obstacles.as_ref().and_then(|o| o.map.ground_z_below_m(place));
        Some(terrain_m.unwrap_or(below_m).max(top_m.unwrap_or(f32::NEG_INFINITY)))
    }

    /// Numbers of nodes and edges of the roadmap, and length of the roadmap or field file, bytes.
    pub fn roadmap_counts(&self) -> RoadmapCounts {
        RoadmapCounts {
            nodes: self.roadmap.nodes.len(),
            edges: self.roadmap.edges.len(),
            file_bytes: self.roadmap_or_field_file.len(),
        }
    }

    /// Index, in the scenario's order, of the vehicle with this id.
    ///
    /// # Errors
    /// No vehicle has this id.
    pub fn index_of(&self, id: u8) -> anyhow::Result<usize> {
        let index = self.tasks.iter().position(|task| task.id == id);
        index.ok_or_else(|| {
            let ids: Vec<String> = self.tasks.iter().map(|task| task.id.to_string()).collect();
            anyhow!("no vehicle has id {id}: {}: there are {}", self.scenario.path, ids.join(", "))
        })
    }

    /// Position of the hull centre of vehicle `index` while it stands on its pad, WGS84.
    pub fn pad_position(&self, index: usize) -> Geodetic {
        let start = self.scenario.vehicles[index].start;
        let pad = start - Point::new(0.0, 0.0, self.tasks[index].climb_m);
        enu_to_geodetic(&self.scenario.map.origin, &pad)
    }

    /// The mission file, parsed as by a companion; its CRC covers all that companions must agree
    /// on.
    pub fn mission_view(&self) -> MissionView<'_> {
        MissionView::parse(&self.mission_file).expect("we wrote it ourselves")
    }

    /// Encodes the mission file; `block` is its part about goals or about an area.
    pub(super) fn encode(&self, block: &MissionBlock<'_>) -> anyhow::Result<Vec<u8>> {
        let scenario = &self.scenario;
        let header = MissionHeader {
            roadmap_crc: self
                .roadmap_or_field_file
                .last_chunk()
                .map_or(0, |crc| u32::from_le_bytes(*crc)),
            mode: planner_mode(&scenario.mission),
            method: scenario.deconfliction.method,
            origin: scenario.map.origin,
            cruise_mps: scenario.mission.cruise_mps,
            schedule: self.schedule,
            safety_distance_m: scenario.deconfliction.safety_distance_m,
            geofence: scenario.mission.geofence.as_ref().map(|fence| (fence.min, fence.max)),
            ground_stations: scenario.mission.ground_stations,
        };
        let vehicles: Vec<_> = scenario
            .vehicles
            .iter()
            .zip(&self.tasks)
            .map(|(vehicle, &task)| MissionVehicle {
                task,
                path_start: vehicle.start,
                radius_m: vehicle.radius_m,
                speed_max_mps: vehicle.speed_max_mps,
            })
            .collect();
        let mut bytes = vec![0; block.file_len(vehicles.len())];
        mission_file::write_mission(&header, &vehicles, block, &mut bytes)
            .map_err(|e| anyhow!("no mission file: {}: {e}", scenario.path))?;
        Ok(bytes)
    }
}

/// The roadmap in a file that we made.
fn parse_roadmap(roadmap_file: &[u8]) -> RoadmapView<'_> {
    RoadmapView::parse(roadmap_file).expect("we wrote it ourselves")
}

/// How the planner is to give goals to vehicles.
fn planner_mode(mission: &scenario::MissionSection) -> GoalMode {
    match (mission.mode, mission.objective) {
        (scenario::MissionMode::Labelled, _) => GoalMode::Labelled,
        (_, scenario::AssignmentObjective::TotalDistance) => {
            GoalMode::Unlabelled(Objective::TotalDistance)
        }
        (_, scenario::AssignmentObjective::Makespan) => GoalMode::Unlabelled(Objective::Makespan),
    }
}
