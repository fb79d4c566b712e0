//! Bit-packed voxel map: one bit per cell, stored as bricks of 4 × 4 × 4 cells, one 64-bit word
//! each.
//!
//! One load shows whether a brick holds any obstacle, so a query over empty space advances four
//! cells at a time. The built-in building map at 0.5 m (82 × 48 × 98 cells) takes 50.4 kB. Cell
//! `(i, j, k)` covers the closed cube from `min + (i, j, k) · resolution` to
//! `min + (i + 1, j + 1, k + 1) · resolution`.

use crate::Point;

/// Cells along one edge of a brick.
pub const CELLS_PER_BRICK_EDGE: u32 = 4;

/// Reason why [`VoxelGrid::new`] refused a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridError {
    /// A dimension is zero or above [`MAX_DIM`], or the grid needs more words than 32 bits can
    /// index.
    Dimensions,
    /// The length of the word slice is not [`GridShape::word_count`].
    WordCount,
    /// The minimum corner or the resolution is not finite, or the resolution is not positive.
    NotFinite,
    /// A bit is set for a cell beyond the last one of an axis: a padding bit of a brick at an upper
    /// face.
    Padding,
}

/// Most cells that a grid may have along one axis.
pub const MAX_DIM: u32 = 1 << 15;

/// Dimensions, position and resolution of a voxel grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridShape {
    /// Number of cells along east, north and up.
    pub dims: [u32; 3],
    /// Minimum corner of cell (0, 0, 0) in the mission frame, metres.
    pub min: Point,
    /// Edge length of a cell, metres.
    pub resolution_m: f32,
}

impl GridShape {
    /// Number of bricks along each axis, the last one of which may be partly used.
    #[inline]
    pub fn brick_dims(&self) -> [u32; 3] {
        self.dims.map(|d| d.div_ceil(CELLS_PER_BRICK_EDGE))
    }

    /// Number of bricks in the grid, which is the number of 64-bit words that it needs;
    /// `usize::MAX` on overflow.
    pub fn word_count(&self) -> usize {
        self.brick_dims().iter().fold(1, |count: usize, &b| count.saturating_mul(b as usize))
    }

    /// Maximum corner of the grid in the mission frame, metres.
    pub fn max(&self) -> Point {
        self.min
            + Point::new(self.dims[0] as f32, self.dims[1] as f32, self.dims[2] as f32)
                * self.resolution_m
    }

    /// The cell that contains `p` (a cell includes its lower faces only), or `None` if `p` is
    /// outside the grid or NaN.
    pub fn cell_of(&self, p: &Point) -> Option<[u32; 3]> {
        let mut cell = [0; 3];
        for axis in 0..3 {
            let c = libm::floorf((p[axis] - self.min[axis]) / self.resolution_m);
            if !(c >= 0.0 && c < self.dims[axis] as f32) {
                return None;
            }
            cell[axis] = c as u32;
        }
        Some(cell)
    }

    /// Centre of a cell in the mission frame, metres.
    pub fn center(&self, cell: [u32; 3]) -> Point {
        let half = |c: u32| (c as f32 + 0.5) * self.resolution_m;
        self.min + Point::new(half(cell[0]), half(cell[1]), half(cell[2]))
    }

    /// Word index and bit mask of a cell. For a cell outside the grid the word is that of another
    /// cell, or an index beyond the words.
    #[inline]
    pub fn word_and_mask(&self, [i, j, k]: [u32; 3]) -> (usize, u64) {
        let [bx, by, _] = self.brick_dims();
        let word = (k / 4).wrapping_mul(by).wrapping_add(j / 4).wrapping_mul(bx).wrapping_add(i / 4)
            as usize;
        (word, 1 << ((k % 4) * 16 + (j % 4) * 4 + i % 4))
    }

    /// Whether all padding bits (bits of cells beyond the last of an axis) are clear. A set padding
    /// bit would be an obstacle in a cell that does not exist.
    fn padding_is_clear(&self, words: &[u64]) -> bool {
        /// Masks, for each axis, of a brick's first layer of cells, its first two and its first
        /// three.
        const BRICK_LAYER_MASKS: [[u64; 3]; 3] = [
            [0x1111_1111_1111_1111, 0x3333_3333_3333_3333, 0x7777_7777_7777_7777],
            [0x000f_000f_000f_000f, 0x00ff_00ff_00ff_00ff, 0x0fff_0fff_0fff_0fff],
            [0xffff, 0xffff_ffff, 0xffff_ffff_ffff],
        ];
        let bricks = self.brick_dims();
        (0..3).filter(|&axis| !self.dims[axis].is_multiple_of(CELLS_PER_BRICK_EDGE)).all(|axis| {
            let padding =
                !BRICK_LAYER_MASKS[axis][(self.dims[axis] % CELLS_PER_BRICK_EDGE) as usize - 1];
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            (0..bricks[u]).all(|at_u| {
                (0..bricks[v]).all(|at_v| {
                    let mut cell = [0; 3];
                    (cell[axis], cell[u], cell[v]) = (bricks[axis] - 1, at_u, at_v);
                    let (word, _) =
                        self.word_and_mask(cell.map(|brick| brick * CELLS_PER_BRICK_EDGE));
                    words[word] & padding == 0
                })
            })
        })
    }

    /// Checks dimensions, minimum corner and resolution.
    fn check(&self) -> Result<(), GridError> {
        // Words are indexed by 32 bits, on boards and on desktops.
        let countable = self.word_count() < u32::MAX as usize;
        if self.dims.iter().any(|&d| d == 0 || d > MAX_DIM) || !countable {
            return Err(GridError::Dimensions);
        }
        let finite = self.min.iter().all(|c| c.is_finite()) && self.resolution_m.is_finite();
        if finite && self.resolution_m > 0.0 { Ok(()) } else { Err(GridError::NotFinite) }
    }
}

/// Whether the space beyond the grid's faces counts as obstacle or as free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// Space beyond the grid is an obstacle: clearance is measured to the grid's faces too.
    Blocked,
    /// Space beyond the grid is free, and may be flown through.
    Free,
}

/// A voxel map that borrows its words; a set bit is a cell with an obstacle.
#[derive(Clone, Copy, Debug)]
pub struct VoxelGrid<'a> {
    shape: GridShape,
    /// What the space beyond the map's faces counts as.
    beyond_map: Outside,
    /// The cells' bits, in the order of [`GridShape::word_and_mask`].
    words: &'a [u64],
}

impl<'a> VoxelGrid<'a> {
    /// Checks shape, number of words and padding bits. Reads the bricks at the upper faces only.
    pub fn new(shape: GridShape, beyond_map: Outside, words: &'a [u64]) -> Result<Self, GridError> {
        shape.check()?;
        if words.len() != shape.word_count() {
            return Err(GridError::WordCount);
        }
        if !shape.padding_is_clear(words) {
            return Err(GridError::Padding);
        }
        Ok(Self { shape, beyond_map, words })
    }

    /// Dimensions, position and resolution.
    #[inline]
    pub fn shape(&self) -> &GridShape {
        &self.shape
    }

    /// Whether the space beyond the faces is obstacle or free.
    #[inline]
    pub fn beyond_map(&self) -> Outside {
        self.beyond_map
    }

    /// The words, one per brick: x fastest, then y, then z.
    #[inline]
    pub fn words(&self) -> &'a [u64] {
        self.words
    }

    /// Whether a cell is an obstacle. A cell outside the grid is an obstacle if the grid has
    /// [`Outside::Blocked`].
    #[inline]
    pub fn is_occupied(&self, cell: [u32; 3]) -> bool {
        if (0..3).any(|axis| cell[axis] >= self.shape.dims[axis]) {
            return self.beyond_map == Outside::Blocked;
        }
        let (word, mask) = self.shape.word_and_mask(cell);
        self.words[word] & mask != 0
    }

    /// Whether the cell that contains `p` is an obstacle. A point outside the grid is in an
    /// obstacle if the grid has [`Outside::Blocked`].
    pub fn is_blocked_at(&self, p: &Point) -> bool {
        match self.shape.cell_of(p) {
            Some(cell) => self.is_occupied(cell),
            None => self.beyond_map == Outside::Blocked,
        }
    }
}

#[cfg(test)]
mod tests;
