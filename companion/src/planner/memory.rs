//! What a shell lends to [`super::answer_plan_request`]: the files, what the companion knows for
//! the requested plan, and memory. A board has the memory in statics, the host on its heap.

use heapless::Vec;
use planner_core::detour::{DetourRequest, KeepOutZone};
use planner_core::flight::{VehiclePlan, WaypointRange};
use planner_core::map::field::FieldView;
use planner_core::plan::{PlanWorkspace, SwarmPlan};
use planner_core::roadmap::RoadmapView;
use planner_core::schedule::ScheduleWorkspace;

use super::coverage;
use crate::config::PlanFailure;
use crate::mission::photographed::MAX_PHOTOGRAPHED_RANGES;
use crate::storage::mission_file::MissionView;
use crate::swarm::fleet::{DivisionInputs, MAX_DIVISIONS, VehicleDivisionInput};

/// The files that plans are made from. Without the mission, or the roadmap or field that it needs,
/// every request fails.
#[derive(Clone, Copy, Default)]
pub struct PlanFiles<'a> {
    /// Mission to plan. `None` without a valid one.
    pub mission: Option<MissionView<'a>>,
    /// Roadmap on which the routes of a mission with goals are searched. `None` without a valid
    /// one.
    pub roadmap: Option<RoadmapView<'a>>,
    /// Field of heights that a coverage mission's flights keep above. `None` without a valid one.
    pub field: Option<FieldView<'a>>,
}

/// Workspace for planning a coverage mission of at most `X` vertices, `L` lanes, `K` vehicles and
/// `C` convex corners of no-fly zones.
#[derive(Default)]
pub struct AreaWorkspace<const X: usize, const L: usize, const K: usize, const C: usize> {
    /// Workspace for lanes and routes.
    pub area: coverage::Workspace<X, L, K>,
    /// Workspace for scheduling the flights.
    pub schedule: ScheduleWorkspace,
}

impl<const X: usize, const L: usize, const K: usize, const C: usize> AreaWorkspace<X, L, K, C> {
    /// Empty; its bytes are all zeros, so a static of it lies in .bss.
    pub const fn new() -> Self {
        Self { area: coverage::Workspace::new(), schedule: ScheduleWorkspace::new() }
    }
}

/// Lends the workspace of one kind of mission. A plan uses only one of the two, so both may lie in
/// the same memory.
///
/// The capacities: `N` nodes of a roadmap, `V` vehicles, `P` timed segments; for areas those of
/// [`AreaWorkspace`].
pub trait LendWorkspace<
    const N: usize,
    const V: usize,
    const P: usize,
    const X: usize,
    const L: usize,
    const K: usize,
    const C: usize,
>
{
    /// The workspace for missions with goals.
    fn for_goals(&mut self) -> &mut PlanWorkspace<N, V, P>;
    /// The workspace for coverage missions.
    fn for_area(&mut self) -> &mut AreaWorkspace<X, L, K, C>;
}

/// A plan that a companion requests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RequestedPlan {
    /// The vehicle's part of the swarm's plan. Over an area, that is the plan without the
    /// photographed waypoints of the [`PlanInputs`], and after the divisions there.
    Flight,
    /// A detour around the keep-out zones of the [`PlanInputs`].
    Detour(DetourRequest),
}

/// What a companion contributes to the plan that it requests:
/// [`read_plan_inputs`](crate::Companion::read_plan_inputs) fills it, for at most `V` vehicles and
/// `Z` keep-out zones.
#[derive(Default)]
pub struct PlanInputs<const V: usize, const Z: usize> {
    /// Keep-out zones of a detour.
    zones: Vec<KeepOutZone, Z>,
    /// Whether a keep-out zone had no room in `zones`.
    too_many_zones: bool,
    /// Waypoints that were photographed before this flight.
    pub(super) photographed: Vec<WaypointRange, MAX_PHOTOGRAPHED_RANGES>,
    /// For each division so far the inputs of all vehicles; empty unless a division's plan is
    /// requested.
    pub(super) divisions: Vec<DivisionInputs<V>, MAX_DIVISIONS>,
}

impl<const V: usize, const Z: usize> PlanInputs<V, Z> {
    /// Empty; its bytes are all zeros, so a static of it lies in .bss.
    pub const fn new() -> Self {
        Self {
            zones: Vec::new(),
            too_many_zones: false,
            photographed: Vec::new(),
            divisions: Vec::new(),
        }
    }

    /// Forgets the inputs of an earlier request.
    pub(crate) fn clear(&mut self) {
        self.zones.clear();
        self.too_many_zones = false;
        self.photographed.clear();
        self.divisions.clear();
    }

    /// Adds waypoints that were photographed before.
    pub(crate) fn add_photographed(&mut self, ranges: &[WaypointRange]) {
        // Cannot overflow: it has the capacity of the companion's list.
        let _ = self.photographed.extend_from_slice(ranges);
    }

    /// Adds the inputs of a division, after those of the earlier ones.
    pub(crate) fn add_division(&mut self, inputs: &[VehicleDivisionInput]) {
        // Cannot overflow: it has room for the divisions that the companion keeps and for the one
        // in progress.
        let _ = self.divisions.push(inputs.iter().copied().collect());
    }

    /// Adds a keep-out zone of a detour.
    pub(crate) fn add_zone(&mut self, zone: KeepOutZone) {
        self.too_many_zones |= self.zones.push(zone).is_err();
    }

    /// The keep-out zones of a detour. If not all had room there is no plan: a detour that ignored
    /// some zones would not be safe.
    pub(super) fn zones(&mut self) -> Result<&mut [KeepOutZone], PlanFailure> {
        if self.too_many_zones { Err(PlanFailure::Capacity) } else { Ok(&mut self.zones) }
    }
}

/// One vehicle's plan, of at most `W` waypoints and `G` gates, and what the companion knows for it.
#[derive(Default)]
pub struct OwnPlanMemory<const V: usize, const W: usize, const G: usize, const Z: usize> {
    /// What the companion knows for the plan.
    pub inputs: PlanInputs<V, Z>,
    /// The answer, or what was written of it before a failure.
    pub plan: VehiclePlan<W, G>,
    /// Nodes of a detour's path.
    pub(super) nodes: Vec<u16, W>,
}

impl<const V: usize, const W: usize, const G: usize, const Z: usize> OwnPlanMemory<V, W, G, Z> {
    /// Empty; its bytes are all zeros, so a static of it lies in .bss.
    pub const fn new() -> Self {
        Self { inputs: PlanInputs::new(), plan: VehiclePlan::new(), nodes: Vec::new() }
    }
}

/// Memory that the planner works in; on a board its parts lie in different RAMs of the chip.
pub struct PlanningMemory<'a, M, const V: usize, const W: usize, const G: usize, const Z: usize> {
    /// Lends the workspaces.
    pub workspaces: &'a mut M,
    /// Plan of the whole swarm.
    pub swarm: &'a mut SwarmPlan<V, W>,
    /// Plan of this vehicle, and inputs of it.
    pub own: &'a mut OwnPlanMemory<V, W, G, Z>,
    /// Most gates of one vehicle's plan, at most `G`.
    pub max_gates: usize,
}

impl<'a, M, const V: usize, const W: usize, const G: usize, const Z: usize>
    PlanningMemory<'a, M, V, W, G, Z>
{
    /// Memory for plans of up to `G` gates.
    pub const fn new(
        workspaces: &'a mut M,
        swarm: &'a mut SwarmPlan<V, W>,
        own: &'a mut OwnPlanMemory<V, W, G, Z>,
    ) -> Self {
        Self { workspaces, swarm, own, max_gates: G }
    }
}
