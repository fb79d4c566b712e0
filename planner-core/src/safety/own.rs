//! A vehicle's own set, prepared once to be compared with those of many neighbours.
//!
//! Most pairs of legs are far apart, and a board sees that without their distance: by the box
//! around the own set and by balls around the legs. What is left is compared leg by leg. Each of
//! these bounds is a little wider than it has to be, so rounding skips no pair that counts.

use fpu::sqrtf;
use heapless::Vec;

use super::{MAX_SET_POINTS, ReachableSet};
use crate::Point;
use crate::geometry::{point_distance_sq, segments_distance_sq};

/// Rounding of distances, metres: an approach by less than this is not counted as one, and no
/// vehicle can creep past another by so little.
const APPROACH_ROUNDING_M: f32 = 0.003;
/// Margin added to bounding boxes, metres: more than a coordinate of the mission frame is rounded
/// by.
const BOUNDS_ROUNDING_M: f32 = 0.01;
/// No less than the square root, and at most 7 % more: half the exponent, and the line between two
/// powers of four.
#[inline]
fn sqrt_upper_bound(square: f32) -> f32 {
    f32::from_bits((square.to_bits() >> 1) + (127 << 22))
}

/// Room for the legs of a set.
pub type Legs<'a> = Vec<Leg<'a>, MAX_SET_POINTS>;

/// A leg with its midpoint and an upper bound of half its length.
#[derive(Clone, Copy, Debug)]
pub struct Leg<'a> {
    from: &'a Point,
    to: &'a Point,
    middle: Point,
    half_m: f32,
}

impl<'a> Leg<'a> {
    #[inline]
    fn new(from: &'a Point, to: &'a Point) -> Self {
        let half = (to - from) * 0.5;
        Self { from, to, middle: from + half, half_m: sqrt_upper_bound(half.norm_squared()) }
    }

    /// Whether two cannot come nearer than `apart_m`.
    #[inline]
    fn is_apart(&self, other: &Leg<'_>, apart_m: f32) -> bool {
        let most_m = self.half_m + other.half_m + apart_m;
        (self.middle - other.middle).norm_squared() >= most_m * most_m
    }

    /// Whether it may come nearer to a place than `near_m`.
    #[inline]
    fn may_come_within(&self, place: &Point, near_m: f32) -> bool {
        let most_m = self.half_m + near_m + BOUNDS_ROUNDING_M;
        (self.middle - place).norm_squared() < most_m * most_m
    }
}

/// The own set.
#[derive(Clone, Debug)]
pub struct OwnSet<'a> {
    set: &'a ReachableSet,
    legs: &'a [Leg<'a>],
    /// Middle of the box around it, and half of its size.
    middle: Point,
    half: Point,
}

impl<'a> OwnSet<'a> {
    /// The set that a vehicle can no longer avoid. The caller lends the room for its legs: a board
    /// takes long to copy them.
    pub fn new<'s: 'a>(set: &'s ReachableSet, legs: &'a mut Legs<'s>) -> Self {
        let first = set.points[0];
        // The second leg begins at the same point where a first leg has no length.
        let double = set.points.len() > 2 && first == set.points[1];
        let (mut low, mut high) = (first, first);
        legs.clear();
        for (from, to) in set.segments().skip(usize::from(double)) {
            // Cannot overflow: as many legs as points at most.
            let _ = legs.push(Leg::new(from, to));
            low = merge_coordinates(&low, to, |a, b| a < b);
            high = merge_coordinates(&high, to, |a, b| a > b);
        }
        Self { set, legs, middle: (low + high) * 0.5, half: (high - low) * 0.5 }
    }

    /// From the box around the set to a place, metres; 0 on each axis along which the place is
    /// beside no face.
    #[inline]
    pub fn away_from_box(&self, place: &Point) -> Point {
        let axis = |axis: usize| {
            let away = (place[axis] - self.middle[axis]).abs() - self.half[axis];
            if away > 0.0 { away } else { 0.0 }
        };
        Point::new(axis(0), axis(1), axis(2))
    }

    /// Whether a segment, given by its middle and half of it, stays outside the box around this
    /// set, by `apart_m`.
    #[inline]
    fn is_outside(&self, middle: &Point, half: &Point, apart_m: f32) -> bool {
        let apart = |axis: usize| {
            (middle[axis] - self.middle[axis]).abs() - half[axis].abs() >= self.half[axis] + apart_m
        };
        apart(0) || apart(1) || apart(2)
    }

    /// Square of the least distance between the polylines of both sets, and the segment of the other
    /// one that is so near; none where they are no nearer than `most_m`.
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
            let other = Leg::new(from, to);
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

    /// Whether this vehicle's set comes nearer than `apart_m` to a neighbour's, which is at `place`
    /// now, and nearer than the vehicle is already.
    pub fn conflicts(&self, other: &ReachableSet, place: &Point, apart_m: f32) -> bool {
        let most_m = apart_m + other.widened_by_m + self.set.widened_by_m;
        let found = self.nearest_segment(other, most_m);
        found.is_some_and(|nearest| self.comes_nearer(nearest, other, place, most_m))
    }

    /// Whether a motion that comes too near comes nearer than the vehicle is.
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
        // A motion leads no nearer where the vehicle is as near to one leg already.
        let here_m = sqrtf(motion_sq) + APPROACH_ROUNDING_M;
        let is_here = |leg| point_distance_sq(leg, here) <= here_m * here_m;
        // Most often that is the leg that the motion comes nearest to.
        if here_m < most_m && !is_here(nearest) && !other.segments().any(is_here) {
            return true;
        }
        // The vehicle stays as far from where the neighbour may come; but it must not fly towards
        // where the neighbour comes from.
        let now_sq = (here - place).norm_squared();
        let nearer_m = sqrtf(now_sq.min(4.0 * most_m * most_m)) - APPROACH_ROUNDING_M;
        let is_nearer = |leg: &Leg<'_>| {
            leg.may_come_within(place, nearer_m)
                && point_distance_sq((leg.from, leg.to), place) < nearer_m * nearer_m
        };
        nearer_m > 0.0 && self.legs.iter().any(is_nearer)
    }
}

/// Coordinate by coordinate `b` where it is `more` than `a`. Not `min`: what that does about
/// numbers that are none takes a board three times as long.
#[inline]
fn merge_coordinates(a: &Point, b: &Point, more: impl Fn(f32, f32) -> bool) -> Point {
    let of = |a: f32, b: f32| if more(b, a) { b } else { a };
    Point::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z))
}
