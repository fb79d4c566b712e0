//! Lower bounds of the clearance at points, from an exact Euclidean distance transform between
//! cells.
//!
//! Points in two cells whose indices differ by `d` are at least `√Σ max(|dᵢ| − 1, 0)²` cells apart.
//! Since `max(|d| − 1, 0)² = min over e of (d − e)²` for e in −1, 0, 1, that is the ordinary
//! squared distance to the obstacles grown by one cell along every axis, which separates by axis
//! (Felzenszwalb & Huttenlocher 2012). Squares are stored in 16 bits, so distances saturate at 255
//! cells. At every step the simulator reads this bound first, and computes the exact distance only
//! where the bound is small. Cost: O(cells) once, two bytes a cell; one load a query.

use planner_core::Point;
use planner_core::map::voxel::{GridShape, Outside, VoxelGrid};
use rayon::prelude::*;

/// For every cell of a map: a lower bound of the distance from any point in it to the nearest
/// obstacle.
#[derive(Clone, Debug)]
pub struct ClearanceField {
    /// Place and size of the map.
    shape: GridShape,
    /// Whether space beyond the map counts as an obstacle.
    beyond_map: Outside,
    /// Squared distances, cells²; in memory z varies fastest, then x, then y.
    squared_distances: Vec<u16>,
}

impl ClearanceField {
    /// Computes the field of a map.
    pub fn new(grid: &VoxelGrid<'_>) -> Self {
        let shape = *grid.shape();
        let [nx, ny, nz] = shape.dims.map(|d| d as usize);
        // Transform along x and y within each layer, layers in parallel.
        let mut layers = vec![u16::MAX; nx * ny * nz];
        layers.par_chunks_mut(nx * ny).enumerate().for_each(|(k, layer)| {
            for j in 0..ny {
                for i in 0..nx {
                    if grid.is_occupied([i as u32, j as u32, k as u32]) {
                        layer[j * nx + i] = 0;
                    }
                }
            }
            let mut scratch = LineTransform::new(nx.max(ny));
            for row in layer.chunks_mut(nx) {
                scratch.line.copy_from(row.iter().copied());
                scratch.transform();
                row.copy_from_slice(&scratch.out);
            }
            for i in 0..nx {
                scratch.line.copy_from(layer.iter().skip(i).step_by(nx).copied());
                scratch.transform();
                for (cell, &value) in layer.iter_mut().skip(i).step_by(nx).zip(&scratch.out) {
                    *cell = value;
                }
            }
        });
        // Transform along z; the memory order changes so that each column is contiguous.
        let mut squared_distances = vec![0; nx * ny * nz];
        squared_distances.par_chunks_mut(nx * nz).enumerate().for_each(|(j, sheet)| {
            let mut scratch = LineTransform::new(nz);
            for (i, column) in sheet.chunks_mut(nz).enumerate() {
                scratch.line.copy_from(layers.iter().skip(j * nx + i).step_by(nx * ny).copied());
                scratch.transform();
                column.copy_from_slice(&scratch.out);
            }
        });
        Self { shape, beyond_map: grid.beyond_map(), squared_distances }
    }

    /// Lower bound of the distance from `point` to the nearest obstacle, metres; 0 for NaN.
    pub fn lower_bound_m(&self, point: &Point) -> f32 {
        let (min, max) = (self.shape.min, self.shape.max());
        let Some([i, j, k]) = self.shape.cell_of(point) else {
            let away = (min - point).sup(&(point - max)).sup(&Point::zeros());
            return if self.beyond_map == Outside::Free { away.norm() } else { 0.0 };
        };
        let [nx, _, nz] = self.shape.dims;
        let at = (j as usize * nx as usize + i as usize) * nz as usize + k as usize;
        let inner = f32::from(self.squared_distances[at]).sqrt() * self.shape.resolution_m;
        match self.beyond_map {
            Outside::Free => inner,
            Outside::Blocked => inner.min((point - min).inf(&(max - point)).min()).max(0.0),
        }
    }
}

/// Buffers for the transform along one line of cells.
struct LineTransform {
    /// Values of the cells before the transform.
    line: Vec<u16>,
    /// Values of the cells after the transform.
    out: Vec<u16>,
    /// Parabolas of the lower envelope, from left to right.
    envelope: Vec<Parabola>,
}

/// The squared distance from a site plus the site's own value, as a parabola over x:
/// `height + (x − site)²`. A side has at most 2¹⁵ cells, so squares fit into i32.
#[derive(Clone, Copy, Debug)]
struct Parabola {
    /// The x at which the parabola is lowest.
    site: i32,
    /// Value of the parabola at x = 0.
    at_zero: i32,
    /// First x at which this parabola is the lowest of the envelope.
    lowest_from: i32,
}

/// Replaces a vector's content in the memory that it has.
trait CopyFrom {
    fn copy_from(&mut self, values: impl Iterator<Item = u16>);
}

impl CopyFrom for Vec<u16> {
    fn copy_from(&mut self, values: impl Iterator<Item = u16>) {
        self.clear();
        self.extend(values);
    }
}

impl LineTransform {
    fn new(length: usize) -> Self {
        let line = Vec::with_capacity(length);
        Self { out: line.clone(), line, envelope: Vec::with_capacity(length) }
    }

    /// Sets `out[x] = min over q of line[q] + max(|x − q| − 1, 0)²`, saturated at the largest u16.
    /// Cost: O(length).
    fn transform(&mut self) {
        let n = self.line.len();
        self.envelope.clear();
        for q in 0..n {
            // Grows obstacles by one cell: the least value of the cell and its two neighbours.
            let near = &self.line[q.saturating_sub(1)..n.min(q + 2)];
            let height = near.iter().fold(u16::MAX, |a, &b| a.min(b));
            if height == u16::MAX {
                continue;
            }
            let site = q as i32;
            let at_zero = i32::from(height) + site * site;
            let mut from = 0;
            while let Some(last) = self.envelope.last() {
                // The first integer x where the new parabola is no higher than the last one of the
                // envelope.
                let width = 2 * (site - last.site);
                let cross = (at_zero - last.at_zero + width - 1).div_euclid(width);
                if cross > last.lowest_from {
                    from = cross;
                    break;
                }
                self.envelope.pop();
            }
            if from < n as i32 {
                self.envelope.push(Parabola { site, at_zero, lowest_from: from });
            }
        }
        self.out.clear();
        self.out.resize(n, u16::MAX);
        for (i, parabola) in self.envelope.iter().enumerate() {
            let to = self.envelope.get(i + 1).map_or(n as i32, |next| next.lowest_from);
            for x in parabola.lowest_from..to {
                let value = parabola.at_zero + x * (x - 2 * parabola.site);
                self.out[x as usize] = value.min(i32::from(u16::MAX)) as u16;
            }
        }
    }
}

#[cfg(test)]
mod tests;
