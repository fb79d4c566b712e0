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
use planner_core::voxel::{GridShape, Outside, VoxelGrid};
use rayon::prelude::*;

/// For every cell of a map: a lower bound of the distance from any point in it to the nearest
/// obstacle.
#[derive(Clone, Debug)]
pub struct ClearanceField {
    shape: GridShape,
    outside: Outside,
    /// Squared distances, cells²; in memory z varies fastest, then x, then y.
    squared: Vec<u16>,
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
        let mut squared = vec![0; nx * ny * nz];
        squared.par_chunks_mut(nx * nz).enumerate().for_each(|(j, sheet)| {
            let mut scratch = LineTransform::new(nz);
            for (i, column) in sheet.chunks_mut(nz).enumerate() {
                scratch.line.copy_from(layers.iter().skip(j * nx + i).step_by(nx * ny).copied());
                scratch.transform();
                column.copy_from_slice(&scratch.out);
            }
        });
        Self { shape, outside: grid.outside(), squared }
    }

    /// Lower bound of the distance from `point` to the nearest obstacle, metres; 0 for NaN.
    pub fn lower_bound_m(&self, point: &Point) -> f32 {
        let (min, max) = (self.shape.min, self.shape.max());
        let Some([i, j, k]) = self.shape.cell_of(point) else {
            let away = (min - point).sup(&(point - max)).sup(&Point::zeros());
            return if self.outside == Outside::Free { away.norm() } else { 0.0 };
        };
        let [nx, _, nz] = self.shape.dims;
        let at = (j as usize * nx as usize + i as usize) * nz as usize + k as usize;
        let inner = f32::from(self.squared[at]).sqrt() * self.shape.resolution_m;
        match self.outside {
            Outside::Free => inner,
            Outside::Blocked => inner.min((point - min).inf(&(max - point)).min()).max(0.0),
        }
    }
}

/// Buffers for the transform along one line of cells.
struct LineTransform {
    line: Vec<u16>,
    out: Vec<u16>,
    /// Parabolas of the lower envelope, from left to right.
    envelope: Vec<Parabola>,
}

/// The squared distance from a site plus the site's own value, as a parabola over x:
/// `height + (x − site)²`. A side has at most 2¹⁵ cells, so squares fit into i32.
#[derive(Clone, Copy, Debug)]
struct Parabola {
    site: i32,
    /// Value of the parabola at x = 0.
    at_zero: i32,
    /// First x at which this parabola is the lowest of the envelope.
    from: i32,
}

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
                if cross > last.from {
                    from = cross;
                    break;
                }
                self.envelope.pop();
            }
            if from < n as i32 {
                self.envelope.push(Parabola { site, at_zero, from });
            }
        }
        self.out.clear();
        self.out.resize(n, u16::MAX);
        for (i, parabola) in self.envelope.iter().enumerate() {
            let to = self.envelope.get(i + 1).map_or(n as i32, |next| next.from);
            for x in parabola.from..to {
                let value = parabola.at_zero + x * (x - 2 * parabola.site);
                self.out[x as usize] = value.min(i32::from(u16::MAX)) as u16;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::occupancy::{OccupancyMap, Unknown};
    use crate::map::octree::Occupancy;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        /// Every cell against every obstacle, by the definition.
        #[test]
        fn equals_the_definition(
            seed in any::<u64>(),
            dims in [1u32..13, 1u32..13, 1u32..13],
            rarity in 2u64..200,
        ) {
            let shape = GridShape { dims, min: Point::new(-1.0, 2.0, 0.5), resolution_m: 0.5 };
            let mut map = OccupancyMap::all_unknown(shape, "random").unwrap();
            let all: Vec<[u32; 3]> = (0..dims[0])
                .flat_map(|i| (0..dims[1]).flat_map(move |j| (0..dims[2]).map(move |k| [i, j, k])))
                .collect();
            let mut state = seed | 1;
            let mut obstacles = Vec::new();
            for &cell in &all {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                if (state >> 33) % rarity == 0 {
                    map.set(cell, Occupancy::Occupied);
                    obstacles.push(cell);
                }
            }
            let voxels = map.voxel_map(Unknown::Free);
            let field = ClearanceField::new(&voxels.grid());
            for &cell in &all {
                let apart = |o: &[u32; 3]| {
                    (0..3).map(|a| o[a].abs_diff(cell[a]).saturating_sub(1).pow(2)).sum::<u32>()
                };
                let want = obstacles.iter().map(apart).min().map_or(65535, |d| d.min(65535));
                let got = field.lower_bound_m(&shape.center(cell));
                prop_assert_eq!(got, (want as f32).sqrt() * 0.5);
            }
        }
    }

    #[test]
    fn beyond_the_faces() {
        let shape = GridShape { dims: [8, 8, 8], min: Point::zeros(), resolution_m: 1.0 };
        let map = {
            let mut map = OccupancyMap::all_unknown(shape, "cube").unwrap();
            for cell in 0..512 {
                map.set([cell % 8, cell / 8 % 8, cell / 64], Occupancy::Free);
            }
            map
        };
        let blocked = ClearanceField::new(&map.voxel_map(Unknown::Blocked).grid());
        assert_eq!(blocked.lower_bound_m(&Point::new(4.0, 1.5, 4.0)), 1.5);
        assert_eq!(blocked.lower_bound_m(&Point::new(-1.0, 4.0, 4.0)), 0.0);
        assert_eq!(blocked.lower_bound_m(&Point::new(f32::NAN, 4.0, 4.0)), 0.0);
        let free = ClearanceField::new(&map.voxel_map(Unknown::Free).grid());
        assert_eq!(free.lower_bound_m(&Point::new(-3.0, 4.0, 12.0)), 5.0);
    }
}
