use proptest::prelude::*;

use super::*;
use crate::flight::path::tests::corner_path;

#[test]
fn a_stop_that_is_advised_too_late_is_as_long_as_flown() {
    let mut path = Path::<2>::new();
    path.push(Point::zeros(), 10.0).unwrap();
    path.push(Point::new(200.0, 0.0, 0.0), 10.0).unwrap();
    let cfg = TrackConfig { cruise_mps: 15.0, ..TrackConfig::default() };
    let mut state = ReferenceState::default();
    while state.along_m < 80.0 {
        advance(&cfg, &path, &mut state, &Advice::FREE, 0.02).unwrap();
    }
    let (from_m, brakes_m) = (state.along_m, braking_distance_m(&cfg, &path, &state));
    let stop = Advice { speed_scale: 0.0, stop_within_m: 0.0, waiting_for_id: 2 };
    while state.speed_mps > 0.0 {
        advance(&cfg, &path, &mut state, &stop, 0.02).unwrap();
    }
    let flown_m = state.along_m - from_m;
    assert!(flown_m > 10.0 && (brakes_m - flown_m).abs() < 0.3, "{brakes_m} {flown_m}");
    let mut place = Path::<2>::new();
    place.push(Point::zeros(), 10.0).unwrap();
    let moving = ReferenceState { along_m: 0.0, speed_mps: 2.0 };
    assert_eq!(braking_distance_m(&cfg, &place, &moving), 0.0, "a path of one place has no way");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Legs that climb brake with less than level ones where the vertical acceleration is lower.
    #[test]
    fn on_slopes_a_stop_is_as_long_as_flown(
        steps in proptest::collection::vec((0.5_f32..12.0, -8.0_f32..8.0), 2..12),
        (accel, accel_z) in (0.3_f32..3.0, 0.3_f32..3.0),
        (cruise_mps, stop_share) in (0.5_f32..12.0, 0.0_f32..1.0),
    ) {
        let mut path = Path::<16>::new();
        let mut at = Point::zeros();
        path.push(at, 10.0).unwrap();
        for (forward, up) in steps {
            at += Point::new(forward, 0.0, up);
            path.push(at, 10.0).unwrap();
        }
        let cfg = TrackConfig {
            cruise_mps,
            climb_mps: cruise_mps,
            descend_mps: cruise_mps,
            accel_mps2: accel,
            accel_z_mps2: accel_z,
            deviation_max_m: 10.0,
            ..TrackConfig::default()
        };
        let mut state = ReferenceState::default();
        let stop_at_m = stop_share * path.length_m();
        for _ in 0..20_000 {
            if state.along_m >= stop_at_m {
                break;
            }
            advance(&cfg, &path, &mut state, &Advice::FREE, 0.01).unwrap();
        }
        let (from, brakes_m) = (state, braking_distance_m(&cfg, &path, &state));
        let stop = Advice { speed_scale: 0.0, stop_within_m: 0.0, waiting_for_id: 2 };
        while state.speed_mps > 0.0 {
            advance(&cfg, &path, &mut state, &stop, 0.001).unwrap();
        }
        let flown_m = state.along_m - from.along_m;
        let stepped_m = 0.02 + 0.02 * brakes_m;
        prop_assert!(flown_m < brakes_m + stepped_m, "{brakes_m} {flown_m} {from:?}");
        let legs = |m: f32| path.waypoints().iter().filter(|w| w.along_m <= m).count();
        if legs(from.along_m + brakes_m) - legs(from.along_m) < BRAKING_LEGS {
            let most_m = flown_m + 0.05 + 0.12 * brakes_m;
            prop_assert!(brakes_m < most_m, "{brakes_m} {flown_m} {from:?}");
        }
    }
}

#[test]
fn a_vehicle_that_follows_arrives_and_slows_in_the_corner() {
    let (cfg, path) = (TrackConfig::default(), corner_path(0.8));
    let mut state = ReferenceState::default();
    let (mut at_corner, mut fastest, mut steps) = (f32::INFINITY, 0.0_f32, 0);
    let vehicle = loop {
        let reference = advance(&cfg, &path, &mut state, &Advice::FREE, 0.05).unwrap();
        fastest = fastest.max(state.speed_mps);
        if (state.along_m - 6.0).abs() < 0.1 {
            at_corner = at_corner.min(state.speed_mps);
        }
        steps += 1;
        if reference.finished || steps > 1000 {
            break reference.position;
        }
    };
    assert_eq!(vehicle, Point::new(6.0, 6.0, 1.0));
    assert!(fastest > 1.9 && at_corner < 0.75, "fastest {fastest}, corner {at_corner}");
}

#[test]
fn stops_before_the_distance_advised_and_goes_on_when_freed() {
    let (cfg, path) = (TrackConfig::default(), corner_path(0.8));
    let mut state = ReferenceState::default();
    for _ in 0..400 {
        let advice = Advice { stop_within_m: 4.0 - state.along_m, ..Advice::FREE };
        advance(&cfg, &path, &mut state, &advice, 0.05).unwrap();
        assert!(state.along_m <= 4.0 + 1e-4, "{}", state.along_m);
    }
    assert!(state.along_m > 3.9, "{}", state.along_m);
}

#[test]
fn speed_changes_by_no_more_than_each_axis_allows() {
    let cfg = TrackConfig {
        accel_z_mps2: 1.0,
        climb_mps: 1.0,
        descend_mps: 0.7,
        ..TrackConfig::default()
    };
    let mut path = Path::<8>::new();
    for (x, z) in [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (6.0, 1.0), (9.0, 1.2)] {
        path.push(Point::new(x, 0.0, z), 0.8).unwrap();
    }
    let mut state = ReferenceState::default();
    let (mut last, mut steps) = (Point::zeros(), 0);
    loop {
        let before = state;
        let reference = advance(&cfg, &path, &mut state, &Advice::FREE, 0.05).unwrap();
        let leg = path.waypoints().iter().filter(|w| w.along_m <= before.along_m).count();
        let same = path.waypoints().iter().filter(|w| w.along_m <= state.along_m).count() == leg;
        let velocity = (reference.position - last) / 0.05;
        let change = (state.speed_mps - before.speed_mps).abs() / 0.05;
        let whole = path
            .waypoints()
            .iter()
            .all(|w| w.along_m <= state.along_m || w.along_m > state.along_m + 0.02);
        if same && whole && !reference.finished {
            assert!((-0.71..1.01).contains(&velocity.z), "{velocity:?}");
            let ahead = path.point_at(state.along_m + 1e-2).unwrap() - reference.position;
            let up = (ahead.z / 1e-2).abs().min(1.0);
            assert!(
                change * up < 1.0 + 0.02 && change * (1.0 - up * up).sqrt() < 1.52,
                "{state:?}"
            );
        }
        (last, steps) = (reference.position, steps + 1);
        if reference.finished || steps > 1000 {
            break;
        }
    }
    assert!(steps < 400, "{steps}");
}
