//! Heights of the ground from files: ESRI grids (`.asc`), GeoTIFF, and point clouds (`.las`, `.laz`).
//!
//! Each becomes one [`HeightGrid`] in the mission frame. Units, missing cells and the coordinate system are what the file
//! says; what it says and cannot be honoured is refused by name. A file that names no coordinate system is in metres about
//! the mission's origin where the mission's own coordinates are, else it is refused.
//!
//! Datums of plates (ETRS89, NAD83) are taken for WGS84, 1 to 2 m apart; those that need a grid of shifts are refused.
//! Heights are above sea level as the file has them.

mod asc;
mod claims;
mod cloud;
mod crs;
mod error;
mod geokeys;
mod geotiff;
mod grid;
mod guard;
mod raster;
#[cfg(test)]
mod tests;

use std::path::Path;

use planner_core::coverage::Flat;
use planner_core::frames::Geodetic;

pub use self::error::TerrainError;
pub use self::grid::{HeightGrid, Heights};
use crate::quote::quoted_path;

/// Longest file read, bytes.
pub const MOST_BYTES: u64 = 1 << 28;
/// Most cells of a file or a grid: 128 MB of heights.
pub const MOST_CELLS: usize = 1 << 25;

/// Where heights are asked for.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Origin of the mission frame. Heights stay above sea level whatever its altitude.
    pub origin: &'a Geodetic,
    /// Whether numbers that name no coordinate system are metres about the origin.
    pub metres: bool,
    /// The box that is wanted, metres: its least and its greatest corner. All of the file where absent.
    pub window: Option<[Flat; 2]>,
}

/// Reads a file of heights.
///
/// # Errors
/// It cannot be read, is not what its name says, is in a coordinate system that is not honoured, or has no height here.
pub fn read(path: &Path, frame: &Frame<'_>) -> Result<HeightGrid, TerrainError> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let grid = match ending.to_ascii_lowercase().as_str() {
        "asc" => asc::read(path)?.laid_out(frame)?,
        "tif" | "tiff" => geotiff::read(path)?.laid_out(frame)?,
        "las" | "laz" => cloud::read(path, frame)?,
        _ => return Err(TerrainError::Format),
    };
    match grid.count() {
        0 => Err(TerrainError::Elsewhere(quoted_path(path))),
        _ => Ok(grid),
    }
}
