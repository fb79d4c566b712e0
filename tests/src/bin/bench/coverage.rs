//! Times our coverage planner beside the public C++ BINPAT, on its kind of area: five vertices, 300
//! by 150 m, lanes of 10 m.
//!
//! `--binpat DIR` is a checkout of cvar-upm/multi_uav_planning_binpat; `tests/peers/binpat.cpp`
//! times it. Both are run alternately. Both do the same work: from the vertices to the flights,
//! written out as points with heights (start, layer, both ends of every lane, home). For the loss
//! of a vehicle, each has flown ten waypoints of its route, 90 m, and stands there; then the first
//! one is lost. The remaining lanes are divided among the others from where they stand, and written
//! out.
//!
//! What differs: theirs cuts the path anywhere, ours between waypoints. Theirs layers flights by
//! the path to and from their part, ours by the time of the whole flight. Theirs also compares the
//! new longest flight with the old one.

use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use flockmate_tests::costs::Costs;
use flockmate_tests::workspace;
use planner_core::coverage::Flat;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::divide;
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::pack::{
    CoverageProblem, Heights, PackWorkspace, RouteDirection, RoutePlan, TrackUnit, Vehicle, binpat,
};
use planner_core::coverage::powell;
use planner_core::coverage::tracks::{self, LanePattern, Tracks};
use planner_core::coverage::transit::TransitGraph;
use planner_core::flight::WaypointRange;

use crate::row::Row;

/// Number of random areas on which the methods' costs are compared.
const RANDOM_AREAS: u64 = 1000;
/// Runs in each round; their median counts.
const RUNS: usize = 301;
/// Rounds, each of our runs and then theirs; the median of the rounds counts.
const ROUNDS: usize = 5;
const LANES: usize = 512;
const VEHICLES: usize = 32;
/// The area, metres.
const AREA_VERTICES: [[f32; 2]; 5] =
    [[0.0, 0.0], [300.0, 0.0], [320.0, 80.0], [300.0, 150.0], [0.0, 150.0]];

/// Rows for a plan and for planning after a loss, with 3 and 10 vehicles; for POWELL with 3, beside
/// the time it may take; and for the costs of all methods.
///
/// # Errors
/// The C++ program cannot be built or run.
pub fn rows(checkout: Option<&Path>) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    let peer = checkout.map(build_cpp_binpat).transpose()?;
    if peer.is_none() {
        println!(
            "coverage: no --binpat DIR, a checkout of cvar-upm/multi_uav_planning_binpat; only POWELL"
        );
    }
    for n in [3, 10] {
        let Some(peer) = &peer else { break };
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            ours.push(our_times_us(n));
            theirs.push(their_times_us(peer, n)?);
        }
        for (k, name) in ["coverage, plan", "coverage, after a loss"].into_iter().enumerate() {
            let middle = |times: &[[f64; 2]]| {
                let mut times: Vec<f64> = times.iter().map(|round| round[k]).collect();
                times.sort_by(f64::total_cmp);
                times[ROUNDS / 2]
            };
            let (ours, theirs) = (middle(&ours), middle(&theirs));
            let name = name.to_owned();
            rows.push(Row {
                name,
                ours,
                theirs,
                ratio: theirs / ours,
                required: 1.1,
                unit: "us",
                n,
            });
        }
    }
    let ours = our_powell_time_us();
    let name = "coverage, POWELL".to_owned();
    rows.push(Row {
        name,
        ours,
        theirs: 5000.0,
        ratio: 5000.0 / ours,
        required: 1.0,
        unit: "us",
        n: 3,
    });
    rows.extend(cost_rows());
    Ok(rows)
}

/// Compares the greatest costs of the methods on random convex areas for 2 to 10 vehicles. Rows:
/// the share of areas for which a relation holds, beside the share required, and POWELL's median
/// gap to the best division, beside the gap allowed.
fn cost_rows() -> Vec<Row> {
    let costs = Costs::of(0..RANDOM_AREAS);
    println!("coverage: {costs:?}");
    let share = |name: &str, but: usize, required: f64| {
        let ours = 100.0 * (1.0 - but as f64 / costs.areas as f64);
        let name = format!("coverage, {name}, areas");
        Row {
            name,
            ours,
            theirs: required,
            ratio: ours / required,
            required: 1.0,
            unit: "%",
            n: costs.areas,
        }
    };
    // With a gap of 0 the ratio would be infinite.
    let gap = f64::from(costs.median_gaps_percent[2]).max(0.01);
    let name = "coverage, gap of POWELL to exact, median".to_owned();
    vec![
        share("POWELL <= BINPAT", costs.powell_over_binpat, 100.0),
        share("POWELL <= SIMPLE", costs.powell_over_simple, 95.0),
        share("exact <= all", costs.plans_below_exact, 100.0),
        Row {
            name,
            ours: gap,
            theirs: 8.0,
            ratio: 8.0 / gap,
            required: 1.0,
            unit: "%",
            n: costs.areas,
        },
    ]
}

/// Compiles `tests/peers/binpat.cpp` with the headers of the checkout; returns the program.
fn build_cpp_binpat(checkout: &Path) -> Result<tempfile::TempPath> {
    let program = tempfile::NamedTempFile::new()?.into_temp_path();
    let include = checkout.join("planning_binpat/include");
    let built = Command::new("g++")
        .args(["-O3", "-march=native", "-std=c++17", "-o"])
        .arg(&program)
        .arg("-I")
        .arg(&include)
        .arg("-I")
        .arg(include.join("assignment/bare"))
        .arg(workspace().join("tests/peers/binpat.cpp"))
        .arg(checkout.join("planning_binpat/src/bare/lap.cpp"))
        .status()
        .context("cannot run g++")?;
    ensure!(built.success(), "the C++ BINPAT in {} does not build", checkout.display());
    Ok(program)
}

/// Times of the C++ BINPAT, microseconds.
fn their_times_us(program: &Path, vehicles: usize) -> Result<[f64; 2]> {
    let output = Command::new(program).args([vehicles.to_string(), RUNS.to_string()]).output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let times: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    times.try_into().map_err(|_| anyhow::anyhow!("the C++ BINPAT printed {text:?}"))
}

/// Input and workspaces of our plans of the area, and the flights as points.
struct CoverageBench {
    vertices: Vec<Flat>,
    rings: [Ring; 1],
    vehicles: Vec<Vehicle>,
    tracks: Box<Tracks<LANES>>,
    workspace: Box<tracks::LaneWorkspace<64>>,
    pack: Box<PackWorkspace<VEHICLES>>,
    plan: RoutePlan<VEHICLES>,
    /// Points of the flights.
    points: Vec<[f32; 3]>,
}

impl CoverageBench {
    fn new(vehicles: usize) -> Self {
        let vehicle = |i: usize| {
            let place = Flat::new(5.0 * i as f32, -10.0);
            let (cruise_mps, climb_mps, descend_mps) = (5.0, 3.0, 1.0);
            Vehicle {
                transit_start: place,
                home: place,
                cruise_mps,
                climb_mps,
                descend_mps,
                weight: 1.0,
            }
        };
        Self {
            vertices: AREA_VERTICES.iter().map(|[x, y]| Flat::new(*x, *y)).collect(),
            rings: [Ring { end: AREA_VERTICES.len() as u16, kind: RingKind::Outer }],
            vehicles: (0..vehicles).map(vehicle).collect(),
            tracks: Box::default(),
            workspace: Box::default(),
            pack: Box::default(),
            plan: RoutePlan::new(),
            points: Vec::new(),
        }
    }

    /// One whole plan: from the vertices to the flights as points.
    fn plan(&mut self) {
        let area = Area::new(black_box(&self.vertices), &self.rings).expect("an area");
        let mut transit = TransitGraph::<8>::empty();
        transit.set_area(area).expect("no zones");
        let footprint = Footprint { along_m: 10.0, across_m: 10.0 };
        let spacing = Spacing { footprint, max_lane_spacing_m: 10.0, max_waypoint_spacing_m: 10.0 };
        let pattern = LanePattern {
            spacing,
            angle_from_east_deg: None,
            border_overshoot_m: 0.0,
            max_search_steps: 10_000,
        };
        tracks::build_lanes(&area, &pattern, &transit, &mut self.workspace, &mut self.tracks)
            .expect("lanes");
        let work = work_of_lanes(&self.tracks, &transit, &self.vehicles);
        binpat(&work, &mut self.pack, &mut self.plan).expect("routes");
        write_flights_as_points(&work, &self.plan, &mut self.points);
        black_box(&self.points);
    }
}

/// Writes every flight as points: start, up to its layer, the lanes, its layer, home.
fn write_flights_as_points(
    work: &CoverageProblem<'_, LANES, 8>,
    plan: &RoutePlan<VEHICLES>,
    points: &mut Vec<[f32; 3]>,
) {
    points.clear();
    let Heights { max_picture_height_m: mission_m, layer_spacing_m: layer_m } = work.heights;
    for route in &plan.routes {
        let vehicle = &work.vehicles[usize::from(route.vehicle_index)];
        let up_m = mission_m + layer_m * f32::from(route.layer);
        let at = |place: &Flat, height_m: f32| [place.x, place.y, height_m];
        points.extend([at(&vehicle.transit_start, mission_m), at(&vehicle.transit_start, up_m)]);
        let lanes = work.tracks.lane_of(route.lowest_waypoint)
            ..=work.tracks.lane_of(route.waypoint_end - 1);
        let begins = points.len();
        for lane in &work.tracks.lanes()[lanes] {
            let from = route.lowest_waypoint.max(lane.first_waypoint) - lane.first_waypoint;
            let to = route.waypoint_end.min(lane.first_waypoint + lane.waypoint_count)
                - 1
                - lane.first_waypoint;
            points.extend([from, to].map(|k| at(&lane.waypoint(k), mission_m)));
        }
        if route.direction == RouteDirection::Backward {
            points[begins..].reverse();
        }
        let [first, last] = [points[begins], points[points.len() - 1]];
        points.insert(begins, [first[0], first[1], up_m]);
        points.extend([[last[0], last[1], up_m], at(&vehicle.home, up_m), at(&vehicle.home, 0.0)]);
    }
}

fn work_of_lanes<'a>(
    tracks: &'a Tracks<LANES>,
    transit: &'a TransitGraph<'a, 8>,
    vehicles: &'a [Vehicle],
) -> CoverageProblem<'a, LANES, 8> {
    let heights = Heights { max_picture_height_m: 35.0, layer_spacing_m: 5.0 };
    CoverageProblem {
        tracks,
        transit,
        vehicles,
        heights,
        unit: TrackUnit::Waypoint,
        following: None,
    }
}

fn our_times_us(vehicles: usize) -> [f64; 2] {
    let mut bench = CoverageBench::new(vehicles);
    let plan_us = median_us(|| bench.plan());
    let transit = TransitGraph::<8>::empty();
    // Each vehicle has flown ten waypoints of its route and stands at the tenth.
    let mut done = Vec::new();
    for route in &bench.plan.routes {
        let flown = WaypointRange {
            first: route.lowest_waypoint,
            end: (route.lowest_waypoint + 10).min(route.waypoint_end),
        };
        bench.vehicles[usize::from(route.vehicle_index)].transit_start =
            bench.tracks.waypoint(flown.end - 1).expect("a waypoint");
        done.push(flown);
    }
    let mut left: Box<Tracks<LANES>> = Box::default();
    let update_us = median_us(|| {
        divide::remaining_lanes(&bench.tracks, black_box(&done), &transit, &mut left)
            .expect("something is left");
        let rest = &bench.vehicles[1..];
        let work = work_of_lanes(&left, &transit, rest);
        binpat(&work, &mut bench.pack, &mut bench.plan).expect("routes");
        write_flights_as_points(&work, &bench.plan, &mut bench.points);
        black_box(&bench.points);
    });
    let last = left.waypoint_count() - 1;
    assert_eq!(divide::number_on_whole_path(&done, last), bench.tracks.waypoint_count() - 1);
    [plan_us, update_us]
}

/// Median time of our POWELL-BINPAT, microseconds.
fn our_powell_time_us() -> f64 {
    let mut bench = CoverageBench::new(3);
    bench.plan();
    let transit = TransitGraph::<8>::empty();
    let mut ws: Box<powell::PowellWorkspace<VEHICLES>> = Box::default();
    let work = work_of_lanes(&bench.tracks, &transit, &bench.vehicles);
    median_us(|| {
        powell::powell(&work, &powell::PowellConfig::USUAL, &mut ws, &mut bench.plan)
            .expect("routes");
    })
}

fn median_us(mut run: impl FnMut()) -> f64 {
    let mut time = || {
        let began = Instant::now();
        run();
        began.elapsed().as_secs_f64() * 1e6
    };
    let mut times: Vec<f64> = (0..RUNS).map(|_| time()).collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2]
}
