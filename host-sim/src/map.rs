//! Maps are read, generated and written here; planner-core queries them as bit-packed voxel grids.

pub mod boxes;
pub mod bt;
pub mod building;
pub mod column;
pub mod edt;
mod error;
mod ground;
pub mod occupancy;
pub mod octree;
mod voxel_map;

use std::path::Path;

pub use boxes::BoxTree;
pub use edt::ClearanceField;
pub use error::MapError;
pub use ground::level_ground_map;
pub use occupancy::{OccupancyMap, UnknownSpace};
pub use octree::{Occupancy, Octree};
pub use voxel_map::VoxelMap;

/// The names of maps that are accepted, for messages.
pub const ACCEPTED_MAPS: &str =
    "an OctoMap `.bt` file, or `builtin:building`, `builtin:building?seed=N`";

/// Allowed edge of a planning cell, metres.
pub const RESOLUTION_RANGE_M: std::ops::RangeInclusive<f64> = 0.001..=100.0;

/// What the name of a map stands for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MapSource<'a> {
    /// The generated nine-floor building with this seed.
    Building(u64),
    /// The path of an OctoMap binary file.
    Bt(&'a Path),
}

impl<'a> MapSource<'a> {
    /// Parses the name of a map; no file is opened.
    pub fn parse(file: &'a str) -> Result<Self, MapError> {
        let unknown = || MapError::UnknownKind { file: file.into(), expected: ACCEPTED_MAPS };
        if let Some(builtin) = file.strip_prefix("builtin:") {
            let (name, seed) = match builtin.split_once("?seed=") {
                Some((name, seed)) => (name, seed.parse().map_err(|_| unknown())?),
                None => (builtin, building::DEFAULT_SEED),
            };
            return if name == "building" { Ok(Self::Building(seed)) } else { Err(unknown()) };
        }
        let path = Path::new(file);
        match path.extension().and_then(|e| e.to_str()) {
            Some(e) if e.eq_ignore_ascii_case("bt") => Ok(Self::Bt(path)),
            _ => Err(unknown()),
        }
    }
}

/// Loads a map onto a planning grid with cells of `resolution_m`. `file` is the name of a built-in
/// map, or a path relative to the working directory.
pub fn load(file: &str, resolution_m: f32) -> Result<OccupancyMap, MapError> {
    match MapSource::parse(file)? {
        MapSource::Building(seed) => building::building_map(seed, resolution_m),
        MapSource::Bt(path) => OccupancyMap::from_octree(&bt::read(path)?, resolution_m, file),
    }
}

#[cfg(test)]
mod tests;
