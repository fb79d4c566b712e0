//! The companion itself: routes frames in, runs the mission table, makes frames out.

mod actions;
mod board;
mod detours;
mod division;
mod frames;
mod inputs;
mod photographed;
mod plan_inputs;
mod steps;
mod transmit;

use core::mem::MaybeUninit;

use heapless::Deque;
use planner_core::flight::VehiclePlan;

use crate::autopilot::AutopilotKind;
use crate::autopilot::handshake::{Handshake, HandshakeContext};
use crate::autopilot::telemetry::{OriginRange, Telemetry};
use crate::config::{CheckedConfig, Config, ConfigError, PlanFailure};
use crate::events::{Event, Link, PlanKind};
use crate::guidance::{Guidance, GuidanceInputs, SetpointStats};
use crate::link::Links;
use crate::link::frame::Counters;
use crate::margins;
use crate::mission::course::Mission;
use crate::replanning::detour::Detours;
use crate::services::Services;
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::{Duration, Instant};
use crate::timers::Timers;

/// Least time between two warnings that a setpoint is held, or that a far EKF origin is not used.
const WARNING_EVERY: Duration = Duration::from_secs(5);
/// Period of HEARTBEAT.
pub(crate) const HEARTBEAT_EVERY: Duration = Duration::from_millis(1000);
/// Limits of the value that the companion sets for ArduCopter's `GUID_TIMEOUT`, the time without
/// setpoints after which Guided mode stops the vehicle, seconds. Within the limits it is the time
/// in which a vehicle at cruise speed covers the safety margin to walls. With the default of 3 s a
/// vehicle would fly on into walls while its link stalls. The lower limit is four setpoint periods.
const GUID_TIMEOUT_RANGE_S: (f32, f32) = (0.2, 0.5);
/// Maximum number of events that wait for the shell; when the queue is full a further event is
/// dropped.
const MAX_EVENTS: usize = 16;

/// The companion of one UAV: at most `V` vehicles in the swarm, and at most `W` waypoints and `G`
/// gates in its own plan.
#[derive(Clone, Debug)]
pub struct Companion<const V: usize, const W: usize, const G: usize> {
    pub(crate) config: Config<V>,
    /// Time passed to the last call that takes one.
    pub(crate) now: Instant,
    pub(crate) timers: Timers,
    pub(crate) links: Links,
    pub(crate) telemetry: Telemetry,
    /// The other vehicles, as last heard; in a coverage mission the fleet too.
    pub(crate) neighbours: Neighbours<V>,
    /// What blocks the path, and the detour that is requested or flown.
    pub(crate) detours: Detours,
    /// Requests to the autopilot, repeated until they take effect.
    pub(crate) handshake: Handshake,
    pub(crate) mission: Mission<W, G>,
    pub(crate) guidance: Guidance,
    /// The other MAVLink services (files, parameters, TIMESYNC) and the flash store.
    pub(crate) services: Services,
    /// Events that wait for the shell, oldest first.
    pub(crate) events: Deque<Event, MAX_EVENTS>,
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// A companion that has received nothing yet.
    ///
    /// # Errors
    /// As [`Config::checked`].
    pub fn new(config: Config<V>) -> Result<Self, ConfigError> {
        config.checked().map(Self::from_checked)
    }

    /// Makes a companion from checked settings, directly at `place`: a board's stack has no room
    /// for a copy.
    #[inline(never)]
    pub fn init_in_place(place: &mut MaybeUninit<Self>, settings: CheckedConfig<V>) -> &mut Self {
        place.write(Self::from_checked(settings))
    }

    /// The companion with these settings, before its first byte.
    #[inline(always)]
    fn from_checked(CheckedConfig { config, path_start: start }: CheckedConfig<V>) -> Self {
        const { assert!(V >= 1 && W >= 2, "a swarm holds this vehicle, a path two points") };
        let mut neighbours = Neighbours::new(
            &config.roster,
            config.system_id,
            config.slowest_vehicle_mps,
            config.fastest_vehicle_mps.max(config.climb_mps),
        );
        if let Some(down_s) = config.lost_vehicle_down_after_s {
            let pair_error_m =
                margins::pair_position_error_m(config.required_clearance_m, config.radius_m);
            neighbours.form_fleet(down_s, config.ground, pair_error_m);
        }
        Self {
            now: Instant::ZERO,
            timers: Timers::default(),
            links: Links::default(),
            telemetry: Telemetry::new(match config.mission_crc {
                0 => OriginRange::Anywhere,
                _ => OriginRange::NearMission,
            }),
            neighbours,
            detours: Detours::default(),
            handshake: Handshake::default(),
            mission: Mission::new(start),
            guidance: Guidance::new(&config, &AutopilotKind::default().default_limits()),
            services: Services::new(&config),
            events: Deque::new(),
            config,
        }
    }

    /// Current state of the mission table.
    pub fn state(&self) -> State {
        self.mission.state()
    }

    /// Whether the mission is in a state that streams setpoints to the autopilot, one each 50 ms.
    pub fn streams_setpoints(&self) -> bool {
        self.mission.state().streams_setpoints()
    }

    /// Telemetry of this vehicle's autopilot, from its last messages.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// The autopilot that flies the vehicle, PX4 or ArduPilot; PX4 until a HEARTBEAT has been
    /// received.
    pub(crate) fn autopilot_kind(&self) -> AutopilotKind {
        self.telemetry.kind()
    }

    /// System id of the neighbour that the safety filter stops for; if there is none, of the one
    /// that advice ([`planner_core::track::deconflict`]) stops for, at a gate or before a predicted
    /// conflict, or by Algorithm 2 slows for; 0 for none.
    pub fn waiting_for(&self) -> u8 {
        match self.guidance.filter.blocker_id() {
            0 => self.guidance.advice.waiting_for_id,
            id => id,
        }
    }

    /// Number of times that the safety filter stopped the vehicle since the companion's start.
    pub fn filter_stop_count(&self) -> u32 {
        self.guidance.filter.stop_count()
    }

    /// System id of the neighbour that the safety filter stops for at `now`, computed as in each
    /// step; 0 for none. The call changes no state: benches call it to count the filter's
    /// instructions.
    pub fn query_filter_blocker(&mut self, now: Instant) -> u8 {
        let scene = GuidanceInputs::new(
            self.mission.plan(),
            &self.telemetry,
            (self.neighbours.own_rank(), self.config.system_id),
            self.detours.path_source(),
        );
        self.guidance.query_filter_blocker(self.mission.state(), &scene, &self.neighbours, now)
    }

    /// Whether the setpoint is in a stop by the safety filter, which may use twice the jerk.
    pub fn is_in_urgent_stop(&self) -> bool {
        self.guidance.smoother.is_in_urgent_stop()
    }

    /// Arc length that this vehicle has covered along its own path, metres: before and in the climb
    /// minus the height still to climb, in the last descent beyond the path's length. On a detour
    /// the progress along it is added to the place where the vehicle left its plan.
    pub fn progress_m(&self) -> f32 {
        let left_at_m = if self.detours.is_on_detour() { self.detours.left_at_m() } else { 0.0 };
        self.guidance.reported_progress_m(self.mission.state(), &self.guidance_inputs())
            + left_at_m.max(0.0)
    }

    /// Statistics of the setpoints since the companion's start: number, greatest values, holds.
    pub fn setpoint_stats(&self) -> SetpointStats {
        self.guidance.smoother.stats
    }

    /// Counters of frames and errors of a link's framer.
    pub fn counters(&self, link: Link) -> Counters {
        self.links.counters(link)
    }

    /// Messages dropped because a link's queue was full.
    pub fn dropped_messages(&self, link: Link) -> u32 {
        self.links.dropped_messages(link)
    }

    /// Processes bytes that a link received up to `now`.
    pub fn handle_bytes(&mut self, link: Link, now: Instant, bytes: &[u8]) {
        self.now = now;
        self.receive(link, bytes);
    }

    /// Handles the planner's answer to a request of kind `wanted`. An answer that was not
    /// requested, or for which the state no longer waits, is ignored.
    pub fn handle_plan(
        &mut self,
        now: Instant,
        wanted: PlanKind,
        outcome: Result<&VehiclePlan<W, G>, PlanFailure>,
    ) {
        self.now = now;
        match (wanted, self.mission.state(), outcome) {
            (PlanKind::Mission, State::Planning, Ok(plan)) => {
                self.mission.set_plan(plan);
                self.neighbours
                    .fleet_mut()
                    .into_iter()
                    .for_each(|f| f.set_plan(plan.swarm_plan_crc));
            }
            (PlanKind::Mission, State::Planning, Err(failure)) => {
                self.mission.set_plan_failure(failure);
            }
            (PlanKind::Detour, ..) if !self.detours.is_request_read() => return,
            (PlanKind::Detour, state, Ok(plan)) if state.waits_for_detour() => {
                self.adopt_detour(plan);
            }
            (PlanKind::Detour, state, Err(failure)) if state.waits_for_detour() => {
                self.handle_detour_failure(failure);
            }
            (PlanKind::Division, _, outcome) => self.handle_division_plan(outcome),
            _ => return,
        }
        self.run_mission_table();
    }

    /// Removes and returns the oldest event for the shell.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The time at which [`Self::handle_timeout`] is to be called next.
    pub fn poll_timeout(&self) -> Option<Instant> {
        Some(self.timers.next_due())
    }

    /// What guidance reads now of the plan, the telemetry and the roster.
    pub(crate) fn guidance_inputs(&self) -> GuidanceInputs<'_, W, G> {
        GuidanceInputs::new(
            self.mission.plan(),
            &self.telemetry,
            (self.neighbours.own_rank(), self.config.system_id),
            self.detours.path_source(),
        )
    }

    /// The state, the height of the climb, whether the column below the vehicle or above its pad is
    /// clear, and times: from these follow the requests to the autopilot.
    fn handshake_context(&self) -> HandshakeContext {
        let time_in_state = self.mission.time_in_state(self.now);
        let margin_m = self.config.required_clearance_m - self.config.radius_m;
        let timeout_s = (margin_m / self.config.cruise_mps)
            .clamp(GUID_TIMEOUT_RANGE_S.0, GUID_TIMEOUT_RANGE_S.1);
        let column_clear =
            self.guidance.filter.column_clear() && !self.guidance.is_guiding_landing();
        HandshakeContext {
            now: self.now,
            state: self.mission.state(),
            time_in_state,
            climb_m: self.mission.climb_m(),
            guided_timeout_s: timeout_s,
            column_clear,
            may_request_land_mode: self.must_land()
                || (column_clear && HandshakeContext::is_column_checked(time_in_state)),
        }
    }

    /// Starts requesting the telemetry streams; while disarmed, in a state without setpoints, also
    /// the autopilot's limits. Guidance uses their defaults until they are read.
    fn request_streams(&mut self) {
        let situation = self.handshake_context();
        if self.handshake.begin_requesting_streams(
            &self.telemetry,
            &situation,
            &mut self.timers,
            &mut self.links,
        ) {
            self.guidance.set_limits(&self.config, self.handshake.limits());
        }
    }
}

#[cfg(test)]
mod tests;
