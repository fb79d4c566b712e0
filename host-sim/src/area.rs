//! Reads polygons from files: areas to photograph, holes in them, and no-fly zones.
//!
//! Formats: GeoJSON, WKT, KML and QGroundControl `.plan`. Points and lines in a file are ignored.
//! Coordinates are those of the file, with x (east or longitude) first.

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

/// File format of polygons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AreaFormat {
    /// RFC 7946 (longitude, latitude), or the same structure with coordinates in metres.
    GeoJson,
    /// Well-known text (OGC).
    Wkt,
    /// Keyhole Markup Language.
    Kml,
    /// QGroundControl's plan: the polygons of its surveys; without a survey, its inclusion fences.
    Plan,
}

impl AreaFormat {
    /// The format by the ending of the file's name; `None` for any other ending.
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

/// Reads the polygons of a file; the ending of its name says the format.
///
/// # Errors
/// The file cannot be read, is not in the format of its ending, holds no polygon or too many
/// vertices.
pub fn read(path: &Path) -> Result<Polygons, AreaFileError> {
    let format = AreaFormat::from_path(path).ok_or(AreaFileError::UnknownFormat)?;
    parse(&files::read_text(path)?, format)
}

/// Parses the polygons of a text in the given format.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, format: AreaFormat) -> Result<Polygons, AreaFileError> {
    // Some programs write a byte order mark at the beginning of a text: it is removed.
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
        .for_each(remove_repeated_vertices);
    let count = polygons.vertex_count();
    if count > MAX_VERTICES { Err(AreaFileError::TooManyVertices(count)) } else { Ok(polygons) }
}

/// Removes each vertex that equals the one before it, and a last vertex that equals the first.
pub fn remove_repeated_vertices(ring: &mut RingXy) {
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
}
