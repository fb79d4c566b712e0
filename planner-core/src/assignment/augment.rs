//! Shortest augmenting paths: Dijkstra over the columns of a dense matrix, vectorised over all
//! columns.
//!
//! In the shortest-path search a settled column is excluded by setting its price to minus infinity
//! and its distance to infinity. Its reduced costs are then infinite, so the inner loop needs no
//! test for it. Price and distance are saved, and restored at the end of the search.

use super::costs::CostMatrix;
use super::state::{AugmentingPaths, MatchingState, SIMD_LANES, UNASSIGNED};

/// Augments the matching by the shortest path from the row `state.free_rows[k]`. Returns false if
/// no path leads to a free column.
pub(super) fn augment_from_row(
    costs: &CostMatrix<'_>,
    state: &mut MatchingState<'_>,
    paths: &mut AugmentingPaths<'_>,
    k: usize,
) -> bool {
    let row = state.free_rows[k];
    paths.distance.fill(f64::INFINITY);
    let least = relax_columns(costs.row_costs(row, state.row_buffer), state.price, 0.0, row, paths);
    augment_shortest_path(costs, state, paths, least)
}

/// Augments the matching by the cheapest path from any free row. Returns false if there is no path.
pub(super) fn augment_from_free_rows(
    costs: &CostMatrix<'_>,
    state: &mut MatchingState<'_>,
    paths: &mut AugmentingPaths<'_>,
) -> bool {
    paths.distance.fill(f64::INFINITY);
    let mut least = f64::INFINITY;
    for row in
        (0..costs.rows as u16).filter(|&row| state.col_of_row[usize::from(row)] == UNASSIGNED)
    {
        least = relax_columns(costs.row_costs(row, state.row_buffer), state.price, 0.0, row, paths);
    }
    augment_shortest_path(costs, state, paths, least)
}

/// Settles columns in the order of their distances until a free column is nearest; then updates the
/// prices and flips the path to it. `least` is the least distance of a column when the search
/// begins. Returns false if no free column can be reached.
fn augment_shortest_path(
    costs: &CostMatrix<'_>,
    state: &mut MatchingState<'_>,
    paths: &mut AugmentingPaths<'_>,
    mut least: f64,
) -> bool {
    // Columns at the same distance are settled together and wait in `settled_cols[done..queued]`:
    // with integer costs many columns are at the same distance.
    let (mut done, mut queued) = (0, 0);
    let mut next = least;
    let end = loop {
        if done == queued || next <= least {
            least = next;
            if least == f64::INFINITY {
                break None;
            }
            let from = queued;
            match nearest_columns(
                paths.distance,
                state.row_of_col,
                least,
                &mut paths.settled_cols[from..],
            ) {
                NearestColumns::Free(col) => break Some(col),
                NearestColumns::Taken(count) => queued += count,
            }
            for k in from..queued {
                let at = usize::from(paths.settled_cols[k]);
                (paths.settled_price[k], paths.settled_distance[k]) = (state.price[at], least);
                (state.price[at], paths.distance[at]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        let col = paths.settled_cols[done];
        let row = state.row_of_col[usize::from(col)];
        let offset = f64::from(costs.cost_at(row, col))
            - paths.settled_price[done]
            - paths.settled_distance[done];
        next =
            relax_columns(costs.row_costs(row, state.row_buffer), state.price, offset, row, paths);
        done += 1;
    };
    for k in 0..queued {
        let rise = if end.is_some() { paths.settled_distance[k] - least } else { 0.0 };
        state.price[usize::from(paths.settled_cols[k])] = paths.settled_price[k] + rise;
    }
    end.map(|col| flip_augmenting_path(state, paths.predecessor_row, col)).is_some()
}

/// Sets `distance = min(distance, cost - price - offset)` for all columns, with `row` as
/// predecessor where that is less; returns the least distance.
fn relax_columns(
    line: &[f32],
    price: &[f64],
    offset: f64,
    row: u16,
    paths: &mut AugmentingPaths<'_>,
) -> f64 {
    let (lines, line_rest) = line.as_chunks::<SIMD_LANES>();
    let (prices, price_rest) = price.as_chunks::<SIMD_LANES>();
    let (distances, distance_rest) = paths.distance.as_chunks_mut::<SIMD_LANES>();
    let (previous, previous_rest) = paths.predecessor_row.as_chunks_mut::<SIMD_LANES>();
    let mut least = [f64::INFINITY; SIMD_LANES];
    for (((line, price), distance), previous) in
        lines.iter().zip(prices).zip(distances).zip(previous)
    {
        // Whole chunks are loaded and stored, with selects in between: so the compiler vectorises
        // the lanes, and no branch is mispredicted.
        let (mut nearest, mut through) = (*distance, [0.0; SIMD_LANES]);
        for lane in 0..SIMD_LANES {
            through[lane] = f64::from(line[lane]) - price[lane] - offset;
        }
        let mut nearer = [0_u16; SIMD_LANES];
        for lane in 0..SIMD_LANES {
            nearer[lane] = if through[lane] < nearest[lane] { u16::MAX } else { 0 };
            nearest[lane] =
                if through[lane] < nearest[lane] { through[lane] } else { nearest[lane] };
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

/// Result of [`nearest_columns`].
enum NearestColumns {
    /// A free column at the least distance: the end of an augmenting path.
    Free(u16),
    /// No free column: the number of matched columns that were queued.
    Taken(usize),
}

/// The columns at distance `least`: one that is free if there is any, else all of them are written
/// to `queue`.
fn nearest_columns(
    distance: &[f64],
    row_of_col: &[u16],
    least: f64,
    queue: &mut [u16],
) -> NearestColumns {
    let mut count = 0;
    let mut offer = |first: usize, distances: &[f64]| {
        for (k, _) in distances.iter().enumerate().filter(|(_, d)| **d == least) {
            let col = (first + k) as u16;
            if row_of_col[first + k] == UNASSIGNED {
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
            return NearestColumns::Free(free);
        }
    }
    match offer(distance.len() - rest.len(), rest) {
        Some(free) => NearestColumns::Free(free),
        None => NearestColumns::Taken(count),
    }
}

/// Matches each column on the path that ends at column `end` to the row from which the search
/// reached it.
fn flip_augmenting_path(state: &mut MatchingState<'_>, previous: &[u16], end: u16) {
    let mut col = end;
    while col != UNASSIGNED {
        let row = previous[usize::from(col)];
        let released = state.col_of_row[usize::from(row)];
        state.match_pair(row, col);
        col = released;
    }
}

/// Adds one pair to the matching, by that augmenting path from any free row whose largest cost is
/// least; returns this cost. `None` if there is no such path.
pub(super) fn augment_bottleneck(
    costs: &CostMatrix<'_>,
    state: &mut MatchingState<'_>,
    paths: &mut AugmentingPaths<'_>,
) -> Option<f32> {
    // The path to a settled column is final: its distance is set to infinity so that it is not
    // chosen again, and its entry in `settled_price` to 1 so that it is not reached again.
    let done = &mut *paths.settled_price;
    done.fill(0.0);
    paths.distance.fill(f64::INFINITY);
    for row in
        (0..costs.rows as u16).filter(|&row| state.col_of_row[usize::from(row)] == UNASSIGNED)
    {
        relax_by_largest_cost(
            costs.row_costs(row, state.row_buffer),
            f64::NEG_INFINITY,
            row,
            done,
            paths.distance,
            paths.predecessor_row,
        );
    }
    loop {
        let least = paths.distance.iter().copied().fold(f64::INFINITY, f64::min);
        if least == f64::INFINITY {
            return None;
        }
        match nearest_columns(paths.distance, state.row_of_col, least, paths.settled_cols) {
            NearestColumns::Free(col) => {
                flip_augmenting_path(state, paths.predecessor_row, col);
                return Some(least as f32);
            }
            NearestColumns::Taken(count) => {
                for &col in &paths.settled_cols[..count] {
                    done[usize::from(col)] = 1.0;
                    paths.distance[usize::from(col)] = f64::INFINITY;
                }
                for &col in &paths.settled_cols[..count] {
                    let row = state.row_of_col[usize::from(col)];
                    let line = costs.row_costs(row, state.row_buffer);
                    relax_by_largest_cost(
                        line,
                        least,
                        row,
                        done,
                        paths.distance,
                        paths.predecessor_row,
                    );
                }
            }
        }
    }
}

/// As [`relax_columns`] for the bottleneck: sets `distance = min(distance, max(cost, so_far))` for
/// all columns that are not `done`, with `row` as predecessor where that is less. `so_far` is the
/// largest cost on the path to `row`.
fn relax_by_largest_cost(
    line: &[f32],
    so_far: f64,
    row: u16,
    done: &[f64],
    distance: &mut [f64],
    previous: &mut [u16],
) {
    let columns = line.iter().zip(done).zip(distance).zip(previous);
    for (((&cost, &done), distance), previous) in columns {
        // Not `max`: whether `max` of 0 and −0 returns 0 or −0 depends on the processor.
        let cost = f64::from(cost);
        let through = if cost > so_far { cost } else { so_far };
        if done == 0.0 && through < *distance {
            (*distance, *previous) = (through, row);
        }
    }
}
