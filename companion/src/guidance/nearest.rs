//! The point of a path that is nearest to a place, within a window.

use planner_core::Point;
use planner_core::flight::Path;

/// A nearest point this close to the end of the path counts as its end, metres.
const AT_PATH_END_M: f32 = 0.02;

/// Arc length of the path's point nearest to `place`, searched `window_m` around `near_m`, metres;
/// the path's length where that is less than 0.02 m away.
pub(super) fn nearest_arc_length_m<const W: usize>(
    path: &Path<W>,
    place: &Point,
    near_m: f32,
    window_m: f32,
) -> f32 {
    let (along_m, length_m) = (path.project(place, near_m, window_m), path.length_m());
    if length_m - along_m < AT_PATH_END_M { length_m } else { along_m.max(0.0) }
}
