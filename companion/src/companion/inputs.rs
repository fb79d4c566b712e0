//! Computes the inputs of the mission table's guards from the state of the companion.

use planner_core::{Length, Point};

use super::{Companion, HEARTBEAT_EVERY};
use crate::autopilot::handshake::is_battery_known_or_unchecked;
use crate::autopilot::telemetry::MAX_POSITION_AGE;
use crate::config::{PlanFailure, REACHES_ALL_M};
use crate::guidance::{REJOIN_WINDOW_AFTER_LOSS_M, REJOIN_WINDOW_M};
use crate::margins::{LEASE_S, MAX_HEIGHT_ERROR_ON_GROUND_M};
use crate::mission::{GuardInputs, MAX_UNFOLLOWED, State};
use crate::swarm::fleet::{Fleet, MISSED_AFTER};
use crate::swarm::neighbours::MAX_HOVER_MPS;
use crate::time::{Duration, Instant};
use crate::timers::Timer;

/// Greatest horizontal distance from the place where landing was commanded in flight to the
/// touchdown, metres: the vehicle may have to stop first.
const MAX_LANDING_DRIFT_M: f32 = 1.0;
/// Greatest horizontal distance from the place where landing was commanded to the touchdown, for a
/// vehicle that stood still then, metres.
const MAX_LANDING_DRIFT_FROM_REST_M: f32 = 0.3;
/// Time since the last renewal of its lease after which a vehicle in a coverage mission counts as
/// unheard: 1 s before the lease ends. The row `NeighboursSilent` stops the vehicle 1 s later.
const UNHEARD_AFTER: Duration = Duration::from_secs(LEASE_S - 1);
/// Height above the pad below which a climb is not interrupted by a pause, metres, but at most half
/// of the climb: lower, an autopilot may take a hovering vehicle for landed, and disarm it.
const MIN_PAUSE_HEIGHT_M: f32 = 1.0;
/// Time without being heard by a majority after which a vehicle that has no part of the area no
/// longer waits for a part.
const MAX_RESERVE_UNHEARD: Duration = Duration::from_secs(300);
/// Time, in addition to [`MAX_UNFOLLOWED`], for which a vehicle in a coverage mission may be away
/// from a setpoint that stands; then it lands. Outdoors gusts push it further than walls would
/// allow indoors.
const EXTRA_UNFOLLOWED_IN_SWAY: Duration = Duration::from_secs(60);
/// Greatest distance from its setpoint at which [`EXTRA_UNFOLLOWED_IN_SWAY`] applies, metres.
const MAX_SWAY_M: f32 = 2.0;
/// An unheard vehicle stops if its next closed gate is less than this ahead, metres.
const MIN_CLOSED_GATE_AHEAD_M: f32 = 0.2;
/// Greatest time that a climb is assumed to take in addition to its height at the climb speed,
/// seconds: idling motors, and the stop at the top.
const ASSUMED_CLIMB_OVERHEAD_S: f32 = 8.0;
/// Vertical speed above which a vehicle does not rest on the ground, m/s.
const MAX_RESTING_VERTICAL_MPS: f32 = 0.5;

/// Time since the safety filter last stopped this vehicle for one that comes down unheard, within
/// which that descent is expected to leave room: until then only this time counts as hindrance.
const DESCENT_LEAVES_ROOM_WITHIN: Duration = Duration::from_secs(30);

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// The values of all guards' inputs now.
    pub(crate) fn guard_inputs(&self) -> GuardInputs {
        let (t, now, view) = (&self.telemetry, self.now, self.detour_view());
        let scene = &view.guidance_inputs;
        let (kind, handshake) = (self.autopilot_kind(), self.handshake.arming());
        let offboard = t.custom_mode == kind.setpoint_mode();
        let mode_foreign = match self.mission.state() {
            state if state.is_started_before_arming() => {
                !offboard && t.custom_mode != self.mission.mode_at_start()
            }
            // Disarming after a landing, the autopilot may change to another mode by itself.
            state if state.lands_or_disarms() => {
                !offboard && t.custom_mode != kind.land_mode() && t.armed
            }
            _ => !offboard,
        };
        let beneath = self.mission.uninterrupted_state();
        let area = self.config.lost_vehicle_down_after_s.is_some();
        let follow = self.mission.state() == State::Follow;
        let on_ground = t.reports_ground(now);
        let fence = self.config.geofence;
        let standing = self.guidance.is_setpoint_still_outside_descent()
            && t.velocity.length() < MAX_HOVER_MPS;
        let drift_m = if standing { MAX_LANDING_DRIFT_FROM_REST_M } else { MAX_LANDING_DRIFT_M };
        let inside = |(low, high): (Point, Point)| {
            (0..3).all(|a| t.position[a] >= low[a] && t.position[a] <= high[a])
        };
        let room_below =
            !self.neighbours.any_below(&t.position, self.config.safety_distance_m + drift_m)
                && !self.detours.is_obstacle_below(&t.position);
        let (over_field, sought_home) =
            (self.detours.home.can_turn_home(&view), self.detours.home.seeking_for(now));
        let sways = area && self.guidance.distance_to_setpoint_m(t) < MAX_SWAY_M;
        let sways_for = if sways { EXTRA_UNFOLLOWED_IN_SWAY } else { Duration::default() };
        let unfollowed_for = self.guidance.unfollowed_for(now).saturating_sub(sways_for);
        let (at_end, homeward) =
            (self.guidance.is_reference_at_end(scene), self.returns_to_start());
        let blocked_for = self.detours.blocked_for(now);
        // A vehicle that something holds, or whose EKF origin moved, cannot fly home or aside: it
        // can only land.
        let can_leave = unfollowed_for < MAX_UNFOLLOWED && !t.origin_moved;
        // From a held landing the vehicle turns back only if the way to its path is free: the
        // landing may have begun where a pilot or the wind had moved the vehicle.
        let joins =
            self.mission.state() != State::LandingHeld || self.guidance.can_join_path(scene);
        GuardInputs {
            time_in_state: self.mission.time_in_state(now),
            heartbeat_age: t.heartbeat_age(now),
            autopilot_heard_for: t.heartbeats_heard_for(now),
            position_age: t.position_age(now),
            position_jumped: t.is_position_settling(now),
            stalled_for: match self.mission.state() {
                State::Follow => now - self.guidance.last_progress_at(),
                // Where the vehicle can still fly home, its standstill at a gate before the block
                // does not count.
                State::Blocked if over_field && sought_home.is_none() => blocked_for,
                State::Blocked => (now - self.guidance.last_progress_at()).max(blocked_for),
                _ => Duration::default(),
            },
            unfollowed_for,
            path_blocked_for: blocked_for,
            unlinked_for: self.unlinked_for(),
            division_overdue: self.timers.is_due(Timer::DivisionDue, now),
            may_fly_on_unheard: self.is_flying_unheard(),
            others_out_of_range: self.neighbours.are_all_out_of_range_or_done(),
            swarm_linked: self.is_linked(),
            excluded: self.is_excluded(),
            left_out_set_changed: self.mission.photographed().has_left_out_set_changed(),
            plans_differ: self.hears_another_plan(),
            holds_to_divide: self.mission.state().follows_path_or_is_blocked()
                && self.is_holding_for_division(),
            division_plan_ready: self.mission.is_division_plan_ready(),
            division_settled: self.is_division_settled() && !self.detours.is_off_own_path(),
            plan_ready: self.mission.plan().is_some(),
            plan_failed: self.mission.plan_failure().is_some(),
            roadmap_unusable: self.mission.plan_failure() == Some(PlanFailure::RoadmapUnusable),
            plan_leaves_pad: self.plan_leaves_pad(),
            in_reserve: self.is_in_reserve(),
            shares_plan_with_others: self.shares_plan_with_others(),
            at_pad: self.is_at_pad(),
            imprecise_at_cruise: self.mission.state() == State::Ready
                && self.guidance.estimate_speed_share < 1.0,
            imprecise_at_crawl_for: self.mission.imprecise_at_crawl_for(now),
            origin_moved: t.origin_moved,
            start_pending: self.mission.pending().start,
            pause_pending: self.mission.pending().pause,
            climb_just_begun: self.mission.state() == State::Climb
                && t.position.z - self.mission.pad_position().z
                    < MIN_PAUSE_HEIGHT_M.min(self.mission.climb_m() / 2.0),
            resume_pending: self.mission.pending().resume,
            land_pending: self.mission.pending().land,
            return_pending: self.mission.pending().turn_back && !homeward,
            is_coverage: area,
            may_seek_path_home: over_field,
            in_last_descent: self.guidance.is_in_descent(),
            may_detour_and_rejoin: standing
                && (self.is_division_settled() || self.detours.is_beside_plan())
                && self.detours.may_detour_over_area(&view, &self.timers),
            stands_at_detour_end: follow && self.detours.ends_on_plan_path() && at_end && standing,
            own_plan_ready: self.detours.is_own_plan_ready(),
            own_plan_failed: self.detours.is_own_plan_lost(),
            seeks_or_flies_path_home: self.detours.is_homeward(),
            seeking_home_for: sought_home,
            ready_to_request_path_home: standing
                && self.detours.home.may_request(now, &self.timers),
            in_climb: beneath.takes_off(),
            armed: t.armed,
            armed_bit_overdue: handshake.is_armed_bit_overdue(now),
            arming_unrequested: handshake.is_arming_unrequested(),
            arming_unanswered: handshake.is_arming_unanswered(now),
            in_own_mode: handshake.is_in_own_mode(),
            in_land_mode: t.custom_mode == kind.land_mode(),
            in_setpoint_mode: offboard,
            mode_foreign,
            autopilot_critical: t.is_critical(),
            on_ground,
            height_if_ground_reported_m: if t.last_reported_ground() {
                view.height_above_ground_m()
            } else {
                f32::NAN
            },
            has_flown: handshake.has_flown(),
            moves_vertically: t.position_age(now) < MAX_POSITION_AGE
                && t.velocity.z.abs() > MAX_RESTING_VERTICAL_MPS,
            airborne: t.armed && t.last_reported_flight(),
            take_off_command_done: !kind.takes_off_by_command() || t.last_reported_flight(),
            may_take_off: self.plan_leaves_pad()
                && self.guidance.advice_allows_departure()
                && self.guidance.filter.column_clear()
                && self.mission.departure_due(now, self.guidance.departs_later_by())
                && !self.hears_another_plan()
                && !self.mission.pending().pause
                && is_battery_known_or_unchecked(t, self.config.battery_low_percent, now)
                && !self.detours.is_blocked()
                && self.neighbours.is_path_clear_since(self.mission.entered_at())
                && match self.neighbours.fleet() {
                    Some(fleet) => fleet.takes_part() && self.is_linked(),
                    None => self.is_linked() || self.neighbours.are_all_landed_or_out(),
                },
            climb_done: self.mission.state() == State::Climb && self.guidance.is_climb_done(scene),
            // The ground may be higher than the plan says: a reported landing ends the descent.
            path_done: follow
                && (self.guidance.is_path_and_descent_done(scene, now)
                    || (self.guidance.is_in_descent() && on_ground)),
            returns_to_start: homeward,
            reference_at_goal: self.guidance.is_reference_at_goal(scene)
                && !self.detours.is_homeward(),
            near_path: match self.mission.state() {
                state if !state.may_be_off_path_on_resume() => false,
                _ if beneath.takes_off() => self.guidance.is_near_start(scene),
                // Resuming a landing does not depend on a place along the path.
                _ if beneath == State::Land && self.mission.interrupted_state() == State::Land => {
                    true
                }
                State::PilotReturned => self.guidance.is_near_path(scene, REJOIN_WINDOW_M),
                _ => self.guidance.is_near_path(scene, REJOIN_WINDOW_AFTER_LOSS_M),
            },
            battery_low: t.is_battery_below(self.config.battery_low_percent),
            battery_critical: t.is_battery_below(self.config.battery_low_percent / 2),
            column_blocked_for: self.guidance.filter.column_blocked_for(now),
            column_blocked_for_good_for: self.guidance.filter.column_blocked_for_good_for(now),
            start_barred_for: self.mission.start_barred_for(now),
            may_leave_part_to_others: self.neighbours.may_leave_part_to_others(now, MISSED_AFTER),
            column_clear_for: self.guidance.filter.column_clear_for(now),
            must_land: self.must_land(),
            can_turn_back: can_leave
                && joins
                && self.guidance.reference_along_m() >= 0.0
                && !self.guidance.returning
                && (!area || self.detours.home.is_seeking())
                && !self.neighbours.hears_nobody(now),
            way_back_barred: self.detours.is_way_back_barred(&view),
            pad_blocked_for: self.pad_blocked_for(),
            way_back_blocked_for_good_for: self.way_back_blocked_for_good_for(),
            join_barred: follow && self.guidance.is_join_barred(scene),
            // In a coverage mission the search for a place aside checks the way from where the
            // vehicle is.
            may_seek_landing_aside: can_leave
                && (joins || area)
                && self.detours.may_seek_landing_aside(&view),
            seeks_landing_aside: self.detours.seeks_landing_aside(),
            lands_aside: self.detours.seeks_landing_aside() || self.detours.lands_at_end(),
            landing_place_reached: follow && self.detours.lands_at_end() && at_end && standing,
            yielded_for: self.counted_hindrance(self.guidance.filter.yielded_for(now)),
            hindered_for: self.counted_hindrance(self.guidance.filter.hindered_for(now)),
            room_below,
            outside_geofence: self.guidance.is_standing_at_fence()
                || fence.is_some_and(|fence| t.position_at.is_some() && !inside(fence)),
            path_blocked: self.detours.is_blocked(),
            our_turn_to_detour: self.detours.is_our_turn(&view),
            detour_ready: self.detours.is_detour_ready(),
            detours_given_up: self.detours.has_given_up_detours(),
            waited_below_landing_for: self.detours.time_trapped_below_landing(&view),
            standing,
        }
    }

    /// Whether this vehicle has no part of the area, but may get one if another vehicle is lost.
    fn is_in_reserve(&self) -> bool {
        let needed = |fleet: &Fleet<V>| {
            // A committed division whose plan has not come yet may give it a part.
            let behind = fleet.division_count() > self.mission.division_count();
            let quiet = self.timers.is_due(Timer::ReserveEnds, self.now) && !fleet.is_dividing();
            (behind || (fleet.may_reserve_get_a_part() && !quiet))
                && fleet.lease_age(self.now) < MAX_RESERVE_UNHEARD
        };
        !self.plan_leaves_pad() && self.neighbours.fleet().is_some_and(needed)
    }

    /// Whether there is a plan, and its task makes the vehicle leave its pad.
    pub(super) fn plan_leaves_pad(&self) -> bool {
        self.mission.plan().is_some_and(|plan| plan.task.leaves_pad())
    }

    /// Whether the estimated position is at the pad: horizontally within `start_tolerance_m`, in
    /// height also within [`MAX_HEIGHT_ERROR_ON_GROUND_M`].
    pub(super) fn is_at_pad(&self) -> bool {
        let pad = self.mission.path_start() - Point::new(0.0, 0.0, self.mission.climb_m());
        let away = self.telemetry.position - pad;
        let height_tolerance_m = self.config.start_tolerance_m.min(MAX_HEIGHT_ERROR_ON_GROUND_M);
        away.xy().length() <= self.config.start_tolerance_m && away.z.abs() <= height_tolerance_m
    }

    /// Time for which this vehicle has heard no other one, or none has reported that it hears this
    /// vehicle, whichever is longer; counted from the entry into the state unless the vehicle is
    /// paused or its autopilot silent. Zero while it may fly on unheard, or flies back or aside to
    /// land. In a coverage mission: time since the last renewal of its lease, counted from 1 s
    /// before the lease ends.
    fn unlinked_for(&self) -> Duration {
        let (now, state) = (self.now, self.mission.state());
        if let Some(fleet) = self.neighbours.fleet() {
            let age = fleet.time_without_majority(now).saturating_sub(UNHEARD_AFTER);
            // On the pad the age counts from the entry into the state, so that the warning row that
            // enters `Scheduled` again is not taken in each step.
            let on_pad = state == State::Scheduled;
            return if on_pad { age.min(self.mission.time_in_state(now)) } else { age };
        }
        // A vehicle that flies back, or aside to land, does not stop because no other vehicle hears
        // it: it is about to land anyway. For a vehicle that stands the time counts all the same:
        // others assume after a while that it is down, so it has to land.
        let stands = state.stands_until_resumed();
        let is_landing = self.guidance.returning
            || self.detours.lands_at_end()
            || self.detours.seeks_landing_aside();
        match (is_landing && !stands) || self.is_flying_unheard() {
            true => Duration::default(),
            false if stands => self.neighbours.unlinked_duration(now, Instant::ZERO),
            false => self.neighbours.unlinked_duration(now, self.mission.entered_at()),
        }
    }

    /// The part of `hindered_for` that counts: the time since the safety filter last kept this
    /// vehicle from moving on because of a vehicle that comes down unheard. Such a descent takes
    /// longer than the limits for hindrances, and leaves room once it ends; if it has left none for
    /// [`DESCENT_LEAVES_ROOM_WITHIN`], all of `hindered_for` counts.
    fn counted_hindrance(&self, hindered_for: Duration) -> Duration {
        let since = self.guidance.filter.time_since_blocked_by_unheard_descent(self.now);
        if since < DESCENT_LEAVES_ROOM_WITHIN { hindered_for.min(since) } else { hindered_for }
    }

    /// On the way home, time for which any vehicle has barred the descent to the pad, or one that
    /// rests for good the path there; at the end of a coverage path, time for which one that rests
    /// for good has barred the descent. Else zero.
    fn pad_blocked_for(&self) -> Duration {
        let follow = self.mission.state() == State::Follow;
        let homeward = self.returns_to_start();
        let descends = self.guidance.is_in_descent();
        match follow && (homeward || (descends && self.config.lost_vehicle_down_after_s.is_some()))
        {
            true if homeward && descends => self.guidance.filter.hindered_for(self.now),
            // The end of its path in a coverage mission is above its pad: there is no other way
            // down to the pad.
            true => self.guidance.filter.blocked_for_good_for(self.now),
            false => Duration::default(),
        }
    }

    /// Time for which a vehicle that rests for good has barred the way back to its pad; zero in a
    /// coverage mission.
    fn way_back_blocked_for_good_for(&self) -> Duration {
        match self.mission.state() == State::Follow && self.returns_to_start() {
            true if self.config.lost_vehicle_down_after_s.is_none() => {
                self.counted_hindrance(self.guidance.filter.blocked_for_good_for(self.now))
            }
            _ => Duration::default(),
        }
    }

    /// Whether the vehicle flies back along its path, flies straight home, or seeks the way home.
    fn returns_to_start(&self) -> bool {
        self.guidance.returning || self.detours.is_homeward()
    }

    /// Whether within 1 s this vehicle heard another one, and one reported that it hears this
    /// vehicle; in a coverage mission, whether a majority of those that take part reported that
    /// they hear it.
    fn is_linked(&self) -> bool {
        match self.neighbours.fleet() {
            Some(fleet) => fleet.time_without_majority(self.now) < HEARTBEAT_EVERY,
            None => self.neighbours.linked_within(self.now, HEARTBEAT_EVERY),
        }
    }

    /// Whether a vehicle in this state may continue its plan while no other vehicle hears it: only
    /// on its plan, unblocked and no slower than others expect, where the radio's range is known,
    /// and not in a coverage mission.
    pub(super) fn may_fly_unheard(&self) -> bool {
        let follows = self.mission.state().may_continue_unheard();
        let left = self.detours.is_blocked()
            || self.detours.has_left_plan()
            || self.detours.is_on_detour();
        let ranged = self.config.radio_range_m < REACHES_ALL_M;
        // A vehicle slowed by a parameter or by its autopilot is not where the others predict it to
        // be. In a coverage mission no vehicle flies on by this rule: there the lease limits how
        // long it does.
        let keeps_pace = self.guidance.cruise_mps() >= self.config.slowest_vehicle_mps;
        ranged
            && keeps_pace
            && self.neighbours.fleet().is_none()
            && follows
            && !left
            && !self.guidance.returning
            && self.mission.plan().is_some()
    }

    /// Whether this vehicle continues its plan with all others out of range: its next gate is open,
    /// or none is left.
    fn is_flying_unheard(&self) -> bool {
        let length_m = self.mission.plan().map_or(0.0, |plan| plan.path.length_m());
        let clear_m = self.guidance.gates_open_up_to_m(&self.detour_view().guidance_inputs);
        self.may_fly_unheard()
            && self.neighbours.are_all_out_of_range_or_done()
            && (clear_m > self.guidance.reference_along_m() + MIN_CLOSED_GATE_AHEAD_M
                || clear_m >= length_m)
    }

    /// Place along its path up to which this vehicle flies while it is unheard, metres, and the
    /// seconds by which its gates and its climb delay it, compared with a flight from `progress_m`
    /// at 0.4 of the slowest vehicle's cruise speed; (−1e6, 0) where it does not fly on.
    pub(super) fn unheard_end_m_and_delay_s(&self, progress_m: f32) -> (f32, u8) {
        match self.may_fly_unheard() {
            true => {
                let scene = self.detour_view().guidance_inputs;
                let (clear_m, in_s) = self.guidance.unheard_end_m_and_delay_s(
                    &scene,
                    &self.neighbours,
                    progress_m,
                    self.now,
                );
                // The climb is assumed at 1 m/s, or slower if the settings say so; idling motors
                // before it and the stop at its top are added.
                let climb_s = if progress_m < 0.0 {
                    ASSUMED_CLIMB_OVERHEAD_S
                        + libm::ceilf(-progress_m / libm::fminf(self.config.climb_mps, 1.0))
                } else {
                    0.0
                };
                (clear_m, in_s.max(climb_s as u8))
            }
            false => (-1e6, 0),
        }
    }

    /// Whether this vehicle lands whatever is below: the charge is below half of the configured
    /// limit, or its position is unknown or the EKF origin has moved, so that it cannot hold.
    pub(crate) fn must_land(&self) -> bool {
        let t = &self.telemetry;
        t.is_battery_below(self.config.battery_low_percent / 2)
            || t.origin_moved
            || t.position_age(self.now) >= MAX_POSITION_AGE
    }
}
