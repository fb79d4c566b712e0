//! `cargo xtask test`: runs everything that CI runs.

use std::time::Instant;

use anyhow::{Result, ensure};

use crate::bare_metal::{self, Board, Built};
use crate::host_tests::{self, Environment, Program};
use crate::shell::{self, cargo};
use crate::{emulate, install, licences, size, structure};

/// Crates whose documentation is checked: all libraries that others build on.
const DOCUMENTED: [&str; 8] = [
    "fpu",
    "lock-step",
    "planner-core",
    "companion",
    "sim-autopilot",
    "host-sim",
    "firmware",
    "board-bench",
];

/// Arguments of `test`.
#[derive(clap::Args)]
pub struct Args {
    /// Only formatting, lints, documents and the host's tests: no boards, browser, Python clients.
    #[arg(long)]
    quick: bool,
}

/// Checks the sources and builds programs and tests, without a warning.
fn host() -> Result<Vec<Program>> {
    step("lints", || {
        let mut lints = cargo();
        lints.args(["clippy", "--workspace", "--all-targets", "--locked"]);
        shell::run(lints.args(["--", "-D", "warnings"]))
    })?;
    step("documents", || {
        let mut doc = cargo();
        doc.args(["doc", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "-D warnings");
        DOCUMENTED.iter().for_each(|library| _ = doc.args(["-p", library]));
        shell::run(&mut doc)
    })?;
    step("structure", structure::run)?;
    step("licences", licences::check)?;
    step("host tests' build", host_tests::build)
}

/// Builds the firmware for every board and installs what the tests run beside it. Returns the
/// environment variables by which tests find these.
fn boards_and_clients() -> Result<Environment> {
    let mut found = Vec::new();
    step("boards", || {
        for board in Board::ALL {
            let Built { folder: programs, warnings } = bare_metal::build(board)?;
            ensure!(warnings == 0, "the firmware for {} has warnings", board.name());
            if board == Board::Qemu {
                found.push(("FLOCKMATE_FIRMWARE", programs.into_os_string()));
            }
        }
        install::install_missing(install::EMULATOR)
    })?;
    step("browser", || install::install_missing(install::BROWSER))?;
    step("Python clients", || {
        found.push(("FLOCKMATE_PYTHON", install::python_clients()?.into_os_string()));
        Ok(())
    })?;
    Ok(found)
}

/// Runs every step. The firmware is built in parallel with the host's programs, because each build
/// spends minutes on one crate at a time, and with the tests that need no board. The later steps
/// run one after the other.
fn steps(args: &Args) -> Result<()> {
    step("format", || shell::run(cargo().args(["fmt", "--all", "--check"])))?;
    std::thread::scope(|scope| {
        let others = (!args.quick).then(|| scope.spawn(boards_and_clients));
        let programs = host()?;
        let others = others.map(|others| || others.join().expect("builds without panic"));
        step("host tests", || host_tests::run(programs, others))
    })?;
    if args.quick {
        return Ok(());
    }
    let stack = step("emulated flight", || emulate::fly_for_stack_use(&emulate::Args::default()))?;
    step("sizes", || {
        Board::ALL.into_iter().try_for_each(|board| size::rows(board, stack).map(drop))
    })
}

/// Runs the steps and prints the time each took.
pub fn run(args: &Args) -> Result<()> {
    let begun = Instant::now();
    steps(args)?;
    println!("== all passed in {:.0} s", begun.elapsed().as_secs_f32());
    Ok(())
}

fn step<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    println!("== {name}");
    let begun = Instant::now();
    let done = work()?;
    println!("== {name}: passed in {:.0} s", begun.elapsed().as_secs_f32());
    Ok(done)
}
