use super::*;

#[test]
fn large_swarms_keep_further_from_parked_vehicles_where_places_leave_room() {
    let extra_m = |vehicles: usize, apart_m: f32| {
        let place = |i: usize| Point::new(apart_m * i as f32, 0.0, 0.0);
        let pads: Vec<Point> = (0..vehicles).map(place).collect();
        // Each lands where the next one started, and so waits for it.
        let landed: Vec<Point> = (1..=vehicles).map(place).collect();
        extra_beside_parked_m(3.4, &pads, &landed)
    };
    assert_eq!((extra_m(12, 3.77), extra_m(13, 3.77)), (0.0, MAX_EXTRA_BESIDE_PARKED_M));
    assert!((extra_m(40, 3.55) - 0.05).abs() < 1e-5);
    assert_eq!(extra_m(40, 3.45), 0.0);
}
