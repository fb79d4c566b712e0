//! `cargo xtask structure`: which file imports which, the shape of structs and functions, and the
//! length of files and lines.
//!
//! Read from the sources with `syn`. An import is any path that leaves its file: a `use`, a type, a
//! call. What a `pub use` passes on counts as an import of the file that defines it. Test modules
//! may import what they like; a `mod` line is no import.

mod distances;
mod imports;
mod lines;
mod shape;
mod sources;

use std::path::Path;

use anyhow::{Result, ensure};

use self::sources::Tree;

/// The crates that are checked, by folder.
const CRATES: [&str; 8] =
    ["fpu", "planner-core", "companion", "sim-autopilot", "host-sim", "firmware", "tests", "xtask"];

/// Prints every cycle of imports and every struct, function, file or line beyond the limits; fails
/// if there is one without a reason, or if docs/margins.md is not that of the sources.
pub fn run() -> Result<()> {
    let mut wrong = 0;
    for name in CRATES {
        for tree in Tree::of_crate(Path::new(name))? {
            for cycle in imports::cycles(&tree) {
                println!("{name}: import cycle:\n  {}", cycle.join("\n  "));
                wrong += 1;
            }
            for (what, reason) in shape::beyond(&tree) {
                println!("{name}: {what}: {}", reason.unwrap_or("no reason given"));
                wrong += usize::from(reason.is_none());
            }
        }
    }
    for (what, reason) in lines::beyond()? {
        println!("{what}: {}", reason.unwrap_or("no reason given"));
        wrong += usize::from(reason.is_none());
    }
    for place in distances::wrong()? {
        println!("{place}");
        wrong += 1;
    }
    ensure!(wrong == 0, "{wrong} places break the rules of the structure");
    Ok(())
}
