//! Coordinate systems: conversion of a file's coordinates to the mission frame and back.

use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::geo::frames::{Geodetic, enu_to_geodetic, geodetic_to_enu};
use proj4rs::Proj;
use proj4rs::transform::transform;

use super::error::{TerrainError, WARP_HINT};
use super::frame::WithoutCrs;

/// Metres in an international foot.
pub(super) const FOOT_M: f64 = 0.3048;
/// Metres in a US survey foot.
pub(super) const US_FOOT_M: f64 = 1200.0 / 3937.0;

/// Coordinate system of a file's coordinates.
#[derive(Debug)]
pub(super) enum Crs {
    /// The file does not state one.
    Unstated,
    /// The file states this one.
    Stated(Box<CoordinateSystem>),
}

/// A coordinate system that a file states.
#[derive(Debug)]
pub(super) struct CoordinateSystem {
    /// The system itself.
    proj: Proj,
    /// WGS84 latitude and longitude, into which places are converted.
    wgs84: Proj,
    /// Metres in a unit of its horizontal coordinates; `None` if these are degrees.
    pub unit_m: Option<f64>,
}

impl CoordinateSystem {
    /// The system with this code in the EPSG register.
    pub(super) fn epsg(code: u16) -> Result<Self, TerrainError> {
        let name = format!("EPSG:{code}");
        let Some(found) = crs_definitions::from_code(code) else {
            return Err(TerrainError::unusable_crs(&name));
        };
        Self::proj(found.proj4, &name)
    }

    /// The system that well-known text (WKT) describes.
    pub(super) fn wkt(text: &str) -> Result<Self, TerrainError> {
        let name: String = text.split('"').nth(1).unwrap_or("an unnamed system").to_owned();
        let unusable = || TerrainError::unusable_crs(&name);
        // Only the horizontal system is parsed; the vertical one may stand beside it.
        let start = ["PROJCS", "PROJCRS", "PROJECTEDCRS", "GEOGCS", "GEOGCRS", "GEODCRS"];
        let start = start.iter().find_map(|word| text.find(word)).ok_or_else(unusable)?;
        let proj = proj4wkt::wkt_to_projstring(up_to_closing_bracket(&text[start..]))
            .map_err(|_| unusable())?;
        Self::proj(&proj, &name)
    }

    /// The system that a PROJ definition describes; `name` is for the error.
    fn proj(definition: &str, name: &str) -> Result<Self, TerrainError> {
        let unusable = || TerrainError::unusable_crs(name);
        // The library would silently leave out a datum shift by a grid file that it does not have.
        if ["+datum=NAD27", "+nadgrids=@", "+geoidgrids"]
            .iter()
            .any(|shift| definition.contains(shift))
            && !definition.contains("+nadgrids=@null")
        {
            return Err(unusable());
        }
        let proj = Proj::from_proj_string(definition).map_err(|_| unusable())?;
        let wgs84 = Proj::from_proj_string("+proj=longlat +datum=WGS84 +no_defs")
            .map_err(|_| unusable())?;
        if proj.is_geocent() || !proj.is_normalized_axis() || !proj.has_inverse() {
            return Err(unusable());
        }
        let unit_m = (!proj.is_latlong()).then(|| proj.to_meter());
        Ok(Self { proj, wgs84, unit_m })
    }

    /// Longitude and latitude, WGS84 degrees, of a place in the file's coordinates; `None` outside
    /// the system's domain.
    pub(super) fn to_wgs84_degrees(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let mut place = match self.unit_m {
            Some(_) => (x, y, 0.0),
            None => (x.to_radians(), y.to_radians(), 0.0),
        };
        transform(&self.proj, &self.wgs84, &mut place).ok()?;
        let found = [place.0.to_degrees(), place.1.to_degrees()];
        found.iter().all(|degrees| degrees.is_finite()).then_some(found)
    }

    /// The file's coordinates of a place given by longitude and latitude, WGS84 degrees; `None`
    /// outside the system's domain.
    fn wgs84_degrees_to_crs(&self, [lon, lat]: [f64; 2]) -> Option<[f64; 2]> {
        let mut place = (lon.to_radians(), lat.to_radians(), 0.0);
        transform(&self.wgs84, &self.proj, &mut place).ok()?;
        let found = match self.unit_m {
            Some(_) => [place.0, place.1],
            None => [place.0.to_degrees(), place.1.to_degrees()],
        };
        found.iter().all(|number| number.is_finite()).then_some(found)
    }
}

impl Crs {
    /// Refuses a file without a coordinate system, unless `without_crs` takes its coordinates as
    /// metres.
    pub(super) fn check_usable(&self, without_crs: WithoutCrs) -> Result<(), TerrainError> {
        match self {
            Self::Unstated if without_crs == WithoutCrs::Refused => {
                Err(TerrainError::NoGeoreference(
                    "a .prj beside an .asc or gdal_translate -a_srs say it; in a mission with \
                     coordinates = \"metres\" its numbers are metres about the origin",
                ))
            }
            _ => Ok(()),
        }
    }

    /// Metres in a unit of height if the file gives heights no unit of their own: the unit of its
    /// horizontal coordinates, or metres if these are degrees.
    pub(super) fn default_height_unit_m(&self) -> f64 {
        match self {
            Self::Unstated => 1.0,
            Self::Stated(system) => system.unit_m.unwrap_or(1.0),
        }
    }

    /// A file's coordinates as a place in the mission frame, metres; `None` outside the system's
    /// domain.
    pub(super) fn to_mission_frame(&self, origin: &Geodetic, place: [f64; 2]) -> Option<Flat> {
        match self {
            Self::Unstated => Some(Flat::new(place[0] as f32, place[1] as f32)),
            Self::Stated(system) => {
                let [lon_deg, lat_deg] = system.to_wgs84_degrees(place)?;
                let place = Geodetic { lat_deg, lon_deg, alt_m: origin.alt_m };
                place.is_valid().then(|| geodetic_to_enu(origin, &place).xy())
            }
        }
    }

    /// A place in the mission frame as the file's coordinates; `None` outside the system's domain.
    pub(super) fn mission_frame_to_crs(&self, origin: &Geodetic, place: &Flat) -> Option<[f64; 2]> {
        match self {
            Self::Unstated => Some([f64::from(place.x), f64::from(place.y)]),
            Self::Stated(system) => {
                // The point at the origin's altitude, not the one on the plane that touches the
                // earth at the origin: three iterations find it.
                let mut up_m = 0.0;
                let mut found = *origin;
                for _ in 0..3 {
                    found = enu_to_geodetic(origin, &Point::new(place.x, place.y, up_m));
                    up_m -= (found.alt_m - origin.alt_m) as f32;
                }
                system.wgs84_degrees_to_crs([found.lon_deg, found.lat_deg])
            }
        }
    }
}

/// Metres in the unit with this EPSG code.
pub(super) fn epsg_unit_m(code: u16) -> Result<f64, TerrainError> {
    match code {
        9001 => Ok(1.0),
        9002 => Ok(FOOT_M),
        9003 => Ok(US_FOOT_M),
        other => Err(TerrainError::UnusableCrs {
            what: format!("units of EPSG:{other}"),
            hint: WARP_HINT,
        }),
    }
}

/// Metres in a unit of height, as well-known text states it; `None` if it states none.
pub(super) fn wkt_height_unit_m(text: &str) -> Option<f64> {
    let start = ["VERT_CS", "VERTCS", "VERTCRS"].iter().find_map(|word| text.find(word))?;
    let part = up_to_closing_bracket(&text[start..]);
    let unit = &part[part.rfind("UNIT[")?..];
    unit.split(',').nth(1)?.trim_matches([']', ' ']).parse().ok()
}

/// The text up to the bracket that closes its first bracket.
fn up_to_closing_bracket(text: &str) -> &str {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        depth += i32::from(c == '[') - i32::from(c == ']');
        if c == ']' && depth == 0 {
            return &text[..=at];
        }
    }
    text
}
