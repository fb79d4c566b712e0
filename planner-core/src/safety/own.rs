//! A vehicle's own set, prepared once to be compared with those of many neighbours.
//!
//! Most pairs of legs are far apart, and a board sees that without their distance: by the box around the own set, by the
//! line from its first to its last point and how far the others lie beside that, and by balls around the legs. What is
//! left is compared leg by leg. Each of these bounds is a little wider than it has to be, so rounding skips no pair
//! that counts.

use heapless::Vec;
use libm::sqrtf;

use super::{MAX_SET_POINTS, ReachableSet};
use crate::Point;
use crate::geometry::{point_distance_sq, segments_distance_sq};

/// Rounding of distances, metres: an approach by less than this is not counted as one, and no
/// vehicle can creep past another by so little.
const APPROACH_ROUNDING_M: f32 = 0.003;
/// Margin added to bounding boxes, metres: more than a coordinate of the mission frame is rounded
/// by.
const BOUNDS_ROUNDING_M: f32 = 0.01;
/// Paths of more legs than this are first bounded by the line between their ends, which is cheaper
/// than to compare each leg.
const MAX_LEGS_WITHOUT_BOUND: usize = 2;

/// No less than the square root, and at most 7 % more: half the exponent, and the line between two powers of four.
#[inline]
fn sqrt_upper_bound(square: f32) -> f32 {
    f32::from_bits((square.to_bits() >> 1) + (127 << 22))
}

/// A leg with its midpoint and an upper bound of half its length.
#[derive(Clone, Copy, Debug)]
struct Leg {
    from: Point,
    to: Point,
    middle: Point,
    half_m: f32,
}

impl Leg {
    #[inline]
    fn new(from: &Point, to: &Point) -> Self {
        let half = (to - from) * 0.5;
        Self { from: *from, to: *to, middle: from + half, half_m: sqrt_upper_bound(half.norm_squared()) }
    }

    /// Whether two cannot come nearer than `apart_m`.
    #[inline]
    fn is_apart(&self, other: &Self, apart_m: f32) -> bool {
        let most_m = self.half_m + other.half_m + apart_m;
        (self.middle - other.middle).norm_squared() >= most_m * most_m
    }
}

/// The own set.
#[derive(Clone, Debug)]
pub struct OwnSet<'a> {
    set: &'a ReachableSet,
    legs: Vec<Leg, MAX_SET_POINTS>,
    /// Reach of the set from its first point, metres.
    reach_m: f32,
    /// Greatest distance of the set from the line between its first point and its last, metres.
    lateral_extent_m: f32,
    /// Middle and size of the box around it.
    middle: Point,
    size: Point,
}

impl<'a> OwnSet<'a> {
    /// The set that a vehicle can no longer avoid.
    pub fn new(set: &'a ReachableSet) -> Self {
        let (first, _) = set.ends();
        // Filled in place: a board takes long to copy it.
        let mut own = Self {
            set,
            legs: Vec::new(),
            reach_m: set.reach_m(),
            lateral_extent_m: 0.0,
            middle: *first,
            size: *first,
        };
        // The second leg begins at the same point where a first leg has no length.
        let double = set.points.len() > 2 && set.points[0] == set.points[1];
        let (mut low, mut high) = (*first, *first);
        set.segments()
            .skip(usize::from(double))
            .for_each(|(from, to)| own.add(from, to, &mut low, &mut high));
        if own.legs.len() > MAX_LEGS_WITHOUT_BOUND {
            own.lateral_extent_m = own.lateral_extent_m();
        }
        (own.middle, own.size) = ((low + high) * 0.5, high - low);
        own
    }

    #[inline(never)]
    fn add(&mut self, from: &Point, to: &Point, low: &mut Point, high: &mut Point) {
        // Cannot overflow: as many legs as points at most.
        let _ = self.legs.push(Leg::new(from, to));
        (*low, *high) = (merge_coordinates(low, to, |a, b| a < b), merge_coordinates(high, to, |a, b| a > b));
    }

    /// No less than what its points lie beside the line between its ends, metres.
    #[inline(never)]
    fn lateral_extent_m(&self) -> f32 {
        let beside_sq = |leg: &Leg| point_distance_sq(self.set.ends(), &leg.to);
        sqrt_upper_bound(
            self.legs.iter().map(beside_sq).fold(0.0, |most, sq| if sq > most { sq } else { most }),
        )
    }

    /// Greatest distance of the set from its first point, metres.
    #[inline]
    pub fn reach_m(&self) -> f32 {
        self.reach_m
    }

    /// Whether a segment stays outside the box around this set, by `apart_m`.
    #[inline]
    fn is_outside(&self, from: &Point, to: &Point, apart_m: f32) -> bool {
        let apart = |axis: usize| {
            let (a, b) = (from[axis] - self.middle[axis], to[axis] - self.middle[axis]);
            // Twice: from middle to middle, less half of each.
            (a + b).abs() - (b - a).abs() >= self.size[axis] + 2.0 * apart_m
        };
        apart(0) || apart(1) || apart(2)
    }

    /// Square of the least distance between the polylines of both sets, at most `most_m` squared.
    fn centreline_distance_sq(&self, other: &ReachableSet, most_m: f32) -> f32 {
        let wide_m = most_m + BOUNDS_ROUNDING_M;
        let mut least_sq = most_m * most_m;
        for (from, to) in other.segments() {
            if self.is_outside(from, to, wide_m) {
                continue;
            }
            if self.legs.len() > MAX_LEGS_WITHOUT_BOUND {
                let line_m = wide_m + self.lateral_extent_m;
                if segments_distance_sq((from, to), self.set.ends()) >= line_m * line_m {
                    continue;
                }
            }
            let other = Leg::new(from, to);
            for leg in &self.legs {
                if !leg.is_apart(&other, wide_m) {
                    let apart_sq = segments_distance_sq((from, to), (&leg.from, &leg.to));
                    least_sq = if apart_sq < least_sq { apart_sq } else { least_sq };
                }
            }
        }
        least_sq
    }

    /// Whether this vehicle's set comes nearer than `apart_m` to a neighbour's, which is at `place` now, and nearer than the
    /// vehicle is already.
    pub fn conflicts(&self, other: &ReachableSet, place: &Point, apart_m: f32) -> bool {
        let most_m = apart_m + other.widened_by_m + self.set.widened_by_m;
        let most_sq = most_m * most_m;
        let motion_sq = self.centreline_distance_sq(other, most_m);
        motion_sq < most_sq && self.comes_nearer(motion_sq, other, place, most_m)
    }

    /// Whether a motion that comes too near comes nearer than the vehicle is.
    #[inline(never)]
    fn comes_nearer(&self, motion_sq: f32, other: &ReachableSet, place: &Point, most_m: f32) -> bool {
        if self.set.widened_by_m > 0.0 {
            return true;
        }
        let here = &self.set.points[0];
        if is_nearer(motion_sq, distance_sq(other, here, most_m * most_m)) {
            return true;
        }
        // The vehicle stays as far from where the neighbour may come; but it must not fly towards
        // where the neighbour comes from.
        let now_sq = (here - place).norm_squared();
        is_nearer(distance_sq(self.set, place, f32::INFINITY), now_sq.min(4.0 * most_m * most_m))
    }
}

/// Square of the least distance from a set's line to a place, or `most_sq` if it is not less.
#[inline(never)]
fn distance_sq(set: &ReachableSet, place: &Point, most_sq: f32) -> f32 {
    let nearer = |least: f32, leg| {
        let apart_sq = point_distance_sq(leg, place);
        if apart_sq < least { apart_sq } else { least }
    };
    set.segments().fold(most_sq, nearer)
}

/// Whether a distance is less than another one, both squared.
#[inline]
fn is_nearer(least_sq: f32, than_sq: f32) -> bool {
    // Most are not, and take no root.
    least_sq < than_sq && sqrtf(least_sq) < sqrtf(than_sq) - APPROACH_ROUNDING_M
}

/// Coordinate by coordinate `b` where it is `more` than `a`. Not `min`: what that does about numbers that are none takes a
/// board three times as long.
#[inline]
fn merge_coordinates(a: &Point, b: &Point, more: impl Fn(f32, f32) -> bool) -> Point {
    let of = |a: f32, b: f32| if more(b, a) { b } else { a };
    Point::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z))
}
