//! The surface of a voxel map for drawing: exposed faces merged into rectangles, and the creases
//! between them.
//!
//! Greedy meshing (M. Lysenko, "Meshing in a Minecraft Game", 2012): layer by layer, each exposed
//! face grows along the first axis, then along the second. A crease is a lattice edge where the
//! four cells around it are not flat: one or three of them filled, or two that touch by that edge
//! only. Linear in the number of cells.

use planner_core::Point;
use planner_core::map::voxel::VoxelGrid;
use serde::Serialize;

use super::pack;

/// Most rectangles, and most crease lines, of a page: 12 bytes a rectangle, so 2.4 MB of base64. A
/// map with more rectangles is drawn from cells twice as large, again and again, until it fits; the
/// page says so.
pub const MAX_FACES_OR_CREASES: usize = 150_000;
/// Most drawn cells, which bounds time and memory; a larger map is drawn from larger cells.
const CELL_LIMIT: usize = 1 << 25;

/// Drawn surface of a voxel map.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MapSurface {
    /// Minimum corner, metres.
    #[serde(serialize_with = "pack::point")]
    pub min: Point,
    /// Maximum corner of the map itself, metres; drawn cells may reach beyond it.
    #[serde(serialize_with = "pack::point")]
    pub max: Point,
    /// Edge of a cell of the map, metres.
    pub resolution_m: f32,
    /// Edge of a cell as drawn, metres: the resolution times a power of two.
    #[serde(rename = "drawn_m")]
    pub drawn_cell_m: f32,
    /// Rectangles, six numbers each: `2 · axis + (1 if it faces up the axis)`, position of its
    /// plane along the axis, least `u` and `v`, extent along `u` and `v`; in drawn cells from
    /// `min`, with `u` and `v` the two axes after `axis` in the cycle east, north, up.
    #[serde(serialize_with = "pack::words")]
    pub faces: Vec<u16>,
    /// Crease lines, five numbers each, in drawn cells: axis the line runs along, `u`, `v`, start,
    /// length. Empty if there are more than [`MAX_FACES_OR_CREASES`].
    #[serde(serialize_with = "pack::words")]
    pub creases: Vec<u16>,
}

impl MapSurface {
    /// The surface of the occupied cells of `grid`. Nothing is drawn outside the grid, whatever
    /// [`VoxelGrid::beyond_map`] says, so that an open map looks open.
    pub fn of(grid: &VoxelGrid<'_>) -> Self {
        let shape = grid.shape();
        let mut scale = 1;
        loop {
            let dims = shape.dims.map(|d| d.div_ceil(scale));
            let fits = dims.iter().map(|&d| d as usize + 2).product::<usize>() <= CELL_LIMIT;
            let smallest = dims.iter().all(|&d| d == 1);
            if fits || smallest {
                let cells = DrawnCells::of(grid, scale);
                let faces = cells.faces();
                if faces.len() / 6 <= MAX_FACES_OR_CREASES || smallest {
                    let mut creases = cells.creases();
                    if creases.len() / 5 > MAX_FACES_OR_CREASES {
                        creases = Vec::new();
                    }
                    let drawn_m = shape.resolution_m * scale as f32;
                    let resolution_m = shape.resolution_m;
                    return Self {
                        min: shape.min,
                        max: shape.max(),
                        resolution_m,
                        drawn_cell_m: drawn_m,
                        faces,
                        creases,
                    };
                }
            }
            scale *= 2;
        }
    }
}

/// Occupancy of the drawn cells, one byte each, with one empty layer around the map, so that a
/// cell's neighbours need no range check.
struct DrawnCells {
    /// Numbers of drawn cells along each axis, without the empty layer.
    dims: [usize; 3],
    /// Distance in `filled` from a cell to the next one along each axis.
    stride: [usize; 3],
    /// Whether each cell is drawn, the empty layer included.
    filled: Vec<bool>,
}

impl DrawnCells {
    /// Drawn cells of `scale`³ cells of the grid each, filled if any of these is occupied.
    fn of(grid: &VoxelGrid<'_>, scale: u32) -> Self {
        let dims = grid.shape().dims.map(|d| d.div_ceil(scale) as usize);
        let stride = [1, dims[0] + 2, (dims[0] + 2) * (dims[1] + 2)];
        let mut cells = Self { dims, stride, filled: vec![false; stride[2] * (dims[2] + 2)] };
        let [nx, ny, nz] = grid.shape().dims;
        for k in 0..nz {
            for j in 0..ny {
                let row =
                    ((k / scale) as usize + 1) * stride[2] + ((j / scale) as usize + 1) * stride[1];
                for i in 0..nx {
                    if grid.is_occupied([i, j, k]) {
                        cells.filled[row + (i / scale) as usize + 1] = true;
                    }
                }
            }
        }
        cells
    }

    /// Rectangles in the form of [`MapSurface::faces`].
    fn faces(&self) -> Vec<u16> {
        let mut out = Vec::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let (nu, nv) = (self.dims[u], self.dims[v]);
            let mut mask = vec![0; nu * nv];
            for layer in 0..=self.dims[axis] {
                for b in 0..nv {
                    let row = layer * self.stride[axis] + (b + 1) * self.stride[v];
                    for a in 0..nu {
                        let below = row + (a + 1) * self.stride[u];
                        let (low, high) =
                            (self.filled[below], self.filled[below + self.stride[axis]]);
                        mask[b * nu + a] = if low == high { 0 } else { 1 + u8::from(low) };
                    }
                }
                merge_into_rectangles(&mut mask, nu, |kind, a, b, w, h| {
                    let code = 2 * axis + usize::from(kind == 2);
                    out.extend([code, layer, a, b, w, h].map(|n| n as u16));
                });
            }
        }
        out
    }

    /// Crease lines in the form of [`MapSurface::creases`].
    fn creases(&self) -> Vec<u16> {
        let mut out = Vec::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for b in 0..=self.dims[v] {
                for a in 0..=self.dims[u] {
                    let corner = a * self.stride[u] + b * self.stride[v];
                    let mut start = None;
                    for c in 0..=self.dims[axis] {
                        let here = c < self.dims[axis] && {
                            let at = corner + (c + 1) * self.stride[axis];
                            let (p, q) = (self.filled[at], self.filled[at + self.stride[u]]);
                            let at = at + self.stride[v];
                            let (r, s) = (self.filled[at], self.filled[at + self.stride[u]]);
                            // No crease if the four cells are flat: all alike, or split along u or
                            // along v.
                            !((p == q && r == s) || (p == r && q == s))
                        };
                        match (here, start) {
                            (true, None) => start = Some(c),
                            (false, Some(from)) => {
                                out.extend([axis, a, b, from, c - from].map(|n| n as u16));
                                start = None;
                            }
                            _ => {}
                        }
                    }
                }
            }
        }
        out
    }
}

/// Covers the non-zero cells of `mask` (rows of `nu` cells) with rectangles of one value each,
/// calls `rectangle(value, a, b, width, height)` for each, and sets the cells to 0.
fn merge_into_rectangles(
    mask: &mut [u8],
    nu: usize,
    mut rectangle: impl FnMut(u8, usize, usize, usize, usize),
) {
    let nv = mask.len() / nu;
    for b in 0..nv {
        let mut a = 0;
        while a < nu {
            let kind = mask[b * nu + a];
            if kind == 0 {
                a += 1;
                continue;
            }
            let w = (a..nu).take_while(|&x| mask[b * nu + x] == kind).count();
            let whole = |y: &usize| mask[y * nu + a..y * nu + a + w].iter().all(|&m| m == kind);
            let h = (b..nv).take_while(whole).count();
            for y in b..b + h {
                mask[y * nu + a..y * nu + a + w].fill(0);
            }
            rectangle(kind, a, b, w, h);
            a += w;
        }
    }
}

#[cfg(test)]
mod tests;
