//! Speed of the swarm simulation: simulated seconds a second of the clock, on one core.
//!
//! In these rows "ours" is the time that [`swarm::fly`] took, "theirs" the time simulated in it,
//! and the ratio how many times faster than the clock it ran. The simulation is one thread, so this
//! is one core, whatever the machine has. Planning and the map's distance field are not in it; how
//! long they took is printed. A flight that is not complete is an error.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use host_sim::map::{Occupancy, OccupancyMap, bt};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario;
use host_sim::swarm;
use planner_core::Point;
use planner_core::map::voxel::GridShape;

use crate::row::Row;

const DEMO: &str = include_str!("../../../../host-sim/scenarios/demo.toml");

/// Number of flights of the demo; the median time counts.
const DEMO_FLIGHTS: usize = 3;
const LARGE_SWARM: usize = 200;
/// Size of the ground of the large swarm, metres, and the edge of its cells.
const GROUND_SIZE_M: [f32; 3] = [120.0, 120.0, 16.0];
const RESOLUTION_M: f32 = 0.5;
/// Number of lanes side by side along y, and their spacing, metres: in each a train of
/// [`VEHICLES_PER_LANE`] vehicles.
const LANES: usize = 20;
const LANE_SPACING_M: f32 = 5.5;
const VEHICLES_PER_LANE: usize = LARGE_SWARM / LANES;
/// Distance between two starts in a lane, and from each start to its goal, metres.
const START_SPACING_M: f32 = 8.0;
const START_TO_GOAL_M: f32 = 36.0;

/// A row for the demo's ten vehicles and one for two hundred on open ground; times in seconds.
pub fn rows() -> Result<Vec<Row>> {
    let mut flights =
        (0..DEMO_FLIGHTS).map(|_| fly(DEMO, "demo.toml")).collect::<Result<Vec<_>>>()?;
    flights.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (took_s, simulated_s) = flights[DEMO_FLIGHTS / 2];
    let ten = row("swarm of ten", took_s, simulated_s, 100.0, 10);
    let dir = tempfile::tempdir()?;
    let map = dir.path().join("ground.bt");
    bt::write(&ground_map()?.to_octree("ground")?, &map)?;
    let (took_s, simulated_s) = fly(&large_swarm_scenario(&map), "two hundred")?;
    Ok(vec![ten, row("swarm of 200", took_s, simulated_s, 1.0, LARGE_SWARM)])
}

fn row(name: &str, took_s: f64, simulated_s: f64, required: f64, n: usize) -> Row {
    Row {
        name: name.into(),
        ours: took_s,
        theirs: simulated_s,
        ratio: simulated_s / took_s,
        required,
        unit: "s ",
        n,
    }
}

/// Plans and simulates a flight; returns the seconds that it took, and those simulated.
fn fly(text: &str, name: &str) -> Result<(f64, f64)> {
    let scenario = scenario::parse(text, name).context("the scenario of a bench")?;
    let began = Instant::now();
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden())?;
    let plan = mission.plan()?;
    mission.clearance_field();
    let planned_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let flight = swarm::fly(&mission, &plan, "bench", swarm::Pace::Fastest, &Progress::hidden())?;
    let took_s = began.elapsed().as_secs_f64();
    let result = &flight.result;
    println!(
        "{name}: {} vehicles, {took_s:.2} s, {} deadlocks, planned in {planned_s:.2} s (schedule and paths {:.2} s), nearest pair {:.2} m, makespan {:.0} s",
        result.vehicles.len(),
        result.safety.deadlocks,
        mission.timing.plan_s,
        result.safety.min_separation_m.unwrap_or(f64::INFINITY),
        result.totals.makespan_s
    );
    for event in flight.log.iter().filter(|e| e.level == host_sim::report::Level::Error).take(10) {
        println!("  {:.2} s, vehicle {:?}: {}", event.t_s, event.vehicle, event.text);
    }
    let landed = result.vehicles.iter().filter(|v| v.landed && v.reached).count();
    ensure!(
        result.complete,
        "{name}: {landed} of {} landed at their goals; not complete",
        result.vehicles.len()
    );
    Ok((took_s, flight.simulated_s))
}

/// Map of a floor with pillars between the lanes.
fn ground_map() -> Result<OccupancyMap> {
    let cells = |metres: f32| (metres / RESOLUTION_M) as u32;
    let shape = GridShape {
        dims: GROUND_SIZE_M.map(cells),
        min: Point::zeros(),
        resolution_m: RESOLUTION_M,
    };
    let mut map = OccupancyMap::all_unknown(shape, "ground")?;
    // Pillars are one metre wide, 20 m apart, in every second gap between two lanes.
    let pillar = |x: f32, y: f32| {
        (x % 20.0 < 1.0)
            && ((y - lane_y_m(0) + 0.5 * (LANE_SPACING_M + 1.0)) % (2.0 * LANE_SPACING_M) < 1.0)
    };
    let [nx, ny, nz] = shape.dims;
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let at = |cell: u32| (cell as f32 + 0.5) * RESOLUTION_M;
                let solid = k == 0 || pillar(at(i), at(j));
                map.set([i, j, k], if solid { Occupancy::Occupied } else { Occupancy::Free });
            }
        }
    }
    Ok(map)
}

fn lane_y_m(lane: usize) -> f32 {
    7.0 + LANE_SPACING_M * lane as f32
}

/// Scenario of two hundred vehicles that fly east in trains, side by side.
fn large_swarm_scenario(map: &Path) -> String {
    let place = |i: usize, way_m: f32, z: f32| {
        format!(
            "[{:?}, {:?}, {z:?}]",
            4.0 + START_SPACING_M * (i % VEHICLES_PER_LANE) as f32 + way_m,
            lane_y_m(i / VEHICLES_PER_LANE)
        )
    };
    let goals: Vec<_> = (0..LARGE_SWARM).map(|i| place(i, START_TO_GOAL_M, 2.5)).collect();
    let mut text = format!(
        "[map]\nfile = {:?}\nresolution_m = {RESOLUTION_M:?}\n\n[roadmap]\nnodes = 6000\nedge_max_m = 10.0\n\n[mission]\nmode = \"labelled\"\n\
         goals = [{}]\n\n[simulation]\nradio_range_m = 500.0\ntime_limit_s = 1800.0\n\n[deconfliction]\nmethod = \"priority\"\nsafety_distance_m = 1.5\n",
        map.to_string_lossy(),
        goals.join(", ")
    );
    for i in 0..LARGE_SWARM {
        text += &format!(
            "\n[[vehicles]]\nid = {}\ngoal = {i}\nstart = {}\nradius_m = 0.3\n",
            i + 1,
            place(i, 0.0, 2.0)
        );
    }
    text
}
