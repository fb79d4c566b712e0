//! Who flies to which task: the linear sum assignment and the bottleneck assignment, on dense cost matrices.
//!
//! Source: R. Jonker, A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear assignment
//! problems", Computing 38 (1987): column reduction with reduction transfer, augmenting row reduction, then one shortest
//! augmenting path for each row still free. P3D §3.3 names it the unlabelled allocation. O(n³) at worst.
//!
//! Beyond the paper: fewer rows than columns or the other way round, and pairs that cannot be (`f32::INFINITY`). The
//! answer has the most pairs there can be and, among those, the least total. No large number stands in for infinity.
//! Where every row of the shorter side can be served, Jonker–Volgenant answers; where one cannot, it is begun anew with
//! shortest augmenting paths from *all* free rows at once. Each of those keeps the matching the cheapest of its size,
//! so when no path is left it is the largest and the cheapest of that size.
//!
//! Costs are f32 in any unit (metres, seconds), sums and dual prices f64.

mod augment;
mod reduce;

use augment::Paths;
use libm::fmaxf;

/// "Not assigned", as an index.
const NONE: u16 = u16::MAX;

/// Why an assignment was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AssignmentError {
    /// There are no rows or no columns.
    Empty,
    /// The costs are not `rows · cols` long.
    Shape,
    /// The output is not `rows` long.
    OutputLength,
    /// Rows or columns exceed the workspace.
    WorkspaceTooSmall,
    /// This cost is NaN.
    NotANumber {
        /// Row of the cost.
        row: u16,
        /// Column of the cost.
        col: u16,
    },
    /// This cost is minus infinity.
    MinusInfinity {
        /// Row of the cost.
        row: u16,
        /// Column of the cost.
        col: u16,
    },
}

/// What an assignment amounts to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Assignment {
    /// Number of pairs: the most there can be.
    pub pairs: usize,
    /// Sum of their costs.
    pub total: f64,
    /// The largest of their costs; minus infinity without a pair.
    pub largest: f32,
}

/// Scratch memory for up to `N` rows and `N` columns: 46 bytes for each. All-zero when new.
pub struct AssignmentWorkspace<const N: usize> {
    /// Price of each column. Free columns keep 0 unless the matrix is square.
    price: [f64; N],
    distance: [f64; N],
    settled_price: [f64; N],
    settled_distance: [f64; N],
    row: [f32; N],
    previous: [u16; N],
    settled: [u16; N],
    row_of: [u16; N],
    col_of: [u16; N],
    free: [u16; N],
}

impl<const N: usize> AssignmentWorkspace<N> {
    /// All zeros.
    pub const fn new() -> Self {
        assert!(N < NONE as usize, "indices are 16 bits");
        Self {
            price: [0.0; N],
            distance: [0.0; N],
            settled_price: [0.0; N],
            settled_distance: [0.0; N],
            row: [0.0; N],
            previous: [0; N],
            settled: [0; N],
            row_of: [0; N],
            col_of: [0; N],
            free: [0; N],
        }
    }

    fn borrow(&mut self, rows: usize, cols: usize) -> (State<'_>, Paths<'_>) {
        let state = State {
            price: &mut self.price[..cols],
            row_of: &mut self.row_of[..cols],
            col_of: &mut self.col_of[..rows],
            row: &mut self.row[..cols],
            free: &mut self.free[..rows],
        };
        let paths = Paths {
            distance: &mut self.distance[..cols],
            previous: &mut self.previous[..cols],
            settled: &mut self.settled[..cols],
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

/// Dual prices and the matching so far, sides swapped so that there are never more rows than columns.
struct State<'w> {
    price: &'w mut [f64],
    row_of: &'w mut [u16],
    col_of: &'w mut [u16],
    /// Room for one row of a transposed matrix.
    row: &'w mut [f32],
    /// Rows without a column, in the order they are to be served.
    free: &'w mut [u16],
}

impl State<'_> {
    fn reset(&mut self) {
        self.price.fill(0.0);
        self.row_of.fill(NONE);
        self.col_of.fill(NONE);
    }

    fn join(&mut self, row: u16, col: u16) {
        self.row_of[usize::from(col)] = row;
        self.col_of[usize::from(row)] = col;
    }
}

/// A checked cost matrix, seen so that `rows <= cols`. Costs above `limit` count as infinite.
struct Costs<'a> {
    data: &'a [f32],
    rows: usize,
    cols: usize,
    transposed: bool,
    limit: f32,
}

impl<'a> Costs<'a> {
    fn new(data: &'a [f32], rows: usize, cols: usize) -> Result<Self, AssignmentError> {
        if rows == 0 || cols == 0 {
            return Err(AssignmentError::Empty);
        }
        if rows.checked_mul(cols) != Some(data.len()) {
            return Err(AssignmentError::Shape);
        }
        // One pass that vectorises; which cost it was is only asked when there is one.
        let sound =
            data.chunks(64).all(|chunk| chunk.iter().fold(true, |ok, &c| ok & (c > f32::NEG_INFINITY)));
        if !sound && let Some(at) = data.iter().position(|c| c.is_nan() || *c == f32::NEG_INFINITY) {
            let (row, col) = ((at / cols) as u16, (at % cols) as u16);
            return Err(match data[at].is_nan() {
                true => AssignmentError::NotANumber { row, col },
                false => AssignmentError::MinusInfinity { row, col },
            });
        }
        let transposed = rows > cols;
        let (rows, cols) = if transposed { (cols, rows) } else { (rows, cols) };
        Ok(Self { data, rows, cols, transposed, limit: f32::INFINITY })
    }

    #[inline]
    fn at(&self, row: u16, col: u16) -> f32 {
        let (row, col) = (usize::from(row), usize::from(col));
        let cost = self.data[if self.transposed { col * self.rows + row } else { row * self.cols + col }];
        if cost <= self.limit { cost } else { f32::INFINITY }
    }

    /// One row, in place where it lies so in memory, else copied into `buffer`.
    #[inline]
    fn row<'b>(&'b self, row: u16, buffer: &'b mut [f32]) -> &'b [f32] {
        let row = usize::from(row);
        if !self.transposed && self.limit == f32::INFINITY {
            return &self.data[row * self.cols..][..self.cols];
        }
        self.copy_row(row, buffer)
    }

    #[cold]
    fn copy_row<'b>(&self, row: usize, buffer: &'b mut [f32]) -> &'b [f32] {
        let (first, stride) = if self.transposed { (row, self.rows) } else { (row * self.cols, 1) };
        for (copy, &cost) in buffer.iter_mut().zip(self.data[first..].iter().step_by(stride)) {
            *copy = if cost <= self.limit { cost } else { f32::INFINITY };
        }
        buffer
    }
}

/// The assignment with the most pairs and, among those, the least total cost (mission objective "total").
///
/// `costs` is row-major, `rows` × `cols`; infinity marks a pair that cannot be. `out[row]` becomes the row's column.
pub fn assign<const N: usize>(
    costs: &[f32],
    rows: usize,
    cols: usize,
    ws: &mut AssignmentWorkspace<N>,
    out: &mut [Option<u16>],
) -> Result<Assignment, AssignmentError> {
    let costs = check(costs, rows, cols, N, out)?;
    solve(&costs, ws);
    Ok(report(&costs, &ws.col_of, out))
}

/// The assignment with the most pairs, among those the least largest cost, and among those the least total (mission
/// objective "makespan"). Arguments as [`assign`].
///
/// The least largest cost comes from augmenting paths that minimise their largest edge, from all free rows at once: a
/// larger matching needs an edge out of what is reached below the present bound, so the bound is raised no further than
/// it must be (O. Gross, "The bottleneck assignment problem", 1959).
pub fn bottleneck<const N: usize>(
    costs: &[f32],
    rows: usize,
    cols: usize,
    ws: &mut AssignmentWorkspace<N>,
    out: &mut [Option<u16>],
) -> Result<Assignment, AssignmentError> {
    let mut costs = check(costs, rows, cols, N, out)?;
    let (mut state, mut paths) = ws.borrow(costs.rows, costs.cols);
    state.reset();
    let mut limit = f32::NEG_INFINITY;
    while let Some(largest) = augment::from_all_bottleneck(&costs, &mut state, &mut paths) {
        limit = fmaxf(limit, largest);
    }
    costs.limit = limit;
    solve(&costs, ws);
    Ok(report(&costs, &ws.col_of, out))
}

fn check<'a>(
    costs: &'a [f32],
    rows: usize,
    cols: usize,
    capacity: usize,
    out: &[Option<u16>],
) -> Result<Costs<'a>, AssignmentError> {
    if rows.max(cols) > capacity {
        return Err(AssignmentError::WorkspaceTooSmall);
    }
    if out.len() != rows {
        return Err(AssignmentError::OutputLength);
    }
    Costs::new(costs, rows, cols)
}

fn solve<const N: usize>(costs: &Costs<'_>, ws: &mut AssignmentWorkspace<N>) {
    let (mut state, mut paths) = ws.borrow(costs.rows, costs.cols);
    state.reset();
    let complete = reduce::free_rows(costs, &mut state, &mut paths)
        .is_some_and(|left| (0..left).all(|k| augment::from_one(costs, &mut state, &mut paths, k)));
    if !complete {
        state.reset();
        while augment::from_all(costs, &mut state, &mut paths) {}
    }
}

fn report(costs: &Costs<'_>, col_of: &[u16], out: &mut [Option<u16>]) -> Assignment {
    out.fill(None);
    let mut result = Assignment { pairs: 0, total: 0.0, largest: f32::NEG_INFINITY };
    for (row, &col) in col_of[..costs.rows].iter().enumerate().filter(|(_, col)| **col != NONE) {
        let cost = costs.at(row as u16, col);
        let (from, to) = if costs.transposed { (usize::from(col), row as u16) } else { (row, col) };
        out[from] = Some(to);
        result.pairs += 1;
        result.total += f64::from(cost);
        result.largest = fmaxf(result.largest, cost);
    }
    result
}

#[cfg(test)]
mod tests;
