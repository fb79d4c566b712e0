//! Distance from a straight segment to the obstacles of a voxel map, and whether it is enough.
//!
//! This check decides on every roadmap edge (paper P3D §3.2, Algorithm 1): may a vehicle that needs
//! `clearance_m` fly straight from `a` to `b`? A segment is clear iff its Euclidean distance to
//! every occupied closed cell, and to the outside where that is
//! [`Outside::Blocked`](crate::map::voxel::Outside::Blocked), is strictly greater than the
//! clearance: touching a face, an edge or a corner is blocked.
//!
//! # Why the answer is exact at clearance 0
//!
//! Both ends are first snapped to a lattice of 2⁻¹⁴ cell ([`snap`]). From there on all arithmetic
//! is in integers, without rounding or overflow: the segment meets a closed cell iff none of the
//! six separating axes of a segment and a cube (three face normals, three cross products) separates
//! them, and those tests are 64-bit products of 31-bit numbers. The walk that finds occupied cells
//! to test may therefore visit more cells than the segment touches, and does.
//!
//! So for ends on the lattice (multiples of resolution / 16384; also a corner and a resolution for
//! which `(p − min) / resolution` is exact, such as powers of two) the answer is right, touching
//! included. For any other ends the answer is that for a segment whose ends are moved by at most
//! [`max_snap_error_cells`]: 2⁻¹⁵ cell of snapping and two f32 roundings, 0.000 06 cell in a grid
//! of 256 cells a side, 15 µm at 0.25 m.
//!
//! # Cost
//!
//! Clearance 0: one word of 4 × 4 × 4 cells for every four cells along the longest axis (up to four
//! words where the segment runs near a brick's border); single cells are tested only in bricks that
//! hold an obstacle near the line. Clearance above 0: the words whose cells lie in the bounding
//! boxes of the swept volume, and one distance for each obstacle in them.

mod distance;
mod lanes;
mod lattice;
#[cfg(test)]
mod tests;
mod walk;

pub(crate) use self::distance::is_farther_than;
pub use self::distance::{point_clearance, segment_clearance};
pub(crate) use self::lanes::brick_layer_mask;
pub use self::lattice::{FRACTION_BITS, MAX_SNAPPED, Snapped, max_snap_error_cells, snap};
pub(crate) use self::walk::snapped_rest_touches;
pub use self::walk::snapped_segment_touches;
use crate::Point;
use crate::map::voxel::VoxelGrid;

/// From this clearance on, in cells, the f32 distance check alone finds every obstacle that the
/// segment touches, whatever the rounding. Below, the exact check runs first.
pub(crate) const TOUCH_CHECK_CLEARANCE_CELLS: f32 = 0.25;

/// Whether the segment from `a` to `b` stays strictly farther than `clearance_m` from every
/// obstacle.
///
/// Also false (the safe answer) if an end is not finite or more than
/// [`MAX_DIM`](crate::map::voxel::MAX_DIM) cells beyond the grid, or if the clearance is NaN,
/// infinite or negative. `a` may equal `b`.
pub fn segment_is_clear(grid: &VoxelGrid<'_>, a: &Point, b: &Point, clearance_m: f32) -> bool {
    let (Some(from), Some(to)) = (snap(grid.shape(), a), snap(grid.shape(), b)) else {
        return false;
    };
    if clearance_m == 0.0 {
        return !snapped_segment_touches(grid, &from, &to);
    }
    if !(clearance_m > 0.0 && clearance_m.is_finite()) {
        return false;
    }
    if clearance_m < TOUCH_CHECK_CLEARANCE_CELLS * grid.shape().resolution_m
        && snapped_segment_touches(grid, &from, &to)
    {
        return false;
    }
    is_farther_than(grid, a, b, 0.0, clearance_m)
}
