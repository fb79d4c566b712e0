use super::*;

#[test]
fn a_box_is_pruned_and_found_again() {
    // 4³ free cells aligned to a power of two prune to one leaf; one occupied cell beside them
    // stays alone.
    let min = [KEY_ORIGIN; 3];
    let tree = Octree::from_cells(0.5, min, [5, 4, 4], |[x, y, z]| match x {
        4 if (y, z) == (0, 0) => Occupancy::Occupied,
        4 => Occupancy::Unknown,
        _ => Occupancy::Free,
    })
    .unwrap();
    let counts = tree.counts();
    assert_eq!((counts.free_leaves, counts.occupied_leaves), (1, 1));
    assert_eq!((counts.free_m3, counts.occupied_m3), (8.0, 0.125));
    assert_eq!(tree.metric_bounds(), Some(([0.0; 3], [2.5, 2.0, 2.0])));
    assert_eq!(tree.occupancy_at([1.99, 0.0, 1.0]), Occupancy::Free);
    assert_eq!(tree.occupancy_at([2.0, 0.0, 0.0]), Occupancy::Occupied);
    assert_eq!(tree.occupancy_at([2.0, 0.6, 0.0]), Occupancy::Unknown);
    assert_eq!(tree.occupancy_at([f64::NAN, 0.0, 0.0]), Occupancy::Unknown);
    assert_eq!(tree.occupancy_at([1e30, 0.0, 0.0]), Occupancy::Unknown);
}

#[test]
fn a_box_beyond_the_key_space_is_refused() {
    assert!(
        Octree::from_cells(1.0, [KEYS_PER_AXIS - 1, 0, 0], [2, 1, 1], |_| Occupancy::Free)
            .is_none()
    );
}
