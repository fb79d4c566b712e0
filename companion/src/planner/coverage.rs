//! The planner of coverage missions: from the area in the mission file to the flights of all
//! vehicles (paper CPP §3).

use core::fmt;

use heapless::Vec;
use planner_core::coverage::area::{Area, AreaError, Ring};
use planner_core::coverage::flights::{self, CaptureSettings, FlightInputs, Pad};
use planner_core::coverage::losses::{self, DivisionProblem, VehicleStatus};
use planner_core::coverage::pack::{self, CoverageProblem, PackWorkspace, RoutePlan, Vehicle};
use planner_core::coverage::tracks::{self, LanePattern, Tracks};
use planner_core::coverage::transit::TransitGraph;
use planner_core::coverage::{CoverageError, Flat, around};
use planner_core::detour::{DetourRequest, KeepOutZone};
use planner_core::file::CRC32;
use planner_core::flight::{HeadingMode, PicturePlan, VehiclePlan, WaypointRange};
use planner_core::map::field::FieldView;
use planner_core::map::field::follow::TerrainFollowing;
use planner_core::plan::{PlanError, SwarmPlan};
use planner_core::schedule::ScheduleWorkspace;

use crate::config::PlanFailure;
use crate::storage::mission_file::coverage::{CoverageView, HeadingRule, PartEligibility};
use crate::storage::mission_file::{MissionVehicle, MissionView};
use crate::swarm::fleet::VehicleDivisionInput;

/// Most changes of the lanes' order that companions try when planning (`search_steps`); on a board
/// a few million instructions.
pub const BOARD_SEARCH_STEPS: u32 = 2000;
/// Most rings of an area that a companion plans.
pub const MAX_RINGS: usize = 128;
/// Clearance that every leg in a coverage mission is planned with, metres: there are no walls.
pub(crate) const OPEN_FIELD_CLEARANCE_M: f32 = 10.0;

/// Memory of the planner for areas of at most `X` vertices, `L` lanes and `K` vehicles.
pub struct Workspace<const X: usize, const L: usize, const K: usize> {
    /// Vertices of the area's rings, in the mission frame.
    vertices: Vec<Flat, X>,
    /// Which of `vertices` each ring has.
    rings: Vec<Ring, MAX_RINGS>,
    /// Memory of the lanes' computation.
    lane_workspace: tracks::LaneWorkspace<X>,
    /// The area's lanes.
    tracks: Tracks<L>,
    /// Memory of the division of the lanes among the vehicles.
    pack: PackWorkspace<K>,
    /// The vehicles' routes.
    routes: RoutePlan<K>,
    /// Memory of later divisions.
    losses: losses::LossesWorkspace<L, K>,
    /// Of what the lanes and routes in this memory are.
    planned: PlanFingerprint,
}

/// Identifies the plan that a workspace and the flights planned with it hold: a further division
/// starts from that plan instead of planning the whole area again.
#[derive(Clone, Copy, PartialEq, Eq)]
struct PlanFingerprint {
    /// Number of plans up to this one, the one before take-off included; 0 if there is no plan.
    plan_count: u32,
    /// CRC of the inputs of all these plans.
    inputs_crc: u32,
    /// CRC of the plan's flights.
    plan_crc: u32,
}

impl PlanFingerprint {
    /// No plan yet.
    const NOTHING: Self = Self { plan_count: 0, inputs_crc: 0, plan_crc: 0 };
}

impl<const X: usize, const L: usize, const K: usize> Workspace<X, L, K> {
    /// An empty workspace, all zeros, so that it may live in .bss.
    pub const fn new() -> Self {
        Self {
            vertices: Vec::new(),
            rings: Vec::new(),
            lane_workspace: tracks::LaneWorkspace::new(),
            tracks: Tracks::new(),
            pack: PackWorkspace::new(),
            routes: RoutePlan::new(),
            losses: losses::LossesWorkspace::new(),
            planned: PlanFingerprint::NOTHING,
        }
    }

    /// The lanes of the last plan.
    pub fn tracks(&self) -> &Tracks<L> {
        &self.tracks
    }

    /// The routes of the last plan.
    pub fn routes(&self) -> &RoutePlan<K> {
        &self.routes
    }
}

impl<const X: usize, const L: usize, const K: usize> Default for Workspace<X, L, K> {
    fn default() -> Self {
        Self::new()
    }
}

/// Why there is no coverage plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// The area, or the settings for photographing it, cannot be planned.
    Coverage(CoverageError),
    /// The flights cannot be planned.
    Plan(PlanError),
    /// The mission has uneven ground, and its field of heights is missing or is not the mission's.
    NoField,
}

impl From<CoverageError> for Error {
    fn from(error: CoverageError) -> Self {
        Self::Coverage(error)
    }
}

impl From<PlanError> for Error {
    fn from(error: PlanError) -> Self {
        Self::Plan(error)
    }
}

impl From<losses::LossesError> for Error {
    fn from(error: losses::LossesError) -> Self {
        match error {
            losses::LossesError::Coverage(error) => Self::Coverage(error),
            losses::LossesError::Plan(error) => Self::Plan(error),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Coverage(error) => write!(f, "{error:?}"),
            Self::Plan(error) => write!(f, "{error:?}"),
            Self::NoField => f.write_str("NoField"),
        }
    }
}

impl From<Error> for PlanFailure {
    fn from(error: Error) -> Self {
        match error {
            Error::Plan(error) => error.into(),
            Error::NoField => Self::RoadmapUnusable,
            Error::Coverage(
                CoverageError::Area(AreaError::AreaFull)
                | CoverageError::LanesFull
                | CoverageError::NoFlyFull
                | CoverageError::Vehicles
                | CoverageError::WorkspaceTooSmall,
            ) => Self::Capacity,
            Error::Coverage(CoverageError::Unreachable) => Self::Unreachable,
            Error::Coverage(_) => Self::Invalid,
        }
    }
}

/// Inputs of the packing for vehicle `i`, which takes off from and lands on the same pad.
fn packing_vehicle(
    mission: &MissionView<'_>,
    vehicle: &MissionVehicle,
    view: &CoverageView<'_>,
    i: usize,
) -> Vehicle {
    let place = vehicle.path_start.xy();
    let share = view.shares().nth(i);
    Vehicle {
        transit_start: place,
        home: place,
        cruise_mps: libm::fminf(mission.header().cruise_mps, vehicle.speed_max_mps),
        climb_mps: share.map_or(0.0, |s| s.climb_mps),
        descend_mps: share.map_or(0.0, |s| s.descend_mps),
        // With `Anyone` the weights are sizes of parts, not of vehicles: after a loss each vehicle
        // that flies on gets an equal share.
        weight: match view.header().part_eligibility {
            PartEligibility::SameWeight => share.map_or(0.0, |s| s.weight),
            PartEligibility::Anyone => 1.0,
        },
    }
}

/// Inputs of a coverage plan.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a, 'm> {
    /// The mission.
    pub mission: &'a MissionView<'m>,
    /// The coverage block of the mission.
    pub view: &'a CoverageView<'m>,
    /// The field of heights on this computer, if any; it is used only if its CRC is the mission's
    /// `roadmap_crc`.
    pub field: Option<FieldView<'m>>,
    /// Most gates that one vehicle's plan has room for.
    pub max_gates: usize,
    /// Waypoints that are photographed already, as ranges of their numbers along all lanes.
    pub photographed: &'a [WaypointRange],
}

impl<'m> Request<'_, 'm> {
    /// The surface above uneven ground that lanes follow; `None` for level ground.
    fn terrain_following(
        &self,
        vehicles: &[Vehicle],
    ) -> Result<Option<TerrainFollowing<'m>>, Error> {
        let Some(ground) = &self.view.header().ground else { return Ok(None) };
        let crc = self.mission.header().roadmap_crc;
        let field = self.field.filter(|field| field.crc() == crc).ok_or(Error::NoField)?;
        let steepest =
            vehicles.iter().map(|v| libm::fminf(v.climb_mps, v.descend_mps) / v.cruise_mps);
        let max_slope = steepest.fold(f32::INFINITY, libm::fminf);
        let (height_m, tolerance_m) = (ground.min_height_above_ground_m, ground.height_tolerance_m);
        Ok(Some(TerrainFollowing { field, min_height_m: height_m, tolerance_m, max_slope }))
    }
}

/// The area of a coverage block, its vertices and rings copied into the given memory.
fn read_area<'a, const X: usize>(
    view: &CoverageView<'_>,
    vertices: &'a mut Vec<Flat, X>,
    rings: &'a mut Vec<Ring, MAX_RINGS>,
) -> Result<Area<'a>, CoverageError> {
    vertices.clear();
    rings.clear();
    for vertex in view.vertices() {
        vertices.push(vertex).map_err(|_| CoverageError::Area(AreaError::AreaFull))?;
    }
    for ring in view.rings() {
        rings.push(ring).map_err(|_| CoverageError::Area(AreaError::AreaFull))?;
    }
    Area::new(vertices, rings).map_err(CoverageError::Area)
}

/// Plans one vehicle's detour over the area: its way home, aside, or back to its path. The detour
/// keeps clear of all `obstacles`, stays above the field of heights, where the ground is uneven,
/// and out of no-fly zones, which may have `C` convex corners.
///
/// # Errors
/// [`PlanFailure`] says why there is no detour.
pub fn plan_detour<
    const X: usize,
    const L: usize,
    const K: usize,
    const C: usize,
    const W: usize,
    const G: usize,
>(
    view: &CoverageView<'_>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    ws: &mut Workspace<X, L, K>,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), PlanFailure> {
    let area = read_area(view, &mut ws.vertices, &mut ws.rings).map_err(Error::Coverage)?;
    let mut transit = TransitGraph::<C>::empty();
    transit.set_area(area).map_err(Error::Coverage)?;
    let field = field.filter(|_| view.header().ground.is_some());
    around::plan_detour_for_vehicle(&transit, field, request, obstacles, out)
        .map_err(|_| PlanFailure::Unreachable)
}

/// Vehicles and pads of a mission over this area.
fn read_fleet<const K: usize>(
    mission: &MissionView<'_>,
    view: &CoverageView<'_>,
    area: &Area<'_>,
) -> Result<(Vec<Vehicle, K>, Vec<Pad, K>), CoverageError> {
    let (mut vehicles, mut pads) = (Vec::new(), Vec::new());
    for (i, own) in mission.vehicles().enumerate() {
        let (id, start, climb_m) = (own.task.id, own.path_start, own.task.climb_m);
        let pad = Pad {
            vehicle_id: id,
            path_start: start,
            climb_m,
            path_end_z_m: start.z,
            descent_m: climb_m,
            airborne: false,
        };
        vehicles
            .push(packing_vehicle(mission, &own, view, i))
            .map_err(|_| CoverageError::Vehicles)?;
        pads.push(pad).map_err(|_| CoverageError::Vehicles)?;
        if area.is_in_no_fly_zone(&own.path_start.xy()) {
            return Err(CoverageError::InsideNoFly(i as u8));
        }
    }
    Ok((vehicles, pads))
}

/// CRC of the inputs of a plan before take-off.
fn start_inputs_crc(request: &Request<'_, '_>) -> u32 {
    let mut digest = CRC32.digest();
    digest.update(&request.mission.crc().to_le_bytes());
    digest.update(&(request.max_gates as u32).to_le_bytes());
    for range in request.photographed {
        digest.update(&range.first.to_le_bytes());
        digest.update(&range.end.to_le_bytes());
    }
    digest.finalize()
}

/// CRC that identifies, in this board's memory, the plan after a division: of the division's inputs
/// and of `before`, the CRC of all inputs before it.
fn division_inputs_crc(before: u32, inputs: &[VehicleDivisionInput]) -> u32 {
    let mut digest = CRC32.digest();
    digest.update(&before.to_le_bytes());
    for input in inputs {
        digest.update(&[u8::from(input.alive)]);
        digest.update(&input.along_dm.to_le_bytes());
    }
    digest.finalize()
}

/// Plans the flights of all vehicles; no-fly zones may have `C` convex corners. `losses` has for
/// each division so far the inputs of all vehicles, by the rank of their system ids.
///
/// Where `ws` and `out` still hold the plan after the first few of these divisions, only the later
/// ones are computed; the result is the same.
///
/// # Errors
/// The error says why there is no plan.
pub fn plan_flights<
    'l,
    const X: usize,
    const L: usize,
    const K: usize,
    const C: usize,
    const V: usize,
    const W: usize,
>(
    request: &Request<'_, '_>,
    losses: impl Iterator<Item = &'l [VehicleDivisionInput]> + Clone,
    ws: &mut Workspace<X, L, K>,
    schedule: &mut ScheduleWorkspace,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), Error> {
    let Request { mission, view, max_gates: gates_most, .. } = *request;
    let header = view.header();
    let area = read_area(view, &mut ws.vertices, &mut ws.rings)?;
    let mut transit = TransitGraph::<C>::empty();
    transit.set_area(area)?;
    let (vehicles, pads) = read_fleet::<K>(mission, view, &area)?;
    // After a failure the workspace counts as holding no plan.
    let planned = core::mem::replace(&mut ws.planned, PlanFingerprint::NOTHING);
    let mut wanted =
        PlanFingerprint { plan_count: 1, inputs_crc: start_inputs_crc(request), plan_crc: out.crc };
    let mut known = u32::from(planned == wanted);
    for inputs in losses.clone() {
        wanted.inputs_crc = division_inputs_crc(wanted.inputs_crc, inputs);
        wanted.plan_count += 1;
        known = if planned == wanted { wanted.plan_count } else { known };
    }
    if known == 0 {
        let pattern = LanePattern {
            spacing: header.spacing,
            angle_from_east_deg: header.lane_angle_deg,
            border_overshoot_m: header.border_overshoot_m,
            max_search_steps: header.search_steps,
        };
        tracks::build_lanes(&area, &pattern, &transit, &mut ws.lane_workspace, &mut ws.tracks)?;
        if ws.tracks.waypoint_count() > PicturePlan::MAX_AREA_WAYPOINTS {
            return Err(CoverageError::LanesFull.into());
        }
    }
    let (tracks, transit) = (&ws.tracks, &transit);
    let following = request.terrain_following(&vehicles)?;
    let whole = CoverageProblem {
        tracks,
        transit,
        vehicles: &vehicles,
        heights: header.heights,
        unit: header.assignment_unit,
        following,
    };
    let along = tracks.lane_direction();
    let look = match header.heading_rule {
        HeadingRule::SameOnAllLanes => HeadingMode::FixedEnuRad(libm::atan2f(along.y, along.x)),
        HeadingRule::DirectionOfFlight => HeadingMode::Ahead,
    };
    let flight_inputs = FlightInputs {
        pads: &pads,
        capture: CaptureSettings {
            max_picture_spacing_m: header.spacing.max_waypoint_spacing_m,
            heading_mode: look,
            trigger: header.trigger,
        },
        assumed_clearance_m: OPEN_FIELD_CLEARANCE_M,
        schedule: mission.header().schedule,
        max_gates: gates_most,
        done_waypoints: &[],
        occupied_layers: 0,
        following,
    };
    if known == 0 {
        let (left, done) = ws.losses.reset_with_done(tracks, transit, request.photographed)?;
        let work = CoverageProblem { tracks: left, ..whole };
        match header.part_eligibility {
            PartEligibility::SameWeight => pack::binpat(&work, &mut ws.pack, &mut ws.routes)?,
            PartEligibility::Anyone => {
                let shares: Vec<f32, K> = view.shares().map(|share| share.weight).collect();
                // With `Anyone` the weights are sizes of parts, which any vehicle may get.
                pack::binpat_by_shares(&work, &shares, &mut ws.pack, &mut ws.routes)?;
            }
        }
        let inputs = FlightInputs { done_waypoints: done, ..flight_inputs };
        flights::plan_flights(&work, &ws.routes, &inputs, schedule, out)?;
        known = 1;
    }
    for inputs in losses.skip(known as usize - 1) {
        let mut statuses: Vec<VehicleStatus, K> = Vec::new();
        for pad in &pads {
            let rank = pads.iter().filter(|other| other.vehicle_id < pad.vehicle_id).count();
            let input = inputs.get(rank).ok_or(CoverageError::Vehicles)?;
            let fate = VehicleStatus { continues: input.alive, photographed_to_m: input.along_m() };
            statuses.push(fate).map_err(|_| CoverageError::Vehicles)?;
        }
        let division =
            DivisionProblem { problem: &whole, flight_inputs: &flight_inputs, statuses: &statuses };
        losses::redivide_work(
            &division,
            &mut ws.losses,
            &mut ws.pack,
            schedule,
            &mut ws.routes,
            out,
        )?;
    }
    ws.planned = PlanFingerprint { plan_crc: out.crc, ..wanted };
    Ok(())
}
