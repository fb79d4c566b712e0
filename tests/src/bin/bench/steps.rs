//! Instructions of one step of `priority` deconfliction, in the worst of ten thousand random cases.
//!
//! The bench runs itself under valgrind's callgrind, which counts the instructions of
//! [`priority_step`] alone and writes the count down each time it returns. So every case is counted
//! by itself. In these rows "ours" is the worst case, "theirs" what a step may cost. It is this
//! machine's instruction set; a board's differs by a small factor.
//!
//! The cases are those that a board is measured with ([`StepCase`]); half of them are chosen to be
//! hard.

use std::hint::black_box;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use board_bench::cases::{STEP_CASES, StepCase, StepKind};
use planner_core::track::deconflict::{Advice, Method};
use rand_core::SeedableRng;
use rand_pcg::Pcg32;

use crate::row::Row;

const SEED: u64 = 1;
/// The function whose instructions are counted, by its name in callgrind.
const COUNTED_FUNCTION: &str = "bench::steps::priority_step";

/// Rows for ten and for thirty-two neighbours, in thousands of instructions.
pub fn rows() -> Result<Vec<Row>> {
    [(10, 20.0), (32, 60.0)].map(|(neighbours, limit)| row(neighbours, limit)).into_iter().collect()
}

fn row(neighbours: usize, limit: f64) -> Result<Row> {
    let mut counts = count_instructions(neighbours)?;
    ensure!(counts.len() == STEP_CASES, "{} of {STEP_CASES} cases were counted", counts.len());
    counts.sort_unstable();
    let thousands = |count: u64| count as f64 * 1e-3;
    let worst = thousands(counts[STEP_CASES - 1]);
    println!(
        "{neighbours} neighbours: median {:.1}, worst {worst:.1} thousand instructions of {STEP_CASES} cases",
        thousands(counts[STEP_CASES / 2])
    );
    Ok(Row {
        name: "priority step".into(),
        ours: worst,
        theirs: limit,
        ratio: limit / worst,
        required: 1.0,
        unit: "ki",
        n: neighbours,
    })
}

/// Number of instructions of each case.
fn count_instructions(neighbours: usize) -> Result<Vec<u64>> {
    let dir = tempfile::tempdir()?;
    let file = dir.path().join("counts");
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet", "--combine-dumps=yes"])
        .args([
            format!("--toggle-collect={COUNTED_FUNCTION}"),
            format!("--dump-after={COUNTED_FUNCTION}"),
        ])
        .arg(format!("--callgrind-out-file={}", file.display()))
        .arg(std::env::current_exe()?)
        .args(["--steps-beside", &neighbours.to_string()])
        .stdout(Stdio::null())
        .status()
        .context("valgrind does not start")?;
    ensure!(status.success(), "valgrind: {status}");
    let counts = std::fs::read_to_string(&file)?;
    // Each return of the function writes one block; the last block, at the process's end, is 0.
    let totals = counts.lines().filter_map(|line| line.strip_prefix("summary: "));
    Ok(totals.filter_map(|count| count.trim().parse().ok()).filter(|&count| count > 0).collect())
}

/// The function whose instructions are counted: one step of deconfliction.
#[inline(never)]
fn priority_step(case: &StepCase) -> Advice {
    // As the last thing done, the call would be a jump, and callgrind would not see the return.
    black_box(case.advise(Method::Priority))
}

/// Runs every case once: what the bench runs under callgrind.
pub fn run_cases(neighbours: usize) {
    let mut rng = Pcg32::seed_from_u64(SEED);
    for number in 0..STEP_CASES {
        let case = StepCase::new(&mut rng, neighbours, StepKind::of_case(number));
        black_box(priority_step(black_box(&case)));
    }
}
