//! Links the programs for the emulated board as its firmware is linked.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // The build script of firmware gives these to crates that depend on it; on the host it gives
    // none.
    let arguments = env::var("DEP_BOARD_LINK_ARGUMENTS").unwrap_or_default();
    for argument in arguments.split_whitespace() {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
