//! The exact check: an integer walk along the segment's longest axis over the bricks that it may
//! touch.

use super::lanes::brick_layer_mask;
use super::lattice::{FRACTION_BITS, MAX_SNAPPED, ONE_CELL, Snapped};
use crate::map::voxel::{Outside, VoxelGrid};

/// Whether the segment touches an occupied closed cell, or space outside the grid where that is an
/// obstacle. Exact; also true if an end is beyond [`MAX_SNAPPED`].
pub fn snapped_segment_touches(grid: &VoxelGrid<'_>, a: &Snapped, b: &Snapped) -> bool {
    snapped_rest_touches(grid, a, b, 0.0)
}

/// As [`snapped_segment_touches`], but skips the first part of the segment, `known` (0 to 1) of its
/// length from `a`: the caller knows that this part touches nothing.
#[inline]
pub(crate) fn snapped_rest_touches(
    grid: &VoxelGrid<'_>,
    a: &Snapped,
    b: &Snapped,
    known: f32,
) -> bool {
    let dims = grid.shape().dims;
    if grid.beyond_map() == Outside::Blocked {
        let inside = |p: &Snapped| {
            (0..3).all(|axis| p[axis] > 0 && p[axis] < (dims[axis] as i32) << FRACTION_BITS)
        };
        if !inside(a) || !inside(b) {
            return true;
        }
    } else if a.iter().chain(b).any(|c| c.unsigned_abs() > MAX_SNAPPED as u32) {
        return true;
    }
    let size = [0, 1, 2].map(|axis| (b[axis] - a[axis]).unsigned_abs());
    if size[0] >= size[1] && size[0] >= size[2] {
        Walk::<0, 1, 2>::new(grid, a, b, known).touches_obstacle()
    } else if size[1] >= size[2] {
        Walk::<1, 0, 2>::new(grid, a, b, known).touches_obstacle()
    } else {
        Walk::<2, 0, 1>::new(grid, a, b, known).touches_obstacle()
    }
}

/// A walk along the segment's longest axis `U`; `V` and `W` are the other two axes.
struct Walk<'g, const U: usize, const V: usize, const W: usize> {
    /// Words of the grid, one per brick.
    words: &'g [u64],
    /// Lower and upper end of the segment along `U`: the caller's ends, swapped if necessary.
    a: Snapped,
    b: Snapped,
    /// First and last coordinate of the walk along `U`, lattice units.
    start: i32,
    end: i32,
    /// Number of cells along each axis.
    dims: [i32; 3],
    /// Number of words between neighbouring bricks along each axis.
    strides: [i32; 3],
    /// Change of each coordinate per lattice unit along `U`, times 2³⁰.
    slopes: [i64; 3],
    /// Greatest error of [`Walk::coordinate_at`], lattice units.
    slack: i32,
}

/// Range of cells along one axis that a part of the segment may touch, clipped to the grid; empty
/// if `first > last`.
#[derive(Clone, Copy)]
struct Span {
    /// First cell of the range.
    first: i32,
    /// Last cell of the range.
    last: i32,
}

impl Span {
    /// The cells between two coordinates, lattice units, widened by `slack` on each side; the axis
    /// has `dim` cells.
    #[inline(always)]
    fn new(from: i32, to: i32, slack: i32, dim: i32) -> Self {
        let (low, high) = if from < to { (from, to) } else { (to, from) };
        Self {
            first: ((low - slack) >> FRACTION_BITS).max(0),
            last: ((high + slack) >> FRACTION_BITS).min(dim - 1),
        }
    }

    /// The cells of this range in brick `brick`, as a mask of its four layers. Range and brick must
    /// overlap.
    #[inline(always)]
    fn layer_bits(self, brick: i32) -> u32 {
        let first = (self.first - brick * 4).max(0) as u32;
        let last = (self.last - brick * 4).min(3) as u32;
        (0b1111 << first) & (0b1111 >> (3 - last))
    }

    /// As [`Self::layer_bits`], but 0 if range and brick do not overlap.
    #[inline(always)]
    fn layer_bits_if_overlapping(self, brick: i32) -> u32 {
        let first = (self.first - brick * 4).clamp(0, 4) as u32;
        let last = (self.last - brick * 4).clamp(-1, 3);
        (0b1111 << first) & (0b1111 >> (3 - last) as u32)
    }
}

impl<'g, const U: usize, const V: usize, const W: usize> Walk<'g, U, V, W> {
    #[inline(always)]
    fn new(grid: &VoxelGrid<'g>, a: &Snapped, b: &Snapped, known: f32) -> Self {
        let d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        // Skips the part known to be free, less a thousandth of it and one cell, so that the
        // rounding of `known` and of this product does no harm.
        let skip = ((d[U].unsigned_abs() as f32 * known * 0.999) as i32 - ONE_CELL).max(0);
        // Ends are swapped where needed, so that the walk always goes up along U.
        let ((a, b), (start, end)) = if d[U] < 0 {
            ((*b, *a), (b[U], a[U] - skip))
        } else {
            ((*a, *b), (a[U] + skip, b[U]))
        };
        let [bx, by, _] = grid.shape().brick_dims().map(|n| n as i32);
        // The slope is at most 1. The quotient of two f32 errs by 2⁻²³ at most, so a coordinate
        // errs by 2⁻²² of the length, and two lattice units.
        let per_u = if d[U] == 0 { 0.0 } else { (1 << 30) as f32 / d[U] as f32 };
        Self {
            words: grid.words(),
            a,
            b,
            start,
            end,
            dims: grid.shape().dims.map(|n| n as i32),
            strides: [1, bx, bx * by],
            slopes: d.map(|d| (d as f32 * per_u) as i64),
            slack: (d[U].unsigned_abs() >> 21) as i32 + 3,
        }
    }

    /// The segment's coordinate on `axis` where its coordinate on `U` is `u`. It errs by at most
    /// `slack`, which is not added here: [`Span::new`] widens by it.
    #[inline(always)]
    fn coordinate_at(&self, axis: usize, u: i32) -> i32 {
        let run = i64::from(u - self.a[U]);
        self.a[axis] + ((run * self.slopes[axis]) >> 30) as i32
    }

    /// Whether the walk meets an occupied cell that the segment touches.
    #[inline(always)]
    fn touches_obstacle(&self) -> bool {
        // Cells are closed: an end on a cell's lower face touches the neighbour below that face
        // too.
        let whole = Span::new(self.start, self.end, 1, self.dims[U]);
        if whole.first > whole.last {
            return false;
        }
        let first = (whole.first * ONE_CELL).clamp(self.start, self.end);
        let (mut v, mut w) = (self.coordinate_at(V, first), self.coordinate_at(W, first));
        for brick in whole.first >> 2..=whole.last >> 2 {
            let u = ((brick + 1) * (4 * ONE_CELL)).clamp(self.start, self.end);
            let (next_v, next_w) = (self.coordinate_at(V, u), self.coordinate_at(W, u));
            let span_v = Span::new(v, next_v, self.slack, self.dims[V]);
            let span_w = Span::new(w, next_w, self.slack, self.dims[W]);
            (v, w) = (next_v, next_w);
            let row = brick * self.strides[U];
            for brick_w in span_w.first >> 2..=span_w.last >> 2 {
                for brick_v in span_v.first >> 2..=span_v.last >> 2 {
                    let word = self.words
                        [(row + brick_v * self.strides[V] + brick_w * self.strides[W]) as usize];
                    if word == 0 {
                        continue;
                    }
                    let near = word
                        & brick_layer_mask(V, span_v.layer_bits(brick_v))
                        & brick_layer_mask(W, span_w.layer_bits(brick_w));
                    if near != 0 && self.brick_touches(near, brick, brick_v, brick_w) {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Whether the segment touches one of the occupied cells `near` of a brick, tested by layers
    /// along `U`.
    #[inline(always)]
    fn brick_touches(&self, near: u64, brick_u: i32, brick_v: i32, brick_w: i32) -> bool {
        let floor = brick_u * (4 * ONE_CELL);
        let from = floor.clamp(self.start, self.end);
        let (mut v, mut w) = (self.coordinate_at(V, from), self.coordinate_at(W, from));
        for layer in 0..4 {
            let to = (floor + (layer + 1) * ONE_CELL).clamp(self.start, self.end);
            let (next_v, next_w) = (self.coordinate_at(V, to), self.coordinate_at(W, to));
            let (last_v, last_w) = (v, w);
            (v, w) = (next_v, next_w);
            let mut cells = near & brick_layer_mask(U, 1 << layer);
            if cells == 0 {
                continue;
            }
            cells &= brick_layer_mask(
                V,
                Span::new(last_v, v, self.slack, self.dims[V]).layer_bits_if_overlapping(brick_v),
            );
            cells &= brick_layer_mask(
                W,
                Span::new(last_w, w, self.slack, self.dims[W]).layer_bits_if_overlapping(brick_w),
            );
            while cells != 0 {
                let bit = cells.trailing_zeros() as i32;
                cells &= cells - 1;
                let index = [bit & 3, bit >> 2 & 3, bit >> 4];
                let mut cell = [0; 3];
                cell[U] = brick_u * 4 + index[U];
                cell[V] = brick_v * 4 + index[V];
                cell[W] = brick_w * 4 + index[W];
                if cell_is_touched(&self.a, &self.b, cell) {
                    return true;
                }
            }
        }
        false
    }
}

/// Whether the segment from `a` to `b` meets a closed cell: the six separating axes, in integers.
/// Differences of coordinates stay below 1.5 · 2³⁰, so the two products and their difference stay
/// below 2⁶³.
#[inline(always)]
fn cell_is_touched(a: &Snapped, b: &Snapped, cell: [i32; 3]) -> bool {
    /// Half the edge of a cell, in units of a snapped coordinate.
    const HALF_CELL: i64 = (ONE_CELL / 2) as i64;
    let mut d = [0_i64; 3];
    let mut to_center = [0_i64; 3];
    for axis in 0..3 {
        let low = cell[axis] * ONE_CELL;
        if a[axis].max(b[axis]) < low || a[axis].min(b[axis]) > low + ONE_CELL {
            return false;
        }
        d[axis] = i64::from(b[axis] - a[axis]);
        to_center[axis] = i64::from(low - a[axis]) + HALF_CELL;
    }
    [(0, 1), (1, 2), (2, 0)].into_iter().all(|(p, q)| {
        (d[p] * to_center[q] - d[q] * to_center[p]).abs() <= (d[p].abs() + d[q].abs()) * HALF_CELL
    })
}
