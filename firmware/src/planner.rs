//! What answers a companion on board that asks for a plan: the swarm's from roadmap and mission
//! file as they lie in flash, or a way around what is in its way.

use companion::planner::coverage::{self, Request};
use companion::storage::mission_file::coverage::CoverageView;
use companion::storage::mission_file::{MissionKind, MissionView};
use companion::swarm::fleet::{DivisionInputs, MAX_DIVISIONS};
use companion::{MAX_DONE_RANGES, PlanFailure, PlanKind, planner};
use heapless::Vec;
use planner_core::detour::{self, DetourRequest, KeepOutZone};
use planner_core::field::FieldView;
use planner_core::flight::{VehiclePlan, WaypointRange};
use planner_core::plan::{self, SwarmPlan};
use planner_core::roadmap::RoadmapView;

use crate::boards;
use crate::capacity::BoardCompanion;
use crate::capacity::{AREA_CORNERS, AREA_VERTICES, GATES, LANES, VEHICLES, WAYPOINTS};
use crate::kept::FileWork;
use crate::scratch::WorkspaceOverlay;

/// Most keep-out zones of a detour. A vehicle that fell silent may lie below a dozen places, any
/// other makes one zone or two; with more zones than these there is no detour, not one past a zone
/// that was left out.
const MAX_ZONES: usize = 4 * VEHICLES;

/// Memory for planning beside roadmap and mission: pieces that lie in memories of their own.
pub struct PlanningMemory<'a> {
    /// Workspace of the search.
    pub scratch: &'a mut WorkspaceOverlay,
    /// The swarm's plan.
    pub swarm: &'a mut SwarmPlan<VEHICLES, WAYPOINTS>,
    /// The vehicle's own.
    pub own: &'a mut OwnPlanMemory,
}

/// A vehicle's plan, and what it is made from beside the swarm's.
pub struct OwnPlanMemory {
    plan: VehiclePlan<WAYPOINTS, GATES>,
    obstacles: Vec<KeepOutZone, MAX_ZONES>,
    /// Whether there were more.
    too_many_zones: bool,
    done: Vec<WaypointRange, MAX_DONE_RANGES>,
    losses: Vec<DivisionInputs<VEHICLES>, MAX_DIVISIONS>,
    nodes: Vec<u16, WAYPOINTS>,
}

impl OwnPlanMemory {
    /// All zeros, so a static costs .bss alone.
    pub const fn new() -> Self {
        Self {
            plan: VehiclePlan::new(),
            obstacles: Vec::new(),
            too_many_zones: false,
            done: Vec::new(),
            losses: Vec::new(),
            nodes: Vec::new(),
        }
    }
}

impl Default for OwnPlanMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// A planner over a roadmap or field and a mission that belong together, or over none.
pub struct Planner<'a> {
    /// Roadmap to plan on.
    pub roadmap: Option<RoadmapView<'a>>,
    /// The heights to fly above.
    pub field: Option<FieldView<'a>>,
    /// Mission to plan.
    pub mission: Option<MissionView<'a>>,
    /// System id of the vehicle whose plan it is.
    pub system_id: u8,
    /// A checksum of all.
    pub files: u32,
    /// Memory of the planner.
    pub memory: PlanningMemory<'a>,
}

impl Planner<'_> {
    /// Inputs of the plan that the companion wants: lost vehicles, or keep-out zones of its detour.
    pub fn read_inputs(
        &mut self,
        wanted: PlanKind,
        companion: &mut BoardCompanion,
    ) -> Option<DetourRequest> {
        let OwnPlanMemory { obstacles, too_many_zones: crowded, done, losses, .. } =
            &mut *self.memory.own;
        obstacles.clear();
        done.clear();
        losses.clear();
        *crowded = false;
        // Cannot overflow: as many as the companion keeps.
        let _ = done.extend_from_slice(companion.excluded_waypoints());
        if wanted == PlanKind::Division {
            // Cannot overflow: as many as the companion keeps, and the one under way.
            companion.losses().for_each(|lots| _ = losses.push(lots.iter().copied().collect()));
        }
        if wanted != PlanKind::Detour {
            return None;
        }
        companion.detour_request(|obstacle| *crowded |= obstacles.push(obstacle).is_err())
    }

    /// The plan asked for. Files of which it is known that they bring the board down are not
    /// planned on.
    ///
    /// # Errors
    /// Reason why there is none.
    pub fn answer(
        &mut self,
        wanted: PlanKind,
        detour: Option<&DetourRequest>,
    ) -> Result<&VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
        if wanted == PlanKind::Detour && detour.is_none() {
            return Err(PlanFailure::Unreachable);
        }
        if !boards::begin_work(FileWork::Plan, self.files) {
            return Err(PlanFailure::Invalid);
        }
        let outcome = self.plan(detour);
        boards::finish_work();
        outcome
    }

    /// Kept apart so that a debugger finds it.
    #[inline(never)]
    fn plan(
        &mut self,
        detour: Option<&DetourRequest>,
    ) -> Result<&VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
        let Some(mission) = &self.mission else { return Err(PlanFailure::NoRoadmap) };
        let index = mission.index_of(self.system_id).ok_or(PlanFailure::Invalid)?;
        let schedule = &mission.header().schedule;
        if let MissionKind::Coverage(area) = mission.kind() {
            return match detour {
                Some(request) => plan_area_detour(area, self.field, request, &mut self.memory),
                None => plan_area(mission, self.field, index, &mut self.memory),
            };
        }
        let Some(roadmap) = &self.roadmap else { return Err(PlanFailure::NoRoadmap) };
        let PlanningMemory { scratch, swarm, own } = &mut self.memory;
        let ws = scratch.planner();
        if let Some(request) = detour {
            if own.too_many_zones {
                return Err(PlanFailure::Capacity);
            }
            detour::plan_vehicle_detour(
                roadmap,
                request,
                &mut own.obstacles,
                &mut ws.search,
                &mut own.nodes,
                &mut own.plan,
            )
            .map_err(|_| PlanFailure::Unreachable)?;
            return Ok(&own.plan);
        }
        planner::plan_goals(mission, roadmap, GATES, ws, swarm, |_| {})?;
        plan::vehicle_plan(swarm, index, schedule, &mut ws.schedule, &mut own.plan)
            .map_err(|_| PlanFailure::Capacity)?;
        Ok(&own.plan)
    }
}

/// The way home over the area, or aside. Apart as [`plan_area`].
#[inline(never)]
fn plan_area_detour<'m>(
    area: &CoverageView<'_>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    memory: &'m mut PlanningMemory<'_>,
) -> Result<&'m VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
    let PlanningMemory { scratch, own, .. } = memory;
    if own.too_many_zones {
        return Err(PlanFailure::Capacity);
    }
    let ws = &mut scratch.area().area;
    coverage::plan_detour::<AREA_VERTICES, LANES, VEHICLES, AREA_CORNERS, WAYPOINTS, GATES>(
        area,
        field,
        request,
        &mut own.obstacles,
        ws,
        &mut own.plan,
    )?;
    Ok(&own.plan)
}

/// The plan of a coverage mission. Apart, so that what it has on the stack is not there while
/// others plan.
#[inline(never)]
fn plan_area<'m>(
    mission: &MissionView<'_>,
    field: Option<FieldView<'_>>,
    index: usize,
    memory: &'m mut PlanningMemory<'_>,
) -> Result<&'m VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
    let MissionKind::Coverage(view) = mission.kind() else { return Err(PlanFailure::Invalid) };
    let PlanningMemory { scratch, swarm, own } = memory;
    let ws = scratch.area();
    coverage::plan_flights::<AREA_VERTICES, LANES, VEHICLES, AREA_CORNERS, VEHICLES, WAYPOINTS>(
        &Request { mission, view, field, max_gates: GATES, photographed: &own.done },
        own.losses.iter().map(|lots| &lots[..]),
        &mut ws.area,
        &mut ws.schedule,
        swarm,
    )?;
    plan::vehicle_plan(swarm, index, &mission.header().schedule, &mut ws.schedule, &mut own.plan)
        .map_err(|_| PlanFailure::Capacity)?;
    Ok(&own.plan)
}
