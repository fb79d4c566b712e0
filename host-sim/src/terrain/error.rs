//! Reason why a file gives no heights.

use thiserror::Error;

use super::limits::{MAX_BYTES, MAX_CELLS};
use crate::quote::quoted;

/// Reason why a file gives no heights.
#[derive(Debug, Error)]
pub enum TerrainError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// The file is longer than is read.
    #[error("cannot be read: it has {0} bytes, at most {MAX_BYTES} are read")]
    TooLong(u64),
    /// The file's name says nothing about its format.
    #[error("is in no known format: its name ends in none of .asc, .tif, .tiff, .las, .laz")]
    Format,
    /// The file is not what its name says.
    #[error("is not {format}: {why}")]
    Malformed {
        /// Format by the file's name.
        format: &'static str,
        /// Fault of the file.
        why: String,
    },
    /// The file's coordinate system cannot be used.
    #[error("is in {what}, which cannot be used; {hint}")]
    System {
        /// Coordinate system that the file states.
        what: String,
        /// Remedy.
        hint: &'static str,
    },
    /// The file does not state its place.
    #[error("does not say where it is; {0}")]
    Nowhere(&'static str),
    /// The file has too many cells, or the box would have.
    #[error("has {0} cells here; at most {MAX_CELLS} are held")]
    TooManyCells(u128),
    /// The requested box has no height.
    #[error("has no height here: {0} lies elsewhere, or holds none")]
    Elsewhere(String),
}

/// Hint of an error about a coordinate system.
pub(super) const WARP_HINT: &str =
    "convert it: gdalwarp -t_srs EPSG:32630, with your zone, or pdal translate";

impl TerrainError {
    pub(super) fn malformed(format: &'static str, why: &impl ToString) -> Self {
        Self::Malformed { format, why: quoted(why.to_string().lines().next().unwrap_or_default()) }
    }

    pub(super) fn system(what: &str) -> Self {
        Self::System { what: quoted(what), hint: WARP_HINT }
    }
}
