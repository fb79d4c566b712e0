//! Polygons from files: what is to be photographed, holes in it, and zones that no vehicle may
//! enter.
//!
//! GeoJSON, WKT, KML and QGroundControl `.plan`. Points and lines in a file are passed over.
//! Coordinates are as the file has them, x (east or longitude) first.

mod geojson;
mod kml;
pub mod overlap;
mod plan;
mod polygons;
#[cfg(test)]
mod tests;
mod wkt;

use std::path::Path;

pub use self::polygons::{AreaFileError, MAX_VERTICES, Polygons, RingXy};
use crate::files;

/// Format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AreaFormat {
    /// RFC 7946, or the same in metres.
    GeoJson,
    /// Well-known text.
    Wkt,
    /// Keyhole markup.
    Kml,
    /// QGroundControl's plan: the polygon of its survey, else its inclusion fence.
    Plan,
}

impl AreaFormat {
    /// The format of a file of this name.
    pub fn from_path(path: &Path) -> Option<Self> {
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
    let format = AreaFormat::from_path(path).ok_or(AreaFileError::Format)?;
    parse(&files::read_text(path)?, format)
}

/// Reads a text.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, format: AreaFormat) -> Result<Polygons, AreaFileError> {
    // Some programs begin every text with a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut polygons = match format {
        AreaFormat::GeoJson => geojson::parse(text)?,
        AreaFormat::Wkt => wkt::parse(text)?,
        AreaFormat::Kml => kml::parse(text)?,
        AreaFormat::Plan => plan::parse(text)?,
    };
    if polygons.outers.is_empty() {
        let hint = match format {
            AreaFormat::Plan => ", no survey's and no inclusion fence",
            _ => "",
        };
        return Err(AreaFileError::NoPolygon(hint));
    }
    polygons
        .outers
        .iter_mut()
        .chain(&mut polygons.holes)
        .chain(&mut polygons.no_fly)
        .for_each(open_ring);
    let count = polygons.vertex_count();
    if count > MAX_VERTICES { Err(AreaFileError::TooManyVertices(count)) } else { Ok(polygons) }
}

/// Drops vertices that repeat the one before, around the end too.
pub fn open_ring(ring: &mut RingXy) {
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
}
