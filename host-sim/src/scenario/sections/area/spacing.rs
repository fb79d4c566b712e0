//! The camera of an area, the height of the pictures and the distances between them.

use planner_core::coverage::CoverageError;
use planner_core::coverage::footprint::{Camera, Footprint, Spacing};

use crate::scenario::error::ScenarioError;
use crate::scenario::reader::{Result, Table, TomlValue};

/// Reads `camera`.
pub(super) fn read_camera(value: &TomlValue<'_>) -> Result<Camera> {
    let table = value.table()?;
    let sensor = table.get("sensor_mm");
    let camera = match &sensor {
        Some(sensor) => {
            let side = 0.1..=1000.0;
            let sides_mm = read_pair(sensor, |v| v.f64(&side).map(|n| n as f32))?;
            let hint = "a camera is { fov_deg, aspect } or { sensor_mm = [w, h], focal_mm, pixels = [w, h] }";
            let focal_mm = table.required("focal_mm", hint)?.f64(&(0.1..=10_000.0))? as f32;
            let pixels = match table.get("pixels") {
                Some(pixels) => {
                    read_pair(&pixels, |v| v.integer_in_range(1..=1_000_000).map(|n| n as u32))?
                }
                None => return Err(value.error("needs pixels beside sensor_mm")),
            };
            Camera::Sensor { sides_mm, focal_mm, pixels }
        }
        None => {
            let hint = "a camera is { fov_deg, aspect } or { sensor_mm = [w, h], focal_mm, pixels = [w, h] }";
            let fov_deg = table.required("fov_deg", hint)?.f64(&(0.1..=175.0))? as f32;
            Camera::Diagonal { fov_deg, aspect: table.f32("aspect", 1.5, 0.05..=20.0)? }
        }
    };
    table.refuse_unknown_keys()?;
    Ok(camera)
}

/// Reads a list of two values.
fn read_pair<T: Copy>(
    value: &TomlValue<'_>,
    item: impl Fn(&TomlValue<'_>) -> Result<T>,
) -> Result<[T; 2]> {
    let items = value.items()?;
    let [a, b] = items.as_slice() else { return Err(value.error("must be two numbers")) };
    Ok([item(a)?, item(b)?])
}

/// Height of the pictures, metres: given, or computed from the ground sampling distance, else 35.
fn read_height(table: &Table<'_>, camera: Option<&Camera>) -> Result<f32> {
    let height = table.get("height_m");
    let gsd = table.get("gsd_m");
    Ok(match (&height, &gsd) {
        (Some(_), Some(gsd)) => {
            return Err(gsd.error("cannot stand beside area.height_m: give one of them"));
        }
        (Some(height), None) => height.f64(&(0.1..=5000.0))? as f32,
        (None, Some(gsd)) => {
            let gsd_m = gsd.f64(&(1e-4..=100.0))? as f32;
            let Some(camera) = camera else { return Err(gsd.error("needs area.camera")) };
            camera.height_for_gsd(gsd_m).map_err(|_| gsd.error("needs a camera with pixels"))?
        }
        (None, None) => 35.0,
    })
}

/// Reads the height of the pictures, and footprint, lane and waypoint distance.
pub(super) fn read_spacing(table: &Table<'_>, camera: Option<&Camera>) -> Result<(f32, Spacing)> {
    let height_m = read_height(table, camera)?;
    let distances = 0.1..=10_000.0;
    let lane = table.get("lane_m").map(|v| v.f64(&distances).map(|n| (n as f32, v))).transpose()?;
    let waypoint =
        table.get("waypoint_m").map(|v| v.f64(&distances).map(|n| (n as f32, v))).transpose()?;
    for (overlap, spacing) in [("overlap_side", &lane), ("overlap_front", &waypoint)] {
        if let (Some(value), Some(_)) = (table.get(overlap), spacing) {
            return Err(value
                .error("cannot stand beside the distance that follows from it: give one of them"));
        }
    }
    if let (None, Some(_), Some(overlap)) = (camera, &lane, table.get("overlap_front")) {
        return Err(overlap.error("needs area.camera"));
    }
    let side = table.f32("overlap_side", 0.6, 0.0..=0.95)?;
    let front = table.f32("overlap_front", 0.7, 0.0..=0.95)?;
    let footprint = match camera {
        Some(camera) => camera.footprint(height_m).map_err(|error| spacing_error(table, &error))?,
        // Without a camera, the given spacings are taken as the footprint of a picture.
        None => match (&lane, &waypoint) {
            (Some((lane_m, _)), Some((waypoint_m, _))) => {
                Footprint { along_m: *waypoint_m, across_m: *lane_m }
            }
            (Some((lane_m, _)), None) => Footprint { along_m: *lane_m, across_m: *lane_m },
            _ => {
                let hint =
                    "add `camera = { fov_deg = 73.7, aspect = 1.5 }`, or lane_m and waypoint_m";
                return Err(table.text.error_with_hint(
                    &table.span,
                    "area.camera is missing",
                    hint,
                ));
            }
        },
    };
    let lane_m = lane.as_ref().map_or(footprint.across_m * (1.0 - side), |(m, _)| *m);
    let waypoint_m = match (&waypoint, camera) {
        (Some((m, _)), _) => *m,
        (None, Some(_)) => footprint.along_m * (1.0 - front),
        (None, None) => footprint.along_m,
    };
    let spacing =
        Spacing { footprint, max_lane_spacing_m: lane_m, max_waypoint_spacing_m: waypoint_m };
    match spacing.check() {
        Ok(()) => Ok((height_m, spacing)),
        Err(CoverageError::Gaps) => {
            let wide = lane_m > footprint.across_m;
            let (key, side) =
                if wide { (&lane, footprint.across_m) } else { (&waypoint, footprint.along_m) };
            let why = format!("leaves gaps: one picture shows {side:.2} m from {height_m} m");
            match key {
                Some((_, value)) => Err(value.error(&why)),
                None => Err(table.text.error(&table.span, format!("area {why}"))),
            }
        }
        Err(error) => Err(spacing_error(table, &error)),
    }
}

/// The error for a spacing that cannot be used.
fn spacing_error(table: &Table<'_>, error: &CoverageError) -> ScenarioError {
    table.text.error(&table.span, format!("area: {error:?}"))
}
