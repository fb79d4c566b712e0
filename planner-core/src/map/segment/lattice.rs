//! The lattice to which the ends of a segment are snapped, so that the exact check runs in
//! integers.

use crate::Point;
use crate::map::voxel::{GridShape, MAX_DIM};

/// Fraction bits of a snapped coordinate: its unit is 2⁻¹⁴ cell.
pub const FRACTION_BITS: u32 = 14;
/// Edge length of a cell, in units of a snapped coordinate.
pub(super) const ONE_CELL: i32 = 1 << FRACTION_BITS;

/// The greatest coordinate that [`snap`] returns, in units of 2⁻¹⁴ cell.
pub const MAX_SNAPPED: i32 = (2 * MAX_DIM as i32) << FRACTION_BITS;

/// A point in units of 2⁻¹⁴ cell, relative to the grid's minimum corner.
pub type Snapped = [i32; 3];

/// `p` rounded to the lattice of 2⁻¹⁴ cell; `None` if a coordinate is not finite, or outside −1 to
/// 2 times [`MAX_DIM`] cells from the grid's minimum corner.
#[inline]
pub fn snap(shape: &GridShape, p: &Point) -> Option<Snapped> {
    /// [`snap`] accepts coordinates from −1 to 2 times this number, in cells.
    const MAX_DIM_CELLS: f32 = MAX_DIM as f32;
    let mut out = [0; 3];
    for axis in 0..3 {
        let u = (p[axis] - shape.min[axis]) / shape.resolution_m;
        if !(-MAX_DIM_CELLS..=2.0 * MAX_DIM_CELLS).contains(&u) {
            return None;
        }
        let v = u * ONE_CELL as f32;
        out[axis] = (if v < 0.0 { v - 0.5 } else { v + 0.5 }) as i32;
    }
    Some(out)
}

/// Most cells along each axis by which [`snap`] may move a point that lies within `cells` cells of
/// the grid's minimum corner: half a lattice unit, and half an ulp each for the subtraction and the
/// division.
pub fn max_snap_error_cells(cells: f32) -> f32 {
    0.5 / ONE_CELL as f32 + 2.0 * cells * (f32::EPSILON / 2.0)
}
