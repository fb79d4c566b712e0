use super::*;

#[test]
fn waypoints_are_loaded_one_by_one_and_the_last_ends_the_path() {
    let mut path = Path::<4>::new();
    for (x, y) in [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0)] {
        path.push(Point::new(x, y, 1.0), 1.0).unwrap();
    }
    let mut waypoints = Algorithm2Waypoints::default();
    let mut at = |x: f32, y: f32| {
        waypoints.update_current_waypoint(&path, &Point::new(x, y, 1.0)).map(|p| (p.x, p.y))
    };
    assert_eq!(at(-1.0, 0.0), Some((0.0, 0.0)));
    assert_eq!(at(-0.41, 0.0), Some((0.0, 0.0)), "outside Wp_radius");
    assert_eq!(at(-0.39, 0.0), Some((5.0, 0.0)));
    assert_eq!(at(5.0, 4.9), Some((5.0, 0.0)), "the last one does not count before its turn");
    assert_eq!(at(5.0, 0.2), Some((5.0, 5.0)));
    assert_eq!(at(5.0, 4.7), None);
    assert_eq!(at(0.0, 0.0), None, "completed for good");
    assert!(waypoints.is_completed());
    assert_eq!(
        Algorithm2Waypoints::default().update_current_waypoint(&Path::<4>::new(), &Point::zeros()),
        None
    );
}
