//! `host-sim paper`: prints the tables of a paper beside the results of this program.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;

use crate::paper::cpp;

/// Arguments of `host-sim paper`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The paper: cpp (Luna 2022, coverage)
    paper: Paper,
    /// Directory for `tables.json`, `result.json`, `timing.json` and `report.html`
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Papers by their short names (docs/papers.md); only cpp can be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Paper {
    /// Madridano 2020
    P3d,
    /// Madridano 2019
    P2d,
    /// Luna 2022
    Cpp,
    /// Muñoz 2021
    Fm2,
}

/// Runs the comparison with a paper.
///
/// # Errors
/// The paper is not available yet, or results cannot be written.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match args.paper {
        Paper::Cpp => cpp::run(&args.out),
        other => bail!(
            "not available yet: paper {}: of the papers, cpp is built",
            format!("{other:?}").to_lowercase()
        ),
    }
}
