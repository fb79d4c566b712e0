//! The cases: maps of corridors and open halls, and who swaps places with whom.

use std::f32::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use host_sim::map::{Occupancy, OccupancyMap, bt};
use planner_core::Point;
use planner_core::voxel::GridShape;

/// Nominal speed, m/s.
pub const CRUISE_MPS: f32 = 2.0;
const RESOLUTION_M: f32 = 0.25;
/// Height of starts and goals over the floor's top, metres.
const HEIGHT_M: f32 = 1.5;

/// One case.
pub struct Case {
    /// Its name in the table.
    pub name: String,
    map: PathBuf,
    vehicles: Vec<(Point, Point)>,
    nodes: usize,
    safety_distance_m: f32,
    safety_margin_m: f32,
    /// Lines of `[simulation]`.
    simulation: &'static str,
}

impl Case {
    /// The scenario's text.
    pub fn scenario(&self, method: &str, seed: u64) -> String {
        let mut text =
            format!("seed = {seed}\n[map]\nfile = {:?}\nresolution_m = {RESOLUTION_M}\n", self.map);
        let goals: Vec<String> =
            self.vehicles.iter().map(|(_, g)| format!("[{:.3}, {:.3}, {:.3}]", g.x, g.y, g.z)).collect();
        let _ = write!(
            text,
            "[roadmap]\nnodes = {}\nedge_min_m = 0.3\nedge_max_m = 6.0\nsafety_margin_m = {}\n\
             [mission]\nmode = \"labelled\"\ncruise_mps = {CRUISE_MPS}\ngoals = [{}]\n\
             [deconfliction]\nmethod = {method:?}\nsafety_distance_m = {}\n\
             [simulation]\ntime_limit_s = 400.0\n{}\n",
            self.nodes,
            self.safety_margin_m,
            goals.join(", "),
            self.safety_distance_m,
            self.simulation
        );
        for (i, (start, _)) in self.vehicles.iter().enumerate() {
            let _ = write!(
                text,
                "[[vehicles]]\nid = {}\nstart = [{:.3}, {:.3}, {:.3}]\nradius_m = 0.3\ngoal = {i}\n",
                i + 1,
                start.x,
                start.y,
                start.z
            );
        }
        text
    }
}

/// All cases; maps go to `dir`.
pub fn all(dir: &Path) -> Result<Vec<Case>> {
    let gusts = "gust_mps = 3.0";
    let lossy = "gust_mps = 3.0\nradio_loss = 0.3";
    let late = "gust_mps = 3.0\nradio_delay_s = 0.3";
    let corridor = corridor(dir)?;
    let crossing = crossing(dir)?;
    let small_hall = hall(dir, 24.0, "hall.bt")?;
    let field = hall(dir, 66.0, "field.bt")?;
    let z = RESOLUTION_M + HEIGHT_M;
    let ends = [Point::new(1.5, 2.0, z), Point::new(28.5, 2.0, z)];
    let swap = vec![(ends[0], ends[1]), (ends[1], ends[0])];
    let arm = |i: usize, along: f32| {
        // Twice per arm, at two distances from the middle of the crossing at (15, 15).
        let (x, y) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][i % 4];
        Point::new(15.0 + x * along, 15.0 + y * along, z)
    };
    let cross = (0..8)
        .map(|i| {
            let along = if i < 4 { 13.0 } else { 9.5 };
            (arm(i, along), arm(i + 2, along))
        })
        .collect::<Vec<_>>();
    let circle = |count: usize, radius_m: f32, middle_m: f32| {
        let place = move |i: usize| {
            let angle = i as f32 * TAU / count as f32;
            Point::new(middle_m + radius_m * angle.cos(), middle_m + radius_m * angle.sin(), z)
        };
        (0..count).map(|i| (place(i), place(i + count / 2))).collect::<Vec<_>>()
    };
    let case = |name: &str, map: &PathBuf, vehicles: &[(Point, Point)], nodes, simulation| Case {
        name: name.to_owned(),
        map: map.clone(),
        vehicles: vehicles.to_vec(),
        nodes,
        safety_distance_m: 1.5,
        safety_margin_m: 0.5,
        simulation,
    };
    let twenty = circle(20, 20.0, 24.0);
    let mut cases = vec![
        case("head-on, corridor, side room", &corridor, &swap, 300, gusts),
        case("crossing of four corridors, 8", &crossing, &cross, 600, gusts),
        case("circle of 20 m, 20 swap", &small_hall, &twenty, 1500, gusts),
        case("circle, 30 % radio loss", &small_hall, &twenty, 1500, lossy),
        case("circle, 300 ms radio delay", &small_hall, &twenty, 1500, late),
        case("corridor, 30 % radio loss", &corridor, &swap, 300, lossy),
        case("corridor, 300 ms radio delay", &corridor, &swap, 300, late),
    ];
    let hundred = case("circle of 60 m, 100 swap at 3 m", &field, &circle(100, 60.0, 66.0), 3000, gusts);
    cases.push(Case { safety_distance_m: 3.0, ..hundred });
    Ok(cases)
}

/// A map of `size`, solid but for what `free` says of cell centres; its floor is one cell thick.
fn carve(dir: &Path, name: &str, size: Point, free: impl Fn(Point) -> bool) -> Result<PathBuf> {
    let dims = [0, 1, 2].map(|a| (size[a] / RESOLUTION_M).round() as u32);
    let shape = GridShape { dims, min: Point::zeros(), resolution_m: RESOLUTION_M };
    let mut map = OccupancyMap::unknown(shape, name)?;
    for (i, j, k) in
        (0..dims[0]).flat_map(|i| (0..dims[1]).flat_map(move |j| (0..dims[2]).map(move |k| (i, j, k))))
    {
        let inside = k > 0 && k + 1 < dims[2] && free(shape.center([i, j, k]));
        map.set([i, j, k], if inside { Occupancy::Free } else { Occupancy::Occupied });
    }
    let path = dir.join(name);
    bt::write(&map.to_octree(name)?, &path)?;
    Ok(path)
}

/// 30 m × 3 m, with one side room off its middle.
fn corridor(dir: &Path) -> Result<PathBuf> {
    carve(dir, "corridor.bt", Point::new(30.5, 8.5, 3.5), |p| {
        let corridor = (0.25..30.25).contains(&p.x) && (0.5..3.5).contains(&p.y);
        let room = (13.0..17.0).contains(&p.x) && (3.5..8.0).contains(&p.y);
        corridor || room
    })
}

/// Two corridors 4 m wide that cross at (15, 15).
fn crossing(dir: &Path) -> Result<PathBuf> {
    carve(dir, "crossing.bt", Point::new(30.0, 30.0, 3.5), |p| {
        let across = |v: f32| (13.0..17.0).contains(&v);
        let along = |v: f32| (0.25..29.75).contains(&v);
        (across(p.x) && along(p.y)) || (across(p.y) && along(p.x))
    })
}

/// An open hall of twice `half_m` a side; low, so that everybody meets at one height.
fn hall(dir: &Path, half_m: f32, name: &str) -> Result<PathBuf> {
    carve(dir, name, Point::new(2.0 * half_m, 2.0 * half_m, 3.5), |_| true)
}
