//! The demo with a radio that does not reach far; `cargo xtask bench --only range` flies twenty seeds of each range.
//!
//! Where vehicles lose one another they may land short of their goals, but they touch nothing, come near nobody, and each
//! names why.

use anyhow::{Context, Result};
use clap::Parser;
use host_sim::mission::Mission;
use host_sim::progress::Progress;
use host_sim::scenario;
use host_sim::swarm::{self, Flight};
use rayon::prelude::*;

const DEMO: &str = include_str!("../../../../host-sim/scenarios/demo.toml");
/// Ranges, metres, and how many of twenty are complete at least; the last is the demo's own.
const RANGES: [(f32, usize); 5] = [(5.0, 0), (8.0, 0), (12.0, 15), (20.0, 19), (500.0, 20)];

#[derive(Parser)]
#[command(about = "The demo with a radio of short range")]
struct Args {
    /// Seeds flown of each range.
    #[arg(long, value_name = "N", default_value_t = 20)]
    seeds: u64,
    /// Only this range, metres.
    #[arg(long, value_name = "METRES")]
    range: Option<f32>,
    /// Only this seed, with what the companions said.
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
}

fn main() -> Result<()> {
    let args = Args::parse();
    let mut bad = false;
    for (range_m, complete_least) in RANGES {
        if args.range.is_some_and(|only| only != range_m) {
            continue;
        }
        let seeds = args.seed.map_or(1..=args.seeds, |seed| seed..=seed);
        let flown: Vec<(u64, Result<Flight>)> =
            seeds.into_par_iter().map(|seed| (seed, fly(seed, range_m))).collect();
        let flights = flown.len();
        let (mut complete, mut safety, mut left, mut unnamed) = (0, [0; 3], 0, 0);
        for (seed, flight) in flown {
            let Flight { result, log, .. } = flight.with_context(|| format!("seed {seed}"))?;
            for event in log.iter().filter(|_| args.seed.is_some()) {
                println!("  {:7.2} s, vehicle {:?}: {}", event.t_s, event.vehicle, event.text);
            }
            complete += usize::from(result.complete);
            let counts = [result.safety.violations, result.safety.wall_contacts, result.safety.deadlocks];
            safety.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
            for vehicle in result.vehicles.iter().filter(|v| v.goal.is_some() && !(v.reached && v.landed)) {
                println!("  range {range_m} m, seed {seed}, vehicle {}: {}", vehicle.id, vehicle.end);
                left += usize::from(!vehicle.landed && !vehicle.end.starts_with("Ready"));
                unnamed += usize::from(!vehicle.end.contains(':'));
            }
            if counts != [0; 3] {
                println!("  range {range_m} m, seed {seed}: violations, contacts, deadlocks {counts:?}");
            }
        }
        println!(
            "range {range_m} m: {complete}/{} complete, {} violations, {} contacts, {} deadlocks, {left} not landed, \
             {unnamed} without a reason",
            flights, safety[0], safety[1], safety[2]
        );
        let least = complete_least * flights / 20;
        bad |= complete < least || safety != [0; 3] || left > 0;
    }
    if bad {
        std::process::exit(1);
    }
    Ok(())
}

fn fly(seed: u64, range_m: f32) -> Result<Flight> {
    let text = DEMO.replacen("seed = 1", &format!("seed = {seed}"), 1);
    let mut parsed = scenario::parse(&text, "demo.toml")?;
    parsed.simulation.radio_range_m = range_m;
    let mut mission = Mission::prepare(parsed, &Progress::hidden())?;
    let plan = mission.plan()?;
    swarm::fly(&mission, &plan, "fly", false, &Progress::hidden())
}
