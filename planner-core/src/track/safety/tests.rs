mod plain;

extern crate std;

use proptest::prelude::*;
use std::vec;
use std::vec::Vec as StdVec;

use self::plain::reported_path_reach;
use super::*;

const BRAKING: Braking = Braking { accel_mps2: 1.5, jerk_mps3: 8.0 };
const BOUNDS: MotionBounds =
    MotionBounds { braking: BRAKING, speed_max_mps: 2.0, stopped_when_unheard_for_s: 3.0 };
/// Safety distance, metres.
const APART_M: f32 = 1.5;

fn point() -> impl Strategy<Value = Point> {
    (-6.0_f32..6.0, -6.0_f32..6.0, 0.0_f32..6.0).prop_map(|(x, y, z)| Point::new(x, y, z))
}

fn points(most: usize) -> impl Strategy<Value = StdVec<Point>> {
    proptest::collection::vec(point(), 1..most)
}

/// Places of a set, 2 cm apart.
fn places(set: &ReachableSet) -> StdVec<Point> {
    let mut places = StdVec::new();
    for (a, b) in set.segments() {
        let steps = ((b - a).norm() / 0.02) as usize + 1;
        places.extend((0..=steps).map(|i| a + (b - a) * (i as f32 / steps as f32)));
    }
    places
}

fn least(from: &[Point], to: &[Point]) -> f32 {
    from.iter().flat_map(|a| to.iter().map(move |b| (a - b).norm())).fold(f32::INFINITY, f32::min)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 60 } else { 600 }))]

    #[test]
    fn sets_conflict_where_their_places_do(
        own in points(5),
        other in points(5),
        length_m in 0.0_f32..6.0,
        grow_m in 0.0_f32..2.0,
        floor in -3.0_f32..6.0,
    ) {
        let own = ReachableSet::along(own[0], own[1..].iter().copied(), length_m);
        let mut other = ReachableSet {
            widened_by_m: grow_m,
            ..ReachableSet::along(other[0], other[1..].iter().copied(), length_m)
        };
        other.add_column((floor > 0.0).then_some(floor));
        let (here, there) = (places(&own), places(&other));
        let motion_m = least(&here, &there) - grow_m;
        let now_m = least(&here[..1], &there) - grow_m;
        let place = there[0];
        let conflict = OwnSet::new(&own, &mut Legs::new()).conflicts(&other, &place, APART_M);
        if motion_m > APART_M + 0.05 {
            prop_assert!(!conflict, "{motion_m} apart");
        } else if motion_m < APART_M - 0.05 && motion_m < now_m - 0.05 {
            prop_assert!(conflict, "{motion_m} apart, {now_m} now");
        }
        let nearer_m = least(&here, &[place]);
        if conflict {
            let towards = nearer_m < (own.points[0] - place).norm();
            prop_assert!(
                motion_m < now_m || towards,
                "a motion that takes nobody nearer is allowed"
            );
        }
    }

    #[test]
    fn a_vehicle_that_holds_to_its_limits_stays_inside_its_set(
        path in points(8),
        speed_mps in 0.0_f32..2.0,
        age_s in 0.0_f32..0.99,
        goes_on_s in 0.0_f32..0.1,
    ) {
        prop_assume!(path.len() > 1);
        let heard = NeighbourMotion {
            position: path[0],
            velocity: (path[1] - path[0]).normalize() * speed_mps,
            speed_mps,
            age_s,
            delay_s: 0.0,
            reported_points: &path,
            place_on_points: PlaceOnPoints::Unknown,
            reported_path_reach: reported_path_reach(&path[0], &path, PlaceOnPoints::Unknown),
            rests_within_m: 0.0,
            grounded: false,
            column_bottom_z_m: None,
        };
        let there = places(&heard.reachable_set(&BOUNDS, 0.0));
        // The vehicle flew on, and stops after the reaction time.
        let flown_m = speed_mps * (age_s + goes_on_s) + BRAKING.stop_distance_m(speed_mps);
        let set = ReachableSet::along(path[0], path.iter().copied(), flown_m);
        for place in places(&set) {
            prop_assert!(least(&[place], &there) < 0.03);
            let reach_m = heard.max_reach_m(&BOUNDS, 0.0);
            prop_assert!((place - path[0]).norm() <= reach_m + 0.01);
        }
    }

    #[test]
    fn no_set_reaches_further_than_its_bound(
        path in points(8),
        east in -1.0_f32..1.0,
        north in -1.0_f32..1.0,
        by_m in 0.0_f32..14.0,
        speed_mps in 0.0_f32..15.0,
        age_s in 0.0_f32..2.0,
        ahead_s in 0.0_f32..4.0,
    ) {
        let way = Point::new(east, north, 0.2).normalize();
        let position = path[0] + way * by_m;
        let heard = NeighbourMotion {
            position,
            velocity: way * speed_mps,
            speed_mps,
            age_s,
            delay_s: 0.2,
            reported_points: &path,
            place_on_points: PlaceOnPoints::Unknown,
            reported_path_reach: reported_path_reach(&position, &path, PlaceOnPoints::Unknown),
            rests_within_m: 0.0,
            grounded: false,
            column_bottom_z_m: None,
        };
        let set = heard.reachable_set(&BOUNDS, ahead_s);
        prop_assert!(set.reach_m() <= heard.max_reach_m(&BOUNDS, ahead_s) + 0.01);
        let joint = PlaceOnPoints::find(&position, &path, &heard.velocity);
        let reported_path_reach = reported_path_reach(&position, &path, joint);
        let heard = NeighbourMotion { place_on_points: joint, reported_path_reach, ..heard };
        prop_assert!(set.reach_m() <= heard.max_reach_m(&BOUNDS, ahead_s) + 0.01);
    }
}

/// The reported points begin at the setpoint, which leads the vehicle by up to 11 m at 15 m/s. They
/// may turn by any angle, also back past the vehicle.
#[test]
fn a_fast_vehicle_behind_its_setpoint_stays_inside_its_set_around_a_corner() {
    let bounds = MotionBounds { speed_max_mps: 15.0, ..BOUNDS };
    for case in 0..15 * 40 * 7 {
        let speed_mps = 1.0 + (case % 15) as f32;
        let leads_m = 0.6 + 0.8 * (speed_mps - 2.0).max(0.0);
        let corner_m = leads_m + 0.1 + (case / 15 % 40) as f32;
        let (north, east) = (0.5 * (case / 600) as f32).sin_cos();
        let place = |along_m: f32| {
            let beyond_m = (along_m - corner_m).max(0.0);
            Point::new(along_m.min(corner_m) + east * beyond_m, north * beyond_m, 0.0)
        };
        let points = [leads_m, corner_m, 300.0].map(place);
        let heard = NeighbourMotion {
            position: Point::zeros(),
            velocity: Point::new(speed_mps, 0.0, 0.0),
            speed_mps,
            age_s: 0.1,
            delay_s: 0.0,
            reported_points: &points,
            place_on_points: PlaceOnPoints::Unknown,
            reported_path_reach: reported_path_reach(
                &Point::zeros(),
                &points,
                PlaceOnPoints::Unknown,
            ),
            rests_within_m: 0.0,
            grounded: false,
            column_bottom_z_m: None,
        };
        let set = heard.reachable_set(&bounds, 0.0);
        let flown_m = 0.1 * speed_mps + BRAKING.stop_distance_m(speed_mps);
        let away_m = least(&[place(flown_m)], &places(&set));
        assert!(away_m < 0.1, "{away_m} m outside at {speed_mps} m/s, corner at {corner_m} m");
        let joint = PlaceOnPoints::find(&heard.position, &points, &heard.velocity);
        let reported_path_reach = reported_path_reach(&heard.position, &points, joint);
        let reach_m = NeighbourMotion { reported_path_reach, ..heard }.max_reach_m(&bounds, 0.0);
        assert!(set.reach_m() <= reach_m + 0.01, "{} of {reach_m} m", set.reach_m());
        // The vehicle flies on beyond the last point that was heard.
        let beyond = NeighbourMotion { reported_points: &[place(-1.5)], ..heard };
        let there = places(&beyond.reachable_set(&bounds, 0.0));
        assert!(least(&[Point::new(flown_m, 0.0, 0.0)], &there) < 0.1);
    }
}

/// A vehicle that flies along a polyline and stops where its reachable set conflicts.
struct Flier {
    /// Points of the polyline, ENU metres.
    path: StdVec<Point>,
    /// Arc length of the vehicle, metres.
    along_m: f32,
    speed_mps: f32,
    /// What the other vehicle heard last: place, velocity, time, and index of the path point that
    /// begins the current leg.
    reported: (Point, Point, f32, usize),
}

impl Flier {
    fn new(path: StdVec<Point>) -> Self {
        let reported = (path[0], Point::zeros(), 0.0, 0);
        Self { path, along_m: 0.0, speed_mps: 0.0, reported }
    }

    fn at(&self, along_m: f32) -> (Point, usize, Point) {
        let mut left_m = along_m;
        for (i, leg) in self.path.windows(2).enumerate() {
            let leg_m = (leg[1] - leg[0]).norm();
            if left_m <= leg_m {
                let way = (leg[1] - leg[0]) / leg_m;
                return (leg[0] + way * left_m, i + 1, way);
            }
            left_m -= leg_m;
        }
        (*self.path.last().unwrap(), self.path.len(), Point::zeros())
    }

    fn set(&self) -> ReachableSet {
        let (place, next, _) = self.at(self.along_m);
        let length_m = self.speed_mps * REACTION_S + BRAKING.stop_distance_m(self.speed_mps) + 0.1;
        let ahead =
            core::iter::once(place).chain(self.path[next.min(self.path.len())..].iter().copied());
        ReachableSet::along(place, ahead, length_m)
    }

    fn step(&mut self, accel_mps2: f32, dt_s: f32) {
        self.speed_mps = (self.speed_mps + accel_mps2 * dt_s).clamp(0.0, 2.0);
        self.along_m += self.speed_mps * dt_s;
        if self.at(self.along_m).1 == self.path.len() {
            self.speed_mps = 0.0;
        }
    }
}

#[test]
fn two_that_stop_where_their_sets_conflict_never_come_near() {
    let mut rng = proptest::test_runner::TestRng::deterministic_rng(
        proptest::test_runner::RngAlgorithm::ChaCha,
    );
    let mut draw =
        |low: f32, high: f32| low + (high - low) * (rng.next_u32() as f32 / u32::MAX as f32);
    let (mut nearest_m, mut stops, mut arrived) = (f32::INFINITY, 0, 0);
    for case in 0..if cfg!(debug_assertions) { 300 } else { 20_000 } {
        let mut fliers: StdVec<Flier> = (0..2)
            .map(|_| {
                let vertical = draw(0.0, 1.0) < 0.3;
                let mut path = vec![Point::new(draw(-5.0, 5.0), draw(-5.0, 5.0), draw(0.0, 6.0))];
                for _ in 0..3 {
                    let last = path[path.len() - 1];
                    let next = Point::new(draw(-5.0, 5.0), draw(-5.0, 5.0), draw(0.0, 6.0));
                    path.push(if vertical { Point::new(last.x, last.y, next.z) } else { next });
                }
                Flier::new(path)
            })
            .collect();
        if (fliers[0].path[0] - fliers[1].path[0]).norm() < 2.0 {
            continue;
        }
        let loss = draw(0.0, 0.4);
        for tick in 0..600 {
            let now_s = tick as f32 * 0.05;
            for flier in &mut fliers {
                if tick % 4 == 0 && (draw(0.0, 1.0) > loss || now_s - flier.reported.2 > 0.7) {
                    let (place, next, way) = flier.at(flier.along_m);
                    let from = next.saturating_sub(1).min(flier.path.len() - 1);
                    flier.reported = (place, way * flier.speed_mps, now_s, from);
                }
            }
            let stop = [0, 1].map(|i| {
                let other = &fliers[1 - i];
                let (position, velocity, at_s, from) = other.reported;
                let heard = NeighbourMotion {
                    position,
                    velocity,
                    speed_mps: velocity.norm(),
                    age_s: now_s - at_s,
                    delay_s: 0.0,
                    reported_points: &other.path[from..],
                    place_on_points: PlaceOnPoints::Unknown,
                    reported_path_reach: ReportedPathReach::UNBOUNDED,
                    rests_within_m: 0.0,
                    grounded: false,
                    column_bottom_z_m: None,
                };
                OwnSet::new(&fliers[i].set(), &mut Legs::new()).conflicts(
                    &heard.reachable_set(&BOUNDS, 0.0),
                    &position,
                    APART_M,
                )
            });
            for (flier, stop) in fliers.iter_mut().zip(stop) {
                flier.step(if stop { -1.5 } else { 1.5 }, 0.05);
                stops += u32::from(stop);
            }
            let apart_m =
                (fliers[0].at(fliers[0].along_m).0 - fliers[1].at(fliers[1].along_m).0).norm();
            assert!(apart_m > APART_M - 0.1, "case {case}, {now_s} s: {apart_m} m");
            nearest_m = nearest_m.min(apart_m);
        }
        arrived += fliers.iter().filter(|f| f.at(f.along_m).1 == f.path.len()).count();
    }
    std::println!("nearest {nearest_m} m, {stops} steps of a stop, {arrived} arrived");
    assert!(stops > 100 && arrived > 100, "{stops} {arrived}");
}
