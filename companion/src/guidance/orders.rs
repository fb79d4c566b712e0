//! Commands of the mission to guidance: hold, begin the climb or a path, resume or reverse the
//! path, lead a landing down.

use super::acknowledged_path::AcknowledgedPath;
use super::nearest::nearest_arc_length_m;
use super::phase::Phase;
use super::smoother::TICK_S;
use super::waypoints::Algorithm2Waypoints;
use super::{
    ARRIVED_WITHIN_M, Guidance, REJOIN_WINDOW_M, SETPOINT_AT_REFERENCE_M, STANDING_SETPOINT_MPS,
};
use crate::config::limits::Urgency;
use crate::time::Instant;
use planner_core::Point;
use planner_core::flight::{Path, VehiclePlan};
use planner_core::track::{self, ReferenceState};

impl Guidance {
    /// Holds from now on: where the setpoint comes to a stop; at `point` where there is no
    /// setpoint, or the position was lost.
    pub fn stop_and_hold(&mut self, point: Point) {
        // After a lost position the setpoint begins where the vehicle is.
        let lost = core::mem::take(&mut self.position_was_lost) && self.since_sent_s > 0.0;
        if lost || !self.smoother.has_setpoint() {
            self.smoother.resume_at(point, self.since_sent_s);
            self.forget_leg();
        }
    }

    /// Holds where the pilot left the vehicle, until the mission resumes; the place along the path
    /// where the flight was interrupted is kept. If the pilot flew the vehicle away from the end of
    /// its path, it is no longer at the end: the ground below it is not that of the goal.
    pub fn hold_after_pilot<const W: usize, const G: usize>(
        &mut self,
        point: Point,
        plan: Option<&VehiclePlan<W, G>>,
    ) {
        self.stop_and_hold(point);
        self.forget_leg();
        let Some(path) = plan.map(|plan| &plan.path) else { return };
        let away =
            |end: Point| (end - point).xy().norm_squared() > ARRIVED_WITHIN_M * ARRIVED_WITHIN_M;
        if self.is_reference_at_end_of(path) && path.point_at(path.length_m()).is_some_and(away) {
            self.reference.along_m = path.length_m() - ARRIVED_WITHIN_M;
            self.setpoint_along_m = self.reference.along_m;
        }
    }

    /// Begins the climb, straight up from the setpoint, or from `position` where there is no
    /// setpoint.
    pub fn begin_climb(&mut self, position: &Point) {
        self.reset();
        self.path_begins_above_pad = true;
        self.phase = Phase::Climb;
        if !self.smoother.has_setpoint() {
            self.smoother.begin_at(*position, self.since_sent_s);
        }
    }

    /// Puts the flight on its path: the reference advances from the arc length that it has.
    pub fn start_following(&mut self, now: Instant) {
        (self.has_begun_path, self.lands_off_path) = (true, false);
        self.evade_search.reset();
        self.acknowledged_path.start_following(now);
        self.last_progress_m = self.reference.along_m;
        self.last_progress_at = now;
    }

    /// Begins another path at its start; the setpoint stands there, or near it.
    pub fn begin_path(&mut self, now: Instant) {
        // If the reference has not moved along the path before, this path begins at the same place
        // as that one.
        self.path_begins_above_pad &= self.reference.along_m <= 0.0;
        (self.reference, self.setpoint_along_m) = (ReferenceState::default(), 0.0);
        self.phase = Phase::Path;
        self.leg = None;
        self.waypoints = Algorithm2Waypoints::default();
        self.ends_away_from_goal = false;
        self.guides_landing = false;
        (self.last_reported_progress_m, self.brakes_to_m) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
        self.open_gate_count = 0;
        self.acknowledged_path = AcknowledgedPath::of_new_path(now);
        // What hindered the vehicle on the other path does not count on this one.
        self.filter.reset();
        self.start_following(now);
    }

    /// Notes that the path just begun ends aside or back on the plan's path: no descent begins at
    /// its end.
    pub(crate) fn note_end_away_from_goal(&mut self) {
        self.ends_away_from_goal = true;
    }

    /// Sets the share of the nominal speed that the error bound of the position estimate allows; 0
    /// stops. Returns the share before.
    pub(crate) fn set_estimate_speed_share(&mut self, share: f32) -> f32 {
        core::mem::replace(&mut self.estimate_speed_share, share)
    }

    /// Whether the hold has begun or ended since the last call.
    pub(crate) fn take_hold_changed(&mut self) -> bool {
        core::mem::take(&mut self.hold_changed)
    }

    /// Notes that an intent was sent, one of `report_hz` each second: it reports the hold, if there
    /// is one.
    pub(crate) fn note_intent_sent(&mut self, now: Instant, report_hz: u8) {
        if self.hold.is_reported() {
            self.hold.note_reported(now, report_hz);
        }
    }

    /// Begins another path, at the place `along_m` metres along it; the setpoint stands there.
    pub(crate) fn begin_path_at(&mut self, along_m: f32, now: Instant) {
        self.begin_path(now);
        (self.reference.along_m, self.setpoint_along_m) = (along_m, along_m);
        self.last_progress_m = along_m;
    }

    /// Sets the place along the path where the vehicle is to hold, metres; ∞ for none.
    pub(crate) fn set_division_hold_m(&mut self, along_m: f32) {
        self.division_hold_m = along_m;
    }

    /// Place along the path where the vehicle is to hold for a division, metres; ∞ for none.
    pub(crate) fn division_hold_m(&self) -> f32 {
        self.division_hold_m
    }

    /// Whether the raw point was set back to where the setpoint stands. Only then may another path
    /// begin, even one that starts a little away from it.
    pub(crate) fn is_raw_point_at_setpoint(&self) -> bool {
        self.raw_point_at_setpoint
    }

    /// Position of the setpoint, ENU metres.
    pub(crate) fn setpoint_position(&self) -> Point {
        self.smoother.position()
    }

    /// Whether the setpoint has reached the reference, at which a path aside begins: a setpoint
    /// that was stopped short of the reference would first have to fly on.
    pub(crate) fn is_setpoint_at_reference(&self) -> bool {
        libm::fabsf(self.reference.along_m - self.setpoint_along_m) < SETPOINT_AT_REFERENCE_M
    }

    /// Whether the setpoint stands, in a descent too.
    pub(crate) fn is_setpoint_still(&self) -> bool {
        self.smoother.velocity().norm_squared() < STANDING_SETPOINT_MPS * STANDING_SETPOINT_MPS
    }

    /// Whether the setpoint stands, outside a descent.
    pub fn is_setpoint_still_outside_descent(&self) -> bool {
        self.is_setpoint_still() && self.phase != Phase::Descent
    }

    /// Whether the setpoint stands because its path leaves the geofence ahead.
    pub fn is_standing_at_fence(&self) -> bool {
        self.stopped_at_fence && self.is_setpoint_still_outside_descent()
    }

    /// Nearest place along `path`, the path that is flown, at which the vehicle could stop now,
    /// metres: both the reference and the setpoint behind it have to brake.
    pub(crate) fn stopping_point_m<const W: usize>(&self, path: &Path<W>) -> f32 {
        let braking_m = track::braking_distance_m(&self.track, path, &self.reference);
        let setpoint_braking_m = self.smoother.stop_distance_m(Urgency::Smooth);
        (self.reference.along_m + braking_m).max(self.setpoint_along_m + setpoint_braking_m)
    }

    /// Where along its path the reference could have stopped in the last step, metres.
    pub(crate) fn braking_end_m(&self) -> f32 {
        self.brakes_to_m.max(self.reference.along_m)
    }

    /// Begins a landing that setpoints lead straight down from where the setpoint stands, to the
    /// height at which the autopilot's landing takes over.
    pub(crate) fn begin_guided_landing(&mut self, now: Instant) {
        self.cancel_evasion();
        (self.guides_landing, self.last_progress_at) = (true, now);
    }

    /// Holds as [`Self::stop_and_hold`] for a landing that does not begin on the path: no straight
    /// way from there to the path is known to be free of walls.
    pub(crate) fn hold_off_path(&mut self, point: Point) {
        self.stop_and_hold(point);
        self.lands_off_path = true;
    }

    /// Whether setpoints lead a landing.
    pub(crate) fn is_guiding_landing(&self) -> bool {
        self.guides_landing
    }

    /// Leaves the landing to the autopilot.
    pub(crate) fn end_guided_landing(&mut self) {
        self.guides_landing = false;
    }

    /// Resumes the climb after an interruption, from the setpoint, or from the vehicle where there
    /// is none.
    pub fn resume_climb(&mut self, position: &Point, now: Instant) {
        self.stop_and_hold(*position);
        self.followed_or_advanced_at = now;
        self.phase = Phase::Climb;
    }

    /// Resumes the flight after an interruption, from the setpoint, or from the vehicle where there
    /// is none: down its descent, or on from the nearest point of the path.
    pub fn resume_flight<const W: usize, const G: usize>(
        &mut self,
        plan: &VehiclePlan<W, G>,
        position: &Point,
        now: Instant,
    ) {
        self.stop_and_hold(*position);
        self.followed_or_advanced_at = now;
        let (path, place) = (&plan.path, self.smoother.position());
        let below = path.point_at(path.length_m()).is_some_and(|end| {
            end.z > place.z
                && (end - place).xy().norm_squared() < ARRIVED_WITHIN_M * ARRIVED_WITHIN_M
        });
        if self.raw_point_at_setpoint && !(self.phase == Phase::Descent && below) {
            self.phase = Phase::Path;
            let along_m = self.reference.along_m;
            self.reference.along_m = nearest_arc_length_m(path, &place, along_m, REJOIN_WINDOW_M);
            if self.join_target(path, place).is_none() {
                // The nearest point cannot be joined: the vehicle was on its way, from its pad or
                // back up its column, to the place where the reference was before.
                self.reference.along_m = along_m;
            }
            self.setpoint_along_m = self.reference.along_m;
        }
        self.start_following(now);
    }

    /// Replaces `path`, the path that is flown, by the way back to its first point, each leg with
    /// its clearance. The raw point may still move forward: the new path begins where it can have
    /// braked, and the raw point at first moves backwards on the new path.
    pub fn reverse_path<const W: usize>(&mut self, path: &mut Path<W>, now: Instant) {
        let speed = self.reference.speed_mps.max(0.0);
        let accel = self.track.accel_mps2.min(self.track.accel_z_mps2);
        let braking_m = speed * speed / (2.0 * accel) + speed * TICK_S;
        let from_m = (self.reference.along_m + braking_m).min(path.length_m());
        let mut back = Path::new();
        let ahead = path.waypoints().iter().find(|w| w.along_m >= from_m);
        let mut clearance_m = ahead.map_or(0.0, |w| w.leg_clearance_m);
        if let Some(turn) = path.point_at(from_m) {
            // `path` had as many points: `turn` takes the place of at least one waypoint ahead.
            let _ = back.push(turn, clearance_m);
        }
        for waypoint in path.waypoints().iter().rev().filter(|w| w.along_m < from_m) {
            let _ = back.push(waypoint.position, clearance_m);
            clearance_m = waypoint.leg_clearance_m;
        }
        let reference = ReferenceState {
            along_m: from_m - self.reference.along_m,
            speed_mps: -self.reference.speed_mps,
        };
        let (phase, leg) = (self.phase, self.leg.take());
        *path = back;
        self.begin_path(now);
        (self.reference, self.setpoint_along_m) = (reference, reference.along_m);
        self.returning = true;
        match phase {
            Phase::Climb | Phase::Join => (self.phase, self.leg) = (phase, leg),
            Phase::Descent => {
                // Back up the leg of the descent: what the setpoint still sinks while it brakes is
                // flown backwards on the new leg.
                if let (Some(leg), false) = (leg, self.raw_point_at_setpoint) {
                    let mut up = Path::new();
                    let ends = (leg.waypoints().last(), leg.waypoints().first());
                    for end in [ends.0, ends.1].into_iter().flatten() {
                        let _ = up.push(end.position, end.leg_clearance_m);
                    }
                    self.leg_reference.along_m = leg.length_m() - self.leg_reference.along_m;
                    self.leg_reference.speed_mps = -self.leg_reference.speed_mps;
                    (self.phase, self.leg) = (Phase::Join, Some(up));
                }
            }
            Phase::Hold | Phase::Path => {}
        }
    }

    /// Forgets the straight leg, and stops the reference: the raw point is where the setpoint
    /// stands, and the next leg begins there.
    pub(super) fn forget_leg(&mut self) {
        self.raw_point_at_setpoint = true;
        self.leg = None;
        self.leg_reference = ReferenceState::default();
        self.reference.speed_mps = 0.0;
    }
}
