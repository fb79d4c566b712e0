//! Line of sight from a node by an empty box of cells around it, without walking the map for each
//! segment.
//!
//! Boxes are convex, so a segment with both ends strictly inside the box is clear; a segment that
//! leaves the box enters the cell behind a face, which is mostly an obstacle. One box serves all
//! segments from a node, and those from other nodes in the box. The box decides only where rounding
//! cannot change the answer: "clear" if both ends are at least [`ROUNDING_CELLS`] cells inside the
//! box, "blocked" if a point of the segment is at least [`ROUNDING_CELLS`] cells inside an occupied
//! cell. All other segments go to the exact check.

use super::config::PrmConfig;
use super::neighbours::NodeGrid;
use crate::Point;
use crate::map::segment::{
    Snapped, TOUCH_CHECK_CLEARANCE_CELLS, brick_layer_mask, is_farther_than, segment_is_clear,
    snap, snapped_rest_touches,
};
use crate::map::voxel::VoxelGrid;

/// Margin for rounding, in cells. Coordinates in cells are computed to within 2⁻¹¹ cell as long as
/// the grid has at most [`MAX_GRID_SIDE_CELLS`] cells a side: two roundings of a coordinate err by
/// 2 · 4096 · 2⁻²⁴ = 2⁻¹¹ at worst, and snapping in the exact check by 2⁻¹⁵.
const ROUNDING_CELLS: f32 = 1.0 / 512.0;
/// Most cells a side of a grid in which free boxes are used.
const MAX_GRID_SIDE_CELLS: u32 = 4096;
/// Depth behind a face of the box at which the cell that a segment enters is looked up, in cells.
const PROBE_DEPTH_CELLS: f32 = 1.0 / 64.0;
/// Most free boxes that are kept for reuse. Nodes come in the order of their cubes, a few rooms at
/// a time.
const MAX_BOXES: usize = 32;

/// A box of free cells: indices `low..high` on each axis.
#[derive(Clone, Copy, Default)]
struct FreeBox {
    low: [i32; 3],
    high: [i32; 3],
}

/// Line-of-sight checks from one node, `here`, to others.
pub(super) struct NodeVisibility<'g, 'a> {
    /// The map.
    grid: &'g VoxelGrid<'a>,
    /// The required clearance, metres.
    clearance_m: f32,
    /// The required clearance, in cells.
    clearance_cells: f32,
    /// Number of cells in a metre.
    cells_per_m: f32,
    /// Most cells by which a free box is grown from its node's cell in each direction.
    max_growth_cells: i32,
    /// The free boxes that were grown last.
    boxes: [FreeBox; MAX_BOXES],
    /// Index of the newest box in `boxes`; the next one replaces the box after it.
    newest_box: usize,
    /// Position of the node, metres in the mission frame.
    here: [f32; 3],
    /// `here` in cells, relative to the grid's minimum corner.
    here_cells: [f32; 3],
    /// `here` on the lattice of the exact check; `None` if it lies too far outside the grid.
    here_snapped: Option<Snapped>,
    /// The free box around `here`; `None` where the box cannot be used, and all segments go to the
    /// exact check.
    view: Option<BoxView>,
}

/// The free box around `here`, relative to `here`.
#[derive(Clone, Copy)]
struct BoxView {
    /// Bounds, in cells relative to `here`: a segment that ends strictly between them is clear.
    /// Empty if `here` itself is nearer to a face of the box than the clearance.
    clear_low: [f32; 3],
    clear_high: [f32; 3],
    /// The box's faces, moved out by [`PROBE_DEPTH_CELLS`], in cells relative to `here`.
    face_low: [f32; 3],
    face_high: [f32; 3],
    /// Distance from the box's faces at which a segment is known to be clear, in cells: clearance
    /// and rounding.
    inset: f32,
}

impl<'g, 'a> NodeVisibility<'g, 'a> {
    pub(super) fn new(grid: &'g VoxelGrid<'a>, config: &PrmConfig) -> Self {
        let resolution = grid.shape().resolution_m;
        Self {
            grid,
            clearance_m: config.clearance_m,
            clearance_cells: config.clearance_m / resolution,
            cells_per_m: 1.0 / resolution,
            max_growth_cells: (config.edge_max_m / resolution).min(MAX_GRID_SIDE_CELLS as f32)
                as i32
                + 1,
            boxes: [FreeBox::default(); MAX_BOXES],
            newest_box: 0,
            here: [0.0; 3],
            here_cells: [0.0; 3],
            here_snapped: None,
            view: None,
        }
    }

    /// Sets the node to check from, and finds the free box around it.
    pub(super) fn set_node(&mut self, here: [f32; 3]) {
        let shape = self.grid.shape();
        self.here = here;
        self.here_snapped = snap(shape, &Point::from(here));
        self.view = None;
        if shape.dims.iter().any(|&d| d > MAX_GRID_SIDE_CELLS) {
            return;
        }
        self.here_cells = [0, 1, 2].map(|axis| (here[axis] - shape.min[axis]) * self.cells_per_m);
        let Some(cell) = shape.cell_of(&Point::from(here)) else {
            return;
        };
        let cell = cell.map(|c| c as i32);
        let around = match self.boxes.iter().find(|b| b.contains(cell)) {
            Some(around) => *around,
            None => {
                let Some(around) = FreeBox::grow(self.grid, cell, self.max_growth_cells) else {
                    return;
                };
                self.newest_box = (self.newest_box + 1) % MAX_BOXES;
                self.boxes[self.newest_box] = around;
                around
            }
        };
        let low = [0, 1, 2].map(|axis| around.low[axis] as f32 - self.here_cells[axis]);
        let high = [0, 1, 2].map(|axis| around.high[axis] as f32 - self.here_cells[axis]);
        if (0..3).any(|axis| low[axis] > -ROUNDING_CELLS || high[axis] < ROUNDING_CELLS) {
            return;
        }
        let inset = self.clearance_cells + self.clearance_cells * 1e-6 + ROUNDING_CELLS;
        let mut view = BoxView {
            clear_low: low.map(|x| x + inset),
            clear_high: high.map(|x| x - inset),
            face_low: low.map(|x| x - PROBE_DEPTH_CELLS),
            face_high: high.map(|x| x + PROBE_DEPTH_CELLS),
            inset,
        };
        if (0..3).any(|axis| view.clear_low[axis] >= 0.0 || view.clear_high[axis] <= 0.0) {
            view.clear_high = [f32::NEG_INFINITY; 3];
        }
        self.view = Some(view);
    }

    /// Calls `found` with each of `places` whose node the segment from `here` reaches with
    /// clearance, and with the least distance of that segment from the box's faces in metres, or 0
    /// if it leaves the box.
    #[inline(always)]
    pub(super) fn for_each_visible<E, const NODES: usize, const CUBES: usize>(
        &self,
        workspace: &NodeGrid<NODES, CUBES>,
        places: &[u16],
        hint: impl Fn(usize) -> Option<bool>,
        mut found: impl FnMut(usize, f32) -> Result<(), E>,
    ) -> Result<(), E> {
        for &place in places {
            let place = usize::from(place);
            let there = workspace.point(place);
            let (clear, room) = match self
                .view
                .as_ref()
                .map_or(SegmentClass::Leaves(0.0), |view| self.classify_segment(view, there))
            {
                SegmentClass::Clear(room) => (true, room),
                SegmentClass::Blocked => (false, 0.0),
                SegmentClass::Leaves(known) => {
                    (hint(place).unwrap_or_else(|| self.is_rest_clear(there, known)), 0.0)
                }
            };
            if clear {
                found(place, room * self.grid.shape().resolution_m)?;
            }
        }
        Ok(())
    }

    /// The exact check of the segment from `here` to `there`; the first part, `known` (0 to 1) of
    /// its length, lies in the free box and need not be checked.
    #[inline]
    fn is_rest_clear(&self, there: [f32; 3], known: f32) -> bool {
        let there = Point::from(there);
        let (Some(a), Some(b)) = (&self.here_snapped, snap(self.grid.shape(), &there)) else {
            return false;
        };
        if self.clearance_cells >= TOUCH_CHECK_CLEARANCE_CELLS {
            return is_farther_than(
                self.grid,
                &Point::from(self.here),
                &there,
                known,
                self.clearance_m,
            );
        }
        if self.clearance_m > 0.0 {
            return segment_is_clear(self.grid, &Point::from(self.here), &there, self.clearance_m);
        }
        !snapped_rest_touches(self.grid, a, &b, known)
    }

    /// Whether the segment from `here` to `there` is clear, as far as the free box can decide with
    /// certainty.
    #[inline(always)]
    fn classify_segment(&self, view: &BoxView, there: [f32; 3]) -> SegmentClass {
        let d = [0, 1, 2].map(|axis| (there[axis] - self.here[axis]) * self.cells_per_m);
        let inside = (d[0] > view.clear_low[0])
            & (d[0] < view.clear_high[0])
            & (d[1] > view.clear_low[1])
            & (d[1] < view.clear_high[1])
            & (d[2] > view.clear_low[2])
            & (d[2] < view.clear_high[2]);
        if inside {
            let room = [0, 1, 2].map(|axis| {
                let (low, high) = (view.clear_low[axis], view.clear_high[axis]);
                (d[axis].min(0.0) - low).min(high - d[axis].max(0.0))
            });
            return SegmentClass::Clear(room[0].min(room[1]).min(room[2]) + view.inset);
        }
        // A component of zero never leaves the box: its quotient is infinite.
        let leave = [0, 1, 2].map(|axis| {
            let face = if d[axis] < 0.0 { view.face_low[axis] } else { view.face_high[axis] };
            face / d[axis]
        });
        let t = leave[0].min(leave[1]).min(leave[2]);
        let at = |t: f32| [0, 1, 2].map(|axis| self.here_cells[axis] + d[axis] * t);
        if t < 0.999 && self.is_certainly_obstacle(at(t)) {
            return SegmentClass::Blocked;
        }
        // The cell beyond the face by which the segment leaves the box is free, or may be. Up to
        // that face, less the probe depth and the clearance, the segment is certainly clear.
        let near =
            [0, 1, 2].map(|axis| leave[axis] - (PROBE_DEPTH_CELLS + view.inset) / d[axis].abs());
        let known = near[0].min(near[1]).min(near[2]).clamp(0.0, 1.0);
        SegmentClass::Leaves(if view.clear_high[0] > 0.0 { known } else { 0.0 })
    }

    /// Whether a point, in cells from the grid's minimum corner, lies in an occupied cell, and not
    /// within rounding of the cell's border.
    #[inline(always)]
    fn is_certainly_obstacle(&self, place: [f32; 3]) -> bool {
        let mut cell = [0; 3];
        let mut certain = true;
        for axis in 0..3 {
            cell[axis] = place[axis] as i32;
            let part = place[axis] - cell[axis] as f32;
            certain &= part > ROUNDING_CELLS
                && part < 1.0 - ROUNDING_CELLS
                && cell[axis] < self.grid.shape().dims[axis] as i32;
        }
        certain && self.grid.is_occupied(cell.map(|c| c as u32))
    }
}

/// What the free box alone says about the segment from `here` to another node.
enum SegmentClass {
    /// The segment ends inside the box, and keeps at least this many cells from the nearest face,
    /// up to rounding.
    Clear(f32),
    /// The segment leaves the box into an occupied cell.
    Blocked,
    /// The segment leaves the box. Its first part, this share (0 to 1) of its length, is clear; the
    /// exact check decides on the rest.
    Leaves(f32),
}

impl FreeBox {
    /// Whether a cell is in the box.
    fn contains(&self, cell: [i32; 3]) -> bool {
        (0..3).all(|axis| cell[axis] >= self.low[axis] && cell[axis] < self.high[axis])
    }

    /// The largest free box that grows from `cell` by at most `reach` cells: along z to floor and
    /// ceiling, then along x, then along y. `None` if the cell is an obstacle.
    fn grow(grid: &VoxelGrid<'_>, cell: [i32; 3], reach: i32) -> Option<Self> {
        if grid.is_occupied(cell.map(|c| c as u32)) {
            return None;
        }
        let mut grown = Self { low: cell, high: cell.map(|c| c + 1) };
        for axis in [2, 0, 1] {
            let dim = grid.shape().dims[axis] as i32;
            grown.high[axis] = grown.free_up_to(grid, axis, (cell[axis] + 1 + reach).min(dim));
            grown.low[axis] = grown.free_down_to(grid, axis, (cell[axis] - reach).max(0));
        }
        Some(grown)
    }

    /// Upper bound (exclusive cell index) to which the box can grow along `axis`, at most `limit`.
    fn free_up_to(&self, grid: &VoxelGrid<'_>, axis: usize, limit: i32) -> i32 {
        let start = self.high[axis];
        let mut brick = start >> 2;
        while brick * 4 < limit {
            let mut layers = self.occupied_layers(grid, axis, brick);
            if brick == start >> 2 {
                layers &= 0b1111 << (start & 3);
            }
            if layers != 0 {
                return (brick * 4 + layers.trailing_zeros() as i32).min(limit);
            }
            brick += 1;
        }
        limit.max(start)
    }

    /// Lower bound (inclusive cell index) to which the box can grow along `axis`, at least `limit`.
    fn free_down_to(&self, grid: &VoxelGrid<'_>, axis: usize, limit: i32) -> i32 {
        let start = self.low[axis];
        let mut brick = (start - 1) >> 2;
        while brick >= 0 && brick * 4 + 3 >= limit {
            let mut layers = self.occupied_layers(grid, axis, brick);
            if brick == (start - 1) >> 2 {
                layers &= 0b1111 >> (3 - ((start - 1) & 3));
            }
            if layers != 0 {
                return (brick * 4 + 32 - layers.leading_zeros() as i32).max(limit);
            }
            brick -= 1;
        }
        limit.min(start)
    }

    /// Bit i is set if layer i of the four layers of cells of brick layer `brick` along `axis`
    /// holds an obstacle within the box's extent on the other two axes.
    fn occupied_layers(&self, grid: &VoxelGrid<'_>, axis: usize, brick: i32) -> u32 {
        let [v, w] = [[1, 2], [0, 2], [0, 1]][axis];
        let [bx, by, _] = grid.shape().brick_dims().map(|n| n as i32);
        let strides = [1, bx, bx * by];
        let layers = |axis: usize, brick: i32| {
            let low = (self.low[axis] - brick * 4).max(0);
            let high = (self.high[axis] - 1 - brick * 4).min(3);
            (0b1111 << low) & (0b1111 >> (3 - high))
        };
        // Along `v` only the first and the last brick may extend beyond the box, and are masked.
        let (first, last) = (self.low[v] >> 2, (self.high[v] - 1) >> 2);
        let (first_mask, last_mask) =
            (brick_layer_mask(v, layers(v, first)), brick_layer_mask(v, layers(v, last)));
        let mut all = 0;
        for brick_w in self.low[w] >> 2..=(self.high[w] - 1) >> 2 {
            let at = |brick_v: i32| {
                (brick * strides[axis] + brick_v * strides[v] + brick_w * strides[w]) as usize
            };
            let mut row = grid.words()[at(first)] & first_mask | grid.words()[at(last)] & last_mask;
            if last > first + 1 {
                let between = &grid.words()[at(first + 1)..at(last)];
                row |= match strides[v] {
                    1 => between.iter().fold(0, |row, word| row | word),
                    stride => {
                        between.iter().step_by(stride as usize).fold(0, |row, word| row | word)
                    }
                };
            }
            all |= row & brick_layer_mask(w, layers(w, brick_w));
        }
        (0..4)
            .filter(|&layer| all & brick_layer_mask(axis, 1 << layer) != 0)
            .fold(0, |bits, layer| bits | 1 << layer)
    }
}
