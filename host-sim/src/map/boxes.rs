//! Distances from segments to a map's obstacles, by a tree of boxes: for the many edges of a roadmap.
//!
//! The obstacles are joined into boxes, each brick of 4 × 4 × 4 cells by itself and then along x, y and z where boxes
//! have equal sides: a wall is one box or a few. Over them lies a tree of boxes, eight to a node. The nearest is found by
//! branch and bound: what is no nearer than what is known already is not opened. Work does not grow with the cube of the
//! distance, as that of [`planner_core::segment::segment_clearance`] does, and the result is the same but for rounding: both
//! are f32 in cells, n · 2⁻²³ a coordinate of n cells. Memory: 30 bytes a box.

use planner_core::Point;
use planner_core::voxel::{GridShape, Outside, VoxelGrid};
use pulp::Arch;
use rayon::prelude::*;

/// Children of a node.
const FAN: usize = 8;
/// Nodes waiting to be opened: 7 a level, and the last one's 8. Seven partings, always of the largest part and into two of
/// which neither has less than a third, leave none with more than a quarter: 2³² boxes make 16 levels.
const WAITING: usize = 120;
/// Child of a node that is a box of obstacles.
const LEAF: u32 = u32::MAX;
/// Places along an axis at which boxes may be parted.
const BINS: usize = 16;
/// A node is opened by segments that pass it this near, metres: the clearance of most edges is less.
const NEAR_M: f32 = 0.6;

/// Cells `low..high`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct CellBox {
    low: [u16; 3],
    high: [u16; 3],
}

impl CellBox {
    /// Twice the centre along an axis.
    fn center(&self, axis: usize) -> u32 {
        u32::from(self.low[axis]) + u32::from(self.high[axis])
    }

    fn join(&self, other: &Self) -> Self {
        Self {
            low: [0, 1, 2].map(|a| self.low[a].min(other.low[a])),
            high: [0, 1, 2].map(|a| self.high[a].max(other.high[a])),
        }
    }

    /// The sides across an axis, one number.
    fn across(&self, axis: usize) -> u64 {
        let (v, w) = ((axis + 1) % 3, (axis + 2) % 3);
        let sides = [self.low[v], self.high[v], self.low[w], self.high[w]];
        sides.into_iter().fold(0, |all, side| all << 16 | u64::from(side))
    }

    /// A measure of how many segments pass it within a distance, in cells: half the surface of all places that near, but
    /// for a constant.
    fn passed_by(&self, near: f32) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|a| f32::from(self.high[a] - self.low[a]));
        x * y + y * z + z * x + core::f32::consts::PI * near * (x + y + z)
    }
}

/// Takes the obstacles of a brick apart into boxes.
fn take_apart(mut word: u64, brick: [usize; 3], out: &mut Vec<CellBox>) {
    while word != 0 {
        let bit = word.trailing_zeros();
        let first = [bit & 3, bit >> 2 & 3, bit >> 4];
        // As far along x as it goes, then as many such rows, then as many such layers.
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

/// Joins boxes that touch along an axis and have equal sides across it.
fn join_along(axis: usize, boxes: &mut Vec<CellBox>) {
    boxes.sort_unstable_by_key(|b| (b.across(axis), b.low[axis]));
    boxes.dedup_by(|next, last| {
        let joins = last.across(axis) == next.across(axis) && last.high[axis] == next.low[axis];
        if joins {
            last.high[axis] = next.high[axis];
        }
        joins
    });
}

/// Boxes that hold all obstacles of a map, and nothing else.
fn boxes(grid: &VoxelGrid<'_>) -> Vec<CellBox> {
    let [bx, by, _] = grid.shape().bricks().map(|n| n as usize);
    let layers: Vec<Vec<CellBox>> = grid
        .words()
        .par_chunks(bx * by)
        .enumerate()
        .map(|(k, layer)| {
            let mut boxes = Vec::new();
            for (at, &word) in layer.iter().enumerate() {
                take_apart(word, [at % bx, at / bx, k], &mut boxes);
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

/// Up to [`FAN`] boxes, coordinate by coordinate so that they are compared together; cells.
#[derive(Clone, Debug)]
struct Node {
    low: [[f32; FAN]; 3],
    high: [[f32; FAN]; 3],
    child: [u32; FAN],
}

impl Node {
    /// Boxes that are beyond everything.
    const EMPTY: Self =
        Self { low: [[f32::INFINITY; FAN]; 3], high: [[f32::INFINITY; FAN]; 3], child: [LEAF; FAN] };
}

/// The tree over a map.
#[derive(Debug)]
pub struct BoxTree {
    shape: GridShape,
    outside: Outside,
    /// The first is the root.
    nodes: Vec<Node>,
    /// The vector instructions that this machine has.
    arch: Arch,
}

/// A node to be opened, and the least square of a distance to what it holds.
#[derive(Clone, Copy, Default)]
struct Waiting {
    square: f32,
    node: u32,
}

impl BoxTree {
    /// The tree over a map. O(bricks + boxes · log boxes).
    pub fn new(grid: &VoxelGrid<'_>) -> Self {
        let mut tree =
            Self { shape: *grid.shape(), outside: grid.outside(), nodes: Vec::new(), arch: Arch::new() };
        tree.add(&mut boxes(grid));
        tree
    }

    /// Adds a node over some boxes, and those below it; its index.
    fn add(&mut self, boxes: &mut [CellBox]) -> u32 {
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        // Few enough are children one by one.
        let mut parts: Vec<_> = if boxes.len() <= FAN { boxes.chunks_mut(1).collect() } else { vec![boxes] };
        while parts.len() < FAN {
            let Some(largest) =
                (0..parts.len()).filter(|&i| parts[i].len() > 1).max_by_key(|&i| parts[i].len())
            else {
                break;
            };
            let (left, right) = in_two(parts.swap_remove(largest), NEAR_M / self.shape.resolution_m);
            parts.extend([left, right]);
        }
        for (lane, part) in parts.into_iter().enumerate().filter(|(_, part)| !part.is_empty()) {
            let whole = part.iter().skip(1).fold(part[0], |whole, b| whole.join(b));
            for axis in 0..3 {
                self.nodes[index].low[axis][lane] = f32::from(whole.low[axis]);
                self.nodes[index].high[axis][lane] = f32::from(whole.high[axis]);
            }
            if part.len() > 1 {
                self.nodes[index].child[lane] = self.add(part);
            }
        }
        index as u32
    }

    /// Distance from the segment to the nearest obstacle, metres, at most `max_m`. Once it is seen to be at most
    /// `enough_m`, the search ends with what it has. Of a segment that touches an obstacle it may be a rounding above zero;
    /// an end that is not finite is at distance 0.
    pub fn clearance_m(&self, a: &Point, b: &Point, max_m: f32, enough_m: f32) -> f32 {
        let resolution_m = self.shape.resolution_m;
        let cells = |p: &Point| [0, 1, 2].map(|axis| (p[axis] - self.shape.min[axis]) / resolution_m);
        let segment = Segment::new(cells(a), cells(b));
        if !segment.d.iter().chain(&segment.a).all(|x| x.is_finite()) {
            return 0.0;
        }
        let mut limit = max_m / resolution_m;
        if self.outside == Outside::Blocked {
            limit = limit.min(segment.to_outside(self.shape.dims)).max(0.0);
        }
        let enough = (enough_m / resolution_m).max(0.0);
        let nearest = self.arch.dispatch(|| self.nearest_square(&segment, limit * limit, enough * enough));
        let nearest = if nearest < limit * limit { nearest.sqrt() } else { limit };
        (nearest * resolution_m).min(max_m)
    }

    /// The squared distance to the nearest obstacle if it is below `bound`, else `bound`; any that is at most `enough`.
    #[inline(always)]
    fn nearest_square(&self, segment: &Segment, mut bound: f32, enough: f32) -> f32 {
        let mut waiting = [Waiting::default(); WAITING];
        let mut count = 1;
        while count > 0 && bound > enough {
            count -= 1;
            if waiting[count].square >= bound {
                continue;
            }
            let node = &self.nodes[waiting[count].node as usize];
            let (least, most) = segment.squares(node);
            for (child, most) in node.child.iter().zip(most) {
                if *child == LEAF && most < bound {
                    bound = most;
                }
            }
            let first = count;
            for lane in 0..FAN {
                if least[lane] >= bound {
                    continue;
                }
                if node.child[lane] == LEAF {
                    let corner = |sides: &[[f32; FAN]; 3]| [sides[0][lane], sides[1][lane], sides[2][lane]];
                    bound = smaller(segment.square_to_box(corner(&node.low), corner(&node.high)), bound);
                    continue;
                }
                // The nearest is opened first.
                let square = least[lane];
                let mut place = count;
                while place > first && waiting[place - 1].square < square {
                    waiting[place] = waiting[place - 1];
                    place -= 1;
                }
                waiting[place] = Waiting { square, node: node.child[lane] };
                count += 1;
            }
        }
        bound
    }
}

/// Parts two boxes or more so that few segments have to open both halves, of which neither has less than a third: the surface
/// area heuristic (MacDonald and Booth 1990) in bins (Wald 2007), for segments that pass within `near` cells. O(boxes).
fn in_two(boxes: &mut [CellBox], near: f32) -> (&mut [CellBox], &mut [CellBox]) {
    let mut best = (f32::INFINITY, 0, 0);
    for axis in 0..3 {
        let Some(bin) = bins(boxes, axis) else { continue };
        let mut all: [Option<(CellBox, usize)>; BINS] = [None; BINS];
        for b in boxes.iter() {
            let one = &mut all[bin(b)];
            *one = one.map_or(Some((*b, 1)), |(whole, count)| Some((whole.join(b), count + 1)));
        }
        let add = |sum: &mut Option<(CellBox, usize)>, next: Option<(CellBox, usize)>| {
            *sum = match (*sum, next) {
                (Some((a, n)), Some((b, m))) => Some((a.join(&b), n + m)),
                (sum, next) => sum.or(next),
            };
            sum.map_or(0.0, |(whole, count)| whole.passed_by(near) * count as f32)
        };
        let (mut above, mut below) = (None, None);
        let mut costs = [0.0; BINS];
        for i in (1..BINS).rev() {
            costs[i] = add(&mut above, all[i]);
        }
        for i in 1..BINS {
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
    if let Some(bin) = bins(boxes, axis).filter(|_| cost.is_finite()) {
        for i in 0..boxes.len() {
            if bin(&boxes[i]) < first_above {
                boxes.swap(i, middle);
                middle += 1;
            }
        }
    } else {
        // Most are in one bin of each axis.
        let spread = |axis: usize| extent(boxes, axis).map_or(0, |(low, high)| high - low);
        let axis = (0..3).max_by_key(|&axis| spread(axis)).unwrap_or(0);
        middle = boxes.len() / 2;
        boxes.select_nth_unstable_by_key(middle, |b| b.center(axis));
    }
    boxes.split_at_mut(middle)
}

/// Least and greatest of the boxes' centres along an axis, twice.
fn extent(boxes: &[CellBox], axis: usize) -> Option<(u32, u32)> {
    let centers = || boxes.iter().map(|b| b.center(axis));
    Some((centers().min()?, centers().max()?))
}

/// Which of [`BINS`] bins along an axis a box is in; `None` where the centres of all are at one place.
fn bins(boxes: &[CellBox], axis: usize) -> Option<impl Fn(&CellBox) -> usize + use<>> {
    let (low, high) = extent(boxes, axis)?;
    (low < high)
        .then_some(move |b: &CellBox| (b.center(axis) - low) as usize * (BINS - 1) / (high - low) as usize)
}

/// A segment in cells.
struct Segment {
    a: [f32; 3],
    d: [f32; 3],
    low: [f32; 3],
    high: [f32; 3],
    /// 1 / d, infinite where it does not move.
    per_d: [f32; 3],
    /// 1 / |d|², 0 for a point.
    inv_square: f32,
}

impl Segment {
    fn new(a: [f32; 3], b: [f32; 3]) -> Self {
        let d = [0, 1, 2].map(|axis| b[axis] - a[axis]);
        let square = dot(d, d);
        Self {
            a,
            d,
            low: [0, 1, 2].map(|axis| a[axis].min(b[axis])),
            high: [0, 1, 2].map(|axis| a[axis].max(b[axis])),
            per_d: d.map(f32::recip),
            inv_square: if square > f32::MIN_POSITIVE { 1.0 / square } else { 0.0 },
        }
    }

    /// Distance to the nearest face of the grid, negative outside.
    fn to_outside(&self, dims: [u32; 3]) -> f32 {
        (0..3)
            .map(|axis| self.low[axis].min(dims[axis] as f32 - self.high[axis]))
            .fold(f32::INFINITY, f32::min)
    }

    /// For each box of a node a square that no distance from the segment to it is below, and the square of one that there
    /// is. The first is the greater of two: the distance of the box around the segment, and, as squares of distances along a
    /// segment are convex, the tangent where the segment is nearest to the box's centre.
    #[inline(always)]
    fn squares(&self, node: &Node) -> ([f32; FAN], [f32; FAN]) {
        let (mut least, mut most) = ([0.0; FAN], [0.0; FAN]);
        for lane in 0..FAN {
            let (mut gap_square, mut along) = (0.0, 0.0);
            for axis in 0..3 {
                let (low, high) = (node.low[axis][lane], node.high[axis][lane]);
                let gap = greater(greater(low - self.high[axis], self.low[axis] - high), 0.0);
                gap_square += gap * gap;
                along += ((low + high) * 0.5 - self.a[axis]) * self.d[axis];
            }
            let t = smaller(greater(along * self.inv_square, 0.0), 1.0);
            let (mut square, mut rate) = (0.0, 0.0);
            for axis in 0..3 {
                let x = self.a[axis] + self.d[axis] * t;
                let off = x - smaller(greater(x, node.low[axis][lane]), node.high[axis][lane]);
                square += off * off;
                rate += off * self.d[axis];
            }
            let fall = greater(rate * t, rate * (t - 1.0));
            // Less what the terms are rounded by.
            let tangent = square - 2.0 * fall - 2e-6 * (square + fall);
            least[lane] = greater(tangent, gap_square);
            most[lane] = square;
        }
        (least, most)
    }

    /// Squared distance to a closed box. As a function of the place along the segment it is convex and piecewise quadratic,
    /// with breaks where the segment crosses a face's plane; its rate is linear between them.
    #[inline(always)]
    fn square_to_box(&self, low: [f32; 3], high: [f32; 3]) -> f32 {
        let (mut half, mut start) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            half[axis] = (high[axis] - low[axis]) * 0.5;
            start[axis] = self.a[axis] - low[axis] - half[axis];
        }
        // Squared distance at a place along the segment, and half its rate.
        let at = |t: f32| {
            let (mut square, mut rate) = (0.0, 0.0);
            for axis in 0..3 {
                let x = start[axis] + self.d[axis] * t;
                let off = x - smaller(greater(x, -half[axis]), half[axis]);
                square += off * off;
                rate += off * self.d[axis];
            }
            (square, rate)
        };
        let (mut from, mut to) = (0.0, 1.0);
        let ((first, mut rate_from), (last, mut rate_to)) = (at(0.0), at(1.0));
        if rate_from >= 0.0 {
            return first;
        }
        if rate_to <= 0.0 {
            return last;
        }
        for axis in 0..3 {
            for face in [-half[axis], half[axis]] {
                let t = (face - start[axis]) * self.per_d[axis];
                if t > from && t < to {
                    let (_, r) = at(t);
                    if r < 0.0 {
                        (from, rate_from) = (t, r);
                    } else {
                        (to, rate_to) = (t, r);
                    }
                }
            }
        }
        // rate_from < 0 ≤ rate_to, and linear between.
        at(from + (to - from) * (rate_from / (rate_from - rate_to))).0
    }
}

/// The second if they cannot be compared: one instruction, unlike `max`.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The second if they cannot be compared.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests;
