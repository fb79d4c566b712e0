//! `cargo xtask bench`: our times beside those of the programs that we compare ourselves to,
//! measured alternately in one run.
//!
//! Prints a table; `--out FILE` writes the rows as JSON,
//! `[{ "name", "ours", "theirs", "ratio", "required", "unit", "n" }]`.

mod assignment;
mod boards;
mod coverage;
mod fidelity;
mod fields2cover;
mod roadmap;
mod row;
mod steps;
mod swarm;
mod worst_case;

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Parser;

use self::row::Row;

#[derive(Parser)]
#[command(about = "Our times beside those of other programs")]
struct Args {
    /// Write the rows to this file as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Run only the groups whose name contains this: roadmap, assignment, coverage, fields2cover,
    /// swarm, steps, worst-case, fidelity, boards.
    #[arg(long, value_name = "NAME", default_value = "")]
    only: String,
    /// The built C++ baseline for the roadmap rows; without it they are skipped.
    #[arg(long, value_name = "PROGRAM")]
    peer: Option<PathBuf>,
    /// A checkout of cvar-upm/multi_uav_planning_binpat for the coverage rows; without it most are
    /// skipped.
    #[arg(long, value_name = "DIR")]
    binpat: Option<PathBuf>,
    /// A checkout of Fields2Cover/Fields2Cover for its rows; without it they are skipped.
    #[arg(long, value_name = "DIR")]
    fields2cover: Option<PathBuf>,
    /// What the steps are counted under: only the work itself, with this many neighbours.
    #[arg(long, value_name = "N", hide = true)]
    steps_beside: Option<usize>,
}

/// Measures the groups that `--only` selects, and prints our times beside those of other programs.
fn main() -> Result<()> {
    let args = Args::parse();
    if let Some(neighbours) = args.steps_beside {
        steps::run_cases(neighbours);
        return Ok(());
    }
    let mut rows = Vec::new();
    if "roadmap".contains(&args.only) {
        match &args.peer {
            Some(peer) => rows.extend(roadmap::rows(peer)?),
            None => println!("roadmap: skipped, no --peer PROGRAM"),
        }
    }
    if "assignment".contains(&args.only) {
        rows.extend(assignment::rows());
    }
    if "coverage".contains(&args.only) {
        rows.extend(coverage::rows(args.binpat.as_deref())?);
    }
    if "fields2cover".contains(&args.only) {
        rows.extend(fields2cover::rows(args.fields2cover.as_deref())?);
    }
    if "swarm".contains(&args.only) {
        rows.extend(swarm::rows()?);
    }
    if "steps".contains(&args.only) {
        rows.extend(steps::rows()?);
    }
    if "worst-case".contains(&args.only) {
        rows.extend(worst_case::rows()?);
    }
    if "fidelity".contains(&args.only) {
        rows.extend(fidelity::rows());
    }
    if "boards".contains(&args.only) {
        boards::run()?;
    }
    println!(
        "{:24} {:>5} {:>13} {:>13} {:>8} {:>9}",
        "name", "n", "ours", "theirs", "ratio", "required"
    );
    for Row { name, ours, theirs, ratio, required, unit, n } in &rows {
        println!(
            "{name:24} {n:>5} {ours:>10.3} {unit} {theirs:>10.3} {unit} {ratio:>7.2}x {required:>8}x"
        );
    }
    if let Some(out) = &args.out {
        std::fs::write(out, serde_json::to_string_pretty(&rows)?)
            .with_context(|| format!("cannot write {}", out.display()))?;
    }
    Ok(())
}
