//! The host's tests and examples: built by cargo, then several programs run at once. cargo itself
//! runs one program after the other, and most have one long test, during which the other cores
//! would be idle.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell::{self, cargo, command, compile};

/// Programs in the order in which they start before all others: those that take longest.
const STARTED_FIRST: [&str; 9] = [
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
const NEED_BOARDS_OR_CLIENTS: [&str; 9] = [
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
const BOARD_AND_CLIENT_VARIABLES: [&str; 3] =
    ["FLOCKMATE_FIRMWARE", "FLOCKMATE_CHROMIUM", "FLOCKMATE_PYTHON"];
/// Programs whose tests measure the companion by the wall clock: they run alone.
const RUN_ALONE: [&str; 1] = ["rehearsal"];
/// Number of tests of one program that run at once. Tests with boards mostly wait, so it is more
/// than one.
const TESTS_AT_ONCE: &str = "2";
/// The same number for programs whose tests wait for Python clients or for processes in real time.
const WAITING_TESTS_AT_ONCE: [(&str, &str); 3] =
    [("closed_loop", "4"), ("conformance", "4"), ("rehearsal", "6")];

/// Environment variables with which programs run: name and value.
pub type Environment = Vec<(&'static str, OsString)>;

/// A program of tests, or an example, which fails if its own checks fail.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TestProgram {
    name: String,
    path: PathBuf,
    /// Directory of its package: tests find their files from there.
    package_folder: PathBuf,
}

/// The program of tests or example that cargo built; `None` for any other artifact.
fn test_program_of(artifact: &Value) -> Option<TestProgram> {
    let target = &artifact["target"];
    if artifact["profile"]["test"] != true && target["kind"][0] != "example" {
        return None;
    }
    let manifest = PathBuf::from(artifact["manifest_path"].as_str()?);
    Some(TestProgram {
        name: target["name"].as_str()?.to_owned(),
        path: artifact["executable"].as_str()?.into(),
        package_folder: manifest.parent()?.to_owned(),
    })
}

/// Builds all of the workspace and returns its test programs and examples; a warning is an error.
pub fn build() -> Result<Vec<TestProgram>> {
    let built = compile(cargo().args(["test", "--workspace", "--no-run", "--locked"]))?;
    ensure!(built.warnings == 0, "{} warnings", built.warnings);
    let programs: Vec<_> = built.artifacts.iter().filter_map(test_program_of).collect();
    ensure!(!programs.is_empty(), "cargo names no program of tests");
    Ok(programs)
}

/// Sort key of a program: those with a smaller number start earlier.
fn start_order(program: &TestProgram) -> usize {
    STARTED_FIRST.iter().position(|first| *first == program.name).unwrap_or(STARTED_FIRST.len())
}

/// Runs one program and prints all that it printed. True if it passed.
fn run_program(program: &TestProgram, environment: &Environment) -> Result<bool> {
    let begun = Instant::now();
    let mut tests = command(&program.path);
    tests.current_dir(&program.package_folder).env("CARGO_MANIFEST_DIR", &program.package_folder);
    let waiting = WAITING_TESTS_AT_ONCE.iter().find(|(name, _)| *name == program.name);
    let at_once = waiting.map_or(TESTS_AT_ONCE, |(_, at_once)| *at_once);
    tests.env("RUST_TEST_THREADS", at_once).envs(environment.iter().cloned());
    // The programs that tests run were built together with the tests.
    tests.env("FLOCKMATE_BUILT", "1");
    let output = tests.output().with_context(|| format!("cannot start {tests:?}"))?;
    let printed = [output.stdout, output.stderr].concat();
    let (name, seconds) = (&program.name, begun.elapsed().as_secs_f32());
    println!("-- {name}, {seconds:.0} s\n{}", String::from_utf8_lossy(&printed).trim());
    Ok(output.status.success())
}

/// Runs `programs`, `at_once` of them at a time, and names those that failed.
fn run_all_and_name_failed(
    programs: Vec<TestProgram>,
    at_once: usize,
    environment: &Environment,
) -> Result<Vec<String>> {
    let waiting = Mutex::new(programs.into_iter());
    let next = || waiting.lock().expect("no holder panics").next();
    let runner = || -> Result<Vec<String>> {
        let mut failed = Vec::new();
        while let Some(program) = next() {
            if !run_program(&program, environment)? {
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

/// Runs all tests and examples, also those in documentation, even if some fail. `others` builds
/// boards, browser and clients and returns the variables that name them; the programs of
/// `NEED_BOARDS_OR_CLIENTS` run after it. With `None` they run without these variables.
///
/// # Errors
///
/// The names of the programs that failed.
pub fn run(
    programs: Vec<TestProgram>,
    others: Option<impl FnOnce() -> Result<Environment>>,
) -> Result<()> {
    let belongs =
        |list: &'static [&str]| move |program: &TestProgram| list.contains(&&*program.name);
    let (alone, mut programs): (Vec<_>, Vec<_>) =
        programs.into_iter().partition(belongs(&RUN_ALONE));
    programs.sort_by_key(start_order);
    let (waiting, free): (Vec<_>, Vec<_>) =
        programs.into_iter().partition(belongs(&NEED_BOARDS_OR_CLIENTS));
    // One more than there are cores: some wait for processes or clients that keep real time.
    let at_once = 1 + std::thread::available_parallelism().map_or(2, usize::from);
    // Given these paths, where nothing is, a test that needs a board, browser or client fails;
    // without the variables it would be skipped.
    let absent = || BOARD_AND_CLIENT_VARIABLES.map(|name| (name, "/not/built/yet".into())).into();
    let mut failed = run_all_and_name_failed(
        free,
        at_once,
        &others.as_ref().map_or_else(Vec::new, |_| absent()),
    )?;
    let found = others.map_or_else(|| Ok(Vec::new()), |bring| bring())?;
    failed.extend(run_all_and_name_failed(waiting, at_once, &found)?);
    failed.extend(run_all_and_name_failed(alone, 1, &found)?);
    let documentation = shell::run(cargo().args(["test", "--workspace", "--doc", "--locked"]));
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    documentation
}

#[cfg(test)]
mod tests;
