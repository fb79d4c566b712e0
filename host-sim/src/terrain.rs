//! Reads heights of the ground from files: ESRI grids (`.asc`), GeoTIFF, and point clouds (`.las`,
//! `.laz`).
//!
//! Each file becomes one [`HeightGrid`] in the mission frame. Units, missing cells and the
//! coordinate system are those that the file states; what cannot be supported is refused by name. A
//! file without a coordinate system is read as metres from the mission's origin if the mission's
//! own coordinates are metres, else it is refused.
//!
//! Datums fixed to tectonic plates (ETRS89, NAD83) are taken for WGS84, from which they differ by 1
//! to 2 m; those that need a grid of datum shifts are refused. Heights are above sea level as in
//! the file.

mod asc;
mod cloud;
mod crs;
mod declared_sizes;
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
pub use self::frame::{TerrainFrame, WithoutCrs};
pub use self::grid::{BoxHeights, HeightGrid};
pub use self::limits::{MAX_BYTES, MAX_CELLS};
use crate::quote::printable_path;

/// Reads a file of heights into a grid in the mission frame.
///
/// # Errors
/// The file cannot be read, is not what its name says, is in a coordinate system that is not
/// supported, or has no height in the frame's window.
pub fn read(path: &Path, frame: &TerrainFrame<'_>) -> Result<HeightGrid, TerrainError> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let grid = match ending.to_ascii_lowercase().as_str() {
        "asc" => asc::read(path)?.resampled(frame)?,
        "tif" | "tiff" => geotiff::read(path)?.resampled(frame)?,
        "las" | "laz" => cloud::read(path, frame)?,
        _ => return Err(TerrainError::UnknownFormat),
    };
    match grid.known_cell_count() {
        0 => Err(TerrainError::NoHeightInWindow(printable_path(path))),
        _ => Ok(grid),
    }
}
