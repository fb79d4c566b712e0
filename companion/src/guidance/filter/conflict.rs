//! Which neighbour's reachable set conflicts with that of this vehicle, and which of the two goes
//! first.

use planner_core::flight::{Path, VehiclePlan};
use planner_core::track::safety::{self, MotionBounds, OwnSet, REACTION_S, ReachableSet};
use planner_core::{Length, Point};

use super::super::{Guidance, GuidanceInputs, Phase};
use super::{FilterConflict, FlightDirection, PASS_STRANGER_AFTER};
use crate::autopilot::telemetry::Telemetry;
use crate::config::limits::Urgency;
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::swarm::neighbours::filter_neighbour::{FilterNeighbour, ReachQuery};
use crate::time::{Duration, Instant};

/// Flight time along the other vehicle's points that has to be free before a vehicle that yields
/// continues, seconds.
const YIELD_LOOK_AHEAD_S: f32 = 3.0;
/// Maximum number of neighbours whose reachable sets are compared in one step: with more nearby the
/// vehicle stops.
const MAX_NEAR_COMPARED: usize = 4;
/// Overshoot of two vehicles in the air beyond their stops, together, metres; the schedule leaves
/// 0.5 m for this and for tracking errors.
const OVERSHOOT_MARGIN_M: f32 = 0.25;
/// Tracking error of this vehicle beside its path, metres: added to the safety distance from a
/// vehicle on the ground.
const TRACKING_MARGIN_M: f32 = 0.1;
/// Distance between the hulls that is kept from a stranger that is passed slowly, and in a late
/// landing, metres.
const STRANGER_HULL_GAP_M: f32 = 0.3;
/// Sway, m/s: speed of the vehicle in excess of its setpoint's for which no longer stop is assumed.
const STOPPING_SWAY_MPS: f32 = 0.3;
/// Time for which a landing was held, after which the vehicle lands beside one that lies there with
/// only the hulls kept apart, if it has no other place to land, and no longer waits for a stranger.
const LATE_LANDING_AFTER: Duration = Duration::from_secs(40);

impl Guidance {
    /// Extends this vehicle's reachable set by the stretch of path that the vehicle flies at least
    /// before it stops, and by `extra_m`. The set begins at the setpoint, not at the vehicle, which
    /// flies on to its setpoint in any case.
    pub(super) fn extend_own_set<const W: usize>(
        &self,
        set: &mut ReachableSet,
        path: &Path<W>,
        telemetry: &Telemetry,
        bounds: &MotionBounds,
        (extra_m, way): (f32, FlightDirection),
    ) {
        let velocity_mps = fpu::sqrtf(telemetry.velocity.norm_squared());
        // Beside its path the vehicle flies straight to where it continues on it.
        let joins =
            self.phase == Phase::Join || (self.phase == Phase::Path && self.raw_point_at_setpoint);
        let join = if joins { path.point_at(self.reference.along_m) } else { None };
        let along_m = if join.is_some() { self.reference.along_m } else { self.setpoint_along_m };
        let reference_mps = fpu::sqrtf(self.smoother.velocity().norm_squared());
        let speed_mps = reference_mps.max(velocity_mps - STOPPING_SWAY_MPS);
        let braking_m = bounds
            .braking
            .stop_distance_m(speed_mps)
            .max(self.smoother.stop_distance_m(Urgency::Urgent));
        let fly_m = speed_mps * REACTION_S + braking_m + extra_m;
        let here = self.smoother.position();
        let points = path.waypoints();
        if way == FlightDirection::Back {
            let next = points.partition_point(|w| w.along_m < along_m);
            let behind = points[..next].iter().rev().map(|w| w.position);
            return set.extend_along(core::iter::once(here).chain(join).chain(behind), fly_m);
        }
        // Forward, the vehicle stops at `stops_at_m` by advice, so the set ends there at the
        // latest.
        let join_m = join.map_or(0.0, |join| (join - here).length());
        let fly_m = fly_m.min(join_m + (self.stops_at_m - along_m).max(0.0));
        let next = points.partition_point(|w| w.along_m <= along_m);
        let ahead = points[next..].iter().map(|w| w.position);
        set.extend_along(core::iter::once(here).chain(join).chain(ahead), fly_m);
    }

    /// The first neighbour that may come nearer to `own` than the distance kept from it.
    pub(super) fn first_conflict<const V: usize, const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &Neighbours<V>,
        own: &OwnSet<'_>,
        bounds: &MotionBounds,
        now: Instant,
    ) -> Option<FilterConflict> {
        let safety_m = self.deconflict.safety_distance_m;
        let place = scene.telemetry.position;
        let lands = state.lands_or_landing_is_held();
        let hears_nobody = neighbours.hears_nobody(now);
        // Hearing nobody, the vehicle lands, or flies on only to a landing place aside.
        let deaf = hears_nobody && (lands || (self.has_begun_path && self.ends_away_from_goal));
        // Like a landing, a guided descent in a coverage mission checks for unheard vehicles on the
        // ground.
        let comes_down = lands || (self.is_in_descent() && neighbours.fleet().is_some());
        let floor_m = scene
            .plan
            .filter(|_| comes_down)
            .map(|plan| self.lowest_possible_ground_m(state, scene, plan));
        let mut near = 0;
        let on_plan = self.flies_by_plan(state, scene);
        let most_apart_m = (safety_m + OVERSHOOT_MARGIN_M.max(neighbours.pair_position_error_m()))
            .max(2.0 * self.track.radius_m + STRANGER_HULL_GAP_M);
        let reach = ReachQuery {
            own,
            within_m: most_apart_m,
            bounds,
            ahead_s: if self.filter.is_stopped() { YIELD_LOOK_AHEAD_S } else { 0.0 },
            on_plan,
            hears_nobody,
            holds_lease: hears_nobody && neighbours.holds_lease(now),
            lands: comes_down,
        };
        let follows = !lands && !hears_nobody;
        let mut next = 0;
        while let Some((i, entry, lost_on_points)) = neighbours.next_within_reach(next, now, &reach)
        {
            next = i + 1;
            let mut met = entry.filter_neighbour(now);
            if lost_on_points {
                met.count_as_lost();
            }
            neighbours.apply_silence(entry, now, &mut met);
            let by_gates = met.on_plan && on_plan;
            if met.out_of_range && (by_gates || lands) {
                // Out of radio range the neighbour is where its gates let it be: away from here.
                continue;
            }
            if by_gates {
                // Gates keep two vehicles on the plan apart, whatever the delay of their messages.
                met.ignore_message_delay();
            }
            if met.lost && !(lands || deaf) && neighbours.may_fly_on_though_lost(entry, now, &reach)
            {
                // Where no neighbour is heard this vehicle's receiver may have failed: the others
                // are not lost, they fly on.
                met.fly_on_for(bounds.stopped_when_unheard_for_s);
            }
            let silent = met.lost || met.motion.age_s > safety::FRESH_S;
            if (lands || deaf) && silent {
                // A landing, and the flight aside before it, does not wait for where a silent
                // vehicle may fly, only for where it may have stopped.
                met.stop_at_last_position();
            }
            if follows && entry.would_fly_all_points_unheard() && !(by_gates || met.lost) {
                met.limit_to_points(entry, bounds);
            }
            let ahead_s =
                if self.filter.is_stopped() && !met.stands { YIELD_LOOK_AHEAD_S } else { 0.0 };
            let held = self.filter.column_wait_for(now);
            if lands && met.stranger && held >= LATE_LANDING_AFTER {
                // A stranger, which anybody can fake, keeps no vehicle in the air for good.
                continue;
            }
            // Flying back to its pad, before its path, or hearing nobody, this vehicle has no other
            // landing place.
            let last_place = self.returning || !self.has_begun_path || deaf;
            let lies = met.motion.grounded || met.lost || (deaf && silent);
            // The end of its path in a coverage mission is above its pad; by then it has sought a
            // place aside in vain.
            let at_end = || {
                entry.would_fly_all_points_unheard()
                    && scene.plan.is_some_and(|p| self.is_reference_at_end_of(&p.path))
            };
            let rests = lies && held >= LATE_LANDING_AFTER && (last_place || at_end());
            let lands_late = lands && (rests || (met.stranger && held >= PASS_STRANGER_AFTER));
            let apart_m = if lands_late || (met.stranger && self.filter.passes_stranger(now)) {
                2.0 * self.track.radius_m + STRANGER_HULL_GAP_M
            } else if (met.motion.grounded || met.stands) && by_gates {
                // The schedule leads past a waiting vehicle at the safety distance plus the
                // tracking errors of both.
                safety_m
            } else if met.motion.grounded {
                let vertical = lands || state == State::Climb || self.is_in_descent();
                safety_m + if vertical { 0.0 } else { TRACKING_MARGIN_M }
            } else if by_gates || met.lost {
                safety_m + OVERSHOOT_MARGIN_M
            } else {
                safety_m + OVERSHOOT_MARGIN_M.max(neighbours.pair_position_error_m())
            };
            // A late landing ignores where a silent vehicle may have fallen.
            let fallen = Some(now).filter(|_| !lands_late);
            let may_lie_below =
                |floor_m| neighbours.may_lie_below(i, &place, floor_m, apart_m, fallen);
            let below = || {
                floor_m.is_some_and(may_lie_below)
                    || (comes_down && entry.may_return_to_pad_near(now, &place, safety_m))
            };
            if silent && !hears_nobody && !met.stranger && below() {
                return Some(FilterConflict {
                    id: met.id,
                    own_yields: true,
                    stranger: false,
                    is_grounded_or_lost: met.lost,
                });
            }
            let reach_m = apart_m + met.motion.max_reach_m(bounds, ahead_s);
            let away = own.box_distances(&met.motion.position);
            let above_m = if met.motion.column_bottom_z_m.is_some() { 0.0 } else { away.z };
            if away.x * away.x + away.y * away.y + above_m * above_m >= reach_m * reach_m {
                continue;
            }
            near += 1;
            let meets = || {
                // Between two vehicles on the plan gates keep the order, so no look-ahead is added.
                let ahead = ahead_s > 0.0 && !by_gates && self.yields_to(state, scene, &met);
                let other = met.motion.reachable_set(bounds, if ahead { ahead_s } else { 0.0 });
                let low = |low: Point| own.conflicts(&ReachableSet::at(low), &low, apart_m);
                own.conflicts(&other, &met.motion.position, apart_m)
                    || met.before_climb.is_some_and(low)
            };
            if near > MAX_NEAR_COMPARED || meets() {
                let own_yields = self.yields_to(state, scene, &met);
                let is_grounded_or_lost = met.motion.grounded || met.lost;
                return Some(FilterConflict {
                    id: met.id,
                    own_yields,
                    stranger: met.stranger,
                    is_grounded_or_lost,
                });
            }
        }
        None
    }

    /// Whether this vehicle follows the shared plan: neither back, nor on a detour, nor in a
    /// landing.
    pub(super) fn flies_by_plan<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
    ) -> bool {
        !self.returning && !scene.is_on_detour() && !state.lands_or_landing_is_held()
    }

    /// Whether this vehicle lets the neighbour `met` go first: a stranger goes first, then a
    /// vehicle on the plan before one off it; then the order of the gates decides; then the one
    /// goes first that does not wait; then the lower id.
    pub(super) fn yields_to<const W: usize, const G: usize>(
        &self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        met: &FilterNeighbour<'_>,
    ) -> bool {
        // A vehicle with another plan than the neighbour's counts as off the plan.
        let on_plan = self.flies_by_plan(state, scene) && met.shares_plan;
        if met.stranger || met.on_plan != on_plan {
            return met.stranger || met.on_plan;
        }
        let along_m = if self.has_begun_path { self.reference.along_m } else { f32::NEG_INFINITY };
        let waits = |plan: &VehiclePlan<W, G>| {
            plan.gates.iter().any(|gate| gate.wait_for_id == met.id && gate.at_m >= along_m)
        };
        if on_plan && self.advice.waiting_for_id == met.id && scene.plan.is_some_and(waits) {
            return true;
        }
        // A neighbour on the plan that reports that it waits lets this vehicle go first.
        if on_plan && met.waits {
            return false;
        }
        met.id < scene.id
    }
}
