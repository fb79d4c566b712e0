//! The checked cost matrix of an assignment.

/// Reason why an assignment was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AssignmentError {
    /// The matrix has no rows or no columns.
    Empty,
    /// The number of costs is not `rows · cols`.
    Shape,
    /// The length of the output is not `rows`.
    OutputLength,
    /// There are more rows or columns than the workspace holds.
    WorkspaceTooSmall,
    /// The cost at this row and column is NaN.
    NotANumber {
        /// Row of the cost.
        row: u16,
        /// Column of the cost.
        col: u16,
    },
    /// The cost at this row and column is minus infinity.
    MinusInfinity {
        /// Row of the cost.
        row: u16,
        /// Column of the cost.
        col: u16,
    },
}

/// A checked cost matrix, transposed where necessary so that `rows <= cols`. Costs above `max_cost`
/// count as infinite.
pub(super) struct CostMatrix<'a> {
    /// The caller's matrix, row-major, not transposed.
    pub(super) costs: &'a [f32],
    /// Number of rows, after the transposition.
    pub(super) rows: usize,
    /// Number of columns, after the transposition.
    pub(super) cols: usize,
    /// Whether rows and columns are those of `costs` swapped.
    pub(super) transposed: bool,
    /// Limit above which a cost counts as infinite; infinite if there is no limit.
    pub(super) max_cost: f32,
}

impl<'a> CostMatrix<'a> {
    pub(super) fn new(data: &'a [f32], rows: usize, cols: usize) -> Result<Self, AssignmentError> {
        if rows == 0 || cols == 0 {
            return Err(AssignmentError::Empty);
        }
        if rows.checked_mul(cols) != Some(data.len()) {
            return Err(AssignmentError::Shape);
        }
        // One pass that vectorises; only if it finds an invalid cost is that cost searched for.
        let sound = data
            .chunks(64)
            .all(|chunk| chunk.iter().fold(true, |ok, &c| ok & (c > f32::NEG_INFINITY)));
        if !sound && let Some(at) = data.iter().position(|c| c.is_nan() || *c == f32::NEG_INFINITY)
        {
            let (row, col) = ((at / cols) as u16, (at % cols) as u16);
            return Err(match data[at].is_nan() {
                true => AssignmentError::NotANumber { row, col },
                false => AssignmentError::MinusInfinity { row, col },
            });
        }
        let transposed = rows > cols;
        let (rows, cols) = if transposed { (cols, rows) } else { (rows, cols) };
        Ok(Self { costs: data, rows, cols, transposed, max_cost: f32::INFINITY })
    }

    /// The cost of a row and a column, as they are after the transposition.
    #[inline]
    pub(super) fn cost_at(&self, row: u16, col: u16) -> f32 {
        let (row, col) = (usize::from(row), usize::from(col));
        let cost =
            self.costs[if self.transposed { col * self.rows + row } else { row * self.cols + col }];
        if cost <= self.max_cost { cost } else { f32::INFINITY }
    }

    /// The costs of one row: a slice of the matrix where rows are contiguous and no limit is set,
    /// else a copy in `buffer`.
    #[inline]
    pub(super) fn row_costs<'b>(&'b self, row: u16, buffer: &'b mut [f32]) -> &'b [f32] {
        let row = usize::from(row);
        if !self.transposed && self.max_cost == f32::INFINITY {
            return &self.costs[row * self.cols..][..self.cols];
        }
        self.copy_row(row, buffer)
    }

    /// Copies one row of costs to `buffer`, with costs above `max_cost` as infinity.
    #[cold]
    fn copy_row<'b>(&self, row: usize, buffer: &'b mut [f32]) -> &'b [f32] {
        let (first, stride) = if self.transposed { (row, self.rows) } else { (row * self.cols, 1) };
        for (copy, &cost) in buffer.iter_mut().zip(self.costs[first..].iter().step_by(stride)) {
            *copy = if cost <= self.max_cost { cost } else { f32::INFINITY };
        }
        buffer
    }
}
