use super::super::tests::joined;
use super::*;

#[test]
fn the_unheard_travel_is_longer_while_a_range_is_set() {
    let mut table = joined(0);
    let all_reached_m = table.entries[0].max_unheard_travel_m;
    let later_m = UNHEARD_NOTICED_LATER_S * table.fastest_vehicle_mps;
    for (range_m, longer_m) in [(60.0, later_m), (30.0, later_m), (REACHES_ALL_M, 0.0)] {
        table.set_own_position_and_range(Point::zeros(), range_m);
        for entry in &table.entries {
            assert!(
                (entry.max_unheard_travel_m - all_reached_m - longer_m).abs() < 1e-4,
                "{range_m}"
            );
        }
    }
}
