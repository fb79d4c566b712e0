//! Paths that take the place of the plan's: detours, the way back, and the plan's own again.

use planner_core::flight::{Path, Task, VehiclePlan, Waypoint};
use planner_core::{Length, Point};

use super::Mission;

/// Greatest distance between the first point of a path and the place where it must begin, metres; a
/// plan beyond it is refused.
const MAX_PATH_START_ERROR_M: f32 = 0.1;
/// A picture at most this far along the path before the place where the vehicle comes back to its
/// path is taken at that place, metres.
const REJOIN_PICTURE_WINDOW_M: f32 = 0.05;

impl<const W: usize, const G: usize> Mission<W, G> {
    /// Puts the detour `way` in place of the plan's path, which the vehicle leaves `along_m` metres
    /// along it. Gates and departure time are cleared.
    pub(crate) fn switch_to_detour(&mut self, way: &VehiclePlan<W, G>, along_m: f32) {
        self.note_path_left(along_m);
        if let Some(plan) = &mut self.plan {
            plan.path = way.path.clone();
            (plan.climb_m, plan.descent_m) = (way.climb_m, way.descent_m);
            plan.gates.clear();
            plan.depart_s = 0.0;
        }
    }

    /// If the plan has no climb, so that its path begins in the air: takes for it the height of the
    /// first point above the ground at `ground_m`, ENU up, metres. The vehicle may land there.
    pub(crate) fn note_ground_below_start(&mut self, ground_m: f32) {
        if let Some(plan) = self.plan.as_mut().filter(|plan| plan.climb_m == 0.0) {
            plan.climb_m = height_above_m(plan.path.waypoints().first(), ground_m);
        }
    }

    /// Takes for the descent, from a path that ends aside, the height of its last point above the
    /// ground at `ground_m`, ENU up, metres.
    pub(crate) fn note_ground_below_end(&mut self, ground_m: f32) {
        if let Some(plan) = &mut self.plan {
            plan.descent_m = height_above_m(plan.path.waypoints().last(), ground_m);
        }
    }

    /// Puts the vehicle's own plan in place again, after a detour that left its path at `left_m`
    /// and came back at `back_m` metres along it. Returns the number of pictures between the two
    /// places: they count as not taken, since those from the detour show other ground.
    pub(crate) fn resume_own_path(
        &mut self,
        plan: &VehiclePlan<W, G>,
        left_m: f32,
        back_m: f32,
    ) -> u32 {
        self.begin_plan(plan);
        let Task::Photograph(photographs) = &plan.task else { return 0 };
        let taken = |along_m: f32| photographs.taken_count(&plan.path, along_m);
        // The picture at the place of the return is still taken.
        self.pictures_before_rejoin = taken(back_m - REJOIN_PICTURE_WINDOW_M);
        self.pictures_before_rejoin.saturating_sub(taken(left_m))
    }

    /// Replaces the path, which the vehicle leaves `along_m` metres along it, by the path back to
    /// the start that `turn` makes of it. The new path is not part of the shared plan: neighbours
    /// keep clear of this vehicle as of one outside the plan.
    pub(crate) fn reverse_path(&mut self, along_m: f32, turn: impl FnOnce(&mut Path<W>)) {
        self.note_path_left(along_m);
        if let Some(plan) = &mut self.plan {
            turn(&mut plan.path);
            plan.gates.clear();
            core::mem::swap(&mut plan.climb_m, &mut plan.descent_m);
        }
    }

    /// Whether the plan's numbers are finite and not negative, and its path begins at `place`; a
    /// plan that does not leave the pad needs no path.
    pub(crate) fn is_plan_valid_from(&self, plan: &VehiclePlan<W, G>, place: &Point) -> bool {
        let numbers = [plan.climb_m, plan.descent_m, plan.depart_s];
        let finite = numbers.iter().all(|h| h.is_finite() && *h >= 0.0)
            && plan.gates.iter().all(|g| !g.at_m.is_nan() && !g.open_from_progress_m.is_nan());
        let first = plan.path.waypoints().first();
        let begins = first.is_some_and(|w| (w.position - place).length() < MAX_PATH_START_ERROR_M);
        finite && (begins || !plan.task.leaves_pad())
    }
}

/// Height of a path's point above the ground at `ground_m` (ENU up), metres; 0 without a point.
fn height_above_m(point: Option<&Waypoint>, ground_m: f32) -> f32 {
    point.map_or(0.0, |w| libm::fmaxf(w.position.z - ground_m, 0.0))
}
