//! The own set as prepared, against the definition: every leg with every other one.

extern crate std;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;
use std::vec::Vec as StdVec;

use super::*;
use crate::geometry::segments_distance_sq;

const BRAKING: Braking = Braking { accel_mps2: 1.5, jerk_mps3: 8.0 };
/// As in the definition.
const NEARER_M: f32 = 0.003;

fn uniform(rng: &mut Pcg32, low: f32, high: f32) -> f32 {
    low + (high - low) * (rng.next_u32() >> 8) as f32 / 16_777_216.0
}

fn near(rng: &mut Pcg32, m: f32) -> Point {
    Point::new(uniform(rng, -m, m), uniform(rng, -m, m), uniform(rng, -m, m))
}

fn one_of<T: Copy>(rng: &mut Pcg32, of: &[T]) -> T {
    of[rng.next_u32() as usize % of.len()]
}

/// Square of the least distance between two sets' lines, at most `most_sq`.
fn least_sq(a: &Set, b: &Set, most_sq: f32) -> f32 {
    let pairs = a.segments().flat_map(|p| b.segments().map(move |q| segments_distance_sq(q, p)));
    pairs.fold(most_sq, f32::min)
}

/// Whether two sets conflict, by the definition.
fn conflict(own: &Set, other: &Set, place: &Point, apart_m: f32) -> bool {
    let here = Set::at(own.points[0]);
    let most_m = apart_m + other.grow_m + own.grow_m;
    let most_sq = most_m * most_m;
    let motion_sq = least_sq(own, other, most_sq);
    if motion_sq >= most_sq {
        return false;
    }
    let now_m = least_sq(&here, other, most_sq).sqrt();
    if own.grow_m > 0.0 || motion_sq.sqrt() < now_m - NEARER_M {
        return true;
    }
    let least_m = least_sq(&Set::at(*place), own, f32::INFINITY).sqrt();
    least_m < (own.points[0] - place).norm_squared().sqrt().min(2.0 * most_m) - NEARER_M
}

/// A way of up to so many legs: nearly straight, or to and fro, or straight up and down; the first may have no length.
fn way(rng: &mut Pcg32, from: Point, most: u32) -> StdVec<Point> {
    let leg_m = one_of(rng, &[0.2, 1.0, 5.0]);
    let onward = near(rng, leg_m);
    let kind = rng.next_u32() % 3;
    let mut at = from;
    let mut points = StdVec::new();
    if rng.next_u32().is_multiple_of(2) {
        points.push(at);
    }
    for _ in 0..rng.next_u32() % most {
        at += match kind {
            0 => onward + near(rng, 0.01 * leg_m),
            1 => near(rng, leg_m),
            _ => Point::new(0.0, 0.0, uniform(rng, -leg_m, leg_m)),
        };
        points.push(at);
    }
    points
}

fn heard<'a>(rng: &mut Pcg32, position: Point, points: &'a [Point]) -> Heard<'a> {
    let velocity = near(rng, 2.0);
    Heard {
        position,
        velocity,
        speed_mps: velocity.norm(),
        age_s: uniform(rng, 0.0, 1.2),
        delay_s: uniform(rng, 0.0, 0.5),
        points,
        joint: Joint::Unknown,
        extent_m: points.iter().map(|p| (p - points[0]).norm()).fold(0.0, f32::max),
        rests_within_m: one_of(rng, &[0.0, 0.0, 6.0]),
        grounded: rng.next_u32().is_multiple_of(16),
        column_to_m: rng.next_u32().is_multiple_of(3).then(|| position.z - uniform(rng, -1.0, 60.0)),
    }
}

#[test]
fn a_prepared_set_conflicts_where_the_definition_says() {
    let bounds = Bounds { braking: BRAKING, speed_max_mps: 5.0, silent_s: 3.0 };
    let (mut meets, mut passes, mut far) = (0, 0, 0);
    for seed in 0..if cfg!(debug_assertions) { 20_000 } else { 400_000 } {
        let rng = &mut Pcg32::seed_from_u64(seed);
        let around_m = one_of(rng, &[1.0, 100.0, 2000.0]);
        let here = near(rng, around_m);
        let ahead = way(rng, here, 12);
        let set = match rng.next_u32() % 8 {
            0 => Set::vertical(here, here.z + uniform(rng, -30.0, 30.0)),
            1 => Set::at(here),
            _ => Set::along(here, ahead.iter().copied(), uniform(rng, 0.0, 15.0)),
        };
        let own = OwnSet::new(&set);
        let away_m = one_of(rng, &[2.0, 8.0, 20.0]);
        let position = here + near(rng, away_m);
        let beside_m = one_of(rng, &[0.0, 0.4, 3.0]);
        let from = position + near(rng, beside_m);
        let points = way(rng, from, 8);
        let heard = heard(rng, position, &points);
        let ahead_s = one_of(rng, &[0.0, 3.0]);
        let other = heard.set(&bounds, ahead_s);
        let joint = Joint::find(&position, &points);
        assert_eq!(
            Heard { joint, ..heard }.set(&bounds, ahead_s),
            other,
            "{seed}: what is remembered is the same"
        );
        // A place and eight points that all lie ahead are one more than there is room for.
        if points.len() < 8 {
            assert!(other.reach_m() <= heard.reach_m(&bounds, ahead_s) + 0.01, "{seed}");
        }
        let apart_m = uniform(rng, 0.5, 3.0);
        let conflicts = own.conflicts(&other, &position, apart_m);
        assert_eq!(
            conflicts,
            conflict(&set, &other, &position, apart_m),
            "{seed}: {set:?}, {other:?}, {apart_m} m"
        );
        let most_m = apart_m + other.grow_m + set.grow_m;
        let most_sq = most_m * most_m;
        match (conflicts, least_sq(&set, &other, most_sq) < most_sq) {
            (true, _) => meets += 1,
            (false, true) => passes += 1,
            (false, false) => far += 1,
        }
    }
    std::println!("{meets} meet, {passes} are near and come no nearer, {far} are apart");
    assert!(meets > 1000 && passes > 500 && far > 1000, "{meets} {passes} {far}");
}

#[test]
fn the_remembered_place_is_the_nearest_on_the_points() {
    let mut on = 0;
    for seed in 0..20_000 {
        let rng = &mut Pcg32::seed_from_u64(seed);
        let position = near(rng, 100.0);
        let from = position + near(rng, 1.0);
        let points = way(rng, from, 8);
        let place = Joint::find(&position, &points).ahead(&position, &points);
        // 1 cm apart.
        let legs = points.windows(2).flat_map(|leg| {
            let steps = ((leg[1] - leg[0]).norm() / 0.01) as usize + 1;
            (0..=steps).map(move |i| leg[0] + (leg[1] - leg[0]) * (i as f32 / steps as f32))
        });
        let away_m = |p: Point| (position - p).norm();
        let least_m = legs.chain(points.first().copied()).map(away_m).fold(f32::INFINITY, f32::min);
        match place {
            Some((place, ahead)) => {
                assert!(away_m(place) < least_m + 1e-3 && away_m(place) < OFF_M, "{seed}");
                assert!(ahead.len() <= points.len(), "{seed}");
                on += 1;
            }
            None => assert!(points.is_empty() || least_m > OFF_M - 0.02, "{seed}: {least_m}"),
        }
    }
    assert!(on > 2000, "{on}");
}
