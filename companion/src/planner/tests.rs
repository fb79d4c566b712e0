//! The answer to each kind of request, and the reason where there is no plan.

extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec as List;

use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::area::{Ring, RingKind};
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::pack::{Heights, TrackUnit};
use planner_core::detour::{DetourGoal, KeepOutZone, ZoneKind};
use planner_core::flight::{Task, Trigger, WaypointRange};
use planner_core::geo::frames::Geodetic;
use planner_core::plan::{GoalMode, Objective, VehicleTask};
use planner_core::roadmap::{self, Edge, RoadmapHeader};
use planner_core::track::deconflict::Method;

use super::*;
use crate::storage::mission_file::coverage::{
    CoverageBlock, CoverageHeader, HeadingRule, PartEligibility, UnevenGround, VehicleShare,
};
use crate::storage::mission_file::{
    self, MissionBlock, MissionGoal, MissionHeader, MissionVehicle,
};
use crate::swarm::fleet::VehicleDivisionInput;

const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
/// Beginnings of both vehicles' paths, ENU metres.
const STARTS: [Point; 2] = [Point::new(0.0, 0.0, 2.0), Point::new(0.0, 8.0, 2.0)];
/// Goals, ENU metres.
const GOALS: [Point; 2] = [Point::new(20.0, 0.0, 2.0), Point::new(20.0, 8.0, 2.0)];
/// A node of the roadmap on the way around what lies between the first start and the first goal.
const BESIDE: Point = Point::new(10.0, 4.0, 2.0);
/// Most gates.
const G: usize = 16;
/// Most keep-out zones.
const Z: usize = 2;

/// Workspaces for 8 nodes, 4 vehicles, 64 timed segments, 64 vertices, 128 lanes, 16 corners.
#[derive(Default)]
struct Workspaces {
    goals: PlanWorkspace<8, 4, 64>,
    area: AreaWorkspace<64, 128, 4, 16>,
}

impl LendWorkspace<8, 4, 64, 64, 128, 4, 16> for Workspaces {
    fn for_goals(&mut self) -> &mut PlanWorkspace<8, 4, 64> {
        &mut self.goals
    }

    fn for_area(&mut self) -> &mut AreaWorkspace<64, 128, 4, 16> {
        &mut self.area
    }
}

/// A planner's files and memory.
#[derive(Default)]
struct Bench {
    mission: List<u8>,
    roadmap: List<u8>,
    workspaces: Workspaces,
    swarm: SwarmPlan<4, 64>,
    own: OwnPlanMemory<4, 64, G, Z>,
}

impl Bench {
    fn answer(
        &mut self,
        system_id: u8,
        requested: &RequestedPlan,
    ) -> Result<&VehiclePlan<64, G>, PlanFailure> {
        let files = PlanFiles {
            mission: MissionView::parse(&self.mission).ok(),
            roadmap: RoadmapView::parse(&self.roadmap).ok(),
            field: None,
        };
        let memory = PlanningMemory::new(&mut self.workspaces, &mut self.swarm, &mut self.own);
        let mut memory = Box::new(memory);
        answer_plan_request(&files, system_id, requested, &mut memory)?;
        Ok(&self.own.plan)
    }

    fn failure(&mut self, system_id: u8, requested: &RequestedPlan) -> Option<PlanFailure> {
        self.answer(system_id, requested).err()
    }
}

/// A mission of vehicles 3 and 7 with this block.
fn mission(mode: GoalMode, roadmap_crc: u32, block: &MissionBlock<'_>) -> List<u8> {
    let header = MissionHeader {
        roadmap_crc,
        mode,
        method: Method::Priority,
        origin: ORIGIN,
        cruise_mps: 5.0,
        schedule: ScheduleConfig {
            separation_m: 2.0,
            parked_separation_m: 1.75,
            cruise_mps: 4.5,
            vertical_mps: 1.0,
        },
        safety_distance_m: 1.5,
        geofence: None,
        ground_stations: [255, 0, 0, 0],
    };
    let vehicles = [(3, STARTS[0]), (7, STARTS[1])].map(|(id, start)| MissionVehicle {
        task: VehicleTask { id, required_clearance_m: 0.8, climb_m: 1.7, goal: None },
        path_start: start,
        radius_m: 0.3,
        speed_max_mps: 5.0,
    });
    let mut out = vec![0; block.file_len(vehicles.len())];
    mission_file::write_mission(&header, &vehicles, block, &mut out).unwrap();
    out
}

/// A mission with goals, and its roadmap: from each start an edge leads to the goal opposite, and
/// one to the node `BESIDE`, which has edges to both goals.
fn with_goals() -> Box<Bench> {
    let header = RoadmapHeader {
        origin: ORIGIN,
        edge_min_m: 0.5,
        edge_max_m: 30.0,
        tested_clearance_m: 0.8,
        max_clearance_m: 10.0,
        start_count: 2,
        goal_count: 2,
    };
    let nodes = [STARTS[0], STARTS[1], GOALS[0], GOALS[1], BESIDE];
    let edges = [(0, 2), (1, 3), (0, 4), (1, 4), (2, 4), (3, 4)].map(|(a, b)| Edge {
        a,
        b,
        clearance_m: 2.0,
    });
    let mut roadmap = vec![0; roadmap::encoded_len(nodes.len(), edges.len(), 0).unwrap()];
    roadmap::write(&header, &nodes, &edges, &mut roadmap).unwrap();
    let crc = RoadmapView::parse(&roadmap).unwrap().crc();
    let goals = GOALS.map(|position| MissionGoal { position, descent_m: 1.7 });
    let mode = GoalMode::Unlabelled(Objective::TotalDistance);
    let mission = mission(mode, crc, &MissionBlock::Goals(&goals));
    Box::new(Bench { mission, roadmap, ..Bench::default() })
}

/// A mission over an area of 100 × 60 m, without a roadmap.
fn over_area(ground: Option<UnevenGround>) -> Box<Bench> {
    let header = CoverageHeader {
        assignment_unit: TrackUnit::Waypoint,
        part_eligibility: PartEligibility::Anyone,
        heading_rule: HeadingRule::SameOnAllLanes,
        trigger: Trigger::Distance,
        search_steps: 2000,
        heights: Heights { max_picture_height_m: 25.0, layer_spacing_m: 5.0 },
        spacing: Spacing {
            footprint: Footprint { along_m: 20.0, across_m: 30.0 },
            max_lane_spacing_m: 12.0,
            max_waypoint_spacing_m: 8.0,
        },
        lane_angle_deg: None,
        border_overshoot_m: 0.0,
        ground,
    };
    let vertices = [(0.0, 10.0), (100.0, 10.0), (100.0, 70.0), (0.0, 70.0)];
    let vertices = vertices.map(|(x, y)| Flat::new(x, y));
    let rings = [Ring { end: 4, kind: RingKind::Outer }];
    let shares = [VehicleShare { weight: 1.0, climb_mps: 3.0, descend_mps: 1.0 }; 2];
    let parts = CoverageBlock { header, shares: &shares, rings: &rings, vertices: &vertices };
    let mission = mission(GoalMode::Labelled, 0, &MissionBlock::Coverage(parts));
    Box::new(Bench { mission, ..Bench::default() })
}

/// A request for a detour of vehicle 3 to `goal`, from a place 2 m from its start on the way to its
/// own goal.
fn detour(goal: DetourGoal) -> RequestedPlan {
    RequestedPlan::Detour(DetourRequest {
        land_aside: false,
        here: Point::new(2.0, 0.0, 2.0),
        leg: [GOALS[0], STARTS[0]],
        leg_clearance_m: 2.0,
        goal,
        descent_m: 1.7,
        required_clearance_m: 0.8,
        fence: None,
    })
}

/// A static keep-out zone: a sphere of 1.5 m about this place.
fn zone(place: Point) -> KeepOutZone {
    KeepOutZone { from: place, to: place, radius_m: 1.5, kind: ZoneKind::Static }
}

/// Number of pictures that this plan takes.
fn pictures(plan: &VehiclePlan<64, G>) -> u32 {
    match &plan.task {
        Task::Photograph(photographs) => photographs.planned_count(&plan.path),
        _ => 0,
    }
}

#[test]
fn a_vehicle_gets_its_part_of_the_swarms_plan() {
    for mut bench in [with_goals(), over_area(None)] {
        let own = [3, 7].map(|id| bench.answer(id, &RequestedPlan::Flight).unwrap().clone());
        assert_eq!(own[0].swarm_plan_crc, own[1].swarm_plan_crc);
        assert_eq!([own[0].swarm_plan_crc, own[1].swarm_plan_crc], [bench.swarm.crc; 2]);
        for (own, flight) in own.iter().zip(&bench.swarm.flights) {
            assert!(own.path == flight.path && own.task == flight.task && own.task.leaves_pad());
        }
    }
}

#[test]
fn a_detour_keeps_out_of_the_zones() {
    let mut bench = with_goals();
    let direct = bench.answer(3, &detour(DetourGoal::RoadmapGoal(0))).unwrap().path.length_m();
    assert!((direct - 18.0).abs() < 0.01, "{direct}");
    bench.own.inputs.add_zone(zone(Point::new(10.0, 0.0, 2.0)));
    let around = bench.answer(3, &detour(DetourGoal::RoadmapGoal(0))).unwrap();
    assert!(around.path.waypoints().iter().any(|w| w.position == BESIDE), "{around:?}");
    bench.own.inputs.add_zone(zone(BESIDE));
    assert_eq!(
        bench.failure(3, &detour(DetourGoal::RoadmapGoal(0))),
        Some(PlanFailure::Unreachable)
    );
}

#[test]
fn an_area_is_planned_without_what_is_photographed_and_after_losses() {
    let mut bench = over_area(None);
    let whole = pictures(bench.answer(3, &RequestedPlan::Flight).unwrap());
    bench.own.inputs.add_photographed(&[WaypointRange { first: 0, end: 20 }]);
    let rest = pictures(bench.answer(3, &RequestedPlan::Flight).unwrap());
    assert!(0 < rest && rest < whole, "{rest} of {whole}");
    let lost = [true, false].map(|alive| VehicleDivisionInput { alive, along_dm: 0 });
    bench.own.inputs.add_division(&lost);
    let alone = pictures(bench.answer(3, &RequestedPlan::Flight).unwrap());
    assert!(alone > rest, "{alone}, {rest}");
    bench.own.inputs.clear();
    assert_eq!(pictures(bench.answer(3, &RequestedPlan::Flight).unwrap()), whole);
}

#[test]
fn each_failure_has_its_reason() {
    use PlanFailure::*;
    let home = DetourGoal::Point { end: STARTS[0], layer_z_m: 30.0 };
    let requests = [RequestedPlan::Flight, detour(DetourGoal::RoadmapGoal(0)), detour(home)];
    for requested in &requests {
        let mut nothing = Box::<Bench>::default();
        assert_eq!(nothing.failure(3, requested), Some(RoadmapUnusable), "no mission");
        let mut stranger = with_goals();
        assert_eq!(stranger.failure(4, requested), Some(Invalid), "a vehicle of no mission");
        let mut bench = with_goals();
        bench.roadmap.clear();
        assert_eq!(bench.failure(3, requested), Some(RoadmapUnusable), "no roadmap");
    }
    let mut goals = with_goals();
    assert_eq!(goals.failure(3, &detour(home)), Some(Unreachable), "no such goal");
    let ground = UnevenGround {
        min_height_above_ground_m: 18.0,
        height_tolerance_m: 3.0,
        low_m: 0.0,
        high_m: 4.0,
    };
    let mut no_field = over_area(Some(ground));
    assert_eq!(no_field.failure(3, &RequestedPlan::Flight), Some(RoadmapUnusable));
    for (mut bench, goal) in [(goals, DetourGoal::RoadmapGoal(0)), (over_area(None), home)] {
        let far = Point::new(-50.0, -50.0, 2.0);
        (0..Z).for_each(|_| bench.own.inputs.add_zone(zone(far)));
        assert_eq!(bench.failure(3, &detour(goal)), None);
        bench.own.inputs.add_zone(zone(far));
        assert_eq!(bench.failure(3, &detour(goal)), Some(Capacity), "too many zones");
        assert_eq!(bench.failure(3, &RequestedPlan::Flight), None, "a flight has no zones");
    }
}
