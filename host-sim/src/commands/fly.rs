//! `host-sim fly` and `host-sim demo`: plan a mission, fly it in the simulation, write the report.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, bail, ensure};

use super::load_supported;
use crate::capacity::BoardCapacity;
use crate::coverage::CoveragePlan;
use crate::files::ResultFiles;
use crate::flown::picture_store::PictureStore;
use crate::flown::{layers, page, pictures};
use crate::link::LinkUrl;
use crate::mission::{HostPlan, PreparedMission};
use crate::output;
use crate::progress::Progress;
use crate::quote::printable_path;
use crate::report::Level;
use crate::say;
use crate::scenario::{self, CompanionHost, Scenario};
use crate::swarm::faults;
use crate::swarm::gateway::Gateway;
use crate::swarm::{self, Pace, SwarmFlight};

/// The demo's scenario, compiled into the program so that no file is needed.
const DEMO_SCENARIO: &str = include_str!("../../scenarios/demo.toml");

/// Name of the board that QEMU emulates.
const EMULATED_BOARD: &str = "qemu";

/// Arguments of `host-sim fly`.
#[derive(Debug, clap::Args)]
pub struct FlyArgs {
    /// The scenario
    scenario: PathBuf,
    /// Directory for `result.json`, `timing.json` and `report.html`
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Fly at the speed of the clock instead of as fast as possible
    #[arg(long)]
    realtime: bool,
    /// Show the swarm to a ground station behind this link, at the speed of the clock:
    /// udp:HOST:14550 for QGroundControl
    #[arg(long, value_name = "URL")]
    qgc: Option<LinkUrl>,
    /// Seed to use instead of the scenario's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Link to a board or another process that runs the companion of the scenario's first vehicle,
    /// by its port for the autopilot: tcp:HOST:PORT, udp:HOST:PORT, serial:PATH:BAUD or one that
    /// listens. Given again, the second vehicle's, and so on. Flies at the speed of the clock
    #[arg(long, value_name = "URL")]
    companion: Vec<LinkUrl>,
    /// Link to that companion by its port for the radio; given again, to the second companion, and
    /// so on. A companion without this link and the others hear each other only through the
    /// companion's own radio; if they do not, no vehicle starts
    #[arg(long, value_name = "URL", requires = "companion")]
    radio: Vec<LinkUrl>,
    /// Firmware for boards in QEMU that run the companions in lock step with the simulation, from
    /// `cargo xtask build --board qemu`. Each board has roadmap and mission in its flash and logs
    /// to board-N.defmt in the output directory
    #[arg(long, value_name = "FIRMWARE", conflicts_with = "companion")]
    emulate: Option<PathBuf>,
    /// Directory for what each companion keeps in its flash, as boards do: parameters, and in a
    /// coverage mission the waypoints that are photographed. The next flight continues there, and
    /// is judged by the pictures of all flights
    #[arg(long, value_name = "DIR", conflicts_with_all = ["companion", "emulate"])]
    flash: Option<PathBuf>,
    /// Number of the scenario's first vehicles that have a board in QEMU (`--emulate`); all if
    /// absent
    #[arg(long, value_name = "N", requires = "emulate")]
    boards: Option<usize>,
}

/// How a running flight is shown: at what pace, and to which ground station.
#[derive(Default)]
struct FlightDisplay<'a> {
    /// How fast simulated time passes.
    pace: Pace,
    /// Link to a ground station, such as QGroundControl; `None` without one.
    qgc: Option<&'a LinkUrl>,
}

/// Arguments of `host-sim demo`.
#[derive(Debug, clap::Args)]
pub struct DemoArgs {
    /// Directory for `result.json`, `timing.json` and `report.html`
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
}

/// Runs `host-sim fly`. Exit code 0 if the mission is complete.
///
/// # Errors
/// The input is bad; the error names its place.
pub fn run(args: &FlyArgs) -> anyhow::Result<ExitCode> {
    let mut scenario = load_supported(&args.scenario, args.seed)?;
    set_board_links(&mut scenario, &args.companion, &args.radio)?;
    if let Some(program) = &args.emulate {
        set_emulated_boards(&mut scenario, program, args.boards, &args.out)?;
    }
    if let Some(dir) = &args.flash {
        set_flash_files(&mut scenario, dir)?;
    }
    let pace = if args.realtime { Pace::RealTime } else { Pace::Fastest };
    let shown = FlightDisplay { pace, qgc: args.qgc.as_ref() };
    plan_fly_and_report(scenario, "fly", &args.out, &shown, args.flash.as_deref())
}

/// Makes the scenario's first vehicles use companions on boards or in other processes: the n-th
/// vehicle uses the n-th link of `companions`, and of `radios` if there are as many.
fn set_board_links(
    scenario: &mut Scenario,
    companions: &[LinkUrl],
    radios: &[LinkUrl],
) -> anyhow::Result<()> {
    let (boards, vehicles) = (companions.len(), scenario.vehicles.len());
    ensure!(
        boards <= vehicles,
        "too many --companion: {boards}: {} has {vehicles} vehicles",
        scenario.path
    );
    ensure!(
        radios.len() <= boards,
        "too many --radio: {}: each belongs to one --companion, of which there are {boards}",
        radios.len()
    );
    for (i, (vehicle, autopilot)) in scenario.vehicles.iter_mut().zip(companions).enumerate() {
        vehicle.companion =
            CompanionHost::Url { autopilot: autopilot.clone(), radio: radios.get(i).cloned() };
    }
    Ok(())
}

/// Gives each companion a file in this directory for its flash.
fn set_flash_files(scenario: &mut Scenario, dir: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(dir)
        .with_context(|| format!("cannot keep flashes: {}", printable_path(dir)))?;
    for vehicle in &mut scenario.vehicles {
        ensure!(
            matches!(vehicle.companion, CompanionHost::InProcess { .. }),
            "--flash: vehicle {} has a companion elsewhere, with a flash of its own",
            vehicle.id
        );
        let file = dir.join(format!("vehicle-{}.flash", vehicle.id));
        vehicle.companion = CompanionHost::InProcess { flash: Some(file) };
    }
    Ok(())
}

/// Makes the scenario's first `boards` vehicles use companions on boards in QEMU; `None` means all
/// vehicles.
fn set_emulated_boards(
    scenario: &mut Scenario,
    program: &Path,
    boards: Option<usize>,
    out: &Path,
) -> anyhow::Result<()> {
    let vehicles = scenario.vehicles.len();
    let boards = boards.unwrap_or(vehicles);
    ensure!(
        boards <= vehicles,
        "too many --boards: {boards}: {} has {vehicles} vehicles",
        scenario.path
    );
    for vehicle in &mut scenario.vehicles[..boards] {
        let log = out.join(format!("board-{}.defmt", vehicle.id));
        vehicle.companion = CompanionHost::Emulated { program: program.to_owned(), log };
    }
    Ok(())
}

/// Runs `host-sim demo`. Exit code 0 if the mission is complete.
///
/// # Errors
/// The output cannot be written.
pub fn demo(args: &DemoArgs) -> anyhow::Result<ExitCode> {
    let scenario =
        scenario::parse(DEMO_SCENARIO, "demo.toml").context("the demo's own scenario")?;
    plan_fly_and_report(scenario, "demo", &args.out, &FlightDisplay::default(), None)
}

/// Refuses a mission that is larger than the emulated board holds.
fn check_fits_emulated_boards(mission: &PreparedMission, plan: &HostPlan) -> anyhow::Result<()> {
    let mut vehicles = mission.scenario.vehicles.iter();
    if vehicles.any(|vehicle| matches!(vehicle.companion, CompanionHost::Emulated { .. })) {
        let board = BoardCapacity::by_name(EMULATED_BOARD).map_err(anyhow::Error::msg)?;
        if let Some(why) = mission.board_limit_exceeded(plan, board) {
            bail!("the mission does not fit {}: {}: {why}", board.name, mission.scenario.path);
        }
    }
    Ok(())
}

/// Prints whether the flight was given up at its time limit, its errors, and how fast it was
/// simulated.
fn print_errors_and_speed(flight: &SwarmFlight, limit_s: f32) {
    let aloft = flight.result.vehicles.iter().filter(|vehicle| !vehicle.landed).count();
    if aloft > 0 && flight.simulated_s >= f64::from(limit_s) {
        say!("given up   at simulation.time_limit_s = {limit_s} s, {aloft} not landed");
    }
    for incident in flight.log.iter().filter(|event| event.level == Level::Error) {
        let id = incident.vehicle.map_or(String::new(), |id| format!(" vehicle {id}"));
        say!("           {:.2} s{id}: {}", incident.t_s, incident.text);
    }
    say!(
        "           {:.0} s simulated in {:.1} s, {:.0} × real time",
        flight.simulated_s,
        flight.wall_time_s,
        flight.simulated_s / flight.wall_time_s
    );
}

/// Adds the pictures of earlier flights if this flight continued them. It continued them unless, at
/// its start, the companions knew no waypoint, or every waypoint, as photographed: then they began
/// the area again.
fn add_earlier_pictures_if_continued(
    kept: &PictureStore,
    mission: &PreparedMission,
    flight: &mut SwarmFlight,
) -> anyhow::Result<()> {
    let done: u32 = flight.photographed_before.iter().map(|range| range.end - range.first).sum();
    let planned = CoveragePlan::plan_as_companions(&mission.scenario)?;
    if done > 0 && done < planned.tracks.waypoint_count() {
        kept.prepend_earlier_to(&mut flight.pictures);
    }
    Ok(())
}

/// Plans and flies a mission, judges its pictures, and writes results and report. `flashes` is the
/// directory in which companions keep their flash files.
fn plan_fly_and_report(
    scenario: Scenario,
    command: &'static str,
    out: &Path,
    shown: &FlightDisplay<'_>,
    flashes: Option<&Path>,
) -> anyhow::Result<ExitCode> {
    faults::check(&scenario)?;
    let kept = flashes.filter(|_| scenario.covers_area()).map(PictureStore::open).transpose()?;
    let gateway = shown.qgc.map(|url| url.open().map(Gateway::new)).transpose()?;
    let mut results = ResultFiles::open(out, &output::RESULT_FILES)?;
    let began = Instant::now();
    let progress = Progress::on_terminal();
    output::print_slow_vehicles(&scenario);
    let mut mission = PreparedMission::prepare(scenario, &progress)?;
    let plan = mission.plan()?;
    check_fits_emulated_boards(&mission, &plan)?;
    let mut flight = match gateway {
        Some(gateway) => {
            swarm::fly_with_ground_station(&mission, &plan, command, gateway, &progress)?
        }
        None => swarm::fly(&mission, &plan, command, shown.pace, &progress)?,
    };
    if let Some(places) = pictures::track_points_as_pictures(&mission.scenario, &flight.tracks)? {
        flight.pictures = places;
    }
    if let Some(kept) = &kept {
        add_earlier_pictures_if_continued(kept, &mission, &mut flight)?;
    }
    let pictures = std::mem::take(&mut flight.pictures);
    let judged = match &mission.scenario.area {
        Some(_) => Some(pictures::judge_pictures(&mission.scenario, &plan, pictures.clone())?),
        None => None,
    };
    if let Some(judged) = &judged {
        flight.result.complete &= judged.complete;
        flight.result.coverage = Some(judged.result.clone());
        if let Some(kept) = kept {
            kept.store_pictures(&pictures)?;
        }
    }
    let mut page = page::flown_page(&mission, &plan, &flight)?;
    if let Some(judged) = judged {
        page.outlines = judged.outlines;
        page.plots.insert(0, judged.plot);
        let planned = CoveragePlan::plan_as_companions(&mission.scenario)?;
        page.coverage = Some(layers::flown_layers(&planned, &mission, &plan, &flight, pictures)?);
    }
    mission.timing.simulated_s = flight.simulated_s;
    mission.timing.wall_s = began.elapsed().as_secs_f64();
    output::add(&mut results, &flight.result, &mission.timing, page)?;
    results.commit()?;
    output::print_summary(&flight.result, out);
    print_errors_and_speed(&flight, mission.scenario.simulation.time_limit_s);
    Ok(if flight.result.complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
