//! Why a file gives no heights.

use thiserror::Error;

use super::limits::{MOST_BYTES, MOST_CELLS};
use crate::quote::quoted;

/// Why a file gives no heights.
#[derive(Debug, Error)]
pub enum TerrainError {
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// It is longer than is read.
    #[error("cannot be read: it has {0} bytes, at most {MOST_BYTES} are read")]
    TooLong(u64),
    /// Its name says nothing about its format.
    #[error("is in no known format: its name ends in none of .asc, .tif, .tiff, .las, .laz")]
    Format,
    /// It is not what its name says.
    #[error("is not {format}: {why}")]
    Malformed {
        /// What it should be.
        format: &'static str,
        /// What is wrong.
        why: String,
    },
    /// Where its numbers are cannot be honoured.
    #[error("is in {what}, which cannot be used; {hint}")]
    System {
        /// What it says.
        what: String,
        /// What would help.
        hint: &'static str,
    },
    /// It does not say where it is.
    #[error("does not say where it is; {0}")]
    Nowhere(&'static str),
    /// It has too many cells, or the box would have.
    #[error("has {0} cells here; at most {MOST_CELLS} are held")]
    TooManyCells(u128),
    /// There is no height in the box that was asked for.
    #[error("has no height here: {0} lies elsewhere, or holds none")]
    Elsewhere(String),
}

/// What helps where a coordinate system does not.
pub(super) const WARP: &str = "convert it: gdalwarp -t_srs EPSG:32630, with your zone, or pdal translate";

impl TerrainError {
    pub(super) fn malformed(format: &'static str, why: &impl ToString) -> Self {
        Self::Malformed { format, why: quoted(why.to_string().lines().next().unwrap_or_default()) }
    }

    pub(super) fn system(what: &str) -> Self {
        Self::System { what: quoted(what), hint: WARP }
    }
}
