//! Column reduction and augmenting row reduction of Jonker–Volgenant: cheap phases that match most
//! rows.

use super::costs::CostMatrix;
use super::state::{AugmentingPaths, MatchingState, SIMD_LANES, UNASSIGNED};

/// Columns of a large matrix that are reduced together: four cache lines of each row.
const BLOCK_COLUMNS: usize = 64;

/// Column reduction, then two rounds of augmenting row reduction. Column reduction is for square
/// matrices only: it changes the price of every column, and a column that stays free must keep
/// price 0. Returns the number of rows that are left free, which are the first in
/// `state.free_rows`. `None` if a row or, in a square matrix, a column has no finite cost, so that
/// not every row can be matched.
pub(super) fn reduce_to_free_rows(
    costs: &CostMatrix<'_>,
    state: &mut MatchingState<'_>,
    paths: &mut AugmentingPaths<'_>,
) -> Option<usize> {
    let mut left = if costs.rows == costs.cols {
        reduce_columns(costs, state, paths)?
    } else {
        for (row, free) in state.free_rows.iter_mut().enumerate() {
            *free = row as u16;
        }
        costs.rows
    };
    for _ in 0..2 {
        if left > 0 {
            left = reduce_rows(costs, state, left)?;
        }
    }
    Some(left)
}

/// Sets each column's price to its least cost and matches it to the row with that cost, if the row
/// is free. Then, for a row that is the cheapest of exactly one column, lowers that column's price
/// by the row's slack (reduction transfer). Returns the number of rows left free, as
/// [`reduce_to_free_rows`] does.
fn reduce_columns(
    costs: &CostMatrix<'_>,
    state: &mut MatchingState<'_>,
    paths: &mut AugmentingPaths<'_>,
) -> Option<usize> {
    // Many columns per pass, the last pass overlapping the one before: fewer passes over the rows
    // of a large matrix mean fewer cache misses. A small matrix has fewer columns than a block.
    match costs.cols {
        0..SIMD_LANES => cheapest_rows_by::<1>(costs, state.price, paths.predecessor_row),
        SIMD_LANES..BLOCK_COLUMNS => {
            cheapest_rows_by::<SIMD_LANES>(costs, state.price, paths.predecessor_row);
        }
        _ => cheapest_rows_by::<BLOCK_COLUMNS>(costs, state.price, paths.predecessor_row),
    }
    if state.price.contains(&f64::INFINITY) {
        return None;
    }
    // Here `settled_cols` holds, for each row, the number of columns of which that row is the
    // cheapest.
    paths.settled_cols.fill(0);
    for col in (0..costs.cols as u16).rev() {
        let row = paths.predecessor_row[usize::from(col)];
        paths.settled_cols[usize::from(row)] += 1;
        if state.col_of_row[usize::from(row)] == UNASSIGNED {
            state.match_pair(row, col);
        }
    }
    let mut left = 0;
    for row in 0..costs.rows as u16 {
        match paths.settled_cols[usize::from(row)] {
            0 => {
                state.free_rows[left] = row;
                left += 1;
            }
            1 => {
                let own = usize::from(state.col_of_row[usize::from(row)]);
                // With its price at minus infinity the row's own column has an infinite reduced
                // cost, so the least is that of the other columns.
                let price = core::mem::replace(&mut state.price[own], f64::NEG_INFINITY);
                let slack = least_reduced_cost(costs.row_costs(row, state.row_buffer), state.price);
                state.price[own] = if slack < f64::INFINITY { price - slack } else { price };
            }
            _ => {}
        }
    }
    Some(left)
}

/// Calls [`cheapest_rows`] for all columns, `K` at a time.
fn cheapest_rows_by<const K: usize>(
    costs: &CostMatrix<'_>,
    price: &mut [f64],
    least_row: &mut [u16],
) {
    for first in (0..costs.cols).step_by(K) {
        cheapest_rows::<K>(costs, first.min(costs.cols - K), price, least_row);
    }
}

/// Writes the least cost of each of the `K` columns from `first` on, and the first row with that
/// cost. For square matrices only, which are never transposed.
fn cheapest_rows<const K: usize>(
    costs: &CostMatrix<'_>,
    first: usize,
    price: &mut [f64],
    least_row: &mut [u16],
) {
    let (mut least, mut rows) = ([f32::INFINITY; K], [0_u32; K]);
    for (row, line) in (0..).zip(costs.costs.chunks_exact(costs.cols)) {
        let Some(line) = line[first..].first_chunk::<K>() else { return };
        // Written as selects of one width, so that the compiler vectorises the lanes: which row is
        // cheaper cannot be predicted.
        for lane in 0..K {
            let cheaper = (line[lane] < least[lane]) & (line[lane] <= costs.max_cost);
            least[lane] = if cheaper { line[lane] } else { least[lane] };
            rows[lane] = if cheaper { row } else { rows[lane] };
        }
    }
    for lane in 0..K {
        (price[first + lane], least_row[first + lane]) =
            (f64::from(least[lane]), rows[lane] as u16);
    }
}

/// The least of cost minus price over all columns of a row.
fn least_reduced_cost(line: &[f32], price: &[f64]) -> f64 {
    let (lines, line_rest) = line.as_chunks::<SIMD_LANES>();
    let (prices, price_rest) = price.as_chunks::<SIMD_LANES>();
    let mut least = [f64::INFINITY; SIMD_LANES];
    for (line, price) in lines.iter().zip(prices) {
        for lane in 0..SIMD_LANES {
            let reduced = f64::from(line[lane]) - price[lane];
            least[lane] = if reduced < least[lane] { reduced } else { least[lane] };
        }
    }
    let rest = line_rest.iter().zip(price_rest).map(|(&cost, &price)| f64::from(cost) - price);
    rest.chain(least).fold(f64::INFINITY, |a, b| if b < a { b } else { a })
}

/// Matches each of the first `rows_in` free rows to its cheapest column, and lowers that column's
/// price until the row's second cheapest column is as good. The row that had the column is matched
/// next, or left for an augmenting path if the price could not be lowered. A row with one possible
/// column is left free as well. Returns the number of rows left free; `None` if a row has no
/// possible column.
fn reduce_rows(
    costs: &CostMatrix<'_>,
    state: &mut MatchingState<'_>,
    rows_in: usize,
) -> Option<usize> {
    let (mut at, mut left) = (0, 0);
    // Rows take columns from one another as long as prices fall; the budget bounds the work.
    let mut budget = rows_in * costs.cols;
    while at < rows_in {
        let row = state.free_rows[at];
        at += 1;
        let two = TwoCheapestColumns::of_row(costs.row_costs(row, state.row_buffer), state.price);
        if two.least == f64::INFINITY {
            return None;
        }
        if two.second == f64::INFINITY {
            // The row has one possible column: no second price bounds the fall, so the row is left
            // for an augmenting path.
            state.free_rows[left] = row;
            left += 1;
            continue;
        }
        let mut col = two.col;
        let price = state.price[usize::from(col)] - (two.second - two.least);
        // Compared after rounding: a fall too small to change the f64 price would repeat forever.
        let falls = price < state.price[usize::from(col)] && budget > 0;
        if falls {
            state.price[usize::from(col)] = price;
        } else if state.row_of_col[usize::from(col)] != UNASSIGNED && two.second == two.least {
            col = two.second_col;
        }
        let evicted = state.row_of_col[usize::from(col)];
        if evicted != UNASSIGNED {
            state.col_of_row[usize::from(evicted)] = UNASSIGNED;
            if falls {
                at -= 1;
                budget -= 1;
                state.free_rows[at] = evicted;
            } else {
                state.free_rows[left] = evicted;
                left += 1;
            }
        }
        state.match_pair(row, col);
    }
    Some(left)
}

/// The two columns of a row with the least reduced costs (cost minus price).
struct TwoCheapestColumns {
    /// Least reduced cost of the row.
    least: f64,
    /// Second least reduced cost.
    second: f64,
    /// Column with the least reduced cost.
    col: u16,
    /// Column with the second least reduced cost.
    second_col: u16,
}

impl TwoCheapestColumns {
    /// The two columns of least reduced cost in a row, `line`: its costs; `price`: the columns'
    /// prices.
    fn of_row(line: &[f32], price: &[f64]) -> Self {
        let mut two = Self {
            least: f64::INFINITY,
            second: f64::INFINITY,
            col: UNASSIGNED,
            second_col: UNASSIGNED,
        };
        // The first columns give a rough bound on the second cheapest. After them most chunks hold
        // no value below this bound, which eight subtractions and comparisons show without a
        // branch.
        let head = line.len().min(2 * SIMD_LANES);
        two.update_cheapest(0, &line[..head], &price[..head]);
        let (lines, line_rest) = line[head..].as_chunks::<SIMD_LANES>();
        let (prices, price_rest) = price[head..].as_chunks::<SIMD_LANES>();
        for (chunk, (line, price)) in lines.iter().zip(prices).enumerate() {
            let mut below = 0;
            for lane in 0..SIMD_LANES {
                below |= u64::from(f64::from(line[lane]) - price[lane] < two.second);
            }
            if below != 0 {
                two.update_cheapest(head + chunk * SIMD_LANES, line, price);
            }
        }
        two.update_cheapest(line.len() - line_rest.len(), line_rest, price_rest);
        two
    }

    /// Takes the columns from `first` on into account, whose costs and prices are `line` and
    /// `price`.
    #[inline]
    fn update_cheapest(&mut self, first: usize, line: &[f32], price: &[f64]) {
        for (k, (&cost, &price)) in line.iter().zip(price).enumerate() {
            let (value, col) = (f64::from(cost) - price, (first + k) as u16);
            if value < self.second {
                if value < self.least {
                    (self.second, self.second_col) = (self.least, self.col);
                    (self.least, self.col) = (value, col);
                } else {
                    (self.second, self.second_col) = (value, col);
                }
            }
        }
    }
}
