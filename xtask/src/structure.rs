//! `cargo xtask structure`: checks the sources for import cycles, imports that point up, fields
//! written outside their module, written-out sets of states, large structs, long functions, `bool`
//! arguments, long files and long lines.
//!
//! The sources are parsed with `syn`. Any path that names an item of another file is an import of
//! that file: in a `use`, a type, a call. A `pub use` is an import too, and an item behind one
//! counts as an import of the file that defines it. Test modules may import anything; a `mod` line
//! is no import.

mod distances;
mod imports;
mod layers;
mod lines;
mod shape;
mod sources;
mod states;
mod writes;

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Result, ensure};

use self::sources::Tree;

/// Folders of the crates that are checked.
const CRATES: [&str; 10] = [
    "fpu",
    "lock-step",
    "planner-core",
    "companion",
    "sim-autopilot",
    "host-sim",
    "firmware",
    "board-bench",
    "tests",
    "xtask",
];

/// Prints every import cycle, every foreign write, and every struct, function, file or line beyond
/// the limits. An error if one of them has no listed reason, or if docs/margins.md does not match
/// the sources.
pub fn run() -> Result<()> {
    let (mut wrong, mut beyond) = (0, Vec::new());
    let mut records = BTreeSet::new();
    for tree in Tree::trees_of_crate(Path::new("planner-core"))? {
        records.extend(writes::public_fields(&tree));
    }
    let state_names = states::state_names()?;
    for name in CRATES {
        for tree in Tree::trees_of_crate(Path::new(name))? {
            for cycle in imports::import_cycles(&tree) {
                println!("{name}: import cycle:\n  {}", cycle.join("\n  "));
                wrong += 1;
            }
            let places = layers::upward_imports(&tree)
                .into_iter()
                .chain(writes::foreign_writes(&tree, &records))
                .chain(states::written_out_state_sets(&tree, &state_names));
            for place in places {
                println!("{name}: {place}");
                wrong += 1;
            }
            for (what, reason) in shape::beyond_size_limits(&tree) {
                println!("{name}: {what}: {}", reason.unwrap_or("no reason given"));
                wrong += usize::from(reason.is_none());
                beyond.push(what);
            }
        }
    }
    for (what, reason) in lines::faults_of_files()? {
        println!("{what}: {}", reason.unwrap_or("no reason given"));
        wrong += usize::from(reason.is_none());
    }
    for exception in shape::unused_exceptions(&beyond) {
        println!("{exception}");
        wrong += 1;
    }
    for place in distances::check_margins_page()? {
        println!("{place}");
        wrong += 1;
    }
    ensure!(wrong == 0, "{wrong} places break the rules of the structure");
    Ok(())
}
