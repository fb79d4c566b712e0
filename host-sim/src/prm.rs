//! The roadmap builder on all cores: the board's code, its work shared out by ranges of nodes.
//!
//! The edges come in the same order whatever the number of threads, because ranges are joined in their order.

use planner_core::Point;
use planner_core::prm::{self, Config, Edge, PrmError, Workspace};
use planner_core::roadmap;
use planner_core::segment::segment_clearance;
use planner_core::voxel::VoxelGrid;
use rayon::prelude::*;

/// Nodes of one piece of work: some 20 µs.
const PIECE: usize = 32;
/// Edges of one piece of annotation.
const EDGES: usize = 256;
/// As many nodes as a roadmap can have, and cubes enough for maps of 500 m a side at Dmax 8 m.
pub type HostWorkspace = Workspace<{ u16::MAX as usize }, { 1 << 21 }>;

/// An empty workspace on the heap.
pub fn workspace() -> Box<HostWorkspace> {
    // Made where it stays: 5 MB do not go over the stack in release builds, and a thread with room for it is used in debug.
    std::thread::Builder::new()
        .stack_size(64 << 20)
        .spawn(|| Box::new(Workspace::new()))
        .expect("the system starts threads")
        .join()
        .expect("making zeros does not panic")
}

/// The edges of [`prm::connect`], found on all threads of the current rayon pool.
pub fn connect<const NODES: usize, const CUBES: usize>(
    grid: &VoxelGrid<'_>,
    nodes: &[Point],
    config: &Config,
    workspace: &mut Workspace<NODES, CUBES>,
) -> Result<Vec<Edge>, PrmError> {
    workspace.index(nodes, config)?;
    let workspace = &*workspace;
    let pieces: Vec<Vec<Edge>> = (0..nodes.len().div_ceil(PIECE))
        .into_par_iter()
        .map(|piece| {
            let mut edges = Vec::with_capacity(PIECE * 64);
            let range = piece * PIECE..(piece + 1) * PIECE;
            prm::connect_range(grid, workspace, config, range, |edge| {
                edges.push(edge);
                Ok(())
            })?;
            Ok(edges)
        })
        .collect::<Result<_, PrmError>>()?;
    Ok(pieces.concat())
}

/// Each edge with its distance to the nearest obstacle, at most `max_m`, for [`roadmap::write`].
pub fn annotate(grid: &VoxelGrid<'_>, nodes: &[Point], edges: &[Edge], max_m: f32) -> Vec<roadmap::Edge> {
    let clearance =
        |e: &Edge| segment_clearance(grid, &nodes[usize::from(e.a)], &nodes[usize::from(e.b)], max_m);
    edges
        .par_iter()
        .with_min_len(EDGES)
        .map(|e| roadmap::Edge { a: e.a, b: e.b, clearance_m: clearance(e) })
        .collect()
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
        let mut nodes = vec![Point::zeros(); 500];
        prm::sample_nodes(&map.grid(), None, &[], &config, &mut nodes).unwrap();
        let mut workspace = workspace();
        let mut alone = vec![Edge::default(); 20_000];
        let count = prm::connect(&map.grid(), &nodes, &config, &mut workspace, &mut alone).unwrap();
        assert!(count > 500);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let edges = pool.install(|| connect(&map.grid(), &nodes, &config, &mut workspace)).unwrap();
            assert_eq!(edges, alone[..count]);
        }
    }
}
