//! Random hills as height maps, and coverage scenarios above them.

use std::fmt::Write as _;
use std::path::Path;

use rand_core::Rng;

use crate::areas;

/// Half the side of a height map, metres.
const HALF_SIDE_M: f64 = 600.0;

/// How far around each start the ground is level, metres: scenarios with a step nearer to a start
/// are refused.
const LEVEL_M: f64 = 3.0;

/// A square height map of random hills and noise, centred on the origin.
pub struct Hills {
    /// Side of a cell, metres.
    cell_m: f64,
    /// Number of cells along a side.
    cells_per_side: usize,
    /// Height of each cell, metres.
    heights_m: Vec<f64>,
}

impl Hills {
    /// Hills of up to 0.7 and hollows of up to 0.3 of `most_m`, metres, on a tilted plane.
    pub fn new(random: &mut impl Rng, most_m: f64) -> Self {
        let cell_m = 2.0 + (18.0 * areas::unit_random(random)).round();
        let side = (2.0 * HALF_SIDE_M / cell_m).ceil() as usize;
        let hills: Vec<[f64; 4]> = (0..random.next_u32() % 12)
            .map(|_| {
                let at = || 2.0 * HALF_SIDE_M;
                let place = [
                    areas::unit_random(random) * at() - HALF_SIDE_M,
                    areas::unit_random(random) * at() - HALF_SIDE_M,
                ];
                let (wide, high) = (
                    20.0 + 200.0 * areas::unit_random(random),
                    most_m * (areas::unit_random(random) - 0.3),
                );
                [place[0], place[1], wide, high]
            })
            .collect();
        let tilt = [0, 1].map(|_| 0.2 * (areas::unit_random(random) - 0.5));
        // No noise, trees here and there, or every cell rough: share of cells and height, metres.
        let (share, rough) = [(0.0, 0.0), (0.02, 15.0), (1.0, 2.0)][random.next_u32() as usize % 3];
        let mut heights_m = Vec::with_capacity(side * side);
        for row in 0..side {
            for column in 0..side {
                let at = [column, row].map(|k| (k as f64 + 0.5) * cell_m - HALF_SIDE_M);
                let hill = |[x, y, wide, high]: &[f64; 4]| {
                    high * (-((at[0] - x).powi(2) + (at[1] - y).powi(2)) / (wide * wide)).exp()
                };
                let noise = if areas::unit_random(random) < share {
                    rough * areas::unit_random(random)
                } else {
                    0.0
                };
                let smooth: f64 = hills.iter().map(hill).sum();
                let height = 300.0 + smooth + tilt[0] * at[0] + tilt[1] * at[1] + noise;
                heights_m.push((height * 100.0).round() / 100.0);
            }
        }
        Self { cell_m, cells_per_side: side, heights_m }
    }

    /// Height at a place (metres east and north of the origin), metres above sea level.
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        let [column, row] = [x, y].map(|at| ((at + HALF_SIDE_M) / self.cell_m) as usize);
        self.heights_m[row * self.cells_per_side + column]
    }

    /// The height map as an ESRI ASCII grid.
    pub fn to_ascii_grid(&self) -> String {
        let mut text = format!(
            "ncols {0}\nnrows {0}\nxllcorner {1}\nyllcorner {1}\ncellsize {2}\n",
            self.cells_per_side, -HALF_SIDE_M, self.cell_m
        );
        for row in self.heights_m.chunks_exact(self.cells_per_side).rev() {
            for height in row {
                let _ = write!(text, "{height} ");
            }
            text.push('\n');
        }
        text
    }

    /// Writes these hills, levelled around the starts of the scenario `text`, to `path`. Returns
    /// the scenario with that file as its terrain and its vehicles' starts on that ground.
    pub fn put_under_scenario(&self, text: &str, path: &Path, tolerance_m: f64) -> String {
        let starts: Vec<[f64; 2]> = text.lines().filter_map(start_of_line).collect();
        let levelled = self.levelled_around(&starts);
        std::fs::write(path, levelled.to_ascii_grid()).expect("there is room");
        let terrain = format!(
            "terrain = \"{}\"\nterrain_tolerance_m = {tolerance_m:.1}\ncamera = ",
            path.display()
        );
        let origin_m = levelled.height_at(0.0, 0.0);
        let stand = |line: &str| match start_of_line(line) {
            Some([x, y]) => {
                let up_m = levelled.height_at(x, y) - origin_m;
                format!("start = [{x}, {y}, {up_m:.2}]\n")
            }
            None => format!("{line}\n"),
        };
        text.replace("camera = ", &terrain).lines().map(stand).collect()
    }

    /// These hills with level ground within [`LEVEL_M`] of each place. Places so near to each other
    /// that they share cells have one height.
    fn levelled_around(&self, places: &[[f64; 2]]) -> Self {
        let mut heights_m = self.heights_m.clone();
        let share_m = 2.0 * (LEVEL_M + self.cell_m);
        let mut levels: Vec<([f64; 2], f64)> = Vec::new();
        for &[x, y] in places {
            let near = |([at_x, at_y], _): &&([f64; 2], f64)| (at_x - x).hypot(at_y - y) < share_m;
            let level_m = levels.iter().find(near).map_or(self.height_at(x, y), |level| level.1);
            levels.push(([x, y], level_m));
            let range = |at: f64| {
                let cell = |at: f64| ((at + HALF_SIDE_M) / self.cell_m) as usize;
                cell(at - LEVEL_M)..=cell(at + LEVEL_M)
            };
            for (row, column) in range(y).flat_map(|row| range(x).map(move |column| (row, column)))
            {
                heights_m[row * self.cells_per_side + column] = level_m;
            }
        }
        Self { heights_m, ..*self }
    }
}

/// The place, metres, if `line` is a vehicle's start.
fn start_of_line(line: &str) -> Option<[f64; 2]> {
    let numbers = line.strip_prefix("start = [")?.trim_end_matches(']').split(", ");
    let place: Vec<f64> = numbers.map(|number| number.parse().expect("a number")).collect();
    Some([place[0], place[1]])
}
