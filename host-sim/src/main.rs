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
    /// Be an autopilot that ground tools can fly
    Autopilot(host_sim::autopilot::server::AutopilotArgs),
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Map(args) => {
            host_sim::map::command::run(&args).map(|()| ExitCode::SUCCESS).map_err(|error| error.to_string())
        }
        Command::Autopilot(args) => {
            host_sim::autopilot::server::run(&args).map_err(|error| format!("{error:#}"))
        }
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error}");
        ExitCode::from(2)
    })
}
