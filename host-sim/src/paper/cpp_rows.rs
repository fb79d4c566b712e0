//! Rows of paper CPP's tables: the paper's values, ours, and the statistics of both.

use serde::Serialize;

use crate::result::rounded;

/// One line of a table.
#[derive(Debug, Serialize)]
pub(super) struct TableRow {
    /// Number of the table; for Table 5 also its track.
    pub(super) table: String,
    /// `short` or `long` in a row of Tables A1 to A12, `None` in any other.
    #[serde(skip)]
    pub(super) track: Option<&'static str>,
    /// Name of the method, as in a scenario.
    pub(super) method: &'static str,
    /// Distance between lanes, metres; 0 in Table 5.
    pub(super) lane_m: f64,
    /// Height of the pictures, metres; 0 in Table 5.
    pub(super) height_m: f64,
    /// Unit of the values.
    pub(super) unit: &'static str,
    /// Our values: one for each vehicle, in Table 3 for each fleet size, in Table 5 one.
    pub(super) ours: Vec<f64>,
    /// The paper's values, alike.
    pub(super) theirs: Vec<f64>,
    pub(super) ours_summary: Option<ValueSummary>,
    pub(super) theirs_summary: Option<ValueSummary>,
}

/// Largest value, mean (Av), the sample's standard deviation (SD), and CV = 100 · SD / Av.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct ValueSummary {
    pub(super) max: f64,
    pub(super) mean: f64,
    pub(super) sd: f64,
    pub(super) cv_percent: f64,
}

impl ValueSummary {
    pub(super) fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let sd = (squares / (count - 1.0)).sqrt();
        let short = |value: f64| rounded(value as f32);
        let max = values.iter().copied().fold(0.0, f64::max);
        Self { max, mean: short(mean), sd: short(sd), cv_percent: short(100.0 * sd / mean) }
    }
}
