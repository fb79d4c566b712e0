//! Polygons with the coordinates of their file, and the errors of reading them.

use thiserror::Error;

use crate::quote::printable;

/// Most vertices that a file may have, over all its polygons.
pub const MAX_VERTICES: usize = 10_000;

/// Vertices of one closed ring, x (east or longitude) first; the last vertex may repeat the first.
pub type RingXy = Vec<[f64; 2]>;

/// All polygons of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    /// Areas to photograph.
    pub outers: Vec<RingXy>,
    /// Holes of all outer rings: not photographed, but vehicles may fly over them.
    pub holes: Vec<RingXy>,
    /// No-fly zones: neither photographed nor flown over.
    pub no_fly: Vec<RingXy>,
}

/// Reason why a file cannot be used as an area.
#[derive(Debug, Error)]
pub enum AreaFileError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// The ending of the file's name is none of the known formats.
    #[error("is in no known format: its name ends in none of .geojson, .json, .wkt, .kml, .plan")]
    UnknownFormat,
    /// The file is not in the format of its ending.
    #[error("is not {format}: {why}")]
    Malformed {
        /// Format that the text is not in, as a noun for the message.
        format: &'static str,
        /// First line of the parser's message.
        why: String,
    },
    /// The file holds no polygon; the text is a hint that the message ends with.
    #[error("holds no polygon{0}")]
    NoPolygon(&'static str),
    /// The file holds more than [`MAX_VERTICES`] vertices; the field is their number.
    #[error("holds {0} vertices; at most {MAX_VERTICES} can be used")]
    TooManyVertices(usize),
}

impl AreaFileError {
    /// The error for a text that is not of this format, with the first line of `why`.
    pub(super) fn malformed(format: &'static str, why: &impl ToString) -> Self {
        Self::Malformed {
            format,
            why: printable(why.to_string().lines().next().unwrap_or_default()),
        }
    }
}

impl Polygons {
    /// Number of vertices of all rings.
    pub fn vertex_count(&self) -> usize {
        self.outers.iter().chain(&self.holes).chain(&self.no_fly).map(Vec::len).sum()
    }

    /// Adds one polygon: the first ring that is not empty is its outer ring, the others are its
    /// holes.
    pub(super) fn add(&mut self, rings: impl IntoIterator<Item = RingXy>) {
        let mut rings = rings.into_iter().filter(|ring| !ring.is_empty());
        self.outers.extend(rings.next());
        self.holes.extend(rings);
    }
}
