//! The methods by which the path over an area is divided among vehicles, in the host's memory.

use planner_core::coverage::pack::{
    CoverageProblem, PackWorkspace, Route, RoutePlan, binpat, binpat_by_shares,
};
use planner_core::coverage::{CoverageError, exact, powell};

use crate::scenario::coverage::CoverageMethod;

/// Least share of the path for one vehicle, metres: far below any spacing of waypoints.
const MIN_SHARE_M: f32 = 1e-3;

/// Divides the path among vehicles by a method. Returns the shares by which BINPAT makes the same
/// division on companions; `None` if there are none.
///
/// # Errors
/// As the method's planner.
pub fn divide_by_method<const L: usize, const N: usize, const K: usize>(
    work: &CoverageProblem<'_, L, N>,
    method: CoverageMethod,
    plan: &mut RoutePlan<K>,
) -> Result<Option<Vec<f32>>, CoverageError> {
    let own = || Some(work.vehicles.iter().map(|vehicle| vehicle.weight).collect());
    match method {
        CoverageMethod::SimpleBinpat | CoverageMethod::Binpat => {
            binpat(work, &mut PackWorkspace::<K>::new(), plan).map(|()| own())
        }
        CoverageMethod::PowellBinpat => divide_by_powell(work, plan).map(Some),
        CoverageMethod::Exact => {
            let count = work.tracks.waypoint_count() as usize;
            let [ways, reaches, states] =
                exact::ExactWorkspace::required_lengths(work.vehicles.len(), count);
            let (mut ways_m, mut reaches) = (vec![0.0; ways], vec![0; reaches]);
            let mut states = vec![(0, 0); states];
            let mut ws = exact::ExactWorkspace {
                transit_lengths_m: &mut ways_m,
                reachable_ends: &mut reaches,
                states: &mut states,
            };
            exact::plan_exact(work, &mut ws, &mut PackWorkspace::<K>::new(), plan)?;
            if work.following.is_some() {
                // Over terrain the exact division may not be the best.
                let mut other = RoutePlan::new();
                let shares = divide_by_powell(work, &mut other)?;
                if other.max_cost_s() < plan.max_cost_s() {
                    *plan = other;
                    return Ok(Some(shares));
                }
            }
            imitate_exact_plan(work, plan)
        }
    }
}

/// Writes the plan by POWELL-BINPAT, and returns the vehicles' shares of it.
fn divide_by_powell<const L: usize, const N: usize, const K: usize>(
    work: &CoverageProblem<'_, L, N>,
    plan: &mut RoutePlan<K>,
) -> Result<Vec<f32>, CoverageError> {
    let mut ws = powell::PowellWorkspace::<K>::new();
    powell::powell(work, &powell::PowellConfig::USUAL, &mut ws, plan)?;
    Ok(ws.pack.shares()[..work.vehicles.len()].to_vec())
}

/// Shares with which BINPAT cuts the path where the exact division does; `exact` then becomes
/// BINPAT's plan. `None` if BINPAT cuts elsewhere, or assigns the parts to vehicles so that they
/// take longer: companions plan by shares alone, so they cannot fly the exact plan.
fn imitate_exact_plan<const L: usize, const N: usize, const K: usize>(
    work: &CoverageProblem<'_, L, N>,
    exact: &mut RoutePlan<K>,
) -> Result<Option<Vec<f32>>, CoverageError> {
    let mut shares = vec![0.0; work.vehicles.len()];
    let mut packed_m = 0.0;
    for (share, route) in shares.iter_mut().zip(&exact.routes) {
        let end_m = work.tracks.distance_to_waypoint_m(route.waypoint_end - 1);
        // A share of length 0 would get no waypoint, but a route of the path's first waypoint alone
        // has length 0.
        *share = (end_m - packed_m).max(MIN_SHARE_M);
        packed_m = end_m;
    }
    let mut plan = RoutePlan::new();
    binpat_by_shares(work, &shares, &mut PackWorkspace::<K>::new(), &mut plan)?;
    let waypoints = |route: &Route| (route.lowest_waypoint, route.waypoint_end);
    let alike = plan.routes.iter().map(waypoints).eq(exact.routes.iter().map(waypoints));
    if !alike || plan.max_cost_s() > exact.max_cost_s() {
        return Ok(None);
    }
    *exact = plan;
    Ok(Some(shares))
}
