//! One line of the bench.

use serde::Serialize;

/// One line of the bench: `ratio` is theirs / ours, or ours / theirs of a share that is to be
/// large: more is better.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What was done.
    pub name: String,
    /// Our median.
    pub ours: f64,
    /// Their median.
    pub theirs: f64,
    /// theirs / ours, or the other way round.
    pub ratio: f64,
    /// What `ratio` must be at least.
    pub required: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Size of the problem.
    pub n: usize,
}
