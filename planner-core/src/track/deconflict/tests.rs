use super::*;
use proptest::prelude::*;

proptest! {
    /// Compared with the distances at each millisecond, at closing speeds up to 40 m/s.
    #[test]
    fn no_contact_on_a_straight_course_is_missed(
        cruise_mps in 0.5f32..15.0,
        meet_s in 0.0f32..4.0,
        off in proptest::array::uniform3(-1.5f32..1.5),
        velocity in proptest::array::uniform3(-15.0f32..15.0),
        age_s in 0.0f32..1.0,
    ) {
        let mut path = Path::<4>::new();
        path.push(Point::zeros(), 1.0).unwrap();
        path.push(Point::new(100.0, 0.0, 0.0), 1.0).unwrap();
        let cfg = DeconflictConfig { cruise_mps, ..cfg(Method::Priority) };
        let velocity = Point::from(velocity);
        let meet = Point::new(cruise_mps * meet_s, 0.0, 0.0) + Point::from(off);
        let n = Neighbour {
            velocity,
            age_s,
            ..neighbour(1, 0, meet - velocity * (age_s + meet_s))
        };
        let own = own(&path);
        let distance = |ms: u32| {
            let after_s = ms as f32 * 1e-3;
            (n.position + n.velocity * (age_s + after_s)
                - Point::new(cruise_mps * after_s, 0.0, 0.0))
            .norm()
        };
        prop_assume!(distance(0) > cfg.safety_distance_m);
        let contact = (0..4000).find(|&ms| distance(ms) < cfg.safety_distance_m - 0.01);
        let apart_m = stop_separation_m(&cfg, cruise_mps);
        let found = PathSamples::new(&cfg, &own).distance_to_conflict_m(apart_m, &own, &n);
        if let Some(ms) = contact {
            let within_m = found.expect("a contact is found");
            prop_assert!(within_m <= cruise_mps * ms as f32 * 1e-3 + 1e-3);
        }
    }
}

fn cfg(method: Method) -> DeconflictConfig {
    DeconflictConfig { method, safety_distance_m: 1.5, cruise_mps: 2.0, accel_mps2: 1.5 }
}

fn neighbour(id: u8, rank: u16, position: Point) -> Neighbour {
    Neighbour {
        id,
        rank,
        position,
        velocity: Point::zeros(),
        age_s: 0.0,
        progress_m: None,
        grounded: false,
        out_of_plan: false,
        on_detour: false,
    }
}

fn straight() -> Path<4> {
    let mut path = Path::new();
    path.push(Point::zeros(), 1.0).unwrap();
    path.push(Point::new(20.0, 0.0, 0.0), 1.0).unwrap();
    path
}

fn own(path: &Path<4>) -> OwnVehicle<'_, 4> {
    OwnVehicle { rank: 1, position: Point::zeros(), along_m: 0.0, path, on_detour: false }
}

#[test]
fn algorithm2_divides_by_the_highest_ranked_vehicle_in_range() {
    let path = straight();
    let near = [
        neighbour(1, 0, Point::new(0.5, 0.0, 0.0)),
        neighbour(3, 2, Point::new(1.0, 0.0, 0.0)),
        neighbour(4, 3, Point::new(0.0, 1.0, 0.0)),
        neighbour(5, 4, Point::new(0.0, 1.5, 0.0)),
    ];
    let advice = advise(&cfg(Method::Algorithm2), &own(&path), &[], &near);
    assert_eq!((advice.speed_scale, advice.waiting_for_id), (1.0 / 6.0, 4));
    let advice = advise(&cfg(Method::Algorithm2), &own(&path), &[], &near[..1]);
    assert_eq!(advice, Advice::FREE, "a lower id has no priority");
}

/// Past a vehicle that hovers beside the path, where a stop from cruise speed would end too
/// near, the speed is at most [`MAX_PASSING_MPS`]; before a vehicle on the path, or one that moves,
/// the own vehicle stops.
#[test]
fn priority_passes_one_that_hovers_slowly_and_stops_before_others() {
    let mut path = Path::<4>::new();
    path.push(Point::zeros(), 1.0).unwrap();
    path.push(Point::new(200.0, 0.0, 0.0), 1.0).unwrap();
    let cfg = DeconflictConfig { cruise_mps: 13.0, ..cfg(Method::Priority) };
    let at = |along_m: f32, beside_m: f32, velocity_mps: f32| {
        let own = OwnVehicle {
            along_m,
            position: Point::new(along_m, 0.0, 0.0),
            on_detour: true,
            ..own(&path)
        };
        let other = Neighbour {
            velocity: Point::new(0.0, velocity_mps, 0.0),
            ..neighbour(2, 0, Point::new(40.0, beside_m, 0.0))
        };
        let advice = advise(&cfg, &own, &[], &[other]);
        (advice.waiting_for_id, advice.speed_scale * cfg.cruise_mps)
    };
    // Room for a stop from cruise speed, from the passing speed, and for neither.
    for along_m in [0.0, 20.0, 35.0, 40.0] {
        assert_eq!(at(along_m, 3.6, 0.0), (0, 13.0));
        assert_eq!(at(along_m, 2.0, 0.0).0, 0);
        assert_eq!(at(along_m.min(35.0), 1.8, 0.0).0, 2);
        assert_eq!(at(along_m.min(35.0), 2.0, -1.5).0, 2);
    }
    let near = |mps: f32| (MAX_PASSING_MPS..MAX_PASSING_MPS + 0.01).contains(&mps);
    assert!(near(at(38.0, 2.0, 0.0).1), "{:?}", at(38.0, 2.0, 0.0));
    let before = at(20.0, 2.0, 0.0).1;
    assert!(before > MAX_PASSING_MPS && before < 13.0, "{before}");
    assert_eq!(at(45.0, 2.0, 0.0), (0, 13.0), "it is behind");
}

#[test]
fn priority_stops_at_the_first_gate_that_is_not_passed() {
    let path = straight();
    let gates = [
        Gate { at_m: 1.0, wait_for_id: 2, open_from_progress_m: 5.0 },
        Gate { at_m: 2.0, wait_for_id: 2, open_from_progress_m: 9.0 },
        Gate { at_m: 2.5, wait_for_id: 7, open_from_progress_m: 1.0 },
        Gate { at_m: 9.0, wait_for_id: 8, open_from_progress_m: 1.0 },
    ];
    let mut heard = [neighbour(2, 0, Point::new(9.0, 9.0, 9.0))];
    heard[0].progress_m = Some(5.5);
    let advice = advise(&cfg(Method::Priority), &own(&path), &gates, &heard);
    assert_eq!((advice.stop_within_m, advice.waiting_for_id), (2.0, 2));
    heard[0].progress_m = Some(9.0);
    let advice = advise(&cfg(Method::Priority), &own(&path), &gates, &heard);
    assert_eq!(
        (advice.stop_within_m, advice.waiting_for_id),
        (2.5, 7),
        "an unheard vehicle has not passed"
    );
    heard[0] = Neighbour {
        out_of_plan: true,
        grounded: true,
        ..neighbour(7, 1, Point::new(9.0, 9.0, 0.0))
    };
    let advice = advise(&cfg(Method::Priority), &own(&path), &gates[2..], &heard);
    assert_eq!(advice, Advice::FREE, "a vehicle out of the plan will never pass");
}

#[test]
fn priority_stops_before_a_vehicle_without_a_plan() {
    let path = straight();
    let ahead = [neighbour(9, 5, Point::new(5.0, 0.2, 0.0))];
    let advice = advise(&cfg(Method::Priority), &own(&path), &[], &ahead);
    assert_eq!(advice.waiting_for_id, 9);
    assert!(advice.stop_within_m <= 3.5 && advice.stop_within_m > 2.5, "{}", advice.stop_within_m);
    let behind = [neighbour(9, 5, Point::new(-1.0, 0.0, 0.0))];
    assert_eq!(advise(&cfg(Method::Priority), &own(&path), &[], &behind), Advice::FREE);
}

/// The gate is 10 m on, 5 s by the schedule after take-off, 8 s with the start. A neighbour that
/// has 26 m to fly at 2 m/s opens it 5 s later.
#[test]
fn a_neighbour_is_late_where_the_own_vehicle_would_wait_for_it() {
    let mut path = Path::<4>::new();
    path.push(Point::zeros(), 1.0).unwrap();
    path.push(Point::new(20.0, 0.0, 0.0), 1.0).unwrap();
    path.set_times_at_speed(0.0, 2.0);
    let gates = [Gate { at_m: 10.0, wait_for_id: 7, open_from_progress_m: 30.0 }];
    let cfg = cfg(Method::Priority);
    let comes = |progress_m: f32| Neighbour {
        progress_m: Some(progress_m),
        ..neighbour(7, 1, Point::new(50.0, 0.0, 0.0))
    };
    let with =
        |n: Neighbour, other: Neighbour| has_late_neighbour(&cfg, 2.0, &path, &gates, &[other, n]);
    let other = Neighbour { progress_m: Some(3.0), ..neighbour(3, 0, Point::zeros()) };
    let late = |n: Neighbour| with(n, other);
    assert!(late(comes(0.0)) && late(comes(3.9)));
    assert!(!late(comes(4.1)) && !late(comes(30.0)));
    assert!(!has_late_neighbour(&cfg, 2.0, &path, &gates, &[]));
    // One that does not fly the plan, or is not heard, may be what the late one waits for.
    for change in [
        |n| Neighbour { progress_m: None, ..n },
        |n| Neighbour { out_of_plan: true, ..n },
        |n| Neighbour { on_detour: true, ..n },
        |n| Neighbour { age_s: 2.1, ..n },
    ] {
        assert!(!late(change(comes(0.0))) && !with(comes(0.0), change(other)));
    }
    let algorithm2 = DeconflictConfig { method: Method::Algorithm2, ..cfg };
    assert!(!has_late_neighbour(&algorithm2, 2.0, &path, &gates, &[comes(0.0)]));
}
