//! Adds nodes in narrow passages that random sampling misses: if the roadmap does not connect a
//! start to a goal and the map does, the corners of a path over the map's cells become nodes.
//!
//! A passage hardly wider than a vehicle and its margin takes up next to nothing of the space that
//! nodes are drawn from, so no number of random nodes is sure to find it. The nodes added here lie
//! on the centres of cells, and every step between two of them keeps the required clearance, so the
//! new edges are as clear as any other.
//!
//! Cost: an A* search over the map's cells for each pair of components that is to be joined; a
//! mission whose roadmap connects all its starts and goals pays only for the tree of boxes and for
//! testing whether they are connected.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use planner_core::Point;
use planner_core::map::voxel::GridShape;
use planner_core::roadmap::Edge;
use planner_core::roadmap::prm::PrmConfig;

use crate::map::{BoxTree, VoxelMap};

/// Clearance of a passage's path beyond the required one, metres: more than rounding errors, and
/// more than the millimetre to which the roadmap file rounds down.
const CLEARANCE_SLACK_M: f32 = 1.2e-3;
/// Largest map that is searched, cells: the search keeps about nine bytes a cell.
const MAX_SEARCHED_CELLS: usize = 1 << 25;

/// A start and a goal, as nodes, that are to be connected, and the clearance that their vehicle
/// requires, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WantedConnection {
    /// The start's node.
    pub start_node: usize,
    /// The goal's node.
    pub goal_node: usize,
    /// Required clearance, metres: the vehicle's radius and safety margin.
    pub required_clearance_m: f32,
}

/// Nodes that connect each wanted pair that `edges` do not connect. A pair for which the map has no
/// path gets none.
pub fn missing_passage_nodes(
    map: &VoxelMap,
    tree: &BoxTree,
    nodes: &[Point],
    edges: &[Edge],
    config: &PrmConfig,
    wanted: &[WantedConnection],
) -> Vec<Point> {
    let mut wanted = wanted.to_vec();
    // Widest first: a passage found for a large vehicle also serves smaller ones.
    wanted.sort_by(|a, b| b.required_clearance_m.total_cmp(&a.required_clearance_m));
    let mut found = Vec::new();
    let mut ways: Vec<WantedConnection> = Vec::new();
    for class in wanted.chunk_by(|a, b| a.required_clearance_m == b.required_clearance_m) {
        let required_m = class[0].required_clearance_m;
        let mut parts = ConnectedComponents::new(nodes.len(), edges, required_m);
        ways.iter().for_each(|way| parts.union(way.start_node, way.goal_node));
        let mut walled_off = BTreeSet::new();
        for pair in class {
            let (from, to) =
                (parts.component_of(pair.start_node), parts.component_of(pair.goal_node));
            if from == to || walled_off.contains(&(from, to)) {
                continue;
            }
            let ends = (nodes[pair.start_node], nodes[pair.goal_node]);
            let cells = CellSearch::new(map, tree, required_m)
                .and_then(|search| search.shortest_cell_path(&ends.0, &ends.1));
            match cells.and_then(|way| fewest_corners(tree, &way, config, required_m)) {
                Some(corners) => {
                    found.extend(corners);
                    ways.push(*pair);
                    parts.union(pair.start_node, pair.goal_node);
                }
                None => drop(walled_off.insert((from, to))),
            }
        }
    }
    found
}

/// Connected components (union-find) of the edges wider than a clearance; the lowest node is the
/// root.
pub(super) struct ConnectedComponents(Vec<usize>);

impl ConnectedComponents {
    pub(super) fn new(nodes: usize, edges: &[Edge], required_m: f32) -> Self {
        let mut parts = Self((0..nodes).collect());
        for edge in edges.iter().filter(|edge| edge.clearance_m > required_m) {
            parts.union(usize::from(edge.a), usize::from(edge.b));
        }
        parts
    }

    /// The root of a node's component.
    pub(super) fn component_of(&mut self, mut node: usize) -> usize {
        while self.0[node] != node {
            self.0[node] = self.0[self.0[node]];
            node = self.0[node];
        }
        node
    }

    /// Joins the components of two nodes.
    fn union(&mut self, a: usize, b: usize) {
        let (a, b) = (self.component_of(a), self.component_of(b));
        self.0[a.max(b)] = a.min(b);
    }
}

/// Whether a straight segment keeps the required clearance and [`CLEARANCE_SLACK_M`] more.
fn is_clear_with_slack(tree: &BoxTree, a: &Point, b: &Point, required_m: f32) -> bool {
    let enough_m = required_m + CLEARANCE_SLACK_M;
    tree.clearance_m(a, b, 2.0 * enough_m, enough_m) > enough_m
}

/// An A* search over the centres of the map's cells.
struct CellSearch<'a> {
    shape: &'a GridShape,
    map: &'a VoxelMap,
    /// Obstacles of the map.
    tree: &'a BoxTree,
    /// Clearance that a cell's centre needs, metres.
    required_m: f32,
}

impl<'a> CellSearch<'a> {
    /// The search; `None` if the map has more than [`MAX_SEARCHED_CELLS`] cells.
    fn new(map: &'a VoxelMap, tree: &'a BoxTree, required_m: f32) -> Option<Self> {
        let cells =
            map.shape.dims.iter().try_fold(1_usize, |all, &d| all.checked_mul(d as usize))?;
        (cells <= MAX_SEARCHED_CELLS).then_some(Self { shape: &map.shape, map, tree, required_m })
    }

    /// Number of a cell in the map, x fastest; [`Self::cell`] is the inverse.
    fn index(&self, [i, j, k]: [u32; 3]) -> usize {
        let [nx, ny, _] = self.shape.dims.map(|d| d as usize);
        (k as usize * ny + j as usize) * nx + i as usize
    }

    /// Coordinates of the cell of this index.
    fn cell(&self, index: usize) -> [u32; 3] {
        let [nx, ny, _] = self.shape.dims.map(|d| d as usize);
        [index % nx, index / nx % ny, index / nx / ny].map(|c| c as u32)
    }

    /// Centre of a cell, metres in the mission frame.
    fn centre(&self, cell: [u32; 3]) -> Point {
        let [i, j, k] = cell.map(|c| c as f32 + 0.5);
        self.shape.min + Point::new(i, j, k) * self.shape.resolution_m
    }

    /// The cell itself and its up to 26 neighbours inside the map.
    fn cell_and_neighbours(&self, cell: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
        let dims = self.shape.dims;
        (0..27).filter_map(move |n| {
            let step = [n % 3, n / 3 % 3, n / 9];
            let mut next = [0; 3];
            for axis in 0..3 {
                next[axis] =
                    (cell[axis] + step[axis]).checked_sub(1).filter(|&c| c < dims[axis])?;
            }
            Some(next)
        })
    }

    /// Of the cell that holds `place` and its neighbours, those to whose centres a clear straight
    /// segment leads from `place`.
    fn adjacent_cells_in_sight(&self, place: &Point) -> Vec<usize> {
        let Some(cell) = self.shape.cell_of(place) else { return Vec::new() };
        let sees = |next: &[u32; 3]| {
            is_clear_with_slack(self.tree, place, &self.centre(*next), self.required_m)
        };
        self.cell_and_neighbours(cell).filter(sees).map(|next| self.index(next)).collect()
    }

    /// The points of a shortest path over cell centres, `from` and `to` included; `None` if there
    /// is none.
    fn shortest_cell_path(&self, from: &Point, to: &Point) -> Option<Vec<Point>> {
        let ends: BTreeSet<usize> = self.adjacent_cells_in_sight(to).into_iter().collect();
        let grid = self.map.grid();
        let never_sample = self.map.no_node_grid();
        let cells = self.shape.dims.iter().map(|&d| d as usize).product();
        let (mut cost, mut came) = (vec![f32::INFINITY; cells], vec![u32::MAX; cells]);
        let mut open = BinaryHeap::new();
        // `f32` is not `Ord`; non-negative floats order like their bits.
        let rank = |cost_m: f32, at: &Point| Reverse((cost_m + (to - at).norm()).to_bits());
        for index in self.adjacent_cells_in_sight(from) {
            let centre = self.centre(self.cell(index));
            cost[index] = (centre - from).norm();
            open.push((rank(cost[index], &centre), index));
        }
        let mut done = vec![0_u64; cells.div_ceil(64)];
        while let Some((_, index)) = open.pop() {
            if done[index / 64] >> (index % 64) & 1 == 1 {
                continue;
            }
            done[index / 64] |= 1 << (index % 64);
            let (cell, centre) = (self.cell(index), self.centre(self.cell(index)));
            if ends.contains(&index) {
                let back = std::iter::successors(Some(index), |&i| {
                    Some(came[i] as usize).filter(|&i| i < cells)
                });
                let mut way: Vec<Point> = back.map(|i| self.centre(self.cell(i))).collect();
                way.reverse();
                return Some(std::iter::once(*from).chain(way).chain([*to]).collect());
            }
            for next in self.cell_and_neighbours(cell) {
                let (i, place) = (self.index(next), self.centre(next));
                let cost_m = cost[index] + (place - centre).norm();
                if cost_m < cost[i]
                    && !grid.is_occupied(next)
                    && !never_sample.is_blocked_at(&place)
                    && is_clear_with_slack(self.tree, &centre, &place, self.required_m)
                {
                    (cost[i], came[i]) = (cost_m, index as u32);
                    open.push((rank(cost_m, &place), i));
                }
            }
        }
        None
    }
}

/// The inner corners (at least one) of the path along `way` that has the fewest edges. Each edge is
/// clear, and its length is within the limits of `config`. `None` if no such path exists.
fn fewest_corners(
    tree: &BoxTree,
    way: &[Point],
    config: &PrmConfig,
    required_m: f32,
) -> Option<Vec<Point>> {
    let last = way.len() - 1;
    let mut hops = vec![u32::MAX; way.len()];
    let mut came = vec![0; way.len()];
    hops[0] = 0;
    for i in 1..=last {
        for j in (0..i).filter(|&j| (j, i) != (0, last)) {
            let length_m = (way[i] - way[j]).norm();
            let fits = (config.edge_min_m..=config.edge_max_m).contains(&length_m);
            let hops_here = hops[j].saturating_add(1);
            if fits
                && hops_here < hops[i]
                && is_clear_with_slack(tree, &way[j], &way[i], required_m)
            {
                (hops[i], came[i]) = (hops_here, j);
            }
        }
    }
    if hops[last] == u32::MAX {
        return None;
    }
    let back = std::iter::successors(Some(came[last]), |&i| Some(came[i]).filter(|_| i > 0));
    let mut corners: Vec<Point> = back.take_while(|&i| i > 0).map(|i| way[i]).collect();
    corners.reverse();
    Some(corners)
}

#[cfg(test)]
mod tests;
