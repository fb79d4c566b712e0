//! What a board plans with: one piece of memory, for planning on a roadmap, for building one, or
//! for a coverage mission.
//!
//! An enum would do but for its change from one use to the other, which the compiler makes on the
//! stack, where there is no room for it.
#![expect(unsafe_code, reason = "four uses of one piece of memory")]

use core::mem::{ManuallyDrop, MaybeUninit};

use companion::planner::coverage;
use planner_core::Point;
use planner_core::coverage::pack::Plan;
use planner_core::coverage::tracks::{self, Tracks};
use planner_core::coverage::{losses, powell};
use planner_core::plan::PlanWorkspace;
use planner_core::prm::{self, Config, PrmError};
use planner_core::roadmap::Edge;
use planner_core::schedule::ScheduleWorkspace;
use planner_core::voxel::VoxelGrid;

use crate::capacity::{
    AREA_VERTICES, HALF_EDGES, LANES, ROADMAP_CUBES, ROADMAP_NODES, TIMED_SEGMENTS, VEHICLES,
};

/// Scratch of planning a swarm.
pub type Planner = PlanWorkspace<ROADMAP_NODES, VEHICLES, TIMED_SEGMENTS>;

/// Scratch of planning a coverage mission.
pub struct AreaWorkspace {
    /// Lanes and routes.
    pub area: coverage::Workspace<AREA_VERTICES, LANES, VEHICLES>,
    /// Flights.
    pub schedule: ScheduleWorkspace,
}

impl AreaWorkspace {
    /// Creates it empty.
    pub const fn new() -> Self {
        Self { area: coverage::Workspace::new(), schedule: ScheduleWorkspace::new() }
    }
}

impl Default for AreaWorkspace {
    fn default() -> Self {
        Self::new()
    }
}

/// The memory; a board has one. The smaller uses lie in the memory of the largest.
pub struct WorkspaceOverlay {
    memory: Memory,
    used: OverlayUse,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum OverlayUse {
    Plan,
    Build,
    Coverage,
    Area,
}

union Memory {
    plan: ManuallyDrop<Planner>,
    build: ManuallyDrop<RoadmapBuilder>,
    coverage: ManuallyDrop<CoverageWorkspace>,
    area: ManuallyDrop<AreaWorkspace>,
}

/// Zero values of each use: the compiler refuses a constant that is no value of its type.
#[expect(dead_code, reason = "made by the compiler alone")]
const ALL_ZEROS: (Planner, RoadmapBuilder, CoverageWorkspace, AreaWorkspace) = {
    // SAFETY: the compiler checks it.
    unsafe {
        let zeroed = (
            MaybeUninit::zeroed(),
            MaybeUninit::zeroed(),
            MaybeUninit::zeroed(),
            MaybeUninit::zeroed(),
        );
        (
            zeroed.0.assume_init(),
            zeroed.1.assume_init(),
            zeroed.2.assume_init(),
            zeroed.3.assume_init(),
        )
    }
};

impl WorkspaceOverlay {
    /// All zeros, so a static costs .bss alone.
    pub const fn new() -> Self {
        Self { memory: Memory { plan: ManuallyDrop::new(Planner::new()) }, used: OverlayUse::Plan }
    }

    /// The memory for planning from here on.
    pub fn planner(&mut self) -> &mut Planner {
        self.switch_use(OverlayUse::Plan);
        // SAFETY: it was all zeros at the last turn, which is an empty planner, and only a planner
        // was written since.
        unsafe { &mut self.memory.plan }
    }

    /// The memory for building from here on; empty.
    pub fn builder(&mut self) -> &mut RoadmapBuilder {
        self.switch_use(OverlayUse::Build);
        // SAFETY: as above; all zeros is an empty builder.
        unsafe { &mut self.memory.build }
    }

    /// The memory for a coverage mission from here on; empty.
    pub fn coverage(&mut self) -> &mut CoverageWorkspace {
        self.switch_use(OverlayUse::Coverage);
        // SAFETY: as above; all zeros is nothing lent yet.
        unsafe { &mut self.memory.coverage }
    }

    /// The memory for planning a coverage mission from here on; empty.
    pub fn area(&mut self) -> &mut AreaWorkspace {
        self.switch_use(OverlayUse::Area);
        // SAFETY: as above; all zeros is an area without vertices.
        unsafe { &mut self.memory.area }
    }

    /// Zeros where the use changes.
    fn switch_use(&mut self, used: OverlayUse) {
        if self.used != used {
            // SAFETY: no use has anything to drop, and any bytes may be written over their memory.
            unsafe { (&raw mut self.memory).write_bytes(0, 1) };
            self.used = used;
        }
    }
}

impl Default for WorkspaceOverlay {
    fn default() -> Self {
        Self::new()
    }
}

/// Workspaces of a coverage mission's plan.
pub struct CoverageWorkspace {
    /// The whole path.
    pub tracks: Tracks<LANES>,
    /// Lanes that are left after a loss.
    pub left: Tracks<LANES>,
    /// Workspace for making lanes.
    pub build: tracks::Workspace<AREA_VERTICES>,
    /// Workspace for dividing lanes.
    pub powell: powell::Workspace<VEHICLES>,
    /// The routes.
    pub plan: Plan<VEHICLES>,
    /// Workspace for losses, and for the lanes left after them.
    pub losses: losses::Workspace<LANES, VEHICLES>,
    /// Workspace for keeping flights apart.
    pub schedule: ScheduleWorkspace,
}

impl CoverageWorkspace {
    /// Creates it empty.
    pub const fn new() -> Self {
        Self {
            tracks: Tracks::new(),
            left: Tracks::new(),
            build: tracks::Workspace::new(),
            powell: powell::Workspace::new(),
            plan: Plan::new(),
            losses: losses::Workspace::new(),
            schedule: ScheduleWorkspace::new(),
        }
    }
}

impl Default for CoverageWorkspace {
    fn default() -> Self {
        Self::new()
    }
}

/// Nodes and edges of a roadmap that is built on board.
pub struct RoadmapBuilder {
    nodes: [Point; ROADMAP_NODES],
    node_count: usize,
    index: prm::Workspace<ROADMAP_NODES, ROADMAP_CUBES>,
    edges: [Edge; HALF_EDGES / 2],
    edge_count: usize,
}

impl RoadmapBuilder {
    /// Samples nodes and joins them: Algorithm 1 of P3D. Every edge carries the clearance it was
    /// tested at.
    ///
    /// # Errors
    /// The map has no room, or the roadmap is larger than this board's.
    pub fn build(
        &mut self,
        grid: &VoxelGrid<'_>,
        terminals: &[Point],
        config: &Config,
    ) -> Result<(), PrmError> {
        self.sample_nodes(grid, terminals, config)?;
        self.build_index(config)?;
        self.connect_nodes(grid, config)
    }

    /// First step: nodes.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn sample_nodes(
        &mut self,
        grid: &VoxelGrid<'_>,
        terminals: &[Point],
        config: &Config,
    ) -> Result<(), PrmError> {
        self.edge_count = 0;
        self.node_count = prm::sample_nodes(grid, None, terminals, config, &mut self.nodes)?;
        Ok(())
    }

    /// Second step: nodes by place.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn build_index(&mut self, config: &Config) -> Result<(), PrmError> {
        self.index.build_index(&self.nodes[..self.node_count], config)
    }

    /// Third step: edges.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn connect_nodes(&mut self, grid: &VoxelGrid<'_>, config: &Config) -> Result<(), PrmError> {
        let Self { node_count, index, edges, edge_count, .. } = self;
        *edge_count = 0;
        prm::connect_range(grid, index, config, 0..*node_count, |edge| {
            let to = edges.get_mut(*edge_count).ok_or(PrmError::RoadmapFull)?;
            *to = Edge { a: edge.a, b: edge.b, clearance_m: config.clearance_m };
            *edge_count += 1;
            Ok(())
        })
    }

    /// Nodes of the built roadmap.
    pub fn nodes(&self) -> &[Point] {
        &self.nodes[..self.node_count]
    }

    /// Edges of the built roadmap.
    pub fn edges(&self) -> &[Edge] {
        &self.edges[..self.edge_count]
    }
}
