//! KML: the polygons of placemarks, also in documents and folders. Longitude first, then latitude.

mod walk;

use kml::Kml;
use kml::types::{Geometry, LinearRing, Polygon};

use super::polygons::{AreaFileError, Polygons, RingXy};

/// The polygons of a KML text.
pub(super) fn parse(text: &str) -> Result<Polygons, AreaFileError> {
    walk::check(text)?;
    let file: Kml<f64> =
        text.parse().map_err(|error: kml::Error| AreaFileError::malformed("KML", &error))?;
    let mut polygons = Polygons::default();
    add(&file, &mut polygons);
    Ok(polygons)
}

/// Adds the polygons of an element and of all elements in it.
fn add(element: &Kml<f64>, polygons: &mut Polygons) {
    match element {
        Kml::KmlDocument(document) => document.elements.iter().for_each(|e| add(e, polygons)),
        Kml::Document { elements, .. } => elements.iter().for_each(|e| add(e, polygons)),
        Kml::Folder(folder) => folder.elements.iter().for_each(|e| add(e, polygons)),
        Kml::Placemark(placemark) => {
            placemark.geometry.iter().for_each(|geometry| add_geometry(geometry, polygons));
        }
        Kml::MultiGeometry(many) => many.geometries.iter().for_each(|g| add_geometry(g, polygons)),
        Kml::Polygon(polygon) => polygons.add(rings(polygon)),
        _ => {}
    }
}

/// Adds the polygons of a geometry and of all geometries in it.
fn add_geometry(geometry: &Geometry<f64>, polygons: &mut Polygons) {
    match geometry {
        Geometry::Polygon(polygon) => polygons.add(rings(polygon)),
        Geometry::MultiGeometry(many) => {
            many.geometries.iter().for_each(|g| add_geometry(g, polygons));
        }
        _ => {}
    }
}

/// The outer ring of a polygon, then its holes.
fn rings(polygon: &Polygon<f64>) -> Vec<RingXy> {
    let ring = |ring: &LinearRing<f64>| ring.coords.iter().map(|c| [c.x, c.y]).collect();
    std::iter::once(&polygon.outer).chain(&polygon.inner).map(ring).collect()
}

#[cfg(test)]
mod tests;
