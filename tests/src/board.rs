//! Boards in QEMU: the built firmware, and what it is run with.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use planner_core::voxel::VoxelGrid;

use crate::workspace;

/// Where bank 2 of the emulated flash lies.
const BANK2: u32 = 0x6000_0000;
/// Where a map for measurements lies.
const MAP: u32 = 0x6080_0000;

/// A program for the board `qemu`, from the directory that `FLOCKMATE_FIRMWARE` names, as seen from the checkout; `None` with a line
/// that says what is skipped.
pub fn program(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("FLOCKMATE_FIRMWARE") else {
        println!("skipped: FLOCKMATE_FIRMWARE names no built firmware (`cargo xtask test` builds it)");
        return None;
    };
    Some(workspace().join(folder).join(name))
}

/// QEMU with a program on the board.
fn qemu(program: &Path) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command
        .args(["-machine", "mps2-an500", "-display", "none"])
        .arg("-kernel")
        .arg(program)
        .stdin(Stdio::null());
    command
}

/// QEMU's option that puts a file into memory at every reset.
fn loader(file: &Path, at: u32) -> String {
    format!("loader,file={},addr={at:#x},force-raw=on", file.display())
}

/// A map as `measure` and `calls` find it.
pub fn map_image(grid: &VoxelGrid<'_>) -> Vec<u8> {
    let shape = grid.shape();
    let dims = shape.dims.iter().flat_map(|d| d.to_le_bytes());
    let numbers = shape.min.iter().chain([&shape.resolution_m]).flat_map(|x| x.to_le_bytes());
    let words = grid.words();
    let count = (words.len() as u32).to_le_bytes();
    dims.chain(numbers).chain(count).chain(words.iter().flat_map(|word| word.to_le_bytes())).collect()
}

/// What `measure` or `calls` says of a roadmap file and a map, line by line.
///
/// # Panics
/// It does not run to its end.
pub fn measure(program: &Path, roadmap: &[u8], map: &[u8]) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let file = |name: &str, bytes: &[u8]| {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).expect("it can be written");
        file
    };
    let (roadmap, map) = (file("roadmap.bin", roadmap), file("map.bin", map));
    // An instruction takes a nanosecond of the board's time.
    let out = qemu(program)
        .args(["-monitor", "none", "-icount", "shift=0", "-semihosting-config", "enable=on,target=native"])
        .args(["-device", &loader(&roadmap, BANK2), "-device", &loader(&map, MAP)])
        .output()
        .expect("qemu-system-arm runs");
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success(), "{text}\n{}", String::from_utf8_lossy(&out.stderr));
    text.lines().map(str::to_owned).collect()
}
