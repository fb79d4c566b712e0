//! Tests of obstacles: spheres reported by commands.

extern crate std;

use super::*;
use crate::link::commands::FENCE_EXCLUSION;

const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
const CLEARANCE_M: f32 = 0.8;

/// The command that reports a spherical obstacle.
pub(crate) fn sphere(at: Point, radius_m: f32) -> Command {
    let place = frames::enu_to_geodetic(&ORIGIN, &at);
    Command {
        command: FENCE_EXCLUSION,
        param1: radius_m,
        param2: 0.0,
        place: Some((
            (place.lat_deg * 1e7).round() as i32,
            (place.lon_deg * 1e7).round() as i32,
            place.alt_m as f32,
        )),
        from: (255, 190),
        to_our_system: true,
        to_our_component: true,
    }
}

fn take(obstacles: &mut Obstacles, command: &Command) -> u8 {
    obstacles.handle_command(command, &ORIGIN, CLEARANCE_M)
}

#[test]
fn a_sphere_of_a_command_is_an_obstacle_with_the_clearance_around_it() {
    let mut obstacles = Obstacles::default();
    let at = Point::new(14.0, 12.0, 1.5);
    assert_eq!(take(&mut obstacles, &sphere(at, 0.5)), ACCEPTED);
    assert_eq!(take(&mut obstacles, &sphere(at, 0.5)), ACCEPTED, "sent twice");
    let known = obstacles.all();
    assert_eq!(known.len(), 1);
    assert!((known[0].from - at).norm() < 0.05 && known[0].to == known[0].from, "{known:?}");
    assert!((known[0].radius_m - 1.3).abs() < 1e-6, "radius and required clearance: {known:?}");
}

#[test]
fn what_is_no_sphere_is_refused_and_one_too_many_is_for_later() {
    let mut obstacles = Obstacles::default();
    let at = |x: f32| Point::new(x, 30.0, 1.5);
    for radius_m in [f32::NAN, f32::INFINITY, 20.1, 1000.0] {
        assert_eq!(take(&mut obstacles, &sphere(at(0.0), radius_m)), DENIED, "{radius_m}");
    }
    let nowhere = Command { place: None, ..sphere(at(0.0), 1.0) };
    assert_eq!(take(&mut obstacles, &nowhere), DENIED, "COMMAND_LONG has no place");
    let no_earth = Command { place: Some((i32::MAX, 0, 700.0)), ..nowhere };
    assert_eq!(take(&mut obstacles, &no_earth), DENIED);
    for i in 0..MAX_OBSTACLES {
        assert_eq!(take(&mut obstacles, &sphere(at(i as f32), 0.5)), ACCEPTED);
    }
    assert_eq!(take(&mut obstacles, &sphere(at(99.0), 0.5)), TEMPORARILY_REJECTED);
}

proptest::proptest! {
    /// Whatever is reported and revoked, the obstacles that a detour was planned for stay the
    /// first.
    #[test]
    fn obstacles_are_those_reported_and_not_revoked(
        orders in proptest::collection::vec(
            (0u8..24, -1.0f32..25.0, proptest::prelude::any::<bool>()),
            0..200,
        ),
    ) {
        let mut obstacles = Obstacles::default();
        let mut model: std::vec::Vec<(u8, bool)> = std::vec::Vec::new();
        for (x, radius_m, plans) in orders {
            let result =
                take(&mut obstacles, &sphere(Point::new(f32::from(x), 30.0, 1.5), radius_m));
            let known = model.iter().any(|(at, _)| *at == x);
            // A larger obstacle at the same place is another entry; the model keeps one for each
            // place.
            if radius_m <= 0.0 {
                model.retain(|(at, _)| *at != x);
                proptest::prop_assert_eq!(result, ACCEPTED);
            } else if radius_m > MAX_OBSTACLE_RADIUS_M {
                proptest::prop_assert_eq!(result, DENIED);
            } else if result == ACCEPTED && !known {
                model.push((x, false));
            } else {
                let full = obstacles.count() == MAX_OBSTACLES;
                proptest::prop_assert!(known || (result == TEMPORARILY_REJECTED && full));
            }
            if plans {
                obstacles.mark_requested();
                obstacles.mark_requested_avoided();
                model.iter_mut().for_each(|(_, avoided)| *avoided = true);
            }
            proptest::prop_assert!(
                obstacles.avoided_count <= obstacles.count() && obstacles.count() <= MAX_OBSTACLES
            );
            let places: std::collections::BTreeSet<i32> =
                obstacles.known.iter().map(|o| libm::roundf(o.from.x) as i32).collect();
            let wanted: std::collections::BTreeSet<i32> =
                model.iter().map(|(x, _)| i32::from(*x)).collect();
            proptest::prop_assert_eq!(places, wanted);
            for (x, avoided) in &model {
                let new = obstacles.known[obstacles.avoided_count..]
                    .iter()
                    .any(|o| libm::roundf(o.from.x) as i32 == i32::from(*x));
                proptest::prop_assert!(*avoided || new, "{}", x);
            }
        }
    }
}
