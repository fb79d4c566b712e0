//! Command line of `host-sim`.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use host_sim::{autopilot, commands, map};

/// Plans and flies drone swarms on the desk, with the code that flies on the board.
#[derive(Parser)]
#[command(version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Ten UAVs fly to their tasks in a nine-floor building: nothing to install first
    Demo(commands::fly::DemoArgs),
    /// Look at maps and convert them
    Map(map::command::MapArgs),
    /// Build roadmap files and look at them
    Roadmap(commands::roadmap::Args),
    /// Plan a scenario: roadmap, assignment, paths; no flight
    Plan(commands::plan::Args),
    /// Plan and fly a scenario with simulated autopilots
    Fly(commands::fly::FlyArgs),
    /// Simulate one autopilot for any MAVLink client
    Autopilot(autopilot::server::AutopilotArgs),
    /// Run one vehicle's companion beside any autopilot, simulated, SITL or real
    Companion(commands::companion::Args),
    /// Upload a roadmap or mission file to a companion
    Upload(commands::upload::Args),
    /// Join the swarm links of boards and processes, with a radio's loss and delay
    Radio(commands::radio::Args),
}

/// Exit code for bad input; 1 is a mission that failed.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Demo(args) => commands::fly::demo(&args),
        Command::Map(args) => map::command::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Roadmap(args) => commands::roadmap::run(&args),
        Command::Plan(args) => commands::plan::run(&args),
        Command::Fly(args) => commands::fly::run(&args),
        Command::Autopilot(args) => autopilot::server::run(&args),
        Command::Companion(args) => commands::companion::run(&args),
        Command::Upload(args) => commands::upload::run(&args),
        Command::Radio(args) => commands::radio::run(&args),
    };
    done.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::from(BAD_INPUT)
    })
}
