//! Building a roadmap on the host: planner-core's PRM on all cores, every edge with its clearance,
//! encoded as the file that goes on the board.
//!
//! Edges come in the same order on any number of threads: the results of the parallel jobs are
//! joined in the order of the nodes.

pub mod cap;
pub mod passages;

use std::cell::Cell;
use std::ops::Range;
use std::time::Instant;

use anyhow::{anyhow, bail};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::map::voxel::{GridShape, VoxelGrid};
use planner_core::roadmap::prm::{self, NodeGrid, PrmConfig, PrmError};
use planner_core::roadmap::search::SearchWorkspace;
use planner_core::roadmap::{self, Edge, LANDMARK_COUNT, RoadmapError, RoadmapHeader};
use rayon::prelude::*;

use crate::capacity::{BoardCapacity, MAX_ROADMAP_CUBES, MAX_ROADMAP_NODES, on_heap};
use crate::map::{BoxTree, VoxelMap};

/// Greatest clearance stored with an edge, metres: enough for our largest vehicle.
pub const MAX_STORED_CLEARANCE_M: f32 = 6.0;
/// Nodes whose edges one parallel job finds: about a fifth of a millisecond of work.
const NODES_PER_JOB: usize = 32;
/// Numbers that a roadmap file stores for each node beside its position: its distance to each
/// landmark, and its height above the ground.
const LANDMARK_AND_HEIGHT_COLUMNS: usize = LANDMARK_COUNT + 1;
/// Clearances that differ by less than this count as equal, metres: the file stores millimetres.
const SAME_CLEARANCE_M: f32 = 2e-4;

/// Nodes and edges, not yet encoded.
#[derive(Clone, Debug)]
pub struct BuiltRoadmap {
    /// Starts, goals, then sampled nodes.
    pub nodes: Vec<Point>,
    /// Edges with their clearances.
    pub edges: Vec<Edge>,
    /// Height of each node above the ground below it, metres; infinite where there is no ground.
    pub heights_above_ground_m: Vec<f32>,
}

/// How long each part of the construction took, seconds. Boxes and nodes are made in parallel.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct BuildTimes {
    /// Building the tree of boxes over the map, which gives distances to obstacles.
    #[serde(rename = "boxes_s")]
    pub box_tree_s: f64,
    /// Sampling random free nodes, and measuring their heights above the ground.
    pub nodes_s: f64,
    /// Finding which pairs of nodes are joined, and the clearance of each edge.
    pub edges_s: f64,
    /// Adding nodes in passages that random sampling missed.
    pub passages_s: f64,
    /// Choosing the edges that a board has room for.
    #[serde(rename = "cap_s")]
    pub edge_cap_s: f64,
    /// Encoding the file: distances to the landmarks, adjacency rows, CRC-32.
    #[serde(rename = "file_s")]
    pub encoding_s: f64,
}

/// Samples nodes and joins them: Algorithm 1 of paper P3D, with the clearance of every edge. The
/// result does not depend on the number of threads.
pub fn build(
    map: &VoxelMap,
    terminals: &[Point],
    config: &PrmConfig,
) -> anyhow::Result<(BuiltRoadmap, BuildTimes)> {
    let grid = map.grid();
    let sampled = || {
        let nodes = sample(map, terminals, config)?;
        let heights_m: Vec<f32> =
            nodes.iter().map(|node| height_above_ground_m(map, node)).collect();
        anyhow::Ok((nodes, heights_m))
    };
    let ((tree, box_tree_s), (sampled, nodes_s)) =
        rayon::join(|| timed(|| BoxTree::new(&grid)), || timed(sampled));
    let (nodes, heights_m) = sampled?;
    let joining = Instant::now();
    let mut workspace = Box::new(NodeGrid::<MAX_ROADMAP_NODES, MAX_ROADMAP_CUBES>::new());
    let edges = connect_with_clearances(&grid, &tree, &nodes, config, &mut workspace)
        .map_err(|e| describe_prm_error(&e))?;
    let parts = BuildTimes {
        box_tree_s,
        nodes_s,
        edges_s: joining.elapsed().as_secs_f64(),
        ..BuildTimes::default()
    };
    Ok((BuiltRoadmap { nodes, edges, heights_above_ground_m: heights_m }, parts))
}

/// Adds nodes in passages between starts and goals that random sampling missed, joins all nodes
/// again, and returns how many were added. With 0 the roadmap is unchanged.
pub fn add_passages(
    map: &VoxelMap,
    roadmap: &mut BuiltRoadmap,
    config: &PrmConfig,
    wanted: &[passages::WantedConnection],
) -> anyhow::Result<usize> {
    let (grid, tree) = (map.grid(), BoxTree::new(&map.grid()));
    let added =
        passages::missing_passage_nodes(map, &tree, &roadmap.nodes, &roadmap.edges, config, wanted);
    if added.is_empty() {
        return Ok(0);
    }
    let total = roadmap.nodes.len() + added.len();
    if total > MAX_ROADMAP_NODES {
        bail!(
            "the roadmap would have {total} nodes: this build plans on at most {MAX_ROADMAP_NODES}"
        );
    }
    roadmap
        .heights_above_ground_m
        .extend(added.iter().map(|node| height_above_ground_m(map, node)));
    roadmap.nodes.extend(&added);
    let mut workspace = Box::new(NodeGrid::<MAX_ROADMAP_NODES, MAX_ROADMAP_CUBES>::new());
    roadmap.edges = connect_with_clearances(&grid, &tree, &roadmap.nodes, config, &mut workspace)
        .map_err(|e| describe_prm_error(&e))?;
    Ok(added.len())
}

/// Height of a node above the ground below it, metres; infinite where there is no ground.
fn height_above_ground_m(map: &VoxelMap, node: &Point) -> f32 {
    map.ground_z_below_m(node).map_or(f32::INFINITY, |ground_m| node.z - ground_m)
}

/// The result of `work`, and the seconds that it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let begun = Instant::now();
    let done = work();
    (done, begun.elapsed().as_secs_f64())
}

/// The nodes of a roadmap: the terminals (starts and goals), then `config.random_nodes` random free
/// ones.
pub fn sample(
    map: &VoxelMap,
    terminals: &[Point],
    config: &PrmConfig,
) -> anyhow::Result<Vec<Point>> {
    let total = terminals.len() + config.random_nodes;
    if total > MAX_ROADMAP_NODES {
        bail!(
            "the roadmap would have {total} nodes: this build plans on at most {MAX_ROADMAP_NODES}"
        );
    }
    let mut nodes = vec![Point::zeros(); total];
    let never_sample = map.no_node_grid();
    prm::sample_nodes(&map.grid(), Some(&never_sample), terminals, config, &mut nodes)
        .map_err(|e| describe_prm_error(&e))?;
    Ok(nodes)
}

/// The edges of [`prm::connect`], in its order, found on all threads of the current rayon pool.
pub fn connect<const NODES: usize, const CUBES: usize>(
    grid: &VoxelGrid<'_>,
    nodes: &[Point],
    config: &PrmConfig,
    workspace: &mut NodeGrid<NODES, CUBES>,
) -> Result<Vec<prm::PrmEdge>, PrmError> {
    workspace.sort_nodes(nodes, config)?;
    map_nodes_in_parallel(nodes.len(), |range, edges| {
        prm::connect_range(grid, workspace, config, range, |edge| {
            edges.push(edge);
            Ok(())
        })
    })
}

/// The edges of [`prm::connect`], each with its distance to the nearest obstacle, at most
/// [`MAX_STORED_CLEARANCE_M`]. `tree` is built over `grid`: its distances also decide which
/// segments are clear; only a segment within rounding of the required clearance is checked cell by
/// cell.
pub fn connect_with_clearances<const NODES: usize, const CUBES: usize>(
    grid: &VoxelGrid<'_>,
    tree: &BoxTree,
    nodes: &[Point],
    config: &PrmConfig,
    workspace: &mut NodeGrid<NODES, CUBES>,
) -> Result<Vec<Edge>, PrmError> {
    workspace.sort_nodes(nodes, config)?;
    // The clearance of an edge is at most that of either end, and mostly equal to the smaller one.
    let around: Vec<f32> = nodes
        .par_iter()
        .map(|node| tree.clearance_m(node, node, MAX_STORED_CLEARANCE_M, 0.0))
        .collect();
    let ends = |edge: prm::PrmEdge| (usize::from(edge.a), usize::from(edge.b));
    let most_m = |edge: prm::PrmEdge| {
        let (a, b) = ends(edge);
        around[a].min(around[b])
    };
    let clearance_m = |edge: prm::PrmEdge, enough_m: f32| {
        let (a, b) = ends(edge);
        tree.clearance_m(&nodes[a], &nodes[b], most_m(edge), enough_m)
    };
    let unsure_m = rounding_m(grid.shape()) + 1e-5 * config.clearance_m;
    map_nodes_in_parallel(nodes.len(), |range, edges| {
        let known = Cell::new(None);
        let hint = |edge| {
            let nearest_m = clearance_m(edge, config.clearance_m - unsure_m);
            known.set(Some(nearest_m));
            let sure = (nearest_m - config.clearance_m).abs() > unsure_m;
            sure.then_some(nearest_m > config.clearance_m)
        };
        prm::connect_range_with_clearance_bound(
            grid,
            workspace,
            config,
            range,
            hint,
            |edge, room_m| {
                let clearance_m = match known.take() {
                    Some(nearest_m) if room_m == 0.0 => nearest_m,
                    _ if room_m + SAME_CLEARANCE_M >= most_m(edge) => most_m(edge),
                    _ => clearance_m(edge, 0.0),
                };
                edges.push(Edge { a: edge.a, b: edge.b, clearance_m });
                Ok(())
            },
        )
    })
}

/// Runs `work` on ranges of nodes on all threads, and joins the results in the order of the ranges.
fn map_nodes_in_parallel<T: Copy + Send>(
    nodes: usize,
    work: impl Fn(Range<usize>, &mut Vec<T>) -> Result<(), PrmError> + Sync,
) -> Result<Vec<T>, PrmError> {
    let pieces: Vec<Vec<T>> = (0..nodes.div_ceil(NODES_PER_JOB))
        .into_par_iter()
        .map(|piece| {
            let mut found = Vec::with_capacity(NODES_PER_JOB * 64);
            work(piece * NODES_PER_JOB..(piece + 1) * NODES_PER_JOB, &mut found)?;
            Ok(found)
        })
        .collect::<Result<_, PrmError>>()?;
    Ok(pieces.concat())
}

/// Bound on the difference between a distance computed from cells and one from boxes, metres, with
/// a wide margin: both are rounded as coordinates are.
fn rounding_m(shape: &GridShape) -> f32 {
    let longest = shape.dims.into_iter().max().unwrap_or(0) as f32;
    (1e-3 + longest * 16.0 * f32::EPSILON) * shape.resolution_m
}

impl BuiltRoadmap {
    /// The roadmap with at most as many edges as the board holds, chosen by [`cap::limit_edges`].
    ///
    /// # Errors
    /// It has more nodes than the board holds, or needs more edges to stay connected.
    pub fn fit_to_board(self, board: &BoardCapacity) -> anyhow::Result<Self> {
        let (name, nodes) = (board.name, self.nodes.len());
        if nodes > board.nodes {
            bail!(
                "the roadmap does not fit {name}: it would have {nodes} nodes, {name} holds {}\n\
                 hint: lower roadmap.nodes; starts and goals are nodes too",
                board.nodes
            );
        }
        let bare =
            roadmap::encoded_len(nodes, 0, LANDMARK_AND_HEIGHT_COLUMNS).unwrap_or(usize::MAX);
        let an_edge = 2 * size_of::<u32>();
        let most = (board.half_edges / 2).min(board.roadmap_bytes.saturating_sub(bare) / an_edge);
        let edges = cap::limit_edges(&self.nodes, &self.edges, most).ok_or_else(|| {
            anyhow!("the roadmap does not fit {name}: {most} edges do not connect it")
        })?;
        Ok(Self { edges, ..self })
    }
}

/// The header of the file of a roadmap that was built with `config`.
pub fn header(config: &PrmConfig, origin: Geodetic, starts: u16, goals: u16) -> RoadmapHeader {
    RoadmapHeader {
        origin,
        edge_min_m: config.edge_min_m,
        edge_max_m: config.edge_max_m,
        tested_clearance_m: config.clearance_m,
        max_clearance_m: MAX_STORED_CLEARANCE_M,
        start_count: starts,
        goal_count: goals,
    }
}

/// The roadmap as the file that is uploaded to a board.
pub fn encode(roadmap: &BuiltRoadmap, header: &RoadmapHeader) -> anyhow::Result<Vec<u8>> {
    let too_large = || anyhow!("{} edges do not fit a roadmap file", roadmap.edges.len());
    let BuiltRoadmap { nodes, edges, heights_above_ground_m: heights_m } = roadmap;
    let length = roadmap::encoded_len(nodes.len(), edges.len(), LANDMARK_AND_HEIGHT_COLUMNS)
        .ok_or_else(too_large)?;
    let mut bytes = vec![0; length];
    let mut workspace = on_heap(SearchWorkspace::<MAX_ROADMAP_NODES>::new);
    roadmap::write_with_landmarks(header, nodes, edges, heights_m, &mut workspace, &mut bytes)
        .map_err(|e: RoadmapError| anyhow!("the roadmap cannot be written: {e:?}"))?;
    Ok(bytes)
}

/// The error for the user.
fn describe_prm_error(error: &PrmError) -> anyhow::Error {
    match error {
        PrmError::Config(name) => anyhow!("roadmap.{name} is out of range"),
        PrmError::TerminalBlocked(i) => {
            anyhow!("terminal {i} lies in an obstacle, in unknown space or outside the map")
        }
        PrmError::NoFreeSpace(found) => {
            anyhow!(
                "only {found} nodes found: too little of the map, or of mission.geofence, is free"
            )
        }
        other => anyhow!("{other:?}"),
    }
}

#[cfg(test)]
mod tests;
