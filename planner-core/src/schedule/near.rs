//! Scheduled timed segments sorted into the cells of a square horizontal grid, so that the search
//! for segments near another one visits only the cells around it.
//!
//! Cost: one sort to build; a search visits the segments in the cells within reach.

use crate::Length;
use libm::{fmaxf, fminf};

use super::config::ScheduleConfig;
use super::timed_segments::{TimedSegment, is_conflict};
use crate::sort;

/// Number of cells along one side of the grid.
const CELLS_PER_SIDE: usize = 32;
/// Least side of a cell, metres. It is far below the separation, so smaller cells would rule out
/// hardly more segments.
const MIN_CELL_M: f32 = 0.5;

/// Index of timed segments by the horizontal cell of their midpoint.
#[derive(Clone, Debug)]
pub(super) struct SegmentGrid {
    /// South-western corner of the grid, metres east and north in the mission frame.
    min: [f32; 2],
    /// Side of a cell, metres.
    cell_m: f32,
    /// Half of the length of the longest segment, metres.
    max_half_length_m: f32,
    /// Index of the first segment of each cell, row by row from the south; the last entry is the
    /// number of segments.
    cell_starts: [u16; CELLS_PER_SIDE * CELLS_PER_SIDE + 1],
}

impl SegmentGrid {
    pub(super) const fn new() -> Self {
        // All zero; `sort_into_cells` sets all fields before the first search.
        Self {
            min: [0.0; 2],
            cell_m: 0.0,
            max_half_length_m: 0.0,
            cell_starts: [0; CELLS_PER_SIDE * CELLS_PER_SIDE + 1],
        }
    }

    /// Sorts `segments`, at most `u16::MAX` of them, by their cells, and indexes them.
    pub(super) fn sort_into_cells(&mut self, segments: &mut [TimedSegment]) {
        let (mut min, mut max) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        self.max_half_length_m = 0.0;
        for segment in &*segments {
            let middle = middle(segment);
            for a in 0..2 {
                (min[a], max[a]) = (fminf(min[a], middle[a]), fmaxf(max[a], middle[a]));
            }
            self.max_half_length_m = fmaxf(self.max_half_length_m, half_length(segment));
        }
        let extent_m = fmaxf(max[0] - min[0], max[1] - min[1]);
        (self.min, self.cell_m) = (min, fmaxf(extent_m / CELLS_PER_SIDE as f32, MIN_CELL_M));
        let cell = |segment: &TimedSegment| {
            let [x, y] = middle(segment);
            self.cell_index(1, y) * CELLS_PER_SIDE + self.cell_index(0, x)
        };
        // The order within a cell does not matter, as long as it is the same on all boards.
        sort::heapsort_by(segments, |a, b| cell(a).cmp(&cell(b)));
        self.cell_starts.fill(0);
        for segment in &*segments {
            let [x, y] = middle(segment);
            self.cell_starts[self.cell_index(1, y) * CELLS_PER_SIDE + self.cell_index(0, x) + 1] +=
                1;
        }
        for cell in 0..CELLS_PER_SIDE * CELLS_PER_SIDE {
            self.cell_starts[cell + 1] += self.cell_starts[cell];
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
        let reach_m = apart_m + half_length(own) + self.max_half_length_m;
        let middle = middle(own);
        let [columns, rows] = [0, 1].map(|axis| {
            (
                self.cell_index(axis, middle[axis] - reach_m),
                self.cell_index(axis, middle[axis] + reach_m),
            )
        });
        (rows.0..=rows.1).flat_map(move |row| {
            let from = self.cell_starts[row * CELLS_PER_SIDE + columns.0];
            let to = self.cell_starts[row * CELLS_PER_SIDE + columns.1 + 1];
            &segments[usize::from(from)..usize::from(to)]
        })
    }

    /// The `segments` in conflict with `own`, whatever their times.
    pub(super) fn conflicting_segments<'s>(
        &'s self,
        segments: &'s [TimedSegment],
        cfg: &'s ScheduleConfig,
        own: &'s TimedSegment,
    ) -> impl Iterator<Item = &'s TimedSegment> {
        let apart_m = fmaxf(cfg.separation_m, cfg.parked_separation_m);
        self.candidates_near(segments, own, apart_m).filter(|q| is_conflict(cfg, own, q))
    }
}

/// Midpoint of a segment, metres east and north.
fn middle(segment: &TimedSegment) -> [f32; 2] {
    [(segment.from.x + segment.to.x) * 0.5, (segment.from.y + segment.to.y) * 0.5]
}

/// Half of a segment's length, metres.
fn half_length(segment: &TimedSegment) -> f32 {
    (segment.to - segment.from).length() * 0.5
}

#[cfg(test)]
mod tests;
