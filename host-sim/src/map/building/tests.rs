use super::*;
use crate::map::edt::ClearanceField;
use crate::map::occupancy::UnknownSpace;

/// The floors that a vehicle with 0.8 m of clearance reaches from the lobby, over cell centres.
fn floors_reached(map: &OccupancyMap) -> Vec<u32> {
    let voxels = map.to_voxel_map(UnknownSpace::Blocked);
    let (field, shape) = (ClearanceField::new(&voxels.grid()), voxels.shape);
    let start = shape.cell_of(&Point::new(20.0, 5.0, 1.5)).unwrap();
    let index = |[i, j, k]: [u32; 3]| ((k * shape.dims[1] + j) * shape.dims[0] + i) as usize;
    let mut seen = vec![false; shape.dims.iter().map(|&d| d as usize).product()];
    seen[index(start)] = true;
    let mut queue = vec![start];
    let mut rooms = std::collections::BTreeSet::new();
    while let Some(cell) = queue.pop() {
        let center = shape.center(cell);
        // Counts rooms only, not the corridor or a shaft.
        if !(CORRIDOR_Y_M[0] - 2.0..CORRIDOR_Y_M[1] + 2.0).contains(&center.y) {
            rooms.insert((center.z / FLOOR_HEIGHT_M) as u32);
        }
        for (axis, step) in [(0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)] {
            let mut next = cell;
            next[axis] = next[axis].wrapping_add_signed(step);
            if next[axis] < shape.dims[axis]
                && !seen[index(next)]
                && field.lower_bound_m(&shape.center(next)) > 0.8
            {
                seen[index(next)] = true;
                queue.push(next);
            }
        }
    }
    rooms.into_iter().collect()
}

#[test]
fn rooms_on_every_floor_are_reached_whatever_the_seed() {
    for seed in [DEFAULT_SEED, 2, 7] {
        let map = building_map(seed, 0.25).unwrap();
        assert_eq!(map.shape().dims, [164, 96, 196]);
        assert_eq!(map.counts().unknown, 0);
        assert_eq!(floors_reached(&map), (0..FLOORS).collect::<Vec<_>>(), "seed {seed}");
    }
}

#[test]
fn the_seed_decides() {
    let map = building_map(DEFAULT_SEED, 0.5).unwrap();
    assert_eq!(map, building_map(DEFAULT_SEED, 0.5).unwrap());
    assert_ne!(map, building_map(2, 0.5).unwrap());
    assert!(building_map(1, 0.01).is_err() && building_map(1, f32::NAN).is_err());
}
