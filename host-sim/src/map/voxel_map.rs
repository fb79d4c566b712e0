//! The bit grids of a map that planner-core queries.

use planner_core::Point;
use planner_core::map::voxel::{GridShape, Outside, VoxelGrid};

/// The bit grids of a map that planner-core plans on.
#[derive(Clone, Debug)]
pub struct VoxelMap {
    /// Dimensions, corner and resolution of the grid.
    pub shape: GridShape,
    /// One bit per cell: set if the cell is an obstacle.
    pub obstacle_words: Vec<u64>,
    /// Bits of the occupied cells alone, if unknown cells are obstacles too; `None` if
    /// `obstacle_words` holds no unknown cells.
    pub occupied_words: Option<Vec<u64>>,
    /// Bits of the cells in which no roadmap node may lie, if these are more than the obstacles.
    /// `None` if not.
    pub no_node_words: Option<Vec<u64>>,
    /// Whether the space beyond the map's faces is an obstacle.
    pub beyond_map: Outside,
}

impl VoxelMap {
    /// The bit grid of obstacles that planner-core queries.
    pub fn grid(&self) -> VoxelGrid<'_> {
        VoxelGrid::new(self.shape, self.beyond_map, &self.obstacle_words)
            .expect("the words were made for the shape")
    }

    /// The bit grid of cells in which no roadmap node may lie; space beyond the map counts as such.
    pub fn no_node_grid(&self) -> VoxelGrid<'_> {
        let words = self.no_node_words.as_deref().unwrap_or(&self.obstacle_words);
        VoxelGrid::new(self.shape, Outside::Blocked, words)
            .expect("the words were made for the shape")
    }

    /// This map, with roadmap nodes allowed only in cells that lie entirely inside the box between
    /// two corners, ENU metres.
    pub fn with_nodes_inside(&self, low: &Point, high: &Point) -> Self {
        let masks = [0, 1, 2].map(|axis| {
            let cells = |at_m: f32| (at_m - self.shape.min[axis]) / self.shape.resolution_m;
            // `as` saturates, and a range that ends before it begins is empty.
            let dim = self.shape.dims[axis];
            let inside = brick_masks(
                axis,
                (cells(low[axis]).ceil() as u32).min(dim),
                (cells(high[axis]).floor() as u32).min(dim),
            );
            let mut masks = vec![0; dim.div_ceil(4) as usize];
            inside.into_iter().for_each(|(brick, mask)| masks[brick as usize] = mask);
            masks
        });
        let all = [0, 1, 2].map(|axis| brick_masks(axis, 0, self.shape.dims[axis]));
        let mut words = self.no_node_grid().words().to_vec();
        let mut word = words.iter_mut();
        for (k, z) in &all[2] {
            for (j, y) in &all[1] {
                for (i, x) in &all[0] {
                    let [i, j, k] = [i, j, k].map(|brick| *brick as usize);
                    let inside = masks[0][i] & masks[1][j] & masks[2][k];
                    *word.next().expect("a word for each brick") |= x & y & z & !inside;
                }
            }
        }
        Self { no_node_words: Some(words), ..self.clone() }
    }

    /// Whether a cell is an obstacle only because it is unknown. Panics for a cell outside the
    /// grid.
    pub fn is_unknown_obstacle(&self, cell: [u32; 3]) -> bool {
        let (word, mask) = self.shape.word_and_mask(cell);
        self.occupied_words
            .as_ref()
            .is_some_and(|seen| self.obstacle_words[word] & !seen[word] & mask != 0)
    }

    /// Height on which a vehicle that sinks vertically from `point` comes to stand, metres: the top
    /// of the first obstacle below it, or `point` itself inside an obstacle. Without an obstacle it
    /// is the map's bottom if the outside is blocked, else `None`. Also `None` for a point beside
    /// or below the map.
    pub fn ground_z_below_m(&self, point: &Point) -> Option<f32> {
        let mut inside = *point;
        inside.z =
            inside.z.clamp(self.shape.min.z, self.shape.max().z - self.shape.resolution_m / 2.0);
        let [i, j, top] = self.shape.cell_of(&inside)?;
        if point.z < self.shape.min.z {
            return None;
        }
        let grid = self.grid();
        let cell = (0..=top).rev().find(|&k| grid.is_occupied([i, j, k]));
        let height = |k: u32| self.shape.min.z + k as f32 * self.shape.resolution_m;
        match cell {
            Some(k) => Some(height(k + 1).min(point.z)),
            None => (self.beyond_map == Outside::Blocked).then_some(self.shape.min.z),
        }
    }
}

/// Bricks along one axis that the cells `from..to` reach into: index, and mask of those cells.
pub(super) fn brick_masks(axis: usize, from: u32, to: u32) -> Vec<(u32, u64)> {
    let lane = |c: u32| match axis {
        0 => 0x1111_1111_1111_1111 << c,
        1 => 0x000f_000f_000f_000f << (4 * c),
        _ => 0xffff << (16 * c),
    };
    (from / 4..to.div_ceil(4))
        .map(|brick| {
            let cells = (0..4).filter(|c| (from..to).contains(&(brick * 4 + c)));
            (brick, cells.fold(0, |bits, c| bits | lane(c)))
        })
        .collect()
}

#[cfg(test)]
mod tests;
