//! Command line of `host-sim`.

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;

use anyhow::bail;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use host_sim::{commands, progress, quote, say};

/// Plans and flies drone swarms on a computer, with the code that flies on the board.
#[derive(Parser)]
#[command(version, about)]
struct Cli {
    #[command(subcommand)]
    command: HostSimCommand,
}

#[derive(Subcommand)]
enum HostSimCommand {
    /// Fly a built-in mission: ten UAVs go to their goals in a nine-floor building
    Demo(commands::fly::DemoArgs),
    /// Show and convert maps
    Map(commands::map::MapArgs),
    /// Build and show roadmap files
    Roadmap(commands::roadmap::Args),
    /// Plan a scenario: roadmap, assignment, paths; no flight
    Plan(commands::plan::Args),
    /// Plan and fly a scenario with simulated autopilots
    Fly(commands::fly::FlyArgs),
    /// Plan how a fleet photographs an area, and export the flights; no flight
    Cover(commands::cover::Args),
    /// Print the tables of a paper beside the results of this program
    Paper(commands::paper::Args),
    /// Simulate one autopilot for any MAVLink client
    Autopilot(commands::autopilot::AutopilotArgs),
    /// Run one vehicle's companion beside any autopilot, simulated, SITL or real
    Companion(commands::companion::Args),
    /// Upload a roadmap, field or mission file to a companion
    Upload(commands::upload::Args),
    /// Connect the swarm links of boards and processes like a radio, with loss and delay
    Radio(commands::radio::Args),
}

/// Exit code for bad input and every other error; a mission that was run and failed exits with 1.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let done = match Cli::try_parse() {
        Ok(cli) => run(cli.command),
        Err(error) => print_help_or_argument_error(&error),
    };
    // A command whose output could not be printed (stdout closed or full) has failed.
    let done = done.and_then(|code| progress::check_printed().map(|()| code));
    done.unwrap_or_else(|error| {
        // If stderr cannot be written either, the exit code alone reports the error.
        let _ = writeln!(
            std::io::stderr(),
            "error: {}",
            quote::printable_message(&format!("{error:#}"))
        );
        ExitCode::from(BAD_INPUT)
    })
}

fn run(command: HostSimCommand) -> anyhow::Result<ExitCode> {
    match command {
        HostSimCommand::Demo(args) => commands::fly::demo(&args),
        HostSimCommand::Map(args) => commands::map::run(&args),
        HostSimCommand::Roadmap(args) => commands::roadmap::run(&args),
        HostSimCommand::Plan(args) => commands::plan::run(&args),
        HostSimCommand::Fly(args) => commands::fly::run(&args),
        HostSimCommand::Cover(args) => commands::cover::run(&args),
        HostSimCommand::Paper(args) => commands::paper::run(&args),
        HostSimCommand::Autopilot(args) => commands::autopilot::run(&args),
        HostSimCommand::Companion(args) => commands::companion::run(&args),
        HostSimCommand::Upload(args) => commands::upload::run(&args),
        HostSimCommand::Radio(args) => commands::radio::run(&args),
    }
}

/// Handles arguments that clap did not parse into a command: prints help or version if they were
/// requested; otherwise returns an error of one line with hints.
fn print_help_or_argument_error(error: &clap::Error) -> anyhow::Result<ExitCode> {
    let asked = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
    if asked {
        let text = error.render();
        let text = if std::io::stdout().is_terminal() {
            text.ansi().to_string()
        } else {
            text.to_string()
        };
        say!("{}", text.trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    let arguments: Vec<String> =
        std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect();
    let help = help_command_for(&arguments);
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        bail!("no command given\nhint: `{help}` lists them");
    }
    let text = quote::with_printable_arguments(&error.to_string(), arguments.into_iter().skip(1));
    let mut lines = text.lines().map(str::trim);
    let what: Vec<&str> = lines.by_ref().take_while(|line| !line.is_empty()).collect();
    // Clap's tip on how to pass `-x` as a value is dropped: hardly anyone means `-x` as a value.
    let tips = lines
        .filter_map(|line| line.strip_prefix("tip: "))
        .filter(|tip| !tip.starts_with("to pass"));
    let tips: String = tips.map(|tip| format!("\nhint: {tip}")).collect();
    let what = what.join(" ");
    bail!("{}{tips}\nhint: `{help}` says more", what.strip_prefix("error: ").unwrap_or(&what))
}

/// The `--help` command line of the innermost subcommand that the arguments name.
fn help_command_for(arguments: &[String]) -> String {
    let mut command = &Cli::command();
    let mut line = command.get_name().to_owned();
    for argument in arguments.iter().skip(1) {
        let Some(next) = command.find_subcommand(argument) else { break };
        command = next;
        line = format!("{line} {}", next.get_name());
    }
    line + " --help"
}
