//! Flies the demo with radios of short range; `cargo xtask bench --only range` flies twenty seeds
//! of each range.
//!
//! Vehicles that lose each other may land short of their goals; but none may touch anything or come
//! too near another one, and each must log why it landed.

use anyhow::{Context, Result};
use clap::Parser;
use flockmate_tests::edge::{Outcome, RadioEdgeMission};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::report::LogEvent;
use host_sim::scenario;
use host_sim::swarm::{self, SwarmFlight};
use rayon::prelude::*;

const DEMO: &str = include_str!("../../../../host-sim/scenarios/demo.toml");
/// Radio ranges, metres, and how many of twenty flights must be complete; the last is the demo's
/// own range.
const RANGES: [(f32, usize); 5] = [(5.0, 10), (8.0, 17), (12.0, 19), (20.0, 20), (500.0, 20)];

#[derive(Parser)]
#[command(about = "The demo with a radio of short range")]
struct Args {
    /// Seeds flown of each range.
    #[arg(long, value_name = "N", default_value_t = 20)]
    seeds: u64,
    /// Only this range, metres.
    #[arg(long, value_name = "METRES")]
    range: Option<f32>,
    /// Fly each seed N times with a fault: a vehicle fails near the place where it leaves the radio
    /// range of the others.
    #[arg(long, value_name = "N", default_value_t = 0)]
    strikes: usize,
    /// The first seed of the strikes.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    from: u64,
    /// The same faults, but every vehicle hears every other one.
    #[arg(long)]
    heard: bool,
    /// Only this seed, with the log of the companions.
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
}

fn main() -> Result<()> {
    let args = Args::parse();
    if args.strikes > 0 {
        return fly_with_failures(&args);
    }
    let mut bad = false;
    for (range_m, complete_least) in RANGES {
        if args.range.is_some_and(|only| only != range_m) {
            continue;
        }
        let seeds = args.seed.map_or(1..=args.seeds, |seed| seed..=seed);
        let flown: Vec<(u64, Result<SwarmFlight>)> =
            seeds.into_par_iter().map(|seed| (seed, fly(seed, range_m))).collect();
        let flights = flown.len();
        let (mut complete, mut safety, mut stood, mut left, mut unnamed) = (0, [0; 3], 0, 0, 0);
        for (seed, flight) in flown {
            let SwarmFlight { result, log, .. } = flight.with_context(|| format!("seed {seed}"))?;
            for event in log.iter().filter(|_| args.seed.is_some()) {
                println!("  {:7.2} s, vehicle {:?}: {}", event.t_s, event.vehicle, event.text);
            }
            complete += usize::from(result.complete);
            stood += print_standstills(&log, &format!("range {range_m} m, seed {seed}"));
            let counts =
                [result.safety.violations, result.safety.wall_contacts, result.safety.deadlocks];
            safety.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
            for vehicle in
                result.vehicles.iter().filter(|v| v.goal.is_some() && !(v.reached && v.landed))
            {
                // The reason that the vehicle logged when it gave up its goal.
                let said = log
                    .iter()
                    .rfind(|e| e.vehicle == Some(vehicle.id) && e.text.contains("→ Land: "));
                let why = said.map_or("no reason", |event| &event.text);
                println!(
                    "  range {range_m} m, seed {seed}, vehicle {}: {}; {why}",
                    vehicle.id, vehicle.end
                );
                left += usize::from(!vehicle.landed && !vehicle.end.starts_with("Ready"));
                unnamed += usize::from(said.is_none());
            }
            if counts != [0; 3] {
                println!(
                    "  range {range_m} m, seed {seed}: violations, contacts, deadlocks {counts:?}"
                );
            }
        }
        println!(
            "range {range_m} m: {complete}/{} complete, {} violations, {} contacts, {} deadlocks, {stood} stood \
             for 20 s, {left} not landed, {unnamed} without a reason",
            flights, safety[0], safety[1], safety[2]
        );
        let least = complete_least * flights / 20;
        bad |= complete < least || safety != [0; 3] || left + unnamed > 0;
    }
    if bad {
        std::process::exit(1);
    }
    Ok(())
}

/// Prints the standstills of `flight` that ended, and returns their number.
fn print_standstills(log: &[LogEvent], flight: &str) -> usize {
    let stood = log.iter().filter(|event| event.text.starts_with("stood for"));
    let print = |event: &&LogEvent| {
        println!("  {flight}, vehicle {}: {}", event.vehicle.unwrap_or(0), event.text);
    };
    stood.inspect(print).count()
}

/// Flies missions in which a vehicle fails at the edge of the radio range, judged by true motion.
fn fly_with_failures(args: &Args) -> Result<()> {
    let of_seed = |seed: u64| -> Result<Vec<Outcome>> {
        let mut edge = RadioEdgeMission::new(seed)?;
        if args.heard {
            edge.let_all_hear();
        }
        (0..args.strikes).filter_map(|_| edge.fly_with_fault().transpose()).collect()
    };
    let seeds = args.seed.map_or(args.from..args.from + args.seeds, |seed| seed..seed + 1);
    let flown: Vec<(u64, Result<Vec<Outcome>>)> =
        seeds.into_par_iter().map(|seed| (seed, of_seed(seed))).collect();
    let (mut flights, mut counts) = (0, [0; 5]);
    for (seed, outcomes) in flown {
        for outcome in outcomes.with_context(|| format!("seed {seed}"))? {
            flights += 1;
            let found =
                [outcome.forbidden.len(), outcome.near_struck.len(), outcome.not_landed.len()];
            let all =
                [found[0], found[1], found[2], outcome.deadlocks as usize, outcome.arrived_count];
            counts.iter_mut().zip(all).for_each(|(sum, count)| *sum += count);
            if found != [0; 3] {
                println!("  seed {seed}, {}, {} deadlocks", outcome.description, outcome.deadlocks);
                outcome
                    .log
                    .iter()
                    .filter(|_| args.seed.is_some())
                    .for_each(|line| println!("  {line}"));
                let lines = [outcome.forbidden, outcome.near_struck, outcome.not_landed];
                lines.iter().flatten().for_each(|line| println!("    {line}"));
            }
        }
    }
    let [wrong, near, aloft, deadlocks, arrived] = counts;
    println!(
        "{flights} flights with a failure at the edge of the range: {wrong} wrong, {near} near the vehicle struck, \
         {aloft} not landed, {deadlocks} deadlocks, {arrived} arrived"
    );
    if wrong + aloft > 0 {
        std::process::exit(1);
    }
    Ok(())
}

fn fly(seed: u64, range_m: f32) -> Result<SwarmFlight> {
    let text = DEMO.replacen("seed = 1", &format!("seed = {seed}"), 1);
    let mut parsed = scenario::parse(&text, "demo.toml")?;
    parsed.simulation.radio_range_m = range_m;
    let mut mission = PreparedMission::prepare(parsed, &Progress::hidden())?;
    let plan = mission.plan()?;
    swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden())
}
