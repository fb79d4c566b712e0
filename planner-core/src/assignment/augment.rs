//! Shortest augmenting paths: Dijkstra over the columns of a dense matrix, vectorised over all of them.
//!
//! A settled column is taken out of the running by moving its price to minus infinity and its distance to infinity, so
//! the inner loop has no test for it: its reduced costs come out infinite. Both are kept aside and put back at the end.

use super::{Costs, NONE, State};

/// Columns handled together; enough for the widest vectors, small enough to stay in registers.
pub(super) const LANES: usize = 8;

/// Scratch of one search, a slot for each column.
pub(super) struct Paths<'w> {
    pub(super) distance: &'w mut [f64],
    pub(super) previous: &'w mut [u16],
    /// Columns settled, in order, with their price and distance.
    pub(super) settled: &'w mut [u16],
    pub(super) settled_price: &'w mut [f64],
    pub(super) settled_distance: &'w mut [f64],
}

/// Serves the free row number `k`. False if no path leads to a free column.
pub(super) fn from_one(costs: &Costs<'_>, state: &mut State<'_>, paths: &mut Paths<'_>, k: usize) -> bool {
    let row = state.free[k];
    paths.distance.fill(f64::INFINITY);
    let least = relax(costs.row(row, state.row), state.price, 0.0, row, paths);
    shortest(costs, state, paths, least)
}

/// Adds one pair, from whichever free row is cheapest. False if no path is left.
pub(super) fn from_all(costs: &Costs<'_>, state: &mut State<'_>, paths: &mut Paths<'_>) -> bool {
    paths.distance.fill(f64::INFINITY);
    let mut least = f64::INFINITY;
    for row in (0..costs.rows as u16).filter(|&row| state.col_of[usize::from(row)] == NONE) {
        least = relax(costs.row(row, state.row), state.price, 0.0, row, paths);
    }
    shortest(costs, state, paths, least)
}

/// Settles columns from the distances of the sources, updates the prices and flips the path.
fn shortest(costs: &Costs<'_>, state: &mut State<'_>, paths: &mut Paths<'_>, mut least: f64) -> bool {
    let mut count = 0;
    let end = loop {
        if least == f64::INFINITY {
            break None;
        }
        let col = nearest(paths.distance, state.row_of, least);
        let row = state.row_of[usize::from(col)];
        if row == NONE {
            break Some(col);
        }
        let at = usize::from(col);
        let price = state.price[at];
        (paths.settled[count], paths.settled_price[count], paths.settled_distance[count]) =
            (col, price, least);
        count += 1;
        (state.price[at], paths.distance[at]) = (f64::NEG_INFINITY, f64::INFINITY);
        let offset = f64::from(costs.at(row, col)) - price - least;
        least = relax(costs.row(row, state.row), state.price, offset, row, paths);
    };
    for k in 0..count {
        let rise = if end.is_some() { paths.settled_distance[k] - least } else { 0.0 };
        state.price[usize::from(paths.settled[k])] = paths.settled_price[k] + rise;
    }
    end.map(|col| flip(state, paths.previous, col)).is_some()
}

/// `distance = min(distance, cost - price - offset)` over all columns; returns the least distance.
fn relax(line: &[f32], price: &[f64], offset: f64, row: u16, paths: &mut Paths<'_>) -> f64 {
    let (lines, line_rest) = line.as_chunks::<LANES>();
    let (prices, price_rest) = price.as_chunks::<LANES>();
    let (distances, distance_rest) = paths.distance.as_chunks_mut::<LANES>();
    let (previous, previous_rest) = paths.previous.as_chunks_mut::<LANES>();
    let mut least = [f64::INFINITY; LANES];
    for (((line, price), distance), previous) in lines.iter().zip(prices).zip(distances).zip(previous) {
        let mut through = [0.0; LANES];
        let mut nearer = false;
        for lane in 0..LANES {
            through[lane] = f64::from(line[lane]) - price[lane] - offset;
            nearer |= through[lane] < distance[lane];
        }
        if nearer {
            for lane in 0..LANES {
                if through[lane] < distance[lane] {
                    (distance[lane], previous[lane]) = (through[lane], row);
                }
            }
        }
        for lane in 0..LANES {
            least[lane] = if distance[lane] < least[lane] { distance[lane] } else { least[lane] };
        }
    }
    let rest = line_rest.iter().zip(price_rest).zip(distance_rest).zip(previous_rest);
    for (k, (((&cost, &price), distance), previous)) in rest.enumerate() {
        let through = f64::from(cost) - price - offset;
        if through < *distance {
            (*distance, *previous) = (through, row);
        }
        least[k] = least[k].min(*distance);
    }
    least.into_iter().fold(f64::INFINITY, f64::min)
}

/// A column at distance `least`, a free one if there is any.
fn nearest(distance: &[f64], row_of: &[u16], least: f64) -> u16 {
    let mut found = NONE;
    for (col, _) in distance.iter().enumerate().filter(|(_, d)| **d == least) {
        if row_of[col] == NONE {
            return col as u16;
        }
        if found == NONE {
            found = col as u16;
        }
    }
    found
}

/// Gives each column on the path to the row it was reached from.
fn flip(state: &mut State<'_>, previous: &[u16], end: u16) {
    let mut col = end;
    while col != NONE {
        let row = previous[usize::from(col)];
        let released = state.col_of[usize::from(row)];
        state.join(row, col);
        col = released;
    }
}

/// Adds one pair by the path from any free row whose largest cost is least; returns that cost. `None` if no path is left.
pub(super) fn from_all_bottleneck(
    costs: &Costs<'_>,
    state: &mut State<'_>,
    paths: &mut Paths<'_>,
) -> Option<f32> {
    // The path to a settled column is final: its distance moves to infinity so that it is not chosen again, and
    // `settled_price` keeps it from being reached anew.
    let done = &mut *paths.settled_price;
    done.fill(0.0);
    paths.distance.fill(f64::INFINITY);
    for row in (0..costs.rows as u16).filter(|&row| state.col_of[usize::from(row)] == NONE) {
        relax_largest(
            costs.row(row, state.row),
            f64::NEG_INFINITY,
            row,
            done,
            paths.distance,
            paths.previous,
        );
    }
    loop {
        let least = paths.distance.iter().copied().fold(f64::INFINITY, f64::min);
        if least == f64::INFINITY {
            return None;
        }
        let col = nearest(paths.distance, state.row_of, least);
        let row = state.row_of[usize::from(col)];
        if row == NONE {
            flip(state, paths.previous, col);
            return Some(least as f32);
        }
        done[usize::from(col)] = 1.0;
        paths.distance[usize::from(col)] = f64::INFINITY;
        relax_largest(costs.row(row, state.row), least, row, done, paths.distance, paths.previous);
    }
}

fn relax_largest(
    line: &[f32],
    so_far: f64,
    row: u16,
    done: &[f64],
    distance: &mut [f64],
    previous: &mut [u16],
) {
    let columns = line.iter().zip(done).zip(distance).zip(previous);
    for (((&cost, &done), distance), previous) in columns {
        let through = f64::from(cost).max(so_far);
        if done == 0.0 && through < *distance {
            (*distance, *previous) = (through, row);
        }
    }
}
