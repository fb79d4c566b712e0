use super::*;
use crate::scenario;
use crate::scenario::coverage::CoverageMethod;

/// [`count_missed_and_repeated`] with one picture at each waypoint (5 m apart) of a plan of at
/// least three lanes, after `change` has changed the pictures.
fn counted(change: impl Fn(&mut Vec<Picture>)) -> (u64, u64) {
    let text = "[area]\npolygon = [[0, 0], [60, 0], [60, 30], [0, 30]]\nheight_m = 20.0\nlane_m = 10.0\n\
                waypoint_m = 5.0\ncamera = { fov_deg = 73.7, aspect = 1.5 }\n[mission]\ncruise_mps = 5.0\n\
                [[vehicles]]\nid = 1\nstart = [-10, -10, 0]\n";
    let scenario = scenario::parse(text, "taken").unwrap();
    let planned = CoveragePlan::new(&scenario, CoverageMethod::Binpat).unwrap();
    let waypoints =
        (0..planned.tracks.waypoint_count()).filter_map(|number| planned.tracks.waypoint(number));
    let picture = |place: Flat| Picture {
        vehicle: Some(1),
        t_s: 0.0,
        position: Point::new(place.x, place.y, 20.0),
        yaw_enu_rad: 0.0,
    };
    let mut pictures: Vec<Picture> = waypoints.map(picture).collect();
    change(&mut pictures);
    count_missed_and_repeated(&planned, &pictures)
}

#[test]
fn pictures_where_waypoints_are_or_late_leave_none_out() {
    assert_eq!(counted(|_| ()), (0, 0));
    // Each picture later than the one before, as with trigger by distance: up to a whole
    // spacing.
    let later = |pictures: &mut Vec<Picture>| {
        let step = pictures[1].position - pictures[0].position;
        assert!(
            ((pictures[12].position - pictures[0].position) - step * 12.0).norm() < 0.01,
            "one lane"
        );
        for (k, picture) in pictures[1..12].iter_mut().enumerate() {
            picture.position += step * ((k + 1) as f32 / 12.0);
        }
    };
    assert_eq!(counted(later), (0, 0));
}

#[test]
fn a_picture_that_is_missing_leaves_its_waypoint_out() {
    for index in [0, 1, 5, 12, 13] {
        let without = |pictures: &mut Vec<Picture>| {
            pictures.remove(index);
        };
        assert_eq!(counted(without), (1, 0), "{index}");
    }
    assert_eq!(counted(|pictures| drop(pictures.drain(3..6))), (3, 0));
    assert_eq!(
        counted(|pictures| pictures[4].position += Point::new(7.0, 7.0, 0.0)).0,
        1,
        "beside its lane"
    );
    assert!(counted(Vec::clear).0 > 30);
}

#[test]
fn a_vehicle_that_comes_back_or_after_another_flies_twice_and_one_that_waits_does_not() {
    let again = |from: usize, vehicle: Option<u8>| {
        counted(move |pictures| {
            let more =
                pictures[from..from + 3].iter().map(|picture| Picture { vehicle, ..*picture });
            pictures.extend(more.collect::<Vec<_>>());
        })
    };
    assert_eq!(again(4, Some(1)), (0, 3));
    assert_eq!(again(4, Some(2)), (0, 3));
    assert_eq!(again(4, None), (0, 3));
    // Two pictures of one place, one after the other.
    assert_eq!(counted(|pictures| pictures.insert(4, pictures[4])), (0, 0));
    // The order of pictures of earlier flights is not known.
    let earlier = |pictures: &mut Vec<Picture>| {
        pictures.iter_mut().for_each(|picture| picture.vehicle = None);
        pictures.push(pictures[3]);
    };
    assert_eq!(counted(earlier), (0, 0));
}
