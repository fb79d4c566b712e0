//! The next raw point: along the path, or along the straight leg of a climb, a join or a descent.

use planner_core::flight::{Path, VehiclePlan};
use planner_core::track::deconflict::Advice;
use planner_core::track::{self, Reference, ReferenceState};
use planner_core::{Length, Point};

use super::smoother::TICK_S;
use super::{
    DESCENT_DONE_WITHIN_M, FENCE_HALVINGS, FENCE_MARGIN_M, GUIDED_LANDING_STALL_TIMEOUT, Guidance,
    GuidanceInputs, MAX_LEG_LEAD_M, MIN_LEG_M, Phase, REFERENCE_RESET_WINDOW_M, TOUCHDOWN_MPS,
};
use crate::autopilot::AutopilotKind;
use crate::config::limits::MIN_LEG_SPEED_LIMIT_MPS;
use crate::guidance::evade::{self, StepBack};
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::Instant;

impl Guidance {
    /// Advances the raw point by a tick, and the phase if the present one is done. Notes
    /// whether a step back from below a vehicle that descends was barred.
    #[expect(clippy::too_many_arguments, reason = "what a step knows")]
    pub(super) fn next_raw_point<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        plan: &VehiclePlan<W, G>,
        advice: &Advice,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        step_back: &mut StepBack,
    ) -> Point {
        let path = &plan.path;
        let raw = self.smoother.raw_point();
        if core::mem::replace(&mut self.raw_point_at_setpoint, false) && self.phase == Phase::Path {
            (self.phase, self.leg) = (Phase::Join, None);
        }
        if self.phase == Phase::Climb && state != State::Climb && self.is_leg_done() {
            (self.phase, self.leg) = (Phase::Join, None);
        }
        if self.phase == Phase::Path && state == State::Follow && self.may_begin_descent(scene) {
            (self.phase, self.leg) = (Phase::Descent, None);
            self.last_progress_at = now;
        }
        let target = match self.phase {
            Phase::Hold => return raw,
            Phase::Climb => path.point_at(0.0).map(|start| Point::new(raw.x, raw.y, start.z)),
            // Without a free way the setpoint stays where it is.
            Phase::Join if self.leg.is_none() => self.join_target(path, raw),
            Phase::Join => path.point_at(self.reference.along_m),
            Phase::Descent => path.point_at(path.length_m()).map(|end| {
                let down_m = if self.climbing_back {
                    0.0
                } else {
                    self.guided_descent_depth_m(scene, plan.descent_m)
                };
                let led_m = self.planned_ground_m(plan) + self.guided_descent_end_height_m(scene);
                let to_m =
                    if self.guides_landing { libm::fminf(led_m, raw.z) } else { end.z - down_m };
                Point::new(raw.x, raw.y, to_m)
            }),
            Phase::Path if self.is_algorithm2() => {
                return self
                    .next_raw_point_to_waypoint(path, &scene.telemetry.position, advice)
                    .unwrap_or(raw);
            }
            Phase::Path => {
                return self
                    .next_raw_point_on_path(path, advice, neighbours, now, step_back)
                    .unwrap_or(raw);
            }
        };
        let Some(target) = target else { return raw };
        if self.leg.is_none() {
            let mut leg = Path::new();
            // Two points fit.
            let _ = leg.push(raw, f32::INFINITY.min(self.track.lead_max_m));
            let _ = leg.push(target, f32::INFINITY.min(self.track.lead_max_m));
            (self.leg, self.leg_reference) = (Some(leg), ReferenceState::default());
        }
        let Some(leg) = &self.leg else { return raw };
        let advice = Advice { speed_scale: self.descent_speed_share(plan, leg), ..Advice::FREE };
        let before_m = self.leg_reference.along_m;
        let reference =
            track::advance(&self.leg_track, leg, &mut self.leg_reference, &advice, TICK_S);
        self.max_lead_m = MAX_LEG_LEAD_M;
        if self.phase == Phase::Descent && self.leg_reference.along_m > before_m {
            self.last_progress_at = now;
        }
        if self.phase == Phase::Join && (leg.length_m() < MIN_LEG_M || self.is_leg_done()) {
            // A leg back up a descent may end beside the path: another leg joins it.
            let beside_m = (target - raw).length();
            let joined = beside_m < MIN_LEG_M + MIN_LEG_SPEED_LIMIT_MPS * TICK_S;
            (self.phase, self.leg) = (if joined { Phase::Path } else { Phase::Join }, None);
        }
        reference.map_or(raw, |reference| reference.position)
    }

    /// The next raw point of a stop: it brakes along the path or leg, since a stop from high speed
    /// is longer than the raw steps that the smoother's averages still hold.
    pub(super) fn next_braked_raw_point<const W: usize>(&mut self, path: &Path<W>) -> Point {
        let stop = Advice { speed_scale: 0.0, stop_within_m: 0.0, waiting_for_id: 0 };
        let reference = match (self.phase, &self.leg) {
            (Phase::Path, None) => {
                track::advance(&self.track, path, &mut self.reference, &stop, TICK_S)
            }
            (Phase::Path | Phase::Climb | Phase::Join | Phase::Descent, Some(leg)) => {
                track::advance(&self.leg_track, leg, &mut self.leg_reference, &stop, TICK_S)
            }
            _ => None,
        };
        reference.map_or(self.smoother.raw_point(), |reference| reference.position)
    }

    /// The next raw point on the path: forward, or back from below a vehicle that descends.
    pub(super) fn next_raw_point_on_path<const V: usize, const W: usize>(
        &mut self,
        path: &Path<W>,
        advice: &Advice,
        neighbours: &mut Neighbours<V>,
        now: Instant,
        step_back: &mut StepBack,
    ) -> Option<Point> {
        let mut advice = *advice;
        if let Some(to_m) = self.step_back_to_m {
            let safety_m = self.deconflict.safety_distance_m;
            let near = neighbours.states_with_age(now);
            // The reference steps back only if the filter has checked the path backwards and found
            // it free.
            let free = self.filter.scans_backwards() && !self.filter.is_stopped();
            if !free {
                advice.stop_within_m = 0.0;
            } else if let Some(place) =
                evade::step_back(path, &mut self.reference, to_m, near, safety_m, TICK_S)
            {
                return Some(place);
            } else {
                *step_back = StepBack::Barred;
                advice.stop_within_m = 0.0;
            }
        }
        // Where the path leaves the geofence, the raw point stops before the fence.
        let speed = self.reference.speed_mps.max(0.0);
        let accel = self.track.accel_mps2.min(self.track.accel_z_mps2);
        let braking_m = speed * speed / (2.0 * accel) + 2.0 * speed * TICK_S + FENCE_MARGIN_M;
        let allowed = |by_m: f32| {
            let ahead = path.point_at(self.reference.along_m + by_m);
            ahead.is_none_or(|ahead| self.smoother.is_within_fence_slack(&ahead))
        };
        let (mut inside_m, mut outside_m) = (0.0, braking_m + FENCE_MARGIN_M);
        if !allowed(outside_m) {
            for _ in 0..FENCE_HALVINGS {
                let middle_m = 0.5 * (inside_m + outside_m);
                *if allowed(middle_m) { &mut inside_m } else { &mut outside_m } = middle_m;
            }
            advice.stop_within_m = advice.stop_within_m.min(inside_m - FENCE_MARGIN_M);
            self.stopped_at_fence = true;
        }
        let Reference { position, lead_limit_m: lead_m, .. } =
            track::advance(&self.track, path, &mut self.reference, &advice, TICK_S)?;
        self.max_lead_m = lead_m;
        Some(position)
    }

    /// The next raw point by Algorithm 2: straight to the current waypoint, at the advised speed.
    pub(super) fn next_raw_point_to_waypoint<const W: usize>(
        &mut self,
        path: &Path<W>,
        position: &Point,
        advice: &Advice,
    ) -> Option<Point> {
        let (raw, before) = (self.smoother.raw_point(), self.waypoints);
        let target = self.waypoints.update_current_waypoint(path, position);
        let mut advice = *advice;
        match target {
            None => advice.speed_scale = 0.0,
            Some(target) if self.leg.is_none() || self.waypoints != before => {
                let mut leg = Path::new();
                // Two points fit.
                let _ = leg.push(raw, self.track.lead_max_m);
                let _ = leg.push(target, self.track.lead_max_m);
                let course = |leg: &Path<2>| match leg.waypoints() {
                    [from, to] => (to.position - from.position) / (to.along_m - from.along_m),
                    _ => Point::zeros(),
                };
                // The component of the old leg's velocity along the new leg is kept.
                let kept =
                    self.leg.as_ref().map_or(0.0, |old| course(old).dot(&course(&leg)).max(0.0));
                let speed_mps = self.leg_reference.speed_mps * kept;
                (self.leg, self.leg_reference) =
                    (Some(leg), ReferenceState { along_m: 0.0, speed_mps });
            }
            Some(_) => {}
        }
        let leg = self.leg.as_ref()?;
        let speed = self.leg_reference.speed_mps.max(0.0);
        let braking_m = speed * speed / (2.0 * self.track.accel_z_mps2.min(self.track.accel_mps2));
        let ahead_m = self.leg_reference.along_m + braking_m + 2.0 * speed * TICK_S + MIN_LEG_M;
        if leg.point_at(ahead_m).is_some_and(|ahead| !self.smoother.is_within_fence_slack(&ahead)) {
            advice.stop_within_m = braking_m;
            self.stopped_at_fence = true;
        }
        let reference = track::advance(&self.track, leg, &mut self.leg_reference, &advice, TICK_S)?;
        self.max_lead_m = MAX_LEG_LEAD_M;
        self.reference.speed_mps = self.leg_reference.speed_mps;
        let length_m = path.length_m();
        self.reference.along_m = if self.waypoints.is_completed() {
            length_m
        } else {
            let seen_m =
                path.project(&reference.position, self.reference.along_m, REFERENCE_RESET_WINDOW_M);
            seen_m.max(self.reference.along_m).min((length_m - MIN_LEG_M).max(0.0))
        };
        Some(reference.position)
    }

    /// Whether the raw point has reached the end of its straight leg: of a climb, a join or a
    /// descent.
    pub(super) fn is_leg_done(&self) -> bool {
        self.leg.as_ref().is_some_and(|leg| self.leg_reference.along_m >= leg.length_m())
    }

    /// Depth below the end of the path to which setpoints lead the descent, metres: to the ground
    /// for PX4, else down to `final_descent_height_m` above it. There the autopilot's landing takes
    /// over, in which the wind may carry the vehicle off.
    pub(super) fn guided_descent_depth_m<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
        descent_m: f32,
    ) -> f32 {
        libm::fmaxf(descent_m - self.guided_descent_end_height_m(scene), 0.0)
    }

    /// Height above the ground at which setpoints end their descent, metres: 0 for PX4.
    fn guided_descent_end_height_m<const W: usize, const G: usize>(
        &self,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> f32 {
        if scene.telemetry.kind == Some(AutopilotKind::Px4) {
            0.0
        } else {
            self.final_descent_height_m
        }
    }

    /// Whether setpoints lead the landing down in this step: once the setpoint stands, and while no
    /// other vehicle may be in the column. Ends the guided landing at its lower end, or after 4 s
    /// without progress.
    pub(super) fn update_guided_landing<const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        now: Instant,
    ) -> bool {
        if !self.guides_landing || state != State::Land {
            return false;
        }
        if self.phase != Phase::Descent && self.raw_point_at_setpoint {
            (self.phase, self.leg) = (Phase::Descent, None);
        }
        let down = |leg: &Path<2>| {
            let low = leg.waypoints().last();
            self.is_leg_done()
                && low.is_some_and(|low| {
                    scene.telemetry.position.z - low.position.z < DESCENT_DONE_WITHIN_M
                })
        };
        let ended = self.phase == Phase::Descent && self.leg.as_ref().is_some_and(down);
        self.guides_landing = !ended && now - self.last_progress_at < GUIDED_LANDING_STALL_TIMEOUT;
        self.guides_landing && self.phase == Phase::Descent && self.filter.column_clear()
    }

    /// Share of the leg's speed for a descent, such that it is no faster than [`TOUCHDOWN_MPS`]
    /// from `final_descent_height_m` above the ground on: within that margin to walls the real
    /// ground may already lie.
    fn descent_speed_share<const W: usize, const G: usize>(
        &self,
        plan: &VehiclePlan<W, G>,
        leg: &Path<2>,
    ) -> f32 {
        let (true, Some(top)) =
            (self.phase == Phase::Descent && !self.climbing_back, leg.waypoints().first())
        else {
            return 1.0;
        };
        let over_m = top.position.z
            - self.leg_reference.along_m
            - (self.planned_ground_m(plan) + self.final_descent_height_m);
        let most_mps = fpu::sqrtf(
            TOUCHDOWN_MPS * TOUCHDOWN_MPS
                + 2.0 * self.leg_track.accel_z_mps2 * libm::fmaxf(over_m, 0.0),
        );
        // The leg's speed is the lower of these two limits.
        most_mps / libm::fminf(self.leg_track.cruise_mps, self.leg_track.descend_mps)
    }
}
