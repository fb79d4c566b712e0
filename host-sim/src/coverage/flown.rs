//! A coverage flight: what its pictures show.

use planner_core::plan::SwarmPlan;

use super::check::{self, Findings, Picture};
use super::{Planned, page, result};
use crate::report::{Outline, Plot};
use crate::result::CoverageResult;
use crate::scenario::Scenario;

/// Findings about a flight.
pub struct Judged {
    /// The part of `result.json` about the coverage.
    pub result: CoverageResult,
    /// Borders of the area.
    pub outlines: Vec<Outline>,
    /// Share of the area that is photographed, over time.
    pub plot: Plot,
    /// Whether no part of the area was left out.
    pub complete: bool,
}

/// Judges the pictures of a flight of this scenario by this plan.
///
/// # Errors
/// As [`Planned::new`].
pub fn judge<const V: usize, const W: usize>(
    scenario: &Scenario,
    plan: &SwarmPlan<V, W>,
    pictures: Vec<Picture>,
) -> anyhow::Result<Judged> {
    let mut planned = Planned::flown(scenario)?;
    for sortie in &mut planned.sorties {
        sortie.depart_s = plan.flights[usize::from(sortie.route.vehicle)].depart_s;
    }
    let findings: Findings = check::check_pictures(&planned, pictures);
    Ok(Judged {
        result: result::of(&planned, &findings),
        outlines: page::outlines(&planned),
        plot: page::photographed(&findings),
        complete: findings.covered_share >= 1.0,
    })
}
