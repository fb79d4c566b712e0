//! The host's tests: built by cargo, then run several programs at once. cargo itself runs one after
//! the other, and most of them have one long test, beside which the other cores would be idle.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Stdio;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell::{self, cargo, command};

/// Programs in the order in which they start before all others: those that take longest.
const FIRST: [&str; 8] = [
    "closed_loop",
    "report",
    "coverage_losses",
    "companion",
    "schedule_model",
    "schedules",
    "coverage_flights",
    "conformance",
];
/// Programs that hold the companion to the wall clock: nothing runs beside them.
const ALONE: [&str; 1] = ["rehearsal"];
/// Tests of one program that run at once, on a core each. Those with boards and clients mostly
/// wait, so there is more than one.
const TESTS_AT_ONCE: &str = "2";

/// A program of tests, as cargo built it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Program {
    name: String,
    path: PathBuf,
    /// Directory of its package: tests find their files from there.
    package: PathBuf,
}

/// The program of tests that a line of cargo's messages names; `None` if it names none.
fn program(line: &str) -> Option<Program> {
    let message: Value = serde_json::from_str(line).ok()?;
    if message["reason"] != "compiler-artifact" || message["profile"]["test"] != true {
        return None;
    }
    let manifest = PathBuf::from(message["manifest_path"].as_str()?);
    Some(Program {
        name: message["target"]["name"].as_str()?.to_owned(),
        path: message["executable"].as_str()?.into(),
        package: manifest.parent()?.to_owned(),
    })
}

/// Builds the tests of the workspace and names their programs.
pub fn build() -> Result<Vec<Program>> {
    let mut build = cargo();
    build.args(["test", "--workspace", "--no-run", "--locked"]);
    build.args(["--message-format", "json-render-diagnostics"]);
    let built = build.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(built.status.success(), "the tests do not build");
    let programs: Vec<_> =
        String::from_utf8_lossy(&built.stdout).lines().filter_map(program).collect();
    ensure!(!programs.is_empty(), "cargo names no program of tests");
    Ok(programs)
}

/// Place of a program in the order of their starts.
fn turn(program: &Program) -> usize {
    FIRST.iter().position(|first| *first == program.name).unwrap_or(FIRST.len())
}

/// Runs one program and prints all that it printed. True if it passed.
fn passes(program: &Program, environment: &[(&str, OsString)]) -> Result<bool> {
    let begun = Instant::now();
    let mut tests = command(&program.path);
    tests.current_dir(&program.package).env("CARGO_MANIFEST_DIR", &program.package);
    tests.env("RUST_TEST_THREADS", TESTS_AT_ONCE).envs(environment.iter().cloned());
    let output = tests.output().with_context(|| format!("cannot start {tests:?}"))?;
    let printed = [output.stdout, output.stderr].concat();
    let (name, seconds) = (&program.name, begun.elapsed().as_secs_f32());
    println!("-- {name}, {seconds:.0} s\n{}", String::from_utf8_lossy(&printed).trim());
    Ok(output.status.success())
}

/// Runs `programs`, `at_once` of them at a time, and names those that failed.
fn failures(
    programs: Vec<Program>,
    at_once: usize,
    environment: &[(&str, OsString)],
) -> Result<Vec<String>> {
    let waiting = Mutex::new(programs.into_iter());
    let next = || waiting.lock().expect("no holder panics").next();
    let runner = || -> Result<Vec<String>> {
        let mut failed = Vec::new();
        while let Some(program) = next() {
            if !passes(&program, environment)? {
                failed.push(program.name);
            }
        }
        Ok(failed)
    };
    let failed: Vec<_> = std::thread::scope(|scope| {
        let runners: Vec<_> = (0..at_once).map(|_| scope.spawn(runner)).collect();
        runners.into_iter().map(|runner| runner.join().expect("runs without panic")).collect()
    });
    Ok(failed.into_iter().collect::<Result<Vec<_>>>()?.concat())
}

/// Runs the programs of tests and the examples in documentation, all of them although some fail.
/// By the variables in `environment` tests find clients and boards.
///
/// # Errors
///
/// The names of the programs that failed.
pub fn run(programs: Vec<Program>, environment: &[(&str, OsString)]) -> Result<()> {
    let (alone, mut beside): (Vec<_>, Vec<_>) =
        programs.into_iter().partition(|program| ALONE.contains(&program.name.as_str()));
    beside.sort_by_key(turn);
    let cores = std::thread::available_parallelism().map_or(2, usize::from);
    let mut failed = failures(beside, cores, environment)?;
    failed.extend(failures(alone, 1, environment)?);
    let documentation = shell::run(cargo().args(["test", "--workspace", "--doc", "--locked"]));
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    documentation
}

#[cfg(test)]
mod tests;
