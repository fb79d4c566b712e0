//! Shortest augmenting paths: Dijkstra over the columns of a dense matrix, vectorised over all of them.
//!
//! A settled column is taken out of the running by moving its price to minus infinity and its distance to infinity, so
//! the inner loop has no test for it: its reduced costs come out infinite. Both are kept aside and put back at the end.

use super::costs::Costs;
use super::state::{Paths, SIMD_LANES, State, UNASSIGNED};

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
    for row in (0..costs.rows as u16).filter(|&row| state.col_of[usize::from(row)] == UNASSIGNED) {
        least = relax(costs.row(row, state.row), state.price, 0.0, row, paths);
    }
    shortest(costs, state, paths, least)
}

/// Settles columns from the distances of the sources, updates the prices and flips the path.
fn shortest(costs: &Costs<'_>, state: &mut State<'_>, paths: &mut Paths<'_>, mut least: f64) -> bool {
    // Columns at one distance are settled together and wait in `settled[done..queued]`: integer costs have many.
    let (mut done, mut queued) = (0, 0);
    let mut next = least;
    let end = loop {
        if done == queued || next <= least {
            least = next;
            if least == f64::INFINITY {
                break None;
            }
            let from = queued;
            match nearest(paths.distance, state.row_of, least, &mut paths.settled[from..]) {
                Nearest::Free(col) => break Some(col),
                Nearest::Taken(count) => queued += count,
            }
            for k in from..queued {
                let at = usize::from(paths.settled[k]);
                (paths.settled_price[k], paths.settled_distance[k]) = (state.price[at], least);
                (state.price[at], paths.distance[at]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        let col = paths.settled[done];
        let row = state.row_of[usize::from(col)];
        let offset = f64::from(costs.at(row, col)) - paths.settled_price[done] - paths.settled_distance[done];
        next = relax(costs.row(row, state.row), state.price, offset, row, paths);
        done += 1;
    };
    for k in 0..queued {
        let rise = if end.is_some() { paths.settled_distance[k] - least } else { 0.0 };
        state.price[usize::from(paths.settled[k])] = paths.settled_price[k] + rise;
    }
    end.map(|col| flip(state, paths.previous, col)).is_some()
}

/// `distance = min(distance, cost - price - offset)` over all columns; returns the least distance.
fn relax(line: &[f32], price: &[f64], offset: f64, row: u16, paths: &mut Paths<'_>) -> f64 {
    let (lines, line_rest) = line.as_chunks::<SIMD_LANES>();
    let (prices, price_rest) = price.as_chunks::<SIMD_LANES>();
    let (distances, distance_rest) = paths.distance.as_chunks_mut::<SIMD_LANES>();
    let (previous, previous_rest) = paths.previous.as_chunks_mut::<SIMD_LANES>();
    let mut least = [f64::INFINITY; SIMD_LANES];
    for (((line, price), distance), previous) in lines.iter().zip(prices).zip(distances).zip(previous) {
        // Whole chunks in, whole chunks out, and selects within: so the compiler makes vectors of the lanes, and nothing
        // is mispredicted.
        let (mut nearest, mut through) = (*distance, [0.0; SIMD_LANES]);
        for lane in 0..SIMD_LANES {
            through[lane] = f64::from(line[lane]) - price[lane] - offset;
        }
        let mut nearer = [0_u16; SIMD_LANES];
        for lane in 0..SIMD_LANES {
            nearer[lane] = if through[lane] < nearest[lane] { u16::MAX } else { 0 };
            nearest[lane] = if through[lane] < nearest[lane] { through[lane] } else { nearest[lane] };
        }
        for lane in 0..SIMD_LANES {
            least[lane] = if nearest[lane] < least[lane] { nearest[lane] } else { least[lane] };
        }
        *distance = nearest;
        let mut from = *previous;
        for lane in 0..SIMD_LANES {
            from[lane] = (from[lane] & !nearer[lane]) | (row & nearer[lane]);
        }
        *previous = from;
    }
    let rest = line_rest.iter().zip(price_rest).zip(distance_rest).zip(previous_rest);
    for (k, (((&cost, &price), distance), previous)) in rest.enumerate() {
        let through = f64::from(cost) - price - offset;
        if through < *distance {
            (*distance, *previous) = (through, row);
        }
        least[k] = if *distance < least[k] { *distance } else { least[k] };
    }
    least.into_iter().fold(f64::INFINITY, |a, b| if b < a { b } else { a })
}

enum Nearest {
    /// A free column: the end of a path.
    Free(u16),
    /// Number of taken columns that were queued.
    Taken(usize),
}

/// The columns at distance `least`: a free one if there is any, else all of them into `queue`.
fn nearest(distance: &[f64], row_of: &[u16], least: f64, queue: &mut [u16]) -> Nearest {
    let mut count = 0;
    let mut offer = |first: usize, distances: &[f64]| {
        for (k, _) in distances.iter().enumerate().filter(|(_, d)| **d == least) {
            let col = (first + k) as u16;
            if row_of[first + k] == UNASSIGNED {
                return Some(col);
            }
            queue[count] = col;
            count += 1;
        }
        None
    };
    let (chunks, rest) = distance.as_chunks::<SIMD_LANES>();
    for (chunk, distances) in chunks.iter().enumerate() {
        if distances.iter().fold(false, |any, &d| any | (d == least))
            && let Some(free) = offer(chunk * SIMD_LANES, distances)
        {
            return Nearest::Free(free);
        }
    }
    match offer(distance.len() - rest.len(), rest) {
        Some(free) => Nearest::Free(free),
        None => Nearest::Taken(count),
    }
}

/// Gives each column on the path to the row it was reached from.
fn flip(state: &mut State<'_>, previous: &[u16], end: u16) {
    let mut col = end;
    while col != UNASSIGNED {
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
    // `settled_price` keeps it from being reached again.
    let done = &mut *paths.settled_price;
    done.fill(0.0);
    paths.distance.fill(f64::INFINITY);
    for row in (0..costs.rows as u16).filter(|&row| state.col_of[usize::from(row)] == UNASSIGNED) {
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
        match nearest(paths.distance, state.row_of, least, paths.settled) {
            Nearest::Free(col) => {
                flip(state, paths.previous, col);
                return Some(least as f32);
            }
            Nearest::Taken(count) => {
                for &col in &paths.settled[..count] {
                    done[usize::from(col)] = 1.0;
                    paths.distance[usize::from(col)] = f64::INFINITY;
                }
                for &col in &paths.settled[..count] {
                    let row = state.row_of[usize::from(col)];
                    let line = costs.row(row, state.row);
                    relax_largest(line, least, row, done, paths.distance, paths.previous);
                }
            }
        }
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
        // Not `max`: which zero it returns, if one is negative, depends on the processor.
        let cost = f64::from(cost);
        let through = if cost > so_far { cost } else { so_far };
        if done == 0.0 && through < *distance {
            (*distance, *previous) = (through, row);
        }
    }
}
