//! Shortest paths on a roadmap: A* for one pair, one Dijkstra row for a vehicle's costs to many
//! goals.
//!
//! Source: P3D §3.3 (A* per pair, cost matrix for the allocation); the heuristic is the greater of
//! the straight distance and what the roadmap's landmarks tell, both admissible and consistent: an
//! edge is as long as the straight line between its nodes, and no way to a landmark differs between
//! its ends by more. Blocked edges only lengthen ways. Metres, f32. Cost O(half-edges + nodes · log
//! nodes), each node settled once; memory is the caller's [`SearchWorkspace`].
//!
//! Edge lengths are not stored but follow from the nodes. Most half-edges never need theirs: the
//! target is settled or already reached too cheaply for any edge of that squared length, so a
//! square root is taken only when it may change a distance. A host that searches often keeps the
//! lengths at hand ([`RoadmapWithLengths`]). Ties go to the lower node index, so the same roadmap
//! gives the same path everywhere.

use heapless::Vec;

use crate::Point;
use crate::roadmap::{HalfEdge, RoadmapView, target_of};

pub(crate) mod heap;
use heap::{Heap, SETTLED};

/// Half-edges compared together; a node rarely has more.
const HALF_EDGE_CHUNK: usize = 64;
/// Places in a chunk; as long as a `u8` can count, so that no index needs a check.
type Improvements = [u8; 256];

/// Most targets for which the search is guided (A*) to each target in turn: a board's 32 vehicles.
const MAX_GUIDED_TARGETS: usize = 32;

/// Reason why a search has no result.
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

/// Scratch memory for roadmaps of up to `N` nodes: 16 bytes a node. All-zero when new, so a static
/// costs .bss only.
pub struct SearchWorkspace<const N: usize> {
    distance: [f32; N],
    parent: [u16; N],
    heap: Heap<N>,
}

impl<const N: usize> SearchWorkspace<N> {
    /// Creates it empty: all zeros.
    pub const fn new() -> Self {
        assert!(N <= u16::MAX as usize, "node indices are 16 bits");
        Self { distance: [0.0; N], parent: [0; N], heap: Heap::new() }
    }

    /// Length in metres of the shortest way from the last search's source to `node`; infinite if it
    /// was not settled.
    pub fn distance_m(&self, node: u16) -> f32 {
        match self.distance.get(usize::from(node)) {
            Some(&distance) if self.heap.entry_index(node) == SETTLED => distance,
            _ => f32::INFINITY,
        }
    }

    /// Writes the nodes from the last search's source to `node`, both included. Only the parents
    /// are read, so a path may be taken out for every target of a [`dijkstra_row`].
    pub fn path_to<const P: usize>(
        &self,
        node: u16,
        out: &mut Vec<u16, P>,
    ) -> Result<(), SearchError> {
        out.clear();
        if usize::from(node) >= N || self.heap.entry_index(node) != SETTLED {
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

/// A roadmap to search: as it lies in flash ([`RoadmapView`]), or with its edge lengths at hand
/// ([`RoadmapWithLengths`]). Both give the same paths and lengths, bit for bit.
pub trait Graph {
    /// The roadmap.
    fn view(&self) -> &RoadmapView<'_>;

    /// Length in metres of half-edge `k`, which leads from `here` to `target`.
    fn length(&self, k: usize, here: &Point, target: u16) -> f32;

    /// Which of these half-edges may shorten the way to their targets, `reached` being the way to
    /// `here`: their places in `half_edges` go to `out`, their number is returned. `first` is the
    /// index of the first. None that does is left out.
    ///
    /// Most do not: the target is settled, or reached more cheaply. They are distinguished by
    /// selects, since which they are cannot be predicted.
    fn find_improvements<const N: usize>(
        &self,
        first: usize,
        half_edges: &[[u8; 4]],
        here: &Point,
        reached: f32,
        distance: &[f32; N],
        out: &mut Improvements,
    ) -> usize;
}

impl Graph for RoadmapView<'_> {
    fn view(&self) -> &RoadmapView<'_> {
        self
    }

    #[inline]
    fn length(&self, _k: usize, here: &Point, target: u16) -> f32 {
        fpu::sqrtf((self.node(target) - here).norm_squared())
    }

    #[inline]
    fn find_improvements<const N: usize>(
        &self,
        _first: usize,
        half_edges: &[[u8; 4]],
        here: &Point,
        reached: f32,
        distance: &[f32; N],
        out: &mut Improvements,
    ) -> usize {
        // A little more room than there is, so that rounding never hides a gain: the exact
        // comparison comes later. 1e-6 is eight times the rounding of the three products.
        /// Factor by which rounding may raise a lower bound of the distance to the target.
        const BOUND_ROUNDING: f32 = 1.0 + 1e-6;
        let mut count = 0_u8;
        for (place, half_edge) in half_edges.iter().enumerate() {
            let room = distance[target_index::<N>(half_edge)] - reached;
            let squared = (self.node(target_of(half_edge)) - here).norm_squared();
            out[usize::from(count)] = place as u8;
            count =
                count.wrapping_add(u8::from(squared <= room * libm::fabsf(room) * BOUND_ROUNDING));
        }
        usize::from(count)
    }
}

/// A roadmap with the lengths of its half-edges in memory, 4 bytes each: for hosts, where many
/// searches follow.
#[derive(Clone, Copy, Debug)]
pub struct RoadmapWithLengths<'a> {
    view: RoadmapView<'a>,
    lengths: &'a [f32],
}

impl<'a> RoadmapWithLengths<'a> {
    /// Fills `lengths`, which holds one number for each half-edge or more.
    pub fn new(view: RoadmapView<'a>, lengths: &'a mut [f32]) -> Result<Self, SearchError> {
        let lengths =
            lengths.get_mut(..view.half_edge_count()).ok_or(SearchError::WorkspaceTooSmall)?;
        for node in 0..view.node_count() as u16 {
            let (first, row) = view.half_edges_of(node);
            for (length, half_edge) in lengths[first..].iter_mut().zip(row) {
                *length = view.distance_m(node, target_of(half_edge));
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
    fn length(&self, k: usize, _here: &Point, _target: u16) -> f32 {
        self.lengths[k]
    }

    #[inline]
    fn find_improvements<const N: usize>(
        &self,
        first: usize,
        half_edges: &[[u8; 4]],
        _here: &Point,
        reached: f32,
        distance: &[f32; N],
        out: &mut Improvements,
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

/// The shortest passable path from `from` to `to`. Returns its length in metres and leaves its
/// nodes, ends included, in `out_nodes`.
///
/// `passable(node, edge)` says whether `edge` may be flown out of `node`: size by clearance,
/// blocked nodes and edges.
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

/// The shortest passable paths from `from` to every node that can be reached:
/// [`SearchWorkspace::distance_m`] and [`SearchWorkspace::path_to`] tell them.
pub fn dijkstra_all<const N: usize>(
    graph: &impl Graph,
    from: u16,
    passable: impl Fn(u16, &HalfEdge) -> bool,
    ws: &mut SearchWorkspace<N>,
) -> Result<(), SearchError> {
    start_search(graph.view(), from, ws)?;
    let mut gains = [0; 256];
    while let Some(node) = ws.heap.pop() {
        relax_edges(graph, node, &passable, |_| 0.0, ws, &mut gains);
    }
    Ok(())
}

/// Lengths in metres of the shortest passable paths from `from` to each of `targets`, into `out`;
/// infinite where there is none. One row of the cost matrix; stops when all targets are settled.
///
/// For few targets the search is drawn to them one after another: what A* settled for one target
/// stays settled, its distance is final, and only the waiting nodes are ordered again for the next.
/// For many it is Dijkstra's.
pub fn dijkstra_row<const N: usize>(
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

/// Settles every node that can be reached from `from` over any edge.
pub(crate) fn shortest_path_tree<const N: usize>(
    view: &RoadmapView<'_>,
    from: u16,
    ws: &mut SearchWorkspace<N>,
) -> Result<(), SearchError> {
    start_search(view, from, ws)?;
    let mut gains = [0; 256];
    while let Some(node) = ws.heap.pop() {
        relax_edges(view, node, &|_, _| true, |_| 0.0, ws, &mut gains);
    }
    Ok(())
}

/// The cost matrix of an allocation: lengths in metres of the shortest passable paths from each of
/// `starts` to each of `goals`, row-major into `out`; infinite where there is none.
///
/// Searched from the starts or, against the direction of flight, from the goals, whichever is
/// likely less work: a search drawn to targets that lie close together settles few nodes beside
/// those on the way. `passable` is always asked about the direction of flight.
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
    let ((starts_at, starts_across), (goals_at, goals_across)) =
        (bounding_box(view, starts), bounding_box(view, goals));
    let between = fpu::sqrtf((goals_at - starts_at).norm_squared());
    let from_starts = starts.len() as f32 * (between + goals_across);
    let from_goals = goals.len() as f32 * (between + starts_across);
    if from_starts <= from_goals {
        for (&start, row) in starts.iter().zip(out.chunks_mut(goals.len())) {
            dijkstra_row(graph, start, goals, &passable, ws, row)?;
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

/// Centre and diagonal of the box around some nodes.
fn bounding_box(view: &RoadmapView<'_>, nodes: &[u16]) -> (Point, f32) {
    let first = nodes.first().map_or(Point::zeros(), |&node| view.node(node));
    let corners = nodes.iter().map(|&node| view.node(node));
    let (low, high) = corners.fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    ((low + high) / 2.0, fpu::sqrtf((high - low).norm_squared()))
}

/// Index of the values of a half-edge's target. No target of a checked roadmap is beyond `N`; where
/// `N` is a power of two the compiler sees it too and leaves out the check.
#[inline(always)]
fn target_index<const N: usize>(half_edge: &[u8; 4]) -> usize {
    let target = u32::from_le_bytes(*half_edge) as usize & 0xffff;
    if N.is_power_of_two() { target & (N - 1) } else { target }
}

fn check_node(view: &RoadmapView<'_>, node: u16) -> Result<(), SearchError> {
    if usize::from(node) < view.node_count() { Ok(()) } else { Err(SearchError::BadNode(node)) }
}

/// Settles nodes until all of `targets` are settled or none is left to settle.
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
    start_search(view, from, ws)?;
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
        if informed && ws.heap.entry_index(target) != SETTLED {
            let distance = &ws.distance;
            ws.heap.reorder(|node| distance[usize::from(node)] + heuristic(node));
        }
        while ws.heap.entry_index(target) != SETTLED
            && let Some(node) = ws.heap.pop()
        {
            relax_edges(graph, node, &passable, heuristic, ws, &mut gains);
        }
    }
    Ok(())
}

/// Empties the workspace but for `from`.
fn start_search<const N: usize>(
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

/// Offers the settled `node`'s edges to its neighbours.
#[inline]
fn relax_edges<const N: usize>(
    graph: &impl Graph,
    node: u16,
    passable: &impl Fn(u16, &HalfEdge) -> bool,
    heuristic: impl Fn(u16) -> f32,
    ws: &mut SearchWorkspace<N>,
    gains: &mut Improvements,
) {
    let view = graph.view();
    let distance = &mut ws.distance;
    let (here, reached) = (view.node(node), distance[usize::from(node)]);
    let (first, row) = view.half_edges_of(node);
    for (chunk, half_edges) in row.chunks(HALF_EDGE_CHUNK).enumerate() {
        let first = first + chunk * HALF_EDGE_CHUNK;
        let count = graph.find_improvements(first, half_edges, &here, reached, distance, gains);
        for &place in gains.iter().take(count) {
            let (k, target) =
                (first + usize::from(place), target_of(&half_edges[usize::from(place)]));
            let length = reached + graph.length(k, &here, target);
            let gain =
                length < distance[usize::from(target)] && ws.heap.entry_index(target) != SETTLED;
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
