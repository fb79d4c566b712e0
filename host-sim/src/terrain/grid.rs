//! Heights of the ground in the mission frame: cells of a grid, each with one height or none.

use planner_core::coverage::Flat;

use super::error::TerrainError;
use super::limits::MAX_CELLS;

/// Heights of the ground in the mission frame. Cell (0, 0) is the south-western one.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightGrid {
    /// South-western corner of the grid, metres east and north.
    low: Flat,
    /// Side of a cell, metres.
    cell_m: f32,
    /// Numbers of columns and of rows.
    size: [usize; 2],
    /// Height of each cell, metres, row by row from the south; NaN: no height.
    heights_m: Vec<f32>,
    /// The file's own height at the centre of each cell, in the same order; empty if the same as
    /// `heights_m`.
    centre_heights_m: Vec<f32>,
}

/// Greatest height in the cells of a box, and whether any cell has none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoxHeights {
    /// The greatest height, metres; `None` if no cell has a height.
    pub highest_m: Option<f32>,
    /// Whether a cell has no height, or the box reaches out of the grid.
    pub has_holes: bool,
}

impl HeightGrid {
    /// A grid over the box from `low` to `high`, without any height.
    ///
    /// # Errors
    /// The grid would have more than [`MAX_CELLS`] cells, or box or cells have no valid size.
    pub fn new([low, high]: [Flat; 2], cell_m: f32) -> Result<Self, TerrainError> {
        let sides = high - low;
        let sound = cell_m > 0.0 && cell_m.is_finite() && sides.x >= 0.0 && sides.y >= 0.0;
        if !sound || !sides.x.is_finite() || !sides.y.is_finite() {
            return Err(TerrainError::malformed("a height map", &"its cells have no size"));
        }
        let count = |side: f32| (f64::from(side) / f64::from(cell_m)).ceil().max(1.0);
        let (columns, rows) = (count(sides.x), count(sides.y));
        if columns * rows > MAX_CELLS as f64 {
            return Err(TerrainError::TooManyCells((columns * rows) as u128));
        }
        let size = [columns as usize, rows as usize];
        Ok(Self {
            low,
            cell_m,
            size,
            heights_m: vec![f32::NAN; size[0] * size[1]],
            centre_heights_m: Vec::new(),
        })
    }

    /// Side of a cell, metres.
    pub fn cell_m(&self) -> f32 {
        self.cell_m
    }

    /// Number of cells to the east and to the north.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Least and greatest corner of the grid, metres.
    pub fn bounds(&self) -> [Flat; 2] {
        let sides = Flat::new(self.size[0] as f32, self.size[1] as f32) * self.cell_m;
        [self.low, self.low + sides]
    }

    /// The middle of a cell.
    pub fn cell_centre(&self, [column, row]: [usize; 2]) -> Flat {
        self.low + Flat::new(column as f32 + 0.5, row as f32 + 0.5) * self.cell_m
    }

    /// Height of the cell, metres; `None` if it has none or is outside the grid.
    pub fn cell_height(&self, [column, row]: [usize; 2]) -> Option<f32> {
        let height_m = *self.heights_m.get(row * self.size[0] + column)?;
        (column < self.size[0] && !height_m.is_nan()).then_some(height_m)
    }

    /// Number of cells with a height.
    pub fn known_cell_count(&self) -> usize {
        self.heights_m.iter().filter(|height_m| !height_m.is_nan()).count()
    }

    /// The lowest and the highest height, metres; `None` if no cell has a height.
    pub fn height_range_m(&self) -> Option<[f32; 2]> {
        let known = || self.heights_m.iter().copied().filter(|height_m| !height_m.is_nan());
        Some([known().reduce(f32::min)?, known().reduce(f32::max)?])
    }

    /// The height at a place, metres: the file's height at the centre of the cell that holds the
    /// place. `None` where there is no height, and outside the grid.
    pub fn height_at(&self, place: &Flat) -> Option<f32> {
        let [column, row] = self.cell_of(place)?;
        match self.centre_heights_m.get(row * self.size[0] + column) {
            Some(height_m) => (!height_m.is_nan()).then_some(*height_m),
            None => self.cell_height([column, row]),
        }
    }

    /// Lowest and highest height ([`Self::height_at`]) within `radius_m` of a place, metres; `None`
    /// if there is none.
    pub fn height_range_around_m(&self, place: &Flat, radius_m: f32) -> Option<[f32; 2]> {
        let index = |at_m: f32, axis: usize| {
            let most = self.size[axis] as f32 - 1.0;
            ((at_m - self.low[axis]) / self.cell_m).floor().clamp(0.0, most) as usize
        };
        let range =
            |axis: usize| index(place[axis] - radius_m, axis)..=index(place[axis] + radius_m, axis);
        let cells = range(1).flat_map(|row| range(0).map(move |column| [column, row]));
        let near = cells.map(|cell| self.cell_centre(cell)).filter(|centre| {
            let half = Flat::repeat(self.cell_m / 2.0);
            (place.sup(&(centre - half)).inf(&(centre + half)) - place).norm() <= radius_m
        });
        let heights = near.filter_map(|centre| self.height_at(&centre));
        heights
            .map(|height_m| [height_m; 2])
            .reduce(|[low, high], [other, _]| [low.min(other), high.max(other)])
    }

    /// Keeps the heights so far as those at the cells' centres; cells may then be raised above
    /// them.
    pub(super) fn save_centre_heights(&mut self) {
        self.centre_heights_m.clone_from(&self.heights_m);
    }

    /// Greatest height in the cells that a box touches, and whether any of these has none.
    pub fn highest_in_box(&self, low: &Flat, high: &Flat) -> BoxHeights {
        let index = |at: f32, from: f32| ((at - from) / self.cell_m).floor();
        let mut found = BoxHeights::default();
        let mut ranges = [(0, 0); 2];
        for axis in 0..2 {
            let (from, to) = (index(low[axis], self.low[axis]), index(high[axis], self.low[axis]));
            let most = self.size[axis] as f32 - 1.0;
            // A place on the grid's far border counts as in the last cell.
            let over = high[axis] > self.bounds()[1][axis];
            found.has_holes |= from < 0.0 || over || from > most;
            if to < 0.0 || from > most || from > to {
                return BoxHeights { highest_m: None, has_holes: true };
            }
            ranges[axis] = (from.max(0.0) as usize, to.min(most) as usize);
        }
        for row in ranges[1].0..=ranges[1].1 {
            for column in ranges[0].0..=ranges[0].1 {
                match self.cell_height([column, row]) {
                    Some(height_m) => {
                        let highest_m =
                            found.highest_m.map_or(height_m, |other| other.max(height_m));
                        found.highest_m = Some(highest_m);
                    }
                    None => found.has_holes = true,
                }
            }
        }
        found
    }

    /// The grid with its heights measured from a new zero, which is `zero_m` metres above the old
    /// one.
    pub fn relative_to(mut self, zero_m: f64) -> Self {
        for height_m in self.heights_m.iter_mut().chain(&mut self.centre_heights_m) {
            *height_m = (f64::from(*height_m) - zero_m) as f32;
        }
        self
    }

    /// Column and row of the cell that contains a place; `None` outside the grid.
    fn cell_of(&self, place: &Flat) -> Option<[usize; 2]> {
        let cell = (place - self.low) / self.cell_m;
        let inside = (0..2).all(|axis| cell[axis] >= 0.0 && cell[axis] < self.size[axis] as f32);
        inside.then(|| [cell.x as usize, cell.y as usize])
    }

    /// Raises the cell of a place to at least a height; `false` if the place is outside the grid.
    pub(super) fn raise_cell(&mut self, place: &Flat, height_m: f32) -> bool {
        let Some([column, row]) = self.cell_of(place) else { return false };
        let own = &mut self.heights_m[row * self.size[0] + column];
        // `max` with NaN gives the other number, so a cell without height takes any.
        *own = own.max(height_m);
        true
    }

    /// Fills each cell without height that has cells with heights on both sides in its row or
    /// column, at most `reach` cells away, with the greatest height in the square of that reach.
    pub(super) fn fill_holes(&mut self, reach: usize) {
        let before = self.clone();
        let [columns, rows] = self.size;
        for row in 0..rows {
            for column in 0..columns {
                if before.cell_height([column, row]).is_some() {
                    continue;
                }
                let known = |range: std::ops::RangeInclusive<usize>, fixed: usize, across: bool| {
                    range.into_iter().any(|k| {
                        before.cell_height(if across { [k, fixed] } else { [fixed, k] }).is_some()
                    })
                };
                let (left, right) =
                    (column.saturating_sub(reach), (column + reach).min(columns - 1));
                let (down, up) = (row.saturating_sub(reach), (row + reach).min(rows - 1));
                let across = known(left..=column, row, true) && known(column..=right, row, true);
                let along = known(down..=row, column, false) && known(row..=up, column, false);
                if across || along {
                    let near = (down..=up).flat_map(|r| (left..=right).map(move |c| [c, r]));
                    let highest = near.filter_map(|cell| before.cell_height(cell)).reduce(f32::max);
                    self.heights_m[row * columns + column] = highest.unwrap_or(f32::NAN);
                }
            }
        }
    }
}
