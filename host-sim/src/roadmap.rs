//! Building a roadmap on the desk: planner-core's PRM on all cores, every edge with its clearance, encoded as the file
//! that goes on the board.
//!
//! Edges come in the same order whatever the number of threads, because pieces of work are joined in their order.

use anyhow::{anyhow, bail};
use planner_core::Point;
use planner_core::prm::{self, Config, PrmError, Workspace};
use planner_core::roadmap::{self, Edge, LANDMARKS, RoadmapError, RoadmapHeader};
use planner_core::search::SearchWorkspace;
use planner_core::voxel::VoxelGrid;
use rayon::prelude::*;

use crate::capacity::{ROADMAP_CUBES, ROADMAP_NODES, on_heap};
use crate::map::VoxelMap;

/// Where the clearance stored with an edge saturates, metres: beyond it no vehicle of ours is any wider.
pub const CLEARANCE_MAX_M: f32 = 6.0;
/// Nodes whose edges are one piece of work: a fifth of a millisecond.
const NODES_A_PIECE: usize = 32;
/// Edges whose clearances are one piece of work.
const EDGES_A_PIECE: usize = 256;

/// Nodes and edges, not yet encoded.
#[derive(Clone, Debug)]
pub struct Roadmap {
    /// Starts, goals, then sampled nodes.
    pub nodes: Vec<Point>,
    /// Edges with their clearances.
    pub edges: Vec<Edge>,
}

/// Samples and joins: Algorithm 1 of P3D, then the clearance of every edge. The result does not depend on the number
/// of threads.
pub fn build(map: &VoxelMap, terminals: &[Point], config: &Config) -> anyhow::Result<Roadmap> {
    let nodes = sample(map, terminals, config)?;
    let mut workspace = Box::new(Workspace::<ROADMAP_NODES, ROADMAP_CUBES>::new());
    let joined = connect(&map.grid(), &nodes, config, &mut workspace).map_err(|e| describe(&e))?;
    let edges = annotate(&map.grid(), &nodes, &joined);
    Ok(Roadmap { nodes, edges })
}

/// Terminals and free nodes.
pub fn sample(map: &VoxelMap, terminals: &[Point], config: &Config) -> anyhow::Result<Vec<Point>> {
    let total = terminals.len() + config.nodes;
    if total > ROADMAP_NODES {
        bail!("the roadmap would have {total} nodes: this build plans on at most {ROADMAP_NODES}");
    }
    let mut nodes = vec![Point::zeros(); total];
    let never_sample = map.never_sample();
    prm::sample_nodes(&map.grid(), Some(&never_sample), terminals, config, &mut nodes)
        .map_err(|e| describe(&e))?;
    Ok(nodes)
}

/// The edges of [`prm::connect`], in its order, found on all threads of the current rayon pool.
pub fn connect<const NODES: usize, const CUBES: usize>(
    grid: &VoxelGrid<'_>,
    nodes: &[Point],
    config: &Config,
    workspace: &mut Workspace<NODES, CUBES>,
) -> Result<Vec<prm::Edge>, PrmError> {
    workspace.index(nodes, config)?;
    let workspace = &*workspace;
    let pieces: Vec<Vec<prm::Edge>> = (0..nodes.len().div_ceil(NODES_A_PIECE))
        .into_par_iter()
        .map(|piece| {
            let mut edges = Vec::with_capacity(NODES_A_PIECE * 64);
            let range = piece * NODES_A_PIECE..(piece + 1) * NODES_A_PIECE;
            prm::connect_range(grid, workspace, config, range, |edge| {
                edges.push(edge);
                Ok(())
            })?;
            Ok(edges)
        })
        .collect::<Result<_, PrmError>>()?;
    Ok(pieces.concat())
}

/// Each edge with its distance to the nearest obstacle, at most [`CLEARANCE_MAX_M`].
fn annotate(grid: &VoxelGrid<'_>, nodes: &[Point], edges: &[prm::Edge]) -> Vec<Edge> {
    let clearance = |edge| {
        prm::edge_clearance(grid, nodes, edge, CLEARANCE_MAX_M)
            .expect("both ends of an edge we found are nodes")
    };
    edges
        .par_iter()
        .with_min_len(EDGES_A_PIECE)
        .map(|&edge| Edge { a: edge.a, b: edge.b, clearance_m: clearance(edge) })
        .collect()
}

/// The roadmap as the file that is uploaded to a board.
pub fn encode(roadmap: &Roadmap, header: &RoadmapHeader) -> anyhow::Result<Vec<u8>> {
    let too_large = || anyhow!("{} edges do not fit a roadmap file", roadmap.edges.len());
    let length =
        roadmap::encoded_len(roadmap.nodes.len(), roadmap.edges.len(), LANDMARKS).ok_or_else(too_large)?;
    let mut bytes = vec![0; length];
    let mut workspace = on_heap(SearchWorkspace::<ROADMAP_NODES>::new);
    roadmap::write_with_landmarks(header, &roadmap.nodes, &roadmap.edges, &mut workspace, &mut bytes)
        .map_err(|e: RoadmapError| anyhow!("the roadmap cannot be written: {e:?}"))?;
    Ok(bytes)
}

fn describe(error: &PrmError) -> anyhow::Error {
    match error {
        PrmError::Config(name) => anyhow!("roadmap.{name} is out of range"),
        PrmError::TerminalBlocked(i) => {
            anyhow!("terminal {i} lies in an obstacle, in unknown space or outside the map")
        }
        PrmError::NoFreeSpace(found) => anyhow!("only {found} nodes found: too little of the map is free"),
        other => anyhow!("{other:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Unknown;
    use crate::map::building::building;
    use planner_core::prm::Sampling;

    #[test]
    fn any_number_of_threads_gives_the_same_edges() {
        let map = building(1, 0.5).unwrap().voxel_map(Unknown::Blocked);
        let config = Config {
            nodes: 500,
            edge_min_m: 0.5,
            edge_max_m: 8.0,
            clearance_m: 0.0,
            seed: 1,
            sampling: Sampling::Uniform,
        };
        let nodes = sample(&map, &[], &config).unwrap();
        let mut workspace = Box::new(Workspace::<512, 4096>::new());
        let mut alone = vec![prm::Edge::default(); 20_000];
        let count = prm::connect(&map.grid(), &nodes, &config, &mut workspace, &mut alone).unwrap();
        assert!(count > 500);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let edges = pool.install(|| connect(&map.grid(), &nodes, &config, &mut workspace)).unwrap();
            assert_eq!(edges, alone[..count]);
        }
    }
}
