//! POWELL-BINPAT: a search for the vehicles' shares W of the path, 0 ≤ W_k ≤ 1, with the least max
//! C_k (the largest route cost). For each share of 0 one vehicle gets no route.
//!
//! Source: paper CPP §3.2.3; M. J. D. Powell, "An efficient method for finding the minimum of a
//! function of several variables without calculating derivatives", Computer Journal 7 (1964). An
//! implementation of our own, bounded by at most `max_evaluations` packings.
//!
//! max C_k over W is a staircase with flat steps (a waypoint goes to one vehicle or to another), so
//! a line search first tries points along the whole line and then narrows around the best. Each
//! bin's share counts relative to the sum of all, as in [`super::pack::cbinpack`]. The search
//! starts with the vehicles' weights as shares and keeps the best plan seen, so with equal weights
//! the result is never worse than BINPAT's.

use super::CoverageError;
use super::pack::{BinEligibility, CoverageProblem, PackWorkspace, RoutePlan, pack_routes};

/// Settings of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PowellConfig {
    /// Most packings that are evaluated.
    pub max_evaluations: u32,
}

impl PowellConfig {
    /// The settings with which `host-sim` plans.
    pub const USUAL: Self = Self { max_evaluations: 4000 };
}

/// Number of intervals into which a line search divides the whole line within 0 ≤ W_k ≤ 1.
const LINE_INTERVALS: u32 = 8;
/// Times that a line search halves its step around the best point found so far.
const STEP_HALVINGS: u32 = 7;
/// The search ends with a round that lowers the cost by less than this share of the cost.
const MIN_ROUND_GAIN: f32 = 1e-4;

/// Memory of the search: shares, search directions, and the packings' workspace.
pub struct PowellWorkspace<const K: usize> {
    /// Workspace of the packings.
    pub pack: PackWorkspace<K>,
    /// Shares of the best plan so far.
    best_shares: [f32; K],
    /// The point in the space of shares at which the search is.
    current_shares: [f32; K],
    /// Search directions in the space of shares.
    directions: [[f32; K]; K],
    /// The plan evaluated last.
    plan: RoutePlan<K>,
}

impl<const K: usize> PowellWorkspace<K> {
    /// Creates an empty workspace: all zeros.
    pub const fn new() -> Self {
        Self {
            pack: PackWorkspace::new(),
            best_shares: [0.0; K],
            current_shares: [0.0; K],
            directions: [[0.0; K]; K],
            plan: RoutePlan::new(),
        }
    }
}

impl<const K: usize> Default for PowellWorkspace<K> {
    fn default() -> Self {
        Self::new()
    }
}

/// Writes the plan of the best shares found to `out`; the shares are in `ws.pack` afterwards.
///
/// # Errors
/// Those of [`super::pack::binpat`].
pub fn powell<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    config: &PowellConfig,
    ws: &mut PowellWorkspace<K>,
    out: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    problem.check::<K>()?;
    let count = problem.vehicles.len();
    let mut search = ShareSearch {
        problem,
        evaluations_left: config.max_evaluations.max(1),
        least_cost_s: f32::INFINITY,
        ws,
        out,
    };
    let weights = problem.vehicles.iter().map(|vehicle| vehicle.weight);
    let largest = weights.clone().fold(0.0, libm::fmaxf);
    for (share, weight) in search.ws.current_shares.iter_mut().zip(weights) {
        *share = weight / largest;
    }
    let mut cost = search.evaluate()?;
    search.reset_directions(count);
    loop {
        let before = cost;
        let from = search.ws.current_shares;
        let (mut largest, mut at) = (0.0, 0);
        for k in 0..count {
            let line = search.ws.directions[k];
            let found = search.line_search(&line, count, cost)?;
            if cost - found > largest {
                (largest, at) = (cost - found, k);
            }
            cost = found;
        }
        // The sum of this round's moves becomes a search direction; it replaces the direction that
        // gained most.
        let mut whole = search.ws.current_shares;
        whole.iter_mut().zip(from).for_each(|(to, from)| *to -= from);
        if whole[..count].iter().any(|step| *step != 0.0) {
            cost = search.line_search(&whole, count, cost)?;
            search.ws.directions[at] = whole;
        }
        if search.evaluations_left == 0 || before - cost <= before * MIN_ROUND_GAIN {
            break;
        }
    }
    let ShareSearch { ws, .. } = search;
    ws.pack.shares = ws.best_shares;
    Ok(())
}

/// The running search; `out` has the plan with the cost `least_cost_s`, the best so far.
struct ShareSearch<'s, 'w, const L: usize, const N: usize, const K: usize> {
    problem: &'s CoverageProblem<'w, L, N>,
    /// Number of evaluations that may still be made.
    evaluations_left: u32,
    /// Cost of the best plan so far, seconds.
    least_cost_s: f32,
    ws: &'s mut PowellWorkspace<K>,
    /// The best plan so far.
    out: &'s mut RoutePlan<K>,
}

impl<const L: usize, const N: usize, const K: usize> ShareSearch<'_, '_, L, N, K> {
    /// Sets the search directions to the axes: each changes the share of one bin.
    fn reset_directions(&mut self, count: usize) {
        for (k, line) in self.ws.directions[..count].iter_mut().enumerate() {
            line.fill(0.0);
            line[k] = 1.0;
        }
    }

    /// max C_k with the shares `current_shares`; infinite if all are 0. Keeps the plan if it is the
    /// best so far.
    fn evaluate(&mut self) -> Result<f32, CoverageError> {
        self.evaluations_left = self.evaluations_left.saturating_sub(1);
        let ws = &mut *self.ws;
        if ws.current_shares[..self.problem.vehicles.len()].iter().all(|share| *share <= 0.0) {
            return Ok(f32::INFINITY);
        }
        ws.pack.shares = ws.current_shares;
        pack_routes(self.problem, BinEligibility::Anyone, &mut ws.pack, &mut ws.plan)?;
        let cost = ws.plan.max_cost_s();
        if cost < self.least_cost_s {
            self.least_cost_s = cost;
            ws.best_shares = ws.current_shares;
            self.out.routes.clone_from(&ws.plan.routes);
        }
        Ok(cost)
    }

    /// Searches along the direction `line` through `current_shares`, within 0 ≤ W_k ≤ 1, for a cost
    /// less than `cost`, that of `current_shares`. Returns the least cost found, and moves
    /// `current_shares` to its point.
    fn line_search(
        &mut self,
        line: &[f32; K],
        count: usize,
        cost: f32,
    ) -> Result<f32, CoverageError> {
        let from = self.ws.current_shares;
        let Some((low, high)) = range_in_box(&from[..count], &line[..count]) else {
            return Ok(cost);
        };
        let mut best = (cost, 0.0);
        let step = (high - low) / LINE_INTERVALS as f32;
        for k in 0..=LINE_INTERVALS {
            self.evaluate_at(&from, line, low + step * k as f32, &mut best)?;
        }
        let mut step = step;
        for _ in 0..STEP_HALVINGS {
            step /= 2.0;
            let middle = best.1;
            for at in [middle - step, middle + step] {
                if (low..=high).contains(&at) {
                    self.evaluate_at(&from, line, at, &mut best)?;
                }
            }
        }
        self.move_along(&from, line, best.1);
        Ok(best.0)
    }

    /// Evaluates the shares `from` + `at` · `line` if evaluations are left. `best` becomes their
    /// cost and `at` if they are better.
    fn evaluate_at(
        &mut self,
        from: &[f32; K],
        line: &[f32; K],
        at: f32,
        best: &mut (f32, f32),
    ) -> Result<(), CoverageError> {
        if self.evaluations_left == 0 {
            return Ok(());
        }
        self.move_along(from, line, at);
        let cost = self.evaluate()?;
        if cost < best.0 {
            *best = (cost, at);
        }
        Ok(())
    }

    /// Sets `current_shares` to `from` + `at` · `line`, each share limited to 0 to 1.
    fn move_along(&mut self, from: &[f32; K], line: &[f32; K], at: f32) {
        for (share, (from, line)) in self.ws.current_shares.iter_mut().zip(from.iter().zip(line)) {
            *share = (from + line * at).clamp(0.0, 1.0);
        }
    }
}

/// Range of the line's parameter within which all shares stay from 0 to 1; `None` if the range is
/// one point, or the line has no length.
fn range_in_box(from: &[f32], line: &[f32]) -> Option<(f32, f32)> {
    let (mut low, mut high) = (f32::NEG_INFINITY, f32::INFINITY);
    for (from, step) in from.iter().zip(line).filter(|(_, step)| **step != 0.0) {
        let (a, b) = (-from / step, (1.0 - from) / step);
        low = libm::fmaxf(low, libm::fminf(a, b));
        high = libm::fminf(high, libm::fmaxf(a, b));
    }
    (low.is_finite() && high.is_finite() && low < high).then_some((low, high))
}
