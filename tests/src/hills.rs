//! Random hills as height maps, and coverage scenarios above them.

use std::fmt::Write as _;
use std::path::Path;

use rand_core::Rng;

use crate::areas;

/// Half the side of a height map, metres.
const HALF_SIDE_M: f64 = 600.0;

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

    /// Writes these hills to `path`. Returns the scenario `text` with that file as its terrain and
    /// its vehicles' starts on that ground.
    pub fn put_under_scenario(&self, text: &str, path: &Path, tolerance_m: f64) -> String {
        std::fs::write(path, self.to_ascii_grid()).expect("there is room");
        let terrain = format!(
            "terrain = \"{}\"\nterrain_tolerance_m = {tolerance_m:.1}\ncamera = ",
            path.display()
        );
        let origin_m = self.height_at(0.0, 0.0);
        let stand = |line: &str| match line.strip_prefix("start = [") {
            Some(numbers) => {
                let numbers = numbers.trim_end_matches(']').split(", ").map(str::parse);
                let place: Vec<f64> = numbers.map(|number| number.expect("a number")).collect();
                let up_m = self.height_at(place[0], place[1]) - origin_m;
                format!("start = [{}, {}, {up_m:.2}]\n", place[0], place[1])
            }
            None => format!("{line}\n"),
        };
        text.replace("camera = ", &terrain).lines().map(stand).collect()
    }
}
