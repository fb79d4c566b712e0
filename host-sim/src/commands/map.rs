//! The commands `host-sim map info` and `host-sim map convert`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use serde::Serialize;

use crate::files::ResultFiles;
use crate::map::{MapError, MapSource, OccupancyMap, Octree, RESOLUTION_RANGE_M, bt, building};
use crate::say;

/// Resolution of a built-in map where none is given, metres.
pub const DEFAULT_RESOLUTION_M: f32 = 0.25;

/// Arguments of `host-sim map`.
#[derive(Debug, Args)]
pub struct MapArgs {
    #[command(subcommand)]
    action: MapAction,
}

#[derive(Debug, Subcommand)]
enum MapAction {
    /// Print the size, leaves and volumes of a map
    Info {
        /// An OctoMap `.bt` file or `builtin:building`
        file: String,
        /// Edge of a cell, metres; if absent, a file's own resolution, 0.25 for a built-in map
        #[arg(long, value_name = "METRES", value_parser = parse_resolution)]
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
        /// Edge of a cell, metres; if absent, a file's own resolution, 0.25 for a built-in map
        #[arg(long, value_name = "METRES", value_parser = parse_resolution)]
        resolution: Option<f32>,
    },
}

/// What `host-sim map info` prints about a map.
#[derive(Debug, Serialize)]
pub struct MapInfo {
    /// `"octomap"` or `"builtin"`.
    pub kind: &'static str,
    /// Edge of the smallest cell, metres.
    pub resolution_m: f64,
    /// Number of smallest cells along east, north and up that span the known space.
    pub dims: [u32; 3],
    /// Lower corner of the known space, metres.
    pub min_m: [f64; 3],
    /// Upper corner of the known space, metres.
    pub max_m: [f64; 3],
    /// Number of nodes of the octree.
    pub nodes: usize,
    /// Number of occupied leaves of the octree.
    pub occupied_leaves: usize,
    /// Number of free leaves of the octree.
    pub free_leaves: usize,
    /// Volume of the occupied leaves, m³.
    pub occupied_m3: f64,
    /// Volume of the free leaves, m³.
    pub free_m3: f64,
    /// Volume of the box around the known space that is neither occupied nor free, m³.
    pub unknown_m3: f64,
}

impl MapInfo {
    /// Summary of an octree whose true position is that of its keys plus `shift_m`, metres ENU.
    pub fn from_octree(kind: &'static str, tree: &Octree, shift_m: [f64; 3]) -> Self {
        let counts = tree.counts();
        let (lo, hi) = tree.key_bounds().unwrap_or_default();
        let (min_m, max_m) = tree.metric_bounds().unwrap_or_default();
        let moved = |corner: [f64; 3]| [0, 1, 2].map(|a| corner[a] + shift_m[a]);
        let (min_m, max_m) = (moved(min_m), moved(max_m));
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

/// Runs the command and prints its result to standard output.
///
/// # Errors
/// The map cannot be read or written; the error names the file.
pub fn run(args: &MapArgs) -> anyhow::Result<ExitCode> {
    match &args.action {
        MapAction::Info { file, resolution, json } => {
            let info = map_info(file, *resolution)?;
            say!("{}", if *json { serde_json::to_string_pretty(&info)? } else { info.text() });
        }
        MapAction::Convert { file, out, resolution } => {
            if !matches!(MapSource::parse(&out.to_string_lossy()), Ok(MapSource::Bt(_))) {
                let expected = "a file to write that ends in `.bt`";
                return Err(
                    MapError::UnknownKind { file: out.display().to_string(), expected }.into()
                );
            }
            let mut results = ResultFiles::single_file(out)?;
            let tree = match read(file, *resolution)?.1 {
                Map::Grid(grid) => grid.to_octree(file)?,
                Map::Tree(tree) => tree,
            };
            results.add_file(out, &bt::to_bytes(&tree))?;
            results.commit()?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// A map as the octree of its file, or as a planning grid: resampled from a file, or built in.
enum Map {
    Tree(Octree),
    Grid(OccupancyMap),
}

/// Loads a map: the octree of a `.bt` file, or, with a resolution given or for a built-in map, the
/// grid that missions are planned on. Also returns its kind, `octomap` or `builtin`.
fn read(file: &str, resolution_m: Option<f32>) -> Result<(&'static str, Map), MapError> {
    match (MapSource::parse(file)?, resolution_m) {
        (MapSource::Building(seed), _) => {
            let map = building::building_map(seed, resolution_m.unwrap_or(DEFAULT_RESOLUTION_M))?;
            Ok(("builtin", Map::Grid(map)))
        }
        (MapSource::Bt(path), None) => Ok(("octomap", Map::Tree(bt::read(path)?))),
        (MapSource::Bt(path), Some(resolution_m)) => Ok((
            "octomap",
            Map::Grid(OccupancyMap::from_octree(&bt::read(path)?, resolution_m, file)?),
        )),
    }
}

fn map_info(file: &str, resolution_m: Option<f32>) -> Result<MapInfo, MapError> {
    let (kind, map) = read(file, resolution_m)?;
    let (tree, shift) = match map {
        Map::Tree(tree) => (Some(tree), [0.0; 3]),
        Map::Grid(grid) => grid.to_shifted_octree(),
    };
    let refuse =
        || MapError::DoesNotFitGrid { file: file.into(), why: "all its cells are alike".into() };
    Ok(MapInfo::from_octree(kind, &tree.ok_or_else(refuse)?, shift))
}

/// Parses the edge of a planning cell, metres, within the range that scenarios accept.
fn parse_resolution(text: &str) -> Result<f32, String> {
    let given = text.parse().ok().filter(|r: &f32| RESOLUTION_RANGE_M.contains(&f64::from(*r)));
    let (least, most) = (RESOLUTION_RANGE_M.start(), RESOLUTION_RANGE_M.end());
    given.ok_or_else(|| format!("expected a number from {least} to {most}, in metres"))
}

#[cfg(test)]
mod tests;
