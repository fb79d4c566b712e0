//! Command line of `host-sim`.

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;

use anyhow::bail;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use host_sim::{commands, map, progress, quote, say};

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
    /// Plan how a fleet photographs an area; no flight
    Cover(commands::cover::Args),
    /// Print a paper's tables, ours beside theirs
    Paper(commands::paper::Args),
    /// Simulate one autopilot for any MAVLink client
    Autopilot(commands::autopilot::AutopilotArgs),
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
    let done = match Cli::try_parse() {
        Ok(cli) => run(cli.command),
        Err(error) => print_argument_error(&error),
    };
    // Results that nobody could read are none.
    let done = done.and_then(|code| progress::check_printed().map(|()| code));
    done.unwrap_or_else(|error| {
        // Where the error cannot be printed either, the exit code reports it.
        let _ =
            writeln!(std::io::stderr(), "error: {}", quote::quote_message(&format!("{error:#}")));
        ExitCode::from(BAD_INPUT)
    })
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Demo(args) => commands::fly::demo(&args),
        Command::Map(args) => map::command::run(&args),
        Command::Roadmap(args) => commands::roadmap::run(&args),
        Command::Plan(args) => commands::plan::run(&args),
        Command::Fly(args) => commands::fly::run(&args),
        Command::Cover(args) => commands::cover::run(&args),
        Command::Paper(args) => commands::paper::run(&args),
        Command::Autopilot(args) => commands::autopilot::run(&args),
        Command::Companion(args) => commands::companion::run(&args),
        Command::Upload(args) => commands::upload::run(&args),
        Command::Radio(args) => commands::radio::run(&args),
    }
}

/// A command line that is no command: help that was asked for, or one line that says what is wrong,
/// and a hint.
fn print_argument_error(error: &clap::Error) -> anyhow::Result<ExitCode> {
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
    let help = help_of(&arguments);
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        bail!("no command given\nhint: `{help}` lists them");
    }
    let text = quote::about_arguments(&error.to_string(), arguments.into_iter().skip(1));
    let mut lines = text.lines().map(str::trim);
    let what: Vec<&str> = lines.by_ref().take_while(|line| !line.is_empty()).collect();
    // How to pass `-x` as a value is never what was meant.
    let tips = lines
        .filter_map(|line| line.strip_prefix("tip: "))
        .filter(|tip| !tip.starts_with("to pass"));
    let tips: String = tips.map(|tip| format!("\nhint: {tip}")).collect();
    let what = what.join(" ");
    bail!("{}{tips}\nhint: `{help}` says more", what.strip_prefix("error: ").unwrap_or(&what))
}

/// The command line that explains the command that was meant.
fn help_of(arguments: &[String]) -> String {
    let mut command = &Cli::command();
    let mut line = command.get_name().to_owned();
    for argument in arguments.iter().skip(1) {
        let Some(next) = command.find_subcommand(argument) else { break };
        command = next;
        line = format!("{line} {}", next.get_name());
    }
    line + " --help"
}
