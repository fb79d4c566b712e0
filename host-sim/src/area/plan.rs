//! QGroundControl `.plan`: the polygons of its surveys are the area; without a survey, its
//! inclusion fences are. Exclusion fences are no-fly zones.
//!
//! Format: <https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html>. In
//! such a file latitude comes before longitude.

use serde::Deserialize;

use super::polygons::{AreaFileError, Polygons, RingXy};

/// Number of corners of the polygon that replaces a circular fence.
const CIRCLE_CORNERS: usize = 32;
/// Metres per degree of latitude, on the sphere on which QGroundControl draws circles.
const M_PER_DEG: f64 = 111_319.49;

/// A plan file; only what is read of it, as in the structs below.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PlanFile {
    file_type: String,
    version: u32,
    mission: PlanMission,
    #[serde(default)]
    geo_fence: PlanGeofence,
}

/// The plan's mission.
#[derive(Deserialize)]
struct PlanMission {
    #[serde(default)]
    items: Vec<PlanItem>,
}

/// An item of the mission, such as a survey.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PlanItem {
    /// Kind of a complex item, such as "survey"; `None` for a simple one.
    complex_item_type: Option<String>,
    /// Latitude and longitude of each vertex, degrees. `None` for an item without a polygon.
    polygon: Option<Vec<[f64; 2]>>,
}

/// The plan's geofence.
#[derive(Deserialize, Default)]
struct PlanGeofence {
    #[serde(default)]
    polygons: Vec<FencePolygon>,
    #[serde(default)]
    circles: Vec<FenceCircle>,
}

/// A polygon of the geofence.
#[derive(Deserialize)]
struct FencePolygon {
    /// Whether vehicles have to stay inside; else they have to stay outside.
    inclusion: bool,
    /// Latitude and longitude of each vertex, degrees.
    polygon: Vec<[f64; 2]>,
}

/// A circle of the geofence.
#[derive(Deserialize)]
struct FenceCircle {
    inclusion: bool,
    circle: Circle,
}

/// Centre and radius.
#[derive(Deserialize)]
struct Circle {
    /// Latitude and longitude, degrees.
    center: [f64; 2],
    /// Metres.
    radius: f64,
}

/// The polygons of a plan of QGroundControl.
pub(super) fn parse(text: &str) -> Result<Polygons, AreaFileError> {
    const FORMAT: &str = "a plan of QGroundControl";
    let file: PlanFile =
        serde_json::from_str(text).map_err(|error| AreaFileError::malformed(FORMAT, &error))?;
    if file.file_type != "Plan" || file.version != 1 {
        let why = format!(
            "fileType {:?}, version {}: expected \"Plan\", 1",
            file.file_type, file.version
        );
        return Err(AreaFileError::malformed(FORMAT, &why));
    }
    let surveys = file.mission.items.into_iter();
    let surveys = surveys.filter(|item| item.complex_item_type.as_deref() == Some("survey"));
    let mut polygons = Polygons {
        outers: surveys
            .filter_map(|item| item.polygon)
            .map(|ring| longitude_first(&ring))
            .collect(),
        ..Polygons::default()
    };
    let has_survey = !polygons.outers.is_empty();
    let fences =
        file.geo_fence.polygons.into_iter().map(|f| (f.inclusion, longitude_first(&f.polygon)));
    let circles = file.geo_fence.circles.into_iter().map(|f| (f.inclusion, circle_polygon(&f)));
    for (inclusion, ring) in fences.chain(circles) {
        match (inclusion, has_survey) {
            (false, _) => polygons.no_fly.push(ring),
            (true, false) => polygons.outers.push(ring),
            (true, true) => {}
        }
    }
    Ok(polygons)
}

/// A ring of latitudes and longitudes as one of longitudes and latitudes.
fn longitude_first(ring: &[[f64; 2]]) -> RingXy {
    ring.iter().map(|&[lat, lon]| [lon, lat]).collect()
}

/// The polygon of a circular fence: inscribed in the circle of an inclusion fence, circumscribed
/// about that of an exclusion fence, so that the polygon is never less strict than the circle.
fn circle_polygon(fence: &FenceCircle) -> RingXy {
    let circle = &fence.circle;
    let [lat, lon] = circle.center;
    let half = std::f64::consts::PI / CIRCLE_CORNERS as f64;
    let radius = if fence.inclusion { circle.radius } else { circle.radius / half.cos() };
    let corner = |i: usize| {
        let (sin, cos) = (2.0 * half * i as f64).sin_cos();
        let east = radius * cos / (M_PER_DEG * lat.to_radians().cos());
        [lon + east, lat + radius * sin / M_PER_DEG]
    };
    (0..CIRCLE_CORNERS).map(corner).collect()
}
