//! A map of level ground for missions without a map: free space above a floor.

use planner_core::Point;
use planner_core::map::voxel::GridShape;

use super::error::MapError;
use super::occupancy::OccupancyMap;
use super::octree::Occupancy;

/// Most cells of a map of level ground; a larger area gets larger cells.
const MAX_GROUND_CELLS: f32 = 4e6;

/// A map whose floor has its top at the height of `low`, with free space above it up to `high`, in
/// cells of `cell_m` or larger ones.
///
/// # Errors
/// The area is too large for a map.
pub fn level_ground_map(low: &Point, high: &Point, cell_m: f32) -> Result<OccupancyMap, MapError> {
    let size = high - low;
    let mut cell_m = cell_m;
    let dims = |cell_m: f32| [size.x, size.y, size.z].map(|side| (side / cell_m).ceil().max(1.0));
    while dims(cell_m).iter().product::<f32>() > MAX_GROUND_CELLS {
        cell_m *= 1.5;
    }
    let [x, y, z] = dims(cell_m).map(|cells| cells as u32);
    let shape = GridShape {
        dims: [x, y, z + 1],
        min: Point::new(low.x, low.y, low.z - cell_m),
        resolution_m: cell_m,
    };
    let mut map = OccupancyMap::all_unknown(shape, "the ground")?;
    map.fill([0, 0, 1], [x, y, z + 1], Occupancy::Free);
    map.fill([0, 0, 0], [x, y, 1], Occupancy::Occupied);
    Ok(map)
}
