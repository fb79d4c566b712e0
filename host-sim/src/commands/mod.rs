//! The commands of `host-sim` that work on a scenario.

pub mod autopilot;
pub mod companion;
pub mod cover;
pub mod fly;
pub mod paper;
pub mod plan;
pub mod radio;
pub mod roadmap;
pub mod upload;

use std::path::Path;

use crate::scenario::{self, Scenario};

/// Reads a scenario and refuses what is not built yet by name.
fn load(path: &Path, seed: Option<u64>) -> anyhow::Result<Scenario> {
    let mut scenario = scenario::load(path)?;
    scenario.check_supported()?;
    scenario.seed = seed.unwrap_or(scenario.seed);
    Ok(scenario)
}
