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

/// Those of them that `cargo xtask test` holds to the rules.
const HELD: [&str; 4] = ["planner-core", "host-sim", "tests", "xtask"];
/// Folders of them that are still written: not held yet.
const OPEN: [&str; 2] = ["planner-core/src/coverage", "host-sim/src/coverage"];

/// Prints every cycle of imports and every struct or function beyond the limits; fails if there is one without a reason.
pub fn run() -> Result<()> {
    check(&CRATES, &[])
}

/// The same of the crates that keep to the rules.
pub fn run_held() -> Result<()> {
    check(&HELD, &OPEN)
}

fn check(crates: &[&str], open: &[&str]) -> Result<()> {
    let is_open = |what: &str| open.iter().any(|folder| what.starts_with(folder));
    let mut wrong = 0;
    for name in crates {
        for tree in Tree::of_crate(Path::new(name))? {
            for cycle in imports::cycles(&tree) {
                println!("{name}: import cycle:\n  {}", cycle.join("\n  "));
                wrong += usize::from(!cycle.iter().all(|import| is_open(import)));
            }
            for (what, reason) in shape::beyond(&tree) {
                println!("{name}: {what}: {}", reason.unwrap_or("no reason given"));
                wrong += usize::from(reason.is_none() && !is_open(&what));
            }
        }
    }
    ensure!(wrong == 0, "{wrong} places break the rules of the structure");
    Ok(())
}
