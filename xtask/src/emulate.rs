//! `cargo xtask emulate`: the demo's first vehicles flown by boards in QEMU.
//!
//! Each board is the firmware as it is flashed, with its two UARTs as TCP ports. Roadmap and mission are uploaded through the
//! port to the autopilot by MAVLink FTP; then `host-sim fly` is autopilots, radio and ground station to them, at the speed of
//! the clock.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use crate::bare_metal::{self, Board};
use crate::install;
use crate::shell::{cargo, command, root, run, target_dir};

/// The scenario whose first vehicles fly.
const DEMO: &str = "host-sim/scenarios/demo.toml";
/// Where the tables of its vehicles begin.
const VEHICLE: &str = "[[vehicles]]";
/// An instruction takes 2⁴ ns of a board's time: 62 million a second, which a loaded machine can keep up with.
const SHIFT: &str = "shift=4";

/// A companion that has heard no autopilot for ten seconds erases its flash; that takes ten more.
const ALONE_AFTER: Duration = Duration::from_secs(22);

/// Where the stack lies, as in the board's memory map.
const STACK: u32 = 0x2008_A000;
const STACK_LEN: usize = 88 << 10;
/// Setpoints may be no further apart by a board's own time, milliseconds.
const GAP_MS: u32 = 150;
/// What no stack has touched since the start.
const PAINT: u8 = 0xcc;

/// What to fly.
#[derive(clap::Args)]
pub struct Args {
    /// How many boards
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=10))]
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

/// Builds, uploads and flies; fails if the mission was not complete and clean. Returns how much of its stack a board used
/// at most, bytes.
pub fn run_emulate(args: &Args) -> Result<usize> {
    install::debian(install::EMULATOR)?;
    let firmware = bare_metal::build(Board::Qemu)?.folder.join("flockmate");
    run(cargo().args(["build", "--release", "--locked", "-p", "host-sim"]))?;
    let out = std::path::absolute(&args.out)?;
    std::fs::create_dir_all(&out).with_context(|| format!("cannot write: {}", out.display()))?;
    let mut ports = free_ports();
    let boards: Vec<_> = (1..=args.vehicles)
        .map(|id| Emulated::start(&firmware, &out, id, &mut ports))
        .collect::<Result<_>>()?;
    let scenario = out.join("scenario.toml");
    std::fs::write(&scenario, cut_demo(boards.len())?)?;
    run(host_sim().arg("plan").arg(&scenario).arg("--out").arg(out.join("plan")))?;
    println!("waiting until the boards have found that no autopilot is there, which could be armed");
    std::thread::sleep(ALONE_AFTER);
    for file in ["roadmap.bin", "mission.bin"] {
        upload(&boards, &out.join("plan").join(file))?;
    }
    // They start anew, and paint their stacks, when they find their autopilots.
    let uploading = deepest_stack(&boards, &out)?;
    let gaps = fly(&boards, &scenario, &out)?;
    ensure!(gaps.len() == boards.len(), "{} of {} boards told of their setpoints", gaps.len(), boards.len());
    ensure!(gaps.iter().all(|gap| *gap <= GAP_MS), "setpoints were {gaps:?} ms apart: {GAP_MS} are allowed");
    let deepest = uploading.max(deepest_stack(&boards, &out)?);
    println!("stack      {deepest} bytes of {STACK_LEN} used at most");
    Ok(deepest)
}

/// The most that a board used of its stack since its start, bytes.
fn deepest_stack(boards: &[Emulated], out: &Path) -> Result<usize> {
    let stacks: Vec<_> =
        boards.iter().map(|board| board.stack(&out.join("stack.bin"))).collect::<Result<_>>()?;
    Ok(stacks.into_iter().max().unwrap_or_default())
}

/// Flies, and shows what comes of it; what each board told of its setpoints, milliseconds.
fn fly(boards: &[Emulated], scenario: &Path, out: &Path) -> Result<Vec<u32>> {
    let mut fly = host_sim();
    fly.arg("fly").arg(scenario).arg("--out").arg(out);
    for board in boards {
        let [autopilot, radio] = board.links();
        fly.args(["--companion", &autopilot, "--radio", &radio]);
    }
    let mut fly = fly.stdout(Stdio::piped()).spawn()?;
    let mut gaps = Vec::new();
    for line in BufReader::new(fly.stdout.take().context("its output is piped")?).lines() {
        let line = line?;
        println!("{line}");
        let gap = line.split_once("Setpoints: ").and_then(|(_, rest)| rest.split_once(", at most "));
        let gap = gap.and_then(|(_, rest)| rest.split_once(" ms"));
        gaps.extend(gap.and_then(|(gap, _)| gap.parse::<u32>().ok()));
    }
    ensure!(fly.wait()?.success(), "the mission was not complete and clean");
    Ok(gaps)
}

fn host_sim() -> Command {
    command(target_dir().join("release/host-sim"))
}

/// The demo's first vehicles.
fn cut_demo(vehicles: usize) -> Result<String> {
    let demo = std::fs::read_to_string(root().join(DEMO)).with_context(|| format!("cannot read: {DEMO}"))?;
    let parts: Vec<_> = demo.split(VEHICLE).take(1 + vehicles).collect();
    ensure!(parts.len() == 1 + vehicles, "{DEMO} has only {} vehicles", parts.len() - 1);
    Ok(parts.join(VEHICLE))
}

/// Gives all boards a file, at the same time.
fn upload(boards: &[Emulated], file: &Path) -> Result<()> {
    let start = |board: &Emulated| {
        let [link, _] = &board.links();
        host_sim().arg("upload").args(["--link", link]).arg(file).spawn().context("host-sim does not start")
    };
    let uploads: Vec<_> = boards.iter().map(start).collect::<Result<_>>()?;
    for mut upload in uploads {
        ensure!(upload.wait()?.success(), "the upload of {} failed", file.display());
    }
    Ok(())
}

/// A board in QEMU; it ends with us.
struct Emulated {
    qemu: Child,
    /// TCP ports of its UARTs: to the autopilot, to the radio.
    ports: [u16; 2],
    /// QEMU's own.
    monitor: u16,
}

impl Emulated {
    fn start(firmware: &Path, out: &Path, id: u8, free: &mut impl Iterator<Item = u16>) -> Result<Self> {
        let mut port = || free.next().context("no TCP port is free");
        let (ports, monitor) = ([port()?, port()?], port()?);
        let log = out.join(format!("board-{id}.defmt"));
        let mut qemu = command("qemu-system-arm");
        qemu.args(["-machine", "mps2-an500", "-display", "none", "-icount", SHIFT])
            .args(["-monitor", &format!("tcp:127.0.0.1:{monitor},server=on,wait=off")])
            .args(["-semihosting-config", "enable=on,target=native,chardev=log"])
            .args(["-chardev", &format!("file,id=log,path={}", log.display())]);
        for port in ports {
            qemu.args(["-serial", &format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on")]);
        }
        let qemu = qemu.arg("-kernel").arg(firmware).stdout(Stdio::null()).spawn();
        Ok(Self { qemu: qemu.context("qemu-system-arm does not start")?, ports, monitor })
    }

    /// URLs of its UARTs: to the autopilot, to the radio.
    fn links(&self) -> [String; 2] {
        self.ports.map(|port| format!("tcp:127.0.0.1:{port}"))
    }

    /// Bytes of the stack that were used since the start; `file` is scratch.
    fn stack(&self, file: &Path) -> Result<usize> {
        let mut monitor = TcpStream::connect(("127.0.0.1", self.monitor))?;
        writeln!(monitor, "pmemsave {STACK} {STACK_LEN} \"{}\"", file.display())?;
        monitor.shutdown(Shutdown::Write)?;
        // It says what it does until it has heard that there is no more.
        monitor.read_to_end(&mut Vec::new())?;
        let stack = std::fs::read(file)?;
        std::fs::remove_file(file)?;
        ensure!(stack.len() == STACK_LEN, "QEMU gave {} bytes of stack", stack.len());
        Ok(STACK_LEN - stack.iter().take_while(|byte| **byte == PAINT).count())
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// TCP ports that nobody has now. Not those that the system hands out by itself: another process may be handed them before a board
/// has them.
fn free_ports() -> impl Iterator<Item = u16> {
    // Those of another checkout begin elsewhere.
    let first = (std::process::id() % 100) as u16 * 100;
    (20_000 + first..31_000).filter(|port| TcpListener::bind(("127.0.0.1", *port)).is_ok())
}
