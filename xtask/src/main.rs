//! The developer's commands: `cargo xtask test`, `bench`, `structure`, and for the firmware
//! `build`, `size`, `emulate` and `flash`.
#![forbid(unsafe_code)]

mod bare_metal;
mod bench;
mod build;
mod emulate;
mod flash;
mod host_tests;
mod install;
mod licences;
mod shell;
mod size;
mod structure;
mod test;

use std::process::ExitCode;

use clap::Parser;

#[derive(Parser)]
#[command(about = "Flockmate developer commands")]
enum Command {
    /// Runs everything that CI runs; installs missing packages, or names them in one line.
    Test(test::Args),
    /// Measures our times beside those of other programs.
    Bench(bench::Args),
    /// Builds the firmware for a board.
    Build(build::Args),
    /// Flies the demo's first vehicles by boards emulated in QEMU.
    Emulate(emulate::Args),
    /// Shows how much of a board's memory the firmware takes.
    Size(size::Args),
    /// Checks the sources: import cycles, foreign writes, sizes, lines.
    Structure,
    /// Checks the licences of all dependencies against `deny.toml`.
    Licences,
    /// Writes the firmware to a board behind a debug probe.
    Flash(flash::Args),
}

fn main() -> ExitCode {
    let done = match Command::parse() {
        Command::Test(args) => test::run(&args),
        Command::Bench(args) => bench::run_bench(&args),
        Command::Build(args) => build::run(&args),
        Command::Emulate(args) => emulate::fly_for_stack_use(&args).map(drop),
        Command::Size(args) => size::run(&args),
        Command::Structure => structure::run(),
        Command::Licences => licences::check_licences(),
        Command::Flash(args) => flash::run_flash(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
