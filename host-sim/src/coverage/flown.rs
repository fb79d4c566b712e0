//! A coverage flight: what its pictures show.

use planner_core::plan::SwarmPlan;

use super::check::{self, Findings, Picture};
use super::{CoveragePlan, page, result};
use crate::report::{Outline, Plot};
use crate::result::CoverageResult;
use crate::scenario::Scenario;

/// Findings about a flight.
pub struct FlightFindings {
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
/// As [`CoveragePlan::new`].
pub fn judge_pictures<const V: usize, const W: usize>(
    scenario: &Scenario,
    plan: &SwarmPlan<V, W>,
    pictures: Vec<Picture>,
) -> anyhow::Result<FlightFindings> {
    let mut planned = CoveragePlan::plan_as_companions(scenario)?;
    for sortie in &mut planned.sorties {
        sortie.depart_s = plan.flights[usize::from(sortie.route.vehicle)].depart_s;
    }
    let findings: Findings = check::check_pictures(&planned, pictures);
    Ok(FlightFindings {
        result: result::coverage_result(&planned, &findings),
        outlines: page::area_outlines(&planned),
        plot: page::photographed_share_plot(&findings),
        complete: findings.covered_share >= 1.0,
    })
}
