//! What is done as time passes: the control step, and the messages that are sent periodically.

use super::{Companion, HEARTBEAT_EVERY, WARNING_EVERY};
use crate::autopilot::handshake::is_battery_known_or_unchecked;
use crate::events::{Event, Link};
use crate::guidance::GuidanceInputs;
use crate::link::OnDemandMessage;
use crate::link::severity::Severity;
use crate::margins;
use crate::mission::task::{PathProgress, PathRelation};
use crate::state::State;
use crate::storage::store::ErasePermission;
use crate::time::{Duration, Instant};
use crate::timers::Timer;

/// Period of setpoints, and of control steps while setpoints are sent: 20 Hz, twice the least rate
/// that PX4 needs in practice.
const SETPOINT_EVERY: Duration = Duration::from_millis(50);
/// Time in `Scheduled` after which the companion reports that the start waits for the battery's
/// charge to be known: an autopilot that was just found reports the charge within a second.
const UNKNOWN_CHARGE_REPORT_AFTER: Duration = Duration::from_secs(5);
/// Period of the report that the start waits for the battery's charge.
const UNKNOWN_CHARGE_REPORT_EVERY: Duration = Duration::from_secs(30);
/// Period of steps in the states that stream no setpoints: before and after a flight, in a take-off
/// by command, and in a failsafe.
const IDLE_STEP_EVERY: Duration = Duration::from_millis(200);
/// Period at which a vehicle of a coverage mission sends its roster message to the swarm.
const ROSTER_EVERY: Duration = Duration::from_millis(500);
/// Period at which a vehicle sends its roster message to the swarm while a division is under way.
const ROSTER_EVERY_DIVIDING: Duration = Duration::from_millis(200);

/// How fast the accuracy of the position estimate lets the vehicle fly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum EstimatePace {
    /// Not at all: a share of 0 of the nominal speed.
    Stop,
    /// At a share of the nominal speed.
    Slower,
    /// At nominal speed.
    Nominal,
}

impl EstimatePace {
    /// The pace by its share of the nominal speed.
    fn from_speed_share(share: f32) -> Self {
        match share {
            share if share >= 1.0 => Self::Nominal,
            share if share > 0.0 => Self::Slower,
            _ => Self::Stop,
        }
    }
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Runs the control step and makes the periodic messages that are due at `now`: to be called
    /// when [`Self::poll_timeout`] is due.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.now = now;
        for link in [Link::Autopilot, Link::Swarm] {
            self.receive(link, &[]);
        }
        if self.timers.is_due(Timer::Step, now) {
            self.step();
        }
        if self.timers.take_due(Timer::Heartbeat, now, HEARTBEAT_EVERY) {
            self.links.set_due(Link::Autopilot, OnDemandMessage::Heartbeat);
            self.links.set_due(Link::Swarm, OnDemandMessage::Heartbeat);
            self.links.set_due(Link::Swarm, OnDemandMessage::Relay);
        }
        let every = Duration::from_millis(1000 / u64::from(self.config.swarm_hz));
        if self.timers.take_due(Timer::Swarm, now, every) {
            self.set_position_due();
            self.links.set_due(Link::Swarm, OnDemandMessage::Intent);
        }
        // The roster message has a period of its own, which does not follow `swarm_hz`.
        if let Some(fleet) = self.neighbours.fleet()
            && self.timers.is_due(Timer::Roster, now)
        {
            let every = if fleet.is_dividing() { ROSTER_EVERY_DIVIDING } else { ROSTER_EVERY };
            self.timers.schedule_next(Timer::Roster, now, every);
            self.links.set_due(Link::Swarm, OnDemandMessage::Roster);
        }
    }

    /// One step of the control loop: guidance, division, scan of the path, mission table, the
    /// task's commands, requests to the autopilot.
    fn step(&mut self) {
        let now = self.now;
        if self.services.has_unapplied_parameters()
            && self.erase_permission() == ErasePermission::Allowed
        {
            self.apply_parameters();
        }
        self.update_estimate_speed_share();
        self.neighbours
            .set_own_position_and_range(self.telemetry.position, self.config.radio_range_m);
        let dt_s = self.timers.step_s(now).clamp(0.0, 0.2);
        let scene = GuidanceInputs::new(
            self.mission.plan(),
            &self.telemetry,
            (self.neighbours.own_rank(), self.config.system_id),
            self.detours.path_source(),
        );
        if !self.guidance.step(self.mission.state(), &scene, &mut self.neighbours, now, dt_s)
            && self.timers.take_due(Timer::HeldReport, now, WARNING_EVERY)
        {
            self.links.send_text(Severity::Warning, "Setpoint out of limits: holding");
        }
        if self.guidance.take_hold_changed() {
            self.links.set_due(Link::Swarm, OnDemandMessage::Intent);
        }
        self.step_division();
        self.report_unstarted_vehicle();
        self.scan_for_obstacles();
        self.update_barred_start();
        self.run_mission_table();
        self.step_task();
        let situation = self.handshake_context();
        if self.handshake.send_due_requests(
            &self.telemetry,
            &situation,
            &mut self.timers,
            &mut self.links,
        ) {
            self.guidance.set_limits(&self.config, self.handshake.limits());
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

    /// Sends the commands of the task (pictures, camera) that are due at the vehicle's place;
    /// notes, stores and reports what is photographed.
    fn step_task(&mut self) {
        let state = self.mission.state();
        let off_plan = self.guidance.returning
            || self.guidance.ends_away_from_goal
            || self.detours.is_on_detour();
        let along = PathProgress {
            progress_m: self.guidance.reported_progress_m(state, &self.guidance_inputs()),
            reference_m: self.guidance.reference_along_m(),
            // A vehicle that brakes along its path in order to hold there still takes the pictures
            // that it passes.
            relation: match state.is_on_path() {
                true if self.detours.is_beside_plan() && !self.guidance.returning => {
                    PathRelation::Beside
                }
                true if !off_plan => PathRelation::OnPath,
                _ => PathRelation::Elsewhere,
            },
        };
        let leaves_path =
            self.mission.step_task(along, self.now, &mut self.timers, &mut self.links);
        // A vehicle that brakes to land goes on along its path but takes no pictures there. The
        // pictures that it passed before are noted as it leaves the path, or at the path's end.
        let photographs = along.relation == PathRelation::OnPath
            || (!off_plan
                && (leaves_path || self.guidance.is_reference_at_end(&self.guidance_inputs())));
        let pictures_to_m = photographs.then_some(along.progress_m);
        let due = self.take_photographed_due();
        if due || leaves_path {
            self.note_photographed(pictures_to_m);
        }
        if due {
            self.store_and_report_photographed();
        }
    }

    /// Notes whether a vehicle that is due to depart is kept on its pad by another vehicle in the
    /// column above the pad, or by a blocked path. Also warns, at most each 30 s
    /// (`UNKNOWN_CHARGE_REPORT_EVERY`), that the start waits for the battery's charge to be
    /// reported.
    fn update_barred_start(&mut self) {
        let later_by = self.guidance.departs_later_by();
        let due = self.mission.departure_due(self.now, later_by)
            && self.guidance.advice_allows_departure();
        let waits =
            due && self.mission.state() == State::Scheduled && !self.mission.pending().pause;
        let least = self.config.battery_low_percent;
        if waits
            && self.plan_leaves_pad()
            && self.mission.time_in_state(self.now) >= UNKNOWN_CHARGE_REPORT_AFTER
            && !is_battery_known_or_unchecked(&self.telemetry, least, self.now)
            && self.timers.take_due(Timer::ChargeReport, self.now, UNKNOWN_CHARGE_REPORT_EVERY)
        {
            self.links.send_text(Severity::Warning, "Battery charge unknown: start waits");
        }
        if waits && (!self.guidance.filter.column_clear() || self.detours.is_blocked()) {
            self.mission.note_start_barred(self.now);
        } else {
            self.mission.note_start_free(self.now);
        }
    }

    /// Reports, by text and event, a vehicle that this one waits for and that was not started.
    fn report_unstarted_vehicle(&mut self) {
        let waits = self.mission.state().may_wait_at_gate();
        let waited = Some(self.guidance.advice.waiting_for_id).filter(|id| waits && *id != 0);
        let id = waited.filter(|id| self.neighbours.is_not_started(*id)).unwrap_or(0);
        if self.mission.should_report_wait(id, self.now, &mut self.timers) {
            self.links.send_text_with_numbers(
                Severity::Warning,
                "Waiting for vehicle #: it has not started",
                [u32::from(id), 0],
            );
            // The queue is full only if the shell does not drain the events.
            let _ = self.events.push_back(Event::WaitsForUnstartedVehicle { id });
        }
    }

    /// Sets the share of the cruise speed at which the error bound of the position estimate fits
    /// into the margin to walls, and reports a change between nominal, slower and stopped while
    /// setpoints are sent.
    pub(super) fn update_estimate_speed_share(&mut self) {
        let (now, config) = (self.now, &self.config);
        let bound_m = self.telemetry.estimate_error_bound_m(now, config.min_estimate_error_m);
        // A bound as good as the best receiver's refuses nothing: the operator chose the margin.
        let pace = match bound_m <= margins::MIN_ESTIMATE_ERROR_BOUND_M {
            true => 1.0,
            false => margins::speed_share_for_error_bound(
                bound_m,
                config.required_clearance_m,
                config.radius_m,
            ),
        };
        let before = self.guidance.set_estimate_speed_share(pace);
        self.mission.note_estimate_speed_share(pace, now);
        let now_allowed = EstimatePace::from_speed_share(pace);
        if EstimatePace::from_speed_share(before) == now_allowed
            || !self.mission.state().streams_setpoints()
        {
            return;
        }
        // In whole centimetres, rounded up; a bound above 100 m stands for an unknown accuracy.
        let cm = libm::ceilf(libm::fminf(bound_m, 100.0) * 100.0) as u32;
        let room_m = margins::estimate_margin_m(
            config.required_clearance_m,
            config.radius_m,
            margins::CRUISE_TRACKING_ERROR_M,
        );
        let room_cm = libm::fmaxf(room_m * 100.0, 0.0) as u32;
        let (severity, text) = match now_allowed {
            EstimatePace::Nominal => (Severity::Info, "Estimate within # cm again"),
            EstimatePace::Slower => {
                (Severity::Warning, "Estimate within # cm, margin # cm: slower")
            }
            EstimatePace::Stop if bound_m > 100.0 => {
                (Severity::Warning, "Estimate of unknown accuracy: stopping")
            }
            EstimatePace::Stop => {
                (Severity::Warning, "Estimate within # cm, margin # cm: stopping")
            }
        };
        self.links.send_text_with_numbers(severity, text, [cm, room_cm]);
    }
}
