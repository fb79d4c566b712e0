//! `cargo xtask structure`: which file imports which, and the shape of structs and functions.
//!
//! Read from the sources with `syn`. An import is any path that leaves its file: a `use`, a type, a call. What a `pub use` passes on counts
//! as an import of the file that defines it. Test modules may import what they like; a `mod` line is no import.

mod imports;
mod shape;
mod sources;

use std::path::Path;

use anyhow::{Result, ensure};

use self::sources::Tree;

/// The crates that are looked at, by folder.
const CRATES: [&str; 6] = ["planner-core", "companion", "host-sim", "firmware", "tests", "xtask"];

/// Those without import cycles; `cargo xtask test` holds them to that.
const ACYCLIC: [&str; 5] = ["planner-core", "companion", "host-sim", "tests", "xtask"];
/// Those whose structs and functions keep to the limits, but for the exceptions; held to that too.
const SHAPED: [&str; 4] = ["planner-core", "host-sim", "tests", "xtask"];

/// Prints every cycle of imports and every struct or function beyond the limits; fails if there is one without a reason.
pub fn run() -> Result<()> {
    check(&CRATES, &CRATES)
}

/// The same of the crates that keep to the rules.
pub fn run_held() -> Result<()> {
    check(&ACYCLIC, &SHAPED)
}

fn check(acyclic: &[&str], shaped: &[&str]) -> Result<()> {
    let mut wrong = 0;
    for name in CRATES {
        for tree in Tree::of_crate(Path::new(name))? {
            for cycle in imports::cycles(&tree).into_iter().filter(|_| acyclic.contains(&name)) {
                println!("{name}: import cycle:\n  {}", cycle.join("\n  "));
                wrong += 1;
            }
            for (what, reason) in shape::beyond(&tree).into_iter().filter(|_| shaped.contains(&name)) {
                println!("{name}: {what}: {}", reason.unwrap_or("no reason given"));
                wrong += usize::from(reason.is_none());
            }
        }
    }
    ensure!(wrong == 0, "{wrong} places break the rules of the structure");
    Ok(())
}
