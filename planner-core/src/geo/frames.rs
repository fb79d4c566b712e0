//! Coordinate frames: WGS84, the mission's ENU tangent plane, and each autopilot's own NED
//! projection.
//!
//! The mission frame is ENU metres on the plane tangent to the WGS84 ellipsoid at the mission
//! origin. An autopilot's local frame is NED metres about its own EKF origin, but *not* a tangent
//! plane: PX4 projects azimuthally on a sphere, ArduPilot scales degrees. Two kilometres from the
//! origin their results differ from WGS84 by metres, so every conversion goes through latitude and
//! longitude with the projection of the connected autopilot. All is f64: f32 cannot hold degrees to
//! 1e-9.

use libm::{asin, atan2, cos, fabs, sin, sqrt};
use nalgebra::Vector3;

use crate::Point;

/// Semi-major axis of the WGS84 ellipsoid, metres.
const WGS84_A: f64 = 6_378_137.0;
/// Flattening of the WGS84 ellipsoid.
const WGS84_F: f64 = 1.0 / 298.257_223_563;
/// Square of the first eccentricity of the WGS84 ellipsoid.
const WGS84_E2: f64 = WGS84_F * (2.0 - WGS84_F);
/// Radius of the sphere on which PX4 projects (`CONSTANTS_RADIUS_OF_EARTH`), metres.
pub const PX4_EARTH_RADIUS_M: f64 = 6_371_000.0;
/// ArduPilot's `LOCATION_SCALING_FACTOR`: metres along a meridian per 1e-7 degree of latitude.
pub const ARDUPILOT_M_PER_DEG_E7: f64 = 0.011_131_884_502_145_034;

/// A geodetic position on WGS84.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geodetic {
    /// Latitude, degrees, north positive.
    pub lat_deg: f64,
    /// Longitude, degrees, east positive.
    pub lon_deg: f64,
    /// Altitude, metres above mean sea level. The geoid is taken as the ellipsoid: only differences
    /// of altitudes are used, as in autopilots.
    pub alt_m: f64,
}

impl Geodetic {
    /// Whether the altitude is finite, |latitude| ≤ 90° and |longitude| ≤ 180°; false if any is
    /// NaN.
    pub fn is_valid(&self) -> bool {
        fabs(self.lat_deg) <= 90.0 && fabs(self.lon_deg) <= 180.0 && self.alt_m.is_finite()
    }

    /// The position in ECEF (earth-centred, earth-fixed) coordinates, metres.
    fn ecef(&self) -> Vector3<f64> {
        self.sin_cos().ecef(self.alt_m)
    }

    /// Sines and cosines of latitude and longitude.
    fn sin_cos(&self) -> LatLonSinCos {
        let (lat, lon) = (self.lat_deg.to_radians(), self.lon_deg.to_radians());
        LatLonSinCos { sin_lat: sin(lat), cos_lat: cos(lat), sin_lon: sin(lon), cos_lon: cos(lon) }
    }
}

/// Sines and cosines of one latitude and longitude, computed once: they cost more than all other
/// arithmetic of a conversion.
struct LatLonSinCos {
    sin_lat: f64,
    cos_lat: f64,
    sin_lon: f64,
    cos_lon: f64,
}

impl LatLonSinCos {
    /// ECEF coordinates, metres, of the point at this altitude.
    fn ecef(&self, alt_m: f64) -> Vector3<f64> {
        let n = WGS84_A / sqrt(1.0 - WGS84_E2 * self.sin_lat * self.sin_lat);
        Vector3::new(
            (n + alt_m) * self.cos_lat * self.cos_lon,
            (n + alt_m) * self.cos_lat * self.sin_lon,
            (n * (1.0 - WGS84_E2) + alt_m) * self.sin_lat,
        )
    }
}

/// `position` in ENU metres on the plane tangent to WGS84 at `origin`.
pub fn geodetic_to_enu(origin: &Geodetic, position: &Geodetic) -> Point {
    let turn = origin.sin_cos();
    let d = position.ecef() - turn.ecef(origin.alt_m);
    let LatLonSinCos { sin_lat, cos_lat, sin_lon, cos_lon } = turn;
    let east = -sin_lon * d.x + cos_lon * d.y;
    let north = -sin_lat * cos_lon * d.x - sin_lat * sin_lon * d.y + cos_lat * d.z;
    let up = cos_lat * cos_lon * d.x + cos_lat * sin_lon * d.y + sin_lat * d.z;
    Point::new(east as f32, north as f32, up as f32)
}

/// The geodetic position of the point `enu` (ENU metres about `origin`). Inverse of
/// [`geodetic_to_enu`] up to the rounding of f32: half a millimetre within 8 km, 4 mm at 100 km.
pub fn enu_to_geodetic(origin: &Geodetic, enu: &Point) -> Geodetic {
    let (e, n, u) = (f64::from(enu.x), f64::from(enu.y), f64::from(enu.z));
    let turn = origin.sin_cos();
    let o = turn.ecef(origin.alt_m);
    let LatLonSinCos { sin_lat, cos_lat, sin_lon, cos_lon } = turn;
    let x = o.x - sin_lon * e - sin_lat * cos_lon * n + cos_lat * cos_lon * u;
    let y = o.y + cos_lon * e - sin_lat * sin_lon * n + cos_lat * sin_lon * u;
    let z = o.z + cos_lat * n + sin_lat * u;
    ecef_to_geodetic(x, y, z)
}

/// Geodetic position of an ECEF point in metres. Five fixed-point iterations of the latitude
/// equation: converged below 1e-12 rad for altitudes within ±100 km.
fn ecef_to_geodetic(x: f64, y: f64, z: f64) -> Geodetic {
    let p = sqrt(x * x + y * y);
    let mut lat = atan2(z, p * (1.0 - WGS84_E2));
    let mut alt = 0.0;
    for _ in 0..5 {
        let n = WGS84_A / sqrt(1.0 - WGS84_E2 * sin(lat) * sin(lat));
        alt = if fabs(lat) < core::f64::consts::FRAC_PI_4 {
            p / cos(lat) - n
        } else {
            z / sin(lat) - n * (1.0 - WGS84_E2)
        };
        lat = atan2(z, p * (1.0 - WGS84_E2 * n / (n + alt)));
    }
    Geodetic { lat_deg: lat.to_degrees(), lon_deg: atan2(y, x).to_degrees(), alt_m: alt }
}

/// Great-circle distance between two positions in metres by the haversine formula (paper CPP eq.
/// 9), on a sphere of 6 371 000 m; altitudes are ignored. Compared with WGS84 it is up to 0.56 %
/// too long (along a meridian at the equator) and up to 0.45 % too short (near the poles).
pub fn haversine_m(a: &Geodetic, b: &Geodetic) -> f64 {
    let (lat_a, lat_b) = (a.lat_deg.to_radians(), b.lat_deg.to_radians());
    let half_dlat = sin((lat_b - lat_a) / 2.0);
    let half_dlon = sin((b.lon_deg - a.lon_deg).to_radians() / 2.0);
    let h = half_dlat * half_dlat + cos(lat_a) * cos(lat_b) * half_dlon * half_dlon;
    2.0 * PX4_EARTH_RADIUS_M * asin(sqrt(h.clamp(0.0, 1.0)))
}

/// The map projection by which an autopilot converts latitude and longitude to its local NED frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// PX4 `MapProjection`: azimuthal equidistant on a sphere of 6 371 000 m.
    Px4,
    /// ArduPilot `Location::get_distance_NE`: degrees times a constant, longitude also times the
    /// cosine of the mean latitude.
    ArduPilot,
}

/// `position` in NED metres about the EKF origin `origin`, computed as that autopilot computes it.
pub fn geodetic_to_ned(
    projection: Projection,
    origin: &Geodetic,
    position: &Geodetic,
) -> Vector3<f64> {
    let down = origin.alt_m - position.alt_m;
    match projection {
        Projection::Px4 => {
            let (lat0, lat) = (origin.lat_deg.to_radians(), position.lat_deg.to_radians());
            let dlon = (position.lon_deg - origin.lon_deg).to_radians();
            let cos_c = (sin(lat0) * sin(lat) + cos(lat0) * cos(lat) * cos(dlon)).clamp(-1.0, 1.0);
            let c = libm::acos(cos_c);
            let k = if c > 1e-12 { c / sin(c) } else { 1.0 } * PX4_EARTH_RADIUS_M;
            let north = k * (cos(lat0) * sin(lat) - sin(lat0) * cos(lat) * cos(dlon));
            Vector3::new(north, k * cos(lat) * sin(dlon), down)
        }
        Projection::ArduPilot => {
            let scale = ARDUPILOT_M_PER_DEG_E7 * 1e7;
            let middle = ((origin.lat_deg + position.lat_deg) / 2.0).to_radians();
            let east =
                wrap_180_deg(position.lon_deg - origin.lon_deg) * scale * cos(middle).max(0.01);
            Vector3::new((position.lat_deg - origin.lat_deg) * scale, east, down)
        }
    }
}

/// The geodetic position that an autopilot assigns to `ned`, NED metres about its EKF `origin`.
/// Inverse of [`geodetic_to_ned`].
pub fn ned_to_geodetic(projection: Projection, origin: &Geodetic, ned: &Vector3<f64>) -> Geodetic {
    let alt_m = origin.alt_m - ned.z;
    match projection {
        Projection::Px4 => {
            let (north, east) = (ned.x / PX4_EARTH_RADIUS_M, ned.y / PX4_EARTH_RADIUS_M);
            let c = sqrt(north * north + east * east);
            if c < 1e-15 {
                return Geodetic { alt_m, ..*origin };
            }
            let (lat0, lon0) = (origin.lat_deg.to_radians(), origin.lon_deg.to_radians());
            let lat = asin((cos(c) * sin(lat0) + north * sin(c) * cos(lat0) / c).clamp(-1.0, 1.0));
            let lon =
                lon0 + atan2(east * sin(c), c * cos(lat0) * cos(c) - north * sin(lat0) * sin(c));
            Geodetic { lat_deg: lat.to_degrees(), lon_deg: wrap_180_deg(lon.to_degrees()), alt_m }
        }
        Projection::ArduPilot => {
            let scale = ARDUPILOT_M_PER_DEG_E7 * 1e7;
            let lat_deg = origin.lat_deg + ned.x / scale;
            let middle = ((origin.lat_deg + lat_deg) / 2.0).to_radians();
            let lon_deg = wrap_180_deg(origin.lon_deg + ned.y / (scale * cos(middle).max(0.01)));
            Geodetic { lat_deg, lon_deg, alt_m }
        }
    }
}

/// A longitude, or a difference of two, wrapped into [-180, 180] degrees. Unwrapped, a difference
/// of 359.9999 degrees across the antimeridian would become 40 000 km instead of 11 m.
fn wrap_180_deg(degrees: f64) -> f64 {
    if fabs(degrees) <= 180.0 { degrees } else { libm::remainder(degrees, 360.0) }
}

/// Converts an ENU vector to NED, or a NED vector to ENU: both swap x with y and negate z.
pub fn swap_enu_ned<T: nalgebra::RealField + Copy>(v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(v.y, v.x, -v.z)
}

#[cfg(test)]
mod tests;
