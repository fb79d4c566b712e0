//! Finds imports that point up: a layer must not know those above it.

use super::imports::{self, Import};
use super::sources::Tree;

/// Files of the parts of host-sim that plan; they know no simulation.
const PLANNING: [&str; 15] = [
    "host-sim/src/area",
    "host-sim/src/capacity.rs",
    "host-sim/src/coverage",
    "host-sim/src/map",
    "host-sim/src/margins.rs",
    "host-sim/src/mission",
    "host-sim/src/mission.rs",
    "host-sim/src/output.rs",
    "host-sim/src/paper",
    "host-sim/src/report",
    "host-sim/src/result.rs",
    "host-sim/src/roadmap",
    "host-sim/src/roadmap.rs",
    "host-sim/src/scenario",
    "host-sim/src/terrain",
];

/// Which files must not import which crates and files.
const RULES: &[(&[&str], &[&str])] = &[
    (&PLANNING, &["sim_autopilot", "host-sim/src/swarm", "host-sim/src/flown"]),
    (&["host-sim/src/swarm"], &["host-sim/src/flown", "host-sim/src/commands"]),
    (&["sim-autopilot/src"], &["companion"]),
    (&["firmware/src"], &["board_bench"]),
    // From here on no code knows bytes, links or MAVLink.
    (
        &["companion/src/guidance", "companion/src/guidance.rs"],
        &[
            "mavlink",
            "companion/src/link",
            "companion/src/link.rs",
            "companion/src/services",
            "companion/src/services.rs",
            "companion/src/companion.rs",
        ],
    ),
    (&["companion/src/link", "companion/src/link.rs"], &["companion/src/companion.rs"]),
    (&["companion/src/planner", "companion/src/storage"], &["companion/src/companion.rs"]),
    (&["companion/src/time.rs", "companion/src/timers.rs"], &["mavlink", "companion/src/mission"]),
    // Plan types stand below what makes and follows plans.
    (
        &["planner-core/src/flight", "planner-core/src/flight.rs"],
        &[
            "planner-core/src/plan",
            "planner-core/src/plan.rs",
            "planner-core/src/track.rs",
            "planner-core/src/track/deconflict.rs",
        ],
    ),
];

/// A line for each import that points up.
pub fn upward(tree: &Tree) -> Vec<String> {
    let mut found = Vec::new();
    for (at, source) in tree.sources.iter().enumerate() {
        for (_, above) in RULES.iter().filter(|(below, _)| holds(below, &source.path)) {
            found.extend(imports::of(tree, at).into_iter().filter_map(|import| {
                let to = match import {
                    Import::File(file) => tree.sources[file].path.display().to_string(),
                    Import::Named(name) => name,
                };
                holds(above, to.as_ref())
                    .then(|| format!("{} imports {to}, which is above it", source.path.display()))
            }));
        }
    }
    found.dedup();
    found
}

/// Whether one of the `places` is the file, or a folder above it.
fn holds(places: &[&str], file: &std::path::Path) -> bool {
    places.iter().any(|place| file.starts_with(place))
}
