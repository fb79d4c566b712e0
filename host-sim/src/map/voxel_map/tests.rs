use super::*;
use crate::map::{Occupancy, OccupancyMap, UnknownSpace};

#[test]
fn nodes_lie_in_cells_that_are_entirely_inside_the_box() {
    let shape = GridShape { dims: [13, 9, 7], min: Point::new(-3.0, 2.0, 0.5), resolution_m: 0.3 };
    let mut map = OccupancyMap::all_unknown(shape, "sample").unwrap();
    map.fill([1, 0, 0], shape.dims, Occupancy::Free);
    map.set([7, 4, 3], Occupancy::Occupied);
    for unknown in [UnknownSpace::Blocked, UnknownSpace::Free] {
        let map = map.to_voxel_map(unknown);
        let (min, max) = (map.shape.min, map.shape.max());
        let boxes = [
            (Point::repeat(-1e9), Point::repeat(1e9)),
            (min + Point::repeat(0.4), max - Point::repeat(0.5)),
            (min + Point::new(2.0, -5.0, 0.1), Point::new(max.x + 1.0, max.y - 0.7, 1e9)),
            (max + Point::repeat(1.0), max + Point::repeat(2.0)),
            (min - Point::repeat(2.0), min - Point::repeat(1.0)),
        ];
        for (low, high) in boxes {
            let fenced = map.with_nodes_inside(&low, &high);
            assert_eq!(fenced.grid().words(), map.grid().words());
            let (never, before) = (fenced.no_node_grid(), map.no_node_grid());
            let [nx, ny, nz] = map.shape.dims;
            for (i, j, k) in
                (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| (i, j, k))))
            {
                let half = Point::repeat(0.5 * map.shape.resolution_m);
                let centre = map.shape.center([i, j, k]);
                let (from, to) = (centre - half, centre + half);
                let inside = (0..3).all(|a| from[a] >= low[a] - 1e-4 && to[a] <= high[a] + 1e-4);
                let want = before.is_occupied([i, j, k]) || !inside;
                assert_eq!(never.is_occupied([i, j, k]), want, "{low} {high} {i} {j} {k}");
            }
        }
    }
}
