//! Shortest paths on a roadmap: A* for one pair, one Dijkstra row for a vehicle's costs to many goals.
//!
//! Source: P3D §3.3 (A* per pair, cost matrix for the allocation); the heuristic is the straight distance, admissible and
//! consistent because an edge is as long as the straight line between its nodes. Metres, f32. Cost O(half-edges +
//! nodes · log nodes), each node settled once; memory is the caller's [`SearchWorkspace`].
//!
//! Edge lengths are not stored but follow from the nodes. Most half-edges never need theirs: the target is settled or
//! already reached too cheaply for any edge of that squared length, so a square root is taken only when it may change a
//! distance. Ties go to the lower node index, so the same roadmap gives the same path everywhere.

use heapless::Vec;

use crate::roadmap::{HalfEdge, RoadmapView};

mod heap;
use heap::{Heap, SETTLED, UNSEEN};

/// Why a search gave no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchError {
    /// No passable way joins the two nodes.
    NoPath,
    /// The path has more nodes than the output holds.
    PathTooLong,
    /// A node index is not in the roadmap.
    BadNode(u16),
    /// The roadmap has more nodes than the workspace.
    WorkspaceTooSmall,
    /// The output slice is not as long as the targets.
    OutputLength,
}

/// Scratch memory for roadmaps of up to `N` nodes: 16 bytes a node. All-zero when new, so a static costs .bss only.
pub struct SearchWorkspace<const N: usize> {
    distance: [f32; N],
    parent: [u16; N],
    heap: Heap<N>,
}

impl<const N: usize> SearchWorkspace<N> {
    /// All zeros.
    pub const fn new() -> Self {
        assert!(N <= u16::MAX as usize, "node indices are 16 bits");
        Self { distance: [0.0; N], parent: [0; N], heap: Heap::new() }
    }

    /// Length in metres of the shortest way from the last search's source to `node`; infinite if it was not settled.
    pub fn distance_m(&self, node: u16) -> f32 {
        match self.distance.get(usize::from(node)) {
            Some(&distance) if self.heap.place(node) == SETTLED => distance,
            _ => f32::INFINITY,
        }
    }

    /// Writes the nodes from the last search's source to `node`, both included. Only the parents are read, so a path
    /// may be taken out for every target of a [`dijkstra_row`].
    pub fn path_to<const P: usize>(&self, node: u16, out: &mut Vec<u16, P>) -> Result<(), SearchError> {
        out.clear();
        if usize::from(node) >= N || self.heap.place(node) != SETTLED {
            return Err(SearchError::NoPath);
        }
        let mut at = node;
        loop {
            out.push(at).map_err(|_| SearchError::PathTooLong)?;
            let parent = self.parent[usize::from(at)];
            if parent == at {
                break;
            }
            at = parent;
        }
        out.reverse();
        Ok(())
    }
}

impl<const N: usize> Default for SearchWorkspace<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// The shortest passable path from `from` to `to`. Returns its length in metres and leaves its nodes, ends included, in
/// `out_nodes`.
///
/// `passable(node, edge)` says whether `edge` may be flown out of `node`: size by clearance, blocked nodes and edges.
pub fn astar<const N: usize, const P: usize>(
    view: &RoadmapView<'_>,
    from: u16,
    to: u16,
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
    out_nodes: &mut Vec<u16, P>,
) -> Result<f32, SearchError> {
    out_nodes.clear();
    check_node(view, to)?;
    let goal = view.node(to);
    let mut target_left = 1;
    search(
        view,
        from,
        passable,
        |node| libm::sqrtf((view.node(node) - goal).norm_squared()),
        |node| {
            target_left -= usize::from(node == to);
            target_left == 0
        },
        ws,
    )?;
    ws.path_to(to, out_nodes)?;
    Ok(ws.distance_m(to))
}

/// Lengths in metres of the shortest passable paths from `from` to each of `targets`, into `out`; infinite where there is
/// none. Stops when all targets are settled. One row of the cost matrix.
pub fn dijkstra_row<const N: usize>(
    view: &RoadmapView<'_>,
    from: u16,
    targets: &[u16],
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
    out: &mut [f32],
) -> Result<(), SearchError> {
    if out.len() != targets.len() {
        return Err(SearchError::OutputLength);
    }
    for &target in targets {
        check_node(view, target)?;
    }
    let mut left = targets.len();
    search(
        view,
        from,
        passable,
        |_| 0.0,
        |node| {
            left -= targets.iter().filter(|&&t| t == node).count();
            left == 0
        },
        ws,
    )?;
    for (length, &target) in out.iter_mut().zip(targets) {
        *length = ws.distance_m(target);
    }
    Ok(())
}

fn check_node(view: &RoadmapView<'_>, node: u16) -> Result<(), SearchError> {
    if usize::from(node) < view.node_count() { Ok(()) } else { Err(SearchError::BadNode(node)) }
}

/// Settles nodes in order of distance + `heuristic` until `done(node)` or none is left.
fn search<const N: usize>(
    view: &RoadmapView<'_>,
    from: u16,
    passable: impl Fn(u16, &HalfEdge) -> bool,
    heuristic: impl Fn(u16) -> f32,
    mut done: impl FnMut(u16) -> bool,
    ws: &mut SearchWorkspace<N>,
) -> Result<(), SearchError> {
    if view.node_count() > N {
        return Err(SearchError::WorkspaceTooSmall);
    }
    check_node(view, from)?;
    ws.heap.clear();
    ws.distance[usize::from(from)] = 0.0;
    ws.parent[usize::from(from)] = from;
    ws.heap.push(from, heuristic(from));
    while let Some(node) = ws.heap.pop() {
        if done(node) {
            break;
        }
        let here = view.node(node);
        let reached = ws.distance[usize::from(node)];
        for edge in view.half_edges(node) {
            let target = usize::from(edge.target);
            let place = ws.heap.place(edge.target);
            if place == SETTLED {
                continue;
            }
            let squared = (view.node(edge.target) - here).norm_squared();
            if place != UNSEEN {
                let room = ws.distance[target] - reached;
                if room <= 0.0 || squared >= room * room {
                    continue;
                }
            }
            let length = reached + libm::sqrtf(squared);
            if (place != UNSEEN && length >= ws.distance[target]) || !passable(node, &edge) {
                continue;
            }
            ws.distance[target] = length;
            ws.parent[target] = node;
            ws.heap.push(edge.target, length + heuristic(edge.target));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
