//! Random missions on scanned maps. A start or goal whose column to the ground is clear, by brute
//! force over all cells, is accepted; any other is refused by a message that names a place nearby;
//! no vehicle touches anything in flight.
//!
//! `FLOCKMATE_COLUMNS=100` sets the number of missions per map.

use flockmate_tests::shared_data;
use host_sim::map::{self, Occupancy, OccupancyMap};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario::{self, PositionErrors};
use host_sim::{shortage, swarm};
use planner_core::Point;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Horizontal error of `estimator = "rtk"`, metres.
const RTK_ERROR_M: f32 = 0.1;

/// A map, the resolution for planning on it, and a vehicle that fits: radius and margin, metres.
struct Case {
    file: &'static str,
    resolution_m: f32,
    radius_m: f32,
    margin_m: f32,
    edge_max_m: f32,
}

const CASES: [Case; 4] = [
    Case { file: "geb079.bt", resolution_m: 0.08, radius_m: 0.1, margin_m: 0.08, edge_max_m: 3.0 },
    Case {
        file: "manufacturing.bt",
        resolution_m: 0.086_642_2,
        radius_m: 0.15,
        margin_m: 0.15,
        edge_max_m: 2.5,
    },
    Case { file: "maze.bt", resolution_m: 0.195_32, radius_m: 0.3, margin_m: 0.3, edge_max_m: 8.0 },
    Case {
        file: "two_blocks.bt",
        resolution_m: 0.017_578_1,
        radius_m: 0.03,
        margin_m: 0.02,
        edge_max_m: 0.5,
    },
];
/// Nodes of a roadmap and whether `roadmap.passages` is set; the second is used if the first finds
/// no path.
const NODES: [(usize, bool); 2] = [(1500, false), (6000, true)];
/// Number of missions per map unless `FLOCKMATE_COLUMNS` sets another.
const MISSIONS: usize = 3;

/// Whether the column from the ground to the point is clear, over all cells of the map.
fn is_clear(map: &OccupancyMap, p: &Point, radius_m: f32, required_m: f32) -> bool {
    let shape = map.shape();
    let cell_m = f64::from(shape.resolution_m);
    let low = |axis: usize, cell: u32| f64::from(shape.min[axis]) + f64::from(cell) * cell_m;
    let Some([i, j, top]) = shape.cell_of(p) else { return false };
    if map.state_at([i, j, top]) != Occupancy::Free {
        return false;
    }
    let Some(below) = (0..top).rev().find(|&k| map.state_at([i, j, k]) != Occupancy::Free) else {
        return false;
    };
    let stands_m = low(2, below + 1) + f64::from(radius_m);
    let [x, y, z] = [p.x, p.y, p.z].map(f64::from);
    if map.state_at([i, j, below]) == Occupancy::Unknown || z < stands_m {
        return false;
    }
    let required_m = f64::from(required_m);
    let inside = |axis: usize, at: f64| {
        at - required_m > low(axis, 0) && at + required_m < low(axis, shape.dims[axis])
    };
    if !inside(0, x) || !inside(1, y) || z + required_m >= low(2, shape.dims[2]) {
        return false;
    }
    let gap = |axis: usize, cell: u32, from: f64, to: f64| {
        (low(axis, cell) - to).max(from - low(axis, cell) - cell_m).max(0.0)
    };
    (below + 1..shape.dims[2]).all(|k| {
        (0..shape.dims[1]).all(|j| {
            (0..shape.dims[0]).all(|i| {
                map.state_at([i, j, k]) == Occupancy::Free || {
                    let (dx, dy, dz) = (gap(0, i, x, x), gap(1, j, y, y), gap(2, k, stands_m, z));
                    dx * dx + dy * dy + dz * dz > required_m * required_m
                }
            })
        })
    })
}

fn uniform(rng: &mut Pcg32) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1 << 24) as f32
}

/// Whether a place is so near to the ground that no edge can lead there, whatever its column.
fn is_low(map: &OccupancyMap, p: &Point, required_m: f32) -> bool {
    let shape = map.shape();
    let Some([i, j, top]) = shape.cell_of(p) else { return true };
    let below = (0..top).rev().find(|&k| map.state_at([i, j, k]) != Occupancy::Free);
    below.is_some_and(|below| {
        p.z - shape.min.z - (below + 1) as f32 * shape.resolution_m <= required_m
    })
}

/// A random place in a free cell.
fn place(map: &OccupancyMap, rng: &mut Pcg32) -> Point {
    let (min, size) = (map.shape().min, map.shape().max() - map.shape().min);
    loop {
        let p = min + Point::new(uniform(rng), uniform(rng), uniform(rng)).component_mul(&size);
        if map.shape().cell_of(&p).is_some_and(|cell| map.state_at(cell) == Occupancy::Free) {
            return p;
        }
    }
}

#[test]
fn starts_and_goals_with_clear_columns_are_flown_and_others_refused() {
    let missions =
        std::env::var("FLOCKMATE_COLUMNS").map_or(MISSIONS, |count| count.parse().unwrap());
    for case in &CASES {
        let Some(file) = shared_data(&format!("maps3d/{}", case.file)) else { return };
        let map = map::load(file.to_str().unwrap(), case.resolution_m).unwrap();
        let required_m = case.radius_m + case.margin_m;
        // A margin below the RTK error keeps no vehicle off a wall: such a case tests the columns
        // only, with perfect estimates.
        let fits = case.margin_m >= RTK_ERROR_M;
        let (estimator, cruise_mps) =
            if fits { (PositionErrors::Rtk, 1.0) } else { (PositionErrors::Perfect, 0.3) };
        let mut rng = Pcg32::seed_from_u64(1);
        let (mut flown, mut walled_off, mut missed) = (0, 0, 0);
        let (mut contacts, mut refused, mut hints) = (0, 0, 0);
        for mission in 0..missions {
            let (mut clear, mut other) = (Vec::new(), None);
            for _ in 0..20_000 {
                if clear.len() == 2 && other.is_some() {
                    break;
                }
                let p = place(&map, &mut rng);
                match is_clear(&map, &p, case.radius_m, required_m) {
                    // The program reports what such a place lacks; the unit tests of `shortage`
                    // check that.
                    true if is_low(&map, &p, required_m) => {}
                    true if clear.len() < 2 => clear.push(p),
                    false => other = Some(p),
                    true => {}
                }
            }
            let ([start, goal], Some(other)) = (&clear[..], other) else {
                panic!("{}: {} clear columns, another: {other:?}", case.file, clear.len())
            };
            let prepare = |start: &Point, goal: &Point, (nodes, passages): (usize, bool)| {
                let text = format!(
                    "seed = {mission}\n[map]\nfile = {file:?}\nresolution_m = {}\n\
                     [roadmap]\nnodes = {nodes}\npassages = {passages}\nedge_min_m = 0.05\nedge_max_m = {}\nsafety_margin_m = {}\n\
                     [mission]\nmode = \"labelled\"\ncruise_mps = {cruise_mps}\ngoals = [[{}, {}, {}]]\n\
                     [deconfliction]\nsafety_distance_m = 0.8\n\
                     [[vehicles]]\nid = 1\nstart = [{}, {}, {}]\nradius_m = {}\ngoal = 0\n",
                    case.resolution_m,
                    case.edge_max_m,
                    case.margin_m,
                    goal.x,
                    goal.y,
                    goal.z,
                    start.x,
                    start.y,
                    start.z,
                    case.radius_m
                );
                let mut scenario = scenario::parse(&text, "columns.toml").expect("it is one");
                scenario.simulation.estimator = estimator;
                PreparedMission::prepare(scenario, &Progress::hidden())
            };
            for (start, goal) in [(&other, goal), (start, &other)] {
                let error = prepare(start, goal, NODES[0])
                    .map(|_| ())
                    .expect_err("its column is not clear")
                    .to_string();
                refused += 1;
                hints += usize::from(error.contains("the nearest place that would do is"));
            }
            let plan = |nodes| {
                let mut mission = prepare(start, goal, nodes).ok()?;
                let plan = mission.plan().ok()?;
                let lines = shortage::shortage_lines(&mission, &plan);
                Some((lines.iter().any(|line| line.contains("the map has one")), mission, plan))
            };
            // More nodes if the map has a path that the roadmap has not, as the program suggests.
            let plan =
                plan(NODES[0]).and_then(|first| if first.0 { plan(NODES[1]) } else { Some(first) });
            let Some((false, mission, plan)) = plan else {
                missed += 1;
                continue;
            };
            if !plan.flights[0].task.leaves_pad() {
                walled_off += 1;
                continue;
            }
            let result =
                swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden())
                    .expect("it flies")
                    .result;
            contacts += result.safety.wall_contacts;
            flown += 1;
        }
        println!(
            "{}: of {missions} clear missions {flown} flown, {walled_off} without a way between on the map itself, {missed} \
             not planned; {contacts} contacts; {refused} others refused, {hints} with a place nearby",
            case.file
        );
        assert!(100 * missed <= missions, "{}", case.file);
        assert_eq!(contacts, 0, "{}", case.file);
    }
}

/// The fifth scan is of a few rays: all else is unknown, so no vehicle can stand anywhere.
#[test]
fn a_map_of_a_few_rays_has_no_clear_column() {
    let Some(file) = shared_data("maps3d/wkentaro_test.bt") else { return };
    let map = map::load(file.to_str().unwrap(), 0.1).unwrap();
    let mut rng = Pcg32::seed_from_u64(1);
    assert!((0..2000).all(|_| !is_clear(&map, &place(&map, &mut rng), 0.03, 0.05)));
}
