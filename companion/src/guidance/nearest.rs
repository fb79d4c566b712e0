//! The point of a path that is nearest to a place, within a window; and where the setpoint is along
//! the path.

use planner_core::Point;
use planner_core::flight::Path;

use super::{Guidance, REFERENCE_RESET_WINDOW_M};

/// Length of path searched for a jump, in one step, of the point nearest to the setpoint, metres.
/// Where the setpoint rounds a corner, the point jumps from one leg to the next, by 0.25 m at most.
const CORNER_JUMP_SEARCH_M: f32 = 0.5;
/// Greatest rounding error of an arc length, metres. The search for the nearest point reaches
/// further by it at both ends, so that the place of a setpoint that stands does not creep.
const MAX_ARC_LENGTH_ROUNDING_ERROR_M: f32 = 1e-3;
/// A nearest point this close to the end of the path counts as its end, metres.
const AT_PATH_END_M: f32 = 0.02;

/// Arc length of the path's point nearest to `place`, searched up to `window_m` to either side of
/// `near_m`, metres; the path's length where that is less than 0.02 m away.
pub(super) fn nearest_arc_length_m<const W: usize>(
    path: &Path<W>,
    place: &Point,
    near_m: f32,
    window_m: f32,
) -> f32 {
    let (along_m, length_m) = (path.project(place, near_m, window_m), path.length_m());
    if length_m - along_m < AT_PATH_END_M { length_m } else { along_m.max(0.0) }
}

impl Guidance {
    /// Follows the setpoint forward along the path. Since its place was last sought, the setpoint
    /// has moved by at most a step of `dt_s` at cruise speed, and it is never beyond the reference.
    /// It may be 1.2 s of flight behind the reference, 18 m at 15 m/s. A window of that length
    /// could find a later leg too early, where that leads back over the one before.
    pub(super) fn update_setpoint_along_m<const W: usize>(&mut self, path: &Path<W>, dt_s: f32) {
        let (from_m, along_m) = (self.setpoint_along_m, self.reference.along_m);
        let reach_m = 0.5 * (CORNER_JUMP_SEARCH_M + self.track.cruise_mps * dt_s);
        let place = self.smoother.position();
        let seen_m =
            path.project(&place, from_m + reach_m, reach_m + MAX_ARC_LENGTH_ROUNDING_ERROR_M);
        self.setpoint_along_m = seen_m.max(from_m).min(along_m);
    }

    /// Sets the reference back to the setpoint, which stands.
    pub(super) fn reset_reference_to_setpoint<const W: usize>(&mut self, path: &Path<W>) {
        let from_m = self.setpoint_along_m;
        let stepped_back = self.reference.along_m <= from_m;
        let reach_m = if stepped_back { 0.5 * REFERENCE_RESET_WINDOW_M } else { 0.0 };
        self.reference.along_m =
            nearest_arc_length_m(path, &self.smoother.position(), from_m + reach_m, reach_m);
    }
}
