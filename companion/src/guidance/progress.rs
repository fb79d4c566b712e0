//! Progress of the vehicle along its flight: climb, path and descent, and which of them are done.

use planner_core::flight::{MAX_REPORTED_PROGRESS_LAG_M, Path, VehiclePlan};
use planner_core::track::deconflict::Method;
use planner_core::{Length, Point};

use super::motion::clamp_to;
use super::{
    ARRIVED_WITHIN_M, AT_REST_MPS, CLIMB_DONE_WITHIN_M, DESCENT_DONE_WITHIN_M, Guidance,
    GuidanceInputs, LAND_MODE_AFTER_REST, Phase, WINDOW_EDGE_M,
};
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::Instant;

/// Cruise speed up to which the vehicle's place on the path is searched within three times the
/// greatest lead behind the reference, m/s.
const WIDER_LAG_WINDOW_ABOVE_MPS: f32 = 2.0;
/// Half of the distance searched in addition for each m/s above [`WIDER_LAG_WINDOW_ABOVE_MPS`],
/// seconds: the setpoint's curve follows the reference by up to 1.2 s, and the vehicle that curve
/// by 0.4 s.
const EXTRA_LAG_WINDOW_S: f32 = 1.0;

/// Greatest distance before a gate at which the reference of a vehicle that waits there stands,
/// metres.
const MAX_STOP_BEFORE_GATE_M: f32 = 0.05;
/// A vehicle within [`ARRIVED_WITHIN_M`] of its reference reports its progress at most this far
/// short of the reference, metres: less than gates allow ([`MAX_REPORTED_PROGRESS_LAG_M`]), since a
/// vehicle stops a little short of a gate.
const MAX_REPORTED_SHORTFALL_M: f32 = MAX_REPORTED_PROGRESS_LAG_M - MAX_STOP_BEFORE_GATE_M;
/// A vehicle that has landed reports progress to this far below the planned ground, metres, so that
/// every gate that waits for it opens.
const LANDED_EXTRA_PROGRESS_M: f32 = 1.0;

impl Guidance {
    /// Place along the plan's path up to which this vehicle flies while unheard, through gates that
    /// are open or open after a short wait, metres; and the seconds by which those gates delay it
    /// ([`Neighbours::own_unheard_reach`]).
    pub(crate) fn unheard_end_m_and_delay_s<const V: usize, const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &Neighbours<V>,
        progress_m: f32,
        now: Instant,
    ) -> (f32, u8) {
        let Some(plan) = scene.plan else { return (f32::NEG_INFINITY, 0) };
        let gates = plan.gates.get(self.open_gate_count..).unwrap_or_default();
        let (closed_m, delay_s) = neighbours.own_unheard_reach(gates, progress_m, now);
        (libm::fminf(closed_m, plan.path.length_m()), delay_s)
    }

    /// Greatest speed along the path, by the mission, the parameters and the autopilot, m/s.
    pub(crate) fn cruise_mps(&self) -> f32 {
        self.track.cruise_mps
    }

    /// Place along the plan's path up to which all gates are open, metres; −∞ on the way back, on a
    /// detour and without a path.
    pub(crate) fn gates_open_up_to_m<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> f32 {
        let Some(plan) = scene.plan.filter(|_| !self.returning && !scene.is_on_detour()) else {
            return f32::NEG_INFINITY;
        };
        let gate_m = plan.gates.get(self.open_gate_count).map_or(f32::INFINITY, |gate| gate.at_m);
        gate_m.min(plan.path.length_m())
    }

    /// When the reference last made progress: it advanced by 0.25 m along the path
    /// (`MIN_PROGRESS_M`), began to follow it, or moved in a descent.
    pub fn last_progress_at(&self) -> Instant {
        self.last_progress_at
    }

    /// Arc length reported to neighbours, for their gates, metres: before and in the climb minus
    /// the height still to climb, in the descent beyond the path's length. On one path it never
    /// falls, except while the vehicle flies back in `SwarmLinkLost`.
    pub fn reported_progress_m<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> f32 {
        self.measured_progress_m(state, scene).max(self.last_reported_progress_m)
    }

    /// Notes the progress that this vehicle reports. While the vehicle flies back in
    /// `SwarmLinkLost` its progress falls: no other vehicle has heard the higher one, and the way
    /// has to be flown again.
    pub(super) fn note_reported_progress<const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
    ) {
        self.last_reported_progress_m =
            match state == State::SwarmLinkLost && self.step_back_to_m.is_some() {
                true => self.measured_progress_m(state, scene),
                false => self.reported_progress_m(state, scene),
            };
    }

    /// Progress by the position estimate, metres, counted as [`Self::reported_progress_m`]; it may
    /// fall.
    pub(crate) fn measured_progress_m<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> f32 {
        let Some(plan) = scene.plan else { return 0.0 };
        let (path, z) = (&plan.path, scene.telemetry.position.z);
        let length_m = path.length_m();
        let end_z = path.point_at(length_m).map_or(0.0, |p| p.z);
        let start_z = path.point_at(0.0).map_or(0.0, |p| p.z);
        if state.has_landed() && self.is_reference_at_end_of(path) {
            return length_m + plan.descent_m + LANDED_EXTRA_PROGRESS_M;
        }
        match self.phase {
            Phase::Climb => -clamp_to(start_z - z, 0.0, plan.climb_m),
            Phase::Path | Phase::Descent
                if self.is_reference_at_end_of(path)
                    && (state == State::Land || self.phase == Phase::Descent) =>
            {
                length_m + clamp_to(end_z - z, 0.0, plan.descent_m)
            }
            _ if self.has_begun_path => {
                let lead_m = self.track.lead_max_m;
                let faster_mps =
                    libm::fmaxf(self.track.cruise_mps - WIDER_LAG_WINDOW_ABOVE_MPS, 0.0);
                let window_m = 2.0 * lead_m + EXTRA_LAG_WINDOW_S * faster_mps;
                let seen = path.project(
                    &scene.telemetry.position,
                    self.reference.along_m + lead_m - window_m,
                    window_m,
                );
                // Within `ARRIVED_WITHIN_M` of its reference the vehicle reports at least the
                // progress that gates ask of a vehicle that waits there.
                let at = path.point_at(self.reference.along_m);
                let arrived = at
                    .is_some_and(|at| (at - scene.telemetry.position).length() < ARRIVED_WITHIN_M);
                let least = if arrived {
                    self.reference.along_m - MAX_REPORTED_SHORTFALL_M
                } else {
                    f32::NEG_INFINITY
                };
                seen.max(least).min(self.reference.along_m)
            }
            _ => -plan.climb_m,
        }
    }

    /// Whether the reference has reached the end of a path that ends at the vehicle's goal: not
    /// aside, not back on the plan's path, not back at the path's start.
    pub fn is_reference_at_goal<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        !self.returning
            && !self.ends_away_from_goal
            && scene.plan.is_some_and(|plan| self.is_reference_at_end_of(&plan.path))
    }

    /// Whether the reference has reached the end of the path, wherever that leads.
    pub fn is_reference_at_end<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        scene.plan.is_some_and(|plan| self.is_reference_at_end_of(&plan.path))
    }

    /// Whether the reference has reached the end of this path; false before the path was begun.
    pub(super) fn is_reference_at_end_of<const W: usize>(&self, path: &Path<W>) -> bool {
        self.has_begun_path && self.reference.along_m >= path.length_m()
    }

    /// Height of the ground below the vehicle as far as the plan says, ENU up, metres: that of the
    /// pad before the path, that of the goal at its end, and between them the lowest that is known.
    // Not inlined: it has many callers, and in each it would take a board's flash.
    #[inline(never)]
    pub(crate) fn planned_ground_m<const W: usize, const G: usize>(
        &self,
        plan: &VehiclePlan<W, G>,
    ) -> f32 {
        match self.has_begun_path {
            true if self.is_reference_at_end_of(&plan.path) => planned_grounds_m(plan)[1],
            true => self.lowest_planned_ground_m(plan),
            false => planned_grounds_m(plan)[0],
        }
    }

    /// Height of the lowest ground between pads, ENU up, metres; ∞ if only that of pads is known.
    pub(crate) fn lowest_ground_m(&self) -> f32 {
        self.lowest_ground_m
    }

    /// Lowest height of the ground that the plan or the mission gives, ENU up, metres.
    pub(crate) fn lowest_planned_ground_m<const W: usize, const G: usize>(
        &self,
        plan: &VehiclePlan<W, G>,
    ) -> f32 {
        let [start_m, end_m] = planned_grounds_m(plan);
        start_m.min(end_m).min(self.lowest_ground_m)
    }

    /// Whether the climb is done: the setpoint stands at its top, and the vehicle is there.
    pub fn is_climb_done<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        let top = self.leg.as_ref().and_then(|leg| leg.waypoints().last());
        self.phase == Phase::Climb
            && self.is_leg_done()
            && top.is_some_and(|top| {
                let apart = self.smoother.position() - scene.telemetry.position;
                // Both setpoint and vehicle have to be at the top: a low climb must not count as
                // done while the vehicle is on its pad.
                (self.smoother.position().z - top.position.z).abs() < CLIMB_DONE_WITHIN_M
                    && self.is_setpoint_still_outside_descent()
                    && apart.length() < 2.0 * ARRIVED_WITHIN_M
                    && apart.z.abs() < CLIMB_DONE_WITHIN_M
            })
    }

    /// Whether the path and the guided descent are flown, so that the autopilot's landing takes
    /// over.
    pub fn is_path_and_descent_done<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
        now: Instant,
    ) -> bool {
        if self.is_algorithm2() {
            let stands = self.is_setpoint_still_outside_descent()
                && scene.telemetry.velocity.length() < AT_REST_MPS;
            return stands
                && self.has_begun_path
                && self.waypoints.is_completed()
                && !self.ends_away_from_goal;
        }
        let (Some(plan), Some(leg)) = (scene.plan, self.leg.as_ref()) else { return false };
        let Some(low) = leg.waypoints().last() else { return false };
        // The ground may be higher than the plan says, or the estimate too high. PX4 reports
        // contact only while the setpoint sinks, so a setpoint that stands at the planned ground
        // would wait for it forever.
        let low_m = self.smoother.position().z - low.position.z;
        let ended = low_m < DESCENT_DONE_WITHIN_M
            && self.is_setpoint_still()
            && now - self.last_progress_at >= LAND_MODE_AFTER_REST;
        self.phase == Phase::Descent
            && !self.climbing_back
            && self.is_leg_done()
            && (scene.telemetry.position.z - low.position.z < DESCENT_DONE_WITHIN_M
                || ended
                || self.guided_descent_depth_m(scene, plan.descent_m) == 0.0)
    }

    /// Whether the vehicle stands at the end of its path, and advice lets it begin its descent from
    /// there to the ground; the safety filter is not asked.
    pub(super) fn may_begin_descent<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        let Some(plan) = scene.plan else { return false };
        self.is_reference_at_end_of(&plan.path)
            && !self.is_algorithm2()
            && !self.ends_away_from_goal
            && self.is_setpoint_still_outside_descent()
            && plan.path.point_at(plan.path.length_m()).is_some_and(|end| {
                (end - scene.telemetry.position).length() < ARRIVED_WITHIN_M
                    && (end - self.smoother.position()).length() < ARRIVED_WITHIN_M
            })
            && scene.telemetry.velocity.length() < AT_REST_MPS
            && (self.advice.stop_within_m > plan.descent_m || self.returning)
    }

    /// Whether the vehicle is near enough to the path to resume it: in its descent it is in the
    /// column below the path's end; else the nearest point is less than `window_m` along the path
    /// from the reference, and the straight way there stays inside the clearance of the path's leg.
    pub fn is_near_path<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
        window_m: f32,
    ) -> bool {
        let Some(plan) = scene.plan else { return false };
        let position = &scene.telemetry.position;
        let along_m = plan.path.project(position, self.reference.along_m, window_m);
        if let (Phase::Descent, Some(last)) = (self.phase, plan.path.waypoints().last()) {
            let away = position - last.position;
            if (-plan.descent_m - ARRIVED_WITHIN_M..ARRIVED_WITHIN_M).contains(&away.z)
                && away.xy().length() < ARRIVED_WITHIN_M
            {
                return true;
            }
        }
        if (along_m - self.reference.along_m).abs() > window_m - WINDOW_EDGE_M {
            return false;
        }
        plan.path.point_at(along_m).is_some_and(|nearest| {
            (nearest - position).norm_squared() <= self.free_radius_sq_m2(&plan.path, along_m)
        })
    }

    /// Square of the distance from the path's point at `along_m` up to which the straight way to it
    /// is free of walls, m²: the hull fits where the vehicle is, and within the clearance c around
    /// that point. With d² ≤ c² − r² it then fits everywhere between both.
    fn free_radius_sq_m2<const W: usize>(&self, path: &Path<W>, along_m: f32) -> f32 {
        let mut waypoints = path.waypoints().iter();
        let leg = waypoints.find(|w| w.along_m >= along_m && w.along_m > 0.0);
        // A path back from before its first leg has one point.
        let leg = leg.or(path.waypoints().last());
        let (clearance_m, radius_m) = (leg.map_or(0.0, |w| w.leg_clearance_m), self.track.radius_m);
        clearance_m * clearance_m - radius_m * radius_m
    }

    /// Whether the vehicle may resume its take-off or climb: it is no farther beside its start than
    /// it may take off there, and not above the climb.
    pub fn is_near_start<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        let start = scene.plan.and_then(|plan| plan.path.waypoints().first());
        start.is_some_and(|start| {
            let away = scene.telemetry.position - start.position;
            away.z < ARRIVED_WITHIN_M && self.is_within_start_tolerance(&away)
        })
    }

    /// Whether a vehicle this far from its start is horizontally within the start tolerance plus
    /// [`ARRIVED_WITHIN_M`].
    fn is_within_start_tolerance(&self, away: &Point) -> bool {
        away.xy().length() < self.start_tolerance_m + ARRIVED_WITHIN_M
    }

    /// Where the straight leg by which the vehicle joins its path leads from `place`: to its place
    /// along the path, or first straight up, from above its pad or from the column in which it came
    /// down. `None` if the way to the path is not known to be free of walls; by Algorithm 2 the way
    /// is never checked.
    // Not inlined: it has two callers, and in each it would take a board's flash.
    #[inline(never)]
    pub(super) fn join_target<const W: usize>(
        &self,
        path: &Path<W>,
        place: Point,
    ) -> Option<Point> {
        let along_m = self.reference.along_m;
        let at = path.point_at(along_m)?;
        let away = place - at;
        let arrived_sq = ARRIVED_WITHIN_M * ARRIVED_WITHIN_M;
        let free_sq = self.free_radius_sq_m2(path, along_m).max(arrived_sq);
        if self.is_algorithm2() || away.norm_squared() <= free_sq {
            return Some(at);
        }
        let beside = away.xy().norm_squared() <= arrived_sq
            || (self.path_begins_above_pad
                && along_m <= 0.0
                && self.is_within_start_tolerance(&away));
        match beside && !self.lands_off_path && away.z < CLIMB_DONE_WITHIN_M {
            true if away.z < -CLIMB_DONE_WITHIN_M => Some(Point::new(place.x, place.y, at.z)),
            true => Some(at),
            false => None,
        }
    }

    /// Distance of the setpoint from its place along the path, metres; ∞ without a path.
    pub(crate) fn setpoint_off_path_m<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> f32 {
        let on = scene.plan.and_then(|plan| plan.path.point_at(self.setpoint_along_m));
        on.map_or(f32::INFINITY, |on| (on - self.smoother.position()).length())
    }

    /// Whether the straight way from the setpoint to its place along the path is known to be free
    /// of walls.
    pub(crate) fn can_join_path<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        let place = self.smoother.position();
        scene.plan.is_some_and(|plan| self.join_target(&plan.path, place).is_some())
    }

    /// Whether the vehicle is to join its path, but cannot.
    pub(crate) fn is_join_barred<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        self.phase == Phase::Join && self.leg.is_none() && !self.can_join_path(scene)
    }

    /// Whether the vehicle flies by Algorithm 2 as the paper prints it, without our tracker.
    pub(super) fn is_algorithm2(&self) -> bool {
        self.deconflict.method == Method::Algorithm2
    }

    /// Whether the vehicle descends from the end of its path, or will once others no longer rely on
    /// the hold that it has reported there.
    pub(crate) fn descends_or_will<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
        now: Instant,
    ) -> bool {
        self.is_in_descent() || (self.hold.is_binding(now) && self.may_begin_descent(scene))
    }

    /// Whether the vehicle is in the descent from the end of its path, or of a guided landing.
    pub(crate) fn is_in_descent(&self) -> bool {
        self.phase == Phase::Descent
    }
}

/// Heights of the ground below the two ends of the plan's path, ENU up, metres.
fn planned_grounds_m<const W: usize, const G: usize>(plan: &VehiclePlan<W, G>) -> [f32; 2] {
    let below = |along_m: f32, by_m: f32| plan.path.point_at(along_m).map(|p| p.z - by_m);
    let start_m = below(0.0, plan.climb_m).unwrap_or(0.0);
    [start_m, below(plan.path.length_m(), plan.descent_m).unwrap_or(start_m)]
}
