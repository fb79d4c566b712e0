//! The developer's one entry: `cargo xtask test`, `bench`, and the firmware's `build`, `size`,
//! `emulate` and `flash`.
#![forbid(unsafe_code)]

mod bare_metal;
mod bench;
mod build;
mod emulate;
mod flash;
mod install;
mod shell;
mod size;
mod structure;
mod test;

use std::process::ExitCode;

use clap::Parser;

#[derive(Parser)]
#[command(about = "Flockmate developer commands")]
enum Command {
    /// Everything CI runs; installs what is missing, or says in one line what to install.
    Test(test::Args),
    /// Our times beside those of other programs.
    Bench(bench::Args),
    /// The firmware for a board.
    Build(build::Args),
    /// The demo's first vehicles flown by boards in QEMU.
    Emulate(emulate::Args),
    /// What the firmware takes of a board's memory.
    Size(size::Args),
    /// Import cycles, large structs and long functions.
    Structure,
    /// The firmware onto a board behind a debug probe.
    Flash(flash::Args),
}

fn main() -> ExitCode {
    let done = match Command::parse() {
        Command::Test(args) => test::run(&args),
        Command::Bench(args) => bench::run_bench(&args),
        Command::Build(args) => build::run(&args),
        Command::Emulate(args) => emulate::run_emulate(&args).map(drop),
        Command::Size(args) => size::run(&args),
        Command::Structure => structure::run(),
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
