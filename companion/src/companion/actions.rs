//! Runs the mission table: the row that applies, and its action.

use super::Companion;
use super::division::LEAVE_WITHOUT_COMMITMENT_AFTER;
use crate::autopilot::handshake::DISARM_EVERY;
use crate::config::PlanFailure;
use crate::events::{Event, PlanKind};
use crate::link::severity::Severity;
use crate::mission::{self, Action, State, TransitionRow};
use crate::replanning::detour::path_kind::DetourPurpose;
use crate::timers::Timer;

/// Maximum number of transitions that one evaluation of the mission table makes. More would mean
/// that the table has a cycle.
const MAX_TRANSITIONS_PER_EVALUATION: usize = 4;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Takes rows of the mission table until none applies, or `MAX_TRANSITIONS_PER_EVALUATION` were
    /// taken.
    pub(super) fn run_mission_table(&mut self) {
        for _ in 0..MAX_TRANSITIONS_PER_EVALUATION {
            let inputs = self.guard_inputs();
            let Some(row) = mission::first_applicable_row(self.mission.state(), &inputs) else {
                return;
            };
            self.apply_row(row);
        }
    }

    /// Takes a row: changes the state, runs the row's action, and reports the change by text and
    /// event.
    pub(super) fn apply_row(&mut self, row: &'static TransitionRow) {
        let now = self.now;
        // The state that is resumed if this row interrupts a search for a path: the landing if the
        // search is for a landing place, unless the vehicle flies back or home.
        let lands = self.detours.seeks_landing_aside()
            && !self.guidance.returning
            && !self.detours.is_homeward();
        let after_search = if lands { State::Land } else { State::Blocked };
        let (from, to) =
            self.mission.enter_state(row, self.telemetry.custom_mode, after_search, now);
        self.handshake.reset_for_state(from, to);
        self.run_action(from, to, row);
        // Leaving a replanning state ends the search for a detour.
        if from.waits_for_detour() {
            self.detours.cancel_request();
        }
        if to == State::Follow {
            self.detours.take_up_plan();
        }
        if !row.text.is_empty() {
            self.links.send_text(row.severity, row.text);
        }
        if let Some(text) = self.mission.interruption_text(from, to) {
            self.links.send_text(Severity::Info, text);
        }
        // The queue is full only if the shell does not drain it: then this event is lost.
        let warning = row.severity == Severity::Warning;
        let changed = Event::StateChanged { from, to, text: row.text, warning };
        let _ = self.events.push_back(changed);
        // Where setpoints begin to stream, the next step is due at once.
        if to.streams_setpoints() && !from.streams_setpoints() {
            self.timers.set(Timer::Step, now);
        }
    }

    /// Runs the action of a row that leads from state `from` to `to`; the state is `to` already.
    pub(super) fn run_action(&mut self, from: State, to: State, row: &TransitionRow) {
        let now = self.now;
        self.update_place_before_jump(to);
        let position = self.telemetry.position;
        match row.action {
            Action::None | Action::ForgetStart => {}
            Action::Connect => self.request_streams(),
            Action::RequestPlan => {
                self.mission.forget_plan();
                self.detours.forget_plan(&mut self.timers);
                self.neighbours.forget_plan();
                self.guidance.reset();
                let photographed = self.mission.photographed_mut();
                if self.config.skips_photographed {
                    photographed.prepare_plan_of_rest();
                } else {
                    photographed.prepare_plan_of_new_round();
                }
                // Where a late plan is asked for again, the flight has begun already: what is known
                // of it stays, and a vehicle that has left since stays so.
                let again = from == State::Planning;
                if let Some(fleet) = self.neighbours.fleet_mut().filter(|_| !again) {
                    if fleet.has_reported_leaving() {
                        // The vehicle takes part again. Others have to hear it first, so it keeps
                        // its share for at least this time though it cannot make a commitment yet.
                        self.timers.set(
                            Timer::LeaveWithoutCommitment,
                            now + LEAVE_WITHOUT_COMMITMENT_AFTER,
                        );
                    }
                    fleet.begin_flight(now);
                    self.detours.begin_flight();
                }
                let _ = self.events.push_back(Event::PlanRequested(PlanKind::Mission));
            }
            Action::HoldHere if to == State::Streaming => {
                self.mission.note_pad_left();
                self.guidance.stop_and_hold(position);
            }
            Action::HoldHere if to == State::PilotReturned => {
                self.guidance.hold_after_pilot(position, self.mission.plan());
            }
            Action::HoldHere => self.guidance.stop_and_hold(position),
            Action::HoldLanding => {
                self.timers.set(Timer::Request, now);
                self.timers.set(Timer::UnheardMode, now);
            }
            Action::RequestSetpointMode | Action::RequestArming | Action::RequestTakeOff => {
                self.timers.set(Timer::Request, now);
            }
            Action::RequestLandMode => self.request_landing(from),
            Action::RequestDisarming if to == State::Disarm => {
                self.timers.set(Timer::Request, now + DISARM_EVERY);
            }
            Action::RequestDisarming | Action::CancelStart => self.timers.set(Timer::Request, now),
            Action::BeginClimb => self.guidance.begin_climb(&position),
            Action::FollowPath => self.guidance.start_following(now),
            Action::RequestDetour => self.request_detour(DetourPurpose::Goal),
            Action::RequestPathHome => self.request_detour(DetourPurpose::Home),
            Action::RequestDetourBackToPath => self.request_detour_back_to_path(),
            Action::TurnHome => {
                self.guidance.cancel_evasion();
                self.detours.begin_way_home(now, &mut self.timers);
            }
            Action::RequestDetourAside => {
                self.guidance.cancel_evasion();
                self.request_detour_aside(from);
            }
            Action::RequestLanding => self.request_detour(DetourPurpose::LandingAside),
            Action::NoteDetourFailure => self.handle_detour_failure(PlanFailure::Late),
            Action::FlyDetour => self.guidance.start_following(now),
            Action::FlyDivision => {
                self.mission.note_division_plan_begun();
                self.detours.give_up_plan();
                self.guidance.start_following(now);
            }
            Action::BrakeOnPath => self.guidance.cancel_evasion(),
            Action::Rejoin => self.resume_interrupted_state(from, to),
            Action::TurnBack => {
                self.detours.begin_turn_back();
                let along_m = self.guidance.reported_progress_m(from, &self.guidance_inputs());
                let guidance = &mut self.guidance;
                self.mission.reverse_path(along_m, |path| guidance.reverse_path(path, now));
            }
        }
    }

    /// Begins the landing of a vehicle that was in state `from`: by setpoints that lead straight
    /// down, or by a request for the landing mode.
    pub(super) fn request_landing(&mut self, from: State) {
        use State::*;
        self.timers.set(Timer::Request, self.now);
        let position = self.telemetry.position;
        // Others avoid the place where an unheard vehicle may be on the ground, so setpoints guide
        // the vehicle straight down to that place. A held landing continues as it began: by
        // setpoints or the autopilot.
        if from == SwarmLinkLost || (from == LandingHeld && self.guidance.is_guiding_landing()) {
            return self.guidance.begin_guided_landing(self.now);
        }
        self.guidance.end_guided_landing();
        match from {
            _ if from.lands_at_reference() => self.guidance.cancel_evasion(),
            LandingHeld => self.guidance.stop_and_hold(position),
            // Off the path the reference may be behind a wall, so the vehicle holds where it is.
            _ => self.guidance.hold_off_path(position),
        }
    }

    /// Resumes, in guidance, the state `to` that was interrupted.
    pub(super) fn resume_interrupted_state(&mut self, from: State, to: State) {
        let (now, position) = (self.now, self.telemetry.position);
        match to {
            State::TakeOff => self.timers.set(Timer::Request, now),
            State::Land => self.request_landing(from),
            _ => {
                let climbs = self.mission.uninterrupted_state().takes_off();
                match self.mission.plan() {
                    Some(_) if climbs => self.guidance.resume_climb(&position, now),
                    Some(plan) => self.guidance.resume_flight(plan, &position, now),
                    None => {}
                }
                if to == State::Blocked {
                    // The path counts as blocked until the next scan has checked it.
                    self.detours.assume_blocked();
                }
                if !to.setpoint_advances() {
                    self.guidance.cancel_evasion();
                }
            }
        }
    }
}
