//! Finds the obstacle nearest to a segment by branch and bound over a tree of boxes.
//!
//! The distances of all boxes of a node are computed at once, with vector instructions where the
//! machine has them: branches that depend on distances are mispredicted often, and cost more than
//! the arithmetic. The results are bit-identical with any instruction set. Functions that use
//! [`SimdLanes`] must be inlined into [`BoxSearch::with_simd`]; closures would not be, so there are
//! none.

use pulp::{Simd, WithSimd};

use super::lanes::SimdLanes;

/// Number of boxes in a node.
pub(super) const BOXES_PER_NODE: usize = 8;
/// Capacity of the search's stack of nodes. Seven splits, always of the largest part, into two with
/// at least a third each, leave no part with more than a quarter of the boxes: 2³² boxes make 16
/// levels. Depth first, at most 7 nodes of each level wait, and all 8 of the last: 16 · 7 + 8.
const MAX_WAITING_NODES: usize = 120;
/// Value in `child_offsets` that marks a node whose boxes are obstacles.
const LEAF: u32 = 0;
/// Coordinate of unused boxes, beyond every map, cells; its square is still finite in f32.
const FAR_AWAY_CELLS: f32 = 1e18;

/// Up to [`BOXES_PER_NODE`] boxes, stored by coordinate so that vector instructions compare them
/// together; cells. Either all of them are obstacles, or all are bounding boxes of child nodes.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Lowest corners of the boxes: by axis, then by box.
    pub(super) low: [[f32; BOXES_PER_NODE]; 3],
    /// Highest corners of the boxes: by axis, then by box.
    pub(super) high: [[f32; BOXES_PER_NODE]; 3],
    /// Offset in the node list from this node to the child under each box; [`LEAF`] if the boxes
    /// are obstacles.
    pub(super) child_offsets: [u32; BOXES_PER_NODE],
}

impl Node {
    /// A node whose boxes are all unused.
    pub(super) const EMPTY: Self = Self {
        low: [[FAR_AWAY_CELLS; BOXES_PER_NODE]; 3],
        high: [[FAR_AWAY_CELLS; BOXES_PER_NODE]; 3],
        child_offsets: [LEAF; BOXES_PER_NODE],
    };

    /// Whether the node has boxes, not nodes, as its children.
    fn is_leaf(&self) -> bool {
        self.child_offsets[0] == LEAF
    }
}

/// A node that waits to be opened, and a lower bound of the squared distance to its boxes.
#[derive(Clone, Copy, Default)]
struct OpenNode {
    /// Lower bound of the squared distance, cells².
    min_distance_sq: f32,
    /// Index in the node list.
    node: u32,
}

/// A search for the squared distance, cells², to the nearest obstacle; the result is at most
/// `bound_sq`. It stops at the first distance found that is at most `enough_sq`. It is a type, not
/// a closure, so that all of it is compiled for the vector instructions in use.
pub(super) struct BoxSearch<'a> {
    /// All nodes of the tree; the root is the first.
    pub(super) nodes: &'a [Node],
    /// The segment whose distance is sought.
    pub(super) segment: &'a CellSegment,
    /// Upper bound of the result, cells².
    pub(super) bound_sq: f32,
    /// Squared distance at which the search stops, cells².
    pub(super) enough_sq: f32,
}

impl WithSimd for BoxSearch<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f32 {
        let Self { nodes, segment, mut bound_sq, enough_sq } = self;
        let mut waiting = [OpenNode::default(); MAX_WAITING_NODES];
        let mut count = 1;
        while count > 0 && bound_sq > enough_sq {
            count -= 1;
            let OpenNode { min_distance_sq: square, node: index } = waiting[count];
            if square >= bound_sq {
                continue;
            }
            let node = &nodes[index as usize];
            let (least, most) = segment.distance_bounds_sq(simd, node);
            if !node.is_leaf() {
                for (&square, child) in least.iter().zip(&node.child_offsets) {
                    waiting[count] = OpenNode { min_distance_sq: square, node: index + child };
                    count += usize::from(square < bound_sq);
                }
                continue;
            }
            bound_sq = bound_sq.min(least_of(simd, &most));
            if least_of(simd, &least) < bound_sq {
                bound_sq = bound_sq.min(least_of(simd, &segment.distances_sq_to_boxes(simd, node)));
            }
        }
        bound_sq
    }
}

/// The least of eight numbers.
#[inline(always)]
fn least_of<S: Simd>(simd: S, numbers: &[f32; BOXES_PER_NODE]) -> f32 {
    S::as_simd_f32s(numbers)
        .0
        .iter()
        .fold(f32::INFINITY, |least, &some| least.min(simd.reduce_min_f32s(some)))
}

/// A segment, in cells.
pub(super) struct CellSegment {
    /// Start of the segment.
    a: [f32; 3],
    /// End minus start.
    d: [f32; 3],
    /// Lowest corner of the segment's bounding box.
    low: [f32; 3],
    /// Highest corner of the segment's bounding box.
    high: [f32; 3],
    /// 1 / d; infinite along an axis without motion.
    per_d: [f32; 3],
    /// 1 / |d|²; 0 if both ends coincide.
    inv_length_sq: f32,
}

impl CellSegment {
    pub(super) fn new(a: [f32; 3], b: [f32; 3]) -> Self {
        let d = [0, 1, 2].map(|axis| b[axis] - a[axis]);
        let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        Self {
            a,
            d,
            low: [0, 1, 2].map(|axis| a[axis].min(b[axis])),
            high: [0, 1, 2].map(|axis| a[axis].max(b[axis])),
            per_d: d.map(f32::recip),
            inv_length_sq: if square > f32::MIN_POSITIVE { 1.0 / square } else { 0.0 },
        }
    }

    /// Whether all numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        self.d.iter().chain(&self.a).all(|x| x.is_finite())
    }

    /// Distance from the segment to the nearest face of a grid of `dims` cells, cells; negative if
    /// a part of the segment is outside the grid.
    pub(super) fn distance_to_faces(&self, dims: [u32; 3]) -> f32 {
        (0..3)
            .map(|axis| self.low[axis].min(dims[axis] as f32 - self.high[axis]))
            .fold(f32::INFINITY, f32::min)
    }

    /// For each box of a node: a lower and an upper bound of its squared distance from the segment.
    /// The upper bound is the squared distance of one point of the segment, nearest to the box's
    /// centre. The lower bound is the greater of two: the squared distance between the box and the
    /// segment's bounding box, and the least value over the segment of the tangent at that point,
    /// since squared distance along a segment is convex.
    #[inline(always)]
    fn distance_bounds_sq<S: Simd>(
        &self,
        simd: S,
        node: &Node,
    ) -> ([f32; BOXES_PER_NODE], [f32; BOXES_PER_NODE]) {
        let [a, d] = [SimdLanes::splat_triple(simd, self.a), SimdLanes::splat_triple(simd, self.d)];
        let [first, last] =
            [SimdLanes::splat_triple(simd, self.low), SimdLanes::splat_triple(simd, self.high)];
        let [zero, half, one] = SimdLanes::splat_triple(simd, [0.0, 0.5, 1.0]);
        let [two, rounding, inv_length_sq] =
            SimdLanes::splat_triple(simd, [2.0, 2e-6, self.inv_length_sq]);
        let (mut least, mut most) = ([0.0; BOXES_PER_NODE], [0.0; BOXES_PER_NODE]);
        for part in 0..BOXES_PER_NODE / S::F32_LANES {
            let [low, high] = [
                SimdLanes::load_part(simd, &node.low, part),
                SimdLanes::load_part(simd, &node.high, part),
            ];
            let (mut gap_square, mut along) = (zero, zero);
            for axis in 0..3 {
                let gap = (low[axis] - last[axis]).max(first[axis] - high[axis]).max(zero);
                gap_square = gap_square + gap * gap;
                along = along + ((low[axis] + high[axis]) * half - a[axis]) * d[axis];
            }
            let t = (along * inv_length_sq).max(zero).min(one);
            let (mut square, mut rate) = (zero, zero);
            for axis in 0..3 {
                let x = a[axis] + d[axis] * t;
                let off = x - x.max(low[axis]).min(high[axis]);
                square = square + off * off;
                rate = rate + off * d[axis];
            }
            let fall = (rate * t).max(rate * (t - one));
            // Reduced by the rounding errors of its terms, so that it stays a lower bound.
            let tangent = square - two * fall - rounding * (square + fall);
            tangent.max(gap_square).store_part(&mut least, part);
            square.store_part(&mut most, part);
        }
        (least, most)
    }

    /// Squared distance from the segment to each box of a node. As a function of the position along
    /// the segment it is convex and piecewise quadratic; the pieces meet where the segment crosses
    /// the planes of the box's faces. Its derivative is linear within each piece.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "several arrays of three axes, side by side")]
    fn distances_sq_to_boxes<S: Simd>(&self, simd: S, node: &Node) -> [f32; BOXES_PER_NODE] {
        let [a, d, per_d] = [
            SimdLanes::splat_triple(simd, self.a),
            SimdLanes::splat_triple(simd, self.d),
            SimdLanes::splat_triple(simd, self.per_d),
        ];
        let [zero, a_half, one] = SimdLanes::splat_triple(simd, [0.0, 0.5, 1.0]);
        let mut squares = [0.0; BOXES_PER_NODE];
        for part in 0..BOXES_PER_NODE / S::F32_LANES {
            let [low, high] = [
                SimdLanes::load_part(simd, &node.low, part),
                SimdLanes::load_part(simd, &node.high, part),
            ];
            let mut boxes = Boxes { half_sides: [zero; 3], start_from_centres: [zero; 3], d };
            for axis in 0..3 {
                boxes.half_sides[axis] = (high[axis] - low[axis]) * a_half;
                boxes.start_from_centres[axis] = a[axis] - low[axis] - boxes.half_sides[axis];
            }
            let (mut from, mut to) = (zero, one);
            let (mut rate_from, mut rate_to) =
                (boxes.distance_sq_and_half_slope(zero).1, boxes.distance_sq_and_half_slope(one).1);
            for axis in 0..3 {
                for face in [zero - boxes.half_sides[axis], boxes.half_sides[axis]] {
                    // On an axis without motion `per_d` is infinite and the product may be NaN:
                    // `max` then returns `from`.
                    let t =
                        ((face - boxes.start_from_centres[axis]) * per_d[axis]).max(from).min(to);
                    let (_, rate) = boxes.distance_sq_and_half_slope(t);
                    let falls = rate.is_below(zero);
                    (from, to) = (t.select(falls, from), to.select(falls, t));
                    (rate_from, rate_to) =
                        (rate.select(falls, rate_from), rate_to.select(falls, rate));
                }
            }
            // Between `from` and `to` the derivative is linear and changes from negative to
            // positive: its zero is the minimum.
            let between = from + (to - from) * (rate_from / (rate_from - rate_to));
            let t = between.select(rate_from.is_below(zero), from);
            let t = t.select(zero.is_below(rate_to), to);
            boxes.distance_sq_and_half_slope(t).0.store_part(&mut squares, part);
        }
        squares
    }
}

/// The boxes of a node relative to a segment.
struct Boxes<S: Simd> {
    /// Half the sides of the boxes.
    half_sides: [SimdLanes<S>; 3],
    /// Start of the segment relative to the boxes' centres.
    start_from_centres: [SimdLanes<S>; 3],
    /// End of the segment minus its start.
    d: [SimdLanes<S>; 3],
}

impl<S: Simd> Boxes<S> {
    /// Squared distance at the fraction `t` of the segment, and half its derivative.
    #[inline(always)]
    fn distance_sq_and_half_slope(&self, t: SimdLanes<S>) -> (SimdLanes<S>, SimdLanes<S>) {
        let zero = t.zero();
        let (mut square, mut rate) = (zero, zero);
        for axis in 0..3 {
            let x = self.start_from_centres[axis] + self.d[axis] * t;
            let off = x - x.max(zero - self.half_sides[axis]).min(self.half_sides[axis]);
            square = square + off * off;
            rate = rate + off * self.d[axis];
        }
        (square, rate)
    }
}
