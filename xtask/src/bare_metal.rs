//! The pure crates for a bare-metal Cortex-M7: by rustup's target where there is one, else by Debian's toolchain.

use anyhow::Result;

use crate::install;
use crate::shell::{cargo, command, run, target_dir};

const TARGET: &str = "thumbv7em-none-eabihf";
/// Crates that go on the board.
const CRATES: &[&str] = &["planner-core", "companion"];

/// Builds `planner-core` and `companion` without std.
pub fn build() -> Result<()> {
    let packages = CRATES.iter().flat_map(|name| ["-p", name]);
    if rustup_has_target() {
        println!("bare metal: rustup's {TARGET}");
        return run(cargo().args(["build", "--release", "--target", TARGET]).args(packages));
    }
    println!("bare metal: Debian's toolchain builds core for {TARGET}");
    install::debian(install::BARE_METAL)?;
    run(command("/usr/bin/cargo")
        .args(["build", "--release", "--target", TARGET])
        .args(["-Zbuild-std=core,alloc", "-Zbuild-std-features=compiler-builtins-mem"])
        .args(packages)
        .env("RUSTC_BOOTSTRAP", "1")
        .env("RUSTC", "/usr/bin/rustc")
        .env_remove("RUSTUP_TOOLCHAIN")
        .env_remove("CARGO")
        // Products of two compilers do not mix.
        .env("CARGO_TARGET_DIR", target_dir().join("bare-metal")))
}

fn rustup_has_target() -> bool {
    let installed = command("rustup").args(["target", "list", "--installed"]).output();
    installed.is_ok_and(|out| String::from_utf8_lossy(&out.stdout).lines().any(|line| line == TARGET))
}
