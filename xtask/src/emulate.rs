//! `cargo xtask emulate`: flies the demo's first vehicles by boards emulated in QEMU.
//!
//! Each board runs the firmware as it is flashed, with roadmap and mission in its flash.
//! `host-sim fly --emulate` simulates autopilots, radio and ground station in lock step with the
//! boards: the flight does not depend on the machine's clock or load.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context, Result, ensure};

use crate::bare_metal::{self, Board};
use crate::install;
use crate::shell::{cargo, checkout_root, command, run, target_dir};

/// The scenario whose first vehicles fly.
const DEMO_SCENARIO: &str = "host-sim/scenarios/demo.toml";
/// Line with which each vehicle's table begins in the scenario.
const VEHICLE_TABLE_LINE: &str = "[[vehicles]]";
/// Longest permitted gap between two setpoints, milliseconds: they are due every 50 ms, and a board
/// whose tasks run in time adds less than 1 ms.
const MAX_SETPOINT_GAP_MS: usize = 51;

/// Arguments of `emulate`.
#[derive(clap::Args)]
pub struct Args {
    /// Number of boards
    #[arg(long, value_name = "N", default_value_t = 3)]
    #[arg(value_parser = clap::value_parser!(u8).range(1..=10))]
    vehicles: u8,
    /// Directory for the files of `host-sim fly` and each board's log
    #[arg(long, value_name = "DIR", default_value = "out/emulate")]
    out: PathBuf,
    /// A `host-sim` that is built already
    #[arg(skip)]
    host_sim: Option<PathBuf>,
}

impl Default for Args {
    /// The flight that CI runs, by the `host-sim` of the tests' build (debug) if it is there.
    fn default() -> Self {
        let target = target_dir();
        let host_sim = Some(target.join("debug/host-sim")).filter(|built| built.is_file());
        Self { vehicles: 3, out: target.join("emulate"), host_sim }
    }
}

/// Builds firmware and host-sim and flies. An error if the mission is not completed cleanly or
/// setpoints come too late. Returns the deepest stack use of all boards, bytes.
pub fn fly_for_stack_use(args: &Args) -> Result<usize> {
    install::install_missing(install::EMULATOR)?;
    let firmware = bare_metal::build(Board::Qemu)?.folder.join("flockmate");
    let host_sim = match &args.host_sim {
        Some(built) => built.clone(),
        None => {
            run(cargo().args(["build", "--release", "--locked", "-p", "host-sim"]))?;
            target_dir().join("release/host-sim")
        }
    };
    let out = std::path::absolute(&args.out)?;
    std::fs::create_dir_all(&out).with_context(|| format!("cannot write: {}", out.display()))?;
    let (scenario, boards) = (out.join("scenario.toml"), usize::from(args.vehicles));
    std::fs::write(&scenario, cut_demo(boards)?)?;
    let BoardReports { gaps_ms, stack_bytes: stacks } = fly(&host_sim, &firmware, &scenario, &out)?;
    ensure!(
        gaps_ms.len() == boards,
        "{} of {boards} boards reported their setpoints",
        gaps_ms.len()
    );
    ensure!(
        gaps_ms.iter().all(|gap| *gap <= MAX_SETPOINT_GAP_MS),
        "setpoints were {gaps_ms:?} ms apart: {MAX_SETPOINT_GAP_MS} are allowed"
    );
    stacks.into_iter().max().context("no board reported its stack")
}

/// Numbers that boards reported by STATUSTEXT or log, one of each board.
#[derive(Default)]
struct BoardReports {
    /// Longest gap between two setpoints of each board, milliseconds.
    gaps_ms: Vec<usize>,
    /// Deepest use of each board's stack, bytes.
    stack_bytes: Vec<usize>,
}

/// Runs `host-sim fly`, prints its output and collects the boards' reports from it.
fn fly(host_sim: &Path, firmware: &Path, scenario: &Path, out: &Path) -> Result<BoardReports> {
    let mut fly = command(host_sim);
    fly.arg("fly").arg(scenario).arg("--out").arg(out).arg("--emulate").arg(firmware);
    let mut fly = fly.stdout(Stdio::piped()).spawn()?;
    let mut reported = BoardReports::default();
    for line in BufReader::new(fly.stdout.take().context("its output is piped")?).lines() {
        let line = line?;
        println!("{line}");
        reported.gaps_ms.extend(number_after(&line, "Setpoints: ", ", at most "));
        reported.stack_bytes.extend(number_after(&line, "stack:", " "));
    }
    ensure!(fly.wait()?.success(), "the mission was not complete and clean");
    Ok(reported)
}

/// The number that follows `before`, searched in the part of `line` after `name`.
fn number_after(line: &str, name: &str, before: &str) -> Option<usize> {
    let (_, rest) = line.split_once(name)?.1.split_once(before)?;
    rest.split(' ').next()?.parse().ok()
}

/// The demo scenario cut to its first vehicles.
fn cut_demo(vehicles: usize) -> Result<String> {
    let demo = std::fs::read_to_string(checkout_root().join(DEMO_SCENARIO))
        .with_context(|| format!("cannot read: {DEMO_SCENARIO}"))?;
    let parts: Vec<_> = demo.split(VEHICLE_TABLE_LINE).take(1 + vehicles).collect();
    ensure!(parts.len() == 1 + vehicles, "{DEMO_SCENARIO} has only {} vehicles", parts.len() - 1);
    Ok(parts.join(VEHICLE_TABLE_LINE))
}
