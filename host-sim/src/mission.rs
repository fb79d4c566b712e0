//! From a scenario to what is flown: the map on the planning grid, the roadmap, and the request every companion plans.

use std::time::Instant;

use anyhow::{anyhow, bail};
use planner_core::Point;
use planner_core::deconflict::{DeconflictConfig, Method};
use planner_core::plan::{self, Mode, PlanError, PlanRequest, VehicleTask};
use planner_core::prm::{Config, Sampling};
use planner_core::roadmap::{RoadmapHeader, RoadmapView};
use planner_core::schedule::{ScheduleConfig, ScheduleError, VehiclePlan};

use crate::capacity::{GATES, ROADMAP_NODES, VEHICLES, WAYPOINTS};
use crate::map::{self, VoxelMap};
use crate::progress::Progress;
use crate::result::{RoadmapSize, Timing};
use crate::roadmap::{self, Roadmap};
use crate::scenario::Scenario;

/// The plan of a swarm with the desk's capacities.
pub type SwarmPlan = plan::SwarmPlan<VEHICLES, WAYPOINTS>;
/// One companion's part of it.
pub type OwnPlan = VehiclePlan<WAYPOINTS, GATES>;
type PlanWorkspace = plan::PlanWorkspace<ROADMAP_NODES, VEHICLES>;

/// Braking and accelerating that is planned with, m/s².
pub const ACCEL_MPS2: f32 = 1.5;
/// Nominal speed of take-off and landing, m/s.
pub const VERTICAL_MPS: f32 = 1.0;
/// What two vehicles together may stray from their paths, beyond the safety distance, metres.
const STRAY_M: f32 = 0.5;
/// What one vehicle may stray beside another that stands on the ground, metres.
const STRAY_BESIDE_PARKED_M: f32 = 0.25;

/// A mission ready to be planned and flown.
pub struct Mission {
    /// What was asked for.
    pub scenario: Scenario,
    /// The map on the planning grid.
    pub map: VoxelMap,
    /// The roadmap.
    pub roadmap: Roadmap,
    /// The roadmap as the file on the board.
    pub roadmap_file: Vec<u8>,
    /// The vehicles' tasks, in the order of the scenario.
    pub tasks: Vec<VehicleTask>,
    /// Height of each goal over where a vehicle of the largest radius stands below it, metres.
    pub descents_m: Vec<f32>,
    /// Separation and nominal speeds.
    pub schedule: ScheduleConfig,
    /// What the clock said so far.
    pub timing: Timing,
}

impl Mission {
    /// Reads the map and builds the roadmap.
    pub fn prepare(scenario: Scenario, progress: &Progress) -> anyhow::Result<Self> {
        let mut timing = Timing::default();
        let begun = Instant::now();
        let stage = progress.stage("map");
        let file = scenario.map.file.clone();
        let map = map::load(&file, scenario.map.resolution_m)?.voxel_map(scenario.map.unknown);
        timing.map_s = begun.elapsed().as_secs_f64();
        drop(stage);

        let begun = Instant::now();
        let stage = progress.stage("roadmap");
        let starts: Vec<Point> = scenario.vehicles.iter().map(|v| v.start).collect();
        let terminals: Vec<Point> = starts.iter().chain(&scenario.mission.goals).copied().collect();
        let required = |radius_m: f32| radius_m + scenario.roadmap.safety_margin_m;
        let radii = || scenario.vehicles.iter().map(|v| v.radius_m);
        let config = Config {
            nodes: scenario.roadmap.nodes,
            edge_min_m: scenario.roadmap.edge_min_m,
            edge_max_m: scenario.roadmap.edge_max_m,
            clearance_m: required(radii().fold(f32::INFINITY, f32::min)),
            seed: scenario.seed,
            sampling: scenario.roadmap.sampling,
        };
        let roadmap = roadmap::build(&map, &terminals, &config)?;
        let header = RoadmapHeader {
            origin: scenario.map.origin,
            edge_min_m: config.edge_min_m,
            edge_max_m: config.edge_max_m,
            tested_clearance_m: config.clearance_m,
            max_clearance_m: roadmap::CLEARANCE_MAX_M,
            starts: starts.len() as u16,
            goals: scenario.mission.goals.len() as u16,
        };
        let roadmap_file = roadmap::encode(&roadmap, &header)?;
        timing.roadmap_s = begun.elapsed().as_secs_f64();
        drop(stage);

        let height = |name: &str, i: usize, point: &Point, radius_m: f32| {
            let ground = map
                .ground_below(point)
                .ok_or_else(|| anyhow!("{name} {i} has no ground below it to stand on: choose a place over a floor"))?;
            let height = point.z - ground - radius_m;
            if height < 0.0 {
                bail!("{name} {i} is {:.2} m above the ground, less than the vehicle's radius", point.z - ground);
            }
            Ok(height)
        };
        let mut tasks = Vec::new();
        for (i, vehicle) in scenario.vehicles.iter().enumerate() {
            tasks.push(VehicleTask {
                id: vehicle.id,
                required_clearance_m: required(vehicle.radius_m),
                climb_m: height("start of vehicle", i + 1, &vehicle.start, vehicle.radius_m)?,
                goal: vehicle.goal,
            });
        }
        let largest = radii().fold(0.0, f32::max);
        let goals = scenario.mission.goals.iter().enumerate();
        let descents_m: Vec<f32> =
            goals.map(|(i, goal)| height("goal", i, goal, largest)).collect::<anyhow::Result<_>>()?;
        let safety_m = scenario.deconfliction.safety_distance_m;
        let schedule = ScheduleConfig {
            separation_m: safety_m + STRAY_M,
            parked_separation_m: safety_m + STRAY_BESIDE_PARKED_M,
            cruise_mps: scenario.mission.cruise_mps,
            vertical_mps: VERTICAL_MPS,
        };
        Ok(Self { scenario, map, roadmap, roadmap_file, tasks, descents_m, schedule, timing })
    }

    /// Plans the whole swarm as every companion does.
    pub fn plan(&mut self) -> anyhow::Result<Box<SwarmPlan>> {
        let begun = Instant::now();
        let view = self.view();
        let request = PlanRequest {
            vehicles: &self.tasks,
            descents_m: &self.descents_m,
            mode: self.scenario.mission.planner_mode(),
            schedule: self.schedule,
        };
        let mut workspace = Box::new(PlanWorkspace::new());
        let mut plan = Box::new(SwarmPlan::new());
        plan::plan_swarm(&view, &request, &mut workspace, &mut plan).map_err(|e| describe(&e))?;
        self.timing.plan_s = begun.elapsed().as_secs_f64();
        Ok(plan)
    }

    /// One companion's part of the swarm's plan.
    pub fn own_plan(&self, plan: &SwarmPlan, index: usize) -> Result<Box<OwnPlan>, ScheduleError> {
        let mut workspace = Default::default();
        let mut own = Box::new(OwnPlan::default());
        plan::vehicle_plan(plan, index, &self.schedule, &mut workspace, &mut own)?;
        Ok(own)
    }

    /// The roadmap as a board reads it.
    pub fn view(&self) -> RoadmapView<'_> {
        RoadmapView::parse(&self.roadmap_file).expect("we wrote it ourselves")
    }

    /// Its size.
    pub fn roadmap_size(&self) -> RoadmapSize {
        RoadmapSize {
            nodes: self.roadmap.nodes.len(),
            edges: self.roadmap.edges.len(),
            bytes: self.roadmap_file.len(),
        }
    }

    /// How vehicles keep apart.
    pub fn deconfliction(&self) -> DeconflictConfig {
        DeconflictConfig {
            method: self.scenario.deconfliction.method,
            safety_distance_m: self.scenario.deconfliction.safety_distance_m,
            cruise_mps: self.scenario.mission.cruise_mps,
            accel_mps2: ACCEL_MPS2,
        }
    }
}

fn describe(error: &PlanError) -> anyhow::Error {
    match error {
        PlanError::Schedule(id, ScheduleError::Blocked) => {
            anyhow!("vehicle {id} cannot pass the others: move its start or goal out of their way")
        }
        PlanError::Search(id, error) => anyhow!("no search for vehicle {id}: {error:?}"),
        other => anyhow!("no plan: {other:?}"),
    }
}
