//! Gives the linker the memory map of the chosen board: `memory.x` at the top of the checkout for
//! the default board, `memory.x` beside the board's code for the others.

use std::path::{Path, PathBuf};
use std::{env, fs};

/// Assertions that the linker checks after it has placed all sections. 4K is `GUARD_LEN` in
/// `boards/limits.rs`. The limit of `.data` finds large statics whose first value is not all zeros;
/// the emulated UARTs take 10 kB of it.
const LINKER_CHECKS: &str = r#"
ASSERT(__e_shell <= _stack_end - 4K, "the companion reaches into the stack's guard");
ASSERT(SIZEOF(.data) <= 16K, "what is large has a first value that is not all zeros");
"#;
/// Sections that must not be empty in the H743's firmware, the only program built for that board.
const CHIP_SECTIONS: &str = r#"
ASSERT(SIZEOF(.shell) > 0 && SIZEOF(.swarm_plan) > 0 && SIZEOF(.own_plan) > 0 && SIZEOF(.mission) > 0 && SIZEOF(.dma) > 0,
  "a part has lost its name, or its first value is not all zeros");
"#;
/// Arguments with which every program for a board is linked.
const LINK_ARGUMENTS: [&str; 3] = ["--nmagic", "-Tboard-link.x", "-Tdefmt.x"];

fn main() {
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let chosen = |board: &str| env::var_os(format!("CARGO_FEATURE_{board}")).is_some();
    let manifest = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let boards = manifest.join("src/boards");
    if chosen("QEMU") {
        link(&boards.join("qemu/memory.x"), &[LINKER_CHECKS]);
        // `boards/qemu/vectors.rs` holds all interrupts of this board; the chips' crates bring
        // theirs.
        write("device.x", b"");
    } else if chosen("NUCLEO_H743") {
        link(&manifest.join("../memory.x"), &[LINKER_CHECKS, CHIP_SECTIONS]);
    } else if chosen("PICO2") {
        link(&boards.join("pico2/memory.x"), &[]);
    }
}

fn out() -> PathBuf {
    PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"))
}

fn write(name: &str, bytes: &[u8]) {
    fs::write(out().join(name), bytes).expect("OUT_DIR can be written");
    println!("cargo::rustc-link-search={}", out().display());
}

/// Cortex-m-rt's linker script includes `memory.x`. The linker first searches the directory in
/// which it was started, the top of the checkout, whose `memory.x` is the default board's. So the
/// script is copied, with the chosen board's map included instead and the checks appended.
fn link(memory: &Path, checks: &[&str]) {
    println!("cargo::rerun-if-changed={}", memory.display());
    write("board-memory.x", &fs::read(memory).expect("the board has a memory map"));
    let script = link_script().expect("cortex-m-rt is built before us: it declares what it links");
    let included = script.replace("INCLUDE memory.x", "INCLUDE board-memory.x");
    assert_ne!(script, included, "cortex-m-rt's link.x includes memory.x");
    write("board-link.x", (included + &checks.concat()).as_bytes());
    for argument in LINK_ARGUMENTS {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    // For the build scripts of crates that depend on this one: `DEP_BOARD_LINK_ARGUMENTS`.
    println!("cargo::metadata=arguments={}", LINK_ARGUMENTS.join(" "));
}

/// The `link.x` that cortex-m-rt's build script wrote last; all are alike.
fn link_script() -> Option<String> {
    // BUILD/firmware-HASH/out and BUILD/cortex-m-rt-HASH/out
    let built = out().ancestors().nth(2)?.to_owned();
    let scripts = fs::read_dir(built).ok()?.flatten().filter(|entry| {
        let name = entry.file_name();
        name.to_string_lossy().starts_with("cortex-m-rt-")
    });
    let scripts = scripts.map(|entry| entry.path().join("out/link.x"));
    let newest = scripts.max_by_key(|script| script.metadata().and_then(|m| m.modified()).ok())?;
    fs::read_to_string(newest).ok()
}
