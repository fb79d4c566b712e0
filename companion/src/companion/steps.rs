//! The control step, and the actions of the mission table's rows.

use super::division::CANNOT_START_MOST;
use super::{Companion, IDLE_STEP_EVERY, MAX_TRANSITIONS_PER_STEP, REPORT_EVERY, SETPOINT_EVERY};
use crate::autopilot::requests::DISARM_EVERY;
use crate::config::PlanFailure;
use crate::events::{Event, Link, PlanKind};
use crate::guidance::GuidanceInputs;
use crate::link::OnDemandMessage;
use crate::link::severity::Severity;
use crate::margins;
use crate::mission::task::{PathProgress, PathRelation};
use crate::mission::{self, Action, State, TransitionRow};
use crate::storage::store::ErasePermission;
use crate::swarm::detour::path_kind::DetourPurpose;
use crate::timers::Timer;

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// One step of the control loop: guidance, division, scan of the path, mission table, requests
    /// to the autopilot.
    pub(super) fn step(&mut self) {
        let now = self.now;
        if self.services.has_unapplied_parameters()
            && self.erase_permission() == ErasePermission::Allowed
        {
            self.apply_parameters();
        }
        self.check_estimate_error();
        self.neighbours.set_place(self.telemetry.position, self.config.radio_range_m);
        let dt_s = self.timers.step_s(now).clamp(0.0, 0.2);
        let scene = GuidanceInputs::new(
            self.mission.plan(),
            &self.telemetry,
            (self.neighbours.own_rank(), self.config.system_id),
            self.detours.path_source(),
        );
        if !self.guidance.step(self.mission.state(), &scene, &mut self.neighbours, now, dt_s)
            && self.timers.take_due(Timer::HeldReport, now, REPORT_EVERY)
        {
            self.links.send_text(Severity::Warning, "Setpoint out of limits: holding");
        }
        if self.guidance.take_hold_changed() {
            self.links.set_due(Link::Swarm, OnDemandMessage::Intent);
        }
        self.step_division();
        self.report_unstarted_vehicle();
        self.scan_for_obstacles();
        self.note_barred_start();
        self.run_mission_table();
        self.step_task();
        let situation = self.request_context();
        if self.requests.send_due_requests(
            &self.telemetry,
            &situation,
            &mut self.timers,
            &mut self.links,
        ) {
            self.guidance.set_limits(&self.config, self.requests.limits());
        }
        let flows = self.mission.state().streams_setpoints();
        let every = if flows {
            self.links.set_due(Link::Autopilot, OnDemandMessage::Setpoint);
            SETPOINT_EVERY
        } else {
            self.links.clear_due(Link::Autopilot, OnDemandMessage::Setpoint);
            IDLE_STEP_EVERY
        };
        self.timers.schedule_next(Timer::Step, now, every);
    }

    /// Sends the commands of the task (pictures, camera) that are due at the vehicle's place.
    fn step_task(&mut self) {
        let state = self.mission.state();
        let off_plan = self.guidance.returning
            || self.guidance.ends_away_from_goal
            || self.detours.is_on_detour();
        let along = PathProgress {
            progress_m: self.guidance.progress_m(state, &self.guidance_inputs()),
            reference_m: self.guidance.along_m(),
            // A vehicle that brakes along its path still takes the pictures that it passes.
            place: match state.is_on_path() {
                true if self.detours.is_beside_plan() && !self.guidance.returning => {
                    PathRelation::Beside
                }
                true if !off_plan => PathRelation::OnPath,
                _ => PathRelation::Elsewhere,
            },
        };
        let leaves_path = self.mission.step_task(along, self.now, &mut self.links);
        // Braking to land, the vehicle goes on along its path, and takes no pictures.
        let photographs = along.place == PathRelation::OnPath
            || (!off_plan && (leaves_path || self.guidance.is_at_end(&self.guidance_inputs())));
        let pictures_to_m = photographs.then_some(along.progress_m);
        let due = self.take_photographed_due();
        if due || leaves_path {
            self.note_photographed(pictures_to_m);
        }
        if due {
            self.keep_and_report_photographed();
        }
    }

    /// Notes whether a vehicle that is due to depart is kept on its pad by another vehicle in the
    /// column above the pad, or by a blocked path.
    fn note_barred_start(&mut self) {
        let due = self.mission.departure_due(self.now) && self.guidance.may_depart();
        let waits =
            due && self.mission.state() == State::Scheduled && !self.mission.pending().pause;
        if waits && (!self.guidance.filter.column_clear() || self.detours.is_blocked()) {
            self.mission.note_start_barred(self.now);
        } else {
            self.mission.note_start_free(self.now);
        }
    }

    /// Reports, by text and event, a vehicle that this one waits for and that was not started.
    fn report_unstarted_vehicle(&mut self) {
        let flies =
            matches!(self.mission.state(), State::Scheduled | State::Follow | State::Blocked);
        let waited = Some(self.guidance.advice.waiting_for).filter(|id| flies && *id != 0);
        let id = waited.filter(|id| self.neighbours.is_not_started(*id)).unwrap_or(0);
        if self.mission.should_report_wait(id, self.now) {
            self.links.send_text_with_numbers(
                Severity::Warning,
                "Waiting for vehicle #: it has not started",
                [u32::from(id), 0],
            );
            // The queue is full only if the shell does not drain the events.
            let _ = self.events.push_back(Event::WaitsForStart { id });
        }
    }

    /// Sets the share of the cruise speed at which the error bound of the position estimate fits
    /// into the margin to walls, and reports a change.
    pub(super) fn check_estimate_error(&mut self) {
        let (now, config) = (self.now, &self.config);
        let bound_m = self.telemetry.estimate_bound_m(now, config.estimate_m);
        // A bound as good as the best receiver's refuses nothing: the operator chose the margin.
        let pace = match bound_m <= margins::MIN_ESTIMATE_ERROR_M {
            true => 1.0,
            false => margins::speed_share_for_bound(
                bound_m,
                config.required_clearance_m,
                config.radius_m,
            ),
        };
        let before = self.guidance.set_estimate_speed_share(pace);
        self.mission.note_estimate_speed_share(pace, now);
        let kind = |pace: f32| if pace >= 1.0 { 2 } else { u8::from(pace > 0.0) };
        if kind(before) == kind(pace) || !self.mission.state().streams_setpoints() {
            return;
        }
        // In whole centimetres, rounded up; a bound above 100 m stands for an unknown accuracy.
        let cm = libm::ceilf(libm::fminf(bound_m, 100.0) * 100.0) as u32;
        let room_m = margins::estimate_margin_m(
            config.required_clearance_m,
            config.radius_m,
            margins::TRACKING_M,
        );
        let room_cm = libm::fmaxf(room_m * 100.0, 0.0) as u32;
        let (severity, text) = match kind(pace) {
            2 => (Severity::Info, "Estimate within # cm again"),
            1 => (Severity::Warning, "Estimate within # cm, margin # cm: slower"),
            _ if bound_m > 100.0 => (Severity::Warning, "Estimate of unknown accuracy: stopping"),
            _ => (Severity::Warning, "Estimate within # cm, margin # cm: stopping"),
        };
        self.links.send_text_with_numbers(severity, text, [cm, room_cm]);
    }

    pub(super) fn run_mission_table(&mut self) {
        for _ in 0..MAX_TRANSITIONS_PER_STEP {
            let inputs = self.guard_inputs();
            let Some(row) = mission::first_applicable_row(self.mission.state(), &inputs) else {
                return;
            };
            self.apply_row(row);
        }
    }

    pub(super) fn apply_row(&mut self, row: &'static TransitionRow) {
        let now = self.now;
        // After an interruption, a vehicle that sought a landing place resumes with a landing.
        let lands =
            self.detours.seeks_landing() && !self.guidance.returning && !self.detours.is_homeward();
        let after_search = if lands { State::Land } else { State::Blocked };
        let (from, to) =
            self.mission.enter_state(row, self.telemetry.custom_mode, after_search, now);
        self.requests.reset_for_state(from, to);
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
        // The queue is full only if the shell does not drain: then this event is lost.
        let warning = row.severity == Severity::Warning;
        let changed = Event::StateChanged { from, to, text: row.text, warning };
        let _ = self.events.push_back(changed);
        // Where setpoints begin to stream, the next step is due at once.
        if to.streams_setpoints() && !from.streams_setpoints() {
            self.timers.set(Timer::Step, now);
        }
    }

    pub(super) fn run_action(&mut self, from: State, to: State, row: &TransitionRow) {
        let now = self.now;
        self.save_place_before_jump(to);
        let position = self.telemetry.position;
        match row.action {
            Action::None | Action::ForgetStart => {}
            Action::Connect => self.request_streams(),
            Action::RequestPlan => {
                self.mission.forget_plan();
                self.detours.forget_plan();
                self.neighbours.forget_plan();
                self.guidance.reset();
                let photographed = self.mission.photographed_mut();
                if self.config.skips_photographed {
                    photographed.prepare_plan_of_rest();
                } else {
                    photographed.prepare_plan_of_new_round();
                }
                if let Some(fleet) = self.neighbours.fleet_mut() {
                    if fleet.has_reported_leaving() {
                        // The vehicle takes part again: it leaves its share at the earliest after
                        // this time, since others have to hear it first.
                        self.timers.set(Timer::LeaveWithoutCommitment, now + CANNOT_START_MOST);
                    }
                    fleet.begin_flight(now);
                    self.detours.begin_flight();
                }
                let _ = self.events.push_back(Event::PlanRequested(PlanKind::Mission));
            }
            Action::HoldHere if to == State::Streaming => {
                self.mission.leave_pad();
                self.guidance.hold_at(position);
            }
            Action::HoldHere if to == State::PilotReturned => {
                self.guidance.hold_after_pilot(position, self.mission.plan());
            }
            Action::HoldHere => self.guidance.hold_at(position),
            Action::HoldOver => self.timers.set(Timer::Request, now),
            Action::RequestOffboard | Action::RequestArming | Action::RequestTakeOff => {
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
                self.detours.begin_way_home(now);
            }
            Action::RequestDetourAside => {
                self.guidance.cancel_evasion();
                self.request_detour_aside(from);
            }
            Action::RequestLanding => self.request_detour(DetourPurpose::Landing),
            Action::NoteDetourFailure => self.handle_detour_failure(PlanFailure::Late),
            Action::FlyDetour => self.guidance.start_following(now),
            Action::FlyDivision => {
                self.mission.note_division_flown();
                self.detours.give_up_plan();
                self.guidance.start_following(now);
            }
            Action::BrakeOnPath => self.guidance.cancel_evasion(),
            Action::Rejoin => self.resume_interrupted_state(from, to),
            Action::TurnBack => {
                self.detours.begin_way_back();
                let along_m = self.guidance.progress_m(from, &self.guidance_inputs());
                let guidance = &mut self.guidance;
                self.mission.reverse_path(along_m, |path| guidance.reverse_path(path, now));
            }
        }
    }

    pub(super) fn request_landing(&mut self, from: State) {
        use State::*;
        self.timers.set(Timer::Request, self.now);
        let position = self.telemetry.position;
        // Others avoid the place where an unheard vehicle may be on the ground, so setpoints guide
        // it straight down. A held landing continues as it began: by setpoints or the autopilot.
        if from == Alone || (from == LandingHeld && self.guidance.is_guiding_landing()) {
            return self.guidance.begin_guided_landing(self.now);
        }
        self.guidance.end_guided_landing();
        match from {
            Follow | Paused | Alone | Blocked | Replanning | Dividing | Stopping | Land
            | Disarm => {
                self.guidance.cancel_evasion();
            }
            LandingHeld => self.guidance.hold_at(position),
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
                    // Counts as blocked until the next scan has checked the path.
                    self.detours.assume_blocked();
                }
                if !to.advances() {
                    self.guidance.cancel_evasion();
                }
            }
        }
    }
}
