//! The matching so far, and the memory of one search.

/// Index that means "not assigned".
pub(super) const UNASSIGNED: u16 = u16::MAX;
/// Columns handled together; enough for the widest vector registers, small enough to stay in
/// registers.
pub(super) const SIMD_LANES: usize = 8;

/// Dual prices and the matching so far. The matrix is transposed where it has more rows than
/// columns.
pub(super) struct MatchingState<'w> {
    pub(super) price: &'w mut [f64],
    pub(super) row_of: &'w mut [u16],
    pub(super) col_of: &'w mut [u16],
    /// Room for one row of a transposed matrix.
    pub(super) row: &'w mut [f32],
    /// Rows without a column, in the order they are to be served.
    pub(super) free: &'w mut [u16],
}

impl MatchingState<'_> {
    pub(super) fn reset(&mut self) {
        self.price.fill(0.0);
        self.row_of.fill(UNASSIGNED);
        self.col_of.fill(UNASSIGNED);
    }

    pub(super) fn match_pair(&mut self, row: u16, col: u16) {
        self.row_of[usize::from(col)] = row;
        self.col_of[usize::from(row)] = col;
    }
}

/// Scratch of one search, a slot for each column.
pub(super) struct AugmentingPaths<'w> {
    pub(super) distance: &'w mut [f64],
    pub(super) previous: &'w mut [u16],
    /// Columns settled, in order, with their price and distance.
    pub(super) settled: &'w mut [u16],
    pub(super) settled_price: &'w mut [f64],
    pub(super) settled_distance: &'w mut [f64],
}
