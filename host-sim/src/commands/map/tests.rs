use super::*;
use crate::map::Occupancy;

/// Planning resamples a map to cells of any size, so `map info` must accept them too.
#[test]
fn any_resolution_that_is_planned_on_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hall.bt");
    let tree = Octree::from_cells(0.1, [32_700, 32_801, 32_768], [70, 41, 33], |[x, _, z]| {
        if z == 0 || x % 9 == 0 { Occupancy::Occupied } else { Occupancy::Free }
    });
    bt::write(&tree.unwrap(), &path).unwrap();
    let file = path.to_str().unwrap();
    for resolution_m in [0.05, 0.1, 0.13, 0.15, 0.2, 0.25, 0.3, 0.43, 1.0, 7.0] {
        let grid = crate::map::load(file, resolution_m).unwrap();
        let info = map_info(file, Some(resolution_m)).unwrap();
        assert_eq!(info.dims, grid.shape().dims, "{resolution_m}");
        for axis in 0..3 {
            let (from_m, to_m) = (grid.shape().min[axis], grid.shape().max()[axis]);
            assert!(
                (info.min_m[axis] - f64::from(from_m)).abs() < 1e-4,
                "{resolution_m}: {info:?}"
            );
            assert!((info.max_m[axis] - f64::from(to_m)).abs() < 1e-4, "{resolution_m}: {info:?}");
        }
    }
}
