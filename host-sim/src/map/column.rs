//! The vertical flight between the ground and a start or goal: checks that it has the clearance
//! that every edge has.
//!
//! The ground is the top of the first occupied cell below the point; unknown space and the map's
//! bottom are no ground. A vehicle stands there with its centre one radius above. From there up to
//! the point, every blocked cell above the ground must be farther away than the required clearance:
//! obstacles, unknown space where that is blocked, and then also the map's faces. The segment is
//! vertical and cells are boxes, so distances are exact but for rounding in f64. Metres, ENU in the
//! mission frame. Cost: the cells within the required clearance.

use planner_core::Point;
use planner_core::map::voxel::Outside;

use super::VoxelMap;

/// Greatest offset, east and north each, that [`nearest_clear_column`] tries, metres.
const NEAREST_COLUMN_WITHIN_M: f32 = 5.0;
/// Most cells that [`nearest_clear_column`] reads in all, which takes a second or two.
const MAX_NEAREST_COLUMN_CELLS: f32 = 3e8;
/// Spacing of the points that [`nearest_clear_column`] tries, metres.
const NEAREST_COLUMN_STEP_M: f32 = 0.1;

/// Reason why a vehicle may not fly vertically between the ground and a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColumnError {
    /// The point lies in an obstacle, in unknown space or outside the map.
    NotFree,
    /// No occupied cell is below the point.
    NoGround,
    /// The first blocked cell below the point is unknown: the ground below it was never seen.
    UnknownBelow {
        /// Top of the unknown space, metres ENU.
        top_m: f32,
    },
    /// The point is less than the vehicle's radius above the ground.
    TooLow {
        /// Height of the ground, metres ENU.
        ground_m: f32,
    },
    /// A blocked cell above the ground, or a face of the map, is nearer than the required
    /// clearance.
    TooNear {
        /// The point of the obstacle that is nearest to the vertical flight, metres ENU.
        obstacle_point: Point,
        /// Distance from that point to the vehicle's centre where it passes nearest, metres.
        distance_m: f32,
        /// Whether the obstacle is unknown space or a face of the map, rather than an occupied
        /// cell.
        unknown: bool,
    },
}

/// Height of the ground below `point`, metres ENU, if a vehicle with `required_m` of clearance may
/// fly vertically between the two.
///
/// # Errors
/// The first requirement that is not met; [`ColumnError::TooNear`] names the nearest obstacle.
pub fn ground_below_clear_column(
    map: &VoxelMap,
    point: &Point,
    radius_m: f32,
    required_m: f32,
) -> Result<f32, ColumnError> {
    let shape = &map.shape;
    if map.no_node_grid().is_blocked_at(point) {
        return Err(ColumnError::NotFree);
    }
    let [i, j, top] = shape.cell_of(point).ok_or(ColumnError::NotFree)?;
    let grid = map.grid();
    let below =
        (0..=top).rev().find(|&k| grid.is_occupied([i, j, k])).ok_or(ColumnError::NoGround)?;
    let ground_m = shape.min.z + (below + 1) as f32 * shape.resolution_m;
    if map.is_unknown_obstacle([i, j, below]) {
        return Err(ColumnError::UnknownBelow { top_m: ground_m });
    }
    if point.z - ground_m < radius_m {
        return Err(ColumnError::TooLow { ground_m });
    }
    let (place, distance_m, unknown) =
        obstacle_nearest_to_column(map, point, below, ground_m + radius_m, required_m);
    if f64::from(required_m) < distance_m {
        return Ok(ground_m);
    }
    Err(ColumnError::TooNear { obstacle_point: place, distance_m: distance_m as f32, unknown })
}

/// Obstacle nearest to the vertical segment from `low_m` up to `point`: its nearest point, its
/// distance, and whether it is unknown space or a face. Obstacles are the blocked cells that are
/// above cell layer `ground` and within `reach_m` of the segment, and, where the outside is
/// blocked, the faces of the map but the lowest.
fn obstacle_nearest_to_column(
    map: &VoxelMap,
    point: &Point,
    ground: u32,
    low_m: f32,
    reach_m: f32,
) -> (Point, f64, bool) {
    let shape = &map.shape;
    let (min, max, cell_m) =
        (shape.min.cast::<f64>(), shape.max().cast::<f64>(), f64::from(shape.resolution_m));
    let (at, low_m, reach_m) = (point.cast::<f64>(), f64::from(low_m), f64::from(reach_m));
    let mut nearest = (Point::zeros(), f64::INFINITY, false);
    let mut consider = |place: [f64; 3], unknown: bool| {
        let along = place[2].clamp(low_m, at.z);
        let distance = (place[0] - at.x).hypot(place[1] - at.y).hypot(place[2] - along);
        if distance < nearest.1 {
            nearest = (Point::from(place.map(|x| x as f32)), distance, unknown);
        }
    };
    let mut reach_m = reach_m;
    if map.beyond_map == Outside::Blocked {
        for (axis, end) in [(0, min.x), (0, max.x), (1, min.y), (1, max.y), (2, max.z)] {
            // A cell beyond the nearest face is outside the map, so cells farther than the face
            // need no check.
            reach_m = reach_m.min((end - at[axis]).abs());
            let mut place = [at.x, at.y, at.z];
            place[axis] = end;
            consider(place, true);
        }
    }
    // One cell more on either side than the reach, so that rounding leaves none out.
    let range = |axis: usize, from: f64, to: f64| {
        let first = ((from - reach_m - min[axis]) / cell_m).floor() - 1.0;
        let last = ((to + reach_m - min[axis]) / cell_m).floor() + 1.0;
        let end = f64::from(shape.dims[axis]);
        first.clamp(0.0, end) as u32..(last + 1.0).clamp(0.0, end) as u32
    };
    let grid = map.grid();
    for k in range(2, low_m, at.z).start.max(ground + 1)..range(2, low_m, at.z).end {
        for j in range(1, at.y, at.y) {
            for i in range(0, at.x, at.x) {
                if !grid.is_occupied([i, j, k]) {
                    continue;
                }
                // The point of the cell nearest to the segment, axis by axis.
                let span = |axis: usize, cell: u32| {
                    let from = min[axis] + f64::from(cell) * cell_m;
                    (from, from + cell_m)
                };
                let (x, y, z) = (span(0, i), span(1, j), span(2, k));
                let height = if z.0 > at.z { z.0 } else { z.1.min(at.z).max(z.0) };
                let place = [at.x.clamp(x.0, x.1), at.y.clamp(y.0, y.1), height];
                consider(place, map.is_unknown_obstacle([i, j, k]));
            }
        }
    }
    nearest
}

/// The nearest point at the same height whose vertical flight has the required clearance: within 5
/// m, or within less where the required clearance makes each check costly. `None` if there is none.
pub fn nearest_clear_column(
    map: &VoxelMap,
    point: &Point,
    radius_m: f32,
    required_m: f32,
) -> Option<Point> {
    let steps = (NEAREST_COLUMN_WITHIN_M / NEAREST_COLUMN_STEP_M) as i32;
    let mut offsets: Vec<(i32, i32)> =
        (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i, j))).collect();
    offsets.sort_by_key(|&(i, j)| (i * i + j * j, i, j));
    // Rounded to the two decimals that the hint prints, so that the printed point is the one that
    // was checked.
    let round = |x: f32| (f64::from(x) * 100.0).round() as f32 / 100.0;
    let across = 2.0 * required_m / map.shape.resolution_m + 3.0;
    let layers = (map.shape.dims[2] as f32)
        .min(across + (point.z - map.shape.min.z) / map.shape.resolution_m);
    let most = (MAX_NEAREST_COLUMN_CELLS / (across * across * layers)) as usize;
    offsets.into_iter().take(most).find_map(|(i, j)| {
        let (x, y) = (
            point.x + i as f32 * NEAREST_COLUMN_STEP_M,
            point.y + j as f32 * NEAREST_COLUMN_STEP_M,
        );
        let place = Point::new(round(x), round(y), point.z);
        ground_below_clear_column(map, &place, radius_m, required_m).is_ok().then_some(place)
    })
}

#[cfg(test)]
mod tests;
