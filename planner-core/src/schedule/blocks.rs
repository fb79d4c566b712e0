//! Bounding volumes that rule out pairs of timed segments: each block of consecutive segments of a
//! flight has a bounding box and a capsule. Segments of two flights are compared only where the
//! volumes of both come near each other.
//!
//! Pairs in conflict are never ruled out, and the remaining pairs keep their order, so schedules
//! are bit for bit those of a comparison of all pairs. Cost: one pass over the own flight, and the
//! straight parts or blocks of the other flight × the own blocks.

use heapless::Vec;
use libm::fmaxf;

use super::config::ScheduleConfig;
use super::timed_segments::{
    MAX_TIMED_SEGMENTS, StraightPart, TimedSegment, part_leg_ends, straight_part,
};
use crate::Point;
use crate::flight::{Flight, Waypoint};
use crate::geo::distance::segments_distance_sq;

/// Timed segments per block. More make capsules wide at corners, fewer make more capsules.
pub(super) const SEGMENTS_PER_BLOCK: usize = 8;
/// Most blocks of a flight; each is a bit of [`BlockSet`].
pub(super) const MAX_BLOCKS: usize = MAX_TIMED_SEGMENTS / SEGMENTS_PER_BLOCK;
/// Blocks per group.
const BLOCKS_PER_GROUP: usize = 8;
/// Most groups of blocks of a flight.
const MAX_GROUPS: usize = MAX_BLOCKS.div_ceil(BLOCKS_PER_GROUP);
/// Most by which f32 rounding shortens a distance between points kilometres from the origin,
/// metres.
const BLOCK_ROUNDING_M: f32 = 0.1;

/// Most by which rounding shortens the length of a block's eight segments, metres.
const LENGTH_ROUNDING_M: f32 = 0.01;
/// The same as a share of the arc length at the end of the block; the greater of both counts.
const LENGTH_ROUNDING_SHARE: f32 = 2e-6;

/// A set of blocks of a flight: bit `i` is block `i`.
pub(super) type BlockSet = u64;

const _: () = assert!(
    MAX_BLOCKS <= BlockSet::BITS as usize && MAX_TIMED_SEGMENTS.is_multiple_of(SEGMENTS_PER_BLOCK),
    "a bit for each block"
);

/// Bounding box and capsule of consecutive timed segments.
#[derive(Clone, Copy, Debug)]
struct SegmentBlock {
    bounding_box: BoundingBox,
    /// Axis of the capsule: from the beginning of the first segment to the end of the last.
    capsule_axis: (Point, Point),
    /// Radius of the capsule: an upper bound on the distance of the segments from its axis, metres.
    capsule_radius_m: f32,
}

impl SegmentBlock {
    /// The block around consecutive segments. A curve of their length between the same ends
    /// deviates from the straight line by at most half the minor axis of the ellipse with foci at
    /// both ends; that is the radius.
    fn around_segments(segments: &[TimedSegment]) -> Self {
        let (first, last) = (&segments[0], &segments[segments.len() - 1]);
        let mut block = Self::around_line(first.from, last.to);
        segments.iter().for_each(|segment| block.bounding_box.include(&segment.to, &segment.to));
        let rounding_m = fmaxf(LENGTH_ROUNDING_M, LENGTH_ROUNDING_SHARE * last.end_m);
        let length_m = last.end_m - first.wait_at_m + rounding_m;
        let bent_sq = length_m * length_m - (last.to - first.from).norm_squared();
        block.capsule_radius_m = 0.5 * fpu::sqrtf(fmaxf(bent_sq, 0.0));
        block
    }

    /// The block around a straight line, with radius 0.
    fn around_line(from: Point, to: Point) -> Self {
        let mut bounding_box = BoundingBox(from, from);
        bounding_box.include(&to, &to);
        Self { bounding_box, capsule_axis: (from, to), capsule_radius_m: 0.0 }
    }

    /// The block of all that is in a box: its radius is infinite, so only the box rules out pairs.
    fn from_box(bounding_box: BoundingBox) -> Self {
        Self {
            bounding_box,
            capsule_axis: (bounding_box.0, bounding_box.1),
            capsule_radius_m: f32::INFINITY,
        }
    }

    /// Whether the two capsules come within `reach_m` of each other; true if either radius is
    /// infinite.
    fn capsules_come_near(&self, other: &Self, reach_m: f32) -> bool {
        let apart_m = reach_m + self.capsule_radius_m + other.capsule_radius_m;
        let (own, theirs) = (&self.capsule_axis, &other.capsule_axis);
        // Without this check boxes of 10^15 m would be ruled out: their squared distance is NaN.
        apart_m.is_infinite()
            || segments_distance_sq((&own.0, &own.1), (&theirs.0, &theirs.1)) <= apart_m * apart_m
    }
}

/// An axis-aligned box, from its lowest to its highest corner.
#[derive(Clone, Copy, Debug, Default)]
struct BoundingBox(Point, Point);

impl BoundingBox {
    /// The box without points, from which [`Self::include`] starts.
    const EMPTY: Self = {
        let (low, high) = (f32::INFINITY, f32::NEG_INFINITY);
        Self(Point::new(low, low, low), Point::new(high, high, high))
    };

    /// Grows the box to hold the box from `low` to `high`.
    #[inline(never)]
    fn include(&mut self, low: &Point, high: &Point) {
        // Not `fminf`, whose handling of NaN takes ten times as long on a board.
        for axis in 0..3 {
            if low[axis] < self.0[axis] {
                self.0[axis] = low[axis];
            }
            if high[axis] > self.1[axis] {
                self.1[axis] = high[axis];
            }
        }
    }

    /// Moves each face outwards by `reach_m`.
    fn widen(&mut self, reach_m: f32) {
        (self.0, self.1) = (self.0.add_scalar(-reach_m), self.1.add_scalar(reach_m));
    }

    /// Whether the boxes meet, at a face too.
    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.0[axis] <= other.1[axis] && other.0[axis] <= self.1[axis])
    }

    /// Whether a line lies entirely beyond one face of the box. False does not mean that they meet.
    #[inline(never)]
    fn is_line_beyond_face(&self, from: &Point, to: &Point) -> bool {
        (0..3).any(|axis| {
            let (low, high) = (self.0[axis], self.1[axis]);
            (from[axis] > high && to[axis] > high) || (from[axis] < low && to[axis] < low)
        })
    }
}

/// The blocks of one flight, with boxes around groups of blocks and around all. Boxes are widened
/// by `conflict_distance_m`, so that a line outside a box is in no conflict with the segments in
/// it.
#[derive(Debug, Default)]
pub(super) struct OwnBlocks {
    /// The blocks, in order along the flight.
    blocks: Vec<SegmentBlock, MAX_BLOCKS>,
    /// Box around each group of [`BLOCKS_PER_GROUP`] blocks.
    group_boxes: Vec<BoundingBox, MAX_GROUPS>,
    /// Box around all blocks.
    whole_box: BoundingBox,
    /// Distance from which on two segments are not in conflict, metres.
    conflict_distance_m: f32,
}

impl OwnBlocks {
    pub(super) const fn new() -> Self {
        let whole = BoundingBox(Point::new(0.0, 0.0, 0.0), Point::new(0.0, 0.0, 0.0));
        Self {
            blocks: Vec::new(),
            group_boxes: Vec::new(),
            whole_box: whole,
            conflict_distance_m: 0.0,
        }
    }

    /// Builds blocks, groups and the whole box from the timed segments of a flight.
    pub(super) fn rebuild(&mut self, cfg: &ScheduleConfig, segments: &[TimedSegment]) {
        self.conflict_distance_m =
            fmaxf(cfg.separation_m, cfg.parked_separation_m) + BLOCK_ROUNDING_M;
        self.blocks.clear();
        for some in segments.chunks(SEGMENTS_PER_BLOCK) {
            let mut block = SegmentBlock::around_segments(some);
            block.bounding_box.widen(self.conflict_distance_m);
            // Cannot overflow: there are no more segments than all blocks have room for.
            let _ = self.blocks.push(block);
        }
        self.group_boxes.clear();
        self.whole_box = BoundingBox::EMPTY;
        for blocks in self.blocks.chunks(BLOCKS_PER_GROUP) {
            let mut around = BoundingBox::EMPTY;
            blocks
                .iter()
                .for_each(|block| around.include(&block.bounding_box.0, &block.bounding_box.1));
            self.whole_box.include(&around.0, &around.1);
            // Cannot overflow: there are no more blocks than all groups have room for.
            let _ = self.group_boxes.push(around);
        }
    }

    /// The straight parts of another flight that may be in conflict with this one, in order, each
    /// with the blocks of this flight that it may be in conflict with.
    pub(super) fn parts_near<'f, const W: usize>(
        &'f self,
        cfg: &'f ScheduleConfig,
        flight: &'f Flight<W>,
    ) -> impl Iterator<Item = (StraightPart, BlockSet)> + use<'f, W> {
        let (mut next, mut checked_to) = (0, 1);
        core::iter::from_fn(move || {
            loop {
                if next >= checked_to {
                    let (legs, around) =
                        leading_level_legs(flight.path.waypoints().get(next - 1..)?)?;
                    checked_to = next + legs.max(1);
                    if legs > 1 && self.blocks_near_block(&SegmentBlock::from_box(around)) == 0 {
                        next = checked_to;
                    }
                }
                let (from, to) = part_leg_ends(flight, next)?;
                let near = self.blocks_near_line(from, to);
                next += 1;
                if near != 0 {
                    return Some((straight_part(cfg.vertical_mps, flight, next - 1)?, near));
                }
            }
        })
    }

    /// The blocks that may be in conflict with another flight on the straight line between two
    /// points.
    pub(super) fn blocks_near_line(&self, from: Point, to: Point) -> BlockSet {
        if self.whole_box.is_line_beyond_face(&from, &to) {
            return 0;
        }
        self.blocks_near_block(&SegmentBlock::around_line(from, to))
    }

    /// The blocks that may be in conflict with these at most [`SEGMENTS_PER_BLOCK`] consecutive
    /// segments of another flight.
    pub(super) fn blocks_near(&self, segments: &[TimedSegment]) -> BlockSet {
        if segments.is_empty() {
            0
        } else {
            self.blocks_near_block(&SegmentBlock::around_segments(segments))
        }
    }

    /// The blocks that may be in conflict with a block of another flight.
    #[inline(never)]
    fn blocks_near_block(&self, other: &SegmentBlock) -> BlockSet {
        let mut near = 0;
        for (group, (around, blocks)) in
            self.group_boxes.iter().zip(self.blocks.chunks(BLOCKS_PER_GROUP)).enumerate()
        {
            if !around.overlaps(&other.bounding_box) {
                continue;
            }
            for (bit, own) in blocks.iter().enumerate() {
                if own.bounding_box.overlaps(&other.bounding_box)
                    && own.capsules_come_near(other, self.conflict_distance_m)
                {
                    near |= 1 << (group * BLOCKS_PER_GROUP + bit);
                }
            }
        }
        near
    }

    /// Writes the indices of those segments of the blocks `near` that may be in conflict with
    /// another flight on a straight line to `out`, in ascending order.
    pub(super) fn segments_near_line(
        &self,
        near: BlockSet,
        segments: &[TimedSegment],
        (from, to): (Point, Point),
        out: &mut Vec<u16, MAX_TIMED_SEGMENTS>,
    ) {
        let mut line = BoundingBox(from, from);
        line.include(&to, &to);
        line.widen(self.conflict_distance_m);
        out.clear();
        for block in set_bit_indices(near) {
            let first = block * SEGMENTS_PER_BLOCK;
            let end = (first + SEGMENTS_PER_BLOCK).min(segments.len());
            for (index, segment) in (first..).zip(segments.get(first..end).unwrap_or_default()) {
                if !line.is_line_beyond_face(&segment.from, &segment.to) {
                    // Cannot overflow: `out` has room for all segments.
                    let _ = out.push(index as u16);
                }
            }
        }
    }
}

/// Number of legs from the first waypoint on that stay at that waypoint's height, and their
/// bounding box, by which all these legs can be ruled out at once.
fn leading_level_legs(waypoints: &[Waypoint]) -> Option<(usize, BoundingBox)> {
    let (first, rest) = waypoints.split_first()?;
    let (mut low, mut high) = (first.position, first.position);
    let mut legs = 0;
    for waypoint in rest.iter().take_while(|waypoint| waypoint.position.z == first.position.z) {
        for axis in 0..2 {
            if waypoint.position[axis] < low[axis] {
                low[axis] = waypoint.position[axis];
            }
            if waypoint.position[axis] > high[axis] {
                high[axis] = waypoint.position[axis];
            }
        }
        legs += 1;
    }
    Some((legs, BoundingBox(low, high)))
}

/// Indices of the set bits, in ascending order.
pub(super) fn set_bit_indices(mut bits: BlockSet) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let bit = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (bit < BlockSet::BITS as usize).then_some(bit)
    })
}

/// The segments of the blocks `near` with their indices, in ascending order.
pub(super) fn segments_in_blocks(
    near: BlockSet,
    segments: &[TimedSegment],
) -> impl Iterator<Item = (usize, &TimedSegment)> {
    set_bit_indices(near).flat_map(|block| {
        let first = block * SEGMENTS_PER_BLOCK;
        (first..).zip(segments.chunks(SEGMENTS_PER_BLOCK).nth(block).unwrap_or_default())
    })
}

#[cfg(test)]
mod tests;
