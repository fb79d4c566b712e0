//! Polygons as a file has them, and why it holds none.

use thiserror::Error;

use crate::quote::quoted;

/// Most vertices of all polygons.
pub const MAX_VERTICES: usize = 10_000;

/// One closed line; whether its last vertex repeats the first does not matter.
pub type RingXy = Vec<[f64; 2]>;

/// Content of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    /// Areas to photograph.
    pub outers: Vec<RingXy>,
    /// Areas that are not photographed, and may be flown over.
    pub holes: Vec<RingXy>,
    /// Neither.
    pub no_fly: Vec<RingXy>,
}

/// Reason why a file holds no area.
#[derive(Debug, Error)]
pub enum AreaFileError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// The file's name says nothing about its format.
    #[error("is in no known format: its name ends in none of .geojson, .json, .wkt, .kml, .plan")]
    Format,
    /// The file is not what its name says.
    #[error("is not {format}: {why}")]
    Malformed {
        /// Format by the file's name.
        format: &'static str,
        /// Fault of the file.
        why: String,
    },
    /// The file holds no polygon.
    #[error("holds no polygon{0}")]
    NoPolygon(&'static str),
    /// The file holds too many vertices.
    #[error("holds {0} vertices; at most {MAX_VERTICES} can be used")]
    TooManyVertices(usize),
}

impl AreaFileError {
    pub(super) fn malformed(format: &'static str, why: &impl ToString) -> Self {
        Self::Malformed { format, why: quoted(why.to_string().lines().next().unwrap_or_default()) }
    }
}

impl Polygons {
    /// Vertices of all rings.
    pub fn vertex_count(&self) -> usize {
        self.outers.iter().chain(&self.holes).chain(&self.no_fly).map(Vec::len).sum()
    }

    /// Takes one polygon: its outer ring and its holes.
    pub(super) fn add(&mut self, rings: impl IntoIterator<Item = RingXy>) {
        let mut rings = rings.into_iter().filter(|ring| !ring.is_empty());
        self.outers.extend(rings.next());
        self.holes.extend(rings);
    }
}
