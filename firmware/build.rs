//! Gives the linker the memory map of the chosen board: `memory.x` at the top of the checkout for the default board,
//! `memory.x` beside the board's code for the others.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let chosen = |board: &str| env::var_os(format!("CARGO_FEATURE_{board}")).is_some();
    let manifest = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let boards = manifest.join("src/boards");
    if chosen("QEMU") {
        link(&boards.join("qemu/memory.x"));
        // Its interrupts are all in its own table; the chips' crates bring theirs.
        write("device.x", b"");
    } else if chosen("NUCLEO_H743") {
        link(&manifest.join("../memory.x"));
    } else if chosen("PICO2") {
        link(&boards.join("pico2/memory.x"));
    }
}

fn write(name: &str, bytes: &[u8]) {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    fs::write(out.join(name), bytes).expect("OUT_DIR can be written");
    println!("cargo:rustc-link-search={}", out.display());
}

fn link(memory: &Path) {
    write("memory.x", &fs::read(memory).expect("the board has a memory map"));
    println!("cargo:rerun-if-changed={}", memory.display());
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
}
