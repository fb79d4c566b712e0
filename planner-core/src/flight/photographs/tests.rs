extern crate std;

use super::*;
use crate::Point;

fn path() -> Path<8> {
    let mut path = Path::new();
    for (x, y) in [(0.0, 0.0), (30.0, 0.0), (30.0, 10.0), (0.0, 10.0), (0.0, 20.0)] {
        path.push(Point::new(x, y, 30.0), 1.0).unwrap();
    }
    path
}

fn mark_three(photographs: &mut PicturePlan) {
    for (from, to, first, end) in [(0, 1, 7, 12), (2, 3, 30, 35), (4, 4, 40, 41)] {
        photographs.add_stretch(from, to, WaypointRange { first, end }).unwrap();
    }
}

#[test]
fn pictures_stand_at_both_ends_of_a_stretch_and_evenly_between() {
    let mut photographs = PicturePlan::new(9.0, HeadingMode::Ahead, Trigger::Distance);
    mark_three(&mut photographs);
    let path = path();
    let mut stretches = photographs.stretches(&path);
    let first = stretches.next().unwrap();
    assert_eq!(
        (first.from_m, first.to_m, first.ground_spacing_m, first.count),
        (0.0, 30.0, 7.5, 5)
    );
    let second = stretches.next().unwrap();
    assert_eq!((second.from_m, second.to_m, second.picture_arc_length_m(4)), (40.0, 70.0, 70.0));
    let third = stretches.next().unwrap();
    assert_eq!(
        (third.from_m, third.to_m, third.ground_spacing_m, third.count),
        (80.0, 80.0, 0.0, 1)
    );
    assert_eq!(stretches.next(), None);
    assert_eq!(photographs.planned_count(&path), 11);
    for (along_m, taken, last_m) in [
        (-1.0, 0, None),
        (0.0, 1, Some(0.0)),
        (7.4, 1, Some(0.0)),
        (39.0, 5, Some(30.0)),
        (99.0, 11, Some(80.0)),
    ] {
        assert_eq!(photographs.taken_count(&path, along_m), taken, "{along_m}");
        assert_eq!(photographs.last_picture_before_m(&path, along_m), last_m, "{along_m}");
    }
    assert_eq!(photographs.last_picture_m(&path), Some(80.0));
    assert_eq!(
        PicturePlan::new(9.0, HeadingMode::Ahead, Trigger::Distance).last_picture_m(&path),
        None
    );
}

#[test]
fn pictures_are_evenly_apart_over_ground_where_the_path_rises_and_falls() {
    let mut path = Path::<8>::new();
    // 20 m level, 40 m up at 3 in 4, 20 m down as steep.
    for (x, z) in [(0.0, 30.0), (20.0, 30.0), (60.0, 60.0), (80.0, 45.0), (80.0, 90.0)] {
        path.push(Point::new(x, 0.0, z), 1.0).unwrap();
    }
    let mut photographs = PicturePlan::new(9.0, HeadingMode::Ahead, Trigger::Waypoint);
    photographs.add_stretch(0, 3, WaypointRange { first: 0, end: 9 }).unwrap();
    let shots = photographs.stretches(&path).next().unwrap();
    assert_eq!((shots.ground_spacing_m, shots.count), (10.0, 9));
    for k in 0..9 {
        let place = path.point_at(shots.picture_arc_length_m(k)).unwrap();
        assert!((place.x - 10.0 * k as f32).abs() < 1e-3, "{place}");
        let by = |beside_m: f32| {
            photographs.taken_count(&path, shots.picture_arc_length_m(k) + beside_m)
        };
        assert_eq!((by(-0.05), by(0.0), by(0.05)), (k, k + 1, k + 1), "{k}");
    }
    assert_eq!(photographs.taken_count(&path, 1e9), 9);
}

#[test]
fn pictures_have_the_numbers_of_their_waypoints_both_ways() {
    for (order, [part, whole]) in [
        (WaypointOrder::Rising, [(30, 33), (30, 35)]),
        (WaypointOrder::Falling, [(32, 35), (30, 35)]),
    ] {
        let mut photographs = PicturePlan::new(9.0, HeadingMode::Ahead, Trigger::Distance)
            .with_area_waypoints(50, order);
        mark_three(&mut photographs);
        let path = path();
        let shown = |first, end| -> std::vec::Vec<_> {
            let pictures = WaypointRange { first, end };
            photographs
                .waypoints_of_pictures(&path, pictures)
                .map(|range| (range.first, range.end))
                .collect()
        };
        let numbers = |count| shown(0, count);
        assert_eq!(numbers(0), []);
        assert_eq!(numbers(5), [(7, 12)]);
        assert_eq!(numbers(8), [(7, 12), part]);
        assert_eq!(numbers(11), [(7, 12), whole, (40, 41)]);
        assert_eq!(numbers(99), numbers(11));
        // The pictures `first..end` show the waypoints that the first `end` pictures show and the
        // first `first` ones do not, each waypoint once.
        for (first, end) in (0..13).flat_map(|first| (0..13).map(move |end| (first, end))) {
            let all = |ranges: std::vec::Vec<(u32, u32)>| -> std::collections::BTreeSet<u32> {
                ranges.into_iter().flat_map(|(first, end)| first..end).collect()
            };
            let (upto, before) = (all(numbers(end)), all(numbers(first)));
            assert_eq!(all(shown(first, end)), &upto - &before, "{first}..{end}");
        }
    }
}

#[test]
fn waypoints_beyond_the_bits_are_refused() {
    let mut photographs = PicturePlan::new(9.0, HeadingMode::Ahead, Trigger::Distance);
    let two = WaypointRange { first: 0, end: 2 };
    assert_eq!(photographs.add_stretch(63, 64, two), Err(PathError::PathFull));
    assert_eq!(photographs.add_stretch(3, 2, two), Err(PathError::PathFull));
    assert_eq!(
        photographs.add_stretch(2, 3, WaypointRange { first: 2, end: 2 }),
        Err(PathError::PathFull)
    );
    // On a path that is shorter than what was marked there is nothing to photograph.
    photographs.add_stretch(62, 63, two).unwrap();
    assert_eq!(photographs.stretches(&path()).next(), None);
    let mut photographs = PicturePlan::new(9.0, HeadingMode::Ahead, Trigger::Distance);
    for at in 0..PicturePlan::MAX_STRETCHES {
        photographs.add_stretch(at, at, WaypointRange { first: 0, end: 1 }).unwrap();
    }
    assert_eq!(photographs.add_stretch(40, 41, two), Err(PathError::PathFull));
}
