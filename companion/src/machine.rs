//! The companion itself: routes frames in, runs the mission table, makes frames out.

use heapless::Deque;
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA,
    PARAM_VALUE_DATA, TUNNEL_DATA,
};
use planner_core::Point;
use planner_core::schedule::VehiclePlan;

use crate::autopilot::Kind;
use crate::budget::{self, Budget};
use crate::commands::{self, ACCEPTED, Command, DENIED, Pending, Repeats, TEMPORARILY_REJECTED, UNSUPPORTED};
use crate::config::{Config, ConfigError, PlanFailure};
use crate::detour::{Aim, Around, Obstacles};
use crate::echo::Sent;
use crate::events::{Event, Link};
use crate::frame::{Counters, Frame, Framer};
use crate::ftp::Ftp;
use crate::guidance::{Guidance, Scene, Stats, setpoints_flow};
use crate::intent::Intent;
use crate::limits::AutopilotLimits;
use crate::margins;
use crate::mission::{self, Action, Guard, Interrupted, Row, State, To};
use crate::neighbours::Neighbours;
use crate::neighbours::relay::Relay;
use crate::outbox::{Outbox, Outgoing};
use crate::parameters::Parameters;
use crate::requests::Handshake;
use crate::senders::{Kind as AnswerKind, Rates, Sender};
use crate::store::{Erasing, Store};
use crate::telemetry::{Change, Telemetry};
use crate::time::{Duration, Instant};
use crate::waits::Waits;

/// Setpoints at 20 Hz, twice what PX4 wants at least in practice.
const SETPOINT_EVERY: Duration = Duration::from_millis(50);
/// A setpoint that is held, or an EKF origin that is not used, is reported no more often.
const HELD_EVERY: Duration = Duration::from_secs(5);
/// On the ground the table is looked at five times a second.
const IDLE_EVERY: Duration = Duration::from_millis(200);
/// A hovering vehicle sways more slowly, m/s.
pub(crate) const STANDING_MPS: f32 = 0.3;
pub(crate) const HEARTBEAT_EVERY: Duration = Duration::from_millis(1000);
pub(crate) const DISARM_AFTER: Duration = Duration::from_millis(4000);
/// While another EKF origin is in doubt the autopilot is asked this often.
pub(crate) const ORIGIN_AGAIN: Duration = Duration::from_millis(200);
/// Rows taken at one instant; more would be a cycle in the table.
const ROWS_AT_ONCE: usize = 4;
const EVENTS: usize = 16;

/// The companion of one UAV: at most `V` vehicles in the swarm, `W` waypoints and `G` gates in its plan.
#[derive(Clone, Debug)]
pub struct Companion<const V: usize, const W: usize, const G: usize> {
    pub(crate) config: Config<V>,
    /// Cruise and climb of the mission, which parameters may limit.
    pub(crate) nominal_mps: [f32; 2],
    /// Since when the estimate is worse than the margin leaves at a crawl.
    pub(crate) vague_since: Option<Instant>,
    /// A parameter was set that is not in use yet.
    pub(crate) untuned: bool,
    pub(crate) rank: u16,
    pub(crate) start: Point,
    framers: [Framer; 2],
    pub(crate) outboxes: [Outbox; 2],
    pub(crate) telemetry: Telemetry,
    pub(crate) neighbours: Neighbours<V>,
    pub(crate) plan: Option<VehiclePlan<W, G>>,
    pub(crate) plan_failure: Option<PlanFailure>,
    pub(crate) around: Around,
    pub(crate) obstacles: Obstacles,
    pub(crate) state: State,
    pub(crate) entered_at: Instant,
    /// When MISSION_START was taken: the schedule counts from it.
    started_at: Instant,
    /// When the pilot took the vehicle.
    pub(crate) pilot_since: Instant,
    pub(crate) interrupted: Interrupted,
    pub(crate) pending: Pending,
    pub(crate) handshake: Handshake,
    repeats: Repeats,
    /// What the autopilot's parameters allow.
    pub(crate) autopilot_limits: AutopilotLimits,
    /// Which of them were read, by bits, and how often they may still be requested.
    pub(crate) limits_read: u16,
    pub(crate) limits_tries: u8,
    pub(crate) limits_at: Instant,
    pub(crate) waits: Waits,
    pub(crate) guidance: Guidance,
    pub(crate) mode_before: u32,
    pub(crate) now: Instant,
    /// When a setpoint that was held, and an EKF origin that is not used, may be reported again.
    held_at: Instant,
    far_at: Instant,
    stepped_at: Instant,
    next_step: Instant,
    next_heartbeat: Instant,
    next_swarm: Instant,
    pub(crate) retry_at: Instant,
    pub(crate) origin_at: Instant,
    pub(crate) streams_at: Instant,
    pub(crate) setup: usize,
    pub(crate) setpoint_due: bool,
    pub(crate) heartbeat_due: [bool; 2],
    pub(crate) version_due: [bool; 2],
    pub(crate) position_due: bool,
    pub(crate) intent_due: bool,
    /// What others do not hear may be passed on again, beginning with this rank.
    pub(crate) relay_due: bool,
    pub(crate) relay_next: u16,
    pub(crate) radio: Budget,
    pub(crate) sent: Sent,
    pub(crate) rates: Rates,
    pub(crate) store: Option<Store>,
    pub(crate) parameters: Parameters,
    pub(crate) ftp: Ftp,
    pub(crate) events: Deque<Event, EVENTS>,
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// A companion that has heard nothing yet.
    pub fn new(config: Config<V>) -> Result<Self, ConfigError> {
        const { assert!(V >= 1 && W >= 2, "a swarm holds this vehicle, a path two points") };
        config.check()?;
        let (rank, own) = config.own().ok_or(ConfigError::NotInRoster)?;
        let start = own.start;
        Ok(Self {
            nominal_mps: [config.cruise_mps, config.climb_mps],
            vague_since: None,
            untuned: false,
            rank,
            start,
            framers: [Framer::new(), Framer::new()],
            outboxes: [Outbox::default(), Outbox::default()],
            telemetry: Telemetry::new(config.mission_crc == 0),
            neighbours: Neighbours::new(
                &config.roster,
                config.system_id,
                config.cruise_mps.max(config.climb_mps),
            ),
            plan: None,
            plan_failure: None,
            around: Around::default(),
            obstacles: Obstacles::default(),
            state: State::WaitAutopilot,
            entered_at: Instant::ZERO,
            started_at: Instant::ZERO,
            pilot_since: Instant::ZERO,
            interrupted: Interrupted::default(),
            pending: Pending::default(),
            handshake: Handshake::default(),
            repeats: Repeats::default(),
            autopilot_limits: AutopilotLimits::default_of(Kind::Px4),
            limits_read: 0,
            limits_tries: 0,
            limits_at: Instant::ZERO,
            waits: Waits::default(),
            guidance: Guidance::new(&config, &AutopilotLimits::default_of(Kind::Px4)),
            mode_before: 0,
            now: Instant::ZERO,
            held_at: Instant::ZERO,
            far_at: Instant::ZERO,
            stepped_at: Instant::ZERO,
            next_step: Instant::ZERO,
            next_heartbeat: Instant::ZERO,
            next_swarm: Instant::ZERO,
            retry_at: Instant::ZERO,
            origin_at: Instant::ZERO,
            streams_at: Instant::ZERO,
            setup: usize::MAX,
            setpoint_due: false,
            heartbeat_due: [false; 2],
            version_due: [false; 2],
            position_due: false,
            intent_due: false,
            relay_due: false,
            relay_next: 0,
            radio: Budget::default(),
            sent: Sent::default(),
            rates: Rates::default(),
            store: None,
            parameters: Parameters::default(),
            ftp: Ftp::default(),
            events: Deque::new(),
            config,
        })
    }

    /// Where the mission is.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether setpoints are to go out, one each 50 ms.
    pub fn streams(&self) -> bool {
        setpoints_flow(self.state)
    }

    /// The autopilot as last heard.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Which autopilot flies the vehicle; PX4 while none was heard.
    pub(crate) fn kind(&self) -> Kind {
        self.telemetry.kind.unwrap_or_default()
    }

    /// System id of the vehicle waited for; 0 when free.
    pub fn waiting_for(&self) -> u8 {
        match self.guidance.filter.blocker() {
            0 => self.guidance.advice.waiting_for,
            id => id,
        }
    }

    /// How often the safety filter stopped the vehicle.
    pub fn filter_stops(&self) -> u32 {
        self.guidance.filter.activations()
    }

    /// What the safety filter finds at this moment, as each step asks it: the vehicle that it stops for, 0 for none. Nothing
    /// changes by it; its cost is counted so.
    pub fn ask_filter(&mut self, now: Instant) -> u8 {
        let scene = Scene {
            plan: self.plan.as_ref().filter(|plan| !plan.path.waypoints().is_empty()),
            telemetry: &self.telemetry,
            rank: self.rank,
            id: self.config.system_id,
            detours: self.around.flying,
        };
        self.guidance.ask_filter(self.state, &scene, &self.neighbours, now)
    }

    /// Whether the setpoint is in a stop by the safety filter, which may use twice the jerk.
    pub fn stops_urgently(&self) -> bool {
        self.guidance.door.stops_urgently()
    }

    /// Way made along the own path, metres.
    pub fn progress_m(&self) -> f32 {
        // What is flown around comes on top of where the plan was left.
        let left_at_m = if self.around.flying { self.around.left_at_m } else { 0.0 };
        self.guidance.progress_m(self.state, &self.scene()) + left_at_m.max(0.0)
    }

    /// What the setpoints came to since the start.
    pub fn setpoint_stats(&self) -> Stats {
        self.guidance.door.stats
    }

    /// What a link's framer counted.
    pub fn counters(&self, link: Link) -> Counters {
        self.framers[link as usize].counters()
    }

    /// Messages dropped because a link's queue was full.
    pub fn dropped(&self, link: Link) -> u32 {
        self.outboxes[link as usize].dropped()
    }

    /// Takes bytes of a link in, all received by `now`.
    pub fn handle_bytes(&mut self, link: Link, now: Instant, bytes: &[u8]) {
        self.now = now;
        let mut input = bytes;
        let mut relevant = false;
        while let Some(frame) = self.framers[link as usize].next(now, &mut input) {
            relevant |= self.handle_frame(link, &frame);
        }
        if relevant {
            self.run_table();
        }
    }

    /// Lets time pass: to be called when [`Self::poll_timeout`] is due.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.now = now;
        for link in [Link::Autopilot, Link::Swarm] {
            // Frees what a partial frame held back.
            self.handle_bytes(link, now, &[]);
        }
        if now >= self.next_step {
            self.step();
        }
        if now >= self.next_heartbeat {
            self.next_heartbeat = now + HEARTBEAT_EVERY;
            self.heartbeat_due = [true; 2];
            self.relay_due = true;
        }
        if now >= self.next_swarm {
            self.next_swarm = now + Duration::from_millis(1000 / u64::from(self.config.swarm_hz));
            self.position_due = self.telemetry.position_at.is_some();
            self.intent_due = true;
        }
    }

    /// Takes the planner's answer in: the mission's plan, or the way around asked for by [`Self::detour`]. Ignored unless one
    /// was asked for.
    pub fn handle_plan(&mut self, now: Instant, outcome: Result<&VehiclePlan<W, G>, PlanFailure>) {
        self.now = now;
        match (self.state, outcome) {
            (State::Planning, Ok(plan)) if self.begins_at(plan, &self.start) => {
                self.plan = Some(plan.clone());
            }
            (State::Replanning | State::PadReplanning, Ok(plan)) => self.take_detour(plan),
            (State::Planning, Ok(_)) => self.plan_failure = Some(PlanFailure::Invalid),
            (State::Planning, Err(failure)) => self.plan_failure = Some(failure),
            (State::Replanning | State::PadReplanning, Err(failure)) => self.miss_detour(failure),
            _ => return,
        }
        self.run_table();
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// When [`Self::handle_timeout`] is due.
    pub fn poll_timeout(&self) -> Option<Instant> {
        Some(self.next_step.min(self.next_heartbeat).min(self.next_swarm))
    }

    pub(crate) fn scene(&self) -> Scene<'_, W, G> {
        Scene {
            plan: self.plan.as_ref().filter(|plan| !plan.path.waypoints().is_empty()),
            telemetry: &self.telemetry,
            rank: self.rank,
            id: self.config.system_id,
            detours: self.around.flying,
        }
    }

    /// Whether the schedule lets it take off: it waits on the pad rather than at its first gate in the air.
    pub(crate) fn departure_due(&self) -> bool {
        let depart_s = self.plan.as_ref().map_or(0.0, |plan| plan.depart_s);
        (self.now - self.started_at).secs_f32() >= depart_s
    }

    /// Finite, from `place`, and a path wherever there is a goal.
    pub(crate) fn begins_at(&self, plan: &VehiclePlan<W, G>, place: &Point) -> bool {
        let numbers = [plan.climb_m, plan.descent_m, plan.depart_s];
        let finite = numbers.iter().all(|h| h.is_finite() && *h >= 0.0)
            && plan.gates.iter().all(|g| !g.at_m.is_nan() && !g.until_m.is_nan());
        let first = plan.path.waypoints().first();
        let begins = first.is_some_and(|w| (w.position - place).norm() < 0.1);
        finite && (begins || plan.goal.is_none())
    }

    /// Returns whether the mission table should be looked at.
    fn handle_frame(&mut self, link: Link, frame: &Frame) -> bool {
        let sender = self.sender(link, frame);
        if let Some(command) = commands::read(frame, self.config.system_id) {
            if sender != Sender::GroundStation && command.acts() {
                self.deny(link, sender, &command);
                return false;
            }
            let now = self.now;
            let (result, relevant) = match self.repeats.answered(frame, now) {
                Some(result) => (result, false),
                None => {
                    let result = self.handle_command(link, sender, &command);
                    self.repeats.remember(frame, result, now);
                    (result, true)
                }
            };
            if let Some(result) = result {
                let ack = Outgoing::Ack { command: command.command, result, to: command.from };
                self.answer_to(link, sender, AnswerKind::Ack, ack);
            }
            return relevant;
        }
        if self.serve(link, sender, frame) {
            return false;
        }
        match link {
            Link::Autopilot => {
                if frame.system != self.config.system_id || frame.component != crate::AUTOPILOT {
                    return false;
                }
                if frame.message_id == PARAM_VALUE_DATA::ID {
                    self.handle_limit(frame);
                    return false;
                }
                let change = self.telemetry.handle(self.now, &self.config.origin, frame);
                if let Some(ack) = self.telemetry.ack.take() {
                    self.handle_ack(&ack);
                }
                self.handshake.watch(self.state, &self.telemetry);
                if change == Change::OriginDoubted {
                    self.origin_at = self.origin_at.min(self.now + ORIGIN_AGAIN);
                    return self.telemetry.origin_moved;
                }
                if let Change::OriginFar(km) = change {
                    if self.now >= self.far_at {
                        self.far_at = self.now + HELD_EVERY;
                        self.say_count(true, "EKF origin # km away: not used", [km, 0]);
                    }
                    return true;
                }
                if change == Change::OriginLost {
                    self.origin_at = self.now;
                    // It may have been restarted and know nothing of the streams we asked for. Positions that jump
                    // again and again are no reason to flood it.
                    if self.now >= self.streams_at {
                        self.ask_for_streams();
                    }
                }
                change == Change::Updated && frame.message_id != LOCAL_POSITION_NED_DATA::ID
            }
            Link::Swarm => {
                self.handle_neighbour(frame);
                false
            }
        }
    }

    fn handle_neighbour(&mut self, frame: &Frame) {
        let relevant = matches!(frame.message_id, TUNNEL_DATA::ID | GLOBAL_POSITION_INT_DATA::ID);
        let id = frame.system;
        if !relevant || id == self.config.system_id || id == 0 || frame.component != crate::COMPONENT {
            return;
        }
        // Its sequence number counts only if the frame decodes.
        if frame.message_id == TUNNEL_DATA::ID {
            if let Some(relay) = Relay::decode(frame.padded(), id) {
                let ours = self.plan.as_ref().is_some_and(|plan| plan.plan_crc == relay.plan_crc);
                if ours && relay.mission_crc == self.config.mission_crc {
                    self.neighbours.handle_relay(self.now, id, &relay);
                }
                return;
            }
            let Some(intent) = Intent::decode(frame.padded(), id) else { return };
            if intent.mission_crc != self.config.mission_crc {
                if self.config.roster.iter().any(|entry| entry.system_id == id) {
                    let text = "Vehicle # has another mission file";
                    self.say_of(Sender::Other, true, text, [u32::from(id), 0, 0]);
                }
                return;
            }
            let echo = intent.echo.filter(|echo| u16::from(echo.rank) == self.rank);
            let delay_s = echo.and_then(|echo| self.sent.delay_s(&echo, self.now));
            if let (Some(delay_s), Some(late)) = (delay_s, self.neighbours.lateness(id)) {
                late.take(delay_s);
            }
            if self.neighbours.accept(id, frame.sequence, self.now) {
                let plan_crc = self.plan.as_ref().map(|plan| plan.plan_crc);
                self.neighbours.handle_intent(
                    self.now,
                    self.rank,
                    &intent,
                    self.config.mission_crc,
                    plan_crc,
                );
            }
        } else if let Some(data) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
            self.neighbours.handle_position(self.now, &self.config.origin, id, &data);
        }
    }

    /// Answers a command of a sender whose commands do not count.
    fn deny(&mut self, link: Link, sender: Sender, command: &Command) {
        if command.to_us {
            let ack = Outgoing::Ack { command: command.command, result: DENIED, to: command.from };
            self.answer_to(link, sender, AnswerKind::Ack, ack);
        }
        let numbers = [u32::from(command.command), u32::from(command.from.0), u32::from(command.from.1)];
        self.say_of(sender, true, "Command # denied, not a ground station: #/#", numbers);
    }

    /// Returns the answer; none is due to a broadcast, nor to a command that is another component's.
    fn handle_command(&mut self, link: Link, sender: Sender, command: &Command) -> Option<u8> {
        let (before, known) = (self.pending, self.obstacles.count());
        let inputs = self.inputs();
        let result = match commands::apply(&mut self.pending, self.state, &inputs, command) {
            Some(result) => result,
            None if command.command == commands::REQUEST => self.request(link, sender, command.param1),
            None if command.command == commands::EXCLUDE => self.exclude(command),
            None if command.command == commands::RESTART
                && (command.to_component || command.param2 == 1.0) =>
            {
                self.restart(command)
            }
            // To all components: another one's.
            None if !command.to_component => return None,
            None => UNSUPPORTED,
        };
        let restarts = command.command == commands::RESTART && result == ACCEPTED;
        if restarts || self.pending != before || self.obstacles.count() != known {
            self.log_command(sender, command);
        }
        command.to_us.then_some(result)
    }

    fn request(&mut self, link: Link, sender: Sender, message: f32) -> u8 {
        if !self.may_answer(link, sender, AnswerKind::Message) {
            return TEMPORARILY_REJECTED;
        }
        if link == Link::Swarm && !self.radio.allows(self.now, self.telemetry.armed) {
            return TEMPORARILY_REJECTED;
        }
        if message == HEARTBEAT_DATA::ID as f32 {
            self.heartbeat_due[link as usize] = true;
        } else if message == AUTOPILOT_VERSION_DATA::ID as f32 {
            self.version_due[link as usize] = true;
        } else if message == GLOBAL_POSITION_INT_DATA::ID as f32 && link == Link::Swarm {
            self.position_due = self.telemetry.position_at.is_some();
        } else {
            return DENIED;
        }
        if link == Link::Swarm {
            self.radio.spend(budget::POSITION);
        }
        ACCEPTED
    }

    /// One step of the control loop: reference, table, and what is asked for again.
    fn step(&mut self) {
        let now = self.now;
        if self.untuned && self.erasing() == Erasing::Allowed {
            self.tune();
        }
        self.watch_estimate();
        let dt_s = (now - self.stepped_at).secs_f32().clamp(0.0, 0.2);
        self.stepped_at = now;
        let scene = Scene {
            plan: self.plan.as_ref().filter(|plan| !plan.path.waypoints().is_empty()),
            telemetry: &self.telemetry,
            rank: self.rank,
            id: self.config.system_id,
            detours: self.around.flying,
        };
        if !self.guidance.step(self.state, &scene, &mut self.neighbours, now, dt_s) && now >= self.held_at {
            self.held_at = now + HELD_EVERY;
            self.say(true, "Setpoint out of limits: holding");
        }
        self.intent_due |= core::mem::take(&mut self.guidance.turned);
        self.name_who_never_starts();
        self.look_around();
        self.run_table();
        self.repeat_requests();
        let flows = setpoints_flow(self.state);
        self.setpoint_due = flows;
        let every = if flows { SETPOINT_EVERY } else { IDLE_EVERY };
        // Steps keep their rhythm; after a long gap the rhythm restarts instead of catching up.
        let due = self.next_step + every;
        self.next_step = if due > now { due } else { now + every };
    }

    /// Compares the estimate's bound with what the margin leaves, and sets the pace.
    fn watch_estimate(&mut self) {
        let (now, config) = (self.now, &self.config);
        let bound_m = self.telemetry.estimate_bound_m(now, config.estimate_m);
        // The best that a receiver can do was weighed when the margin was chosen.
        let pace = match bound_m <= margins::ESTIMATE_M {
            true => 1.0,
            false => margins::pace(bound_m, config.required_clearance_m, config.radius_m),
        };
        let before = core::mem::replace(&mut self.guidance.pace, pace);
        self.vague_since = if pace > 0.0 { None } else { self.vague_since.or(Some(now)) };
        let kind = |pace: f32| if pace >= 1.0 { 2 } else { u8::from(pace > 0.0) };
        if kind(before) == kind(pace) || !setpoints_flow(self.state) {
            return;
        }
        // Whole centimetres, rounded up; more than a hundred metres is not known.
        let cm = libm::ceilf(libm::fminf(bound_m, 100.0) * 100.0) as u32;
        let room_m = margins::room_m(config.required_clearance_m, config.radius_m, margins::TRACKING_M);
        let room_cm = libm::fmaxf(room_m * 100.0, 0.0) as u32;
        let (warning, text) = match kind(pace) {
            2 => (false, "Estimate within # cm again"),
            1 => (true, "Estimate within # cm, margin # cm: slower"),
            _ if bound_m > 100.0 => (true, "Estimate of unknown accuracy: stopping"),
            _ => (true, "Estimate within # cm, margin # cm: stopping"),
        };
        self.say_count(warning, text, [cm, room_cm]);
    }

    fn run_table(&mut self) {
        for _ in 0..ROWS_AT_ONCE {
            let inputs = self.inputs();
            let Some(row) = mission::update(self.state, &inputs) else { return };
            self.take(row);
        }
    }

    fn take(&mut self, row: &'static Row) {
        let (from, now) = (self.state, self.now);
        let to = match row.to {
            To::State(to) => to,
            To::Interrupted => self.interrupted.target(from),
        };
        self.interrupted.note(from, to);
        self.state = to;
        self.entered_at = now;
        if row.guard == Guard::StartCommanded {
            self.started_at = now;
            self.mode_before = self.telemetry.custom_mode;
        }
        if to == State::PilotControl && from != State::PilotReturned {
            self.pilot_since = now;
        }
        let ends = matches!(to, State::Aborted | State::Done)
            || matches!(row.action, Action::ForgetStart | Action::CancelStart);
        self.pending.state_changed(row.guard, to, ends);
        self.handshake.state_changed(from, to);
        self.act(from, to, row);
        if !row.text.is_empty() {
            let text = Outgoing::Text { warning: row.warning, text: row.text };
            self.outboxes.iter_mut().for_each(|outbox| outbox.push(text));
        }
        if let Some(text) = self.interrupted.text(from, to) {
            self.say(false, text);
        }
        // Full only if the shell does not drain: then the newest is lost.
        let changed = Event::StateChanged { from, to, text: row.text, warning: row.warning };
        let _ = self.events.push_back(changed);
        // The step that the new state needs is due now.
        if setpoints_flow(to) && !setpoints_flow(from) {
            self.next_step = now;
        }
    }

    fn act(&mut self, from: State, to: State, row: &Row) {
        let now = self.now;
        self.mark_place(to);
        let position = self.telemetry.position;
        match row.action {
            Action::None | Action::ForgetStart => {}
            Action::Connect => self.ask_for_streams(),
            Action::RequestPlan => {
                self.plan = None;
                self.plan_failure = None;
                self.around = Around { left: self.around.left, ..Around::default() };
                self.obstacles.avoided = 0;
                self.neighbours.forget_plan();
                self.guidance.reset();
                let _ = self.events.push_back(Event::PlanRequested);
            }
            Action::HoldHere if to == State::PilotReturned => self.guidance.hold_after_pilot(position),
            Action::HoldHere => self.guidance.hold_at(position),
            Action::HoldOver => self.retry_at = now,
            Action::AskOffboard | Action::AskArm | Action::AskTakeOff => self.retry_at = now,
            Action::AskLand => self.ask_land(from),
            Action::AskDisarm if to == State::Disarm => self.retry_at = now + DISARM_AFTER,
            Action::AskDisarm | Action::CancelStart => self.retry_at = now,
            Action::BeginClimb => self.guidance.begin_climb(&position),
            Action::RunPath => self.guidance.run(now),
            Action::RequestDetour => self.request_detour(Aim::Goal),
            Action::RequestAside => {
                self.guidance.brake();
                // On its way back it was to land already.
                let lands = self.guidance.returning;
                self.request_detour(if lands { Aim::Landing } else { Aim::Aside });
            }
            Action::RequestLanding => self.request_detour(Aim::Landing),
            Action::MissDetour => self.miss_detour(PlanFailure::Late),
            Action::FlyDetour => {
                self.guidance.begin_path(now);
                self.guidance.aside = self.around.aside;
            }
            Action::BrakeOnPath => self.guidance.brake(),
            Action::Rejoin => self.go_on(from, to),
            Action::TurnBack => {
                if let Some(plan) = &mut self.plan {
                    self.guidance.turn_back(&mut plan.path, now);
                    // Off the shared plan: neighbours keep clear of us as of a stranger.
                    plan.gates.clear();
                    core::mem::swap(&mut plan.climb_m, &mut plan.descent_m);
                }
            }
        }
    }

    fn ask_land(&mut self, from: State) {
        use State::*;
        self.retry_at = self.now;
        let position = self.telemetry.position;
        match from {
            Follow | Paused | Alone | Blocked | Replanning | Stopping | Land | Disarm => {
                self.guidance.brake();
            }
            // Off the path, or not known to be on it: the reference may be beyond a wall.
            _ => self.guidance.hold_at(position),
        }
    }

    /// Goes on in the state that was interrupted.
    fn go_on(&mut self, from: State, to: State) {
        let (now, position) = (self.now, self.telemetry.position);
        match to {
            State::TakeOff => self.retry_at = now,
            State::Land => self.ask_land(from),
            _ => {
                let climbs = matches!(self.interrupted.beneath(to), State::TakeOff | State::Climb);
                if let Some(plan) = &self.plan {
                    self.guidance.go_on(plan, climbs, &position, now);
                }
                if to == State::Blocked {
                    // Until it was looked at again.
                    (self.around.blocked, self.around.in_the_way) = (true, true);
                }
                if !matches!(to, State::Climb | State::Follow) {
                    self.guidance.brake();
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "machine_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "ardupilot_tests.rs"]
mod ardupilot_tests;

#[cfg(test)]
#[path = "scene_tests.rs"]
mod scene_tests;

#[cfg(test)]
#[path = "hostile_tests.rs"]
mod hostile_tests;

#[cfg(test)]
#[path = "interruption_tests.rs"]
mod interruption_tests;
