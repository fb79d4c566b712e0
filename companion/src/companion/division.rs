//! The division of a coverage mission's area after a loss: what this vehicle reports of itself,
//! where it holds, and the plan that it requests from the shell.

use planner_core::flight::{Task, VehiclePlan};
use planner_core::{Length, Point};

use super::Companion;
use crate::config::PlanFailure;
use crate::events::{Event, PlanKind};
use crate::link::roster::ShareStatus;
use crate::link::severity::Severity;
use crate::margins::PILOTED_OUT_OF_PLAN_AFTER;
use crate::replanning::detour::path_kind::RejoinPlace;
use crate::state::State;
use crate::swarm::fleet::{COMMITMENT_S, Fleet, LEASE, OwnReport, VehicleDivisionInput};
use crate::time::Duration;
use crate::timers::Timer;

/// Margin beyond the stopping distance at which a vehicle promises to hold at the earliest, metres.
const EXTRA_STOPPING_MARGIN_M: f32 = 0.3;
/// Distance by which a stop may end beyond the place promised, metres.
const MAX_STOP_BEYOND_PROMISE_M: f32 = 0.1;
/// A vehicle within this distance before the place where it promised to hold has reached it,
/// metres. Places that are nearer to each other than this count as the same.
const AT_HOLD_WITHIN_M: f32 = 0.2;
/// Time without a vehicle in flight, after one has ended its flight, after which none will fly any
/// more that could leave a part to a vehicle in reserve.
const RESERVE_ENDS_AFTER: Duration = Duration::from_secs(120);
/// Time for which a vehicle on the ground that cannot make a commitment keeps its share; then it
/// leaves the share to the others.
pub(super) const LEAVE_WITHOUT_COMMITMENT_AFTER: Duration = Duration::from_secs(60);
/// Time for which a vehicle waits above its pad for missing vehicles: more than twice the time
/// after which a missing one counts as lost, or leaves for want of a lease. A false report keeps no
/// vehicle in the air for longer.
const MAX_WAIT_FOR_MISSING: Duration = Duration::from_secs(180);
/// Time after the last lost vehicle must be down within which a division must become binding; later
/// it is overdue.
const DIVISION_DUE_AFTER_LAST_DOWN: Duration = Duration::from_secs(60);
/// Used in place of the plan's CRC where the planner cannot divide the rest of the area.
const IMPOSSIBLE_DIVISION_CRC: u32 = u32::MAX;
/// Time after which an unanswered request for a division is sent to the shell again.
const DIVISION_RETRY_EVERY: Duration = Duration::from_secs(30);

/// An arc length in decimetres, rounded up; `None` if it is negative or does not fit.
fn to_decimetres(along_m: f32) -> Option<u16> {
    let dm = libm::ceilf(along_m * 10.0);
    (0.0..=f32::from(u16::MAX)).contains(&dm).then_some(dm as u16)
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// The inputs of the plan requested by [`PlanKind::Division`]: for each binding division, and
    /// for the one under way if it is to be computed, oldest first, the input of every vehicle by
    /// rank.
    pub fn division_inputs(&self) -> impl Iterator<Item = &[VehicleDivisionInput]> + Clone {
        self.neighbours.fleet().into_iter().flat_map(Fleet::inputs_of_divisions)
    }

    /// Updates the fleet's state and where this vehicle holds, and requests a division's plan if
    /// one is to be computed or flown, or the vehicle's own plan again after a detour.
    pub(super) fn step_division(&mut self) {
        let now = self.now;
        if self.neighbours.fleet().is_none() {
            return;
        }
        if !self.cannot_commit_on_ground() {
            self.timers.set(Timer::LeaveWithoutCommitment, now + LEAVE_WITHOUT_COMMITMENT_AFTER);
        }
        if self.plan_leaves_pad() || !self.has_flight_of_others_ended() {
            self.timers.set(Timer::ReserveEnds, now + RESERVE_ENDS_AFTER);
        }
        if self.mission.state() != State::Dividing {
            self.timers.set(Timer::DivisionDue, now);
        } else if let Some(at) = self.neighbours.fleet().and_then(Fleet::last_down_at) {
            self.timers.set_no_earlier(Timer::DivisionDue, at + DIVISION_DUE_AFTER_LAST_DOWN);
        }
        let own = self.own_fleet_report();
        self.neighbours.step_fleet(&own, now);
        let Some(fleet) = self.neighbours.fleet() else { return };
        let around = self.detours.is_beside_plan();
        if !fleet.is_any_missing() {
            self.timers.set(Timer::StopWaitingForMissing, now + MAX_WAIT_FOR_MISSING);
        }
        let misses =
            fleet.is_any_missing() && !self.timers.is_due(Timer::StopWaitingForMissing, now);
        // Only a vehicle that still takes part waits above its pad.
        let waits = || fleet.takes_part() && (fleet.is_dividing() || misses);
        let halt_m = match self.division_hold_m() {
            Some(holds_at_m) => holds_at_m,
            // On a detour back to its path a vehicle waits for no missing one: that detour does not
            // end above the pad.
            None if !around && waits() => {
                let home_m = self.last_descent_start_m();
                let before = self.guidance.reference_along_m() <= home_m + AT_HOLD_WITHIN_M;
                if before { home_m } else { f32::INFINITY }
            }
            None => f32::INFINITY,
        };
        let behind = fleet.division_count() > self.mission.division_count();
        let wants = fleet.is_division_to_be_computed()
            || ((behind || around) && self.is_at_division_start());
        let fingerprint = wants.then(|| fleet.division_inputs_hash());
        self.guidance.set_division_hold_m(halt_m);
        let timers = &mut self.timers;
        let requests = |hash| {
            self.mission.open_division_request_if_due(hash, now, DIVISION_RETRY_EVERY, timers)
        };
        if fingerprint.is_some_and(requests) {
            // The queue is full only if the shell does not drain; then the request is repeated
            // after `DIVISION_RETRY_EVERY`.
            let _ = self.events.push_back(Event::PlanRequested(PlanKind::Division));
        }
    }

    /// Whether a vehicle has ended its flight, none may be missing, and no other one is in flight.
    fn has_flight_of_others_ended(&self) -> bool {
        let ended = |fleet: &Fleet<V>| fleet.has_any_ended() && !fleet.is_any_missing();
        self.neighbours.fleet().is_some_and(ended)
            && !self.neighbours.is_another_in_flight(self.now, LEASE)
    }

    /// This vehicle's report of itself to the fleet (`Fleet::step`).
    fn own_fleet_report(&self) -> OwnReport {
        let state = self.mission.state();
        let off_plan = self.guidance.returning
            || self.guidance.ends_away_from_goal
            || self.detours.is_on_detour()
            || self.detours.is_homeward()
            || self.detours.has_left_plan();
        // On a detour that leads back to its path the vehicle keeps its part of the area.
        let beside = self.detours.is_beside_plan();
        let ends = match state {
            _ if state.has_left_mission() => true,
            _ if state.is_left_to_pilot() => {
                self.mission.time_since_pilot_takeover(self.now) >= PILOTED_OUT_OF_PLAN_AFTER
            }
            _ => {
                (off_plan && !beside)
                    || (self.cannot_commit_on_ground()
                        && self.timers.is_due(Timer::LeaveWithoutCommitment, self.now))
            }
        };
        let on_pad = state.waits_on_pad_with_plan();
        let along_m = self.guidance.reported_progress_m(state, &self.guidance_inputs());
        let flies = self.guidance.reference_along_m() >= 0.0 && !off_plan;
        // A vehicle that holds above its pad may have overshot the start of its descent a little.
        let descends =
            self.guidance.reference_along_m() > self.last_descent_start_m() + AT_HOLD_WITHIN_M;
        let nearly_down = flies && descends && !on_pad && self.division_hold_m().is_none();
        let standing = match ends || nearly_down {
            true if self.mission.has_all_pictures(along_m) => ShareStatus::Finished,
            _ if ends => ShareStatus::Left,
            _ => ShareStatus::Alive,
        };
        OwnReport {
            status: standing,
            waits_for_start: self.is_not_started(),
            // By the state: an autopilot may report the ground in flight.
            airborne: !(self.is_not_started() || state.is_started_on_pad() || state.is_over()),
            path_division_count: self.mission.division_count(),
            progress_dm: if flies {
                (along_m * 10.0).clamp(0.0, f32::from(u16::MAX)) as u16
            } else {
                0
            },
            new_commitment_dm: if on_pad {
                Some(0)
            } else {
                self.possible_commitment_dm().filter(|_| flies)
            },
            // Beside its path the vehicle does not hold: it first flies its own plan to where it
            // promised to hold.
            holds: on_pad || (state == State::Dividing && !beside),
            wants_division: flies && self.wants_division(),
        }
    }

    /// Whether all vehicles are to divide the rest of the area, because the path of this vehicle
    /// holds only the first part of its route and ends soon.
    fn wants_division(&self) -> bool {
        let Some(plan) = self.mission.plan() else { return false };
        let Task::Photograph(photographs) = &plan.task else { return false };
        let soon_m = self.guidance.reference_along_m() + COMMITMENT_S * self.config.cruise_mps;
        photographs.is_first_part
            && photographs.last_picture_m(&plan.path).is_some_and(|end_m| soon_m >= end_m)
    }

    /// Whether this vehicle, on the ground, cannot make a commitment, so that vehicles in flight
    /// could not divide the area, and those that were started may wait for it. Either it is ready
    /// or started and no majority hears it; or another vehicle that takes part is in flight or was
    /// started, and this one has no autopilot, position or plan, is away from its pad, or hears
    /// another plan.
    fn cannot_commit_on_ground(&self) -> bool {
        let Some(fleet) = self.neighbours.fleet() else { return false };
        let state_is_before_plan = self.mission.state().is_before_plan();
        let lacks = match self.mission.state() {
            _ if state_is_before_plan => true,
            state if state.waits_on_pad_with_plan() && !fleet.has_lease(self.now) => return true,
            State::Ready => !self.is_at_pad() || self.hears_another_plan(),
            state => state.waits_on_pad_after_start() && self.hears_another_plan(),
        };
        let started = state_is_before_plan && fleet.is_another_started();
        lacks && (started || self.neighbours.is_another_in_flight(self.now, LEASE))
    }

    /// Whether this vehicle was not started: it may take part as a new vehicle.
    pub(super) fn is_not_started(&self) -> bool {
        self.mission.state().is_before_start()
    }

    /// Whether this vehicle resumes, or could resume, its part after it reported that it leaves:
    /// the others may have divided that part by then, so it must not.
    fn resumes_after_leaving(&self) -> bool {
        let resumes = match self.mission.state() {
            State::PilotReturned => self.mission.pending().resume,
            state => state.flies_or_holds_its_part(),
        };
        resumes
            && !self.will_land_off_plan()
            && self.neighbours.fleet().is_some_and(Fleet::has_reported_leaving)
    }

    /// Whether this vehicle was started after it reported that it leaves, and still counts as
    /// having left although a majority hears it: it would take part again unless another one were
    /// in flight.
    fn starts_after_leaving(&self) -> bool {
        self.mission.state().is_started_before_arming()
            && self
                .neighbours
                .fleet()
                .is_some_and(|fleet| fleet.has_reported_leaving() && fleet.has_lease(self.now))
    }

    /// Whether this vehicle flies home, back along its path, or aside without a way back, or seeks
    /// a path for one of these: it lands at the end.
    fn will_land_off_plan(&self) -> bool {
        let home = self.guidance.returning || self.detours.is_homeward();
        home || (self.guidance.ends_away_from_goal && !self.detours.is_beside_plan())
            || self.detours.lands_at_end()
            || self.detours.seeks_landing_aside()
    }

    /// Whether this vehicle must not fly its part any more: the others have divided that part or
    /// count this vehicle as lost, or it flies or starts after it reported that it leaves.
    pub(super) fn is_excluded(&self) -> bool {
        let excluded = self.neighbours.fleet().is_some_and(Fleet::is_excluded);
        (excluded && !self.will_land_off_plan())
            || self.resumes_after_leaving()
            || self.starts_after_leaving()
    }

    /// Place along its path, metres, where the last leg begins, which descends above the pad; −∞
    /// without a path.
    fn last_descent_start_m(&self) -> f32 {
        let waypoints = self.mission.plan().map_or(&[][..], |plan| plan.path.waypoints());
        waypoints.iter().nth_back(1).map_or(f32::NEG_INFINITY, |home| home.along_m)
    }

    /// Commitment that this vehicle can make now: place where it will hold, decimetres along its
    /// path, at the last picture within `COMMITMENT_S` of flight, no further than gates and other
    /// vehicles let it fly, and no nearer than it can stop. `None` where it cannot make one, or has
    /// made one; also until a vehicle that brakes, since its path is blocked or another one has
    /// come near, has slowed enough.
    fn possible_commitment_dm(&self) -> Option<u16> {
        let fleet = self.neighbours.fleet()?;
        if !self.mission.state().may_promise_hold()
            || fleet.commitment_dm().is_some()
            || !(fleet.is_dividing() || self.wants_division())
        {
            return None;
        }
        let plan = self.mission.plan()?;
        let Task::Photograph(photographs) = &plan.task else { return None };
        let along_m = self.guidance.reference_along_m();
        let stops_m = self.guidance.stopping_point_m(&plan.path);
        let ahead_m = match self.mission.state().is_blocked() {
            // A vehicle whose path is blocked promises to hold where it is.
            true => along_m,
            // One that is slow to brake may take longer than `COMMITMENT_S` to stop.
            false => (along_m + COMMITMENT_S * self.config.cruise_mps)
                .max(stops_m + EXTRA_STOPPING_MARGIN_M),
        };
        let gates_m = self.guidance.gates_open_up_to_m(&self.guidance_inputs());
        // The neighbour for which advice stops this vehicle may stay there: this vehicle promises
        // no place beyond the advised stop.
        let clear_m = gates_m.min(along_m + self.guidance.advice.stop_within_m.max(0.0));
        let most_m = ahead_m.min(clear_m).min(self.last_descent_start_m()).max(along_m);
        let stops_for_block =
            self.mission.state().is_blocked() && !self.guidance.is_raw_point_at_setpoint();
        if stops_for_block || stops_m > most_m + MAX_STOP_BEYOND_PROMISE_M {
            return None;
        }
        let stop_m = (stops_m + EXTRA_STOPPING_MARGIN_M).min(most_m);
        let picture_m =
            photographs.last_picture_before_m(&plan.path, most_m).filter(|at_m| *at_m >= stop_m);
        to_decimetres(picture_m.unwrap_or(stop_m)).map(|promise_dm| promise_dm.max(1))
    }

    /// Place where this vehicle is to hold for a division, metres along its path: from its promise
    /// until it gets its plan of that division. `None` where it does not hold.
    pub(super) fn division_hold_m(&self) -> Option<f32> {
        // A promise is a place along its own path, and binds no vehicle that is off that path. This
        // is checked here too, as the fleet learns of a landing or return only in the next step.
        let fleet = self.neighbours.fleet().filter(|fleet| fleet.takes_part())?;
        let behind = fleet.division_count() > self.mission.division_count();
        let held_dm = if behind { fleet.held_at_dm() } else { fleet.commitment_dm()? };
        let elsewhere = self.will_land_off_plan() || self.detours.is_beside_plan();
        (!elsewhere).then_some(f32::from(held_dm) / 10.0)
    }

    /// Whether this vehicle's setpoint stands where the vehicle is to hold for a division.
    pub(super) fn is_holding_for_division(&self) -> bool {
        self.division_hold_m().is_some_and(|at_m| {
            let along_m = self.guidance.reference_along_m();
            along_m >= at_m - AT_HOLD_WITHIN_M
                && self.guidance.is_setpoint_still_outside_descent()
                && self.mission.plan().and_then(|plan| plan.path.point_at(along_m)).is_some_and(
                    |place| {
                        let off = self.guidance.setpoint_position() - place;
                        off.norm_squared() <= AT_HOLD_WITHIN_M * AT_HOLD_WITHIN_M
                    },
                )
        })
    }

    /// Whether no division is under way, and this vehicle flies by the last binding one; true in a
    /// mission without an area.
    pub(super) fn is_division_settled(&self) -> bool {
        self.neighbours.fleet().is_none_or(|fleet| {
            let flown = fleet.division_count() == self.mission.division_count()
                && !self.mission.is_division_plan_ready();
            flown && !fleet.is_dividing()
        })
    }

    /// Whether this vehicle stands where its plan of the last division begins: on its pad, or where
    /// it held.
    fn is_at_division_start(&self) -> bool {
        match self.mission.state() {
            State::Dividing => self.guidance.is_raw_point_at_setpoint(),
            state => state.waits_to_fly_plan(),
        }
    }

    /// Takes up its own plan, which the shell has returned again as `plan`, beyond the obstacle
    /// that it flew around; gives the plan up if its path does not pass the end of the detour.
    fn resume_plan_beyond_detour(&mut self, plan: &VehiclePlan<W, G>) {
        let Some(RejoinPlace { along_m: back_m, position }) = self.detours.rejoin_place() else {
            return;
        };
        let back = plan.path.point_at(back_m);
        let here =
            self.mission.plan().and_then(|around| around.path.point_at(around.path.length_m()));
        let near = |place: Point| (position - place).length() < AT_HOLD_WITHIN_M;
        let meets = back.is_some_and(near) && here.is_some_and(near);
        if meets {
            let ground_m = self.planned_ground_m();
            let left = self.mission.resume_own_path(plan, self.detours.left_at_m(), back_m);
            self.mission.note_ground_below_start(ground_m);
            if left > 0 {
                self.links.send_text_with_numbers(
                    Severity::Warning,
                    "Flown around: # waypoints are left",
                    [left, 0],
                );
                // The queue is full only if the shell does not drain the events; then this event is
                // lost.
                let _ = self.events.push_back(Event::DetourSkippedWaypoints { count: left });
            }
            self.neighbours.forget_avoided();
            self.guidance.begin_path_at(back_m, self.now);
        }
        match meets {
            true => self.detours.end_area_detour(&mut self.timers),
            false => self.detours.give_up_plan(),
        }
    }

    /// Handles the shell's answer to the request for a division's plan.
    pub(super) fn handle_division_plan(
        &mut self,
        outcome: Result<&VehiclePlan<W, G>, PlanFailure>,
    ) {
        let may_take = self.is_at_division_start();
        let Some(fleet) = self.neighbours.fleet_mut() else { return };
        if !self.mission.close_division_request(fleet.division_inputs_hash()) {
            return;
        }
        let (division, along_m) = (fleet.division_count(), f32::from(fleet.held_at_dm()) / 10.0);
        match outcome {
            // After a late answer the request is repeated.
            Err(PlanFailure::Late) => {}
            // All vehicles fail alike: each keeps its part, and the waypoints of the lost vehicle
            // are left.
            Err(_) if fleet.is_division_to_be_computed() => {
                fleet.set_hash_from_plan(IMPOSSIBLE_DIVISION_CRC);
                self.links.send_text(Severity::Warning, "What is left cannot be divided");
            }
            Err(_) if may_take && self.detours.is_beside_plan() => {
                self.detours.give_up_plan();
            }
            Err(_) if may_take && division > self.mission.division_count() => {
                self.mission.keep_plan_after_division(division);
            }
            Err(_) => {}
            Ok(plan) if fleet.is_division_to_be_computed() => {
                fleet.set_hash_from_plan(plan.swarm_plan_crc);
            }
            Ok(plan)
                if may_take
                    && division == self.mission.division_count()
                    && self.detours.is_beside_plan() =>
            {
                self.resume_plan_beyond_detour(plan);
            }
            Ok(plan) if may_take && division > self.mission.division_count() => {
                let in_air = self.mission.state() == State::Dividing;
                let own = self.mission.plan().and_then(|plan| plan.path.point_at(along_m));
                let here = self.detours.rejoin_place().map(|back| back.position).or(own);
                let place = here.filter(|_| in_air).unwrap_or(self.mission.path_start());
                let ground_m = self.planned_ground_m();
                if self.mission.accept_division_plan(plan, &place, division) {
                    self.mission.note_ground_below_start(ground_m);
                    self.neighbours.forget_plan();
                    self.detours.forget_plan(&mut self.timers);
                    // From now on places are measured along the new path.
                    match in_air {
                        true => self.guidance.begin_path(self.now),
                        false => self.guidance.reset(),
                    }
                } else if self.detours.is_beside_plan() {
                    self.detours.give_up_plan();
                } else {
                    self.links.send_text(Severity::Warning, "The division begins elsewhere");
                }
            }
            Ok(_) => {}
        }
    }
}
