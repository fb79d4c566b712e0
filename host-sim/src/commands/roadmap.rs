//! The commands `host-sim roadmap build` and `host-sim roadmap info`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, anyhow, ensure};
use clap::Subcommand;
use planner_core::roadmap::{LANDMARK_COUNT, RoadmapError, RoadmapView};

use super::load_supported;
use crate::capacity::BoardCapacity;
use crate::files::{self, ResultFiles};
use crate::mission::PreparedMission;
use crate::progress::Progress;
use crate::quote::printable_path;
use crate::say;

/// Arguments of `host-sim roadmap`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: RoadmapAction,
}

#[derive(Debug, Subcommand)]
enum RoadmapAction {
    /// Build the roadmap of a scenario as the file that is uploaded to a board
    Build {
        /// The scenario
        scenario: PathBuf,
        /// The file to write
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// Board that the file has to fit: nucleo-h743, qemu or pico2
        #[arg(long, value_name = "BOARD", value_parser = BoardCapacity::by_name)]
        board: Option<&'static BoardCapacity>,
    },
    /// Check a roadmap file and print its figures
    Info {
        /// A roadmap file
        file: PathBuf,
    },
}

/// Runs the command and prints the roadmap's figures.
///
/// # Errors
/// The scenario or file is bad; the error names it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.action {
        RoadmapAction::Build { scenario, out, board } => {
            let scenario = load_supported(scenario, None)?;
            ensure!(
                scenario.area.is_none(),
                "no roadmap: {}: a coverage mission flies without one\n\
                 hint: `plan` writes what its boards need",
                scenario.path
            );
            let mut results = ResultFiles::single_file(out)?;
            let mission = PreparedMission::prepare_for(scenario, *board, &Progress::on_terminal())?;
            results.add_file(out, &mission.roadmap_or_field_file)?;
            results.commit()?;
            print(&mission.roadmap_view());
        }
        RoadmapAction::Info { file } => {
            let bytes = files::read(file, files::MAX_BINARY_BYTES)
                .with_context(|| format!("cannot read: {}", printable_path(file)))?;
            let view = parse(&bytes)
                .with_context(|| format!("not a roadmap: {}", printable_path(file)))?;
            print(&view);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints numbers of the roadmap.
fn print(view: &RoadmapView<'_>) {
    let header = view.header();
    let edges = || (0..view.node_count() as u16).flat_map(|n| view.half_edges(n));
    let narrowest = edges().map(|e| e.clearance_m).fold(f32::INFINITY, f32::min);
    say!(
        "nodes          {} ({} starts, {} goals)",
        view.node_count(),
        header.start_count,
        header.goal_count
    );
    say!("edges          {}", view.half_edge_count() / 2);
    say!("edge length    {} to {} m", header.edge_min_m, header.edge_max_m);
    say!(
        "clearance      tested above {} m, narrowest edge {narrowest} m",
        header.tested_clearance_m
    );
    say!(
        "origin         {:.7}, {:.7}, {:.1} m",
        header.origin.lat_deg,
        header.origin.lon_deg,
        header.origin.alt_m
    );
    say!("landmarks      {}", if view.has_landmarks() { LANDMARK_COUNT } else { 0 });
    let grounded =
        (0..view.node_count() as u16).filter(|node| view.ground_z_m(*node).is_some()).count();
    say!("ground         known below {grounded} nodes");
    say!("size           {} bytes, CRC-32 {:08x}", view.byte_len(), view.crc());
}

/// Parses a roadmap file; bytes after the roadmap's end are an error.
pub(super) fn parse(bytes: &[u8]) -> anyhow::Result<RoadmapView<'_>> {
    let view = RoadmapView::parse(bytes).map_err(|error| anyhow!(describe_error(&error)))?;
    ensure!(
        view.byte_len() == bytes.len(),
        "{} bytes follow its end",
        bytes.len() - view.byte_len()
    );
    Ok(view)
}

/// Text of a roadmap file's error, for messages.
fn describe_error(error: &RoadmapError) -> String {
    match error {
        RoadmapError::File(error) => error.to_string(),
        other => format!("its contents are not sound: {other:?}"),
    }
}
