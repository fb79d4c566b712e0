//! The matching under construction, and the memory of one search for an augmenting path.

/// Index that stands for "no row" or "no column".
pub(super) const UNASSIGNED: u16 = u16::MAX;
/// Columns that a loop handles together: enough for the widest vector registers, few enough to stay
/// in registers.
pub(super) const SIMD_LANES: usize = 8;

/// Dual prices and the matching so far. Rows and columns are those of [`super::costs::CostMatrix`],
/// never more rows than columns.
pub(super) struct MatchingState<'w> {
    /// Dual price of each column.
    pub(super) price: &'w mut [f64],
    /// Row that each column is matched to, or [`UNASSIGNED`].
    pub(super) row_of_col: &'w mut [u16],
    /// Column that each row is matched to, or [`UNASSIGNED`].
    pub(super) col_of_row: &'w mut [u16],
    /// Buffer for a copy of one row of costs.
    pub(super) row_buffer: &'w mut [f32],
    /// Rows without a column, in the order in which they are to be matched. Only the first entries
    /// are in use; the phases pass on their number.
    pub(super) free_rows: &'w mut [u16],
}

impl MatchingState<'_> {
    /// Clears prices and matching.
    pub(super) fn reset(&mut self) {
        self.price.fill(0.0);
        self.row_of_col.fill(UNASSIGNED);
        self.col_of_row.fill(UNASSIGNED);
    }

    /// Matches a row and a column; does not release earlier partners.
    pub(super) fn match_pair(&mut self, row: u16, col: u16) {
        self.row_of_col[usize::from(col)] = row;
        self.col_of_row[usize::from(row)] = col;
    }
}

/// Memory of one search for an augmenting path, one entry per column.
pub(super) struct AugmentingPaths<'w> {
    /// Length of the shortest path found to each column, in reduced costs; in the bottleneck search
    /// the least possible largest cost of such a path.
    pub(super) distance: &'w mut [f64],
    /// Row from which the search reached each column; in column reduction the cheapest row of each
    /// column.
    pub(super) predecessor_row: &'w mut [u16],
    /// Settled columns in the order in which they were settled.
    pub(super) settled_cols: &'w mut [u16],
    /// Price of each column of `settled_cols`, saved before the search changes it.
    pub(super) settled_price: &'w mut [f64],
    /// Distance of each column of `settled_cols`, saved as well.
    pub(super) settled_distance: &'w mut [f64],
}
