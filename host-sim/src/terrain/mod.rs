//! Heights of the ground from files: ESRI grids (`.asc`), GeoTIFF, and point clouds (`.las`,
//! `.laz`).
//!
//! Each becomes one [`HeightGrid`] in the mission frame. Units, missing cells and the coordinate
//! system are what the file says; what it says and cannot be honoured is refused by name. A file
//! that names no coordinate system is in metres about the mission's origin where the mission's own
//! coordinates are, else it is refused.
//!
//! Datums of plates (ETRS89, NAD83) are taken for WGS84, 1 to 2 m apart; those that need a grid of
//! shifts are refused. Heights are above sea level as the file has them.

mod asc;
mod claims;
mod cloud;
mod crs;
mod error;
mod field;
mod frame;
mod geokeys;
mod geotiff;
mod grid;
mod guard;
mod limits;
mod raster;
#[cfg(test)]
mod tests;

use std::path::Path;

pub use self::error::TerrainError;
pub use self::field::{FieldConfig, FieldError, encode_field};
pub use self::frame::Frame;
pub use self::grid::{HeightGrid, Heights};
pub use self::limits::{MAX_BYTES, MAX_CELLS};
use crate::quote::quoted_path;

/// Reads a file of heights.
///
/// # Errors
/// It cannot be read, is not what its name says, is in a coordinate system that is not honoured, or
/// has no height here.
pub fn read(path: &Path, frame: &Frame<'_>) -> Result<HeightGrid, TerrainError> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let grid = match ending.to_ascii_lowercase().as_str() {
        "asc" => asc::read(path)?.resampled(frame)?,
        "tif" | "tiff" => geotiff::read(path)?.resampled(frame)?,
        "las" | "laz" => cloud::read(path, frame)?,
        _ => return Err(TerrainError::Format),
    };
    match grid.count() {
        0 => Err(TerrainError::Elsewhere(quoted_path(path))),
        _ => Ok(grid),
    }
}
