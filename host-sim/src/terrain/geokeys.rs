//! GeoKeys: how GeoTIFF, and point clouds before LAS 1.4, state their coordinate system.

use super::crs::{CoordinateSystem, Crs, epsg_unit_m};
use super::error::{TerrainError, WARP_HINT};

/// Id of the key for the kind of system: 1 projected, 2 geographic, 3 geocentric.
const MODEL: u16 = 1024;
/// Id of the key that is 2 if coordinates are those of the cells' centres.
const RASTER: u16 = 1025;
/// Id of the key for the EPSG code of a geographic system.
const GEOGRAPHIC: u16 = 2048;
/// Id of the key for the EPSG code of a projected system.
const PROJECTED: u16 = 3072;
/// Id of the key for the EPSG code of the unit of projected coordinates.
const LENGTH_UNIT: u16 = 3076;
/// Id of the key for the EPSG code of the vertical system.
const VERTICAL: u16 = 4096;
/// Id of the key for the EPSG code of the unit of heights.
const HEIGHT_UNIT: u16 = 4099;
/// Value, instead of an EPSG code, of a key whose system or unit other keys define.
const USER_DEFINED: u16 = 32767;
/// EPSG codes of vertical systems, national and global, with heights above sea level in metres.
const METRE_HEIGHT_SYSTEMS: [u16; 18] = [
    3855, 5701, 5702, 5703, 5705, 5709, 5711, 5714, 5720, 5728, 5730, 5773, 5776, 5782, 5783, 6647,
    7837, 9274,
];
/// EPSG codes of vertical systems with heights in international feet.
const FOOT_HEIGHT_SYSTEMS: [u16; 1] = [8228];
/// EPSG codes of vertical systems with heights in US survey feet.
const US_FOOT_HEIGHT_SYSTEMS: [u16; 1] = [6360];

/// The GeoKeys of a file: id and value.
#[derive(Debug)]
pub(super) struct GeoKeys(Vec<(u16, u16)>);

impl GeoKeys {
    /// Reads the key directory: four numbers, then four a key. Keys whose values stand in another
    /// tag are skipped: no key used here has such a value.
    pub(super) fn new(directory: &[u16]) -> Self {
        let entries = directory.chunks_exact(4).skip(1);
        Self(entries.filter(|entry| entry[1] == 0).map(|entry| (entry[0], entry[3])).collect())
    }

    /// Value of a key; `None` if the file does not have it.
    fn get(&self, key: u16) -> Option<u16> {
        self.0.iter().find(|(own, _)| *own == key).map(|(_, value)| *value)
    }

    /// Whether a raster's coordinates are those of its cells' centres, not corners.
    pub(super) fn is_pixel_point(&self) -> bool {
        self.get(RASTER) == Some(2)
    }

    /// The coordinate system. A user-defined one is read from `wkt`, and refused without it.
    pub(super) fn crs(&self, wkt: Option<&str>) -> Result<Crs, TerrainError> {
        let (projected, geographic) = (self.get(PROJECTED), self.get(GEOGRAPHIC));
        let system = match (self.get(MODEL), projected, geographic) {
            (Some(1), Some(code), _) if code != USER_DEFINED => CoordinateSystem::epsg(code)?,
            (Some(2), _, Some(code)) if code != USER_DEFINED => CoordinateSystem::epsg(code)?,
            (Some(3), ..) => {
                return Err(TerrainError::unusable_crs(
                    "coordinates about the middle of the earth",
                ));
            }
            _ => match wkt {
                Some(wkt) => CoordinateSystem::wkt(wkt)?,
                None if self.0.is_empty() => return Ok(Crs::Unstated),
                None => return Err(TerrainError::unusable_crs("a system of its own")),
            },
        };
        let said = self
            .get(LENGTH_UNIT)
            .filter(|code| *code != USER_DEFINED)
            .map(epsg_unit_m)
            .transpose()?;
        if let (Some(said), Some(known)) = (said, system.unit_m)
            && (said - known).abs() > 1e-6
        {
            let what = format!("units of {said} m, its coordinate system in units of {known} m");
            return Err(TerrainError::UnusableCrs { what, hint: WARP_HINT });
        }
        Ok(Crs::Stated(Box::new(system)))
    }

    /// Metres in a unit of height; `None` if the keys do not state it.
    pub(super) fn height_unit_m(&self) -> Result<Option<f64>, TerrainError> {
        if let Some(code) = self.get(HEIGHT_UNIT) {
            return epsg_unit_m(code).map(Some);
        }
        match self.get(VERTICAL) {
            None => Ok(None),
            Some(code) if METRE_HEIGHT_SYSTEMS.contains(&code) => Ok(Some(1.0)),
            Some(code) if FOOT_HEIGHT_SYSTEMS.contains(&code) => Ok(Some(super::crs::FOOT_M)),
            Some(code) if US_FOOT_HEIGHT_SYSTEMS.contains(&code) => Ok(Some(super::crs::US_FOOT_M)),
            Some(code) => Err(TerrainError::unusable_crs(&format!(
                "heights of EPSG:{code} without their unit"
            ))),
        }
    }
}
