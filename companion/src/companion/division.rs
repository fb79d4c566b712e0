//! A coverage mission whose vehicles are lost: what this one says of itself, where it holds, and
//! what it asks the shell for.

use planner_core::flight::{Task, VehiclePlan};
use planner_core::{Length, Point};

use super::Companion;
use crate::config::PlanFailure;
use crate::events::{Event, PlanKind};
use crate::link::roster::MemberStatus;
use crate::mission::State;
use crate::swarm::detour::flown::RejoinPlace;
use crate::swarm::fleet::{COMMITMENT_S, DivisionInput, Fleet, OwnReport};
use crate::time::Duration;

/// Margin added to the stopping distance when a vehicle commits itself to a hold, metres.
const EXTRA_STOPPING_MARGIN_M: f32 = 0.3;
/// A vehicle within this distance of the place where it promised to hold has reached it, metres.
const AT_HOLD_M: f32 = 0.2;
/// Silence of another vehicle after which a vehicle waits above its own pad: the silent vehicle's
/// share may yet be given to it.
pub(super) const MISSED_AFTER: Duration = Duration::from_secs(3);
/// Time under a pilot's control after which a vehicle has left the mission.
const PILOT_KEEPS_AFTER: Duration = Duration::from_secs(20);
/// Reported in place of a plan CRC where the rest of the area cannot be divided.
const UNDIVIDED: u32 = u32::MAX;
/// Time after which a shell that has not answered is asked again.
const REQUEST_RETRY: Duration = Duration::from_secs(30);

fn to_decimetres(along_m: f32) -> Option<u16> {
    let dm = libm::ceilf(along_m * 10.0);
    (0.0..=f32::from(u16::MAX)).contains(&dm).then_some(dm as u16)
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// The losses of the division that the shell is asked for by [`PlanKind::Division`], division
    /// by division: the lots of all vehicles by rank.
    pub fn losses(&self) -> impl Iterator<Item = &[DivisionInput]> {
        self.neighbours.fleet().into_iter().flat_map(Fleet::losses)
    }

    /// Updates which vehicles still fly, and what of the area is to be divided again.
    pub(super) fn step_division(&mut self) {
        let now = self.now;
        if self.neighbours.fleet().is_none() {
            return;
        }
        let own = self.own_fleet_report();
        self.neighbours.step_fleet(&own, now);
        let Some(fleet) = self.neighbours.fleet() else { return };
        let (home_m, around) = (self.last_descent_start_m(), self.detours.is_beside_plan());
        // A vehicle that has left the mission is on its way to the ground.
        let waits =
            fleet.takes_part() && (fleet.is_dividing() || fleet.is_any_missing(now, MISSED_AFTER));
        let halt_m = match self.division_hold_m() {
            Some(holds_at_m) => holds_at_m,
            // The end of a way around is not its pad.
            None if waits && !around && self.guidance.along_m() <= home_m + AT_HOLD_M => home_m,
            None => f32::INFINITY,
        };
        let behind = fleet.division_count() > self.mission.division_count();
        let wants = fleet.needs_division() || ((behind || around) && self.is_at_division_start());
        let fingerprint = fleet.division_hash();
        self.guidance.set_halt_m(halt_m);
        if wants && self.mission.should_request_division(fingerprint, now, REQUEST_RETRY) {
            // Full only if the shell does not drain; then it is asked again.
            let _ = self.events.push_back(Event::PlanRequested(PlanKind::Division));
        }
    }

    /// State of this vehicle as it reports it to the fleet.
    fn own_fleet_report(&self) -> OwnReport {
        use State::*;
        let state = self.mission.state();
        let off_plan = self.guidance.returning
            || self.guidance.ends_aside
            || self.detours.is_on_detour()
            || self.detours.is_homeward()
            || self.detours.has_left_plan();
        // Around something, and back: its part stays its own.
        let beside = self.detours.is_beside_plan();
        let ends = match state {
            Stopping | Land | LandingHeld | Disarm | Failsafe | Done | Aborted => true,
            PilotControl | PilotReturned => {
                self.mission.time_with_pilot(self.now) >= PILOT_KEEPS_AFTER
            }
            _ => off_plan && !beside,
        };
        let along_m = self.guidance.progress_m(state, &self.guidance_inputs());
        let flies = self.guidance.along_m() >= 0.0 && !off_plan;
        // A vehicle that holds, or waits, may have come a little further than where its descent
        // begins.
        let descends = self.guidance.along_m() > self.last_descent_start_m() + AT_HOLD_M;
        let nearly_down = flies && descends && self.division_hold_m().is_none();
        let standing = match ends || nearly_down {
            true if self.mission.has_all_pictures(along_m) => MemberStatus::Finished,
            _ if ends => MemberStatus::Left,
            _ => MemberStatus::Alive,
        };
        let on_pad = matches!(state, Ready | Scheduled | PadReplanning);
        OwnReport {
            status: standing,
            waits: self.is_not_started(),
            division: self.mission.division_count(),
            progress_dm: if flies {
                (along_m * 10.0).clamp(0.0, f32::from(u16::MAX)) as u16
            } else {
                0
            },
            commitment_dm: if on_pad { Some(0) } else { self.commitment_dm().filter(|_| flies) },
            // Beside its path it waits for its own plan, to fly on to where it promised to hold.
            holds: on_pad || (state == Dividing && !beside),
            wants_division: flies && self.wants_division(),
        }
    }

    /// Whether all are to divide what is left, since its path ends soon, and before its route.
    fn wants_division(&self) -> bool {
        let Some(plan) = self.mission.plan() else { return false };
        let Task::Photograph(photographs) = &plan.task else { return false };
        let soon_m = self.guidance.along_m() + COMMITMENT_S * self.config.cruise_mps;
        photographs.goes_on
            && photographs.last_picture_m(&plan.path).is_some_and(|end_m| soon_m >= end_m)
    }

    /// Whether it has not been started: it may take part as a vehicle that is new.
    pub(super) fn is_not_started(&self) -> bool {
        use State::*;
        matches!(self.mission.state(), WaitAutopilot | WaitPosition | Planning | Ready)
    }

    /// Whether the vehicle would resume its part after it has reported that it leaves: the others
    /// may have divided that part by then.
    fn resumes_too_late(&self) -> bool {
        let resumes = match self.mission.state() {
            State::PilotReturned => self.mission.pending().resume,
            state => matches!(state, State::Dividing | State::Follow | State::Blocked),
        };
        resumes
            && !self.is_landing_off_plan()
            && self.neighbours.fleet().is_some_and(Fleet::has_reported_leaving)
    }

    /// Whether it flies home, back, or aside, to land there.
    fn is_landing_off_plan(&self) -> bool {
        let home = self.guidance.returning || self.detours.is_homeward();
        home || (self.guidance.ends_aside && !self.detours.is_beside_plan())
            || self.detours.lands_at_end()
            || self.detours.seeks_landing()
    }

    /// Whether others have divided its part, or count it as lost, while it would fly it.
    pub(super) fn is_excluded(&self) -> bool {
        let excluded = self.neighbours.fleet().is_some_and(Fleet::is_excluded);
        (excluded && !self.is_landing_off_plan()) || self.resumes_too_late()
    }

    /// Place where this vehicle's last descent begins, metres along its path: above its pad.
    fn last_descent_start_m(&self) -> f32 {
        let waypoints = self.mission.plan().map_or(&[][..], |plan| plan.path.waypoints());
        waypoints.iter().nth_back(1).map_or(f32::NEG_INFINITY, |home| home.along_m)
    }

    /// Place where this vehicle would hold if it committed itself now: at the last picture that it
    /// takes soon, no further than its gates are open and no nearer than it can stop.
    fn commitment_dm(&self) -> Option<u16> {
        use State::*;
        let fleet = self.neighbours.fleet()?;
        let moves = matches!(self.mission.state(), Follow | Paused | Alone | Blocked | Replanning);
        if !moves
            || !(fleet.is_dividing() || self.wants_division())
            || fleet.commitment_dm().is_some()
        {
            return None;
        }
        let plan = self.mission.plan()?;
        let Task::Photograph(photographs) = &plan.task else { return None };
        let along_m = self.guidance.along_m();
        // A vehicle whose path is blocked comes no further.
        let promise_s =
            if matches!(self.mission.state(), Blocked | Replanning) { 0.0 } else { COMMITMENT_S };
        let ahead_m = along_m + promise_s * self.config.cruise_mps;
        let clear_m = self.guidance.gates_open_up_to_m(&self.guidance_inputs());
        let most_m = ahead_m.min(clear_m).min(self.last_descent_start_m()).max(along_m);
        let stop_m = (self.guidance.stopping_point_m() + EXTRA_STOPPING_MARGIN_M).min(most_m);
        let picture_m =
            photographs.last_picture_before_m(&plan.path, most_m).filter(|at_m| *at_m >= stop_m);
        to_decimetres(picture_m.unwrap_or(stop_m)).map(|promise_dm| promise_dm.max(1))
    }

    /// Place where this vehicle is to hold for a division, metres along its path: while the
    /// division is under way, and until the new path of this vehicle has come.
    pub(super) fn division_hold_m(&self) -> Option<f32> {
        // The fleet does not know yet what this vehicle was commanded since the last step. A
        // promise is a place of its own path.
        let elsewhere = self.is_landing_off_plan() || self.detours.is_beside_plan();
        let fleet = self.neighbours.fleet().filter(|fleet| fleet.takes_part() && !elsewhere)?;
        let behind = fleet.division_count() > self.mission.division_count();
        let held_dm = behind.then(|| fleet.held_at_dm());
        held_dm.or(fleet.commitment_dm()).map(|dm| f32::from(dm) / 10.0)
    }

    /// Whether it stands at that place.
    pub(super) fn is_holding_for_division(&self) -> bool {
        self.division_hold_m().is_some_and(|at_m| {
            self.guidance.along_m() >= at_m - AT_HOLD_M && self.guidance.is_standing()
        })
    }

    /// Whether no division is under way or to be flown.
    pub(super) fn is_undivided(&self) -> bool {
        self.neighbours.fleet().is_none_or(|fleet| {
            let flown = fleet.division_count() == self.mission.division_count()
                && !self.mission.has_division();
            flown && !fleet.is_dividing()
        })
    }

    /// Whether it stands where the plan after the last division begins.
    fn is_at_division_start(&self) -> bool {
        match self.mission.state() {
            State::Ready | State::Scheduled => true,
            State::Dividing => self.guidance.is_at_rest_on_raw_point(),
            _ => false,
        }
    }

    /// Continues along its own path beyond the obstacle.
    fn resume_own_plan(&mut self, plan: &VehiclePlan<W, G>) {
        let Some(RejoinPlace { along_m: back_m, position }) = self.detours.rejoin() else {
            return;
        };
        let back = plan.path.point_at(back_m);
        let here =
            self.mission.plan().and_then(|around| around.path.point_at(around.path.length_m()));
        let near = |place: Point| (position - place).length() < AT_HOLD_M;
        let meets = back.is_some_and(near) && here.is_some_and(near);
        if meets {
            let left = self.mission.resume_own_path(plan, self.detours.left_at_m(), back_m);
            if left > 0 {
                self.links.send_text_with_numbers(
                    true,
                    "Flown around: # waypoints are left",
                    [left, 0],
                );
                // Full only if the shell does not drain.
                let _ = self.events.push_back(Event::FlownAround { left });
            }
            self.neighbours.forget_avoided();
            self.guidance.begin_path_at(back_m, self.now);
        }
        self.detours.end_field_detour(meets);
    }

    /// Handles the plan that the shell computed for the division.
    pub(super) fn handle_division_plan(
        &mut self,
        outcome: Result<&VehiclePlan<W, G>, PlanFailure>,
    ) {
        let may_take = self.is_at_division_start();
        let Some(fleet) = self.neighbours.fleet_mut() else { return };
        if !self.mission.take_division_request(fleet.division_hash()) {
            return;
        }
        let (division, along_m) = (fleet.division_count(), f32::from(fleet.held_at_dm()) / 10.0);
        match outcome {
            // A shell that is late is asked again.
            Err(PlanFailure::Late) => {}
            // All come to the same: each keeps its part, and what the lost one left is left out.
            Err(_) if fleet.needs_division() => {
                fleet.take_plan_crc(UNDIVIDED);
                self.links.send_text(true, "What is left cannot be divided");
            }
            Err(_) if may_take && self.detours.is_beside_plan() => {
                self.detours.end_field_detour(false);
            }
            Err(_) if may_take && division > self.mission.division_count() => {
                self.mission.keep_plan_after_division(division);
            }
            Err(_) => {}
            Ok(plan) if fleet.needs_division() => fleet.take_plan_crc(plan.plan_crc),
            Ok(plan)
                if may_take
                    && division == self.mission.division_count()
                    && self.detours.is_beside_plan() =>
            {
                self.resume_own_plan(plan);
            }
            Ok(plan) if may_take && division > self.mission.division_count() => {
                let in_air = self.mission.state() == State::Dividing;
                let own = self.mission.plan().and_then(|plan| plan.path.point_at(along_m));
                let here = self.detours.rejoin().map(|back| back.position).or(own);
                let place = here.filter(|_| in_air).unwrap_or(self.mission.path_start());
                if self.mission.accept_division(plan, &place, division, in_air) {
                    self.neighbours.forget_plan();
                    self.detours.forget_plan();
                    // From now on places are those along the new path.
                    match in_air {
                        true => self.guidance.begin_path(self.now),
                        false => self.guidance.reset(),
                    }
                } else if self.detours.is_beside_plan() {
                    self.detours.end_field_detour(false);
                } else {
                    self.links.send_text(true, "The division begins elsewhere");
                }
            }
            Ok(_) => {}
        }
    }
}
