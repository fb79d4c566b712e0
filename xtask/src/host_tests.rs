//! The host's tests and examples: built by cargo, then run several programs at once. cargo itself
//! runs one after the other, and most of them have one long test, beside which the other cores
//! would be idle.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell::{self, cargo, command, compile};

/// Programs in the order in which they start before all others: those that take longest.
const FIRST: [&str; 9] = [
    "closed_loop",
    "coverage_losses",
    "schedules",
    "coverage_flights",
    "schedule_model",
    "fleet_model",
    "conformance",
    "worst_case",
    "report",
];
/// Programs that need boards, a browser or Python clients. The others run while these are built.
const NEED_OTHERS: [&str; 9] = [
    "board",
    "board_coverage",
    "board_cuts",
    "board_flights",
    "board_lock_step",
    "conformance",
    "logs",
    "report",
    "worst_case",
];
/// Variables by which tests find boards, browser and Python clients.
const OTHERS: [&str; 3] = ["FLOCKMATE_FIRMWARE", "FLOCKMATE_CHROMIUM", "FLOCKMATE_PYTHON"];
/// Programs that hold the companion to the wall clock: nothing runs beside them.
const ALONE: [&str; 1] = ["rehearsal"];
/// Tests of one program that run at once, on a core each. Those with boards mostly wait, so there
/// is more than one.
const TESTS_AT_ONCE: &str = "2";
/// The same of programs whose tests wait for Python clients, or for processes that keep real time.
const WAITING_AT_ONCE: [(&str, &str); 3] =
    [("closed_loop", "4"), ("conformance", "4"), ("rehearsal", "6")];

/// Variables with which programs run.
pub type Environment = Vec<(&'static str, OsString)>;

/// A program of tests, or an example, which fails if its own checks fail.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Program {
    name: String,
    path: PathBuf,
    /// Directory of its package: tests find their files from there.
    package: PathBuf,
}

/// The program of tests or example that cargo built; `None` for any other artifact.
fn program(artifact: &Value) -> Option<Program> {
    let target = &artifact["target"];
    if artifact["profile"]["test"] != true && target["kind"][0] != "example" {
        return None;
    }
    let manifest = PathBuf::from(artifact["manifest_path"].as_str()?);
    Some(Program {
        name: target["name"].as_str()?.to_owned(),
        path: artifact["executable"].as_str()?.into(),
        package: manifest.parent()?.to_owned(),
    })
}

/// Builds programs, tests and examples of the workspace without a warning and names the latter two.
pub fn build() -> Result<Vec<Program>> {
    let built = compile(cargo().args(["test", "--workspace", "--no-run", "--locked"]))?;
    ensure!(built.warnings == 0, "{} warnings", built.warnings);
    let programs: Vec<_> = built.artifacts.iter().filter_map(program).collect();
    ensure!(!programs.is_empty(), "cargo names no program of tests");
    Ok(programs)
}

/// Place of a program in the order of their starts.
fn turn(program: &Program) -> usize {
    FIRST.iter().position(|first| *first == program.name).unwrap_or(FIRST.len())
}

/// Runs one program and prints all that it printed. True if it passed.
fn passes(program: &Program, environment: &Environment) -> Result<bool> {
    let begun = Instant::now();
    let mut tests = command(&program.path);
    tests.current_dir(&program.package).env("CARGO_MANIFEST_DIR", &program.package);
    let waiting = WAITING_AT_ONCE.iter().find(|(name, _)| *name == program.name);
    let at_once = waiting.map_or(TESTS_AT_ONCE, |(_, at_once)| *at_once);
    tests.env("RUST_TEST_THREADS", at_once).envs(environment.iter().cloned());
    // The programs that tests run are built with them.
    tests.env("FLOCKMATE_BUILT", "1");
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
    environment: &Environment,
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

/// Runs tests and examples, those in documentation too, all of them although some fail. Those that
/// need what `others` brings, and names by variables, wait for it; `None`: they run without it.
///
/// # Errors
///
/// The names of the programs that failed.
pub fn run(
    programs: Vec<Program>,
    others: Option<impl FnOnce() -> Result<Environment>>,
) -> Result<()> {
    let belongs = |list: &'static [&str]| move |program: &Program| list.contains(&&*program.name);
    let (alone, mut programs): (Vec<_>, Vec<_>) = programs.into_iter().partition(belongs(&ALONE));
    programs.sort_by_key(turn);
    let (waiting, free): (Vec<_>, Vec<_>) = programs.into_iter().partition(belongs(&NEED_OTHERS));
    // One more than there are cores: some wait for processes or clients that keep real time.
    let at_once = 1 + std::thread::available_parallelism().map_or(2, usize::from);
    // With these a test that asks for the others fails, where it would be skipped without.
    let absent = || OTHERS.map(|name| (name, "/not/built/yet".into())).into();
    let mut failed = failures(free, at_once, &others.as_ref().map_or_else(Vec::new, |_| absent()))?;
    let found = others.map_or_else(|| Ok(Vec::new()), |bring| bring())?;
    failed.extend(failures(waiting, at_once, &found)?);
    failed.extend(failures(alone, 1, &found)?);
    let documentation = shell::run(cargo().args(["test", "--workspace", "--doc", "--locked"]));
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    documentation
}

#[cfg(test)]
mod tests;
