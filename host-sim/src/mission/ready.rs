//! A mission ready to be planned and flown: what all kinds have in common, and the file that boards
//! get.

use std::sync::OnceLock;

use anyhow::anyhow;
use companion::storage::mission_file::{
    self, MissionBlock, MissionHeader, MissionVehicle, MissionView,
};
use planner_core::Point;
use planner_core::flight::VehiclePlan;
use planner_core::frames::{Geodetic, enu_to_geodetic};
use planner_core::plan::{self, Mode, Objective, VehicleTask};
use planner_core::roadmap::RoadmapView;
use planner_core::schedule::{ScheduleConfig, ScheduleError};

use crate::capacity::{BoardCapacity, GATES, VEHICLES, WAYPOINTS};
use crate::map::{ClearanceField, VoxelMap};
use crate::margins;
use crate::result::{RoadmapSize, Timing};
use crate::roadmap::Roadmap;
use crate::scenario::{self, Scenario};

/// The plan of a swarm with the desk's capacities.
pub type SwarmPlan = plan::SwarmPlan<VEHICLES, WAYPOINTS>;
/// One companion's part of the swarm's plan.
pub type OwnPlan = VehiclePlan<WAYPOINTS, GATES>;

/// Acceleration and braking that missions are planned with, m/s².
pub const PLANNED_ACCEL_MPS2: f32 = 1.5;
/// Nominal speed of take-off and landing, m/s.
pub const VERTICAL_MPS: f32 = 1.0;
/// Mean speed of a flight over its cruise speed: corners, braking and gusts take the rest.
const MEAN_SPEED_SHARE: f32 = 0.9;

/// A mission ready to be planned and flown.
pub struct Mission {
    /// Scenario of the mission.
    pub scenario: Scenario,
    /// The map on the planning grid.
    pub map: VoxelMap,
    /// Where the vehicles go: the scenario's goals, or the slots around its single one.
    pub goals: Vec<Point>,
    /// The roadmap.
    pub roadmap: Roadmap,
    /// The roadmap as the file on the board, or the field of an area over terrain.
    pub roadmap_file: Vec<u8>,
    /// The mission as the file on the board.
    pub mission_file: Vec<u8>,
    /// The vehicles' tasks, in the order of the scenario.
    pub tasks: Vec<VehicleTask>,
    /// Height of each goal over where a vehicle of the largest radius stands below it, metres.
    pub descents_m: Vec<f32>,
    pub(super) schedule: ScheduleConfig,
    /// Computing times so far.
    pub timing: Timing,
    /// The board that the files are for; none if they are for the desk.
    pub(super) board: Option<&'static BoardCapacity>,
    pub(super) clearance_field: OnceLock<ClearanceField>,
}

/// Separation and nominal speeds of a scenario.
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

impl Mission {
    /// A mission without goals, roadmap and files.
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
            roadmap: Roadmap { nodes: Vec::new(), edges: Vec::new(), heights_m: Vec::new() },
            roadmap_file: Vec::new(),
            mission_file: Vec::new(),
            tasks,
            descents_m: Vec::new(),
            schedule,
            timing: Timing::default(),
            board,
            clearance_field: OnceLock::new(),
        }
    }

    /// The map's distance field, made when first asked for: only a flight needs it.
    pub fn clearance_field(&self) -> &ClearanceField {
        self.clearance_field.get_or_init(|| ClearanceField::new(&self.map.grid()))
    }

    /// Separation and nominal speeds that the mission file carries; [`Mission::set_separation`]
    /// changes them.
    pub fn schedule(&self) -> &ScheduleConfig {
        &self.schedule
    }

    /// One companion's part of the swarm's plan.
    pub fn own_plan(&self, plan: &SwarmPlan, index: usize) -> Result<Box<OwnPlan>, ScheduleError> {
        let mut workspace = Default::default();
        let mut own = Box::new(OwnPlan::default());
        plan::vehicle_plan(plan, index, &self.schedule, &mut workspace, &mut own)?;
        Ok(own)
    }

    /// The roadmap as a board reads it; the whole file is checked at each call.
    pub fn view(&self) -> RoadmapView<'_> {
        parse_roadmap(&self.roadmap_file)
    }

    /// Height of what a vehicle comes to stand on that sinks from a place, metres; none beside the
    /// map.
    pub fn ground_below(&self, place: &Point) -> Option<f32> {
        let below_m = self.map.ground_below(place)?;
        let terrain = self.scenario.area.as_ref().and_then(|area| area.terrain.as_ref());
        Some(terrain.and_then(|terrain| terrain.grid.height_at(&place.xy())).unwrap_or(below_m))
    }

    /// Size of the roadmap.
    pub fn roadmap_size(&self) -> RoadmapSize {
        RoadmapSize {
            nodes: self.roadmap.nodes.len(),
            edges: self.roadmap.edges.len(),
            bytes: self.roadmap_file.len(),
        }
    }

    /// Place of a vehicle in the scenario.
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

    /// Place of the centre of a vehicle's body while it stands on its pad.
    pub fn pad_position(&self, index: usize) -> Geodetic {
        let start = self.scenario.vehicles[index].start;
        let pad = start - Point::new(0.0, 0.0, self.tasks[index].climb_m);
        enu_to_geodetic(&self.scenario.map.origin, &pad)
    }

    /// The mission as a companion reads it; its CRC covers all that companions must agree on.
    pub fn mission_view(&self) -> MissionView<'_> {
        MissionView::parse(&self.mission_file).expect("we wrote it ourselves")
    }

    pub(super) fn encode(&self, block: &MissionBlock<'_>) -> anyhow::Result<Vec<u8>> {
        let scenario = &self.scenario;
        let header = MissionHeader {
            roadmap_crc: self.roadmap_file.last_chunk().map_or(0, |crc| u32::from_le_bytes(*crc)),
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
                start: vehicle.start,
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

fn parse_roadmap(roadmap_file: &[u8]) -> RoadmapView<'_> {
    RoadmapView::parse(roadmap_file).expect("we wrote it ourselves")
}

fn planner_mode(mission: &scenario::Mission) -> Mode {
    match (mission.mode, mission.objective) {
        (scenario::Mode::Labelled, _) => Mode::Labelled,
        (_, scenario::Objective::Total) => Mode::Unlabelled(Objective::TotalDistance),
        (_, scenario::Objective::Makespan) => Mode::Unlabelled(Objective::Makespan),
    }
}
