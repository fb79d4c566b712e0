//! One step of the safety filter: this vehicle's way ahead, compared with all neighbours.

use planner_core::Point;
use planner_core::flight::{Path, VehiclePlan};
use planner_core::track::deconflict::Method;
use planner_core::track::safety::{Legs, OwnSet, REACTION_S, ReachableSet};

use super::super::motion::clamp_to;
use super::super::{Guidance, GuidanceInputs};
use super::{
    AT_ADVISED_STOP_M, FilterConflict, FlightDirection, MAX_GROUND_BELOW_PAD_M,
    MAX_LAG_WHEN_TURNING_M, MAX_SETPOINT_WHEN_TURNING_MPS, PASS_STRANGER_AFTER, RESUME_CLEAR_FOR,
    RESUME_CLEAR_M, SafetyFilter,
};
use crate::config::limits::{Urgency, neighbour_motion_bounds};
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::Instant;

impl Guidance {
    /// Runs the filter for one step: compares the way ahead with all neighbours, and decides
    /// whether the vehicle is stopped. To be called before the reference moves.
    pub(in crate::guidance) fn step_filter<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) {
        let priority = self.deconflict.method == Method::Priority;
        let Some(plan) = scene.plan.filter(|_| priority) else {
            self.filter = SafetyFilter { column_clear: true, ..SafetyFilter::default() };
            return;
        };
        let position = &scene.telemetry.position;
        let ground_m = || self.lowest_possible_ground_m(state, scene, plan);
        let top_m = || plan.path.point_at(0.0).map_or(position.z, |p| p.z);
        let on_pad = state == State::Scheduled || state.prepares_take_off();
        let whole_column = on_pad || state.lands_or_landing_is_held();
        let way = match state {
            _ if on_pad => FlightDirection::Vertical { to_m: top_m(), speed_mps: 0.0 },
            _ if state.lands_or_landing_is_held() => {
                FlightDirection::Vertical { to_m: ground_m(), speed_mps: 0.0 }
            }
            State::Climb => FlightDirection::Vertical {
                to_m: top_m(),
                speed_mps: self.smoother.velocity().z.max(0.0),
            },
            _ if state.is_on_path_or_stopping() && self.has_begun_path => {
                // While the vehicle stands in its descent, the filter goes on checking the column
                // below it for the neighbour that stopped it.
                match self.is_in_descent() {
                    true => FlightDirection::Vertical {
                        to_m: ground_m(),
                        speed_mps: (-self.smoother.velocity().z).max(0.0),
                    },
                    false if self.is_flying_back(&plan.path) => FlightDirection::Back,
                    false => FlightDirection::Ahead,
                }
            }
            _ => FlightDirection::Stands,
        };
        if !whole_column {
            (self.filter.column_clear, self.filter.column_clear_changed_at) = (true, None);
            self.filter.column_blocked_for_good_since = None;
            self.filter.column_wait_since =
                self.filter.column_wait_since.filter(|_| state == State::Replanning);
        }
        if matches!(way, FlightDirection::Stands) {
            self.filter.reset();
            return;
        }
        let back = way == FlightDirection::Back;
        if back != self.filter.scanned_backwards {
            self.filter.reset_stop();
            self.filter.scanned_backwards = back;
        }
        let stopped = self.filter.is_stopped();
        let extra_m = if stopped { RESUME_CLEAR_M } else { 0.0 };
        let bounds = neighbour_motion_bounds(&self.track, self.fastest_vehicle_mps);
        let mut set;
        match way {
            FlightDirection::Vertical { to_m, .. } if whole_column => {
                set = ReachableSet::vertical(*position, to_m);
            }
            FlightDirection::Vertical { to_m, speed_mps } => {
                let speed_mps = if stopped { 0.0 } else { speed_mps };
                let stop_m =
                    if stopped { 0.0 } else { self.smoother.stop_distance_m(Urgency::Urgent) };
                let braking_m = bounds.braking.stop_distance_m(speed_mps).max(stop_m);
                let fly_m = speed_mps * REACTION_S + braking_m + extra_m;
                let down = to_m < position.z;
                let reference_m = self.smoother.position().z;
                let end_m = if down {
                    (reference_m - fly_m).max(to_m).min(reference_m)
                } else {
                    (reference_m + fly_m).min(to_m).max(reference_m)
                };
                let here = Point::new(position.x, position.y, reference_m);
                set = ReachableSet::vertical(here, end_m);
            }
            FlightDirection::Ahead | FlightDirection::Back => {
                set = ReachableSet::at(self.smoother.position());
                let further = (extra_m, way);
                self.extend_own_set(&mut set, &plan.path, scene.telemetry, &bounds, further);
            }
            FlightDirection::Stands => return,
        }
        let mut legs = Legs::new();
        let mut own = OwnSet::new(&set, &mut legs);
        own.touching_m = 2.0 * self.track.radius_m;
        let mut found = self.first_conflict(state, scene, neighbours, &own, &bounds, now);
        if found.is_none() && on_pad {
            // PX4 disarms within seconds on the ground. So a vehicle does not arm beside one that
            // may just have fallen silent, whose set would soon bar the climb.
            let apart_m = self.deconflict.safety_distance_m
                + bounds.speed_max_mps * bounds.stopped_when_unheard_for_s;
            let missed = neighbours.missed_vehicle_beside(position, apart_m, now);
            found = missed.map(|id| FilterConflict {
                id,
                own_yields: true,
                stranger: false,
                is_grounded_or_lost: false,
            });
        }
        if whole_column {
            self.filter.update_column(found.as_ref(), now);
            self.filter.reset_stop();
            self.filter.blocker_id = found.map_or(0, |found| found.id);
            return;
        }
        self.filter.sets_conflict = found.is_some();
        match found {
            Some(found) => {
                if !stopped {
                    self.filter.stopped_since = Some(now);
                    self.filter.stop_count = self.filter.stop_count.wrapping_add(1);
                }
                self.filter.path_clear_since = None;
                self.filter.yields_to_blocker = found.own_yields;
                // A stranger counts as a hindrance only once this vehicle flies slowly past it,
                // where it bars even that.
                if !found.stranger || self.filter.passes_stranger(now) {
                    self.filter.note_hindered(now);
                }
                if neighbours.comes_down_unheard(found.id, now) {
                    self.filter.blocked_by_unheard_descent_at = now;
                }
                self.filter.blocker_id = found.id;
                (self.filter.blocker_is_stranger, self.filter.blocker_is_grounded_or_lost) =
                    (found.stranger, found.is_grounded_or_lost);
            }
            None if stopped => {
                let since = *self.filter.path_clear_since.get_or_insert(now);
                // The vehicle flies slowly past a stranger, which the roster does not name, until
                // the path has been free for `PASS_STRANGER_AFTER`.
                let clear_for = if self.filter.passes_stranger(now) {
                    PASS_STRANGER_AFTER
                } else {
                    RESUME_CLEAR_FOR
                };
                if now - since >= clear_for {
                    self.filter.reset_stop();
                }
            }
            None => self.note_hindered_by_advice(state, scene, neighbours, now),
        }
    }

    /// Least height that the ground below the vehicle may have, ENU up, metres; never above the
    /// vehicle.
    pub(super) fn lowest_possible_ground_m<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        plan: &VehiclePlan<W, G>,
    ) -> f32 {
        let z_m = scene.telemetry.position.z;
        let mut ground_m = self.planned_ground_m(plan).min(z_m);
        if self.returning && scene.is_on_detour() {
            // The way back along a detour ends in the air where the detour began: the ground there
            // counts as no higher than the climb's height below that.
            ground_m = plan
                .path
                .point_at(0.0)
                .map_or(ground_m, |from| ground_m.min(from.z - plan.climb_m));
        }
        // A landing between pad and goal may end on ground that is lower than at either.
        let lands = state.lands_or_landing_is_held();
        let between = lands && self.has_begun_path && !self.is_reference_at_end_of(&plan.path);
        if between { ground_m - MAX_GROUND_BELOW_PAD_M } else { ground_m }
    }

    /// Whether the vehicle flies back along its path, or stands and is about to; false as long as
    /// the setpoint is still to fly forward to the reference.
    fn is_flying_back<const W: usize>(&self, path: &Path<W>) -> bool {
        if self.reference.along_m > self.setpoint_along_m + MAX_LAG_WHEN_TURNING_M {
            return false;
        }
        let velocity = self.smoother.velocity();
        if velocity.norm_squared() > MAX_SETPOINT_WHEN_TURNING_MPS * MAX_SETPOINT_WHEN_TURNING_MPS {
            let beside = |by_m: f32| {
                path.point_at(clamp_to(self.setpoint_along_m + by_m, 0.0, path.length_m()))
            };
            let onward = match (beside(-MAX_LAG_WHEN_TURNING_M), beside(MAX_LAG_WHEN_TURNING_M)) {
                (Some(from), Some(to)) => velocity.dot(&(to - from)),
                _ => 0.0,
            };
            if onward != 0.0 {
                return onward < 0.0;
            }
        }
        self.reference.speed_mps < 0.0 || self.step_back_to_m.is_some()
    }

    /// Counts a stop by advice as a hindrance by the filter if the vehicle is at that stop, and no
    /// gate there makes it wait for the neighbour for which advice stops it.
    fn note_hindered_by_advice<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) {
        let id = self.advice.waiting_for_id;
        let along_m = self.reference.along_m;
        let gate = |plan: &VehiclePlan<W, G>| {
            let near = |at_m: f32| {
                (along_m - AT_ADVISED_STOP_M..along_m + AT_ADVISED_STOP_M).contains(&at_m)
            };
            plan.gates.iter().any(|gate| gate.wait_for_id == id && near(gate.at_m))
        };
        if state.follows_path_or_is_blocked()
            && id != 0
            && self.advice.stop_within_m.min(self.stop_ahead_m) < AT_ADVISED_STOP_M
            && !scene.plan.is_some_and(gate)
        {
            (self.filter.yields_to_blocker, self.filter.blocker_is_grounded_or_lost) =
                (id < scene.id, neighbours.is_landed_or_out(id, now));
            self.filter.note_hindered(now);
        }
    }
}
