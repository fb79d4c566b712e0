//! The planning workspace: one memory for three uses, of which one is active at a time (planning on
//! a roadmap, building one, planning a coverage mission).
//!
//! An enum is not used: to change its variant the compiler would build the new value on the stack,
//! where there is no room for it.
#![expect(unsafe_code, reason = "three uses of one piece of memory")]

use core::mem::{ManuallyDrop, MaybeUninit};

use companion::planner::{AreaWorkspace, LendWorkspace};
use planner_core::Point;
use planner_core::map::voxel::VoxelGrid;
use planner_core::plan::PlanWorkspace;
use planner_core::roadmap::Edge;
use planner_core::roadmap::prm::{self, PrmConfig, PrmError};

use crate::capacity::{
    AREA_VERTICES, HALF_EDGES, LANES, NO_FLY_CORNERS, ROADMAP_CUBES, ROADMAP_NODES, TIMED_SEGMENTS,
    VEHICLES,
};

/// Workspace for planning a swarm on a roadmap.
pub type PlannerWorkspace = PlanWorkspace<ROADMAP_NODES, VEHICLES, TIMED_SEGMENTS>;

/// Workspace for planning a coverage mission.
pub type CoveragePlanWorkspace = AreaWorkspace<AREA_VERTICES, LANES, VEHICLES, NO_FLY_CORNERS>;

/// The memory for all three uses, as large as the largest; a board has one.
pub struct WorkspaceOverlay {
    memory: Memory,
    /// Present use of the memory.
    used: OverlayUse,
}

/// Use of the overlay's memory.
#[derive(Clone, Copy, PartialEq, Eq)]
enum OverlayUse {
    /// Planning on a roadmap.
    RoadmapPlan,
    /// Building a roadmap.
    RoadmapBuild,
    /// Planning for an area.
    CoveragePlan,
}

/// The memory; `OverlayUse` says which field is in use.
union Memory {
    plan: ManuallyDrop<PlannerWorkspace>,
    build: ManuallyDrop<RoadmapBuilder>,
    coverage: ManuallyDrop<CoveragePlanWorkspace>,
}

/// All-zero values of the three types: this constant compiles only if all zeros is a valid value of
/// each.
#[expect(dead_code, reason = "made by the compiler alone")]
const ALL_ZEROS: (PlannerWorkspace, RoadmapBuilder, CoveragePlanWorkspace) = {
    // SAFETY: the compiler evaluates this and rejects an invalid value.
    unsafe {
        let zeroed = (MaybeUninit::zeroed(), MaybeUninit::zeroed(), MaybeUninit::zeroed());
        (zeroed.0.assume_init(), zeroed.1.assume_init(), zeroed.2.assume_init())
    }
};

impl WorkspaceOverlay {
    /// Empty, in use for planning on a roadmap; its bytes are all zeros, so a static of it lies in
    /// .bss and takes no flash.
    pub const fn new() -> Self {
        Self {
            memory: Memory { plan: ManuallyDrop::new(PlannerWorkspace::new()) },
            used: OverlayUse::RoadmapPlan,
        }
    }

    /// The memory as roadmap builder. It is zeroed if it had another use before.
    pub fn builder(&mut self) -> &mut RoadmapBuilder {
        self.switch_use(OverlayUse::RoadmapBuild);
        // SAFETY: as in `for_goals`; all zeros is an empty builder.
        unsafe { &mut self.memory.build }
    }

    /// Zeroes the memory if `used` differs from its use until now.
    fn switch_use(&mut self, used: OverlayUse) {
        if self.used != used {
            // SAFETY: no variant has a destructor, and any bytes may be written over their memory.
            unsafe { (&raw mut self.memory).write_bytes(0, 1) };
            self.used = used;
        }
    }
}

impl
    LendWorkspace<
        ROADMAP_NODES,
        VEHICLES,
        TIMED_SEGMENTS,
        AREA_VERTICES,
        LANES,
        VEHICLES,
        NO_FLY_CORNERS,
    > for WorkspaceOverlay
{
    /// The memory as workspace of roadmap plans. It is zeroed if it had another use before.
    fn for_goals(&mut self) -> &mut PlannerWorkspace {
        self.switch_use(OverlayUse::RoadmapPlan);
        // SAFETY: `switch_use` zeroed it when the use changed to this one, all zeros is an empty
        // planner, and since then it was written as a planner alone.
        unsafe { &mut self.memory.plan }
    }

    /// The memory as workspace of coverage plans. It is zeroed if it had another use before.
    fn for_area(&mut self) -> &mut CoveragePlanWorkspace {
        self.switch_use(OverlayUse::CoveragePlan);
        // SAFETY: as in `for_goals`; all zeros is an area without vertices.
        unsafe { &mut self.memory.coverage }
    }
}

impl Default for WorkspaceOverlay {
    fn default() -> Self {
        Self::new()
    }
}

/// A roadmap that is being built on board: nodes and edges.
pub struct RoadmapBuilder {
    /// The nodes, metres in the mission frame; in use are the first `node_count`.
    nodes: [Point; ROADMAP_NODES],
    node_count: usize,
    /// The nodes by place.
    node_grid: prm::NodeGrid<ROADMAP_NODES, ROADMAP_CUBES>,
    /// The edges; in use are the first `edge_count`.
    edges: [Edge; HALF_EDGES / 2],
    edge_count: usize,
}

impl RoadmapBuilder {
    /// Samples nodes and connects them by edges: paper P3D, Algorithm 1. Every edge stores the
    /// clearance with which it was tested.
    ///
    /// # Errors
    /// The map has no free space for the nodes, or the roadmap exceeds the board's capacities.
    pub fn build(
        &mut self,
        grid: &VoxelGrid<'_>,
        terminals: &[Point],
        config: &PrmConfig,
    ) -> Result<(), PrmError> {
        self.sample_nodes(grid, terminals, config)?;
        self.sort_nodes(config)?;
        self.connect_nodes(grid, config)
    }

    /// Step 1 of 3: samples the nodes.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn sample_nodes(
        &mut self,
        grid: &VoxelGrid<'_>,
        terminals: &[Point],
        config: &PrmConfig,
    ) -> Result<(), PrmError> {
        self.edge_count = 0;
        self.node_count = prm::sample_nodes(grid, None, terminals, config, &mut self.nodes)?;
        Ok(())
    }

    /// Step 2 of 3: sorts the nodes into cubes by place.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn sort_nodes(&mut self, config: &PrmConfig) -> Result<(), PrmError> {
        self.node_grid.sort_nodes(&self.nodes[..self.node_count], config)
    }

    /// Step 3 of 3: connects near nodes by edges that are clear.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn connect_nodes(
        &mut self,
        grid: &VoxelGrid<'_>,
        config: &PrmConfig,
    ) -> Result<(), PrmError> {
        let Self { node_count, node_grid, edges, edge_count, .. } = self;
        *edge_count = 0;
        prm::connect_range(grid, node_grid, config, 0..*node_count, |edge| {
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
