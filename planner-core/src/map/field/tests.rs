extern crate std;

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::follow::TerrainFollowing;
use super::*;
use crate::Point;

fn field(shape: &FieldShape, nodes_dm: &[i16]) -> Vec<u8> {
    let mut out = vec![0; shape.encoded_len()];
    assert_eq!(write(shape, nodes_dm, &mut out).unwrap(), out.len());
    out
}

/// Raises node heights until no slope is steeper than `most` decimetres per node.
fn flattened(columns: usize, nodes: &mut [i16], most: i16) {
    for _ in 0..nodes.len() {
        let before = nodes.to_vec();
        for (i, node) in nodes.iter_mut().enumerate() {
            let near = [(i % columns > 0, i.wrapping_sub(1)), (i % columns + 1 < columns, i + 1)];
            let far = [
                (i >= columns, i.wrapping_sub(columns)),
                (i + columns < before.len(), i + columns),
            ];
            for (_, other) in near.into_iter().chain(far).filter(|(there, _)| *there) {
                *node = (*node).max(before[other] - most);
            }
        }
        if before == nodes {
            return;
        }
    }
}

proptest! {
    #[test]
    fn what_is_written_is_read(
        (columns, rows, nodes) in (2u16..9, 2u16..9).prop_flat_map(|(columns, rows)| {
            let count = usize::from(columns * rows);
            (Just(columns), Just(rows), prop::collection::vec(any::<i16>(), count))
        }),
        low in [-1e5f32..1e5, -1e5f32..1e5],
        cell_m in 0.5f32..100.0,
        cut in any::<prop::sample::Index>(),
        flip in 0u8..8,
    ) {
        let shape = FieldShape { south_west: Flat::new(low[0], low[1]), cell_m, columns, rows };
        let bytes = field(&shape, &nodes);
        let view = FieldView::parse(&bytes).unwrap();
        prop_assert_eq!(view.shape(), &shape);
        prop_assert_eq!(view.highest_m(), f32::from(*nodes.iter().max().unwrap()) * HEIGHT_STEP_M);
        let at = cut.index(nodes.len());
        let (column, row) = (at % usize::from(columns), at / usize::from(columns));
        let place = shape.south_west + Flat::new(column as f32, row as f32) * cell_m;
        // Coordinates are rounded: at 1e5 m to 8 mm.
        let beside = 6554.0 * 0.05 / cell_m + 0.01;
        prop_assert!(
            (view.height_at(&place) - f32::from(nodes[at]) * HEIGHT_STEP_M).abs() < beside * 2.0
        );
        prop_assert!(FieldView::parse(&bytes[..cut.index(bytes.len())]).is_err());
        let mut damaged = bytes.clone();
        damaged[cut.index(bytes.len())] ^= 1 << flip;
        prop_assert!(FieldView::parse(&damaged).is_err());
    }

    #[test]
    fn a_path_keeps_between_field_and_tolerance_and_is_no_steeper(
        mut nodes in prop::collection::vec(-200i16..600, 12 * 9),
        ends in [[-10f32..70.0, -10f32..50.0], [-10f32..70.0, -10f32..50.0]],
        (tolerance_m, most) in (0.5f32..6.0, 3i16..30),
    ) {
        flattened(12, &mut nodes, most);
        let shape = FieldShape { south_west: Flat::zeros(), cell_m: 5.0, columns: 12, rows: 9 };
        let bytes = field(&shape, &nodes);
        let slope = f32::from(most) * HEIGHT_STEP_M / 5.0 * core::f32::consts::SQRT_2;
        let following = TerrainFollowing {
            field: FieldView::parse(&bytes).unwrap(),
            min_height_m: 30.0,
            tolerance_m,
            max_slope: slope,
        };
        let [from, to] = ends.map(|[x, y]| Flat::new(x, y));
        let begin = following.start_point(&from, &to);
        let mut path = vec![begin];
        let done: Result<(), ()> = following.corners_to(&begin, &to, |corner| {
            path.push(corner);
            Ok(())
        });
        prop_assert!(done.is_ok());
        prop_assert_eq!(path.last().unwrap().xy(), to);
        for leg in path.windows(2) {
            let step = leg[1] - leg[0];
            prop_assert!(step.z.abs() <= slope * step.xy().norm() * 1.001 + 0.002, "{:?}", leg);
            let samples = (step.xy().norm() / 0.25) as usize + 1;
            for k in 0..=samples {
                let at: Point = leg[0] + step * (k as f32 / samples as f32);
                let low_m = following.min_path_z_m(&at.xy());
                // Between two samples of the path, half a node spacing apart, the field may rise by
                // half of what `most` allows per node.
                let bent_m = f32::from(most) * HEIGHT_STEP_M / 2.0;
                prop_assert!(at.z >= low_m - bent_m - 0.01, "{} {}", at.z, low_m);
                prop_assert!(at.z <= low_m + tolerance_m + bent_m + 0.01, "{} {}", at.z, low_m);
            }
        }
    }
}

#[test]
fn over_level_ground_and_along_a_slope_a_path_is_straight() {
    let shape = FieldShape { south_west: Flat::zeros(), cell_m: 10.0, columns: 20, rows: 2 };
    let level = field(&shape, &[70; 40]);
    let rising: Vec<i16> = (0..40).map(|i| (i % 20) * 10).collect();
    let rising = field(&shape, &rising);
    // A ridge of 10 m, which rises and falls along the whole path, takes one corner at its top
    // besides the path's end.
    let ridge: Vec<i16> =
        (0..40).map(|i| 100 - 10 * i16::abs(i % 20 - 10)).map(|h| h.max(0)).collect();
    let ridge = field(&shape, &ridge);
    for (bytes, most) in [(&level, 1), (&rising, 1), (&ridge, 2)] {
        let field = FieldView::parse(bytes).unwrap();
        let following =
            TerrainFollowing { field, min_height_m: 20.0, tolerance_m: 2.0, max_slope: 0.2 };
        let (from, to) = (Flat::new(3.0, 5.0), Flat::new(187.0, 5.0));
        let begin = following.start_point(&from, &to);
        let mut corners = Vec::new();
        let done: Result<(), ()> = following.corners_to(&begin, &to, |corner| {
            corners.push(corner);
            Ok(())
        });
        assert!(done.is_ok() && corners.len() <= most, "{corners:?}");
        if most == 1 {
            assert!((begin.z - following.min_path_z_m(&from)).abs() < 1e-4);
            assert!((corners[0].z - following.min_path_z_m(&to)).abs() < 1e-3);
        }
    }
}
