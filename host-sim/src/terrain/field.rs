//! Makes `field.bin`, the height field that vehicles follow, from a height map.
//!
//! A node has the height of the highest ground around it: within [`READ_AROUND_SAMPLE_CELLS`] cells
//! plus the distance that a vehicle may be beside its path. Then nodes are raised until no slope is
//! steeper than vehicles climb and descend at cruise speed. The whole box must have heights.

use planner_core::coverage::Flat;
use planner_core::map::field::{self, FieldShape, HEIGHT_STEP_M, MAX_NODES};
use thiserror::Error;

use super::grid::HeightGrid;

/// How far from a point on a path heights of nodes matter to that point, in cells: samples of the
/// path are half a cell apart, and the nodes of a sample lie within one cell of the sample.
pub const READ_AROUND_SAMPLE_CELLS: f32 = 1.5;
/// Least distance between two nodes, metres.
const MIN_NODE_SPACING_M: f32 = 2.0;
/// Least number of height steps by which neighbouring nodes must be allowed to differ: with fewer,
/// rounding would distort the slope.
const MIN_RISE_STEPS: f32 = 5.0;

/// Reason why no field can be made.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum FieldError {
    /// The map has no height near this place, metres east and north.
    #[error("it has no height at [{0:.0}, {1:.0}], metres east and north of the origin")]
    NoHeightAt(f32, f32),
    /// This height, metres, does not fit into the file.
    #[error("a height of {0:.0} m is more than 3276 m from the mission's origin")]
    HeightOutOfRange(f32),
    /// The box cannot be covered with at most [`MAX_NODES`] nodes.
    #[error("the area is too large or too small for it")]
    UnsuitableSize,
}

/// Inputs of a field besides the height map.
#[derive(Clone, Copy, Debug)]
pub struct FieldConfig {
    /// The box that is flown over: least and greatest corner, metres.
    pub area: [Flat; 2],
    /// Greatest distance of a vehicle from its path to the side, metres.
    pub max_cross_track_m: f32,
    /// Steepest slope of the field, metres of height for each metre over ground.
    pub max_slope: f32,
}

impl FieldConfig {
    /// How far around a node the map's heights count for that node, metres. `cell_m` is the
    /// distance between nodes, `own_cell_m` the side of the map's cells.
    fn heights_count_within_m(&self, cell_m: f32, own_cell_m: f32) -> f32 {
        // A height in a cell of the map may come from up to one cell beside it.
        READ_AROUND_SAMPLE_CELLS * cell_m + self.max_cross_track_m + own_cell_m
    }

    /// Distance between nodes, metres, unless the map's cells are larger.
    fn min_node_spacing_m(&self) -> f32 {
        let sides = self.area[1] - self.area[0];
        let rise = MIN_RISE_STEPS * HEIGHT_STEP_M * std::f32::consts::SQRT_2 / self.max_slope;
        let fits = (sides.x * sides.y / (MAX_NODES as f32 * 0.9)).sqrt();
        // In a long and narrow box the added row of border nodes matters.
        let long = sides.amax() / (MAX_NODES as f32 / 8.0);
        MIN_NODE_SPACING_M.max(rise).max(fits).max(long)
    }

    /// The box in which the field needs heights, without the cells that a reader adds around any
    /// box.
    pub fn window(&self) -> [Flat; 2] {
        let beyond = Flat::repeat(
            (READ_AROUND_SAMPLE_CELLS + 1.0) * self.min_node_spacing_m() + self.max_cross_track_m,
        );
        [self.area[0] - beyond, self.area[1] + beyond]
    }
}

/// Makes the height field, encoded as in `field.bin`.
///
/// # Errors
/// The map has a hole in the window, or heights that do not fit into the file.
pub fn encode_field(grid: &HeightGrid, config: &FieldConfig) -> Result<Vec<u8>, FieldError> {
    let cell_m = config.min_node_spacing_m().max(grid.cell_m());
    let [low, high] = config.area;
    let count = |side: f32| ((side / cell_m).ceil() + 1.0).max(2.0) as u16;
    let shape = FieldShape {
        south_west: low,
        cell_m,
        columns: count(high.x - low.x),
        rows: count(high.y - low.y),
    };
    if shape.node_count() > MAX_NODES {
        return Err(FieldError::UnsuitableSize);
    }
    let around = Flat::repeat(config.heights_count_within_m(cell_m, grid.cell_m()));
    let (columns, rows) = (usize::from(shape.columns), usize::from(shape.rows));
    let mut nodes_dm = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let place = low + Flat::new(column as f32, row as f32) * cell_m;
            let found = grid.highest_in_box(&(place - around), &(place + around));
            let height_m = match found.highest_m {
                Some(height_m) if !found.has_holes => height_m,
                _ => return Err(FieldError::NoHeightAt(place.x, place.y)),
            };
            let node_dm = (height_m / HEIGHT_STEP_M - 1e-3).ceil();
            if node_dm.abs() > f32::from(i16::MAX) {
                return Err(FieldError::HeightOutOfRange(height_m));
            }
            nodes_dm.push(node_dm as i16);
        }
    }
    // Limit along one axis: a slope across both is steeper by the square root of two.
    let most = (config.max_slope * cell_m / std::f32::consts::SQRT_2 / HEIGHT_STEP_M + 1e-3) as i32;
    limit_slope(&mut nodes_dm, columns, most.clamp(1, i32::from(i16::MAX)));
    let mut bytes = vec![0; shape.encoded_len()];
    field::write(&shape, &nodes_dm, &mut bytes).map_err(|_| FieldError::UnsuitableSize)?;
    Ok(bytes)
}

/// Raises nodes until no two neighbours in a row or column differ by more than `most` height steps:
/// a distance transform in two passes.
fn limit_slope(nodes_dm: &mut [i16], columns: usize, most: i32) {
    let raise = |nodes_dm: &mut [i16], own: usize, other: usize| {
        let least = (i32::from(nodes_dm[other]) - most).max(i32::from(i16::MIN)) as i16;
        nodes_dm[own] = nodes_dm[own].max(least);
    };
    let count = nodes_dm.len();
    for own in 0..count {
        if own % columns > 0 {
            raise(nodes_dm, own, own - 1);
        }
        if own >= columns {
            raise(nodes_dm, own, own - columns);
        }
    }
    for own in (0..count).rev() {
        if (own + 1) % columns > 0 {
            raise(nodes_dm, own, own + 1);
        }
        if own + columns < count {
            raise(nodes_dm, own, own + columns);
        }
    }
}

#[cfg(test)]
mod tests;
