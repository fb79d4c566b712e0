//! The meetings: maps of corridors and open halls, which vehicles swap places, and under which
//! disturbances each meeting is flown.

use std::f32::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use host_sim::map::{Occupancy, OccupancyMap, bt};
use planner_core::Point;
use planner_core::map::voxel::GridShape;

/// Cruise speed of all vehicles, m/s.
const CRUISE_MPS: f32 = 2.0;
/// Edge of a cell of most maps, metres.
const RESOLUTION_M: f32 = 0.25;
/// Edge of a map cell in the map with a doorway 1.6 m wide, metres.
const DOORWAY_RESOLUTION_M: f32 = 0.2;
/// Height of starts and goals above the top of the floor, metres.
const START_GOAL_HEIGHT_M: f32 = 1.5;
/// TOML of the gusts of every case: those that missions are planned for.
pub const GUSTS: &str = "gust_mps = 3.0\n";

/// A map and the vehicles that fly on it: planned once for each seed, flown once for each
/// disturbance and method.
pub struct Meeting {
    /// Disturbances under which it is flown, a row of the table each: name, and further TOML lines
    /// of `[simulation]` and `[[faults]]`.
    pub cases: Vec<(&'static str, &'static str)>,
    /// Id of the vehicle that faults strike when it has taken off; `None`: a different vehicle for
    /// each seed, somewhere on its path.
    struck_vehicle: Option<u8>,
    /// Path of the map file.
    map: PathBuf,
    /// Start and goal of each vehicle, ENU metres.
    vehicles: Vec<(Point, Point)>,
    /// Edge of a cell, metres.
    resolution_m: f32,
    /// Number of random nodes of the roadmap.
    nodes: usize,
    /// Greatest length of an edge of the roadmap, metres.
    edge_max_m: f32,
    safety_margin_m: f32,
    /// How nodes are drawn, as in a scenario.
    sampling: &'static str,
    safety_distance_m: f32,
    /// Time limit of a flight, seconds.
    time_limit_s: f32,
    /// Most seeds with which this meeting is flown.
    pub max_seeds: u64,
    /// Whether the plan's makespan is compared with that of the best order found by a search.
    pub compares_ideal_makespan: bool,
}

impl Meeting {
    /// Id of the vehicle that the faults of the cases strike, and the share of its flight after
    /// which they do.
    pub fn struck_vehicle_and_share(&self, seed: u64) -> (u8, f32) {
        match self.struck_vehicle {
            Some(id) => (id, 0.0),
            None => {
                ((1 + seed % self.vehicles.len() as u64) as u8, (seed * 37 % 100) as f32 * 0.01)
            }
        }
    }

    /// Drops the cases whose name does not contain `part`.
    pub fn keep_cases_named(&mut self, part: &str) {
        self.cases.retain(|(name, _)| name.contains(part));
    }

    /// Whether more than twenty vehicles meet.
    pub fn is_large(&self) -> bool {
        self.vehicles.len() > 20
    }

    /// TOML of the scenario: flown with `method` under the disturbances `simulation` of one case.
    pub fn scenario(&self, method: &str, simulation: &str, seed: u64) -> String {
        let mut text = format!(
            "seed = {seed}\n[map]\nfile = {:?}\nresolution_m = {}\n",
            self.map, self.resolution_m
        );
        let goals: Vec<String> = self
            .vehicles
            .iter()
            .map(|(_, g)| format!("[{:.3}, {:.3}, {:.3}]", g.x, g.y, g.z))
            .collect();
        let _ = write!(
            text,
            "[roadmap]\nnodes = {}\nedge_min_m = 0.3\nedge_max_m = {}\nsafety_margin_m = {}\nsampling = {:?}\n\
             [mission]\nmode = \"labelled\"\ncruise_mps = {CRUISE_MPS}\ngoals = [{}]\n\
             [deconfliction]\nmethod = {method:?}\nsafety_distance_m = {}\n\
             [simulation]\ntime_limit_s = {}\n{simulation}\n",
            self.nodes,
            self.edge_max_m,
            self.safety_margin_m,
            self.sampling,
            goals.join(", "),
            self.safety_distance_m,
            self.time_limit_s,
        );
        for (i, (start, _)) in self.vehicles.iter().enumerate() {
            let [x, y, z] = (*start).into();
            let _ = write!(
                text,
                "[[vehicles]]\nid = {}\nstart = [{x:.3}, {y:.3}, {z:.3}]\nradius_m = 0.3\ngoal = {i}\n",
                i + 1
            );
        }
        text
    }
}

/// Disturbances of most meetings: gusts alone, gusts and radio loss, gusts and radio delay.
const GUSTS_AND_RADIO: [&str; 3] =
    [GUSTS, "gust_mps = 3.0\nradio_loss = 0.3\n", "gust_mps = 3.0\nradio_delay_s = 0.3\n"];

/// Disturbances by a radio that fails for good: it only hears, only sends, or does neither.
const RADIO_FAILURES: [&str; 3] = [
    "gust_mps = 3.0\n[[faults]]\nat_s = AT_S\nvehicle = VEHICLE\nkind = \"radio-cut\"\ndirection = \"tx\"\n",
    "gust_mps = 3.0\n[[faults]]\nat_s = AT_S\nvehicle = VEHICLE\nkind = \"radio-cut\"\ndirection = \"rx\"\n",
    "gust_mps = 3.0\n[[faults]]\nat_s = AT_S\nvehicle = VEHICLE\nkind = \"radio-cut\"\n",
];
/// Disturbance by a pilot, who takes over a vehicle and holds it where it is.
const PILOT_STOPS: &str =
    "gust_mps = 3.0\n[[faults]]\nat_s = AT_S\nvehicle = VEHICLE\nkind = \"pilot-takeover\"\n";

fn three_cases(names: [&'static str; 3]) -> Vec<(&'static str, &'static str)> {
    names.into_iter().zip(GUSTS_AND_RADIO).collect()
}

/// Settings that most meetings share; without a map, vehicles and cases.
fn indoor_defaults() -> Meeting {
    Meeting {
        cases: Vec::new(),
        struck_vehicle: None,
        map: PathBuf::new(),
        vehicles: Vec::new(),
        resolution_m: RESOLUTION_M,
        nodes: 250,
        edge_max_m: 5.0,
        safety_margin_m: 0.5,
        sampling: "uniform",
        safety_distance_m: 1.5,
        time_limit_s: 400.0,
        max_seeds: u64::MAX,
        compares_ideal_makespan: false,
    }
}

/// All meetings; their maps are written to `dir`.
pub fn all_meetings(dir: &Path) -> Result<Vec<Meeting>> {
    let z = RESOLUTION_M + START_GOAL_HEIGHT_M;
    let ends = [Point::new(1.5, 2.0, z), Point::new(28.5, 2.0, z)];
    let corridor = Meeting {
        cases: three_cases([
            "corridor, head-on",
            "corridor, 30 % radio loss",
            "corridor, 300 ms radio delay",
        ]),
        map: corridor_map(dir)?,
        vehicles: vec![(ends[0], ends[1]), (ends[1], ends[0])],
        ..indoor_defaults()
    };
    let crossing = Meeting {
        cases: three_cases([
            "crossing, 8",
            "crossing, 30 % radio loss",
            "crossing, 300 ms radio delay",
        ]),
        map: crossing_map(dir, "crossing.bt", 3.5)?,
        vehicles: crossing_vehicles(z),
        nodes: 400,
        compares_ideal_makespan: true,
        ..indoor_defaults()
    };
    // High enough to fly over a vehicle that lies on the floor.
    let radios = Meeting {
        cases: [
            "radio only hears, crossing",
            "radio only sends, crossing",
            "radio is dead, crossing",
        ]
        .into_iter()
        .zip(RADIO_FAILURES)
        .collect(),
        map: crossing_map(dir, "high.bt", 4.5)?,
        vehicles: crossing_vehicles(z),
        nodes: 400,
        ..indoor_defaults()
    };
    let circle = |count: usize, radius_m: f32, middle_m: f32| {
        let place = move |i: usize| {
            let angle = i as f32 * TAU / count as f32;
            Point::new(middle_m + radius_m * angle.cos(), middle_m + radius_m * angle.sin(), z)
        };
        (0..count).map(|i| (place(i), place(i + count / 2))).collect::<Vec<_>>()
    };
    let twenty = Meeting {
        cases: three_cases(["circle, 20", "circle, 30 % radio loss", "circle, 300 ms radio delay"]),
        map: hall_map(dir, 24.0, "hall.bt")?,
        vehicles: circle(20, 20.0, 24.0),
        nodes: 700,
        ..indoor_defaults()
    };
    // The vehicles start as near to each other as the hundred below.
    let forty = Meeting {
        cases: vec![("circle, 40, 3 m apart", GUSTS)],
        map: hall_map(dir, 30.0, "yard.bt")?,
        vehicles: circle(40, 24.0, 30.0),
        nodes: 700,
        edge_max_m: 9.0,
        sampling: "halton",
        safety_distance_m: 3.0,
        ..indoor_defaults()
    };
    let hundred = Meeting {
        cases: vec![("circle, 100, 3 m apart", GUSTS)],
        map: hall_map(dir, 66.0, "field.bt")?,
        vehicles: circle(100, 60.0, 66.0),
        nodes: 1500,
        edge_max_m: 9.0,
        // Evenly spread nodes: between pads 3.8 m apart, only straight paths lead in and out.
        sampling: "halton",
        safety_distance_m: 3.0,
        time_limit_s: 900.0,
        max_seeds: 3,
        ..indoor_defaults()
    };
    let doorway = Meeting {
        cases: three_cases([
            "doorway, one stands in it",
            "doorway, 30 % radio loss",
            "doorway, 300 ms radio delay",
        ]),
        map: doorway_map(dir)?,
        vehicles: vec![
            (Point::new(3.0, 3.0, z), Point::new(14.0, 3.0, z)),
            (Point::new(14.0, 6.0, z), Point::new(3.0, 6.0, z)),
            // This vehicle takes off and lands in the doorway.
            (Point::new(8.2, 4.4, z), Point::new(8.6, 4.4, z)),
        ],
        resolution_m: DOORWAY_RESOLUTION_M,
        nodes: 600,
        safety_margin_m: 0.3,
        ..indoor_defaults()
    };
    let stopped = Meeting {
        struck_vehicle: Some(3),
        vehicles: vec![
            (Point::new(3.0, 3.0, z), Point::new(14.0, 3.0, z)),
            (Point::new(14.0, 6.0, z), Point::new(3.0, 6.0, z)),
            // The others wait for it to leave the doorway, on their shortest path.
            (Point::new(8.4, 4.4, z), Point::new(14.0, 8.0, z)),
        ],
        map: doorway.map.clone(),
        cases: vec![("doorway, one is stopped in it", PILOT_STOPS)],
        resolution_m: DOORWAY_RESOLUTION_M,
        nodes: 600,
        safety_margin_m: 0.3,
        ..indoor_defaults()
    };
    Ok(vec![corridor, crossing, radios, doorway, stopped, twenty, forty, hundred])
}

/// Start and goal of two vehicles in each arm, at 13 m and at 9.5 m from the middle; starts are on
/// the right of the arm's axis, goals on the left. The vehicle in front crosses straight to the far
/// goal, the one behind turns left to the near one. So each vehicle crosses the paths of all
/// vehicles from other arms.
fn crossing_vehicles(z: f32) -> Vec<(Point, Point)> {
    let place = |arm: usize, along: f32, left: f32| {
        let (x, y) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][arm % 4];
        Point::new(15.0 + x * along - y * left, 15.0 + y * along + x * left, z)
    };
    let (far, near, aside) = (13.0, 9.5, 1.0);
    let front = (0..4).map(|arm| (place(arm, near, -aside), place(arm + 2, far, aside)));
    let behind = (0..4).map(|arm| (place(arm, far, -aside), place(arm + 1, near, aside)));
    front.chain(behind).collect()
}

/// Writes a map of `size` that is solid except for cells whose centre is `free`; floor and ceiling
/// are one cell thick.
fn write_carved_map(
    dir: &Path,
    name: &str,
    resolution_m: f32,
    size: Point,
    free: impl Fn(Point) -> bool,
) -> Result<PathBuf> {
    let dims = [0, 1, 2].map(|a| (size[a] / resolution_m).round() as u32);
    let shape = GridShape { dims, min: Point::zeros(), resolution_m };
    let mut map = OccupancyMap::all_unknown(shape, name)?;
    for (i, j, k) in (0..dims[0])
        .flat_map(|i| (0..dims[1]).flat_map(move |j| (0..dims[2]).map(move |k| (i, j, k))))
    {
        let inside = k > 0 && k + 1 < dims[2] && free(shape.center([i, j, k]));
        map.set([i, j, k], if inside { Occupancy::Free } else { Occupancy::Occupied });
    }
    let path = dir.join(name);
    bt::write(&map.to_octree(name)?, &path)?;
    Ok(path)
}

/// Map of a corridor, 30 m × 3 m, with one side room at its middle.
fn corridor_map(dir: &Path) -> Result<PathBuf> {
    write_carved_map(dir, "corridor.bt", RESOLUTION_M, Point::new(30.5, 8.5, 3.5), |p| {
        let corridor = (0.25..30.25).contains(&p.x) && (0.5..3.5).contains(&p.y);
        let room = (13.0..17.0).contains(&p.x) && (3.5..8.0).contains(&p.y);
        corridor || room
    })
}

/// Map of two rooms of 8 m × 9 m, joined by a doorway 1.6 m wide and 2.2 m high, and by a detour
/// through a passage 3 m wide.
fn doorway_map(dir: &Path) -> Result<PathBuf> {
    write_carved_map(dir, "doorway.bt", DOORWAY_RESOLUTION_M, Point::new(17.0, 13.6, 3.6), |p| {
        let rooms = (0.2..16.8).contains(&p.x) && (0.2..9.2).contains(&p.y);
        let wall = (8.2..8.6).contains(&p.x) && !(3.6..5.2).contains(&p.y);
        let ends = (0.2..3.2).contains(&p.x) || (13.8..16.8).contains(&p.x);
        let passage = (10.0..13.0).contains(&p.y) && (0.2..16.8).contains(&p.x);
        // The lintel is low, so that no vehicle can fly over one in the doorway.
        let lintel = (8.2..8.6).contains(&p.x) && p.z > 2.4;
        (rooms && !wall && !lintel) || passage || (ends && (9.0..10.2).contains(&p.y))
    })
}

/// Map of two corridors 4 m wide that cross at (15, 15).
fn crossing_map(dir: &Path, name: &str, height_m: f32) -> Result<PathBuf> {
    write_carved_map(dir, name, RESOLUTION_M, Point::new(30.0, 30.0, height_m), |p| {
        let across = |v: f32| (13.0..17.0).contains(&v);
        let along = |v: f32| (0.25..29.75).contains(&v);
        (across(p.x) && along(p.y)) || (across(p.y) && along(p.x))
    })
}

/// Map of an open hall of side 2 · `half_m`, so low that all vehicles meet at one height.
fn hall_map(dir: &Path, half_m: f32, name: &str) -> Result<PathBuf> {
    write_carved_map(dir, name, RESOLUTION_M, Point::new(2.0 * half_m, 2.0 * half_m, 3.5), |_| true)
}
