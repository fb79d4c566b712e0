//! Compares the greatest costs of the methods that divide an area, on random convex areas for 2 to
//! 10 vehicles.

use std::ops::Range;

use host_sim::coverage::CoveragePlan;
use host_sim::scenario;
use host_sim::scenario::coverage::CoverageMethod;
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;
use rayon::prelude::*;

use crate::areas::{self, Shape};

/// Ratio of two costs above which one counts as greater: more than rounding.
const GREATER_RATIO: f32 = 1.0001;

/// Comparison of the methods over all areas.
#[derive(Clone, Copy, Debug)]
pub struct Costs {
    /// Number of areas that all methods planned.
    pub areas: usize,
    /// Number of areas where POWELL-BINPAT costs more than BINPAT.
    pub powell_over_binpat: usize,
    /// Number of areas where POWELL-BINPAT costs more than SIMPLE-BINPAT.
    pub powell_over_simple: usize,
    /// Number of plans by SIMPLE-BINPAT, BINPAT or POWELL-BINPAT that cost less than `exact`.
    pub plans_below_exact: usize,
    /// Median excess of SIMPLE-BINPAT, BINPAT and POWELL-BINPAT over `exact`, percent of the cost.
    pub median_gaps_percent: [f32; 3],
}

impl Costs {
    /// Plans one random area for each of these seeds by every method.
    ///
    /// # Panics
    /// A cost is below the lower bound of all divisions, or no area could be planned.
    pub fn of(seeds: Range<u64>) -> Self {
        let mut all: Vec<[f32; 4]> = seeds.into_par_iter().filter_map(costs_by_method).collect();
        assert!(!all.is_empty(), "no area could be planned");
        let over = |a: usize, b: usize| {
            all.iter().filter(|costs| costs[a] > costs[b] * GREATER_RATIO).count()
        };
        let (powell_over_binpat, powell_over_simple) = (over(2, 1), over(2, 0));
        let below_exact = (0..3).map(|method| over(3, method)).sum();
        let gaps = [0, 1, 2].map(|method| {
            let gap = |costs: &[f32; 4]| costs[method] / costs[3];
            all.sort_by(|a, b| gap(a).total_cmp(&gap(b)));
            100.0 * (gap(&all[all.len() / 2]) - 1.0)
        });
        Self {
            areas: all.len(),
            powell_over_binpat,
            powell_over_simple,
            plans_below_exact: below_exact,
            median_gaps_percent: gaps,
        }
    }
}

/// Greatest costs of SIMPLE-BINPAT, BINPAT, POWELL-BINPAT and `exact` on one area, seconds; `None`
/// if a method cannot plan it.
fn costs_by_method(seed: u64) -> Option<[f32; 4]> {
    let mut random = Pcg32::seed_from_u64(seed);
    let text = areas::scenario(&mut random, Shape::Convex, 2 + (seed % 9) as usize);
    let scenario = scenario::parse(&text, "random").ok()?;
    let cost =
        |method| CoveragePlan::new(&scenario, method).map(|planned| planned.plan.max_cost_s()).ok();
    let bound_s = CoveragePlan::new(&scenario, CoverageMethod::Binpat).ok()?.lower_bound_s;
    let costs = [
        cost(CoverageMethod::SimpleBinpat)?,
        cost(CoverageMethod::Binpat)?,
        cost(CoverageMethod::PowellBinpat)?,
        cost(CoverageMethod::Exact)?,
    ];
    assert!(
        costs.iter().all(|cost| *cost >= bound_s * 0.9999),
        "seed {seed}: {costs:?} below {bound_s}"
    );
    Some(costs)
}
