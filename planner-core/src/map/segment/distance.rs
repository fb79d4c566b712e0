//! Distances from a segment to the obstacles of a map, in f32.
//!
//! All lengths here are in cells, coordinates relative to the grid's minimum corner. The distance
//! from a segment to a cube is the minimum of a convex, piecewise quadratic function of the place
//! along the segment. Its derivative is piecewise linear with breaks where the segment crosses one
//! of the six face planes, so its zero is found by bisection over at most six breaks and one
//! division: nothing iterates to convergence.
//!
//! Rounding: coordinates of up to n cells err by n · 2⁻²³, the distance by a few times that;
//! at 256 cells of 0.25 m by less than 0.1 mm.

use core::ops::ControlFlow;

use super::lanes::brick_layer_mask;
use super::lattice::snap;
use super::walk::snapped_segment_touches;
use crate::Point;
use crate::geo::distance::clamp_to;
use crate::map::voxel::{Outside, VoxelGrid};

/// Half the diagonal of a cell, in cells.
const CELL_HALF_DIAGONAL: f32 = 0.866_025_5;
/// Half the diagonal of a brick, in cells.
const BRICK_HALF_DIAGONAL: f32 = 4.0 * CELL_HALF_DIAGONAL;

/// A segment from `a` to `a + d`, in cells.
struct Segment {
    /// Beginning, in cells from the grid's minimum corner.
    a: Point,
    /// Vector from beginning to end, in cells.
    d: Point,
    /// 1 / |d|², or 0 where |d|² is no normal f32: then the segment is taken for the point `a`.
    inv_length_sq: f32,
}

impl Segment {
    fn new(grid: &VoxelGrid<'_>, a: &Point, b: &Point) -> Self {
        let cells = |p: &Point| (p - grid.shape().min) / grid.shape().resolution_m;
        let (a, d) = (cells(a), cells(b) - cells(a));
        let square = d.norm_squared();
        // A squared length below the smallest normal f32 has no reciprocal.
        Self { a, d, inv_length_sq: if square > f32::MIN_POSITIVE { 1.0 / square } else { 0.0 } }
    }

    /// Squared distance from the segment to a point, in cells².
    fn distance_sq_to_point(&self, p: &Point) -> f32 {
        let to = p - self.a;
        let t = (to.dot(&self.d) * self.inv_length_sq).clamp(0.0, 1.0);
        (to - self.d * t).norm_squared()
    }

    /// Squared distance from the segment to the closed cell with minimum corner `low`, in cells².
    fn distance_sq_to_cell(&self, low: &Point) -> f32 {
        // Coordinates relative to the cell's centre: |x| ≤ 0.5 is inside.
        let start = self.a - low - Point::new(0.5, 0.5, 0.5);
        let excess = |t: f32| {
            let p = start + self.d * t;
            p.map(|x| x - x.clamp(-0.5, 0.5))
        };
        let rate = |t: f32| excess(t).dot(&self.d);
        let (mut from, mut to) = (0.0, 1.0);
        let (mut rate_from, mut rate_to) = (rate(0.0), rate(1.0));
        if rate_from >= 0.0 {
            return excess(0.0).norm_squared();
        }
        if rate_to <= 0.0 {
            return excess(1.0).norm_squared();
        }
        for axis in 0..3 {
            if self.d[axis] == 0.0 {
                continue;
            }
            for face in [-0.5, 0.5] {
                let t = (face - start[axis]) / self.d[axis];
                if t > from && t < to {
                    let r = rate(t);
                    if r < 0.0 {
                        (from, rate_from) = (t, r);
                    } else {
                        (to, rate_to) = (t, r);
                    }
                }
            }
        }
        // rate_from < 0 ≤ rate_to, and the rate is linear between the two places.
        excess(from + (to - from) * (rate_from / (rate_from - rate_to))).norm_squared()
    }

    /// Distance from the segment to the nearest face of the grid, in cells; negative if an end is
    /// outside.
    fn distance_to_faces(&self, dims: [u32; 3]) -> f32 {
        let end = self.a + self.d;
        (0..3)
            .map(|axis| {
                self.a[axis].min(end[axis]).min(dims[axis] as f32 - self.a[axis].max(end[axis]))
            })
            .fold(f32::INFINITY, f32::min)
    }

    /// Calls `visit` with each word that may hold an obstacle within `reach` cells of the segment,
    /// and with the minimum corner of the word's brick. Cells outside the bounding boxes of the
    /// swept volume are cleared in that word. `visit` returns the reach for the words that follow,
    /// which may be lower. The first part of the segment, `known` (0 to 1) of its length, is
    /// skipped: the caller knows that nothing is within reach of it.
    fn visit_near_words(
        &self,
        grid: &VoxelGrid<'_>,
        known: f32,
        mut reach: f32,
        mut visit: impl FnMut(u64, &Point) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()> {
        let shape = grid.shape();
        let axis_u = self.d.map(f32::abs).imax();
        let [axis_v, axis_w] = [[1, 2], [0, 2], [0, 1]][axis_u];
        let [bx, by, _] = shape.brick_dims().map(|n| n as usize);
        let strides = [1, bx, bx * by];
        // Per unit of the longest axis every other coordinate changes by at most 1.
        let slope = if self.d[axis_u] == 0.0 { Point::zeros() } else { self.d / self.d[axis_u] };
        let (begin, end) =
            (self.a[axis_u] + self.d[axis_u] * known, self.a[axis_u] + self.d[axis_u]);
        let (least, most) = if begin < end { (begin, end) } else { (end, begin) };
        // The search extends beyond the reach by a thousandth of a cell and by the rounding of
        // large coordinates, so that rounding loses no cell.
        let largest = self.a.amax() + self.d.amax();
        let slack = 1e-3 + largest * (8.0 * f32::EPSILON);
        let Some((first, last)) = cell_range(least, most, reach + slack, shape.dims[axis_u]) else {
            return ControlFlow::Continue(());
        };
        for brick_u in first >> 2..=last >> 2 {
            let low = (brick_u * 4) as f32;
            // The part of the segment within reach of this layer of bricks, along the longest axis.
            let from = clamp_to(low - reach, least, most) - self.a[axis_u];
            let to = clamp_to(low + 4.0 + reach, least, most) - self.a[axis_u];
            let span = |axis: usize| {
                let at = |along: f32| self.a[axis] + slope[axis] * along;
                cell_range(at(from), at(to), reach + slack, shape.dims[axis])
            };
            let (Some(v), Some(w)) = (span(axis_v), span(axis_w)) else {
                continue;
            };
            let mask_u = brick_layer_mask(axis_u, layer_bits(first, last, brick_u));
            for brick_w in w.0 >> 2..=w.1 >> 2 {
                let mask_w = brick_layer_mask(axis_w, layer_bits(w.0, w.1, brick_w)) & mask_u;
                let row = brick_u as usize * strides[axis_u] + brick_w as usize * strides[axis_w];
                for brick_v in v.0 >> 2..=v.1 >> 2 {
                    let word = grid.words()[row + brick_v as usize * strides[axis_v]] & mask_w;
                    if word == 0 {
                        continue;
                    }
                    let word = word & brick_layer_mask(axis_v, layer_bits(v.0, v.1, brick_v));
                    if word == 0 {
                        continue;
                    }
                    let mut corner = Point::zeros();
                    corner[axis_u] = low;
                    corner[axis_v] = (brick_v * 4) as f32;
                    corner[axis_w] = (brick_w * 4) as f32;
                    let bound = reach + BRICK_HALF_DIAGONAL;
                    if self.distance_sq_to_point(&corner.add_scalar(2.0))
                        > bound * bound * (1.0 + 1e-5)
                    {
                        continue;
                    }
                    reach = visit(word, &corner)?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

/// First and last cell along an axis within `reach` of the interval between two coordinates, in
/// cells; `None` if all such cells are beyond the grid.
fn cell_range(from: f32, to: f32, reach: f32, dim: u32) -> Option<(i32, i32)> {
    let (low, high) =
        if from < to { (from - reach, to + reach) } else { (to - reach, from + reach) };
    // A cast to integer rounds towards zero: down, except for negative numbers, which are outside
    // the grid.
    let first = (low as i32).max(0);
    let last = (high as i32).min(dim as i32 - 1);
    (high >= 0.0 && first <= last).then_some((first, last))
}

/// Mask of the layers of brick `brick` that are among the cells `first..=last`. Range and brick
/// must overlap.
fn layer_bits(first: i32, last: i32, brick: i32) -> u32 {
    let low = (first - brick * 4).max(0);
    let high = (last - brick * 4).min(3);
    (0b1111 << low) & (0b1111 >> (3 - high))
}

/// The minimum corners of the occupied cells of a word, whose brick has the minimum corner `brick`.
fn occupied_corners(mut word: u64, brick: &Point) -> impl Iterator<Item = Point> {
    core::iter::from_fn(move || {
        if word == 0 {
            return None;
        }
        let bit = word.trailing_zeros();
        word &= word - 1;
        Some(brick + Point::new((bit & 3) as f32, (bit >> 2 & 3) as f32, (bit >> 4) as f32))
    })
}

/// Whether the segment from `a` to `b` is strictly farther than `clearance_m` (positive, finite)
/// from every obstacle. The caller has checked that the ends are finite and near the grid and, if
/// the clearance is less than `TOUCH_CHECK_CLEARANCE_CELLS`, that the segment touches nothing. The
/// first part of the segment, `known` (0 to 1) of its length, is skipped: the caller knows that it
/// is farther than the clearance, by much more than rounding.
pub(crate) fn is_farther_than(
    grid: &VoxelGrid<'_>,
    a: &Point,
    b: &Point,
    known: f32,
    clearance_m: f32,
) -> bool {
    let segment = Segment::new(grid, a, b);
    let reach = clearance_m / grid.shape().resolution_m;
    if grid.beyond_map() == Outside::Blocked
        && segment.distance_to_faces(grid.shape().dims) <= reach
    {
        return false;
    }
    let square = reach * reach;
    // If the cell's centre is farther than `never`, no part of the cell is in reach; if it is
    // nearer than `always`, some part is.
    let (never, always) = (reach + CELL_HALF_DIAGONAL, reach + 0.5);
    let (never, always) = (never * never * (1.0 + 1e-5), always * always * (1.0 - 1e-5));
    segment
        .visit_near_words(grid, known, reach, |word, brick| {
            for low in occupied_corners(word, brick) {
                let to_center = segment.distance_sq_to_point(&low.add_scalar(0.5));
                if to_center <= always
                    || to_center <= never && segment.distance_sq_to_cell(&low) <= square
                {
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(reach)
        })
        .is_continue()
}

/// Euclidean distance from the segment to the nearest obstacle, metres, at most `max_m`. 0 if it
/// touches one, if an end is not finite or more than [`crate::map::voxel::MAX_DIM`] cells beyond
/// the grid, and if `max_m` is NaN or not positive.
///
/// The search radius is doubled from one cell up to `max_m`, so that a segment near a wall costs
/// little: the work grows with the cube of the returned distance, not of `max_m`.
pub fn segment_clearance(grid: &VoxelGrid<'_>, a: &Point, b: &Point, max_m: f32) -> f32 {
    let shape = grid.shape();
    let (Some(from), Some(to)) = (snap(shape, a), snap(shape, b)) else {
        return 0.0;
    };
    if max_m.is_nan() || max_m <= 0.0 || snapped_segment_touches(grid, &from, &to) {
        return 0.0;
    }
    let segment = Segment::new(grid, a, b);
    let mut limit = max_m / shape.resolution_m;
    if grid.beyond_map() == Outside::Blocked {
        limit = limit.min(segment.distance_to_faces(shape.dims)).max(0.0);
    }
    // No obstacle is farther from a point of the grid than the grid is long.
    let longest = (shape.dims.iter().max().copied().unwrap_or(0) * 4) as f32;
    let mut reach = 1.0_f32;
    loop {
        let tried = reach.min(limit);
        // A squared distance: if the cell's centre is farther, no part of the cell is nearer than
        // `reach`.
        let around =
            |reach: f32| (reach + CELL_HALF_DIAGONAL) * (reach + CELL_HALF_DIAGONAL) * (1.0 + 1e-5);
        let (mut nearest, mut bound) = (tried * tried, around(tried));
        let mut found = false;
        let _ = segment.visit_near_words(grid, 0.0, tried, |word, brick| {
            for low in occupied_corners(word, brick) {
                if segment.distance_sq_to_point(&low.add_scalar(0.5)) <= bound {
                    let square = segment.distance_sq_to_cell(&low);
                    if square <= nearest {
                        (nearest, found) = (square, true);
                        bound = around(fpu::sqrtf(nearest));
                    }
                }
            }
            ControlFlow::Continue(fpu::sqrtf(nearest))
        });
        if found {
            return (fpu::sqrtf(nearest) * shape.resolution_m).min(max_m);
        }
        if tried >= limit || reach > longest {
            return (limit * shape.resolution_m).min(max_m);
        }
        reach *= 2.0;
    }
}

/// Euclidean distance from a point to the nearest obstacle, metres, at most `max_m`; 0 in the same
/// cases as [`segment_clearance`].
pub fn point_clearance(grid: &VoxelGrid<'_>, p: &Point, max_m: f32) -> f32 {
    segment_clearance(grid, p, p, max_m)
}
