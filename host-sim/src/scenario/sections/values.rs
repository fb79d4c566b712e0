//! Values that several tables have.

use planner_core::Point;

use crate::scenario::reader::{Result, Value};

/// Most vehicles of a swarm: the system ids there are.
pub(super) const MAX_ID: u64 = 250;

/// Three numbers.
pub(super) fn read_point(value: &Value<'_>) -> Result<Point> {
    value.triple().map(|[x, y, z]| Point::new(x as f32, y as f32, z as f32))
}
