use super::*;

#[test]
fn a_grid_that_32_bits_cannot_index_is_refused() {
    let shape = |dims| GridShape { dims, min: Point::zeros(), resolution_m: 0.1 };
    // 2^32, 2^33 and 2^39 words, which are 0 in 32 bits.
    for dims in [[1 << 15, 1 << 15, 1 << 8], [1 << 15, 1 << 15, 1 << 9], [MAX_DIM; 3]] {
        let refused = VoxelGrid::new(shape(dims), Outside::Free, &[]).map(|_| ());
        assert_eq!(refused, Err(GridError::Dimensions), "{dims:?}");
    }
    assert!(VoxelGrid::new(shape([4, 5, 1]), Outside::Free, &[0; 2]).is_ok());
}
