//! Errors of reading, generating and writing maps, with enough detail for the user to correct them.

use std::path::{Path, PathBuf};

use crate::quote::{printable, printable_path};

/// Reason why a map could not be read, generated or written.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// The operating system reported an error.
    #[error("cannot {action} the map: {}", printable_path(file))]
    Io {
        /// What failed: "read" or "write".
        action: &'static str,
        /// Path of the file.
        file: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The bytes of the file do not follow its format.
    #[error(
        "malformed map: {}: byte {offset}: expected {expected}, found {found}",
        printable_path(file)
    )]
    Malformed {
        /// Path of the file.
        file: PathBuf,
        /// Offset of the error, bytes from the beginning of the file.
        offset: u64,
        /// What the format requires there.
        expected: String,
        /// What the file has there.
        found: String,
    },
    /// The map's name has the ending of no known format, and is no built-in map.
    #[error("unknown kind of map: {}: expected {expected}", printable(file))]
    UnknownKind {
        /// The map's name as given.
        file: String,
        /// Names that are accepted.
        expected: &'static str,
    },
    /// The map cannot be represented on the requested grid.
    #[error("map does not fit: {}: {why}", printable(file))]
    DoesNotFitGrid {
        /// The map's name as given.
        file: String,
        /// Reason, with the numbers that matter.
        why: String,
    },
}

impl MapError {
    /// The error that reading or writing (`action`) a file failed.
    pub(super) fn from_io(action: &'static str, file: &Path, source: std::io::Error) -> Self {
        Self::Io { action, file: file.into(), source }
    }
}
