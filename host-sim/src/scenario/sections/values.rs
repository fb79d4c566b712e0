//! Reads values that several tables of a scenario have.

use planner_core::Point;

use crate::scenario::reader::{Result, TomlValue};

/// Highest MAVLink system id of a vehicle.
pub(super) const MAX_VEHICLE_ID: u64 = 250;

/// Reads a point given as three numbers: east, north, up in metres.
pub(super) fn read_point(value: &TomlValue<'_>) -> Result<Point> {
    value.triple().map(|[x, y, z]| Point::new(x as f32, y as f32, z as f32))
}
