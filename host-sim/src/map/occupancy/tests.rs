use super::*;
use planner_core::map::voxel::VoxelGrid;

use crate::map::octree::Leaf;

/// A few leaves of each kind at odd places: 0.3 m cells, keys about the origin.
fn sample_tree() -> Octree {
    Octree::from_cells(
        0.3,
        [KEY_ORIGIN - 3, KEY_ORIGIN + 2, KEY_ORIGIN],
        [13, 9, 7],
        |[x, y, z]| match (x * 7 + y * 5 + z * 3) % 11 {
            0 => Occupancy::Unknown,
            1 | 2 if x > 4 => Occupancy::Occupied,
            _ => Occupancy::Free,
        },
    )
    .unwrap()
}

/// The definition, cell by cell over all leaves: occupied if one reaches in, free if free
/// leaves fill it.
fn expected(tree: &Octree, shape: &GridShape, cell: [u32; 3]) -> Occupancy {
    let (r, res) = (f64::from(shape.resolution_m), tree.resolution_m());
    let lo = [0, 1, 2].map(|a| f64::from(shape.min[a]) + f64::from(cell[a]) * r);
    let (mut occupied, mut free) = (false, 0.0);
    tree.for_each_leaf(|Leaf { min_key: min, edge_cells: size, occupied: obstacle }| {
        let volume = (0..3)
            .map(|a| {
                let from = (f64::from(min[a]) - f64::from(KEY_ORIGIN)) * res;
                let share = ((from + f64::from(size) * res).min(lo[a] + r) - from.max(lo[a])) / r;
                if share > 1e-4 { share } else { 0.0 }
            })
            .product::<f64>();
        if obstacle { occupied |= volume > 0.0 } else { free += volume }
    });
    match (occupied, free >= 1.0 - 1e-4) {
        (true, _) => Occupancy::Occupied,
        (false, true) => Occupancy::Free,
        (false, false) => Occupancy::Unknown,
    }
}

#[test]
fn resampling_is_conservative_at_any_resolution() {
    let tree = sample_tree();
    for resolution in [0.3, 0.6, 0.15, 0.1, 0.25, 0.43, 1.0] {
        let map = OccupancyMap::from_octree(&tree, resolution, "sample").unwrap();
        let [nx, ny, nz] = map.shape().dims;
        for (i, j, k) in
            (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| (i, j, k))))
        {
            let want = expected(&tree, map.shape(), [i, j, k]);
            assert_eq!(
                map.state_at([i, j, k]),
                want,
                "resolution {resolution}, cell {:?}",
                (i, j, k)
            );
        }
    }
}

#[test]
fn own_resolution_is_exact() {
    let tree = sample_tree();
    let map = OccupancyMap::from_octree(&tree, 0.3, "sample").unwrap();
    let counts = map.counts();
    let tree_counts = tree.counts();
    assert!((counts.occupied as f64 * 0.027 - tree_counts.occupied_m3).abs() < 1e-9);
    assert!((counts.free as f64 * 0.027 - tree_counts.free_m3).abs() < 1e-9);
    let again =
        OccupancyMap::from_octree(&map.to_octree("sample").unwrap(), 0.3, "sample").unwrap();
    assert_eq!(map, again);
}

#[test]
fn unknown_is_what_the_user_chose() {
    let map = OccupancyMap::from_octree(&sample_tree(), 0.3, "sample").unwrap();
    let counts = map.counts();
    let ones =
        |grid: &VoxelGrid<'_>| grid.words().iter().map(|w| u64::from(w.count_ones())).sum::<u64>();
    let blocked = map.to_voxel_map(UnknownSpace::Blocked);
    assert_eq!(ones(&blocked.grid()), counts.occupied + counts.unknown);
    assert_eq!(ones(&blocked.no_node_grid()), counts.occupied + counts.unknown);
    let free = map.to_voxel_map(UnknownSpace::Free);
    assert_eq!(ones(&free.grid()), counts.occupied);
    assert_eq!(ones(&free.no_node_grid()), counts.occupied + counts.unknown);
    assert_eq!((blocked.beyond_map, free.beyond_map), (Outside::Blocked, Outside::Free));
}

#[test]
fn a_grid_too_large_is_refused_before_it_is_made() {
    let error = OccupancyMap::from_octree(&sample_tree(), 1e-4, "sample").unwrap_err().to_string();
    assert!(error.contains("choose another resolution_m"), "{error}");
    assert!(OccupancyMap::from_octree(&sample_tree(), f32::NAN, "sample").is_err());
}

#[test]
fn the_ground_is_the_first_obstacle_below() {
    let shape = GridShape { dims: [3, 1, 8], min: Point::new(0.0, 0.0, -1.0), resolution_m: 0.5 };
    let mut map = OccupancyMap::all_unknown(shape, "column").unwrap();
    for (i, k) in (0..3).flat_map(|i| (0..8).map(move |k| (i, k))) {
        let solid = (i == 0 && (k == 0 || k == 4)) || (i == 1 && k == 7);
        map.set([i, 0, k], if solid { Occupancy::Occupied } else { Occupancy::Free });
    }
    let blocked = map.to_voxel_map(UnknownSpace::Blocked);
    assert_eq!(blocked.ground_z_below_m(&Point::new(0.2, 0.2, 2.4)), Some(1.5));
    assert_eq!(blocked.ground_z_below_m(&Point::new(0.2, 0.2, 0.9)), Some(-0.5));
    assert_eq!(
        blocked.ground_z_below_m(&Point::new(0.2, 0.2, 1.2)),
        Some(1.2),
        "inside an obstacle"
    );
    assert_eq!(blocked.ground_z_below_m(&Point::new(0.7, 0.2, 9.0)), Some(3.0), "above the map");
    assert_eq!(blocked.ground_z_below_m(&Point::new(1.2, 0.2, 2.0)), Some(-1.0), "the map's floor");
    assert_eq!(blocked.ground_z_below_m(&Point::new(9.0, 0.2, 2.0)), None);
    assert_eq!(
        map.to_voxel_map(UnknownSpace::Free).ground_z_below_m(&Point::new(1.2, 0.2, 2.0)),
        None
    );
}
