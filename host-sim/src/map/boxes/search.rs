//! The nearest obstacle to a segment, by branch and bound over a tree of boxes.
//!
//! All boxes of a node are treated alike, by vector instructions where the machine has them:
//! branches that depend on distances cannot be foreseen, and cost more than arithmetic. The results
//! are the same bits with any of them. What calculates with [`SimdLanes`] is inlined into
//! [`Search::with_simd`], and closures are not: so there are none.

use pulp::{Simd, WithSimd};

use super::lanes::SimdLanes;

/// Boxes of a node.
pub(super) const BOXES_PER_NODE: usize = 8;
/// Most nodes that wait to be opened: 7 a level, and the last one's 8. Seven partings, always of
/// the largest part and into two of which neither has less than a third, leave none with more than
/// a quarter: 2³² boxes make 16 levels.
const MAX_WAITING_NODES: usize = 120;
/// Child index of a node whose boxes are obstacles.
const LEAF: u32 = 0;
/// Coordinate of a box that is beyond everything, cells: its square is finite.
const FAR_AWAY_CELLS: f32 = 1e18;

/// Up to [`BOXES_PER_NODE`] boxes, coordinate by coordinate so that they are compared together;
/// cells. All of them are obstacles, or none is.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) low: [[f32; BOXES_PER_NODE]; 3],
    pub(super) high: [[f32; BOXES_PER_NODE]; 3],
    /// Number of nodes from this one to the one below a box, or [`LEAF`].
    pub(super) child: [u32; BOXES_PER_NODE],
}

impl Node {
    /// Boxes that are beyond everything.
    pub(super) const EMPTY: Self = Self {
        low: [[FAR_AWAY_CELLS; BOXES_PER_NODE]; 3],
        high: [[FAR_AWAY_CELLS; BOXES_PER_NODE]; 3],
        child: [LEAF; BOXES_PER_NODE],
    };

    fn is_leaf(&self) -> bool {
        self.child[0] == LEAF
    }
}

/// A node to be opened, and the least square of a distance to what it holds.
#[derive(Clone, Copy, Default)]
struct OpenNode {
    square: f32,
    node: u32,
}

/// A search for the squared distance to the nearest obstacle if that is below `bound`, else
/// `bound`; any that is at most `enough`. A type and no closure, so that all of it is compiled for
/// the vector instructions that it is given to.
pub(super) struct Search<'a> {
    /// The first is the root.
    pub(super) nodes: &'a [Node],
    pub(super) segment: &'a Segment,
    pub(super) bound: f32,
    pub(super) enough: f32,
}

impl WithSimd for Search<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f32 {
        let Self { nodes, segment, mut bound, enough } = self;
        let mut waiting = [OpenNode::default(); MAX_WAITING_NODES];
        let mut count = 1;
        while count > 0 && bound > enough {
            count -= 1;
            let OpenNode { square, node: index } = waiting[count];
            if square >= bound {
                continue;
            }
            let node = &nodes[index as usize];
            let (least, most) = segment.distance_bounds_sq(simd, node);
            if !node.is_leaf() {
                for (&square, child) in least.iter().zip(&node.child) {
                    waiting[count] = OpenNode { square, node: index + child };
                    count += usize::from(square < bound);
                }
                continue;
            }
            bound = bound.min(least_of(simd, &most));
            if least_of(simd, &least) < bound {
                bound = bound.min(least_of(simd, &segment.distances_sq_to_boxes(simd, node)));
            }
        }
        bound
    }
}

/// The least of some numbers.
#[inline(always)]
fn least_of<S: Simd>(simd: S, numbers: &[f32; BOXES_PER_NODE]) -> f32 {
    S::as_simd_f32s(numbers)
        .0
        .iter()
        .fold(f32::INFINITY, |least, &some| least.min(simd.reduce_min_f32s(some)))
}

/// A segment in cells.
pub(super) struct Segment {
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
    pub(super) fn new(a: [f32; 3], b: [f32; 3]) -> Self {
        let d = [0, 1, 2].map(|axis| b[axis] - a[axis]);
        let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        Self {
            a,
            d,
            low: [0, 1, 2].map(|axis| a[axis].min(b[axis])),
            high: [0, 1, 2].map(|axis| a[axis].max(b[axis])),
            per_d: d.map(f32::recip),
            inv_square: if square > f32::MIN_POSITIVE { 1.0 / square } else { 0.0 },
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.d.iter().chain(&self.a).all(|x| x.is_finite())
    }

    /// Distance to the nearest face of the grid, negative outside.
    pub(super) fn distance_to_faces(&self, dims: [u32; 3]) -> f32 {
        (0..3)
            .map(|axis| self.low[axis].min(dims[axis] as f32 - self.high[axis]))
            .fold(f32::INFINITY, f32::min)
    }

    /// For each box of a node a square that no distance from the segment to it is below, and the
    /// square of one that there is. The first is the greater of two: the distance of the box around
    /// the segment, and, as squares of distances along a segment are convex, the tangent where the
    /// segment is nearest to the box's centre.
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
        let [two, rounding, inv_square] =
            SimdLanes::splat_triple(simd, [2.0, 2e-6, self.inv_square]);
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
            let t = (along * inv_square).max(zero).min(one);
            let (mut square, mut rate) = (zero, zero);
            for axis in 0..3 {
                let x = a[axis] + d[axis] * t;
                let off = x - x.max(low[axis]).min(high[axis]);
                square = square + off * off;
                rate = rate + off * d[axis];
            }
            let fall = (rate * t).max(rate * (t - one));
            // Less what the terms are rounded by.
            let tangent = square - two * fall - rounding * (square + fall);
            tangent.max(gap_square).store_part(&mut least, part);
            square.store_part(&mut most, part);
        }
        (least, most)
    }

    /// Squared distance to each box of a node. As a function of the place along the segment it is
    /// convex and piecewise quadratic, with breaks where the segment crosses a face's plane; its
    /// rate is linear between them.
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
            let mut boxes = Boxes { half: [zero; 3], start: [zero; 3], d };
            for axis in 0..3 {
                boxes.half[axis] = (high[axis] - low[axis]) * a_half;
                boxes.start[axis] = a[axis] - low[axis] - boxes.half[axis];
            }
            let (mut from, mut to) = (zero, one);
            let (mut rate_from, mut rate_to) = (boxes.at(zero).1, boxes.at(one).1);
            for axis in 0..3 {
                for face in [zero - boxes.half[axis], boxes.half[axis]] {
                    // An axis without motion may give NaN here: then this is `from`.
                    let t = ((face - boxes.start[axis]) * per_d[axis]).max(from).min(to);
                    let (_, rate) = boxes.at(t);
                    let falls = rate.is_below(zero);
                    (from, to) = (t.select(falls, from), to.select(falls, t));
                    (rate_from, rate_to) =
                        (rate.select(falls, rate_from), rate_to.select(falls, rate));
                }
            }
            // Between both ends the distance falls, then rises, and its rate is linear.
            let between = from + (to - from) * (rate_from / (rate_from - rate_to));
            let t = between.select(rate_from.is_below(zero), from);
            let t = t.select(zero.is_below(rate_to), to);
            boxes.at(t).0.store_part(&mut squares, part);
        }
        squares
    }
}

/// Boxes as a segment sees them.
struct Boxes<S: Simd> {
    /// Half their sides.
    half: [SimdLanes<S>; 3],
    /// The segment's begin, from their centres.
    start: [SimdLanes<S>; 3],
    d: [SimdLanes<S>; 3],
}

impl<S: Simd> Boxes<S> {
    /// Squared distance at a place along the segment, and half its rate.
    #[inline(always)]
    fn at(&self, t: SimdLanes<S>) -> (SimdLanes<S>, SimdLanes<S>) {
        let zero = t.zero();
        let (mut square, mut rate) = (zero, zero);
        for axis in 0..3 {
            let x = self.start[axis] + self.d[axis] * t;
            let off = x - x.max(zero - self.half[axis]).min(self.half[axis]);
            square = square + off * off;
            rate = rate + off * self.d[axis];
        }
        (square, rate)
    }
}
