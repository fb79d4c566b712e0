//! Scheduled timed segments sorted into the cells of a square horizontal grid, so that the search
//! for segments near another one visits only the cells around it.
//!
//! Cost: one sort to build; a search visits the segments in the cells within reach.

use crate::Length;
use libm::{fmaxf, fminf};

use super::timed_segments::TimedSegment;
use crate::sort;

/// Number of cells along one side of the grid.
const CELLS_PER_SIDE: usize = 32;
/// Least side of a cell, metres: far below the separation, smaller cells rule out no more segments.
const MIN_CELL_M: f32 = 0.5;

/// Index of timed segments by the horizontal cell of their midpoint.
#[derive(Clone, Debug)]
pub(super) struct SegmentGrid {
    min: [f32; 2],
    cell_m: f32,
    /// Half of the length of the longest segment, metres.
    half_m: f32,
    /// Index of the first segment of each cell, row by row.
    starts: [u16; CELLS_PER_SIDE * CELLS_PER_SIDE + 1],
}

impl SegmentGrid {
    pub(super) const fn new() -> Self {
        // All zero; `sort_into_cells` sets the size before the first search.
        Self {
            min: [0.0; 2],
            cell_m: 0.0,
            half_m: 0.0,
            starts: [0; CELLS_PER_SIDE * CELLS_PER_SIDE + 1],
        }
    }

    /// Sorts `segments`, at most `u16::MAX` of them, by their cells, and indexes them.
    pub(super) fn sort_into_cells(&mut self, segments: &mut [TimedSegment]) {
        let (mut min, mut max) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        self.half_m = 0.0;
        for segment in &*segments {
            let middle = middle(segment);
            for a in 0..2 {
                (min[a], max[a]) = (fminf(min[a], middle[a]), fmaxf(max[a], middle[a]));
            }
            self.half_m = fmaxf(self.half_m, half_length(segment));
        }
        let extent_m = fmaxf(max[0] - min[0], max[1] - min[1]);
        (self.min, self.cell_m) = (min, fmaxf(extent_m / CELLS_PER_SIDE as f32, MIN_CELL_M));
        let cell = |segment: &TimedSegment| {
            let [x, y] = middle(segment);
            self.cell_index(1, y) * CELLS_PER_SIDE + self.cell_index(0, x)
        };
        // The order within a cell does not matter, as long as it is the same on all boards.
        sort::sort_by(segments, |a, b| cell(a).cmp(&cell(b)));
        self.starts.fill(0);
        for segment in &*segments {
            let [x, y] = middle(segment);
            self.starts[self.cell_index(1, y) * CELLS_PER_SIDE + self.cell_index(0, x) + 1] += 1;
        }
        for cell in 0..CELLS_PER_SIDE * CELLS_PER_SIDE {
            self.starts[cell + 1] += self.starts[cell];
        }
    }

    /// Index along `axis` of the cell that holds a coordinate, or of the nearest cell if it is
    /// outside the grid.
    fn cell_index(&self, axis: usize, value: f32) -> usize {
        (((value - self.min[axis]) / self.cell_m) as usize).min(CELLS_PER_SIDE - 1)
    }

    /// All segments whose midpoint is so near that they may come within `apart_m` of `own`, and
    /// some that may not.
    pub(super) fn candidates_near<'a>(
        &'a self,
        segments: &'a [TimedSegment],
        own: &TimedSegment,
        apart_m: f32,
    ) -> impl Iterator<Item = &'a TimedSegment> {
        let reach_m = apart_m + half_length(own) + self.half_m;
        let middle = middle(own);
        let [columns, rows] = [0, 1].map(|axis| {
            (
                self.cell_index(axis, middle[axis] - reach_m),
                self.cell_index(axis, middle[axis] + reach_m),
            )
        });
        (rows.0..=rows.1).flat_map(move |row| {
            let from = self.starts[row * CELLS_PER_SIDE + columns.0];
            let to = self.starts[row * CELLS_PER_SIDE + columns.1 + 1];
            &segments[usize::from(from)..usize::from(to)]
        })
    }
}

fn middle(segment: &TimedSegment) -> [f32; 2] {
    [(segment.from.x + segment.to.x) * 0.5, (segment.from.y + segment.to.y) * 0.5]
}

fn half_length(segment: &TimedSegment) -> f32 {
    (segment.to - segment.from).length() * 0.5
}

#[cfg(test)]
mod tests;
