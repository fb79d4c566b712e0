//! A coverage mission as companions fly it: the ground as a map, the mission file, and the plan
//! that all companions compute from it.

use std::iter;

use anyhow::{Context, anyhow, bail};
use companion::margins::CRUISE_TRACKING_ERROR_M;
use companion::planner::coverage::{self, Error, Request};
use companion::storage::mission_file::coverage::{
    CoverageBlock, CoverageHeader, CoverageView, PartEligibility, UnevenGround, VehicleShare,
};
use companion::storage::mission_file::{MissionBlock, MissionKind};
use companion::swarm::fleet::VehicleDivisionInput;
use planner_core::Point;
use planner_core::coverage::area::Area;
use planner_core::coverage::flights::{MAX_PATH_LENGTH_M, PLANNED_ACCEL_MPS2};
use planner_core::coverage::pack::{Route, TrackUnit};
use planner_core::coverage::transit::TransitGraph;
use planner_core::flight::{PathError, WaypointRange};
use planner_core::map::field::FieldView;
use planner_core::plan::{PlanError, VehicleTask};
use planner_core::schedule::ScheduleError;

use super::planner::HostAreaWorkspace;
use super::ready::{HostPlan, PreparedMission, schedule_config};
use crate::area::MAX_VERTICES;
use crate::capacity::{
    BOARD_NO_FLY_CORNERS, BoardCapacity, MAX_GATES, MAX_VEHICLES, MAX_WAYPOINTS, on_heap,
};
use crate::coverage::sorties::{self, USABLE_CHARGE};
use crate::coverage::{CoveragePlan, MAX_AREA_VEHICLES, MAX_LANES, MAX_NO_FLY_CORNERS};
use crate::scenario::coverage::{CoverageMethod, Terrain};
use crate::scenario::{self, AutopilotKind, Scenario};
use crate::{map, margins};

/// Climb from the pad after which a vehicle flies its path, and descent at the path's end, metres;
/// less where the pictures are taken lower above the ground.
const TAKEOFF_HEIGHT_M: f32 = 3.0;
/// Distance by which the map extends beyond area and pads, and above the highest layer, metres.
const MAP_MARGIN_M: f32 = 30.0;

/// Prepares a coverage mission: checks that companions can fly it, and encodes its files.
pub(super) fn prepare(
    mut scenario: Scenario,
    board: Option<&'static BoardCapacity>,
) -> anyhow::Result<PreparedMission> {
    let planned = CoveragePlan::plan_as_companions(&scenario)?;
    let Some(shares) = planned.binpat_shares.clone() else {
        bail!(
            "cannot be flown: {}: companions give parts to vehicles by the least sum of their ways, and those of method \"exact\" would then \
             take longer\nhint: `cover` writes its plans, which autopilots fly without a companion; \"powell-binpat\" can be flown",
            scenario.path
        );
    };
    let map = ground_map(&planned)?;
    let routes = planned.plan.clone();
    let shares_with_speeds: Vec<VehicleShare> = planned
        .vehicles
        .iter()
        .zip(&shares)
        .map(|(v, &weight)| VehicleShare {
            weight,
            climb_mps: v.climb_mps,
            descend_mps: v.descend_mps,
        })
        .collect();
    check_batteries(&planned)?;
    check_ground_clearance(&planned)?;
    let top_m = TAKEOFF_HEIGHT_M.min(min_picture_above_ground_m(planned.area_settings));
    drop(planned);
    for vehicle in &mut scenario.vehicles {
        vehicle.start.z += vehicle.radius_m + top_m;
    }
    // In a coverage mission vehicles have to keep clear only of each other: each may deviate from
    // its path by half of what the separation leaves beyond the safety distance.
    let margin_m = scenario.deconfliction.separation_m - scenario.deconfliction.safety_distance_m;
    let tasks = scenario
        .vehicles
        .iter()
        .map(|v| VehicleTask {
            id: v.id,
            required_clearance_m: v.radius_m + margin_m / 2.0,
            climb_m: top_m,
            goal: None,
        })
        .collect();
    let mut schedule = schedule_config(&scenario);
    schedule.vertical_mps =
        shares_with_speeds.iter().map(|s| s.climb_mps.min(s.descend_mps)).fold(f32::MAX, f32::min);
    let voxels = map.to_voxel_map(map::UnknownSpace::Free);
    let mut mission = PreparedMission::new(scenario, voxels, tasks, schedule, board);
    if let Some(terrain) = mission.scenario.area.as_ref().and_then(|area| area.terrain.as_ref()) {
        mission.roadmap_or_field_file = terrain.field_file.to_vec();
    }
    mission.encode_area_mission(&shares_with_speeds)?;
    let mut ws = on_heap(HostAreaWorkspace::new);
    let plan = mission.plan_area(&[], iter::empty(), &mut ws)?;
    if ws.area.routes() != &routes {
        bail!(
            "cannot be flown: {}: companions would divide the area in another way\nhint: please report it, with the scenario",
            mission.scenario.path
        );
    }
    mission.check_division_count(&plan)?;
    Ok(mission)
}

/// Time in which a vehicle settles at its setpoint after a stop from this speed, seconds, as
/// simulated flights over level lanes of 100 to 400 m take: PX4 overshoots and creeps back.
fn settling_s(autopilot: AutopilotKind, speed_mps: f32) -> f32 {
    let (at_once_mps, s_per_mps) = match autopilot {
        AutopilotKind::Px4 => (4.0, 2.0),
        AutopilotKind::ArduPilot => (8.0, 0.8),
    };
    (s_per_mps * (speed_mps - at_once_mps)).clamp(0.0, MAX_SETTLING_S)
}

/// Greatest value of [`settling_s`].
const MAX_SETTLING_S: f32 = 8.5;

/// Time of a route flown by a companion, seconds, without waiting at gates: as
/// [`sorties::route_duration_s`], and after each lane and each step to the next one the vehicle
/// settles.
pub fn flight_by_companion_s(planned: &CoveragePlan<'_>, route: &Route) -> f32 {
    let index = usize::from(route.vehicle_index);
    let (cruise_mps, autopilot) =
        (planned.vehicles[index].cruise_mps, planned.scenario.vehicles[index].autopilot);
    // A leg from rest to rest may be too short to reach cruise speed.
    let after_leg_s = |length_m: f32| {
        settling_s(autopilot, cruise_mps.min((PLANNED_ACCEL_MPS2 * length_m).sqrt()))
    };
    let [first, last] = [route.lowest_waypoint, route.waypoint_end - 1]
        .map(|number| planned.tracks.lane_of(number));
    let step_s = after_leg_s(planned.area_settings.spacing.max_lane_spacing_m);
    let lanes = &planned.tracks.lanes()[first..=last];
    let settling_s: f32 = lanes.iter().map(|lane| after_leg_s(lane.length_m()) + step_s).sum();
    sorties::route_duration_s(planned, route) + settling_s + 2.0 * after_leg_s(f32::INFINITY)
}

/// Share of its battery charge that the plan of a vehicle may need: 7 % less than
/// [`USABLE_CHARGE`], since flights take up to that much longer, most where they are divided into
/// stretches.
const MAX_PLANNED_CHARGE: f32 = 0.93 * USABLE_CHARGE;

/// Refuses a route that would use more than the usable share of the vehicle's simulated battery:
/// companions fly a route without a battery swap.
fn check_batteries(planned: &CoveragePlan<'_>) -> anyhow::Result<()> {
    for route in &planned.plan.routes {
        let index = usize::from(route.vehicle_index);
        let vehicle = &planned.scenario.vehicles[index];
        let cruise_mps = planned.vehicles[index].cruise_mps;
        let beyond_hover = sorties::power_ratio_at_speed(cruise_mps) - 1.0;
        let takes_s = flight_by_companion_s(planned, route)
            + beyond_hover * route.ground_length_m / cruise_mps;
        let lasts_s = vehicle.battery_hover_s();
        if takes_s > MAX_PLANNED_CHARGE * lasts_s {
            let hint = match planned.area_settings.allows_battery_swaps {
                true => {
                    "`cover` writes a plan for each sortie, which autopilots fly without a companion"
                }
                false => {
                    "endurance_s says how long a battery lasts, area.batteries = true has `cover` plan sorties"
                }
            };
            bail!(
                "area too large: {}: vehicle {} would need the charge of {:.0} s in a hover; its battery lasts {lasts_s:.0} s, \
                 and {:.0} % of that are kept for delays and the landing\nhint: more vehicles, wider lanes, a higher cruise_mps and speed_max_mps take less time; {hint}",
                planned.scenario.vehicle_file_lines[index],
                vehicle.id,
                takes_s,
                100.0 * (1.0 - MAX_PLANNED_CHARGE)
            );
        }
    }
    Ok(())
}

/// Refuses pictures so low that a vehicle whose estimate is too high by the greatest error could
/// touch the ground.
fn check_ground_clearance(planned: &CoveragePlan<'_>) -> anyhow::Result<()> {
    let height_m = min_picture_above_ground_m(planned.area_settings);
    for vehicle in &planned.scenario.vehicles {
        let lower_m =
            margins::max_height_error_m(planned.scenario.simulation.estimator, vehicle.autopilot);
        let least_m = lower_m + vehicle.radius_m + CRUISE_TRACKING_ERROR_M;
        if height_m < least_m {
            bail!(
                "pictures too low: {}: at {height_m:.2} m vehicle {} may touch the ground, {least_m:.2} m are needed\nhint: \
                 its estimate may be {lower_m:.2} m too high, and it strays by \
                 {CRUISE_TRACKING_ERROR_M} m",
                planned.area_settings.file_line,
                vehicle.id
            );
        }
    }
    Ok(())
}

/// The scenario's method of dividing the area among vehicles; the default one without an area.
pub fn division_method(scenario: &Scenario) -> CoverageMethod {
    scenario.area.as_ref().map(|area| area.method).unwrap_or_default()
}

/// The terrain settings of the mission file: height above ground, tolerance, lowest and highest
/// ground.
fn ground_settings(
    area: &scenario::coverage::AreaSection,
    terrain: &Terrain,
) -> anyhow::Result<UnevenGround> {
    let [low_m, high_m] = ground_height_range_m(terrain)?;
    Ok(UnevenGround {
        min_height_above_ground_m: area.picture_height_m,
        height_tolerance_m: terrain.tolerance_m,
        low_m,
        high_m,
    })
}

/// Least height of the pictures above the ground, metres.
fn min_picture_above_ground_m(area: &scenario::coverage::AreaSection) -> f32 {
    if area.terrain.is_some() { area.picture_height_m } else { area.heights.max_picture_height_m }
}

/// The lowest and the highest ground of a terrain, metres above the origin. The highest is limited
/// to that of the field which paths follow.
fn ground_height_range_m(terrain: &Terrain) -> anyhow::Result<[f32; 2]> {
    let field =
        FieldView::parse(&terrain.field_file).map_err(|error| anyhow!("no field: {error}"))?;
    let [low_m, high_m] = terrain.grid.height_range_m().context("no ground")?;
    Ok([low_m, high_m.min(field.highest_m())])
}

/// A map of level ground below area and pads. Over terrain its ground is at the terrain's lowest
/// height; the real heights are then in the terrain's grid.
fn ground_map(planned: &CoveragePlan<'_>) -> anyhow::Result<map::OccupancyMap> {
    let places = planned
        .area_settings
        .vertices
        .iter()
        .chain(planned.vehicles.iter().map(|v| &v.transit_start));
    let (mut low, mut high) = (Point::repeat(f32::INFINITY), Point::repeat(f32::NEG_INFINITY));
    for place in places {
        let place = Point::new(place.x, place.y, 0.0);
        (low, high) = (low.inf(&place), high.sup(&place));
    }
    let heights = planned.area_settings.heights;
    high.z = heights.max_picture_height_m
        + heights.layer_spacing_m * (planned.vehicles.len() + 1) as f32;
    let around = Point::new(MAP_MARGIN_M, MAP_MARGIN_M, 0.0);
    high.z += MAP_MARGIN_M;
    if let Some(terrain) = &planned.area_settings.terrain {
        low.z = ground_height_range_m(terrain)?[0];
    }
    let cell_m = planned.scenario.map.resolution_m;
    Ok(map::level_ground_map(&(low - around), &(high + around), cell_m)?)
}

impl PreparedMission {
    /// Encodes the mission file of an area, with each vehicle's weight in the division and its
    /// climb and descent speeds. Lanes are not in it: the companions plan them.
    fn encode_area_mission(&mut self, shares: &[VehicleShare]) -> anyhow::Result<()> {
        let Some(area) = &self.scenario.area else { return Ok(()) };
        let parts = match division_method(&self.scenario) {
            CoverageMethod::PowellBinpat | CoverageMethod::Exact => PartEligibility::Anyone,
            CoverageMethod::SimpleBinpat | CoverageMethod::Binpat => {
                let alike = shares.iter().all(|share| share.weight == shares[0].weight);
                if alike { PartEligibility::Anyone } else { PartEligibility::SameWeight }
            }
        };
        let header = CoverageHeader {
            assignment_unit: match area.method {
                CoverageMethod::SimpleBinpat => TrackUnit::Lane,
                _ => TrackUnit::Waypoint,
            },
            part_eligibility: parts,
            heading_rule: area.heading,
            trigger: area.trigger,
            search_steps: coverage::BOARD_SEARCH_STEPS,
            heights: area.heights,
            spacing: area.usable_spacing,
            lane_angle_deg: area.lane_angle_deg,
            border_overshoot_m: area.border_overshoot_m,
            ground: area
                .terrain
                .as_ref()
                .map(|terrain| ground_settings(area, terrain))
                .transpose()?,
        };
        let (rings, vertices) = (&area.rings[..], &area.vertices[..]);
        let block = MissionBlock::Coverage(CoverageBlock { header, shares, rings, vertices });
        self.mission_file = self.encode(&block)?;
        Ok(())
    }

    /// Plans the flights of all vehicles as every companion does, without the waypoints `done`,
    /// after `divisions`, each with one input per vehicle; `ws` keeps the lanes and routes.
    fn plan_area<'l>(
        &self,
        done: &[WaypointRange],
        divisions: impl Iterator<Item = &'l [VehicleDivisionInput]> + Clone,
        ws: &mut HostAreaWorkspace,
    ) -> anyhow::Result<Box<HostPlan>> {
        let mission = self.mission_view();
        let MissionKind::Coverage(view) = mission.kind() else {
            bail!("no area: {}", self.scenario.path)
        };
        let mut plan = on_heap(HostPlan::new);
        coverage::plan_flights::<
            MAX_VERTICES,
            MAX_LANES,
            MAX_AREA_VEHICLES,
            MAX_NO_FLY_CORNERS,
            MAX_VEHICLES,
            MAX_WAYPOINTS,
        >(
            &Request {
                mission: &mission,
                view,
                field: self.height_field(),
                max_gates: self.max_gates(),
                photographed: done,
            },
            divisions,
            &mut ws.area,
            &mut ws.schedule,
            &mut plan,
        )
        .map_err(|error| self.explain_error(&error))?;
        Ok(plan)
    }

    /// The field of heights that paths follow over terrain, parsed as on a board; `None` over level
    /// ground.
    fn height_field(&self) -> Option<FieldView<'_>> {
        FieldView::parse(&self.roadmap_or_field_file).ok()
    }

    /// Plans the coverage mission from its start, with nothing photographed.
    pub(super) fn plan_coverage(&self) -> anyhow::Result<Box<HostPlan>> {
        self.plan_area(&[], iter::empty(), &mut on_heap(HostAreaWorkspace::new))
    }

    /// Plans what is left: without the waypoints `done`, and after `divisions`, each of which
    /// is one [`VehicleDivisionInput`] per vehicle.
    ///
    /// # Errors
    /// No plan was found; the error says why.
    pub fn plan_remaining<'l>(
        &self,
        done: &[WaypointRange],
        divisions: impl Iterator<Item = &'l [VehicleDivisionInput]> + Clone,
    ) -> anyhow::Result<Box<HostPlan>> {
        self.plan_area(done, divisions, &mut on_heap(HostAreaWorkspace::new))
    }

    /// Text about the first capacity of a board that the area exceeds; `None` if the board holds
    /// it.
    pub(super) fn area_excess(
        &self,
        view: &CoverageView<'_>,
        board: &BoardCapacity,
    ) -> Option<String> {
        let (vertices, rings): (Vec<_>, Vec<_>) =
            (view.vertices().collect(), view.rings().collect());
        let zones = Area::new(&vertices, &rings)
            .map(|area| TransitGraph::<BOARD_NO_FLY_CORNERS>::empty().set_area(area));
        if matches!(zones, Ok(Err(_))) {
            return Some(format!(
                "more convex corners of no-fly zones, {} holds {BOARD_NO_FLY_CORNERS}",
                board.name
            ));
        }
        let mut ws = on_heap(HostAreaWorkspace::new);
        match self.plan_area(&[], iter::empty(), &mut ws) {
            Ok(_) => board.area_excess(vertices.len(), ws.area.tracks().lanes().len()),
            Err(error) => Some(format!("{error:#}")),
        }
    }

    /// The error for the user.
    fn explain_error(&self, error: &Error) -> anyhow::Error {
        let path = &self.scenario.path;
        match error {
            Error::Plan(PlanError::Path(id, PathError::PathFull)) => anyhow!(
                "the route of vehicle {id} has too many corners: {path}: not one lane fits into a path of {MAX_WAYPOINTS} \
                 waypoints\nhint: no-fly zones with fewer corners{}",
                if self.roadmap_or_field_file.is_empty() {
                    ""
                } else {
                    ", or a larger area.terrain_tolerance_m"
                }
            ),
            Error::Plan(PlanError::Path(id, PathError::TooLong)) => anyhow!(
                "the route of vehicle {id} is too long: {path}: a flight there, along one lane and home takes more than \
                 {MAX_PATH_LENGTH_M} m\nhint: pads nearer to the area, or lanes at another angle_deg"
            ),
            Error::Plan(PlanError::Schedule(id, ScheduleError::Blocked)) => anyhow!(
                "vehicle {id} cannot pass the others: {path}: no departure keeps it apart from them\nhint: pads further \
                 apart, or a smaller deconfliction.separation_m"
            ),
            Error::Plan(PlanError::Schedule(id, ScheduleError::GatesFull)) => {
                anyhow!(
                    "vehicle {id} meets too many others: {path}: its plan holds at most {MAX_GATES} gates"
                )
            }
            other => anyhow!("no plan: {path}: {other}"),
        }
    }
}
