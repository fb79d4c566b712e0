//! Measures every public call of planner-core and companion: the bound on its work, the most
//! instructions counted on the emulated board, and the bytes it is lent; writes them as the table
//! of docs/worst-case.md.
//!
//! The board's program `calls` counts, in QEMU with `-icount shift=0`; the bounds are in
//! [`flockmate_tests::bounds`].

use std::fs;

use anyhow::{Context, Result};
use flockmate_tests::{board, bounds, workspace};

use crate::row::Row;

/// Row name, call, and its limit in thousands of instructions: deconfliction alone, and whole
/// steps.
const LIMITS: [(&str, &str, f64); 6] = [
    ("board advise", "deconflict::advise, priority", 60.0),
    ("board control step, all speak", "Companion::handle_timeout, 32 speak", 75.0),
    ("board control step, most gone", "Companion::handle_timeout, most gone", 75.0),
    ("board control step, all near", "a control step, 32 near", 75.0),
    ("board safety filter", "Companion::query_filter_blocker, 32 near", 12.0),
    ("board control step, else", "Companion::handle_timeout, else", 75.0),
];

/// Writes the table to the page; returns rows for the calls that have a limit.
pub fn rows() -> Result<Vec<Row>> {
    let Some(program) = board::built_program("calls") else { return Ok(Vec::new()) };
    let calls = bounds::count_calls(&program)?;
    let path = workspace().join(bounds::PAGE);
    let page =
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let [before, _, behind] = bounds::split_page(&page)?;
    let table = bounds::table_text(&calls)?;
    fs::write(&path, [before, &table, behind].concat())
        .with_context(|| format!("cannot write {}", path.display()))?;
    print!("{table}");
    LIMITS
        .iter()
        .map(|&(name, call, limit)| {
            let ours =
                calls.get(call).with_context(|| format!("{call} was not counted"))?.instructions
                    as f64
                    * 1e-3;
            let row = Row {
                name: name.into(),
                ours,
                theirs: limit,
                ratio: limit / ours,
                required: 1.0,
                unit: "ki",
                n: 32,
            };
            Ok(row)
        })
        .collect()
}
