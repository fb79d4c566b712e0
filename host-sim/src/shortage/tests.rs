use super::*;
use crate::map::Occupancy;
use crate::map::occupancy::{OccupancyMap, UnknownSpace};
use planner_core::map::voxel::GridShape;

/// Two rooms on either side of a wall with a door that is `door` cells of 0.1 m wide.
fn rooms(door: u32) -> VoxelMap {
    let shape = GridShape { dims: [60, 40, 20], min: Point::zeros(), resolution_m: 0.1 };
    let mut map = OccupancyMap::all_unknown(shape, "rooms").unwrap();
    for (i, j, k) in
        (0..60).flat_map(|i| (0..40).flat_map(move |j| (0..20).map(move |k| (i, j, k))))
    {
        let in_door = (20 - door / 2..20 + door.div_ceil(2)).contains(&j);
        let wall = (i == 30 && !in_door) || k == 0;
        map.set([i, j, k], if wall { Occupancy::Occupied } else { Occupancy::Free });
    }
    map.to_voxel_map(UnknownSpace::Free)
}

/// The clearance of a start or goal is that of the point itself, not that of its cell's centre.
#[test]
fn a_way_is_no_wider_than_its_ends() {
    let (from, to) = (Point::new(1.0, 1.0, 1.0), Point::new(5.0, 3.0, 1.0));
    let low = |p: &Point| Point::new(p.x, p.y, 0.2);
    let widths = |from: &Point, to: &Point| {
        widest_path_clearances_m(&rooms(8), |_| 0.0, from, &[*to], 0.15).unwrap()[0]
    };
    assert!(widths(&from, &to) > 0.14);
    assert!(widths(&low(&from), &to) <= 0.101 && widths(&from, &low(&to)) <= 0.101);
}

#[test]
fn the_widest_way_is_as_wide_as_the_door() {
    let (from, to) = (Point::new(1.0, 1.0, 1.0), Point::new(5.0, 3.0, 1.0));
    for door in [2, 5, 8, 12] {
        let width_m =
            widest_path_clearances_m(&rooms(door), |_| 0.0, &from, &[to], 2.0).unwrap()[0];
        let half_m = door as f32 * 0.05;
        assert!((width_m - half_m).abs() <= 0.1, "{door}: {width_m} for {half_m}");
    }
    assert_eq!(
        widest_path_clearances_m(&rooms(0), |_| 0.0, &from, &[from, to], 2.0).unwrap()[1],
        0.0
    );
}
