//! Runs built firmware on boards emulated by QEMU.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use host_sim::link::LinkUrl;
use host_sim::mission::PreparedMission;
use host_sim::scenario::CompanionHost;
use host_sim::swarm::SwarmFlight;
use planner_core::map::voxel::VoxelGrid;

use crate::{ChildGuard, free_port, workspace};

/// Address of bank 2 of the emulated flash.
const BANK2_ADDRESS: u32 = 0x6000_0000;
/// Longest wait until QEMU listens: on a loaded machine it starts late.
const PATIENCE: Duration = Duration::from_secs(30);
/// Address at which the measuring programs expect a map.
const MAP_ADDRESS: u32 = 0x6080_0000;

/// Path of a program built for the board `qemu`, in the directory that `FLOCKMATE_FIRMWARE` names
/// relative to the checkout; without that variable `None`, and a printed line that says what is
/// skipped.
pub fn built_program(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("FLOCKMATE_FIRMWARE") else {
        println!(
            "skipped: FLOCKMATE_FIRMWARE names no built firmware (`cargo xtask test` builds it)"
        );
        return None;
    };
    Some(workspace().join(folder).join(name))
}

/// A command that runs a program on QEMU's board.
fn qemu_command(program: &Path) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command
        .args(["-machine", "mps2-an500", "-display", "none"])
        .arg("-kernel")
        .arg(program)
        .stdin(Stdio::null());
    command
}

/// QEMU's option that loads a file to an address at every reset.
fn loader_option(file: &Path, at: u32) -> String {
    format!("loader,file={},addr={at:#x},force-raw=on", file.display())
}

/// The bytes of a map as the programs `measure` and `calls` read it from memory.
pub fn map_image(grid: &VoxelGrid<'_>) -> Vec<u8> {
    let shape = grid.shape();
    let dims = shape.dims.iter().flat_map(|d| d.to_le_bytes());
    let numbers = shape.min.iter().chain([&shape.resolution_m]).flat_map(|x| x.to_le_bytes());
    let words = grid.words();
    let count = (words.len() as u32).to_le_bytes();
    dims.chain(numbers)
        .chain(count)
        .chain(words.iter().flat_map(|word| word.to_le_bytes()))
        .collect()
}

/// Runs `measure` or `calls` on a roadmap file and a map; returns the lines that it prints.
///
/// # Panics
/// The program does not run to its end.
pub fn run_measuring_program(program: &Path, roadmap: &[u8], map: &[u8]) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let file = |name: &str, bytes: &[u8]| {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).expect("it can be written");
        file
    };
    let (roadmap, map) = (file("roadmap.bin", roadmap), file("map.bin", map));
    // `-icount shift=0`: an instruction takes one nanosecond of the board's time.
    let out = qemu_command(program)
        .args([
            "-monitor",
            "none",
            "-icount",
            "shift=0",
            "-semihosting-config",
            "enable=on,target=native",
        ])
        .args([
            "-device",
            &loader_option(&roadmap, BANK2_ADDRESS),
            "-device",
            &loader_option(&map, MAP_ADDRESS),
        ])
        .output()
        .expect("qemu-system-arm runs");
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success(), "{text}\n{}", String::from_utf8_lossy(&out.stderr));
    text.lines().map(str::to_owned).collect()
}

/// Starts a board that runs by the wall clock; returns its ports: to the autopilot, to the radio.
///
/// # Panics
/// QEMU does not start.
pub fn start_by_wall_clock(program: &Path) -> (ChildGuard, [LinkUrl; 2]) {
    let ports = [free_port(), free_port()];
    let mut qemu = qemu_command(program);
    qemu.args([
        "-monitor",
        "none",
        "-icount",
        "shift=4",
        "-semihosting-config",
        "enable=on,target=native",
    ]);
    for port in ports {
        qemu.args(["-serial", &format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on")]);
    }
    let board = ChildGuard(qemu.stdout(Stdio::null()).spawn().expect("qemu-system-arm starts"));
    let urls = ports.map(|port| LinkUrl::Tcp(format!("127.0.0.1:{port}")));
    // A connection succeeds as soon as QEMU listens.
    let began = Instant::now();
    while urls[1].open().is_err() {
        assert!(began.elapsed() < PATIENCE, "QEMU does not listen");
        sleep(Duration::from_millis(20));
    }
    (board, urls)
}

/// Gives every vehicle of a mission a board in lock step, which logs to a file in `folder`.
pub fn put_on_boards(mission: &mut PreparedMission, program: &Path, folder: &Path) {
    for vehicle in &mut mission.scenario.vehicles {
        let log = folder.join(format!("board-{}.defmt", vehicle.id));
        vehicle.companion = CompanionHost::Emulated { program: program.to_owned(), log };
    }
}

/// The text of all that can be observed of a flight: its result, its log with times, and the tracks
/// of all vehicles.
///
/// # Panics
/// The result cannot be written.
pub fn observable_text(flight: &SwarmFlight) -> String {
    let result = serde_json::to_string(&flight.result).expect("a result");
    let log: Vec<_> =
        flight.log.iter().map(|event| (event.t_s, event.vehicle, &event.text)).collect();
    format!("{result}\n{log:?}\n{:?}", flight.tracks)
}
