//! Finds imports that point up: a layer must not know those above it.

use std::path::Path;

use super::imports::{self, Import};
use super::sources::Tree;

/// Files of the parts of host-sim that plan; they know no simulation.
const PLANNING_FILES: [&str; 22] = [
    "host-sim/src/area",
    "host-sim/src/area.rs",
    "host-sim/src/capacity.rs",
    "host-sim/src/coverage",
    "host-sim/src/coverage.rs",
    "host-sim/src/map",
    "host-sim/src/map.rs",
    "host-sim/src/margins.rs",
    "host-sim/src/mission",
    "host-sim/src/mission.rs",
    "host-sim/src/output.rs",
    "host-sim/src/paper",
    "host-sim/src/paper.rs",
    "host-sim/src/report",
    "host-sim/src/report.rs",
    "host-sim/src/result.rs",
    "host-sim/src/roadmap",
    "host-sim/src/roadmap.rs",
    "host-sim/src/scenario",
    "host-sim/src/scenario.rs",
    "host-sim/src/terrain",
    "host-sim/src/terrain.rs",
];

/// Which files must not import which crates and files.
const FORBIDDEN_IMPORTS: &[(&[&str], &[&str])] = &[
    (
        &PLANNING_FILES,
        &["sim_autopilot", "host-sim/src/swarm", "host-sim/src/flown", "host-sim/src/commands"],
    ),
    (&["host-sim/src/swarm"], &["host-sim/src/flown", "host-sim/src/commands"]),
    (&["sim-autopilot/src"], &["companion"]),
    (&["firmware/src"], &["board_bench"]),
    // The companion's guidance knows no links, no bytes and no MAVLink; time and timers no MAVLink.
    (
        &["companion/src/guidance", "companion/src/guidance.rs"],
        &[
            "mavlink",
            "companion/src/link",
            "companion/src/link.rs",
            "companion/src/services",
            "companion/src/services.rs",
        ],
    ),
    (&["companion/src/time.rs", "companion/src/timers.rs"], &["mavlink"]),
];

/// The layers of a crate, the lowest first. A layer is a module of the crate's root: its file and
/// the folder beside it.
type Layers = (&'static str, &'static [&'static str]);

const LAYERS: [Layers; 2] = [
    (
        "companion/src",
        &[
            "time",
            "timers",
            "margins",
            "state",
            "events",
            "link",
            "autopilot",
            "config",
            "storage",
            "swarm",
            "mission",
            "guidance",
            "replanning",
            "planner",
            "services",
            "companion",
        ],
    ),
    (
        "planner-core/src",
        &[
            "sort",
            "file",
            "geo",
            "map",
            "flight",
            "roadmap",
            "assignment",
            "schedule",
            "plan",
            "track",
            "detour",
            "coverage",
        ],
    ),
];

/// A line for each import that points up.
pub fn upward_imports(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for (at, source) in tree.sources.iter().enumerate() {
        let above = |to: &Path| {
            let ruled = FORBIDDEN_IMPORTS.iter().any(|(below, above)| {
                contains_file(below, &source.path) && contains_file(above, to)
            });
            ruled || LAYERS.iter().any(|layers| is_above(layers, &source.path, to))
        };
        for import in imports::imports_of(tree, at) {
            let to = match import {
                Import::File(file) => tree.sources[file].path.clone(),
                Import::Named(name) => name.into(),
            };
            if above(&to) {
                let (from, to) = (source.path.display(), to.display());
                found.push(format!("{from} imports {to}, which is above it"));
            }
        }
        if LAYERS.iter().any(|layers| is_in_no_layer(layers, &source.path)) {
            found.push(format!("{} is in no layer", source.path.display()));
        }
    }
    found
}

/// Whether one of the `places` is the file, or a folder above it.
fn contains_file(places: &[&str], file: &Path) -> bool {
    places.iter().any(|place| file.starts_with(place))
}

/// Whether both files are in layers of the crate, and `to` in the higher one.
fn is_above(layers: &Layers, from: &Path, to: &Path) -> bool {
    let indices = (layer_index(layers, from), layer_index(layers, to));
    matches!(indices, (Some(from), Some(to)) if to > from)
}

/// Whether a file is in the crate and in none of its layers. The crate's root is in none.
fn is_in_no_layer(layers: &Layers, file: &Path) -> bool {
    let root = Path::new(layers.0).join("lib.rs");
    file.starts_with(layers.0) && file != root && layer_index(layers, file).is_none()
}

/// Place of a file's layer in the order; `None` for a file in no layer of this crate.
fn layer_index((folder, order): &Layers, file: &Path) -> Option<usize> {
    let module = file.strip_prefix(folder).ok()?.iter().next()?;
    order.iter().position(|layer| Path::new(module).with_extension("") == Path::new(layer))
}

#[cfg(test)]
mod tests;
