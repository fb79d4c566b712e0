//! Reads a scenario: everything a run depends on, in one TOML file.
//!
//! Every key has a default except the vehicles and the map with the goals, or the area in their
//! place. An unknown key, a value out of range, and two values that contradict each other are
//! errors that name file, line and column.
//! Lengths are metres in the mission's ENU frame. Keys of features that are not built yet are read
//! and then refused by name: see [`Scenario::check_supported`].

pub mod coverage;
mod error;
mod sections;
#[cfg(test)]
mod tests;

mod reader;
mod types;

use std::path::{Path, PathBuf};

use crate::files;
use crate::quote::printable_path;
pub use companion::autopilot::AutopilotKind;
pub use error::{ScenarioError, SourcePlace};
pub use planner_core::roadmap::prm::Sampling;
pub use planner_core::track::deconflict::Method;
pub(crate) use sections::DEFAULT_ORIGIN;
pub use types::{
    AssignmentObjective, CompanionHost, Deconfliction, FAULT_OBSTACLE, Fault, Geofence, MapSection,
    MissionMode, MissionSection, PositionErrors, RoadmapSection, Scenario, Simulation,
    TerminalEdges, UnsupportedTable, VEHICLE_FAULT_KINDS, VehicleSection,
};

/// Reads a scenario file; paths in it are relative to its folder.
pub fn load(path: &Path) -> Result<Scenario, ScenarioError> {
    let (text, name, folder) = read_scenario_file(path)?;
    read_scenario(&text, &name, &folder)
}

/// A scenario file's text, its name for errors, and its folder.
fn read_scenario_file(path: &Path) -> Result<(String, String, PathBuf), ScenarioError> {
    let name = printable_path(path);
    let fail = |why: String| ScenarioError { file: name.clone(), place: None, why, hint: None };
    let text = files::read_text(path).map_err(|e| {
        let toml = path.with_extension("toml");
        let hint = (!path.exists() && toml.is_file())
            .then(|| format!("did you mean `{}`?", printable_path(&toml)));
        ScenarioError { hint, ..fail(format!("cannot read it: {e}")) }
    })?;
    let folder = path.parent().map(PathBuf::from).unwrap_or_default();
    Ok((text, name, folder))
}

/// Parses a scenario's text; errors call it `name`, and its paths are relative to the working
/// directory.
pub fn parse(text: &str, name: &str) -> Result<Scenario, ScenarioError> {
    read_scenario(text, name, Path::new(""))
}

/// Reads a scenario's text: a coverage mission if it has `[area]`, else one with goals.
fn read_scenario(text: &str, file: &str, folder: &Path) -> Result<Scenario, ScenarioError> {
    let text = reader::TomlText { file, text };
    sections::read_root(text, |root| match root.get("area") {
        Some(_) => sections::area::read_coverage_scenario(text, root, folder),
        None => sections::goals::read_goals_scenario(text, root, folder),
    })
}
