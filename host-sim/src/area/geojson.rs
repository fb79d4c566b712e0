//! GeoJSON: the polygons of a geometry, a feature or a feature collection.

use geojson::{GeoJson, Geometry, GeometryValue};

use super::polygons::{AreaFileError, Polygons, RingXy};

/// The polygons of a GeoJSON text.
pub(super) fn parse(text: &str) -> Result<Polygons, AreaFileError> {
    let file: GeoJson =
        text.parse().map_err(|error| AreaFileError::malformed("GeoJSON", &error))?;
    let mut polygons = Polygons::default();
    match &file {
        GeoJson::Geometry(geometry) => add(geometry, &mut polygons)?,
        GeoJson::Feature(feature) => {
            feature.geometry.iter().try_for_each(|geometry| add(geometry, &mut polygons))?;
        }
        GeoJson::FeatureCollection(collection) => {
            let mut geometries = collection.features.iter().filter_map(|f| f.geometry.as_ref());
            geometries.try_for_each(|geometry| add(geometry, &mut polygons))?;
        }
    }
    Ok(polygons)
}

/// Adds the polygons of a geometry and of all geometries in it.
fn add(geometry: &Geometry, polygons: &mut Polygons) -> Result<(), AreaFileError> {
    match &geometry.value {
        GeometryValue::Polygon { coordinates } => polygons.add(rings(coordinates)?),
        GeometryValue::MultiPolygon { coordinates } => {
            for polygon in coordinates {
                polygons.add(rings(polygon)?);
            }
        }
        GeometryValue::GeometryCollection { geometries } => {
            geometries.iter().try_for_each(|geometry| add(geometry, polygons))?;
        }
        _ => {}
    }
    Ok(())
}

/// The outer ring of a polygon, then its holes.
fn rings(polygon: &geojson::PolygonType) -> Result<Vec<RingXy>, AreaFileError> {
    let place = |position: &geojson::Position| match position.as_slice() {
        [x, y, ..] => Ok([*x, *y]),
        short => Err(AreaFileError::malformed(
            "GeoJSON",
            &format!("a position has {} numbers", short.len()),
        )),
    };
    polygon.iter().map(|ring| ring.iter().map(place).collect()).collect()
}
