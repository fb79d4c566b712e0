//! `cargo xtask test`: runs everything that CI runs.

use std::ffi::OsString;
use std::time::Instant;

use anyhow::{Result, ensure};

use crate::bare_metal::{self, Board, Built};
use crate::host_tests::{self, Program};
use crate::shell::{self, cargo};
use crate::{emulate, install, size, structure};

/// Packages and an example of each, which fails if its own checks fail.
const EXAMPLES: [(&str, &str); 3] =
    [("planner-core", "ten_uavs"), ("companion", "run_loop"), ("firmware", "smallest_board")];

/// Arguments of `test`.
#[derive(clap::Args)]
pub struct Args {
    /// Only formatting, lints and the host's tests: no browser, no Python clients, no boards.
    #[arg(long)]
    quick: bool,
}

/// Steps that check the sources only: lints, documentation, structure.
fn sources() -> Result<()> {
    step("lints", || {
        shell::run(cargo().args([
            "clippy",
            "--workspace",
            "--all-targets",
            "--locked",
            "--",
            "-D",
            "warnings",
        ]))
    })?;
    step("documents", || {
        let mut doc = cargo();
        doc.args([
            "doc",
            "--no-deps",
            "--locked",
            "-p",
            "fpu",
            "-p",
            "planner-core",
            "-p",
            "companion",
        ]);
        shell::run(doc.env("RUSTDOCFLAGS", "-D warnings"))
    })?;
    step("structure", structure::run)
}

/// Runs the programs that check themselves.
fn examples() -> Result<()> {
    for (package, example) in EXAMPLES {
        shell::run(cargo().args([
            "run",
            "--quiet",
            "--locked",
            "-p",
            package,
            "--example",
            example,
        ]))?;
    }
    Ok(())
}

/// Builds the firmware for every board and installs what the tests run beside it. Returns the
/// variables by which tests find these.
fn boards_and_clients() -> Result<Vec<(&'static str, OsString)>> {
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

/// Checks the sources, then builds `host-sim` as its users run it, which tests compare with the
/// debug build, then the tests.
fn sources_and_host() -> Result<Vec<Program>> {
    sources()?;
    step("release build", || {
        shell::run(cargo().args(["build", "--release", "--locked", "-p", "host-sim"]))
    })?;
    step("host tests' build", host_tests::build)
}

/// Runs every step. Boards and host are built side by side, because each build waits for one
/// crate at a time for minutes; then the steps follow one another, up to the first that fails.
fn steps(args: &Args) -> Result<()> {
    step("format", || shell::run(cargo().args(["fmt", "--all", "--check"])))?;
    if args.quick {
        sources()?;
        let programs = step("host tests' build", host_tests::build)?;
        return step("host tests", || host_tests::run(programs, &[]));
    }
    let (found, programs) = std::thread::scope(|scope| {
        let boards = scope.spawn(boards_and_clients);
        let programs = sources_and_host();
        (boards.join().expect("builds without panic"), programs)
    });
    let (found, programs) = (found?, programs?);
    step("host tests", || host_tests::run(programs, &found))?;
    step("examples", examples)?;
    let stack = step("emulated flight", || emulate::run_emulate(&emulate::Args::default()))?;
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
