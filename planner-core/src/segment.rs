//! How near a straight segment comes to the obstacles of a voxel map.
//!
//! The question of every roadmap edge (P3D §3.2, Algorithm 1): may a vehicle that needs `clearance_m` fly straight from
//! `a` to `b`? A segment is clear iff its Euclidean distance to every occupied closed cell, and to the outside where
//! that is [`Outside::Blocked`], is strictly greater than the clearance: touching a face, an edge or a corner is blocked.
//!
//! # What makes clearance 0 exact
//!
//! Both ends are first snapped to a lattice of 2⁻¹⁴ cell ([`snap`]). From there on all arithmetic is integer and without
//! rounding or overflow: a closed cell is met iff none of the six separating axes of a segment and a cube (three face
//! normals, three cross products) tells them apart, and those tests are 64-bit products of 31-bit numbers. What walks
//! the map to find occupied cells may therefore be generous, and is: it visits a superset of the touched cells.
//!
//! So the answer is the true one, touching included, for ends on the lattice (multiples of resolution / 16384; also
//! a corner and a resolution for which `(p − min) / resolution` is exact, such as powers of two). For any other end it is
//! the true one of a segment moved by at most [`snap_error_cells`] at each end: 2⁻¹⁵ cell of snapping and two f32
//! roundings, 0.000 06 cell in a grid of 256 cells a side, 15 µm at 0.25 m.
//!
//! # Cost
//!
//! Clearance 0: one word of 4 × 4 × 4 cells a step of four cells along the longest axis (up to four words where the
//! segment runs near a brick's border); cells are looked at only in bricks that hold an obstacle near the line. With a clearance:
//! the words whose cells lie in the bounding boxes of the swept volume, and a distance for each obstacle in them.

mod distance;
#[cfg(test)]
mod tests;

pub use distance::{point_clearance, segment_clearance};

use crate::Point;
use crate::voxel::{GridShape, MAX_DIM, Outside, VoxelGrid};

/// Bits after the point of a snapped coordinate, in cells.
pub const FRACTION_BITS: u32 = 14;
const ONE: i32 = 1 << FRACTION_BITS;

/// A point in units of 2⁻¹⁴ cell from the grid's minimum corner.
pub type Snapped = [i32; 3];

/// `p` on the lattice of 2⁻¹⁴ cell, or `None` where it is not finite or more than [`MAX_DIM`] cells beyond the grid.
pub fn snap(shape: &GridShape, p: &Point) -> Option<Snapped> {
    const REACH: f32 = MAX_DIM as f32;
    let mut out = [0; 3];
    for axis in 0..3 {
        let u = (p[axis] - shape.min[axis]) / shape.resolution_m;
        if !(u >= -REACH && u <= 2.0 * REACH) {
            return None;
        }
        let v = u * ONE as f32;
        out[axis] = (if v < 0.0 { v - 0.5 } else { v + 0.5 }) as i32;
    }
    Some(out)
}

/// How far, in cells along each axis, [`snap`] may move a point that lies within `cells` cells of the grid's minimum
/// corner: half a lattice step, and half an ulp for each of the subtraction and the division.
pub fn snap_error_cells(cells: f32) -> f32 {
    0.5 / ONE as f32 + 2.0 * cells * (f32::EPSILON / 2.0)
}

/// Whether the segment from `a` to `b` stays strictly farther than `clearance_m` from every obstacle.
///
/// An end that is not finite or more than [`MAX_DIM`] cells beyond the grid counts as blocked, as does a clearance that is
/// NaN, infinite or negative: the safe answer. `a` may equal `b`.
pub fn segment_is_clear(grid: &VoxelGrid<'_>, a: &Point, b: &Point, clearance_m: f32) -> bool {
    let (Some(from), Some(to)) = (snap(grid.shape(), a), snap(grid.shape(), b)) else {
        return false;
    };
    if clearance_m == 0.0 {
        return !snapped_segment_touches(grid, &from, &to);
    }
    if !(clearance_m > 0.0 && clearance_m.is_finite()) {
        return false;
    }
    !snapped_segment_touches(grid, &from, &to) && distance::is_farther_than(grid, a, b, clearance_m)
}

/// Whether the segment touches an occupied closed cell, or the outside where that is an obstacle. Exact.
pub fn snapped_segment_touches(grid: &VoxelGrid<'_>, a: &Snapped, b: &Snapped) -> bool {
    let dims = grid.shape().dims;
    if grid.outside() == Outside::Blocked {
        let inside =
            |p: &Snapped| (0..3).all(|axis| p[axis] > 0 && p[axis] < (dims[axis] as i32) << FRACTION_BITS);
        if !inside(a) || !inside(b) {
            return true;
        }
    }
    Walk::new(grid, a, b).touches()
}

/// The walk along the longest axis `u`; `v` and `w` are the other two.
struct Walk<'g> {
    words: &'g [u64],
    a: Snapped,
    b: Snapped,
    axes: [usize; 3],
    /// Cells along u, v, w.
    dims: [i32; 3],
    /// Words from one brick to the next along u, v, w.
    strides: [i32; 3],
    /// Change of v and w over one lattice unit of u, times 2³⁰.
    slopes: [i64; 2],
    /// What v and w may err by, in lattice units.
    slack: i32,
}

/// The cells of one axis that a stretch of the segment may touch, clipped to the grid; empty if `first > last`.
#[derive(Clone, Copy)]
struct Span {
    first: i32,
    last: i32,
}

impl Span {
    #[inline(always)]
    fn new(from: i32, to: i32, slack: i32, dim: i32) -> Self {
        let (low, high) = if from < to { (from, to) } else { (to, from) };
        Self {
            first: ((low - slack) >> FRACTION_BITS).max(0),
            last: ((high + slack) >> FRACTION_BITS).min(dim - 1),
        }
    }

    /// The cells of this span in brick `brick`, as a mask of its four lanes. They must meet.
    #[inline(always)]
    fn lanes(self, brick: i32) -> u32 {
        let first = (self.first - brick * 4).max(0) as u32;
        let last = (self.last - brick * 4).min(3) as u32;
        (0b1111 << first) & (0b1111 >> (3 - last))
    }
}

/// The cells of a brick whose lane along `axis` is among `lanes`.
#[inline(always)]
pub(crate) fn lane_mask(axis: usize, lanes: u32) -> u64 {
    const SPREAD: [[u64; 16]; 3] = lane_masks();
    SPREAD[axis][(lanes & 15) as usize]
}

const fn lane_masks() -> [[u64; 16]; 3] {
    let mut out = [[0; 16]; 3];
    let mut lanes = 0;
    while lanes < 16 {
        let mut bit = 0;
        while bit < 64 {
            let lane = [bit % 4, bit / 4 % 4, bit / 16];
            let mut axis = 0;
            while axis < 3 {
                if lanes >> lane[axis] & 1 == 1 {
                    out[axis][lanes] |= 1 << bit;
                }
                axis += 1;
            }
            bit += 1;
        }
        lanes += 1;
    }
    out
}

impl<'g> Walk<'g> {
    #[inline(always)]
    fn new(grid: &VoxelGrid<'g>, a: &Snapped, b: &Snapped) -> Self {
        let d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let size = d.map(i32::unsigned_abs);
        let axes = if size[0] >= size[1] && size[0] >= size[2] {
            [0, 1, 2]
        } else if size[1] >= size[2] {
            [1, 0, 2]
        } else {
            [2, 0, 1]
        };
        let [bx, by, _] = grid.shape().bricks().map(|n| n as i32);
        let strides = [1, bx, bx * by];
        // |slope| ≤ 1. The quotient of two f32 errs by 2⁻²³ at most, so v and w by 2⁻²² of the length, and two units.
        let per_u = if d[axes[0]] == 0 { 0.0 } else { (1 << 30) as f32 / d[axes[0]] as f32 };
        Self {
            words: grid.words(),
            // Along u upwards, so that the walk has one direction.
            a: if d[axes[0]] < 0 { *b } else { *a },
            b: if d[axes[0]] < 0 { *a } else { *b },
            axes,
            dims: axes.map(|axis| grid.shape().dims[axis] as i32),
            strides: axes.map(|axis| strides[axis]),
            slopes: [1, 2].map(|i| (d[axes[i]] as f32 * per_u) as i64),
            slack: (size[axes[0]] >> 21) as i32 + 3,
        }
    }

    /// v (`i` = 1) or w (`i` = 2) where the segment is at `u`, within `slack`.
    #[inline(always)]
    fn at(&self, i: usize, u: i32) -> i32 {
        let run = i64::from(u - self.a[self.axes[0]]);
        self.a[self.axes[i]] + ((run * self.slopes[i - 1]) >> 30) as i32
    }

    fn touches(&self) -> bool {
        let (start, end) = (self.a[self.axes[0]], self.b[self.axes[0]]);
        // A cell is closed: an end on its face touches the one before too.
        let whole = Span::new(start, end, 1, self.dims[0]);
        if whole.first > whole.last {
            return false;
        }
        let mut v = self.at(1, start.max((whole.first * ONE).min(end)));
        let mut w = self.at(2, start.max((whole.first * ONE).min(end)));
        for brick in whole.first >> 2..=whole.last >> 2 {
            let u = end.min((brick + 1) * (4 * ONE)).max(start);
            let (next_v, next_w) = (self.at(1, u), self.at(2, u));
            let span_v = Span::new(v, next_v, self.slack, self.dims[1]);
            let span_w = Span::new(w, next_w, self.slack, self.dims[2]);
            (v, w) = (next_v, next_w);
            let row = brick * self.strides[0];
            for brick_w in span_w.first >> 2..=span_w.last >> 2 {
                for brick_v in span_v.first >> 2..=span_v.last >> 2 {
                    let word =
                        self.words[(row + brick_v * self.strides[1] + brick_w * self.strides[2]) as usize];
                    if word == 0 {
                        continue;
                    }
                    let near = word
                        & lane_mask(self.axes[1], span_v.lanes(brick_v))
                        & lane_mask(self.axes[2], span_w.lanes(brick_w));
                    if near != 0 && self.brick_touches(near, [brick, brick_v, brick_w]) {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Looks at the occupied cells `near` of a brick, one layer along u at a time.
    fn brick_touches(&self, near: u64, brick: [i32; 3]) -> bool {
        let (start, end) = (self.a[self.axes[0]], self.b[self.axes[0]]);
        for layer in 0..4 {
            let near = near & lane_mask(self.axes[0], 1 << layer);
            if near == 0 {
                continue;
            }
            let floor = (brick[0] * 4 + layer) * ONE;
            let (from, to) = (floor.clamp(start, end), (floor + ONE).clamp(start, end));
            let mut layer_mask = near;
            for i in [1, 2] {
                let span = Span::new(self.at(i, from), self.at(i, to), self.slack, self.dims[i]);
                let base = brick[i] * 4;
                if span.first > base + 3 || span.last < base || span.first > span.last {
                    layer_mask = 0;
                } else {
                    layer_mask &= lane_mask(self.axes[i], span.lanes(brick[i]));
                }
            }
            while layer_mask != 0 {
                let bit = layer_mask.trailing_zeros() as i32;
                layer_mask &= layer_mask - 1;
                let lane = [bit & 3, bit >> 2 & 3, bit >> 4];
                let mut cell = [0; 3];
                for i in 0..3 {
                    cell[self.axes[i]] = brick[i] * 4 + lane[self.axes[i]];
                }
                if cell_is_touched(&self.a, &self.b, cell) {
                    return true;
                }
            }
        }
        false
    }
}

/// Whether a segment meets a closed cell: the six separating axes, in integers. Coordinates stay below 1.5 · 2³⁰, so the
/// two products and their difference below 2⁶³.
fn cell_is_touched(a: &Snapped, b: &Snapped, cell: [i32; 3]) -> bool {
    const HALF: i64 = (ONE / 2) as i64;
    let mut d = [0_i64; 3];
    let mut to_center = [0_i64; 3];
    for axis in 0..3 {
        let low = cell[axis] * ONE;
        if a[axis].max(b[axis]) < low || a[axis].min(b[axis]) > low + ONE {
            return false;
        }
        d[axis] = i64::from(b[axis] - a[axis]);
        to_center[axis] = i64::from(low - a[axis]) + HALF;
    }
    [(0, 1), (1, 2), (2, 0)]
        .into_iter()
        .all(|(p, q)| (d[p] * to_center[q] - d[q] * to_center[p]).abs() <= (d[p].abs() + d[q].abs()) * HALF)
}
