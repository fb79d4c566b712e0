use super::*;

pub(crate) fn corner_path(clearance_m: f32) -> Path<8> {
    let mut path = Path::new();
    for (x, y) in [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0)] {
        path.push(Point::new(x, y, 1.0), clearance_m).unwrap();
    }
    path
}

#[test]
fn a_walk_along_the_path_sees_what_single_looks_see() {
    let path = corner_path(0.8);
    for (from_m, step_m) in
        [(0.0, 0.5), (-1.0, 0.7), (5.9, 0.1), (6.0, 3.0), (11.0, 0.4), (20.0, 1.0)]
    {
        for (k, point) in path.points_from(from_m, step_m).take(20).enumerate() {
            assert_eq!(
                Some(point),
                path.point_at(from_m + k as f32 * step_m),
                "{from_m} {step_m} {k}"
            );
        }
    }
    assert_eq!(Path::<4>::new().points_from(0.0, 1.0).next(), None);
    assert_eq!(Path::<4>::new().point_at(0.0), None);
}

#[test]
fn projection_stays_on_the_stretch_at_hand() {
    let mut path = Path::<8>::new();
    for (x, y) in [(0.0, 0.0), (5.0, 0.0), (5.0, 0.5), (0.0, 0.5)] {
        path.push(Point::new(x, y, 1.0), 1.0).unwrap();
    }
    let along = path.project(&Point::new(2.0, 0.4, 1.0), 1.5, 2.0);
    assert!((along - 2.0).abs() < 1e-4, "{along}");
}

#[test]
fn refuses_nan_and_overflow_by_name() {
    let mut path = Path::<1>::new();
    assert_eq!(path.push(Point::new(f32::NAN, 0.0, 0.0), 1.0), Err(PathError::NotFinite));
    path.push(Point::zeros(), 1.0).unwrap();
    assert_eq!(path.push(Point::new(1.0, 0.0, 0.0), 1.0), Err(PathError::PathFull));
}

#[test]
fn times_are_those_of_the_schedule_with_holds() {
    let mut path = corner_path(1.0);
    path.set_times_at_speed(2.0, 0.5);
    let end = path.length_m();
    assert_eq!((path.scheduled_s(-1.0), path.scheduled_s(0.0)), (0.0, 2.0));
    assert!((path.scheduled_s(0.5) - 3.0).abs() < 1e-5);
    let arrives_s = path.scheduled_s(end);
    path.set_last_waypoint_times(arrives_s, arrives_s + 7.0);
    assert_eq!(path.scheduled_s(end), arrives_s + 7.0, "the hold counts");
    assert!(path.scheduled_s(end - 0.01) < arrives_s);
    assert_eq!(path.scheduled_s(end + 5.0), arrives_s + 7.0);
    assert_eq!(Path::<2>::new().scheduled_s(1.0), 0.0);
}
