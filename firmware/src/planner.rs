//! The planner on board: makes the plans that the companion requests. These are the vehicle's part
//! of the swarm's plan, from the roadmap and mission file in flash, and a detour around keep-out
//! zones.

use companion::planner::coverage::{self, Request};
use companion::storage::mission_file::coverage::CoverageView;
use companion::storage::mission_file::{MissionKind, MissionView};
use companion::swarm::fleet::{DivisionInputs, MAX_DIVISIONS};
use companion::{MAX_PHOTOGRAPHED_RANGES, PlanFailure, PlanKind, planner};
use heapless::Vec;
use planner_core::detour::{self, DetourRequest, KeepOutZone};
use planner_core::flight::{VehiclePlan, WaypointRange};
use planner_core::map::field::FieldView;
use planner_core::plan::{self, SwarmPlan};
use planner_core::roadmap::RoadmapView;

use crate::boards;
use crate::capacity::BoardCompanion;
use crate::capacity::{AREA_VERTICES, GATES, LANES, NO_FLY_CORNERS, VEHICLES, WAYPOINTS};
use crate::crash_record::FileWork;
use crate::workspace::WorkspaceOverlay;

/// Most keep-out zones of a detour. A vehicle that fell silent may make a dozen zones, any other
/// vehicle makes one or two. With more zones than these the request fails
/// ([`PlanFailure::Capacity`]): a detour that ignored some zones would not be safe.
const MAX_ZONES: usize = 4 * VEHICLES;

/// Memory that the planner works in; the three parts lie in different RAMs of the chip.
pub struct PlanningMemory<'a> {
    /// Workspace of searches and of coverage planning.
    pub workspace: &'a mut WorkspaceOverlay,
    /// Plan of the whole swarm.
    pub swarm: &'a mut SwarmPlan<VEHICLES, WAYPOINTS>,
    /// Plan of this vehicle, and inputs of it.
    pub own: &'a mut OwnPlanMemory,
}

/// This vehicle's plan, and the inputs that the companion gives for it.
pub struct OwnPlanMemory {
    plan: VehiclePlan<WAYPOINTS, GATES>,
    obstacles: Vec<KeepOutZone, MAX_ZONES>,
    /// Whether a keep-out zone had no room in `obstacles`.
    too_many_zones: bool,
    done: Vec<WaypointRange, MAX_PHOTOGRAPHED_RANGES>,
    losses: Vec<DivisionInputs<VEHICLES>, MAX_DIVISIONS>,
    nodes: Vec<u16, WAYPOINTS>,
}

impl OwnPlanMemory {
    /// Empty; its bytes are all zeros, so a static of it lies in .bss and takes no flash.
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

/// Makes one vehicle's plans from a mission and the roadmap or field it needs; without them every
/// request fails.
pub struct Planner<'a> {
    /// Roadmap in flash on which routes are searched.
    pub roadmap: Option<RoadmapView<'a>>,
    /// Height field that a coverage mission's flights keep above.
    pub field: Option<FieldView<'a>>,
    /// Mission to plan.
    pub mission: Option<MissionView<'a>>,
    /// System id of this vehicle.
    pub system_id: u8,
    /// Checksum of mission and roadmap (or field), by which the crash record names them.
    pub files_checksum: u32,
    /// Memory that the planner works in.
    pub memory: PlanningMemory<'a>,
}

impl Planner<'_> {
    /// Copies the inputs of the requested plan from the companion: photographed waypoints, lost
    /// vehicles for a division, keep-out zones for a detour. Returns the detour's start and goal;
    /// `None` for any other plan, or if the companion no longer wants a detour.
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
        // Cannot overflow: it has the capacity of the companion's list.
        let _ = done.extend_from_slice(companion.excluded_waypoints());
        if wanted == PlanKind::Division {
            // Cannot overflow: it has room for the divisions that the companion keeps and for the
            // one in progress.
            companion
                .division_inputs()
                .for_each(|lots| _ = losses.push(lots.iter().copied().collect()));
        }
        if wanted != PlanKind::Detour {
            return None;
        }
        companion.detour_request(|obstacle| *crowded |= obstacles.push(obstacle).is_err())
    }

    /// Makes the requested plan; refuses files whose planning crashed three starts in a row.
    ///
    /// # Errors
    /// [`PlanFailure`]: the reason why there is no plan.
    pub fn answer(
        &mut self,
        wanted: PlanKind,
        detour: Option<&DetourRequest>,
    ) -> Result<&VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
        if wanted == PlanKind::Detour && detour.is_none() {
            return Err(PlanFailure::Unreachable);
        }
        if !boards::begin_work(FileWork::Plan, self.files_checksum) {
            return Err(PlanFailure::Invalid);
        }
        let outcome = self.plan(detour);
        boards::finish_work();
        outcome
    }

    /// Not inlined, so that a debugger finds the symbol.
    #[inline(never)]
    fn plan(
        &mut self,
        detour: Option<&DetourRequest>,
    ) -> Result<&VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
        let Some(mission) = &self.mission else { return Err(PlanFailure::RoadmapUnusable) };
        let index = mission.index_of(self.system_id).ok_or(PlanFailure::Invalid)?;
        let schedule = &mission.header().schedule;
        if let MissionKind::Coverage(area) = mission.kind() {
            return match detour {
                Some(request) => plan_area_detour(area, self.field, request, &mut self.memory),
                None => plan_area(mission, self.field, index, &mut self.memory),
            };
        }
        let Some(roadmap) = &self.roadmap else { return Err(PlanFailure::RoadmapUnusable) };
        let PlanningMemory { workspace, swarm, own } = &mut self.memory;
        let ws = workspace.planner();
        if let Some(request) = detour {
            if own.too_many_zones {
                return Err(PlanFailure::Capacity);
            }
            detour::plan_detour_for_vehicle(
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

/// Plans a detour of a coverage mission: home above the area, or out of another vehicle's column.
/// Not inlined, for the reason at [`plan_area`].
#[inline(never)]
fn plan_area_detour<'m>(
    area: &CoverageView<'_>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    memory: &'m mut PlanningMemory<'_>,
) -> Result<&'m VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
    let PlanningMemory { workspace, own, .. } = memory;
    if own.too_many_zones {
        return Err(PlanFailure::Capacity);
    }
    let ws = &mut workspace.coverage_plan().area;
    coverage::plan_detour::<AREA_VERTICES, LANES, VEHICLES, NO_FLY_CORNERS, WAYPOINTS, GATES>(
        area,
        field,
        request,
        &mut own.obstacles,
        ws,
        &mut own.plan,
    )?;
    Ok(&own.plan)
}

/// Plans a coverage mission and takes vehicle `index`'s flight from it. Not inlined, so that its
/// stack frame is not added to that of roadmap plans.
#[inline(never)]
fn plan_area<'m>(
    mission: &MissionView<'_>,
    field: Option<FieldView<'_>>,
    index: usize,
    memory: &'m mut PlanningMemory<'_>,
) -> Result<&'m VehiclePlan<WAYPOINTS, GATES>, PlanFailure> {
    let MissionKind::Coverage(view) = mission.kind() else { return Err(PlanFailure::Invalid) };
    let PlanningMemory { workspace, swarm, own } = memory;
    let ws = workspace.coverage_plan();
    coverage::plan_flights::<AREA_VERTICES, LANES, VEHICLES, NO_FLY_CORNERS, VEHICLES, WAYPOINTS>(
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
