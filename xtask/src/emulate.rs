//! `cargo xtask emulate`: the demo's first vehicles flown by boards in QEMU.
//!
//! Each board is the firmware as it is flashed, roadmap and mission in its flash.
//! `host-sim fly --emulate` is autopilots, radio and ground station to them, in lock step: the
//! flight depends on no clock and no load.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context, Result, ensure};

use crate::bare_metal::{self, Board};
use crate::install;
use crate::shell::{cargo, command, root, run, target_dir};

/// The scenario whose first vehicles fly.
const DEMO: &str = "host-sim/scenarios/demo.toml";
/// Where the tables of its vehicles begin.
const VEHICLE: &str = "[[vehicles]]";
/// Setpoints are 50 ms apart; a board whose tasks keep their time adds less than a millisecond.
const GAP_MS: usize = 51;

/// What to fly.
#[derive(clap::Args)]
pub struct Args {
    /// How many boards
    #[arg(long, value_name = "N", default_value_t = 3)]
    #[arg(value_parser = clap::value_parser!(u8).range(1..=10))]
    vehicles: u8,
    /// Directory for what `host-sim fly` writes, and what each board logs
    #[arg(long, value_name = "DIR", default_value = "out/emulate")]
    out: PathBuf,
}

impl Default for Args {
    /// What CI flies.
    fn default() -> Self {
        Self { vehicles: 3, out: target_dir().join("emulate") }
    }
}

/// Builds and flies; fails if the mission was not complete and clean. Returns how much of its stack
/// a board used at most, bytes.
pub fn run_emulate(args: &Args) -> Result<usize> {
    install::debian(install::EMULATOR)?;
    let firmware = bare_metal::build(Board::Qemu)?.folder.join("flockmate");
    run(cargo().args(["build", "--release", "--locked", "-p", "host-sim"]))?;
    let out = std::path::absolute(&args.out)?;
    std::fs::create_dir_all(&out).with_context(|| format!("cannot write: {}", out.display()))?;
    let (scenario, boards) = (out.join("scenario.toml"), usize::from(args.vehicles));
    std::fs::write(&scenario, cut_demo(boards)?)?;
    let Reported { gaps_ms, stacks } = fly(&firmware, &scenario, &out)?;
    ensure!(
        gaps_ms.len() == boards,
        "{} of {boards} boards reported their setpoints",
        gaps_ms.len()
    );
    ensure!(
        gaps_ms.iter().all(|gap| *gap <= GAP_MS),
        "setpoints were {gaps_ms:?} ms apart: {GAP_MS} are allowed"
    );
    stacks.into_iter().max().context("no board reported its stack")
}

/// What boards reported.
#[derive(Default)]
struct Reported {
    /// The longest time between two setpoints, milliseconds.
    gaps_ms: Vec<usize>,
    /// Bytes of the stack that were used.
    stacks: Vec<usize>,
}

/// Flies, and shows what comes of it.
fn fly(firmware: &Path, scenario: &Path, out: &Path) -> Result<Reported> {
    let mut fly = command(target_dir().join("release/host-sim"));
    fly.arg("fly").arg(scenario).arg("--out").arg(out).arg("--emulate").arg(firmware);
    let mut fly = fly.stdout(Stdio::piped()).spawn()?;
    let mut reported = Reported::default();
    for line in BufReader::new(fly.stdout.take().context("its output is piped")?).lines() {
        let line = line?;
        println!("{line}");
        reported.gaps_ms.extend(number(&line, "Setpoints: ", ", at most "));
        reported.stacks.extend(number(&line, "stack:", " "));
    }
    ensure!(fly.wait()?.success(), "the mission was not complete and clean");
    Ok(reported)
}

/// The number after `before` in what follows `name` in a line.
fn number(line: &str, name: &str, before: &str) -> Option<usize> {
    let (_, rest) = line.split_once(name)?.1.split_once(before)?;
    rest.split(' ').next()?.parse().ok()
}

/// The demo's first vehicles.
fn cut_demo(vehicles: usize) -> Result<String> {
    let demo = std::fs::read_to_string(root().join(DEMO))
        .with_context(|| format!("cannot read: {DEMO}"))?;
    let parts: Vec<_> = demo.split(VEHICLE).take(1 + vehicles).collect();
    ensure!(parts.len() == 1 + vehicles, "{DEMO} has only {} vehicles", parts.len() - 1);
    Ok(parts.join(VEHICLE))
}
