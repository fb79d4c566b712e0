//! Building a roadmap on the desk: planner-core's PRM on all cores, every edge with its clearance, encoded as the file
//! that goes on the board.

use std::ops::Range;

use anyhow::{anyhow, bail};
use planner_core::Point;
use planner_core::prm::{self, Config, PrmError};
use planner_core::roadmap::{self, Edge, RoadmapError, RoadmapHeader};
use rayon::prelude::*;

use crate::capacity::ROADMAP_NODES;
use crate::map::VoxelMap;

/// Where the clearance stored with an edge saturates, metres: beyond it no vehicle of ours is any wider.
pub const CLEARANCE_MAX_M: f32 = 6.0;
/// Nodes whose edges are one unit of work.
const CHUNK: usize = 64;

type Workspace = prm::Workspace<{ ROADMAP_NODES }, { ROADMAP_NODES }>;

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
    let joined = connect(map, &nodes, config)?;
    let grid = map.grid();
    let edges = joined
        .par_iter()
        .map(|&edge| {
            let clearance_m = prm::edge_clearance(&grid, &nodes, edge, CLEARANCE_MAX_M).unwrap_or(0.0);
            Edge { a: edge.a, b: edge.b, clearance_m }
        })
        .collect();
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

/// All edges, in the order of their nodes.
pub fn connect(map: &VoxelMap, nodes: &[Point], config: &Config) -> anyhow::Result<Vec<prm::Edge>> {
    let grid = map.grid();
    let mut workspace = Box::new(Workspace::new());
    workspace.index(nodes, config).map_err(|e| describe(&e))?;
    let chunks: Vec<Range<usize>> =
        (0..nodes.len()).step_by(CHUNK).map(|from| from..(from + CHUNK).min(nodes.len())).collect();
    let found: Result<Vec<Vec<prm::Edge>>, PrmError> = chunks
        .into_par_iter()
        .map(|range| {
            let mut edges = Vec::new();
            prm::connect_range(&grid, &workspace, config, range, |edge| {
                edges.push(edge);
                Ok(())
            })?;
            Ok(edges)
        })
        .collect();
    Ok(found.map_err(|e| describe(&e))?.concat())
}

/// The roadmap as the file that is uploaded to a board.
pub fn encode(roadmap: &Roadmap, header: &RoadmapHeader) -> anyhow::Result<Vec<u8>> {
    let too_large = || anyhow!("{} edges do not fit a roadmap file", roadmap.edges.len());
    let length = roadmap::encoded_len(roadmap.nodes.len(), roadmap.edges.len()).ok_or_else(too_large)?;
    let mut bytes = vec![0; length];
    roadmap::write(header, &roadmap.nodes, &roadmap.edges, &mut bytes)
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
