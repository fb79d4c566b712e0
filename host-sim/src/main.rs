//! Command line of `host-sim`.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Look at maps and convert them
    Map(host_sim::map::command::MapArgs),
}

fn main() -> ExitCode {
    let Command::Map(args) = Cli::parse().command;
    match host_sim::map::command::run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
