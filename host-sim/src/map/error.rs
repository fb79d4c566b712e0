//! What can be wrong with a map, said so that the user can mend it.

use std::path::{Path, PathBuf};

use crate::quote::{quoted, quoted_path};

/// Reason why a map could not be read, made or written.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// The file system said no.
    #[error("cannot {action} the map: {}", quoted_path(file))]
    Io {
        /// Attempted action: "read", "write".
        action: &'static str,
        /// The file.
        file: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The bytes are not what the format asks for.
    #[error(
        "malformed map: {}: byte {offset}: expected {expected}, found {found}",
        quoted_path(file)
    )]
    Malformed {
        /// The file.
        file: PathBuf,
        /// Where, in bytes from its beginning.
        offset: u64,
        /// Text that the format requires there.
        expected: String,
        /// Text that stands there.
        found: String,
    },
    /// No reader for such a name.
    #[error("unknown kind of map: {}: expected {expected}", quoted(file))]
    UnknownKind {
        /// The name as given.
        file: String,
        /// Formats that can be read.
        expected: &'static str,
    },
    /// The map cannot be laid on the grid that was asked for.
    #[error("map does not fit: {}: {why}", quoted(file))]
    Grid {
        /// The name as given.
        file: String,
        /// Why, with the numbers.
        why: String,
    },
}

impl MapError {
    pub(super) fn from_io(action: &'static str, file: &Path, source: std::io::Error) -> Self {
        Self::Io { action, file: file.into(), source }
    }
}
