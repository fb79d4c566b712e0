//! The nearest point of a path within a window.

use planner_core::Point;
use planner_core::flight::Path;

/// A setpoint that stands this near the end of the path has flown the path, metres.
const AT_PATH_END_M: f32 = 0.02;

/// Arc length of the nearest point of the path; its end, if that is as near as counts as there.
pub(super) fn nearest_arc_length_m<const W: usize>(
    path: &Path<W>,
    place: &Point,
    near_m: f32,
    window_m: f32,
) -> f32 {
    let (along_m, length_m) = (path.project(place, near_m, window_m), path.length_m());
    if length_m - along_m < AT_PATH_END_M { length_m } else { along_m.max(0.0) }
}
