//! Shortest paths on a roadmap: A* from one node to another, and the path lengths from one node to
//! many goals (a row of the cost matrix).
//!
//! Source: paper P3D §3.3 (A* per pair, cost matrix for the assignment). The heuristic is the
//! greater of the straight-line distance and the bound from the roadmap's landmarks. Both are
//! admissible and consistent: an edge is as long as the straight line between its nodes, and the
//! distances of its two nodes to a landmark differ by no more than its length. Blocked edges only
//! make paths longer, so both bounds still hold. Metres, f32. Cost O(half-edges + nodes · log
//! nodes), each node settled once; memory is the caller's [`SearchWorkspace`].
//!
//! Edge lengths are not stored but computed from the nodes. Most half-edges need no length: the
//! target is settled, or its distance is already too small for the squared length of this edge to
//! improve it. So a square root is taken only where it may change a distance. A host that searches
//! often keeps the lengths in memory ([`RoadmapWithLengths`]). Ties go to the lower node index, so
//! the same roadmap gives the same path on every machine.

use heapless::Vec;

use crate::Point;
use crate::roadmap::{HalfEdge, RoadmapView, decode_target};

pub(crate) mod heap;
use heap::{Heap, SETTLED};

/// Half-edges that are compared in one call of [`Graph::find_possible_improvements`]; a node rarely
/// has more.
const HALF_EDGE_CHUNK: usize = 64;
/// Indices into a chunk of half-edges. 256 entries, so that a `u8` index needs no bounds check.
type HalfEdgeIndices = [u8; 256];

/// Most targets for which [`search`] runs A* to each target in turn, not Dijkstra: a board's 32
/// vehicles.
const MAX_GUIDED_TARGETS: usize = 32;

/// Reason why a search has no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchError {
    /// No path over passable edges joins the two nodes.
    NoPath,
    /// The path has more nodes than the output holds.
    PathTooLong,
    /// The roadmap has no node with this index.
    BadNode(u16),
    /// The workspace holds fewer nodes, or half-edge lengths, than the roadmap has.
    WorkspaceTooSmall,
    /// The output slice is not as long as the number of results.
    OutputLength,
}

/// Memory of a search on roadmaps of up to `N` nodes: 16 bytes per node. All-zero when new, so a
/// static of it takes .bss only.
pub struct SearchWorkspace<const N: usize> {
    /// Length of the shortest path found to each node, metres; final once the node is settled.
    distance: [f32; N],
    /// Node before each node on that path; the source is its own parent.
    parent: [u16; N],
    /// Nodes reached and not settled, by distance plus heuristic.
    heap: Heap<N>,
}

impl<const N: usize> SearchWorkspace<N> {
    /// Creates an empty workspace: all zeros.
    pub const fn new() -> Self {
        assert!(N <= u16::MAX as usize, "node indices are 16 bits");
        Self { distance: [0.0; N], parent: [0; N], heap: Heap::new() }
    }

    /// Length in metres of the shortest path from the last search's source to `node`; infinite if
    /// the search did not settle `node`.
    pub fn distance_m(&self, node: u16) -> f32 {
        match self.distance.get(usize::from(node)) {
            Some(&distance) if self.heap.node_mark(node) == SETTLED => distance,
            _ => f32::INFINITY,
        }
    }

    /// Writes the nodes of the shortest path from the last search's source to `node`, both
    /// included. Leaves the workspace as it is, so it may be called for every target after
    /// [`path_lengths_to`].
    pub fn path_to<const P: usize>(
        &self,
        node: u16,
        out: &mut Vec<u16, P>,
    ) -> Result<(), SearchError> {
        out.clear();
        if usize::from(node) >= N || self.heap.node_mark(node) != SETTLED {
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

/// A roadmap that can be searched: as it lies in flash ([`RoadmapView`]), or with its edge lengths
/// in memory ([`RoadmapWithLengths`]). Both give the same paths and lengths, bit for bit.
pub trait Graph {
    /// The roadmap itself.
    fn view(&self) -> &RoadmapView<'_>;

    /// Length in metres of half-edge `k`, which leads from a node at `here` to node `target`.
    fn half_edge_length_m(&self, k: usize, here: &Point, target: u16) -> f32;

    /// Finds the half-edges that may shorten the path to their targets, where `reached` is the
    /// length of the path to `here`. Writes their indices within `half_edges` to `out` and returns
    /// their number. `first` is the index of `half_edges[0]` in the file. May include some that do
    /// not shorten a path, never leaves out one that does.
    ///
    /// Most half-edges shorten no path: the target is settled, or has a shorter path. Written
    /// without branches, which could not be predicted.
    fn find_possible_improvements<const N: usize>(
        &self,
        first: usize,
        half_edges: &[[u8; 4]],
        here: &Point,
        reached: f32,
        distance: &[f32; N],
        out: &mut HalfEdgeIndices,
    ) -> usize;
}

impl Graph for RoadmapView<'_> {
    fn view(&self) -> &RoadmapView<'_> {
        self
    }

    #[inline]
    fn half_edge_length_m(&self, _k: usize, here: &Point, target: u16) -> f32 {
        fpu::sqrtf((self.node(target) - here).norm_squared())
    }

    #[inline]
    fn find_possible_improvements<const N: usize>(
        &self,
        _first: usize,
        half_edges: &[[u8; 4]],
        here: &Point,
        reached: f32,
        distance: &[f32; N],
        out: &mut HalfEdgeIndices,
    ) -> usize {
        // The bound is raised a little, so that rounding hides no improvement; the exact comparison
        // follows in [`relax_edges`]. 1e-6 is eight times the rounding of the three products.
        /// Factor by which the bound on an edge's squared length is raised.
        const BOUND_ROUNDING: f32 = 1.0 + 1e-6;
        let mut count = 0_u8;
        for (place, half_edge) in half_edges.iter().enumerate() {
            let room = distance[target_index::<N>(half_edge)] - reached;
            let squared = (self.node(decode_target(half_edge)) - here).norm_squared();
            out[usize::from(count)] = place as u8;
            count =
                count.wrapping_add(u8::from(squared <= room * libm::fabsf(room) * BOUND_ROUNDING));
        }
        usize::from(count)
    }
}

/// A roadmap with the lengths of its half-edges in memory, 4 bytes each: for hosts that run many
/// searches on it.
#[derive(Clone, Copy, Debug)]
pub struct RoadmapWithLengths<'a> {
    /// The roadmap itself.
    view: RoadmapView<'a>,
    /// Length of each half-edge, metres, in the file's order.
    lengths: &'a [f32],
}

impl<'a> RoadmapWithLengths<'a> {
    /// Computes all lengths into `lengths`, which must have at least one entry per half-edge.
    pub fn new(view: RoadmapView<'a>, lengths: &'a mut [f32]) -> Result<Self, SearchError> {
        let lengths =
            lengths.get_mut(..view.half_edge_count()).ok_or(SearchError::WorkspaceTooSmall)?;
        for node in 0..view.node_count() as u16 {
            let (first, row) = view.half_edge_row(node);
            for (length, half_edge) in lengths[first..].iter_mut().zip(row) {
                *length = view.distance_m(node, decode_target(half_edge));
            }
        }
        Ok(Self { view, lengths })
    }
}

impl Graph for RoadmapWithLengths<'_> {
    fn view(&self) -> &RoadmapView<'_> {
        &self.view
    }

    #[inline]
    fn half_edge_length_m(&self, k: usize, _here: &Point, _target: u16) -> f32 {
        self.lengths[k]
    }

    #[inline]
    fn find_possible_improvements<const N: usize>(
        &self,
        first: usize,
        half_edges: &[[u8; 4]],
        _here: &Point,
        reached: f32,
        distance: &[f32; N],
        out: &mut HalfEdgeIndices,
    ) -> usize {
        let mut count = 0_u8;
        let lengths = &self.lengths[first..first + half_edges.len()];
        for (place, (half_edge, length)) in half_edges.iter().zip(lengths).enumerate() {
            out[usize::from(count)] = place as u8;
            let gain = reached + length < distance[target_index::<N>(half_edge)];
            count = count.wrapping_add(u8::from(gain));
        }
        usize::from(count)
    }
}

/// The shortest path from `from` to `to` over passable edges. Returns its length in metres and
/// writes its nodes, both ends included, to `out_nodes`.
///
/// `passable(node, edge)` returns whether the vehicle may fly `edge` from `node`: enough clearance,
/// and neither node nor edge blocked.
pub fn astar<const N: usize, const P: usize>(
    graph: &impl Graph,
    from: u16,
    to: u16,
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
    out_nodes: &mut Vec<u16, P>,
) -> Result<f32, SearchError> {
    out_nodes.clear();
    search(graph, from, &[to], passable, ws)?;
    ws.path_to(to, out_nodes)?;
    Ok(ws.distance_m(to))
}

/// Shortest paths over passable edges from `from` to every node that can be reached. Their results
/// are read with [`SearchWorkspace::distance_m`] and [`SearchWorkspace::path_to`].
pub fn dijkstra_all<const N: usize>(
    graph: &impl Graph,
    from: u16,
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
) -> Result<(), SearchError> {
    reset_for_search(graph.view(), from, ws)?;
    let mut gains = [0; 256];
    while let Some(node) = ws.heap.pop() {
        relax_edges(graph, node, &passable, |_| 0.0, ws, &mut gains);
    }
    Ok(())
}

/// Writes the lengths in metres of the shortest passable paths from `from` to each of `targets` to
/// `out`; infinite where there is none. One row of the cost matrix; stops when all targets are
/// settled.
///
/// For up to 32 targets it is an A* to each target in turn: nodes settled for one target stay
/// settled, since their distances are final, and only the heap is reordered by the heuristic of the
/// next target. For more targets it is Dijkstra's algorithm.
pub fn path_lengths_to<const N: usize>(
    graph: &impl Graph,
    from: u16,
    targets: &[u16],
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
    out: &mut [f32],
) -> Result<(), SearchError> {
    if out.len() != targets.len() {
        return Err(SearchError::OutputLength);
    }
    search(graph, from, targets, passable, ws)?;
    for (length, &target) in out.iter_mut().zip(targets) {
        *length = ws.distance_m(target);
    }
    Ok(())
}

/// Dijkstra over all edges: settles every node that can be reached from `from`.
pub(crate) fn shortest_path_tree<const N: usize>(
    view: &RoadmapView<'_>,
    from: u16,
    ws: &mut SearchWorkspace<N>,
) -> Result<(), SearchError> {
    reset_for_search(view, from, ws)?;
    let mut gains = [0; 256];
    while let Some(node) = ws.heap.pop() {
        relax_edges(view, node, &|_, _| true, |_| 0.0, ws, &mut gains);
    }
    Ok(())
}

/// The cost matrix of an assignment: lengths in metres of the shortest passable paths from each of
/// `starts` to each of `goals`, row-major into `out`; infinite where there is none.
///
/// Searches from the starts or, backwards, from the goals, whichever is likely less work: an A* to
/// targets that lie close together settles few nodes off the paths. `passable` is always called
/// with the direction of flight.
pub fn cost_matrix<const N: usize>(
    graph: &impl Graph,
    starts: &[u16],
    goals: &[u16],
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
    out: &mut [f32],
) -> Result<(), SearchError> {
    if starts.len().checked_mul(goals.len()) != Some(out.len()) {
        return Err(SearchError::OutputLength);
    }
    let view = graph.view();
    for &node in starts.iter().chain(goals) {
        check_node(view, node)?;
    }
    if out.is_empty() {
        return Ok(());
    }
    let ((starts_at, starts_across), (goals_at, goals_across)) = (
        bounding_box_centre_and_diagonal(view, starts),
        bounding_box_centre_and_diagonal(view, goals),
    );
    let between = fpu::sqrtf((goals_at - starts_at).norm_squared());
    let from_starts = starts.len() as f32 * (between + goals_across);
    let from_goals = goals.len() as f32 * (between + starts_across);
    if from_starts <= from_goals {
        for (&start, row) in starts.iter().zip(out.chunks_mut(goals.len())) {
            path_lengths_to(graph, start, goals, &passable, ws, row)?;
        }
        return Ok(());
    }
    let in_flight =
        |node: u16, edge: &HalfEdge| passable(edge.target, &HalfEdge { target: node, ..*edge });
    for (column, &goal) in goals.iter().enumerate() {
        search(graph, goal, starts, in_flight, ws)?;
        for (row, &start) in starts.iter().enumerate() {
            out[row * goals.len() + column] = ws.distance_m(start);
        }
    }
    Ok(())
}

/// Centre and diagonal of the bounding box of some nodes, metres.
fn bounding_box_centre_and_diagonal(view: &RoadmapView<'_>, nodes: &[u16]) -> (Point, f32) {
    let first = nodes.first().map_or(Point::zeros(), |&node| view.node(node));
    let corners = nodes.iter().map(|&node| view.node(node));
    let (low, high) = corners.fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    ((low + high) / 2.0, fpu::sqrtf((high - low).norm_squared()))
}

/// Index of a half-edge's target in the search's arrays. No target of a checked roadmap is `N` or
/// more; where `N` is a power of two the mask lets the compiler leave out the bounds check.
#[inline(always)]
fn target_index<const N: usize>(half_edge: &[u8; 4]) -> usize {
    let target = u32::from_le_bytes(*half_edge) as usize & 0xffff;
    if N.is_power_of_two() { target & (N - 1) } else { target }
}

/// Refuses a node that the roadmap does not have.
fn check_node(view: &RoadmapView<'_>, node: u16) -> Result<(), SearchError> {
    if usize::from(node) < view.node_count() { Ok(()) } else { Err(SearchError::BadNode(node)) }
}

/// Settles nodes until all of `targets` are settled or the heap is empty. A* to each target in
/// turn, or Dijkstra for more than [`MAX_GUIDED_TARGETS`].
fn search<const N: usize>(
    graph: &impl Graph,
    from: u16,
    targets: &[u16],
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
) -> Result<(), SearchError> {
    let view = graph.view();
    for &target in targets {
        check_node(view, target)?;
    }
    reset_for_search(view, from, ws)?;
    let mut gains = [0; 256];
    let informed = targets.len() <= MAX_GUIDED_TARGETS;
    for &target in targets {
        let (goal, [goal_a, goal_b]) = (view.node(target), view.landmark_distances_m(target));
        let heuristic = |node: u16| {
            if !informed {
                return 0.0;
            }
            let [a, b] = view.landmark_distances_m(node);
            let straight = fpu::sqrtf((view.node(node) - goal).norm_squared());
            straight.max(libm::fabsf(a - goal_a)).max(libm::fabsf(b - goal_b))
        };
        if informed && ws.heap.node_mark(target) != SETTLED {
            let distance = &ws.distance;
            ws.heap.recompute_costs(|node| distance[usize::from(node)] + heuristic(node));
        }
        while ws.heap.node_mark(target) != SETTLED
            && let Some(node) = ws.heap.pop()
        {
            relax_edges(graph, node, &passable, heuristic, ws, &mut gains);
        }
    }
    Ok(())
}

/// Resets the workspace for a search that starts at node `from`, at distance 0.
fn reset_for_search<const N: usize>(
    view: &RoadmapView<'_>,
    from: u16,
    ws: &mut SearchWorkspace<N>,
) -> Result<(), SearchError> {
    if view.node_count() > N {
        return Err(SearchError::WorkspaceTooSmall);
    }
    check_node(view, from)?;
    ws.heap.clear(view.node_count());
    let distance = &mut ws.distance[..view.node_count()];
    distance.fill(f32::INFINITY);
    distance[usize::from(from)] = 0.0;
    ws.parent[usize::from(from)] = from;
    ws.heap.push(from, 0.0);
    Ok(())
}

/// Relaxes the edges of the settled `node`: a neighbour that is reached by a shorter path gets
/// `node` as its parent and goes into the heap.
#[inline]
fn relax_edges<const N: usize>(
    graph: &impl Graph,
    node: u16,
    passable: &impl Fn(u16, &HalfEdge) -> bool,
    heuristic: impl Fn(u16) -> f32,
    ws: &mut SearchWorkspace<N>,
    gains: &mut HalfEdgeIndices,
) {
    let view = graph.view();
    let distance = &mut ws.distance;
    let (here, reached) = (view.node(node), distance[usize::from(node)]);
    let (first, row) = view.half_edge_row(node);
    for (chunk, half_edges) in row.chunks(HALF_EDGE_CHUNK).enumerate() {
        let first = first + chunk * HALF_EDGE_CHUNK;
        let count =
            graph.find_possible_improvements(first, half_edges, &here, reached, distance, gains);
        for &place in gains.iter().take(count) {
            let (k, target) =
                (first + usize::from(place), decode_target(&half_edges[usize::from(place)]));
            let length = reached + graph.half_edge_length_m(k, &here, target);
            let gain =
                length < distance[usize::from(target)] && ws.heap.node_mark(target) != SETTLED;
            if gain && passable(node, &view.half_edge(k)) {
                distance[usize::from(target)] = length;
                ws.parent[usize::from(target)] = node;
                ws.heap.push(target, length + heuristic(target));
            }
        }
    }
}

#[cfg(test)]
mod tests;
