//! Paper P3D, Algorithm 2, lines 10, 11 and 18 to 25, as printed: the waypoint that a vehicle flies
//! to, and the end of its path.
//!
//! The vehicle flies straight to its current waypoint at the speed that lines 12 to 17 leave
//! ([`planner_core::track::deconflict`]). The next waypoint is loaded once the vehicle is nearer
//! than `Wp_radius` to the current one. That near to the last waypoint the path is completed: speed
//! 0, then the vehicle lands where it is. Nothing of our tracker is used: no speed limit by a
//! corner's clearance, no reference that waits, no guided descent. The paper does not state
//! `Wp_radius`.

use planner_core::flight::Path;
use planner_core::{Length, Point};

/// `Wp_radius`, metres: a waypoint is reached within this distance. It is less than the referee's
/// radius by the greatest error of an RTK estimate.
const WP_RADIUS_M: f32 = 0.4;

/// The paper's `nWaypoint`, the index of the current waypoint, and whether the path is completed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Algorithm2Waypoints {
    /// Index in the path of the waypoint that the vehicle flies to.
    current_index: usize,
    /// Whether the last waypoint was reached.
    completed: bool,
}

impl Algorithm2Waypoints {
    /// One turn of Algorithm 2's loop for a vehicle at `position`. Returns the waypoint that it
    /// flies to; `None` once the path is completed.
    pub(super) fn update_current_waypoint<const W: usize>(
        &mut self,
        path: &Path<W>,
        position: &Point,
    ) -> Option<Point> {
        let points = path.waypoints();
        let goal = points.get(self.current_index)?.position;
        if (goal - position).length() < WP_RADIUS_M {
            if self.current_index + 1 < points.len() {
                self.current_index += 1;
            } else {
                self.completed = true;
            }
        }
        (!self.completed).then(|| points[self.current_index].position)
    }

    /// Whether the last waypoint was reached.
    pub(super) fn is_completed(self) -> bool {
        self.completed
    }
}

#[cfg(test)]
mod tests;
