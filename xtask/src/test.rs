//! `cargo xtask test`: runs everything that CI runs.

use std::time::Instant;

use anyhow::{Result, ensure};

use crate::bare_metal::{self, Board, Built};
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

/// Steps that check the sources only: format, lints, documentation, structure.
fn sources() -> Result<()> {
    step("format", || shell::run(cargo().args(["fmt", "--all", "--check"])))?;
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

/// Runs every step; stops at the first that fails.
fn steps(args: &Args) -> Result<()> {
    sources()?;
    if args.quick {
        return step("host tests", || {
            shell::run(cargo().args(["test", "--workspace", "--no-fail-fast", "--locked"]))
        });
    }
    let mut firmware = None;
    step("boards", || {
        for board in Board::ALL {
            let Built { folder: programs, warnings } = bare_metal::build(board)?;
            ensure!(warnings == 0, "the firmware for {} has warnings", board.name());
            firmware = firmware.take().or((board == Board::Qemu).then_some(programs));
        }
        install::install_missing(install::EMULATOR)
    })?;
    step("browser", || install::install_missing(install::BROWSER))?;
    let mut python = None;
    step("Python clients", || {
        python = Some(install::python_clients()?);
        Ok(())
    })?;
    // The release build comes first, because tests compare it with the debug build.
    step("release build", || {
        shell::run(cargo().args(["build", "--release", "--locked", "-p", "host-sim"]))
    })?;
    step("host tests", || {
        let mut tests = cargo();
        tests.args(["test", "--workspace", "--no-fail-fast", "--locked"]);
        tests.env("RUST_TEST_THREADS", tests_at_once().to_string());
        if let Some(python) = &python {
            tests.env("FLOCKMATE_PYTHON", python);
        }
        if let Some(firmware) = &firmware {
            tests.env("FLOCKMATE_FIRMWARE", firmware);
        }
        shell::run(&mut tests)
    })?;
    step("examples", examples)?;
    let mut stack = 0;
    step("emulated flight", || {
        stack = emulate::run_emulate(&emulate::Args::default())?;
        Ok(())
    })?;
    step("sizes", || {
        for board in Board::ALL {
            size::rows(board, stack)?;
        }
        Ok(())
    })
}

/// Number of tests that run at once: at least four, since those with boards and clients mostly
/// wait.
fn tests_at_once() -> usize {
    std::thread::available_parallelism().map_or(4, |cores| cores.get().max(4))
}

/// Runs the steps and prints the time each took.
pub fn run(args: &Args) -> Result<()> {
    let begun = Instant::now();
    steps(args)?;
    println!("== all passed in {:.0} s", begun.elapsed().as_secs_f32());
    Ok(())
}

fn step(name: &str, work: impl FnOnce() -> Result<()>) -> Result<()> {
    println!("== {name}");
    let begun = Instant::now();
    work()?;
    println!("== {name}: passed in {:.0} s", begun.elapsed().as_secs_f32());
    Ok(())
}
