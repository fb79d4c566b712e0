//! What the guards of the mission table look at, from the state of the companion.

use planner_core::Point;

use super::{Companion, HEARTBEAT_EVERY};
use crate::autopilot::requests::battery_reported;
use crate::config::{PlanFailure, REACHES_ALL_M};
use crate::guidance::{LOST_WINDOW_M, REJOIN_WINDOW_M};
use crate::mission::{Inputs, MAX_POSITION_AGE, State, UNFOLLOWED_MOST};
use crate::swarm::neighbours::MAX_HOVER_MPS;
use crate::time::Duration;

/// Distance of a landing from where it was commanded: the stopping distance from cruise, metres.
const LANDING_DRIFT_M: f32 = 1.0;
/// Distance of a landing from where it was commanded for a vehicle that stood still, metres.
const STANDING_DRIFT_M: f32 = 0.3;
/// Greatest height difference between estimate and pad with which a vehicle takes off, metres: real
/// estimates on the ground were seen up to 1.1 m off.
const MAX_START_HEIGHT_ERROR_M: f32 = 1.5;
/// Silence a second before the lease ends: the row `NeighboursSilent` stops a vehicle a second
/// after this.
const UNHEARD_STOP_AFTER: Duration = Duration::from_secs(19);
/// A gate nearer ahead than this leaves no path to fly on, metres.
const MIN_GATE_AHEAD_M: f32 = 0.2;
/// Greatest vertical speed of a vehicle that rests on the ground, m/s.
const MAX_RESTING_CLIMB_MPS: f32 = 0.5;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// A snapshot.
    pub(crate) fn inputs(&self) -> Inputs {
        let (t, now, view) = (&self.telemetry, self.now, self.view());
        let scene = &view.scene;
        let (kind, handshake) = (self.kind(), self.requests.handshake());
        let offboard = t.custom_mode == kind.setpoint_mode();
        let mode_foreign = match self.mission.state() {
            State::Scheduled | State::PadReplanning | State::Streaming | State::Engaging => {
                !offboard && t.custom_mode != self.mission.mode_before()
            }
            // Disarming after a landing the autopilot chooses a mode of its own.
            State::Land | State::LandingHeld | State::Disarm => {
                !offboard && t.custom_mode != kind.land_mode() && t.armed
            }
            _ => !offboard,
        };
        let climb_m = self.mission.climb_m();
        let away = t.position - (self.mission.start() - Point::new(0.0, 0.0, climb_m));
        let height_tolerance_m = self.config.start_tolerance_m.min(MAX_START_HEIGHT_ERROR_M);
        let beneath = self.mission.beneath();
        let follow = self.mission.state() == State::Follow;
        let on_ground = t.on_ground == Some(true);
        let fence = self.config.geofence;
        let standing = self.guidance.stands() && t.velocity.norm() < MAX_HOVER_MPS;
        let drift_m = if standing { STANDING_DRIFT_M } else { LANDING_DRIFT_M };
        let inside =
            |(low, high): (Point, Point)| (0..3).all(|a| t.position[a] >= low[a] && t.position[a] <= high[a]);
        let room_below = !self.neighbours.any_below(&t.position, self.config.safety_distance_m + drift_m);
        let (over_field, sought_home) =
            (self.detours.home.can_turn(&view), self.detours.home.sought_for(now));
        let unfollowed = self.guidance.unfollowed_for(now);
        // What something holds gets nowhere else.
        let can_leave = unfollowed < UNFOLLOWED_MOST;
        Inputs {
            in_state: self.mission.in_state(now),
            heartbeat_age: t.heartbeat_age(now),
            position_age: t.position_age(now),
            jumped: t.is_settling(now),
            stalled: match self.mission.state() {
                State::Follow => now - self.guidance.progress_at(),
                // The vehicle may have stood for a gate long before. Where it can fly home it does
                // not land for that.
                State::Blocked if over_field && sought_home.is_none() => self.detours.blocked_for(now),
                State::Blocked => (now - self.guidance.progress_at()).max(self.detours.blocked_for(now)),
                _ => Duration::default(),
            },
            unfollowed,
            blocked_for: self.detours.blocked_for(now),
            // On its way back, or aside to land, it is already on its way to the ground: it does not stop for want of
            // being heard.
            neighbour_age: if let Some(fleet) = self.neighbours.fleet() {
                fleet.unheard_for(now).beyond(UNHEARD_STOP_AFTER)
            } else {
                match self.guidance.returning || self.detours.lands() || self.flies_on() {
                    true => Duration::default(),
                    false => self.neighbours.silence(now, self.mission.entered_at()),
                }
            },
            way_free: self.flies_on(),
            out_of_range: self.neighbours.all_beyond(),
            neighbour_heard: self.is_linked(),
            excluded: self.is_excluded(),
            more_is_done: self.mission.photographed().is_outdated(),
            plans_differ: self.hears_another_plan(),
            holds_to_divide: self.holds_to_divide(),
            division_ready: self.mission.has_division(),
            undivided: self.is_undivided() && !self.detours.beside.is_on(),
            plan_ready: self.mission.plan().is_some(),
            plan_failed: self.mission.failure().is_some(),
            roadmap_bad: self.mission.failure() == Some(PlanFailure::NoRoadmap),
            has_goal: self.mission.plan().is_some_and(|plan| plan.task.flies()),
            plans_as_others: self.plans_as_others(),
            at_start: away.xy().norm() <= self.config.start_tolerance_m && away.z.abs() <= height_tolerance_m,
            imprecise: self.mission.state() == State::Ready && self.guidance.pace < 1.0,
            vague: self.mission.vague_for(now),
            origin_moved: t.origin_moved,
            start: self.mission.pending().start,
            pause: self.mission.pending().pause,
            resume: self.mission.pending().resume,
            land: self.mission.pending().land,
            turn_back: self.mission.pending().turn_back
                && !self.guidance.returning
                && !self.detours.home.is_on(),
            area: self.config.division.is_some(),
            over_field,
            may_fly_beside: standing && self.is_undivided() && self.detours.may_fly_beside(&view),
            around_flown: follow && self.detours.beside.flies() && self.guidance.is_at_end(scene) && standing,
            own_plan_ready: self.detours.beside.is_back(),
            own_plan_lost: self.detours.beside.is_lost(),
            homeward: self.detours.home.is_on(),
            sought_home,
            stands_to_return: standing && self.detours.home.may_ask(now),
            in_climb: matches!(beneath, State::TakeOff | State::Climb),
            armed: t.armed,
            armed_unseen: handshake.is_armed_unseen(now),
            arming_unanswered: handshake.is_unanswered(now),
            disarm_refused: handshake.is_disarm_refused(),
            ours: handshake.is_ours(),
            landing: t.custom_mode == kind.land_mode(),
            offboard,
            mode_foreign,
            critical: t.is_critical(),
            on_ground,
            flown: handshake.has_flown(),
            vertical: t.position_age(now) < MAX_POSITION_AGE && t.velocity.z.abs() > MAX_RESTING_CLIMB_MPS,
            airborne: t.armed && t.on_ground == Some(false),
            lifted_off: !kind.takes_off_by_command() || t.on_ground == Some(false),
            gates_open: self.guidance.advice.stop_within_m > 0.05
                && self.guidance.filter.column_clear()
                && self.mission.departure_due(now)
                && !self.hears_another_plan()
                && !self.mission.pending().pause
                && battery_reported(t, self.config.battery_low_percent, now)
                && !self.detours.is_blocked()
                && self.neighbours.is_clear_since(self.mission.entered_at())
                && (self.is_linked() || self.neighbours.all_rest()),
            climb_done: self.mission.state() == State::Climb && self.guidance.climb_done(scene),
            // The ground may be higher than where its pad is said to be.
            path_done: follow
                && (self.guidance.path_done(scene, now) || (self.guidance.descends() && on_ground)),
            at_goal: self.guidance.at_goal(scene) && !self.detours.home.is_on(),
            near_path: match (beneath, self.mission.state()) {
                // These interrupted states do not depend on a place on the path.
                (State::TakeOff | State::Land, State::PilotReturned | State::PositionLost) => true,
                (_, State::PilotReturned) => self.guidance.near_path(scene, REJOIN_WINDOW_M),
                (_, State::PositionLost) => self.guidance.near_path(scene, LOST_WINDOW_M),
                _ => false,
            },
            battery_low: t.charge_below(self.config.battery_low_percent),
            battery_critical: t.charge_below(self.config.battery_low_percent / 2),
            column_blocked: self.guidance.filter.column_blocked_for(now),
            column_barred: self.guidance.filter.column_barred_for(now),
            column_clear: self.guidance.filter.column_clear_for(now),
            must_land: self.must_land(),
            can_turn_back: can_leave
                && self.guidance.along_m() >= 0.0
                && !self.guidance.returning
                && (self.config.division.is_none() || self.detours.home.seeks())
                && !self.neighbours.is_deaf(now),
            pad_blocked_for: match follow && (self.guidance.returning || self.detours.home.is_on()) {
                true if self.guidance.descends() => self.guidance.filter.hindered_for(now),
                true => self.guidance.filter.barred_for(now),
                false => Duration::default(),
            },
            can_land_aside: can_leave && self.detours.can_land_aside(&view),
            lands_aside: self.detours.lands(),
            aside_reached: follow
                && self.detours.is_flying()
                && self.detours.lands()
                && self.guidance.is_at_end(scene)
                && standing,
            yielded: self.guidance.filter.yielded_for(now),
            hindered: self.guidance.filter.hindered_for(now),
            room_below,
            outside: self.guidance.stands_at_fence()
                || fence.is_some_and(|fence| t.position_at.is_some() && !inside(fence)),
            blocked: self.detours.is_blocked(),
            our_turn: self.detours.is_our_turn(&view),
            detour_ready: self.detours.is_ready(),
            no_way_around: self.detours.gives_up(),
            underneath: self.detours.underneath(&view),
            standing,
        }
    }

    /// Whether others are heard and hear it: in a coverage mission a majority of those that take part.
    fn is_linked(&self) -> bool {
        match self.neighbours.fleet() {
            Some(fleet) => fleet.unheard_for(self.now) < HEARTBEAT_EVERY,
            None => self.neighbours.linked_within(self.now, HEARTBEAT_EVERY),
        }
    }

    /// Whether it may fly on its plan though nobody hears it.
    fn follows_plan(&self) -> bool {
        let follows =
            matches!(self.mission.state(), State::TakeOff | State::Climb | State::Follow | State::Alone);
        let left = self.detours.is_blocked() || self.detours.has_left() || self.detours.is_flying();
        let ranged = self.config.radio_range_m < REACHES_ALL_M;
        ranged && follows && !left && !self.guidance.returning && self.mission.plan().is_some()
    }

    /// Whether it does: its next gate is open, or none is left.
    fn flies_on(&self) -> bool {
        let length_m = self.mission.plan().map_or(0.0, |plan| plan.path.length_m());
        let clear_m = self.guidance.clear_m(&self.view().scene);
        self.follows_plan()
            && self.neighbours.all_beyond()
            && (clear_m > self.guidance.along_m() + MIN_GATE_AHEAD_M || clear_m >= length_m)
    }

    /// Distance that this vehicle flies on its plan while it is unheard, metres along its path, and
    /// the seconds after which all gates up to there are open for sure; −1e6 where it flies no such
    /// distance.
    pub(super) fn clears_m(&self) -> (f32, u8) {
        match self.follows_plan() {
            true => self.guidance.clears_m(&self.view().scene, &self.neighbours, self.now),
            false => (-1e6, 0),
        }
    }

    /// Whether it comes down whatever is below: with a battery that is nearly empty, or no place known to hold.
    pub(crate) fn must_land(&self) -> bool {
        let t = &self.telemetry;
        t.charge_below(self.config.battery_low_percent / 2)
            || t.origin_moved
            || t.position_age(self.now) >= MAX_POSITION_AGE
    }
}
