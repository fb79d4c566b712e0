//! The own vehicle's reachable set, prepared once to be compared with those of many neighbours.
//!
//! Most pairs of legs are far apart, which cheap bounds show without a distance: the bounding box
//! of the own set, and balls around the legs. Only the remaining pairs are compared leg by leg.
//! Each bound is slightly wider than necessary, so rounding rules out no pair that conflicts.

use fpu::sqrtf;
use heapless::Vec;

use super::set::{MAX_SET_POINTS, ReachableSet};
use crate::Point;
use crate::geo::distance::{segment_to_point_distance_sq, segments_distance_sq};

/// Rounding of distances, metres: an approach by less than this does not count as one. No vehicle
/// can get past another by coming so little nearer.
const APPROACH_ROUNDING_M: f32 = 0.003;
/// Margin added to bounding boxes, metres: more than the rounding of a coordinate of the mission
/// frame.
const BOUNDS_ROUNDING_M: f32 = 0.01;
/// Upper bound of a square root, at most 7 % above it: half the exponent, and linear between two
/// powers of four.
#[inline]
fn sqrt_upper_bound(square: f32) -> f32 {
    f32::from_bits((square.to_bits() >> 1) + (127 << 22))
}

/// Memory for the legs of a set, which the caller lends to [`OwnSet::new`].
pub type Legs<'a> = Vec<SetLeg<'a>, MAX_SET_POINTS>;

/// A leg of the own reachable set, with its midpoint and an upper bound of half its length.
#[derive(Clone, Copy, Debug)]
pub struct SetLeg<'a> {
    from: &'a Point,
    to: &'a Point,
    /// Midpoint of the leg, ENU metres.
    middle: Point,
    /// Upper bound of half the leg's length, at most 7 % above it, metres.
    half_length_bound_m: f32,
}

impl<'a> SetLeg<'a> {
    #[inline]
    fn new(from: &'a Point, to: &'a Point) -> Self {
        let half = (to - from) * 0.5;
        Self {
            from,
            to,
            middle: from + half,
            half_length_bound_m: sqrt_upper_bound(half.norm_squared()),
        }
    }

    /// Whether two legs are certainly at least `apart_m` from each other.
    #[inline]
    fn is_apart(&self, other: &SetLeg<'_>, apart_m: f32) -> bool {
        let most_m = self.half_length_bound_m + other.half_length_bound_m + apart_m;
        (self.middle - other.middle).norm_squared() >= most_m * most_m
    }

    /// Whether the leg may come nearer to a point than `near_m`.
    #[inline]
    fn may_come_within(&self, place: &Point, near_m: f32) -> bool {
        let most_m = self.half_length_bound_m + near_m + BOUNDS_ROUNDING_M;
        (self.middle - place).norm_squared() < most_m * most_m
    }
}

/// The own vehicle's reachable set with its legs and its bounding box.
#[derive(Clone, Debug)]
pub struct OwnSet<'a> {
    /// The vehicle's reachable set.
    set: &'a ReachableSet,
    /// The legs of the set's polyline.
    legs: &'a [SetLeg<'a>],
    /// Centre of the bounding box, and half of its size.
    box_middle: Point,
    box_half: Point,
    /// Distance of centres at which the two hulls touch, metres: a vehicle already this near to
    /// where another one may come has no distance left to keep, and only has to leave. 0 until the
    /// caller sets it.
    pub touching_m: f32,
}

impl<'a> OwnSet<'a> {
    /// Prepares the own vehicle's reachable set. The caller lends the memory for its legs: copying
    /// them takes long on a board.
    pub fn new<'s: 'a>(set: &'s ReachableSet, legs: &'a mut Legs<'s>) -> Self {
        let first = set.points[0];
        // Where the first leg has length 0, the second begins at the same point, and the first is
        // left out.
        let double = set.points.len() > 2 && first == set.points[1];
        let (mut low, mut high) = (first, first);
        legs.clear();
        for (from, to) in set.segments().skip(usize::from(double)) {
            // Cannot overflow: there are at most as many legs as points.
            let _ = legs.push(SetLeg::new(from, to));
            low = select_per_axis(&low, to, |a, b| a < b);
            high = select_per_axis(&high, to, |a, b| a > b);
        }
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        Self { set, legs, box_middle: middle, box_half: half, touching_m: 0.0 }
    }

    /// Distances from the set's bounding box to a point along each axis, metres; 0 on an axis along
    /// which the point is within the box.
    #[inline]
    pub fn box_distances(&self, place: &Point) -> Point {
        let axis = |axis: usize| {
            let away = (place[axis] - self.box_middle[axis]).abs() - self.box_half[axis];
            if away > 0.0 { away } else { 0.0 }
        };
        Point::new(axis(0), axis(1), axis(2))
    }

    /// Whether a segment, given by its midpoint and half its vector, is at least `apart_m` outside
    /// the set's bounding box along some axis.
    #[inline]
    fn is_outside(&self, middle: &Point, half: &Point, apart_m: f32) -> bool {
        let apart = |axis: usize| {
            (middle[axis] - self.box_middle[axis]).abs() - half[axis].abs()
                >= self.box_half[axis] + apart_m
        };
        apart(0) || apart(1) || apart(2)
    }

    /// Square of the least distance between the polylines of both reachable sets, and the segment
    /// of the other set at that distance; `None` if the sets are no nearer than `most_m`.
    #[inline(always)]
    fn nearest_segment<'o>(
        &self,
        other: &'o ReachableSet,
        most_m: f32,
    ) -> Option<(f32, (&'o Point, &'o Point))> {
        let mut wide_m = most_m + BOUNDS_ROUNDING_M;
        let (mut least_sq, mut found) = (most_m * most_m, None);
        for (from, to) in other.segments() {
            let half = (to - from) * 0.5;
            if self.is_outside(&(from + half), &half, wide_m) {
                continue;
            }
            let other = SetLeg::new(from, to);
            for leg in self.legs {
                if !leg.is_apart(&other, wide_m) {
                    let apart_sq = segments_distance_sq((from, to), (leg.from, leg.to));
                    if apart_sq < least_sq {
                        (least_sq, found) = (apart_sq, Some((from, to)));
                        wide_m = sqrtf(apart_sq) + BOUNDS_ROUNDING_M;
                    }
                }
            }
        }
        found.map(|segment| (least_sq, segment))
    }

    /// Whether this set comes nearer than `apart_m` to a neighbour's set, and this motion brings
    /// the vehicle nearer than it is already. `place` is the neighbour's present position.
    pub fn conflicts(&self, other: &ReachableSet, place: &Point, apart_m: f32) -> bool {
        let most_m = apart_m + other.widened_by_m + self.set.widened_by_m;
        let found = self.nearest_segment(other, most_m);
        found.is_some_and(|nearest| self.comes_nearer(nearest, other, place, most_m))
    }

    /// Whether a motion that comes too near also comes nearer than the vehicle is now. True for an
    /// own set that is widened.
    #[inline(never)]
    fn comes_nearer(
        &self,
        (motion_sq, nearest): (f32, (&Point, &Point)),
        other: &ReachableSet,
        place: &Point,
        most_m: f32,
    ) -> bool {
        if self.set.widened_by_m > 0.0 {
            return true;
        }
        let here = &self.set.points[0];
        // The motion comes no nearer if the vehicle is already as near to a leg of the neighbour's
        // set, or so near that it would touch a neighbour on that leg.
        let here_m = fast_max(sqrtf(motion_sq) + APPROACH_ROUNDING_M, self.touching_m);
        let is_here = |leg| segment_to_point_distance_sq(leg, here) <= here_m * here_m;
        // Most often such a leg is the one that the motion comes nearest to, so it is checked
        // first.
        if here_m < most_m && !is_here(nearest) && !other.segments().any(is_here) {
            return true;
        }
        // The vehicle stays as far from the neighbour's set as it is, but it must not fly towards
        // the neighbour's present position either.
        let now_sq = (here - place).norm_squared();
        let nearer_m = sqrtf(now_sq.min(4.0 * most_m * most_m)) - APPROACH_ROUNDING_M;
        let is_nearer = |leg: &SetLeg<'_>| {
            leg.may_come_within(place, nearer_m)
                && segment_to_point_distance_sq((leg.from, leg.to), place) < nearer_m * nearer_m
        };
        nearer_m > 0.0 && self.legs.iter().any(is_nearer)
    }
}

/// The greater of two numbers. `f32::max`, which also checks for NaN, takes three times as long on
/// a board.
#[inline]
fn fast_max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// For each coordinate that of `b` if it is `more` than that of `a`, else that of `a`. Not `min`,
/// whose handling of NaN takes three times as long on a board.
#[inline]
fn select_per_axis(a: &Point, b: &Point, more: impl Fn(f32, f32) -> bool) -> Point {
    let of = |a: f32, b: f32| if more(b, a) { b } else { a };
    Point::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z))
}
