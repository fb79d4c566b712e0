//! Polygons from files: what is to be photographed, holes in it, and zones that nobody enters.
//!
//! GeoJSON, WKT, KML and QGroundControl `.plan`. Points and lines in a file are passed over. Coordinates are as the file
//! has them, x (east or longitude) first.

mod geojson;
mod kml;
mod plan;
#[cfg(test)]
mod tests;
mod wkt;

use std::path::Path;

use thiserror::Error;

use crate::files;
use crate::quote::quoted;

/// Most vertices of all polygons.
pub const MOST_VERTICES: usize = 10_000;

/// One closed line; whether its last vertex repeats the first does not matter.
pub type RingXy = Vec<[f64; 2]>;

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    /// To photograph.
    pub outers: Vec<RingXy>,
    /// Not photographed, flown over.
    pub holes: Vec<RingXy>,
    /// Neither.
    pub no_fly: Vec<RingXy>,
}

/// Format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// RFC 7946, or the same in metres.
    GeoJson,
    /// Well-known text.
    Wkt,
    /// Keyhole markup.
    Kml,
    /// QGroundControl's plan: the polygon of its survey, else its inclusion fence.
    Plan,
}

/// Why a file holds no area.
#[derive(Debug, Error)]
pub enum AreaFileError {
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// Its name says nothing about its format.
    #[error("is in no known format: its name ends in none of .geojson, .json, .wkt, .kml, .plan")]
    Format,
    /// It is not what its name says.
    #[error("is not {format}: {why}")]
    Malformed {
        /// What it should be.
        format: &'static str,
        /// What is wrong.
        why: String,
    },
    /// There is no polygon in it.
    #[error("holds no polygon{0}")]
    NoPolygon(&'static str),
    /// There are too many vertices in it.
    #[error("holds {0} vertices; at most {MOST_VERTICES} can be used")]
    TooManyVertices(usize),
}

impl AreaFileError {
    fn malformed(format: &'static str, why: &impl ToString) -> Self {
        Self::Malformed { format, why: quoted(why.to_string().lines().next().unwrap_or_default()) }
    }
}

impl Format {
    /// The format of a file of this name.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "geojson" | "json" => Some(Self::GeoJson),
            "wkt" | "txt" => Some(Self::Wkt),
            "kml" => Some(Self::Kml),
            "plan" => Some(Self::Plan),
            _ => None,
        }
    }
}

/// Reads a file.
///
/// # Errors
/// It cannot be read, is not what its name says, or holds no polygon.
pub fn read(path: &Path) -> Result<Polygons, AreaFileError> {
    let format = Format::of(path).ok_or(AreaFileError::Format)?;
    parse(&files::read_text(path)?, format)
}

/// Reads a text.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, format: Format) -> Result<Polygons, AreaFileError> {
    let mut polygons = match format {
        Format::GeoJson => geojson::parse(text)?,
        Format::Wkt => wkt::parse(text)?,
        Format::Kml => kml::parse(text)?,
        Format::Plan => plan::parse(text)?,
    };
    if polygons.outers.is_empty() {
        let hint = match format {
            Format::Plan => ", no survey's and no inclusion fence",
            _ => "",
        };
        return Err(AreaFileError::NoPolygon(hint));
    }
    polygons.outers.iter_mut().chain(&mut polygons.holes).chain(&mut polygons.no_fly).for_each(open);
    let count = polygons.vertex_count();
    if count > MOST_VERTICES { Err(AreaFileError::TooManyVertices(count)) } else { Ok(polygons) }
}

impl Polygons {
    /// Vertices of all rings.
    pub fn vertex_count(&self) -> usize {
        self.outers.iter().chain(&self.holes).chain(&self.no_fly).map(Vec::len).sum()
    }

    /// Takes one polygon: its outer ring and its holes.
    fn add(&mut self, rings: impl IntoIterator<Item = RingXy>) {
        let mut rings = rings.into_iter().filter(|ring| !ring.is_empty());
        self.outers.extend(rings.next());
        self.holes.extend(rings);
    }
}

/// Drops vertices that repeat the one before, around the end too.
pub fn open(ring: &mut RingXy) {
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
}
