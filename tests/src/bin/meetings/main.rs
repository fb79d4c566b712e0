//! Simulates random meetings of whole companions, judged by the true motion;
//! `cargo xtask bench --only meetings` runs ten thousand.

use std::time::Instant;

use clap::Parser;
use flockmate_tests::meeting::{self, Outcome, scene};
use flockmate_tests::setpoints::SetpointStats;
use rayon::prelude::*;

/// Most meetings with setpoints unfit to be flown that are listed.
const MAX_LISTED: usize = 10;

#[derive(Parser)]
#[command(about = "Random meetings of whole companions")]
struct Args {
    /// Number of meetings.
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    n: u64,
    /// The first seed; with --trace the only one.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Print what happens in one meeting.
    #[arg(long)]
    trace: bool,
    /// Fly two vehicles that pass each other at exactly the scheduled separation instead: none may
    /// be stopped.
    #[arg(long)]
    passing: bool,
    /// Time limit of a meeting, seconds after its start, in place of that of its scene: vehicles
    /// that are still up after a long time wait without a bound.
    #[arg(long, value_name = "SECONDS")]
    limit: Option<f32>,
    /// Only meetings of this geometry.
    #[arg(long, value_name = "KIND")]
    kind: Option<String>,
}

/// Flies one meeting, and prints its plans and what happened.
fn fly_and_print(scene: &scene::Scene) {
    let scene::Scene { kind, radio_delay_s, radio_loss, liar, .. } = scene;
    println!("{kind}, delay {radio_delay_s:.2?} s, loss {radio_loss:.2}, liar {liar:?}");
    for vehicle in &scene.vehicles {
        let plan = &vehicle.plan;
        let points: Vec<_> =
            plan.path.waypoints().iter().map(|w| w.position.as_slice().to_vec()).collect();
        println!(
            "{}: {:?}, pad {:.2?}, departs {:.1} s, path {points:.1?}, gates {:.1?}",
            vehicle.id,
            vehicle.kind,
            vehicle.pad.as_slice(),
            plan.depart_s,
            plan.gates
        );
    }
    let outcome = meeting::fly_traced(scene);
    outcome.trace.iter().for_each(|line| println!("{line}"));
    println!("{}", meeting::outcome_line(&outcome));
    outcome
        .unfit_setpoints
        .iter()
        .for_each(|(i, at_s, what)| println!("  {}: {at_s:.2} s: {what}", i + 1));
}

fn main() {
    let args = Args::parse();
    let draw = |seed| {
        let scene =
            if args.passing { scene::passing_scene(seed) } else { scene::random_scene(seed) };
        scene::Scene { limit_s: args.limit.unwrap_or(scene.limit_s), ..scene }
    };
    if args.trace {
        fly_and_print(&draw(args.seed));
        return;
    }
    let began = Instant::now();
    let outcomes: Vec<Outcome> = (args.seed..args.seed + args.n)
        .into_par_iter()
        .map(draw)
        .filter(|scene| args.kind.as_deref().is_none_or(|kind| scene.kind == kind))
        .map(|scene| meeting::fly(&scene))
        .collect();
    let took_s = began.elapsed().as_secs_f64();
    for outcome in outcomes.iter().filter(|outcome| outcome.breaks_rule()) {
        println!("{}", meeting::outcome_line(outcome));
    }
    let sum = meeting::summary(&outcomes);
    println!("{sum}");
    let stops: u32 = outcomes.iter().map(|outcome| outcome.filter_stops).sum();
    let longest_s = outcomes.iter().map(|outcome| outcome.longest_stop_s).fold(0.0, f32::max);
    let unheard_s =
        outcomes.iter().map(|outcome| outcome.longest_unheard_stop_s).fold(0.0, f32::max);
    println!(
        "{stops} stops by the safety filter, the longest {longest_s:.2} s, or {unheard_s:.2} s \
         where a neighbour was silent for more than a second"
    );
    let mut blocked: Vec<_> = outcomes.iter().map(|o| (o.max_blocked_count, o.seed)).collect();
    blocked.sort_unstable();
    println!(
        "paths found blocked at most, and seeds: {:?}",
        blocked.iter().rev().take(8).collect::<Vec<_>>()
    );
    if args.passing {
        for kind in scene::PASSINGS {
            let of = || outcomes.iter().filter(|outcome| outcome.kind == kind);
            let stops: u32 = of().map(|outcome| outcome.filter_stops).sum();
            let longest = of().max_by(|a, b| a.longest_stop_s.total_cmp(&b.longest_stop_s));
            let (seed, longest_s) = longest.map_or((0, 0.0), |o| (o.seed, o.longest_stop_s));
            println!(
                "  {kind}: {} passed, {stops} stops, the longest {longest_s:.2} s (seed {seed})",
                of().count()
            );
        }
    }
    let mut setpoints = SetpointStats::default();
    outcomes.iter().for_each(|outcome| setpoints.merge(&outcome.setpoints));
    println!("{setpoints}");
    for outcome in outcomes.iter().filter(|o| !o.unfit_setpoints.is_empty()).take(MAX_LISTED) {
        let (vehicle, at_s, what) = &outcome.unfit_setpoints[0];
        println!("  seed {}, vehicle {}, {at_s:.2} s: {what}", outcome.seed, vehicle + 1);
    }
    println!("{took_s:.0} s, {:.1} meetings/s", outcomes.len() as f64 / took_s);
    if sum.breaks_rule() {
        std::process::exit(1);
    }
}
