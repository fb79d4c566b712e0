//! What the autopilot is asked for again until it is so: streams, EKF origin, mode, arming, take-off, landing.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::SYS_STATUS_DATA;

use crate::autopilot::Kind;
use crate::autopilot::limits::AutopilotLimits;
use crate::autopilot::telemetry::{Ack, Telemetry};
use crate::companion::{Companion, DISARM_AFTER, ORIGIN_AGAIN};
use crate::events::Link;
use crate::link::frame::Frame;
use crate::link::outbox::Outgoing;
use crate::mission::State;
use crate::time::{Duration, Instant};
use crate::timers::Timer;

/// Before a landing is requested the safety filter has looked down: two steps.
const LOOKS_DOWN: Duration = Duration::from_millis(100);
const RETRY_EVERY: Duration = Duration::from_millis(1000);
/// Longer than ArduCopter takes to spin up and lift off (2.3 s).
const TAKE_OFF_AFTER: Duration = Duration::from_millis(4000);
/// Positions missing this long while HEARTBEAT is heard: it has rebooted, and forgotten the streams.
const STREAMS_LOST: Duration = Duration::from_millis(1500);
/// Streams are asked for again no sooner than this.
const STREAMS_EVERY: Duration = Duration::from_millis(2000);
/// HEARTBEAT comes at 1 Hz: one late is not yet silence.
const HEARD: Duration = Duration::from_millis(1500);
/// Streams asked for at each step while connecting.
const SETUP_BURST: usize = 5;
const GPS_GLOBAL_ORIGIN: u16 = 49;
/// After so long without setpoints Guided stops, seconds: between these, the time in which cruise speed flies the margin.
/// ArduCopter's own 3 s would fly the last velocity on through walls while a link stalls; the shortest are four setpoints.
const GUID_TIMEOUT_S: (f32, f32) = (0.2, 0.5);
/// Requests for limits, all together, and the time from one to the next.
const LIMIT_TRIES: u8 = 80;
const LIMIT_EVERY: Duration = Duration::from_millis(150);
/// `MAV_PARAM_TYPE_REAL32`.
const REAL32: u8 = 9;

/// The armed bit of HEARTBEAT (1 Hz) comes this long after the ack at most.
const ARMED_BIT: Duration = Duration::from_millis(2500);
/// So often arming is requested without any answer.
const ARMING_TRIES: u8 = 2;
/// A stream that is this old is requested again: SYS_STATUS comes each second.
const STREAM_LOST: Duration = Duration::from_millis(4000);
/// No vehicle takes off with a charge that is older.
const BATTERY_LOST: Duration = Duration::from_millis(5000);
/// Different refusals reported in one state.
const REFUSALS: usize = 4;

const NAV_TAKEOFF: u16 = 22;
const DO_SET_MODE: u16 = 176;
const ARM_DISARM: u16 = 400;
/// `MAV_RESULT` ACCEPTED.
const ACCEPTED: u8 = 0;
/// `MAV_RESULT` IN_PROGRESS.
const IN_PROGRESS: u8 = 5;

/// How far the requests of this state have come.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Handshake {
    /// When arming was last requested.
    asked_at: Option<Instant>,
    /// Requests without an answer.
    unanswered: u8,
    /// The last request was denied.
    denied: bool,
    /// When arming was accepted: from then on it is not requested again.
    accepted_at: Option<Instant>,
    /// HEARTBEAT was missing since arming was last requested: it may have been armed, and disarmed by its pilot, unseen.
    gap: bool,
    /// Disarming was refused.
    pub(crate) disarm_refused: bool,
    /// Offboard or Guided was entered for this mission, and no other mode but landing was seen since.
    pub(crate) ours: bool,
    /// The landing detector said air since arming was requested.
    pub(crate) flown: bool,
    /// Refusals reported in this state: command and result.
    reported: [Option<(u16, u8)>; REFUSALS],
}

impl Handshake {
    /// Forgets what belongs to the state left.
    pub(crate) fn state_changed(&mut self, from: State, to: State) {
        self.reported = [None; REFUSALS];
        self.disarm_refused = false;
        if to == State::Arming {
            *self = Self { ours: true, ..Self::default() };
        }
        if from == State::PilotReturned {
            self.ours = true;
        }
    }

    /// Looks at the mode and at the landing detector.
    pub(crate) fn watch(&mut self, state: State, t: &Telemetry) {
        let kind = t.kind.unwrap_or_default();
        let on_ground = t.on_ground != Some(false);
        self.ours &= t.custom_mode == kind.setpoint_mode() || t.custom_mode == kind.land_mode();
        if !on_ground && t.armed {
            self.flown = true;
        }
        if matches!(state, State::Aborted | State::Done) && on_ground && !t.armed {
            self.ours = false;
        }
    }

    /// Whether the armed bit is overdue after an accepted request.
    pub(crate) fn is_armed_unseen(&self, now: Instant) -> bool {
        self.accepted_at.is_some_and(|at| now - at >= ARMED_BIT)
    }

    /// Whether arming was requested as often as allowed without any answer.
    pub(crate) fn is_unanswered(&self, now: Instant) -> bool {
        let waited = self.asked_at.is_some_and(|at| now - at >= ARMED_BIT);
        let silent = !self.denied && self.accepted_at.is_none();
        waited && silent && (self.unanswered >= ARMING_TRIES || self.gap)
    }

    /// Whether arming is to be requested now; notes that it is.
    fn asks_to_arm(&mut self, now: Instant, armed: bool) -> bool {
        let due = match self.asked_at {
            None => true,
            Some(at) if self.denied => now - at >= RETRY_EVERY,
            Some(at) => now - at >= ARMED_BIT && self.unanswered < ARMING_TRIES && !self.gap,
        };
        let asks = due && !armed && self.accepted_at.is_none();
        if asks {
            (self.asked_at, self.denied, self.gap) = (Some(now), false, false);
            self.unanswered += 1;
        }
        asks
    }
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// Starts asking for the streams from the first.
    pub(crate) fn ask_for_streams(&mut self) {
        self.setup = 0;
        self.ask_for_limits();
        self.timers.set(Timer::Streams, self.now + STREAMS_EVERY);
        if self.kind() == Kind::ArduPilot {
            let timeout = Outgoing::Parameter("GUID_TIMEOUT", self.guided_timeout_s());
            self.links.push(Link::Autopilot, timeout);
        }
    }

    /// How long Guided keeps the last velocity.
    fn guided_timeout_s(&self) -> f32 {
        let margin_m = self.config.required_clearance_m - self.config.radius_m;
        (margin_m / self.config.cruise_mps).clamp(GUID_TIMEOUT_S.0, GUID_TIMEOUT_S.1)
    }

    /// Begins to read what the autopilot's parameters allow. In flight the limits stay as they are.
    fn ask_for_limits(&mut self) {
        if self.state.streams_setpoints() || self.telemetry.armed {
            return;
        }
        self.autopilot_limits = AutopilotLimits::default_of(self.kind());
        self.guidance.tune(&self.config, &self.autopilot_limits);
        (self.limits_read, self.limits_tries) = (0, LIMIT_TRIES);
        self.timers.set(Timer::Limit, self.now);
    }

    /// Requests the next limit that was not read.
    fn repeat_limits(&mut self) {
        if self.limits_tries == 0 || !self.timers.is_due(Timer::Limit, self.now) {
            return;
        }
        let all = self.kind().limits();
        let from = usize::from(self.limits_tries);
        // In turn, so that one that does not exist holds back none.
        let missing =
            (from..from + all.len()).map(|i| i % all.len()).find(|i| self.limits_read & 1 << i == 0);
        let Some(limit) = missing.and_then(|i| all.get(i)) else {
            self.limits_tries = 0;
            return;
        };
        self.limits_tries -= 1;
        self.timers.set(Timer::Limit, self.now + LIMIT_EVERY);
        self.links.push(Link::Autopilot, Outgoing::ReadParameter(limit.name));
    }

    /// PARAM_VALUE of the autopilot. Read by field: a type newer than the crate's must not hide the value.
    pub(crate) fn handle_limit(&mut self, frame: &Frame) {
        const ID: core::ops::Range<usize> = 8..24;
        let p = frame.padded();
        let value = f32::from_le_bytes([p[0], p[1], p[2], p[3]]);
        let name = p[ID].split(|b| *b == 0).next().unwrap_or_default();
        let mut changed = false;
        for (i, limit) in self.kind().limits().iter().enumerate() {
            if limit.name.as_bytes() == name && p[24] == REAL32 && !self.telemetry.armed {
                self.limits_read |= 1 << i;
                changed |= self.autopilot_limits.set(limit, value);
            }
        }
        if changed && !self.state.streams_setpoints() {
            self.guidance.tune(&self.config, &self.autopilot_limits);
        }
    }

    /// Asks for whatever is due.
    pub(crate) fn repeat_requests(&mut self) {
        let (now, kind) = (self.now, self.kind());
        let heard = self.telemetry.heartbeat_at.is_some();
        if heard {
            self.repeat_limits();
        }
        let silent = self.telemetry.heartbeat_age(now) > HEARD;
        if !silent
            && self.telemetry.position_age(now) > STREAMS_LOST
            && self.timers.is_due(Timer::Streams, now)
        {
            self.ask_for_streams();
        }
        let doubts = self.telemetry.doubts_origin();
        if heard && (doubts || self.telemetry.ekf_origin.is_none()) && self.timers.is_due(Timer::Origin, now)
        {
            self.timers.set(Timer::Origin, now + if doubts { ORIGIN_AGAIN } else { RETRY_EVERY });
            self.links.push(Link::Autopilot, Outgoing::Request(GPS_GLOBAL_ORIGIN));
        }
        for _ in 0..SETUP_BURST {
            if let Some(&(id, interval_us)) = kind.streams().get(self.setup) {
                self.links.push(Link::Autopilot, Outgoing::Interval(id, interval_us));
                self.setup += 1;
            }
        }
        self.request_lost_streams();
        if self.state == State::Arming {
            self.handshake.gap |= silent;
            if self.handshake.asks_to_arm(now, self.telemetry.armed) {
                self.links.push(Link::Autopilot, Outgoing::Arm(true));
            }
            return;
        }
        // The safety filter looks down before a landing is requested.
        let in_state = now - self.entered_at;
        let looks =
            self.state == State::Land && (in_state < LOOKS_DOWN || !self.guidance.filter.column_clear());
        if !self.timers.is_due(Timer::Request, now) || (looks && !self.must_land()) {
            return;
        }
        self.timers.set(Timer::Request, now + RETRY_EVERY);
        let change_to = |custom_mode| {
            let (main, sub) = kind.mode_params(custom_mode);
            Outgoing::Mode(main, sub)
        };
        match self.state {
            State::Engaging => self.links.push(Link::Autopilot, change_to(kind.setpoint_mode())),
            // HEARTBEAT may not show the mode yet in which a landing was requested.
            State::LandingHeld if in_state < HEARD || self.telemetry.custom_mode != kind.setpoint_mode() => {
                self.links.push(Link::Autopilot, change_to(kind.setpoint_mode()));
            }
            State::CancelStart => self.links.push(Link::Autopilot, Outgoing::Arm(false)),
            State::TakeOff => {
                self.timers.set(Timer::Request, now + TAKE_OFF_AFTER);
                let climb_m = self.plan.as_ref().map_or(0.0, |plan| plan.climb_m);
                self.links.push(Link::Autopilot, Outgoing::TakeOff(self.telemetry.above_home_m + climb_m));
            }
            State::Land if self.telemetry.custom_mode != kind.land_mode() => {
                self.links.push(Link::Autopilot, change_to(kind.land_mode()));
            }
            State::Disarm => {
                self.timers.set(Timer::Request, now + DISARM_AFTER);
                self.links.push(Link::Autopilot, Outgoing::Arm(false));
                if self.telemetry.custom_mode != kind.land_mode() {
                    self.links.push(Link::Autopilot, change_to(kind.land_mode()));
                }
            }
            _ => {}
        }
    }

    /// Requests streams again that are old, or never came, while the autopilot is heard.
    fn request_lost_streams(&mut self) {
        let (now, kind) = (self.now, self.kind());
        let asked = self.setup >= kind.streams().len() && self.telemetry.heartbeat_at.is_some();
        if !asked || self.telemetry.heartbeat_age(now) > HEARD || !self.timers.is_due(Timer::Streams, now) {
            return;
        }
        for &(id, interval_us) in kind.streams().iter().filter(|(_, interval_us)| *interval_us > 0.0) {
            if self.telemetry.stream_age(u32::from(id), now) > STREAM_LOST {
                self.timers.set(Timer::Streams, now + STREAMS_EVERY);
                self.links.push(Link::Autopilot, Outgoing::Interval(id, interval_us));
            }
        }
    }

    /// Whether the battery's charge was reported lately, or does not count.
    pub(crate) fn battery_reported(&self) -> bool {
        self.config.battery_low_percent <= 0
            || self.telemetry.stream_age(SYS_STATUS_DATA::ID, self.now) <= BATTERY_LOST
    }

    /// Takes the autopilot's answer to a request: what became of arming, and what was refused.
    pub(crate) fn handle_ack(&mut self, ack: &Ack) {
        if ack.to != (0, 0) && ack.to != (self.config.system_id, crate::COMPONENT) {
            return;
        }
        let (now, refused) = (self.now, !matches!(ack.result, ACCEPTED | IN_PROGRESS));
        match (self.state, ack.command) {
            (State::Arming, ARM_DISARM) if ack.result == ACCEPTED => {
                self.handshake.accepted_at.get_or_insert(now);
            }
            (State::Arming, ARM_DISARM) if refused => {
                (self.handshake.denied, self.handshake.unanswered) = (true, 0);
            }
            (State::Disarm, ARM_DISARM) if refused => self.handshake.disarm_refused = true,
            _ => {}
        }
        let told = Some((ack.command, ack.result));
        let reports = matches!(ack.command, DO_SET_MODE | ARM_DISARM | NAV_TAKEOFF);
        if !refused || !reports || self.handshake.reported.contains(&told) {
            return;
        }
        if let Some(free) = self.handshake.reported.iter_mut().find(|slot| slot.is_none()) {
            *free = told;
            let text = match ack.command {
                DO_SET_MODE => "Autopilot refuses the mode: # (result #)",
                ARM_DISARM => "Autopilot refuses to arm or disarm: # (result #)",
                _ => "Autopilot refuses to take off: # (result #)",
            };
            self.links.say_count(true, text, [u32::from(ack.command), u32::from(ack.result)]);
        }
    }
}
