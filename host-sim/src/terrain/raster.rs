//! Heights of a file in its own coordinates, resampled to a grid in the mission frame.
//!
//! A cell of the grid has the height of the file's cell at its centre, or that of a higher cell of
//! the file whose centre lies in it. So no height is lost where the grids are rotated against each
//! other, and the greatest height in a box that is enlarged by one cell each way is never less than
//! in the file.

use planner_core::coverage::Flat;
use planner_core::geo::frames::Geodetic;

use super::crs::Crs;
use super::error::TerrainError;
use super::frame::{TerrainFrame, widened_window};
use super::grid::HeightGrid;

/// Heights as a file has them, in its own coordinates.
#[derive(Debug)]
pub(super) struct Raster {
    /// Coordinate system of the file.
    pub crs: Crs,
    /// Number of columns, from west to east.
    pub columns: usize,
    /// Number of rows, from north to south.
    pub rows: usize,
    /// Outer corner of the first cell, the north-western one, in the file's coordinates.
    pub north_west_corner: [f64; 2],
    /// Sides of a cell in the file's units, both positive.
    pub cell_sides: [f64; 2],
    /// Height of each cell, metres, row by row from the north; NaN: no height.
    pub heights_m: Vec<f32>,
}

impl Raster {
    /// The file's coordinates of a point given in cells east and south of the north-western corner.
    fn file_coordinates(&self, column: f64, row: f64) -> [f64; 2] {
        [
            self.north_west_corner[0] + column * self.cell_sides[0],
            self.north_west_corner[1] - row * self.cell_sides[1],
        ]
    }

    /// The inverse of [`Self::file_coordinates`].
    fn cell_coordinates(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            (x - self.north_west_corner[0]) / self.cell_sides[0],
            (self.north_west_corner[1] - y) / self.cell_sides[1],
        ]
    }

    /// Resamples the heights to a grid in the mission frame, whose cells are about as large as the
    /// file's.
    pub(super) fn resampled(&self, frame: &TerrainFrame<'_>) -> Result<HeightGrid, TerrainError> {
        self.crs.check_usable(frame.without_crs)?;
        let origin = frame.origin;
        let window = match frame.window {
            Some(window) => window,
            None => self
                .bounds(origin)
                .ok_or_else(|| TerrainError::unusable_crs("a system that ends before it"))?,
        };
        let nothing =
            |window: [Flat; 2]| HeightGrid::new(window, (window[1] - window[0]).amax().max(1.0));
        let Some(touched) = self.touched_cells(origin, window) else { return nothing(window) };
        let middle = touched.map(|(from, to)| (from + to) as f64 / 2.0);
        let cell_m = self
            .cell_m(origin, middle)
            .ok_or_else(|| TerrainError::unusable_crs("a system that ends before it"))?;
        let window = match frame.window {
            Some(window) => self.align_box(origin, widened_window(window, cell_m), cell_m),
            None => window,
        };
        let Some([columns, rows]) = self.touched_cells(origin, window) else {
            return nothing(window);
        };
        let mut grid = HeightGrid::new(window, cell_m)?;
        let [across, up] = grid.size();
        for row in 0..up {
            for column in 0..across {
                let place = grid.cell_centre([column, row]);
                if let Some(height_m) = self.height_at(origin, &place) {
                    grid.raise_cell(&place, height_m);
                }
            }
        }
        grid.save_centre_heights();
        for row in rows.0..rows.1 {
            for column in columns.0..columns.1 {
                let height_m = self.heights_m[row * self.columns + column];
                let place = self.file_coordinates(column as f64 + 0.5, row as f64 + 0.5);
                if let Some(place) =
                    self.crs.to_mission_frame(origin, place).filter(|_| !height_m.is_nan())
                {
                    grid.raise_cell(&place, height_m);
                }
            }
        }
        Ok(grid)
    }

    /// The height of the file's cell at a place; `None` if that cell has none, and outside the
    /// file.
    pub(super) fn height_at(&self, origin: &Geodetic, place: &Flat) -> Option<f32> {
        let [column, row] = self.cell_coordinates(self.crs.mission_frame_to_crs(origin, place)?);
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.columns as f64 && row < self.rows as f64;
        let height_m =
            inside.then(|| self.heights_m[row as usize * self.columns + column as usize])?;
        (!height_m.is_nan()).then_some(height_m)
    }

    /// Moves the box's least corner to a corner of the file's cells, so that the cells of file and
    /// grid are the same where both have parallel sides.
    fn align_box(&self, origin: &Geodetic, [low, high]: [Flat; 2], cell_m: f32) -> [Flat; 2] {
        let corner =
            self.crs.to_mission_frame(origin, self.file_coordinates(0.0, self.rows as f64));
        let Some(corner) = corner.filter(|corner| corner.amax() < 1e6) else { return [low, high] };
        let down = |axis: usize| {
            let cells =
                ((f64::from(low[axis]) - f64::from(corner[axis])) / f64::from(cell_m)).floor();
            (f64::from(corner[axis]) + cells * f64::from(cell_m)) as f32
        };
        [Flat::new(down(0), down(1)), high]
    }

    /// The box in the mission frame around all cells of the file.
    fn bounds(&self, origin: &Geodetic) -> Option<[Flat; 2]> {
        let (columns, rows) = (self.columns as f64, self.rows as f64);
        let shares = || (0..=8).map(|k| f64::from(k) / 8.0);
        let border = shares().flat_map(|s| shares().map(move |t| (s, t)));
        let places = border.filter_map(|(s, t)| {
            self.crs.to_mission_frame(origin, self.file_coordinates(s * columns, t * rows))
        });
        places.map(|place| [place, place]).reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])])
    }

    /// Ranges of the file's columns and rows that a box in the mission frame may touch; `None` if
    /// none.
    fn touched_cells(
        &self,
        origin: &Geodetic,
        [low, high]: [Flat; 2],
    ) -> Option<[(usize, usize); 2]> {
        let shares = || (0..=8).map(|k| k as f32 / 8.0);
        let places = shares().flat_map(|s| {
            shares().map(move |t| low + (high - low).component_mul(&Flat::new(s, t)))
        });
        let cells = places.filter_map(|place| {
            Some(self.cell_coordinates(self.crs.mission_frame_to_crs(origin, &place)?))
        });
        let [from, to] = cells.map(|cell| [cell, cell]).reduce(|a, b| {
            let pick =
                |f: fn(f64, f64) -> f64, i: usize| [f(a[i][0], b[i][0]), f(a[i][1], b[i][1])];
            [pick(f64::min, 0), pick(f64::max, 1)]
        })?;
        let range = |axis: usize, most: usize| {
            // A straight border in the mission frame is slightly curved in the file's: some cells
            // more.
            let beyond = 2.0 + 0.01 * (to[axis] - from[axis]);
            let first = (from[axis] - beyond).floor().clamp(0.0, most as f64) as usize;
            let end = (to[axis] + beyond).ceil().clamp(0.0, most as f64) as usize;
            (first < end).then_some((first, end))
        };
        Some([range(0, self.columns)?, range(1, self.rows)?])
    }

    /// The shorter side, in metres, of a cell of the file at this column and row.
    fn cell_m(&self, origin: &Geodetic, [column, row]: [f64; 2]) -> Option<f32> {
        let at = |column: f64, row: f64| {
            self.crs.to_mission_frame(origin, self.file_coordinates(column, row))
        };
        let here = at(column, row)?;
        let sides =
            [(at(column + 1.0, row)? - here).norm(), (at(column, row + 1.0)? - here).norm()];
        Some(sides[0].min(sides[1]))
    }
}
