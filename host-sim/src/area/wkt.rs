//! Well-known text: POLYGON, MULTIPOLYGON and GEOMETRYCOLLECTION of them.

use std::str::FromStr as _;

use wkt::Wkt;
use wkt::types::{LineString, Polygon};

use super::polygons::{AreaFileError, Polygons, RingXy};

/// Most collections in a file: the parser recurses for each collection within another one.
const MAX_COLLECTIONS: usize = 64;

/// The polygons of a WKT text.
pub(super) fn parse(text: &str) -> Result<Polygons, AreaFileError> {
    if text.to_ascii_uppercase().matches("COLLECTION").count() > MAX_COLLECTIONS {
        return Err(AreaFileError::malformed(
            "WKT that can be read",
            &"it has more than 64 collections",
        ));
    }
    // PostGIS writes `SRID=…;` before the geometry. It is ignored: `[area]` of the scenario states
    // the coordinate system.
    let text = text.trim();
    let text = match text.split_once(';') {
        Some((system, rest)) if system.to_ascii_uppercase().starts_with("SRID=") => rest,
        _ => text,
    };
    let geometry =
        Wkt::<f64>::from_str(text).map_err(|error| AreaFileError::malformed("WKT", &error))?;
    let mut polygons = Polygons::default();
    add(&geometry, &mut polygons);
    Ok(polygons)
}

/// Adds the polygons of a geometry and of all geometries in it.
fn add(geometry: &Wkt<f64>, polygons: &mut Polygons) {
    match geometry {
        Wkt::Polygon(polygon) => polygons.add(rings(polygon)),
        Wkt::MultiPolygon(many) => {
            many.polygons().iter().for_each(|polygon| polygons.add(rings(polygon)));
        }
        Wkt::GeometryCollection(many) => {
            many.geometries().iter().for_each(|geometry| add(geometry, polygons));
        }
        _ => {}
    }
}

/// The outer ring of a polygon, then its holes.
fn rings(polygon: &Polygon<f64>) -> Vec<RingXy> {
    let ring = |line: &LineString<f64>| line.coords().iter().map(|c| [c.x, c.y]).collect();
    polygon.rings().iter().map(ring).collect()
}
