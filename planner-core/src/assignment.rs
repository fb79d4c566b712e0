//! Assignment of vehicles to tasks on dense cost matrices: the linear sum assignment and the
//! bottleneck assignment.
//!
//! Source: R. Jonker, A. Volgenant, "A shortest augmenting path algorithm for dense and sparse
//! linear assignment problems", Computing 38 (1987): column reduction with reduction transfer,
//! augmenting row reduction, then one shortest augmenting path for each row still free. Paper P3D
//! §3.3 calls this assignment the unlabelled allocation. O(n³) at worst.
//!
//! Beyond the paper: matrices that are not square, and pairs that are impossible (`f32::INFINITY`).
//! The result has the largest possible number of pairs and, among those, the least total cost. No
//! large number stands in for infinity. A matrix with more rows than columns is transposed.
//! Jonker–Volgenant suffices if every row can then be matched. If a row cannot, the matching starts
//! again, with shortest augmenting paths from all free rows at once. After each path the matching
//! is the cheapest of its size, so when no path is left it is the largest, and the cheapest of that
//! size.
//!
//! Costs are f32 in any unit (metres, seconds), sums and dual prices f64.

mod augment;
mod costs;
mod reduce;
mod state;

use libm::fmaxf;

pub use self::costs::AssignmentError;
use self::costs::CostMatrix;
use self::state::{AugmentingPaths, MatchingState, UNASSIGNED};

/// Result of an assignment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Assignment {
    /// Number of pairs: the largest possible.
    pub pair_count: usize,
    /// Sum of the pairs' costs.
    pub total_cost: f64,
    /// The largest cost of a pair; minus infinity if there are no pairs.
    pub largest_cost: f32,
}

/// Memory for matrices of up to `N` rows and `N` columns: 46 · `N` bytes. All-zero when new. Rows
/// and columns are those after a transposition.
pub struct AssignmentWorkspace<const N: usize> {
    /// Dual price of each column. The price of a column without a row stays 0 unless the matrix is
    /// square.
    price: [f64; N],
    /// Memory of a search: length of the shortest path found to each column, in reduced costs.
    distance: [f64; N],
    /// Memory of a search: price of each settled column.
    settled_price: [f64; N],
    /// Memory of a search: distance of each settled column.
    settled_distance: [f64; N],
    /// Buffer for a copy of one row of costs.
    row_buffer: [f32; N],
    /// Memory of a search: row from which it reached each column.
    predecessor_row: [u16; N],
    /// Memory of a search: settled columns in the order in which they were settled.
    settled_cols: [u16; N],
    /// Row that each column is matched to.
    row_of_col: [u16; N],
    /// Column that each row is matched to.
    col_of_row: [u16; N],
    /// Rows that are not matched yet.
    free_rows: [u16; N],
}

impl<const N: usize> AssignmentWorkspace<N> {
    /// Creates an empty workspace: all zeros.
    pub const fn new() -> Self {
        assert!(N < UNASSIGNED as usize, "indices are 16 bits");
        Self {
            price: [0.0; N],
            distance: [0.0; N],
            settled_price: [0.0; N],
            settled_distance: [0.0; N],
            row_buffer: [0.0; N],
            predecessor_row: [0; N],
            settled_cols: [0; N],
            row_of_col: [0; N],
            col_of_row: [0; N],
            free_rows: [0; N],
        }
    }

    /// Lends the workspace, cut to `rows` and `cols`, as the matching and as the memory of a
    /// search. `rows` is at most `cols`.
    fn split_borrows(
        &mut self,
        rows: usize,
        cols: usize,
    ) -> (MatchingState<'_>, AugmentingPaths<'_>) {
        let state = MatchingState {
            price: &mut self.price[..cols],
            row_of_col: &mut self.row_of_col[..cols],
            col_of_row: &mut self.col_of_row[..rows],
            row_buffer: &mut self.row_buffer[..cols],
            free_rows: &mut self.free_rows[..rows],
        };
        let paths = AugmentingPaths {
            distance: &mut self.distance[..cols],
            predecessor_row: &mut self.predecessor_row[..cols],
            settled_cols: &mut self.settled_cols[..cols],
            settled_price: &mut self.settled_price[..cols],
            settled_distance: &mut self.settled_distance[..cols],
        };
        (state, paths)
    }
}

impl<const N: usize> Default for AssignmentWorkspace<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// The assignment with the most pairs and, among those, the least total cost (mission objective
/// "total").
///
/// `costs` is row-major, `rows` × `cols`; infinity marks an impossible pair. Writes the column of
/// each row to `out[row]`, or `None` for a row without a pair.
pub fn assign<const N: usize>(
    costs: &[f32],
    rows: usize,
    cols: usize,
    ws: &mut AssignmentWorkspace<N>,
    out: &mut [Option<u16>],
) -> Result<Assignment, AssignmentError> {
    let costs = check_inputs(costs, rows, cols, N, out)?;
    solve(&costs, ws);
    Ok(write_assignment(&costs, &ws.col_of_row, out))
}

/// The assignment with the most pairs, among those the least largest cost, and among those the
/// least total cost (mission objective "makespan"). Arguments as for [`assign`].
///
/// The least largest cost is found by augmenting paths that minimise their largest edge, from all
/// free rows at once. The bound is the largest cost of an edge used so far. If no augmenting path
/// keeps within the bound, every larger matching needs a costlier edge, from a row that the search
/// reached to a column that it did not reach. The search takes the cheapest of these, so it raises
/// the bound no further than necessary (O. Gross, "The bottleneck assignment problem", 1959).
pub fn assign_bottleneck<const N: usize>(
    costs: &[f32],
    rows: usize,
    cols: usize,
    ws: &mut AssignmentWorkspace<N>,
    out: &mut [Option<u16>],
) -> Result<Assignment, AssignmentError> {
    let mut costs = check_inputs(costs, rows, cols, N, out)?;
    let (mut state, mut paths) = ws.split_borrows(costs.rows, costs.cols);
    state.reset();
    let mut limit = f32::NEG_INFINITY;
    while let Some(largest) = augment::augment_bottleneck(&costs, &mut state, &mut paths) {
        limit = fmaxf(limit, largest);
    }
    costs.max_cost = limit;
    solve(&costs, ws);
    Ok(write_assignment(&costs, &ws.col_of_row, out))
}

/// Checks sizes and costs, and transposes the matrix if it has more rows than columns.
fn check_inputs<'a>(
    costs: &'a [f32],
    rows: usize,
    cols: usize,
    capacity: usize,
    out: &[Option<u16>],
) -> Result<CostMatrix<'a>, AssignmentError> {
    if rows.max(cols) > capacity {
        return Err(AssignmentError::WorkspaceTooSmall);
    }
    if out.len() != rows {
        return Err(AssignmentError::OutputLength);
    }
    CostMatrix::new(costs, rows, cols)
}

/// Computes the assignment of least total cost; leaves the matching in `ws.col_of_row`.
fn solve<const N: usize>(costs: &CostMatrix<'_>, ws: &mut AssignmentWorkspace<N>) {
    let (mut state, mut paths) = ws.split_borrows(costs.rows, costs.cols);
    state.reset();
    let complete = reduce::reduce_to_free_rows(costs, &mut state, &mut paths).is_some_and(|left| {
        (0..left).all(|k| augment::augment_from_row(costs, &mut state, &mut paths, k))
    });
    if !complete {
        state.reset();
        while augment::augment_from_free_rows(costs, &mut state, &mut paths) {}
    }
}

/// Writes the matching to `out` in the caller's rows and columns, and returns its figures.
fn write_assignment(
    costs: &CostMatrix<'_>,
    col_of_row: &[u16],
    out: &mut [Option<u16>],
) -> Assignment {
    out.fill(None);
    let mut result = Assignment { pair_count: 0, total_cost: 0.0, largest_cost: f32::NEG_INFINITY };
    for (row, &col) in
        col_of_row[..costs.rows].iter().enumerate().filter(|(_, col)| **col != UNASSIGNED)
    {
        let cost = costs.cost_at(row as u16, col);
        let (from, to) = if costs.transposed { (usize::from(col), row as u16) } else { (row, col) };
        out[from] = Some(to);
        result.pair_count += 1;
        result.total_cost += f64::from(cost);
        result.largest_cost = fmaxf(result.largest_cost, cost);
    }
    result
}

#[cfg(test)]
mod tests;
