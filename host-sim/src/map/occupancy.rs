//! Occupancy of all cells of a planning grid.
//!
//! The leaves of an octree are resampled conservatively: a planning cell is occupied if any
//! occupied leaf reaches into it, else unknown if any part of it is unknown, else free. Occupied
//! leaves that reach in by less than [`NEGLIGIBLE_EDGE_SHARE`] of a cell (rounding of the
//! resolution) do not count. With the octree's own resolution, or a multiple of it, planning cells
//! begin at cell boundaries of the octree; with its own resolution every cell keeps its state.

use planner_core::Point;
use planner_core::map::voxel::{GridShape, MAX_DIM, Outside};

use super::error::MapError;
use super::octree::{KEY_ORIGIN, KEYS_PER_AXIS, Occupancy, Octree};
use super::voxel_map::{VoxelMap, brick_masks};

/// Share of a planning cell's edge that is neglected: more than the rounding error of f32 over
/// [`MAX_DIM`] cells.
pub const NEGLIGIBLE_EDGE_SHARE: f64 = 2e-3;
/// Most cells of a planning grid; each takes 4 bytes more while an octree is resampled.
pub const MAX_CELLS: u64 = 1 << 27;

/// Whether paths may pass through unknown space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UnknownSpace {
    /// Unknown space is an obstacle, and so is everything beyond the map.
    #[default]
    Blocked,
    /// Unknown space is passable, but no node is placed in it (paper P3D's
    /// `castRay(…, ignoreUnknown = true)`).
    Free,
}

/// A map with three states per cell, two bits each, in the bricks of [`GridShape::word_and_mask`].
#[derive(Clone, Debug, PartialEq)]
pub struct OccupancyMap {
    /// Place and size of the map.
    shape: GridShape,
    /// Bits of the occupied cells.
    occupied: Vec<u64>,
    /// Bits of the free cells; a cell in neither list is unknown.
    free: Vec<u64>,
}

/// Number of cells of each state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellCounts {
    /// Occupied cells.
    pub occupied: u64,
    /// Cells known to be empty.
    pub free: u64,
    /// Cells that were never seen.
    pub unknown: u64,
}

impl OccupancyMap {
    /// A map in which every cell is unknown. Fails if the grid is too large; `name` names the map
    /// in that error.
    pub fn all_unknown(shape: GridShape, name: &str) -> Result<Self, MapError> {
        let cells = shape.dims.iter().map(|&d| u64::from(d)).product::<u64>();
        if shape.dims.iter().any(|&d| d == 0 || d > MAX_DIM) || cells > MAX_CELLS {
            let [x, y, z] = shape.dims;
            let resolution = shape.resolution_m;
            let why = format!(
                "{x} × {y} × {z} cells of {resolution} m, at most {MAX_CELLS} in all and {MAX_DIM} a side: \
                 choose another resolution_m"
            );
            return Err(MapError::DoesNotFitGrid { file: name.into(), why });
        }
        let words = vec![0; shape.word_count()];
        Ok(Self { shape, occupied: words.clone(), free: words })
    }

    /// Resamples an octree onto a grid with cells of `resolution_m`, conservatively. Cost: all
    /// leaves, and all cells that they cover.
    pub fn from_octree(tree: &Octree, resolution_m: f32, name: &str) -> Result<Self, MapError> {
        let refuse = |why: &str| MapError::DoesNotFitGrid { file: name.into(), why: why.into() };
        if !(resolution_m.is_finite() && resolution_m > 0.0) {
            return Err(refuse("resolution_m must be positive"));
        }
        let (lo, hi) = tree.key_bounds().ok_or_else(|| refuse("it holds no known space"))?;
        // Planning cells per smallest cell of the octree. A ratio that, but for f32 rounding, is a
        // whole number or the reciprocal of one is taken to be exactly that.
        let cells_per_metre = 1.0 / f64::from(resolution_m);
        let exact = tree.resolution_m() * cells_per_metre;
        let (multiple, fraction) = ((1.0 / exact).round(), exact.round());
        let scale = if multiple >= 1.0 && (exact * multiple - 1.0).abs() < 1e-6 {
            1.0 / multiple
        } else if fraction >= 1.0 && (exact / fraction - 1.0).abs() < 1e-6 {
            fraction
        } else {
            exact
        };
        let span = [0, 1, 2]
            .map(|a| (f64::from(hi[a] - lo[a]) * scale - NEGLIGIBLE_EDGE_SHARE).ceil().max(1.0));
        let dims = span.map(|s| s.min(f64::from(u32::MAX)) as u32);
        let corner =
            lo.map(|k| ((f64::from(k) - f64::from(KEY_ORIGIN)) * tree.resolution_m()) as f32);
        let shape = GridShape { dims, min: Point::from(corner), resolution_m };
        let mut map = Self::all_unknown(shape, name)?;
        // Share of each cell's volume that free leaves fill.
        let mut free_share = vec![0f32; dims.iter().map(|&d| d as usize).product()];
        tree.for_each_leaf(|leaf| {
            let from = [0, 1, 2].map(|a| f64::from(leaf.min_key[a] - lo[a]) * scale);
            let to = from.map(|f| f + f64::from(leaf.edge_cells) * scale);
            // An occupied leaf that reaches into a cell by less than a hair is rounding; free
            // volume is summed exactly.
            let hair = if leaf.occupied { NEGLIGIBLE_EDGE_SHARE } else { 0.0 };
            let first = from.map(|f| (f + hair).floor() as u32);
            let last =
                [0, 1, 2].map(|a| ((to[a] - hair).ceil() as u32).max(first[a] + 1).min(dims[a]));
            let overlap = |axis: usize, c: u32| {
                (to[axis].min(f64::from(c) + 1.0) - from[axis].max(f64::from(c))).max(0.0)
            };
            for k in first[2]..last[2] {
                for j in first[1]..last[1] {
                    for i in first[0]..last[0] {
                        if leaf.occupied {
                            map.set([i, j, k], Occupancy::Occupied);
                        } else {
                            let at = (k as usize * dims[1] as usize + j as usize)
                                * dims[0] as usize
                                + i as usize;
                            free_share[at] +=
                                (overlap(0, i) * overlap(1, j) * overlap(2, k)) as f32;
                        }
                    }
                }
            }
        });
        map.mark_free_cells(&free_share);
        Ok(map)
    }

    /// Turns unknown cells that free leaves fill entirely into free cells; `free_share` is in cell
    /// order, x fastest.
    fn mark_free_cells(&mut self, free_share: &[f32]) {
        let dims = self.shape.dims;
        // The tolerance is far above the rounding of the sum; an unknown cube with a twentieth of
        // the cell's edge still keeps the cell unknown.
        let whole = 1.0 - 1e-4;
        let mut at = 0;
        for k in 0..dims[2] {
            for j in 0..dims[1] {
                for i in 0..dims[0] {
                    if free_share[at] >= whole && self.state_at([i, j, k]) == Occupancy::Unknown {
                        self.set([i, j, k], Occupancy::Free);
                    }
                    at += 1;
                }
            }
        }
    }

    /// The cells as a pruned octree. Fails if the grid's corner does not lie on a multiple of the
    /// resolution, as the keys of an octree do, or if the grid reaches beyond ±32768 cells.
    pub fn to_octree(&self, name: &str) -> Result<Octree, MapError> {
        let refuse = |why: String| MapError::DoesNotFitGrid { file: name.into(), why };
        let corner = self.shape.min;
        let (tree, shift) = self.to_shifted_octree();
        if shift
            .iter()
            .any(|s| s.abs() > NEGLIGIBLE_EDGE_SHARE * f64::from(self.shape.resolution_m))
        {
            let why = format!(
                "its corner [{}, {}, {}] does not lie on a multiple of {} m, as OctoMap's cells do",
                corner.x, corner.y, corner.z, self.shape.resolution_m
            );
            return Err(refuse(why));
        }
        tree.ok_or_else(|| refuse("it reaches beyond OctoMap's 65536 cells a side".into()))
    }

    /// The cells as a pruned octree whose keys are rounded to the nearest cell, and the shift from
    /// the octree to the grid, metres east, north, up. The octree is `None` where
    /// [`Octree::from_cells`] returns `None`.
    pub fn to_shifted_octree(&self) -> (Option<Octree>, [f64; 3]) {
        // The shortest decimal that parses to this f32: 0.1, not 0.10000000149.
        let resolution: f64 =
            self.shape.resolution_m.to_string().parse().expect("a float prints as a float");
        let (mut min, mut shift) = ([0; 3], [0.0; 3]);
        for axis in 0..3 {
            let cells = f64::from(self.shape.min[axis]) / resolution;
            let most = f64::from(KEYS_PER_AXIS - self.shape.dims[axis].min(KEYS_PER_AXIS));
            let key = (cells.round() + f64::from(KEY_ORIGIN)).clamp(0.0, most);
            min[axis] = key as u32;
            shift[axis] = (cells - (key - f64::from(KEY_ORIGIN))) * resolution;
        }
        (Octree::from_cells(resolution, min, self.shape.dims, |cell| self.state_at(cell)), shift)
    }

    /// Dimensions, corner and resolution of the grid.
    pub fn shape(&self) -> &GridShape {
        &self.shape
    }

    /// State of a cell. Panics for a cell outside the grid.
    pub fn state_at(&self, cell: [u32; 3]) -> Occupancy {
        let (word, mask) = self.shape.word_and_mask(cell);
        if self.occupied[word] & mask != 0 {
            Occupancy::Occupied
        } else if self.free[word] & mask != 0 {
            Occupancy::Free
        } else {
            Occupancy::Unknown
        }
    }

    /// Sets the state of a cell. Panics for a cell outside the grid.
    pub fn set(&mut self, cell: [u32; 3], state: Occupancy) {
        let (word, mask) = self.shape.word_and_mask(cell);
        self.set_bits(word, mask, state);
    }

    /// Sets the state of the cells in `mask` of brick number `word`.
    fn set_bits(&mut self, word: usize, mask: u64, state: Occupancy) {
        self.occupied[word] &= !mask;
        self.free[word] &= !mask;
        match state {
            Occupancy::Unknown => {}
            Occupancy::Free => self.free[word] |= mask,
            Occupancy::Occupied => self.occupied[word] |= mask,
        }
    }

    /// Sets the state of all cells in `from..to` along each axis. Panics beyond the grid.
    pub fn fill(&mut self, from: [u32; 3], to: [u32; 3], state: Occupancy) {
        let [bx, by, _] = self.shape.brick_dims();
        let [xs, ys, zs] = [0, 1, 2].map(|axis| brick_masks(axis, from[axis], to[axis]));
        for &(k, z) in &zs {
            for &(j, y) in &ys {
                for &(i, x) in &xs {
                    self.set_bits(((k * by + j) * bx + i) as usize, x & y & z, state);
                }
            }
        }
    }

    /// Number of cells of each state.
    pub fn counts(&self) -> CellCounts {
        let ones = |words: &[u64]| words.iter().map(|w| u64::from(w.count_ones())).sum::<u64>();
        let (occupied, free) = (ones(&self.occupied), ones(&self.free));
        let all = self.shape.dims.iter().map(|&d| u64::from(d)).product::<u64>();
        CellCounts { occupied, free, unknown: all - occupied - free }
    }

    /// The bit grids that planner-core plans on; `unknown` says how unknown cells count.
    pub fn to_voxel_map(&self, unknown: UnknownSpace) -> VoxelMap {
        let inside = self.inside_mask();
        let not_free: Vec<u64> =
            self.free.iter().zip(&inside).map(|(free, inside)| !free & inside).collect();
        let occupied = self.occupied.clone();
        let (words, seen, never_sample, beyond_map) = match unknown {
            UnknownSpace::Blocked => (not_free, Some(occupied), None, Outside::Blocked),
            UnknownSpace::Free => (occupied, None, Some(not_free), Outside::Free),
        };
        VoxelMap {
            shape: self.shape,
            obstacle_words: words,
            occupied_words: seen,
            no_node_words: never_sample,
            beyond_map,
        }
    }

    /// For each brick, the bits of its cells inside the grid; bricks at the upper faces may extend
    /// beyond it.
    fn inside_mask(&self) -> Vec<u64> {
        let mut words = Vec::with_capacity(self.free.len());
        let [xs, ys, zs] = [0, 1, 2].map(|axis| brick_masks(axis, 0, self.shape.dims[axis]));
        for (_, z) in &zs {
            for (_, y) in &ys {
                words.extend(xs.iter().map(|(_, x)| x & y & z));
            }
        }
        words
    }
}

#[cfg(test)]
mod tests;
