//! Columns compared with brute force over all cells, on random maps.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::map::{Occupancy, OccupancyMap, UnknownSpace};
use planner_core::map::voxel::GridShape;

fn uniform(rng: &mut Pcg32) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1 << 24) as f32
}

/// A floor with holes, and sparse cells of each kind above it.
fn random_map(rng: &mut Pcg32) -> OccupancyMap {
    let dims = [9, 8, 12];
    let shape = GridShape { dims, min: Point::new(-1.3, 0.4, -0.7), resolution_m: 0.2 };
    let mut map = OccupancyMap::all_unknown(shape, "random").unwrap();
    let sparse = uniform(rng) * 0.08;
    for (i, j, k) in (0..dims[0])
        .flat_map(|i| (0..dims[1]).flat_map(move |j| (0..dims[2]).map(move |k| (i, j, k))))
    {
        let state = match uniform(rng) {
            x if k == 0 && x < 0.9 => Occupancy::Occupied,
            x if x < sparse => Occupancy::Occupied,
            x if x < 1.3 * sparse => Occupancy::Unknown,
            _ => Occupancy::Free,
        };
        map.set([i, j, k], state);
    }
    map
}

/// The definition, over all cells: the ground, and whether all that rises above it is far enough.
fn brute_force(
    map: &OccupancyMap,
    unknown: UnknownSpace,
    p: &Point,
    radius_m: f32,
    required_m: f32,
) -> Option<f64> {
    let shape = map.shape();
    let bounds = |axis: usize, cell: u32| {
        let low = f64::from(shape.min[axis]) + f64::from(cell) * f64::from(shape.resolution_m);
        (low, low + f64::from(shape.resolution_m))
    };
    let [x, y, z] = [p.x, p.y, p.z].map(f64::from);
    let [i, j, top] = shape.cell_of(p)?;
    if map.state_at([i, j, top]) != Occupancy::Free {
        return None;
    }
    let below = (0..top).rev().find(|&k| match map.state_at([i, j, k]) {
        Occupancy::Occupied => true,
        Occupancy::Unknown => unknown == UnknownSpace::Blocked,
        Occupancy::Free => false,
    })?;
    if map.state_at([i, j, below]) == Occupancy::Unknown {
        return None;
    }
    let ground = bounds(2, below).1;
    let low = ground + f64::from(radius_m);
    if z < low {
        return None;
    }
    let mut nearest = f64::INFINITY;
    let [nx, ny, nz] = shape.dims;
    // Cells beyond the map are unknown: a margin of cells on all sides but below is checked too.
    let state = |c: [i64; 3]| {
        let inside = (0..3).all(|a| c[a] >= 0 && c[a] < i64::from(shape.dims[a]));
        if inside { map.state_at(c.map(|c| c as u32)) } else { Occupancy::Unknown }
    };
    for k in i64::from(below) + 1..i64::from(nz) + 6 {
        for j in -6..i64::from(ny) + 6 {
            for i in -6..i64::from(nx) + 6 {
                let blocked = match state([i, j, k]) {
                    Occupancy::Occupied => true,
                    Occupancy::Unknown => unknown == UnknownSpace::Blocked,
                    Occupancy::Free => false,
                };
                if blocked {
                    let gap = |axis: usize, cell: i64, from: f64, to: f64| {
                        let cell_m = f64::from(shape.resolution_m);
                        let lower = f64::from(shape.min[axis]) + cell as f64 * cell_m;
                        (lower - to).max(from - lower - cell_m).max(0.0)
                    };
                    let (dx, dy, dz) = (gap(0, i, x, x), gap(1, j, y, y), gap(2, k, low, z));
                    nearest = nearest.min((dx * dx + dy * dy + dz * dz).sqrt());
                }
            }
        }
    }
    (nearest > f64::from(required_m)).then_some(ground)
}

#[test]
fn columns_are_clear_where_brute_force_over_all_cells_finds_nothing_near() {
    let mut rng = Pcg32::seed_from_u64(1);
    let (mut clear, mut hinted) = (0, 0);
    for _ in 0..60 {
        let map = random_map(&mut rng);
        for unknown in [UnknownSpace::Blocked, UnknownSpace::Free] {
            let voxels = map.to_voxel_map(unknown);
            let (min, size) = (map.shape().min, map.shape().max() - map.shape().min);
            for _ in 0..40 {
                let p = min
                    + Point::new(uniform(&mut rng), uniform(&mut rng), uniform(&mut rng))
                        .component_mul(&size);
                let radius_m = 0.05 + 0.2 * uniform(&mut rng);
                let required_m = radius_m + 0.3 * uniform(&mut rng);
                let ours = ground_below_clear_column(&voxels, &p, radius_m, required_m);
                let expected = brute_force(&map, unknown, &p, radius_m, required_m);
                assert_eq!(
                    ours.is_ok(),
                    expected.is_some(),
                    "{p} {radius_m} {required_m}: {ours:?}"
                );
                match (ours, expected) {
                    (Ok(ground_m), Some(expected)) => {
                        assert!((f64::from(ground_m) - expected).abs() < 1e-5);
                        clear += 1;
                    }
                    (Err(ColumnError::TooNear { obstacle_point: place, distance_m, .. }), _) => {
                        // The place in the error is as far from the segment as the error says.
                        let along = place.z.min(p.z);
                        let away = ((place.x - p.x).hypot(place.y - p.y))
                            .hypot((place.z - along).max(0.0));
                        assert!(distance_m <= required_m && away <= distance_m + 1e-5 + radius_m);
                        if let Some(other) = nearest_clear_column(&voxels, &p, radius_m, required_m)
                        {
                            hinted += 1;
                            assert!(
                                brute_force(&map, unknown, &other, radius_m, required_m).is_some()
                            );
                        }
                    }
                    _ => {}
                }
            }
        }
    }
    assert!(clear > 300 && hinted > 100, "{clear} clear, {hinted} hinted");
}

#[test]
fn what_is_wrong_with_a_column_is_named() {
    let shape = GridShape { dims: [40, 40, 40], min: Point::zeros(), resolution_m: 0.25 };
    let mut map = OccupancyMap::all_unknown(shape, "room").unwrap();
    for (i, j, k) in
        (0..40).flat_map(|i| (0..40).flat_map(move |j| (0..40).map(move |k| (i, j, k))))
    {
        map.set([i, j, k], if k == 0 { Occupancy::Occupied } else { Occupancy::Free });
    }
    // A bar beside one column, unknown ground below another, none below a third.
    map.set([22, 20, 8], Occupancy::Occupied);
    map.set([8, 8, 0], Occupancy::Unknown);
    map.set([30, 30, 0], Occupancy::Free);
    let voxels = map.to_voxel_map(UnknownSpace::Blocked);
    let look =
        |x: f32, y: f32, z: f32| ground_below_clear_column(&voxels, &Point::new(x, y, z), 0.3, 0.8);
    assert_eq!(look(5.0, 2.0, 4.0), Ok(0.25));
    let bar = ColumnError::TooNear {
        obstacle_point: Point::new(5.5, 5.1, 2.25),
        distance_m: 0.5,
        unknown: false,
    };
    assert_eq!(look(5.0, 5.1, 4.0), Err(bar));
    assert_eq!(look(2.1, 2.1, 4.0), Err(ColumnError::UnknownBelow { top_m: 0.25 }));
    assert_eq!(look(7.6, 7.6, 4.0), Err(ColumnError::NoGround));
    assert_eq!(look(5.0, 2.0, 0.5), Err(ColumnError::TooLow { ground_m: 0.25 }));
    assert_eq!(look(5.5, 5.1, 2.1), Err(ColumnError::NotFree));
    assert_eq!(look(11.0, 5.1, 2.1), Err(ColumnError::NotFree));
    let face = ColumnError::TooNear {
        obstacle_point: Point::new(0.0, 5.0, 4.0),
        distance_m: 0.7,
        unknown: true,
    };
    assert_eq!(look(0.7, 5.0, 4.0), Err(face));
    let place = nearest_clear_column(&voxels, &Point::new(5.0, 5.1, 4.0), 0.3, 0.85).unwrap();
    assert_eq!(place, Point::new(4.6, 5.1, 4.0));
}
