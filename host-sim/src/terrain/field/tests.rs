use planner_core::map::field::FieldView;
use proptest::prelude::*;

use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_field_is_above_the_ground_and_no_steeper_than_it_may_be(
        heights in prop::collection::vec(-30f32..90.0, 40 * 40),
        (reach_m, slope) in (0f32..3.0, 0.1f32..2.0),
        places in prop::collection::vec([0f32..1.0, 0f32..1.0, -1f32..1.0, -1f32..1.0], 40),
    ) {
        let mut grid =
            HeightGrid::new([Flat::repeat(-100.0), Flat::repeat(100.0)], 5.0).unwrap();
        for (index, height_m) in heights.iter().enumerate() {
            grid.raise_cell(&grid.cell_centre([index % 40, index / 40]), *height_m);
        }
        let area = [Flat::new(-30.0, -20.0), Flat::new(35.0, 28.0)];
        let config = FieldConfig { area, max_cross_track_m: reach_m, max_slope: slope };
        if config.window()[0].amin() < -75.0 || config.window()[1].amax() > 75.0 {
            return Ok(());
        }
        let bytes = encode_field(&grid, &config).unwrap();
        let view = FieldView::parse(&bytes).unwrap();
        for [x, y, east, north] in places {
            let at = area[0] + (area[1] - area[0]).component_mul(&Flat::new(x, y));
            // As far beside `at` as a vehicle may be, plus half a cell, the spacing of a path's
            // samples.
            let beside = at + Flat::new(east, north) * (reach_m + view.shape().cell_m / 2.0);
            prop_assert!(view.height_at(&at) >= grid.height_at(&beside).unwrap() - 1e-3);
            let step = Flat::new(east, north);
            let rise_m = (view.height_at(&(at + step)) - view.height_at(&at)).abs();
            prop_assert!(
                rise_m <= slope * step.norm() + 2e-3,
                "{} {}",
                rise_m,
                slope * step.norm()
            );
        }
    }
}

#[test]
fn holes_are_refused_by_their_place() {
    let mut grid = HeightGrid::new([Flat::repeat(-100.0), Flat::repeat(100.0)], 5.0).unwrap();
    for index in 0..1600 {
        if index != 20 * 40 + 22 {
            grid.raise_cell(&grid.cell_centre([index % 40, index / 40]), 10.0);
        }
    }
    let area = [Flat::repeat(-20.0), Flat::repeat(20.0)];
    let config = FieldConfig { area, max_cross_track_m: 0.5, max_slope: 0.5 };
    assert!(matches!(encode_field(&grid, &config), Err(FieldError::NoHeightAt(..))));
    grid.raise_cell(&grid.cell_centre([22, 20]), 4000.0);
    assert_eq!(encode_field(&grid, &config), Err(FieldError::HeightOutOfRange(4000.0)));
}
