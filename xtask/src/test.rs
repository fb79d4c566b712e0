//! `cargo xtask test`: runs everything that CI runs.

use std::time::Instant;

use anyhow::{Result, ensure};

use crate::bare_metal::{self, Board, BuiltPrograms};
use crate::host_tests::{self, Environment, TestProgram};
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
fn check_and_build_host() -> Result<Vec<TestProgram>> {
    run_step("lints", || {
        let mut lints = cargo();
        lints.args(["clippy", "--workspace", "--all-targets", "--locked"]);
        shell::run(lints.args(["--", "-D", "warnings"]))
    })?;
    run_step("documents", || {
        let mut doc = cargo();
        doc.args(["doc", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "-D warnings");
        DOCUMENTED.iter().for_each(|library| _ = doc.args(["-p", library]));
        shell::run(&mut doc)
    })?;
    run_step("structure", structure::run)?;
    run_step("licences", licences::check_licences)?;
    run_step("host tests' build", host_tests::build)
}

/// Builds the firmware for every board and installs what the tests run beside it. Returns the
/// environment variables by which tests find these.
fn build_boards_and_clients() -> Result<Environment> {
    let mut found = Vec::new();
    run_step("boards", || {
        for board in Board::ALL {
            let BuiltPrograms { folder: programs, warnings } = bare_metal::build(board)?;
            ensure!(warnings == 0, "the firmware for {} has warnings", board.name());
            if board == Board::Qemu {
                found.push(("FLOCKMATE_FIRMWARE", programs.into_os_string()));
            }
        }
        install::install_missing(install::EMULATOR)
    })?;
    run_step("browser", || install::install_missing(install::BROWSER))?;
    run_step("Python clients", || {
        found.push(("FLOCKMATE_PYTHON", install::install_python_clients()?.into_os_string()));
        Ok(())
    })?;
    Ok(found)
}

/// Runs every step. The firmware is built in parallel with the host's programs, because each build
/// spends minutes on one crate at a time, and with the tests that need no board. The later steps
/// run one after the other.
fn run_steps(args: &Args) -> Result<()> {
    run_step("format", || shell::run(cargo().args(["fmt", "--all", "--check"])))?;
    std::thread::scope(|scope| {
        let others = (!args.quick).then(|| scope.spawn(build_boards_and_clients));
        let programs = check_and_build_host()?;
        let others = others.map(|others| || others.join().expect("builds without panic"));
        run_step("host tests", || host_tests::run(programs, others))
    })?;
    if args.quick {
        return Ok(());
    }
    let stack =
        run_step("emulated flight", || emulate::fly_for_stack_use(&emulate::Args::default()))?;
    run_step("sizes", || {
        Board::ALL
            .into_iter()
            .try_for_each(|board| size::print_and_check_rows(board, stack).map(drop))
    })
}

/// Runs the steps and prints the time each took.
pub fn run(args: &Args) -> Result<()> {
    let begun = Instant::now();
    run_steps(args)?;
    println!("== all passed in {:.0} s", begun.elapsed().as_secs_f32());
    Ok(())
}

/// Runs a step and prints its name, and the time that it took if it passed.
fn run_step<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    println!("== {name}");
    let begun = Instant::now();
    let done = work()?;
    println!("== {name}: passed in {:.0} s", begun.elapsed().as_secs_f32());
    Ok(done)
}
