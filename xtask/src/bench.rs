//! `cargo xtask bench`: builds the C++ baseline, then runs the bench that compares our programs
//! with it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::bare_metal::{self, Board};
use crate::install;
use crate::shell::{cargo, checkout_root, command, run, target_dir};

/// Source of the C++ baseline, relative to the checkout.
const BASELINE_SOURCE: &str = "../shared/peers/algorithm1.cpp";

/// Arguments of `bench`.
#[derive(clap::Args)]
pub struct Args {
    /// Write the rows to this file as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Run only the groups whose name contains this: roadmap, assignment, coverage, fields2cover,
    /// swarm, steps, worst-case, boards; or one of the suites: deconfliction, meetings, hostile,
    /// range; or profiles, which flies the demo by a debug and a release build and compares.
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// A checkout of cvar-upm/multi_uav_planning_binpat, with which the coverage rows are compared.
    #[arg(long, value_name = "DIR")]
    binpat: Option<PathBuf>,
    /// A checkout of Fields2Cover/Fields2Cover, with which its rows are compared.
    #[arg(long, value_name = "DIR")]
    fields2cover: Option<PathBuf>,
    /// Number of random seeds: for each case of the deconfliction suite, or each of the range
    /// suite.
    #[arg(long, value_name = "N")]
    seeds: Option<u64>,
    /// Number of meetings, or of forged frames in the hostile suite.
    #[arg(long, value_name = "N")]
    n: Option<u64>,
}

/// Runs the groups or the suite that `only` names, else all groups. If the C++ baseline cannot be
/// built, the rows that compare with it are skipped, and a line gives the reason.
pub fn run_bench(args: &Args) -> Result<()> {
    if args.only.as_deref() == Some("profiles") {
        return compare_profiles();
    }
    let run_release = ["run", "--release", "--quiet", "--package", "flockmate-tests", "--bin"];
    let mut bench = cargo();
    bench.args(run_release);
    if let Some(suite @ ("deconfliction" | "range")) = args.only.as_deref() {
        bench.args([suite, "--"]);
        if let Some(seeds) = args.seeds {
            bench.arg("--seeds").arg(seeds.to_string());
        }
        if let Some(out) = args.out.as_ref().filter(|_| suite == "deconfliction") {
            bench.arg("--out").arg(std::path::absolute(out)?);
        }
        return run(&mut bench);
    }
    if let Some(suite @ ("meetings" | "hostile")) = args.only.as_deref() {
        bench.args([suite, "--"]);
        if let Some(n) = args.n {
            bench.arg("--n").arg(n.to_string());
        }
        return run(&mut bench);
    }
    install::install_missing(install::INSTRUCTION_COUNTER)?;
    bench.args(["bench", "--"]);
    let runs = |group: &str| args.only.as_deref().is_none_or(|only| group.contains(only));
    if runs("worst-case") || runs("boards") {
        install::install_missing(install::EMULATOR)?;
        bench.env("FLOCKMATE_FIRMWARE", bare_metal::build(Board::Qemu)?.folder);
    }
    match build_baseline() {
        Ok(peer) => {
            bench.arg("--peer").arg(peer);
        }
        Err(why) => println!("roadmap rows: skipped, {why:#}"),
    }
    if let Some(binpat) = &args.binpat {
        bench.arg("--binpat").arg(std::path::absolute(binpat)?);
    }
    if let Some(fields2cover) = &args.fields2cover {
        bench.arg("--fields2cover").arg(std::path::absolute(fields2cover)?);
    }
    if let Some(out) = &args.out {
        bench.arg("--out").arg(std::path::absolute(out)?);
    }
    if let Some(only) = &args.only {
        bench.arg("--only").arg(only);
    }
    run(&mut bench)
}

/// Flies the demo by a debug and a release build, and checks that both write the same
/// `result.json`.
fn compare_profiles() -> Result<()> {
    let mut results = Vec::new();
    for (profile, option) in [("debug", None), ("release", Some("--release"))] {
        run(cargo().args(["build", "--locked", "-p", "host-sim"]).args(option))?;
        let out = target_dir().join("profiles").join(profile);
        run(command(target_dir().join(profile).join("host-sim"))
            .args(["demo", "--out"])
            .arg(&out))?;
        results.push(std::fs::read(out.join("result.json"))?);
    }
    ensure!(results[0] == results[1], "result.json differs in {}", target_dir().display());
    println!("the demo's result.json is the same in debug and release");
    Ok(())
}

/// Builds the C++ baseline with the options that its file's header gives, if its source is newer
/// than the program. Returns the program's path.
fn build_baseline() -> Result<PathBuf> {
    let source = checkout_root().join(BASELINE_SOURCE);
    let modified = |file: &Path| file.metadata().and_then(|m| m.modified());
    let source_time =
        modified(&source).with_context(|| format!("{BASELINE_SOURCE} is not there"))?;
    let program = target_dir().join("algorithm1");
    if modified(&program).is_ok_and(|built| built >= source_time) {
        return Ok(program);
    }
    install::install_missing(install::CPP_BASELINE)?;
    std::fs::create_dir_all(target_dir())?;
    run(command("g++")
        .args(["-O3", "-march=native", "-o"])
        .arg(&program)
        .arg(&source)
        .args(["-loctomap", "-loctomath"]))?;
    Ok(program)
}
