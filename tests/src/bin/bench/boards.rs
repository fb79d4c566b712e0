//! Ten emulated boards fly the demo twice, once while eight processes keep the machine busy: both
//! flights must be the same.

use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use flockmate_tests::{ChildGuard, board, workspace};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::{scenario, swarm};

/// Number of processes that keep this machine busy during the second flight.
const BUSY_PROCESSES: usize = 8;

/// Flies the demo on boards twice, compares both flights and prints how long they took.
pub fn run() -> Result<()> {
    let Some(program) = board::built_program("flockmate") else { return Ok(()) };
    let folder = tempfile::tempdir()?;
    let demo = scenario::load(&workspace().join("host-sim/scenarios/demo.toml"))?;
    let progress = Progress::on_terminal();
    let mut mission = PreparedMission::prepare(demo, &progress)?;
    board::put_on_boards(&mut mission, &program, folder.path());
    let plan = mission.plan()?;
    let fly = || swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &progress);
    let alone = fly()?;
    let busy =
        || Command::new("sh").args(["-c", "while :; do :; done"]).stdin(Stdio::null()).spawn();
    let others: Vec<_> = (0..BUSY_PROCESSES)
        .map(|_| busy().map(ChildGuard))
        .collect::<Result<_, _>>()
        .context("no sh")?;
    let beside = fly()?;
    drop(others);
    println!(
        "{} boards, {:.0} s of flight: {:.0} s alone, {:.0} s beside {BUSY_PROCESSES} busy processes",
        mission.scenario.vehicles.len(),
        alone.simulated_s,
        alone.wall_time_s,
        beside.wall_time_s
    );
    ensure!(alone.result.complete, "the flight is not complete");
    ensure!(
        board::observable_text(&alone) == board::observable_text(&beside),
        "the flights differ"
    );
    Ok(())
}
