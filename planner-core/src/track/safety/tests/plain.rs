//! The prepared own set, compared with the definition: every leg against every other one.

extern crate std;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;
use std::vec::Vec as StdVec;

use crate::geo::distance::segments_distance_sq;
use crate::track::safety::*;

const BRAKING: Braking = Braking { accel_mps2: 1.5, jerk_mps3: 8.0 };
/// An approach by less than this, metres, does not count: the value of `APPROACH_ROUNDING_M`.
const NEARER_M: f32 = 0.003;

impl ReachableSet {
    /// Greatest distance of the set from its first point, metres.
    pub(super) fn reach_m(&self) -> f32 {
        let most_m = |most: f32, p: &Point| most.max((p - self.points[0]).norm());
        self.points.iter().fold(0.0, most_m) + self.widened_by_m
    }
}

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
fn least_sq(a: &ReachableSet, b: &ReachableSet, most_sq: f32) -> f32 {
    let pairs = a.segments().flat_map(|p| b.segments().map(move |q| segments_distance_sq(q, p)));
    pairs.fold(most_sq, f32::min)
}

/// Whether two sets conflict, by the definition.
fn conflict(own: &ReachableSet, other: &ReachableSet, place: &Point, apart_m: f32) -> bool {
    let here = ReachableSet::at(own.points[0]);
    let most_m = apart_m + other.widened_by_m + own.widened_by_m;
    let most_sq = most_m * most_m;
    let motion_sq = least_sq(own, other, most_sq);
    if motion_sq >= most_sq {
        return false;
    }
    let now_m = least_sq(&here, other, most_sq).sqrt();
    if own.widened_by_m > 0.0 || motion_sq.sqrt() < now_m - NEARER_M {
        return true;
    }
    let least_m = least_sq(&ReachableSet::at(*place), own, f32::INFINITY).sqrt();
    least_m < (own.points[0] - place).norm_squared().sqrt().min(2.0 * most_m) - NEARER_M
}

/// A polyline of up to that many legs: nearly straight, to and fro, or straight up and down; the
/// first leg may have length 0.
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

/// How far `points` lead a vehicle at `position`.
pub(super) fn reported_path_reach(
    position: &Point,
    points: &[Point],
    place: PlaceOnPoints,
) -> ReportedPathReach {
    let extent_m = points.iter().map(|p| (p - points[0]).norm()).fold(0.0, f32::max);
    ReportedPathReach::new(position, points, &place, extent_m)
}

fn heard<'a>(rng: &mut Pcg32, position: Point, points: &'a [Point]) -> NeighbourMotion<'a> {
    let velocity = near(rng, 2.0);
    NeighbourMotion {
        position,
        velocity,
        speed_mps: velocity.norm(),
        age_s: uniform(rng, 0.0, 1.2),
        delay_s: uniform(rng, 0.0, 0.5),
        reported_points: points,
        place_on_points: PlaceOnPoints::Unknown,
        reported_path_reach: reported_path_reach(&position, points, PlaceOnPoints::Unknown),
        rests_within_m: one_of(rng, &[0.0, 0.0, 6.0]),
        grounded: rng.next_u32().is_multiple_of(16),
        column_bottom_z_m: rng
            .next_u32()
            .is_multiple_of(3)
            .then(|| position.z - uniform(rng, -1.0, 60.0)),
    }
}

#[test]
fn a_prepared_set_conflicts_where_the_definition_says() {
    let bounds =
        MotionBounds { braking: BRAKING, speed_max_mps: 5.0, stopped_when_unheard_for_s: 3.0 };
    let (mut meets, mut passes, mut far) = (0, 0, 0);
    for seed in 0..if cfg!(debug_assertions) { 20_000 } else { 400_000 } {
        let rng = &mut Pcg32::seed_from_u64(seed);
        let around_m = one_of(rng, &[1.0, 100.0, 2000.0]);
        let here = near(rng, around_m);
        let ahead = way(rng, here, 12);
        let set = match rng.next_u32() % 8 {
            0 => ReachableSet::vertical(here, here.z + uniform(rng, -30.0, 30.0)),
            1 => ReachableSet::at(here),
            _ => ReachableSet::along(here, ahead.iter().copied(), uniform(rng, 0.0, 15.0)),
        };
        let mut legs = Legs::new();
        let own = OwnSet::new(&set, &mut legs);
        let away_m = one_of(rng, &[2.0, 8.0, 20.0]);
        let position = here + near(rng, away_m);
        let beside_m = one_of(rng, &[0.0, 0.4, 3.0]);
        let from = position + near(rng, beside_m);
        let points = way(rng, from, 8);
        let heard = heard(rng, position, &points);
        let ahead_s = one_of(rng, &[0.0, 3.0]);
        let other = heard.reachable_set(&bounds, ahead_s);
        let joint = PlaceOnPoints::find(&position, &points, &heard.velocity);
        assert_eq!(
            NeighbourMotion { place_on_points: joint, ..heard }.reachable_set(&bounds, ahead_s),
            other,
            "{seed}: what is remembered is the same"
        );
        assert!(other.reach_m() <= heard.max_reach_m(&bounds, ahead_s) + 0.01, "{seed}");
        let reported_path_reach = reported_path_reach(&position, &points, joint);
        let remembered = NeighbourMotion { reported_path_reach, ..heard };
        assert!(other.reach_m() <= remembered.max_reach_m(&bounds, ahead_s) + 0.01, "{seed}");
        let from_line_m = least_sq(&ReachableSet::at(position), &set, f32::INFINITY).sqrt();
        assert!(
            own.box_distances(&position).norm() <= 1.0001 * from_line_m + 0.001,
            "{seed}: {set:?}"
        );
        let apart_m = uniform(rng, 0.5, 3.0);
        let conflicts = own.conflicts(&other, &position, apart_m);
        assert_eq!(
            conflicts,
            conflict(&set, &other, &position, apart_m),
            "{seed}: {set:?}, {other:?}, {apart_m} m"
        );
        let most_m = apart_m + other.widened_by_m + set.widened_by_m;
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

/// Places 1 cm apart on points, and how far along them they are.
fn places(points: &[Point]) -> StdVec<(f32, Point)> {
    let mut places: StdVec<(f32, Point)> = points.first().map(|p| (0.0, *p)).into_iter().collect();
    for leg in points.windows(2) {
        let (along_m, leg_m) = (places[places.len() - 1].0, (leg[1] - leg[0]).norm());
        let steps = (leg_m / 0.01) as usize + 1;
        let share = |i: usize| i as f32 / steps as f32;
        places.extend(
            (1..=steps)
                .map(|i| (along_m + leg_m * share(i), leg[0] + (leg[1] - leg[0]) * share(i))),
        );
    }
    places
}

#[test]
fn the_nearest_place_is_among_the_remembered_ones() {
    let (mut on, mut back) = (0, 0);
    for seed in 0..20_000 {
        let rng = &mut Pcg32::seed_from_u64(seed);
        let position = near(rng, 100.0);
        let from = position + near(rng, 1.0);
        let points = way(rng, from, 8);
        let joint = PlaceOnPoints::find(&position, &points, &Point::zeros());
        let places = places(&points);
        let away_m = |p: &Point| (position - p).norm();
        let least_m = places.iter().map(|(_, p)| away_m(p)).fold(f32::INFINITY, f32::min);
        let Some((first, ahead)) = joint.ahead(&position, &points) else {
            assert!(points.is_empty() || least_m > OFF_REPORTED_PATH_M - 0.02, "{seed}: {least_m}");
            continue;
        };
        assert!(away_m(&first) < OFF_REPORTED_PATH_M && ahead.len() < points.len(), "{seed}");
        let on_m = |p: &Point| (first - p).norm();
        let at_m = places.iter().filter(|(_, p)| on_m(p) < 0.02).map(|(at_m, _)| *at_m);
        let at_m = at_m.fold(f32::INFINITY, f32::min);
        let remembered = at_m - 0.05..at_m + joint.place_uncertainty_m() + 0.05;
        let within = places.iter().filter(|(at_m, _)| remembered.contains(at_m));
        let within_m = within.map(|(_, p)| away_m(p)).fold(f32::INFINITY, f32::min);
        assert!(within_m < least_m + 0.06, "{seed}: {within_m} instead of {least_m}, {joint:?}");
        (on, back) = (on + 1, back + u32::from(joint.place_uncertainty_m() > 0.0));
    }
    std::println!("{on} on their points, {back} on some that come back");
    assert!(on > 2000 && back > 200, "{on} {back}");
}

/// Points may lead past a vehicle again, or straight back: wherever on them the vehicle truly is,
/// it stays in its set.
#[test]
fn a_vehicle_stays_in_its_set_where_points_lead_back() {
    let bounds =
        MotionBounds { braking: BRAKING, speed_max_mps: 5.0, stopped_when_unheard_for_s: 3.0 };
    let mut back = 0;
    for seed in 0..if cfg!(debug_assertions) { 500 } else { 20_000 } {
        let rng = &mut Pcg32::seed_from_u64(seed);
        let mut points = way(rng, Point::zeros(), 8);
        if rng.next_u32().is_multiple_of(2) {
            // The points lead back the same way, along one leg or all.
            let corner = points.len().saturating_sub(1);
            let from = if rng.next_u32().is_multiple_of(2) { 0 } else { corner.saturating_sub(1) };
            let mut again: StdVec<Point> = points[from.min(corner)..corner.max(from)].to_vec();
            again.reverse();
            points.extend(again);
            points.truncate(8);
        }
        if points.len() < 2 {
            continue;
        }
        let (places, stray_m) = (places(&points), uniform(rng, 0.0, 0.3));
        // The vehicle flies a short distance between its message and now, at any low speed.
        let (truly_m, truly) = places[rng.next_u32() as usize % places.len()];
        let position = truly + near(rng, stray_m / 2.0);
        let speed_mps = uniform(rng, 0.0, 2.0);
        let heard = NeighbourMotion {
            velocity: Point::new(speed_mps, 0.0, 0.0),
            speed_mps,
            age_s: uniform(rng, 0.0, 0.9),
            rests_within_m: 0.0,
            grounded: false,
            column_bottom_z_m: None,
            ..heard(rng, position, &points)
        };
        let set = heard.reachable_set(&bounds, 0.0);
        let flown_m = speed_mps * heard.age_s + BRAKING.stop_distance_m(speed_mps);
        let may_be = |at_m: f32| at_m >= truly_m && at_m <= truly_m + flown_m;
        for (_, place) in places.iter().filter(|(at_m, _)| may_be(*at_m)).step_by(7) {
            let away_m = least_sq(&ReachableSet::at(*place), &set, f32::INFINITY).sqrt();
            assert!(away_m < 2.0 * stray_m + 0.1, "{seed}: {away_m} m from its set, {stray_m}");
        }
        let joint = PlaceOnPoints::find(&position, &points, &heard.velocity);
        back += u32::from(joint.place_uncertainty_m() > 0.0);
    }
    std::println!("{back} of points that come back");
    assert!(back > 100, "{back}");
}
