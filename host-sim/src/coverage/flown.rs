//! Checks the pictures of a coverage mission that was flown.

use planner_core::plan::SwarmPlan;

use super::check::{self, CoverageFindings, Picture};
use super::{CoveragePlan, page, result};
use crate::report::{Outline, Plot};
use crate::result::CoverageResult;
use crate::scenario::Scenario;

/// Result of checking the pictures of a flight.
pub struct FlightFindings {
    /// The coverage section of `result.json`.
    pub result: CoverageResult,
    /// Borders of the area, its holes and no-fly zones, for the report page.
    pub outlines: Vec<Outline>,
    /// Curve of the share of the area that is photographed, over time.
    pub plot: Plot,
    /// Whether every cell of the area that counts is photographed.
    pub complete: bool,
}

/// Checks the pictures that were taken in a flight of this scenario. Departures in the result are
/// those of `plan`, which was flown.
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
    let findings: CoverageFindings = check::check_pictures(&planned, pictures);
    Ok(FlightFindings {
        result: result::coverage_result(&planned, &findings),
        outlines: page::area_outlines(&planned),
        plot: page::photographed_share_plot(&findings),
        complete: findings.covered_share >= 1.0,
    })
}
