//! `host-sim roadmap build|info`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, anyhow};
use clap::Subcommand;
use planner_core::roadmap::RoadmapView;

use super::load;
use crate::mission::Mission;
use crate::progress::Progress;

/// Arguments of `host-sim roadmap`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Build the roadmap of a scenario as the file that is uploaded to a board
    Build {
        /// The scenario
        scenario: PathBuf,
        /// The file to write
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Check a roadmap file and say what it holds
    Info {
        /// A roadmap file
        file: PathBuf,
    },
}

/// Runs the command.
///
/// # Errors
/// Bad input, by name and place.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    match &args.action {
        Action::Build { scenario, out } => {
            let mission = Mission::prepare(load(scenario, None)?, &Progress::on_terminal())?;
            std::fs::write(out, &mission.roadmap_file)
                .with_context(|| format!("cannot write {}", out.display()))?;
            print(&mission.view());
        }
        Action::Info { file } => {
            let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
            let view = RoadmapView::parse(&bytes)
                .map_err(|error| anyhow!("not a roadmap: {}: {error:?}", file.display()))?;
            print(&view);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn print(view: &RoadmapView<'_>) {
    let header = view.header();
    let edges = || (0..view.node_count() as u16).flat_map(|n| view.half_edges(n));
    let narrowest = edges().map(|e| e.clearance_m).fold(f32::INFINITY, f32::min);
    println!("nodes          {} ({} starts, {} goals)", view.node_count(), header.starts, header.goals);
    println!("edges          {}", view.half_edge_count() / 2);
    println!("edge length    {} to {} m", header.edge_min_m, header.edge_max_m);
    println!("clearance      tested above {} m, narrowest edge {narrowest} m", header.tested_clearance_m);
    println!(
        "origin         {:.7}, {:.7}, {:.1} m",
        header.origin.lat_deg, header.origin.lon_deg, header.origin.alt_m
    );
    println!("size           {} bytes, CRC-32 {:08x}", view.byte_len(), view.crc());
}
