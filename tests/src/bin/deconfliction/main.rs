//! The deconfliction suite: meetings that are hard, flown over many seeds with each method. Prints one line per case and
//! method; `cargo xtask bench --only deconfliction` runs it.
//!
//! Every case is a map made here, written as OctoMap and read back like any other, and a scenario's text, so that each can
//! be flown again alone.

mod cases;

use std::path::Path;

use anyhow::{Context, Result};
use clap::Parser;
use host_sim::mission::Mission;
use host_sim::progress::Progress;
use host_sim::result::MissionResult;
use host_sim::{scenario, swarm};
use rayon::prelude::*;
use serde::Serialize;

#[derive(Parser)]
#[command(about = "Hard meetings of vehicles, flown over many seeds")]
struct Args {
    /// Seeds flown of each case.
    #[arg(long, value_name = "N", default_value_t = 100)]
    seeds: u64,
    /// Only the cases whose name contains this.
    #[arg(long, value_name = "NAME", default_value = "")]
    only: String,
    /// Write the rows to this file as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<std::path::PathBuf>,
    /// Keep the maps and scenarios in this directory.
    #[arg(long, value_name = "DIR")]
    keep: Option<std::path::PathBuf>,
}

/// What one method did in one case, over all seeds.
#[derive(Debug, Default, Serialize)]
struct Row {
    name: String,
    method: &'static str,
    seeds: u64,
    /// Missions that ended complete and clean.
    complete: u64,
    /// Missions for which no plan was found.
    unplanned: u64,
    violations: u32,
    wall_contacts: u32,
    deadlocks: u32,
    /// Smallest separation seen, metres.
    min_separation_m: f64,
    /// Mean share by which flights take longer than the same paths flown at the nominal speed.
    extra_time: f64,
}

fn main() -> Result<()> {
    let args = Args::parse();
    let scratch = tempfile::tempdir()?;
    let dir = args.keep.as_deref().unwrap_or(scratch.path());
    std::fs::create_dir_all(dir).with_context(|| format!("cannot make {}", dir.display()))?;
    println!(
        "{:34} {:10} {:>9} {:>9} {:>10} {:>9} {:>9} {:>8} {:>7}",
        "case", "method", "complete", "unplanned", "violations", "contacts", "deadlocks", "nearest", "extra"
    );
    let mut rows = Vec::new();
    for case in cases::all(dir)?.iter().filter(|case| case.name.contains(&args.only)) {
        for method in ["priority", "algorithm2"] {
            let row = fly_all(case, method, args.seeds, dir)?;
            println!(
                "{:34} {:10} {:>5}/{:<3} {:>9} {:>10} {:>9} {:>9} {:>6.2} m {:>5.0} %",
                row.name,
                row.method,
                row.complete,
                row.seeds,
                row.unplanned,
                row.violations,
                row.wall_contacts,
                row.deadlocks,
                row.min_separation_m,
                row.extra_time * 100.0
            );
            rows.push(row);
        }
    }
    if let Some(out) = &args.out {
        std::fs::write(out, serde_json::to_string_pretty(&rows)?)
            .with_context(|| format!("cannot write {}", out.display()))?;
    }
    Ok(())
}

fn fly_all(case: &cases::Case, method: &'static str, seeds: u64, dir: &Path) -> Result<Row> {
    let flown: Vec<Option<MissionResult>> = (1..=seeds)
        .into_par_iter()
        .map(|seed| fly(&case.scenario(method, seed), dir))
        .collect::<Result<_>>()?;
    let mut row =
        Row { name: case.name.clone(), method, seeds, min_separation_m: f64::INFINITY, ..Row::default() };
    let (mut extra, mut flights) = (0.0, 0);
    for result in &flown {
        let Some(result) = result else {
            row.unplanned += 1;
            continue;
        };
        row.complete += u64::from(result.complete);
        row.violations += result.safety.violations;
        row.wall_contacts += result.safety.wall_contacts;
        row.deadlocks += result.safety.deadlocks;
        row.min_separation_m =
            row.min_separation_m.min(result.safety.min_separation_m.unwrap_or(f64::INFINITY));
        for vehicle in result.vehicles.iter().filter(|v| v.landed && v.path_m > 0.0) {
            // Two metres up, two metres down at 1 m/s, the path at the nominal speed.
            extra += vehicle.flight_time_s / (vehicle.path_m / f64::from(cases::CRUISE_MPS) + 4.0) - 1.0;
            flights += 1;
        }
    }
    row.extra_time = extra / f64::from(flights.max(1));
    Ok(row)
}

/// Flies one mission; `None` if it cannot be planned.
fn fly(text: &str, dir: &Path) -> Result<Option<MissionResult>> {
    // Map files are named by their whole path, so the name only serves errors.
    let scenario = scenario::parse(text, &dir.join("case.toml").display().to_string())?;
    let mut mission = Mission::prepare(scenario, &Progress::hidden())?;
    let Ok(plan) = mission.plan() else { return Ok(None) };
    Ok(Some(swarm::fly(&mission, &plan, "fly", false, &Progress::hidden())?.result))
}
