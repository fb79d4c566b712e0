//! One line of the bench's table.

use serde::Serialize;

/// One line of the bench's table. `ratio` is theirs / ours, or ours / theirs for a share that is to
/// be large: in both cases more is better.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// Our median time or value.
    pub ours: f64,
    /// Their median time or value, or what is allowed.
    pub theirs: f64,
    /// theirs / ours, or ours / theirs for a share.
    pub ratio: f64,
    /// Least `ratio` that is required; 0 requires nothing.
    pub required: f64,
    /// Unit of `ours` and `theirs`.
    pub unit: &'static str,
    /// Size of the problem.
    pub n: usize,
}
