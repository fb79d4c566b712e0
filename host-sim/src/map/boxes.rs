//! Distances from segments to a map's obstacles by a tree of bounding boxes, for the many edges of
//! a roadmap.
//!
//! The occupied cells are merged into boxes: within each brick of 4 × 4 × 4 cells, then along x, y
//! and z where boxes have equal cross-sections, so a wall is one box or a few. Over the boxes lies
//! a bounding volume hierarchy with eight boxes to a node. A search by branch and bound finds the
//! nearest box: it skips nodes that are no nearer than the nearest box found so far. Its cost does
//! not grow with the cube of the distance, as that of
//! [`planner_core::map::segment::segment_clearance`] does. The result is the same but for rounding:
//! both compute in f32 in cells, with an error of n · 2⁻²³ in a coordinate of n cells. Memory: 30
//! bytes a box.

use planner_core::Point;
use planner_core::map::voxel::{GridShape, Outside, VoxelGrid};
use pulp::Arch;
use rayon::prelude::*;

use search::{BOXES_PER_NODE, BoxSearch, CellSegment, Node};

mod lanes;
mod search;

/// Largest number of boxes whose subtree one thread builds alone; subtrees over more boxes are
/// built on several threads.
const MAX_BOXES_PER_THREAD: usize = 512;
/// Number of bins along an axis into which boxes are sorted; a group of boxes is split at the
/// border of two bins.
const SPLIT_BINS: usize = 16;
/// Building the tree assumes that a search opens the nodes within this distance of its segment,
/// metres: the clearance of most edges is less.
const ASSUMED_CLEARANCE_M: f32 = 0.6;

/// A box of the cells `low..high` along x, y and z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct CellBox {
    low: [u16; 3],
    high: [u16; 3],
}

impl CellBox {
    /// Twice the centre along an axis, cells.
    fn twice_center(&self, axis: usize) -> u32 {
        u32::from(self.low[axis]) + u32::from(self.high[axis])
    }

    /// The smallest box around both.
    fn union(&self, other: &Self) -> Self {
        Self {
            low: [0, 1, 2].map(|a| self.low[a].min(other.low[a])),
            high: [0, 1, 2].map(|a| self.high[a].max(other.high[a])),
        }
    }

    /// The bounds along the other two axes as one number: equal for two boxes with the same
    /// cross-section.
    fn cross_section_key(&self, axis: usize) -> u64 {
        let (v, w) = ((axis + 1) % 3, (axis + 2) % 3);
        let sides = [self.low[v], self.high[v], self.low[w], self.high[w]];
        sides.into_iter().fold(0, |all, side| all << 16 | u64::from(side))
    }

    /// Estimated number of segments that pass the box within `near` cells, up to a factor: half the
    /// surface of the box grown by `near`, less a constant.
    fn split_cost(&self, near: f32) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|a| f32::from(self.high[a] - self.low[a]));
        x * y + y * z + z * x + core::f32::consts::PI * near * (x + y + z)
    }
}

/// Splits the occupied cells of one brick into boxes.
fn brick_to_boxes(mut word: u64, brick: [usize; 3], out: &mut Vec<CellBox>) {
    while word != 0 {
        let bit = word.trailing_zeros();
        let first = [bit & 3, bit >> 2 & 3, bit >> 4];
        // From the first cell left, a box extends along x as far as cells are occupied, then along
        // y as long as whole rows are, then along z as long as whole layers are.
        let mut size = [1, 1, 1];
        let mut mask = 1_u64 << bit;
        for (axis, stride) in [1, 4, 16].into_iter().enumerate() {
            let one = mask;
            while first[axis] + size[axis] < 4
                && word & one << (stride * size[axis]) == one << (stride * size[axis])
            {
                mask |= one << (stride * size[axis]);
                size[axis] += 1;
            }
        }
        word &= !mask;
        let low = [0, 1, 2].map(|a| (4 * brick[a]) as u16 + first[a] as u16);
        out.push(CellBox { low, high: [0, 1, 2].map(|a| low[a] + size[a] as u16) });
    }
}

/// Merges boxes that touch along an axis and have the same cross-section.
fn join_along(axis: usize, boxes: &mut Vec<CellBox>) {
    boxes.sort_by_cached_key(|b| (b.cross_section_key(axis), b.low[axis]));
    boxes.dedup_by(|next, last| {
        let joins = last.cross_section_key(axis) == next.cross_section_key(axis)
            && last.high[axis] == next.low[axis];
        if joins {
            last.high[axis] = next.high[axis];
        }
        joins
    });
}

/// Disjoint boxes that together hold exactly the occupied cells of a map.
fn boxes_of_map(grid: &VoxelGrid<'_>) -> Vec<CellBox> {
    let [bx, by, _] = grid.shape().brick_dims().map(|n| n as usize);
    let layers: Vec<Vec<CellBox>> = grid
        .words()
        .par_chunks(bx * by)
        .enumerate()
        .map(|(k, layer)| {
            let mut boxes = Vec::new();
            for (at, &word) in layer.iter().enumerate() {
                brick_to_boxes(word, [at % bx, at / bx, k], &mut boxes);
            }
            join_along(0, &mut boxes);
            join_along(1, &mut boxes);
            boxes
        })
        .collect();
    let mut boxes = layers.concat();
    join_along(2, &mut boxes);
    boxes
}

/// A bounding volume hierarchy over the obstacles of a map.
#[derive(Debug)]
pub struct BoxTree {
    /// Place and size of the map.
    shape: GridShape,
    /// Whether the space beyond the map's faces is an obstacle.
    beyond_map: Outside,
    /// The root is the first node.
    nodes: Vec<Node>,
    /// Vector instructions that this machine supports.
    arch: Arch,
}

impl BoxTree {
    /// Builds the tree over a map. Cost: O(bricks + boxes · log boxes).
    pub fn new(grid: &VoxelGrid<'_>) -> Self {
        let nodes =
            build_nodes(&mut boxes_of_map(grid), ASSUMED_CLEARANCE_M / grid.shape().resolution_m);
        Self { shape: *grid.shape(), beyond_map: grid.beyond_map(), nodes, arch: Arch::new() }
    }

    /// Distance from the segment `a`–`b` to the nearest obstacle, metres, at most `max_m`. The
    /// search stops as soon as it has found a distance of at most `enough_m`, and returns that.
    /// The map's faces count as obstacles if the space beyond them is blocked. For a segment that
    /// touches an obstacle, rounding may give slightly more than zero; the result is 0 if a
    /// coordinate is not finite.
    pub fn clearance_m(&self, a: &Point, b: &Point, max_m: f32, enough_m: f32) -> f32 {
        let resolution_m = self.shape.resolution_m;
        let cells =
            |p: &Point| [0, 1, 2].map(|axis| (p[axis] - self.shape.min[axis]) / resolution_m);
        let segment = CellSegment::new(cells(a), cells(b));
        if !segment.is_finite() {
            return 0.0;
        }
        let mut limit = max_m / resolution_m;
        if self.beyond_map == Outside::Blocked {
            limit = limit.min(segment.distance_to_faces(self.shape.dims)).max(0.0);
        }
        let enough = (enough_m / resolution_m).max(0.0);
        let search = BoxSearch {
            nodes: &self.nodes,
            segment: &segment,
            bound_sq: limit * limit,
            enough_sq: enough * enough,
        };
        let nearest = self.arch.dispatch(search);
        let nearest = if nearest < limit * limit { nearest.sqrt() } else { limit };
        (nearest * resolution_m).min(max_m)
    }
}

/// Stores the bounding box of some boxes in one lane of a node.
fn put_bounding_box(node: &mut Node, lane: usize, part: &[CellBox]) {
    let Some((first, others)) = part.split_first() else { return };
    let whole = others.iter().fold(*first, |whole, b| whole.union(b));
    for axis in 0..3 {
        node.low[axis][lane] = f32::from(whole.low[axis]);
        node.high[axis][lane] = f32::from(whole.high[axis]);
    }
}

/// Nodes of the subtree over some boxes; the first is its root. `near` is passed to
/// [`split_boxes`].
fn build_nodes(boxes: &mut [CellBox], near: f32) -> Vec<Node> {
    let mut node = Node::EMPTY;
    if boxes.len() <= BOXES_PER_NODE {
        boxes.chunks(1).enumerate().for_each(|(lane, one)| put_bounding_box(&mut node, lane, one));
        return vec![node];
    }
    let is_large = boxes.len() > MAX_BOXES_PER_THREAD;
    let mut parts = vec![boxes];
    while parts.len() < BOXES_PER_NODE {
        let Some(largest) =
            (0..parts.len()).filter(|&i| parts[i].len() > 1).max_by_key(|&i| parts[i].len())
        else {
            break;
        };
        let (left, right) = split_boxes(parts.swap_remove(largest), near);
        parts.extend([left, right]);
    }
    parts.iter().enumerate().for_each(|(lane, part)| put_bounding_box(&mut node, lane, part));
    let below: Vec<Vec<Node>> = if is_large {
        parts.into_par_iter().map(|part| build_nodes(part, near)).collect()
    } else {
        parts.into_iter().map(|part| build_nodes(part, near)).collect()
    };
    let mut next = 1;
    for (child, nodes) in node.child_offsets.iter_mut().zip(&below) {
        *child = next;
        next += nodes.len() as u32;
    }
    std::iter::once(node).chain(below.into_iter().flatten()).collect()
}

/// Splits two or more boxes into two groups so that few searches have to open both, by the surface
/// area heuristic (MacDonald and Booth 1990) in bins (Wald 2007), for segments that pass within
/// `near` cells. Each group gets at least a third of the boxes. Cost: O(boxes).
fn split_boxes(boxes: &mut [CellBox], near: f32) -> (&mut [CellBox], &mut [CellBox]) {
    let mut best = (f32::INFINITY, 0, 0);
    for axis in 0..3 {
        let Some(bin) = binning_function(boxes, axis) else { continue };
        let mut all: [Option<(CellBox, usize)>; SPLIT_BINS] = [None; SPLIT_BINS];
        for b in boxes.iter() {
            let one = &mut all[bin(b)];
            *one = one.map_or(Some((*b, 1)), |(whole, count)| Some((whole.union(b), count + 1)));
        }
        let add = |sum: &mut Option<(CellBox, usize)>, next: Option<(CellBox, usize)>| {
            *sum = match (*sum, next) {
                (Some((a, n)), Some((b, m))) => Some((a.union(&b), n + m)),
                (sum, next) => sum.or(next),
            };
            sum.map_or(0.0, |(whole, count)| whole.split_cost(near) * count as f32)
        };
        let (mut above, mut below) = (None, None);
        let mut costs = [0.0; SPLIT_BINS];
        for i in (1..SPLIT_BINS).rev() {
            costs[i] = add(&mut above, all[i]);
        }
        for i in 1..SPLIT_BINS {
            let cost = add(&mut below, all[i - 1]) + costs[i];
            let count = below.map_or(0, |(_, count)| count);
            let least = boxes.len().div_ceil(3);
            if cost < best.0 && count >= least && boxes.len() - count >= least {
                best = (cost, axis, i);
            }
        }
    }
    let (cost, axis, first_above) = best;
    let mut middle = 0;
    if let Some(bin) = binning_function(boxes, axis).filter(|_| cost.is_finite()) {
        for i in 0..boxes.len() {
            if bin(&boxes[i]) < first_above {
                boxes.swap(i, middle);
                middle += 1;
            }
        }
    } else {
        // No border between bins leaves a third on either side: splits at the median along the axis
        // with the largest extent.
        let spread =
            |axis: usize| twice_center_range(boxes, axis).map_or(0, |(low, high)| high - low);
        let axis = (0..3).max_by_key(|&axis| spread(axis)).unwrap_or(0);
        middle = boxes.len() / 2;
        boxes.select_nth_unstable_by_key(middle, |b| b.twice_center(axis));
    }
    boxes.split_at_mut(middle)
}

/// Least and greatest value of twice the boxes' centres along an axis; `None` without boxes.
fn twice_center_range(boxes: &[CellBox], axis: usize) -> Option<(u32, u32)> {
    let centers = || boxes.iter().map(|b| b.twice_center(axis));
    Some((centers().min()?, centers().max()?))
}

/// Function from a box to its bin, 0 to [`SPLIT_BINS`] − 1, along an axis; `None` if all centres
/// coincide along it.
fn binning_function(boxes: &[CellBox], axis: usize) -> Option<impl Fn(&CellBox) -> usize + use<>> {
    let (low, high) = twice_center_range(boxes, axis)?;
    (low < high).then_some(move |b: &CellBox| {
        (b.twice_center(axis) - low) as usize * (SPLIT_BINS - 1) / (high - low) as usize
    })
}

#[cfg(test)]
mod tests;
