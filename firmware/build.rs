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
    if chosen("QEMU") {
        let memory = manifest.join("src/boards/qemu/memory.x");
        link(&memory, include_str!("src/boards/qemu/device.x"));
    }
}

fn link(memory: &Path, device: &str) {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let map = fs::read(memory).expect("the board has a memory map");
    fs::write(out.join("memory.x"), map).expect("OUT_DIR can be written");
    fs::write(out.join("device.x"), device).expect("OUT_DIR can be written");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed={}", memory.display());
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
}
