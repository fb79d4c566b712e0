//! `host-sim map info|convert`.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::{Args, Subcommand};
use serde::Serialize;

use super::occupancy::OccupancyMap;
use super::octree::Octree;
use super::{MapError, Source, bt, building};

/// Planning resolution where none is given, metres.
pub const DEFAULT_RESOLUTION_M: f32 = 0.25;

/// Arguments of `host-sim map`.
#[derive(Debug, Args)]
pub struct MapArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Say what a map holds
    Info {
        /// An OctoMap `.bt` file or `builtin:building`
        file: String,
        /// Cells of this edge, metres; a file's own resolution if absent, 0.25 for a builtin
        #[arg(long, value_name = "METRES")]
        resolution: Option<f32>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Write a map as an OctoMap `.bt` file
    Convert {
        /// An OctoMap `.bt` file or `builtin:building`
        file: String,
        /// The `.bt` file to write
        out: PathBuf,
        /// Cells of this edge, metres; a file's own resolution if absent, 0.25 for a builtin
        #[arg(long, value_name = "METRES")]
        resolution: Option<f32>,
    },
}

/// What `map info` prints.
#[derive(Debug, Serialize)]
pub struct Info {
    /// `"octomap"` or `"builtin"`.
    pub kind: &'static str,
    /// Edge of the smallest cell, metres.
    pub resolution_m: f64,
    /// Smallest cells along east, north, up, over the known space.
    pub dims: [u32; 3],
    /// Corners of the known space, metres.
    pub min_m: [f64; 3],
    /// See `min_m`.
    pub max_m: [f64; 3],
    /// Nodes of the octree.
    pub nodes: usize,
    /// Its occupied leaves.
    pub occupied_leaves: usize,
    /// Its free leaves.
    pub free_leaves: usize,
    /// Volume of the occupied leaves.
    pub occupied_m3: f64,
    /// Volume of the free leaves.
    pub free_m3: f64,
    /// The rest of the known space's box.
    pub unknown_m3: f64,
}

impl Info {
    /// Sums up a tree.
    pub fn of(kind: &'static str, tree: &Octree) -> Self {
        let counts = tree.counts();
        let (lo, hi) = tree.key_bounds().unwrap_or_default();
        let (min_m, max_m) = tree.metric_bounds().unwrap_or_default();
        let dims = [0, 1, 2].map(|a| hi[a] - lo[a]);
        let all_m3 = dims.iter().map(|&d| f64::from(d) * tree.resolution_m()).product::<f64>();
        Self {
            kind,
            resolution_m: tree.resolution_m(),
            dims,
            min_m,
            max_m,
            nodes: counts.nodes,
            occupied_leaves: counts.occupied_leaves,
            free_leaves: counts.free_leaves,
            occupied_m3: counts.occupied_m3,
            free_m3: counts.free_m3,
            unknown_m3: (all_m3 - counts.occupied_m3 - counts.free_m3).max(0.0),
        }
    }

    fn text(&self) -> String {
        let [x, y, z] = self.dims;
        let ([x0, y0, z0], [x1, y1, z1]) = (self.min_m, self.max_m);
        [
            format!("kind        {}", self.kind),
            format!("resolution  {} m", self.resolution_m),
            format!("cells       {x} × {y} × {z}"),
            format!("extent      x {x0:.3} … {x1:.3}, y {y0:.3} … {y1:.3}, z {z0:.3} … {z1:.3} m"),
            format!("nodes       {}", self.nodes),
            format!("occupied    {} leaves, {:.3} m³", self.occupied_leaves, self.occupied_m3),
            format!("free        {} leaves, {:.3} m³", self.free_leaves, self.free_m3),
            format!("unknown     {:.3} m³", self.unknown_m3),
        ]
        .join("\n")
    }
}

/// Runs the command; what it prints goes to standard output.
pub fn run(args: &MapArgs) -> anyhow::Result<()> {
    match &args.action {
        Action::Info { file, resolution, json } => {
            let (kind, tree) = tree(file, *resolution)?;
            let info = Info::of(kind, &tree);
            let text = if *json { serde_json::to_string_pretty(&info)? } else { info.text() };
            writeln!(std::io::stdout(), "{text}").context("cannot print")?;
        }
        Action::Convert { file, out, resolution } => {
            if !matches!(Source::parse(&out.to_string_lossy()), Ok(Source::Bt(_))) {
                let expected = "a file to write that ends in `.bt`";
                return Err(MapError::UnknownKind { file: out.display().to_string(), expected }.into());
            }
            bt::write(&tree(file, *resolution)?.1, Path::new(out))?;
        }
    }
    Ok(())
}

/// A map as an octree, resampled if a resolution is asked for.
fn tree(file: &str, resolution_m: Option<f32>) -> Result<(&'static str, Octree), MapError> {
    match Source::parse(file)? {
        Source::Building(seed) => {
            let map = building::building(seed, resolution_m.unwrap_or(DEFAULT_RESOLUTION_M))?;
            Ok(("builtin", map.to_octree(file)?))
        }
        Source::Bt(path) => {
            let tree = bt::read(path)?;
            let tree = match resolution_m {
                Some(resolution_m) => {
                    OccupancyMap::from_octree(&tree, resolution_m, file)?.to_octree(file)?
                }
                None => tree,
            };
            Ok(("octomap", tree))
        }
    }
}
