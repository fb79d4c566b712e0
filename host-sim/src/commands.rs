//! The commands of `host-sim`, one module each.

pub mod autopilot;
pub mod companion;
pub mod cover;
pub mod fly;
pub mod map;
pub mod paper;
pub mod plan;
pub mod radio;
pub mod roadmap;
pub mod upload;

use std::path::Path;

use crate::scenario::{self, Scenario};

/// Loads a scenario and refuses features that are not available yet; `seed` replaces the scenario's
/// seed.
fn load_supported(path: &Path, seed: Option<u64>) -> anyhow::Result<Scenario> {
    let mut scenario = scenario::load(path)?;
    scenario.check_supported()?;
    scenario.seed = seed.unwrap_or(scenario.seed);
    Ok(scenario)
}
