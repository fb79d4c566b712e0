//! Reason why a file gives no heights of the ground.

use thiserror::Error;

use super::limits::{MAX_BYTES, MAX_CELLS};
use crate::quote::printable;

/// Reason why a file gives no heights of the ground.
#[derive(Debug, Error)]
pub enum TerrainError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// The file is longer than [`MAX_BYTES`].
    #[error("cannot be read: it has {0} bytes, at most {MAX_BYTES} are read")]
    TooLong(u64),
    /// The file's name ends in none of the known formats.
    #[error("is in no known format: its name ends in none of .asc, .tif, .tiff, .las, .laz")]
    UnknownFormat,
    /// The file's content is not in the format of its name.
    #[error("is not {format}: {why}")]
    Malformed {
        /// Format that the file's name stands for.
        format: &'static str,
        /// What is wrong with the content.
        why: String,
    },
    /// The file's coordinate system, or unit, cannot be used.
    #[error("is in {what}, which cannot be used; {hint}")]
    UnusableCrs {
        /// The coordinate system or unit that the file states.
        what: String,
        /// Remedy.
        hint: &'static str,
    },
    /// The file states no coordinate system or no position; the text is a remedy.
    #[error("does not say where it is; {0}")]
    NoGeoreference(&'static str),
    /// The file has more cells than [`MAX_CELLS`], or the requested box would have.
    #[error("has {0} cells here; at most {MAX_CELLS} are held")]
    TooManyCells(u128),
    /// The file has no height in the requested box.
    #[error("has no height here: {0} lies elsewhere, or holds none")]
    NoHeightInWindow(String),
}

/// Remedy for a coordinate system that cannot be used.
pub(super) const WARP_HINT: &str =
    "convert it: gdalwarp -t_srs EPSG:32630, with your zone, or pdal translate";

impl TerrainError {
    /// The error for a file that is not of this format, with the first line of `why`.
    pub(super) fn malformed(format: &'static str, why: &impl ToString) -> Self {
        Self::Malformed {
            format,
            why: printable(why.to_string().lines().next().unwrap_or_default()),
        }
    }

    /// The error for a coordinate system that cannot be used, with a hint.
    pub(super) fn unusable_crs(what: &str) -> Self {
        Self::UnusableCrs { what: printable(what), hint: WARP_HINT }
    }
}
