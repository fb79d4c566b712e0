use super::*;
use crate::map::occupancy::{OccupancyMap, UnknownSpace};
use crate::map::octree::Occupancy;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// Every cell against every obstacle, by the definition.
    #[test]
    fn equals_the_definition(
        seed in any::<u64>(),
        dims in [1u32..13, 1u32..13, 1u32..13],
        rarity in 2u64..200,
    ) {
        let shape = GridShape { dims, min: Point::new(-1.0, 2.0, 0.5), resolution_m: 0.5 };
        let mut map = OccupancyMap::all_unknown(shape, "random").unwrap();
        let all: Vec<[u32; 3]> = (0..dims[0])
            .flat_map(|i| (0..dims[1]).flat_map(move |j| (0..dims[2]).map(move |k| [i, j, k])))
            .collect();
        let mut state = seed | 1;
        let mut obstacles = Vec::new();
        for &cell in &all {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            if (state >> 33) % rarity == 0 {
                map.set(cell, Occupancy::Occupied);
                obstacles.push(cell);
            }
        }
        let voxels = map.to_voxel_map(UnknownSpace::Free);
        let field = ClearanceField::new(&voxels.grid());
        for &cell in &all {
            let apart = |o: &[u32; 3]| {
                (0..3).map(|a| o[a].abs_diff(cell[a]).saturating_sub(1).pow(2)).sum::<u32>()
            };
            let want = obstacles.iter().map(apart).min().map_or(65535, |d| d.min(65535));
            let got = field.lower_bound_m(&shape.center(cell));
            prop_assert_eq!(got, (want as f32).sqrt() * 0.5);
        }
    }
}

#[test]
fn beyond_the_faces() {
    let shape = GridShape { dims: [8, 8, 8], min: Point::zeros(), resolution_m: 1.0 };
    let map = {
        let mut map = OccupancyMap::all_unknown(shape, "cube").unwrap();
        for cell in 0..512 {
            map.set([cell % 8, cell / 8 % 8, cell / 64], Occupancy::Free);
        }
        map
    };
    let blocked = ClearanceField::new(&map.to_voxel_map(UnknownSpace::Blocked).grid());
    assert_eq!(blocked.lower_bound_m(&Point::new(4.0, 1.5, 4.0)), 1.5);
    assert_eq!(blocked.lower_bound_m(&Point::new(-1.0, 4.0, 4.0)), 0.0);
    assert_eq!(blocked.lower_bound_m(&Point::new(f32::NAN, 4.0, 4.0)), 0.0);
    let free = ClearanceField::new(&map.to_voxel_map(UnknownSpace::Free).grid());
    assert_eq!(free.lower_bound_m(&Point::new(-3.0, 4.0, 12.0)), 5.0);
}
