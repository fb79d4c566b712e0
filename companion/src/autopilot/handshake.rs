//! Requests to the autopilot, repeated until they have taken effect: streams, EKF origin, limit
//! parameters, mode, arming, take-off, landing, disarming.

use crate::autopilot::AutopilotKind;
use crate::autopilot::arming::ArmingHandshake;
use crate::autopilot::limits::AutopilotLimits;
use crate::autopilot::telemetry::{Ack, MAX_HEARTBEAT_AGE, Telemetry};
use crate::events::Link;
use crate::link::Links;
use crate::link::frame::{COMPANION_COMPONENT, Frame};
use crate::link::outbox::Outgoing;
use crate::link::severity::Severity;
use crate::state::State;
use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

/// Time between two requests for the EKF origin after another origin than the one flown with was
/// received while armed.
pub(crate) const ORIGIN_RETRY_EVERY: Duration = Duration::from_millis(200);
/// Time from entering the state `Disarm` to the first request to disarm, and between two such
/// requests. Autopilots disarm by themselves within 3 s. The report of the ground may be false up
/// to 2.6 m above it
/// ([`MAX_HEIGHT_ERROR_ON_GROUND_M`](crate::margins::MAX_HEIGHT_ERROR_ON_GROUND_M) and the
/// estimate's error); at 0.3 m/s, the slowest landing, the vehicle is down before the request.
pub(crate) const DISARM_EVERY: Duration = Duration::from_millis(9000);
/// Least time in the state `Land` before the landing mode is requested: the safety filter checks
/// the column below the vehicle for two steps first.
const LAND_REQUEST_AFTER: Duration = Duration::from_millis(100);
/// Time between two requests of one kind to the autopilot, unless another constant says otherwise.
const REQUEST_RETRY_EVERY: Duration = Duration::from_millis(1000);
/// Time between two requests to take off: longer than ArduCopter takes to spin up and lift off (2.3
/// s).
const TAKE_OFF_RETRY_EVERY: Duration = Duration::from_millis(4000);
/// Age of the position, while HEARTBEAT still arrives, after which all streams are requested again:
/// the autopilot may have rebooted and forgotten them.
const POSITION_STREAM_TIMEOUT: Duration = Duration::from_millis(1500);
/// Least time between two requests for all streams.
const STREAMS_RETRY_EVERY: Duration = Duration::from_millis(2000);
/// Most streams requested in one step while connecting.
const STREAM_REQUESTS_PER_STEP: usize = 5;
/// Message id of GPS_GLOBAL_ORIGIN.
const GPS_GLOBAL_ORIGIN: u16 = 49;
/// Most PARAM_REQUEST_READ that are sent for all limit parameters together after one call of
/// [`Handshake::begin_requesting_streams`].
const MAX_LIMIT_REQUESTS: u8 = 80;
/// Time between two PARAM_REQUEST_READ for limit parameters.
const LIMIT_REQUEST_EVERY: Duration = Duration::from_millis(150);
/// `MAV_PARAM_TYPE_REAL32`.
const PARAM_TYPE_REAL32: u8 = 9;
/// Age of a stream's last message after which that stream is requested again; the slowest streams
/// have a period of 1 s.
const STREAM_LOST_AFTER: Duration = Duration::from_millis(4000);
/// Times from each of the first three requests for a mode to the next one while HEARTBEAT is
/// silent, seconds. After the fourth request none is made, since a pilot may fly the vehicle by
/// then. At 50 % loss all four are lost in one case of 16.
const MODE_RETRY_WHILE_SILENT_S: [u64; 3] = [1, 5, 20];
/// Greatest age of the reported battery charge with which a vehicle takes off.
const MAX_BATTERY_AGE: Duration = Duration::from_millis(5000);

/// The companion's situation, from which the requests to its autopilot follow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HandshakeContext {
    pub(crate) now: Instant,
    /// State of this vehicle's mission.
    pub(crate) state: State,
    /// Time since the mission state was entered.
    pub(crate) time_in_state: Duration,
    /// Height of the climb above the pad, metres.
    pub(crate) climb_m: f32,
    /// Value for ArduCopter's `GUID_TIMEOUT`: how long Guided keeps flying the last velocity
    /// without a further setpoint, seconds.
    pub(crate) guided_timeout_s: f32,
    /// Whether no other vehicle is in the vertical column that this vehicle is about to climb or
    /// descend.
    pub(crate) column_clear: bool,
    /// Whether the landing mode may be requested now.
    pub(crate) may_request_land_mode: bool,
}

/// State of the requests to the autopilot.
#[derive(Clone, Debug)]
pub(crate) struct Handshake {
    /// Requests to arm, to disarm and for flight modes.
    arming: ArmingHandshake,
    /// The limits that the autopilot's parameters set; its kind's defaults where none was read.
    limits: AutopilotLimits,
    /// Which limit parameters were read: bit i for the i-th of [`AutopilotKind::limit_parameters`].
    limits_read: u16,
    /// Number of requests for limit parameters that may still be sent.
    limit_requests_left: u8,
    /// Index in [`AutopilotKind::streams`] of the stream to be requested next; past the end where
    /// none is.
    next_stream: usize,
    /// Number of changes of mode requested since HEARTBEAT fell silent.
    mode_requests_while_silent: u8,
}

impl Default for Handshake {
    fn default() -> Self {
        let limits = AutopilotKind::default().default_limits();
        Self {
            arming: ArmingHandshake::default(),
            limits,
            limits_read: 0,
            limit_requests_left: 0,
            next_stream: usize::MAX,
            mode_requests_while_silent: 0,
        }
    }
}

impl Handshake {
    /// State of arming, disarming and flight modes.
    pub(crate) fn arming(&self) -> &ArmingHandshake {
        &self.arming
    }

    /// The limits that the autopilot's parameters set; its kind's defaults where none was read.
    pub(crate) fn limits(&self) -> &AutopilotLimits {
        &self.limits
    }

    /// Passes a change of the mission state on to [`ArmingHandshake::reset_for_state`].
    pub(crate) fn reset_for_state(&mut self, from: State, to: State) {
        self.arming.reset_for_state(from, to);
    }

    /// Updates the handshake from the autopilot's mode, armed bit and landing detector.
    pub(crate) fn update_mode_and_landed(&mut self, state: State, t: &Telemetry, now: Instant) {
        self.arming.update_mode_and_landed(state, t, now);
    }

    /// Requests all streams from the first on, in the following steps. With the motors off, in a
    /// state that streams no setpoints, it also sets the limits to their defaults, to be read from
    /// the autopilot again, and returns true. ArduPilot's `GUID_TIMEOUT` is set too.
    pub(crate) fn begin_requesting_streams(
        &mut self,
        telemetry: &Telemetry,
        s: &HandshakeContext,
        timers: &mut Timers,
        links: &mut Links,
    ) -> bool {
        self.next_stream = 0;
        // The limits that bound the setpoints must not change in flight, so they are read before.
        let reads = !s.state.streams_setpoints() && !telemetry.armed;
        if reads {
            self.limits = telemetry.kind().default_limits();
            (self.limits_read, self.limit_requests_left) = (0, MAX_LIMIT_REQUESTS);
            timers.set(Timer::Limit, s.now);
        }
        timers.set(Timer::Streams, s.now + STREAMS_RETRY_EVERY);
        if telemetry.kind() == AutopilotKind::ArduPilot {
            links.push(Link::Autopilot, Outgoing::SetParameter("GUID_TIMEOUT", s.guided_timeout_s));
        }
        reads
    }

    /// Requests the next limit parameter that was not read yet, when its time has come.
    fn request_next_limit_parameter(
        &mut self,
        kind: AutopilotKind,
        now: Instant,
        timers: &mut Timers,
        links: &mut Links,
    ) {
        if self.limit_requests_left == 0 || !timers.is_due(Timer::Limit, now) {
            return;
        }
        let all = kind.limit_parameters();
        let from = usize::from(self.limit_requests_left);
        // Parameters are requested in turn, so that one that the autopilot lacks delays no other.
        let missing = (from..from + all.len())
            .map(|i| i % all.len())
            .find(|i| self.limits_read & 1 << i == 0);
        let Some(limit) = missing.and_then(|i| all.get(i)) else {
            self.limit_requests_left = 0;
            return;
        };
        self.limit_requests_left -= 1;
        timers.set(Timer::Limit, now + LIMIT_REQUEST_EVERY);
        links.push(Link::Autopilot, Outgoing::ReadParameter(limit.name));
    }

    /// Handles the autopilot's PARAM_VALUE; while armed it is ignored. Returns whether a limit
    /// changed. Only a value of type REAL32 counts. The message is decoded field by field.
    pub(crate) fn handle_param_value(&mut self, telemetry: &Telemetry, frame: &Frame) -> bool {
        const ID: core::ops::Range<usize> = 8..24;
        let p = frame.padded_payload();
        let value = f32::from_le_bytes([p[0], p[1], p[2], p[3]]);
        let name = p[ID].split(|b| *b == 0).next().unwrap_or_default();
        let mut changed = false;
        for (i, limit) in telemetry.kind().limit_parameters().iter().enumerate() {
            if limit.name.as_bytes() == name && p[24] == PARAM_TYPE_REAL32 && !telemetry.armed {
                self.limits_read |= 1 << i;
                changed |= self.limits.set(limit, value);
            }
        }
        changed
    }

    /// Sends the requests that are due by time and mission state. Returns whether the limits were
    /// set to their defaults, so that the caller must pass them on to guidance.
    pub(crate) fn send_due_requests(
        &mut self,
        telemetry: &Telemetry,
        s: &HandshakeContext,
        timers: &mut Timers,
        links: &mut Links,
    ) -> bool {
        let (now, kind) = (s.now, telemetry.kind());
        let heard = telemetry.heartbeat_at.is_some();
        let silent = telemetry.heartbeat_age(now) > MAX_HEARTBEAT_AGE;
        if !silent {
            self.mode_requests_while_silent = 0;
            timers.set(Timer::UnheardMode, now);
        }
        if silent && s.state == State::Disarm {
            // Reports of the ground from before the silence no longer count: the wait begins again.
            timers.set(Timer::Request, now + DISARM_EVERY);
        }
        if heard {
            self.request_next_limit_parameter(kind, now, timers, links);
        }
        let lost = !silent && telemetry.position_age(now) > POSITION_STREAM_TIMEOUT;
        let limits_reset = lost
            && timers.is_due(Timer::Streams, now)
            && self.begin_requesting_streams(telemetry, s, timers, links);
        let doubts = telemetry.is_origin_doubtful();
        if heard && (doubts || telemetry.ekf_origin.is_none()) && timers.is_due(Timer::Origin, now)
        {
            timers.set(
                Timer::Origin,
                now + if doubts { ORIGIN_RETRY_EVERY } else { REQUEST_RETRY_EVERY },
            );
            links.push(Link::Autopilot, Outgoing::RequestMessage(GPS_GLOBAL_ORIGIN));
        }
        for _ in 0..STREAM_REQUESTS_PER_STEP {
            if let Some(&(id, interval_us)) = kind.streams().get(self.next_stream) {
                links.push(Link::Autopilot, Outgoing::SetMessageInterval(id, interval_us));
                self.next_stream += 1;
            }
        }
        if heard && !silent && timers.is_due(Timer::Streams, now) {
            self.request_lost_streams(telemetry, now, timers, links);
        }
        if s.state == State::Arming {
            if silent {
                self.arming.note_heartbeat_gap();
            }
            if s.column_clear && self.arming.should_request_arming(now, telemetry) {
                links.push(Link::Autopilot, Outgoing::Arm(true));
            }
        } else {
            self.request_for_state(telemetry, s, timers, links);
        }
        limits_reset
    }

    /// Requests the change of mode, take-off or disarming that the mission state waits for. In
    /// `Land` and `LandingHeld`, at most four requests for the mode are sent while HEARTBEAT is
    /// silent: a pilot may fly the vehicle.
    fn request_for_state(
        &mut self,
        telemetry: &Telemetry,
        s: &HandshakeContext,
        timers: &mut Timers,
        links: &mut Links,
    ) {
        let waits = s.state == State::Land && !s.may_request_land_mode;
        if waits || !timers.take_due(Timer::Request, s.now, REQUEST_RETRY_EVERY) {
            return;
        }
        let (kind, mode) = (telemetry.kind(), telemetry.custom_mode);
        let change_to = |custom_mode| {
            let (main, sub) = kind.mode_params(custom_mode);
            Outgoing::SetMode(main, sub)
        };
        let heartbeat_age = telemetry.heartbeat_age(s.now);
        let needs_mode = match s.state {
            // A HEARTBEAT from before this state may show the landing mode of an earlier landing.
            State::Land => mode != kind.land_mode() || heartbeat_age > s.time_in_state,
            // The HEARTBEAT at hand may be older than the landing mode that was requested before.
            State::LandingHeld => {
                s.time_in_state < MAX_HEARTBEAT_AGE || mode != kind.setpoint_mode()
            }
            _ => false,
        };
        if heartbeat_age > MAX_HEARTBEAT_AGE && s.state.lands_or_landing_is_held() {
            if needs_mode {
                self.request_mode_while_silent(kind, s, timers, links);
            }
            return;
        }
        let mut push = |request| links.push(Link::Autopilot, request);
        match s.state {
            State::Engaging => push(change_to(kind.setpoint_mode())),
            State::LandingHeld if needs_mode => push(change_to(kind.setpoint_mode())),
            State::CancelStart if self.arming.may_disarm_on_pad(s.now, telemetry) => {
                push(Outgoing::Arm(false));
            }
            State::TakeOff => {
                timers.set(Timer::Request, s.now + TAKE_OFF_RETRY_EVERY);
                push(Outgoing::TakeOff(telemetry.above_home_m + s.climb_m));
            }
            State::Land if needs_mode => push(change_to(kind.land_mode())),
            State::Disarm => {
                timers.set(Timer::Request, s.now + DISARM_EVERY);
                push(Outgoing::Arm(false));
            }
            _ => {}
        }
    }

    /// Requests, in `Land`, the landing mode or, in `LandingHeld`, the mode that follows setpoints:
    /// at most four times from when HEARTBEAT falls silent until it is heard again.
    fn request_mode_while_silent(
        &mut self,
        kind: AutopilotKind,
        s: &HandshakeContext,
        timers: &mut Timers,
        links: &mut Links,
    ) {
        let made = usize::from(self.mode_requests_while_silent);
        let retry_s = MODE_RETRY_WHILE_SILENT_S.get(made).copied().unwrap_or_default();
        let may = made <= MODE_RETRY_WHILE_SILENT_S.len();
        if !may || !timers.take_due(Timer::UnheardMode, s.now, Duration::from_secs(retry_s)) {
            return;
        }
        self.mode_requests_while_silent += 1;
        let holds = s.state == State::LandingHeld;
        let (main, sub) =
            kind.mode_params(if holds { kind.setpoint_mode() } else { kind.land_mode() });
        links.push(Link::Autopilot, Outgoing::SetMode(main, sub));
    }

    /// Requests again each stream that has been silent for 4 s (`STREAM_LOST_AFTER`) or never came,
    /// while HEARTBEAT is heard.
    fn request_lost_streams(
        &self,
        telemetry: &Telemetry,
        now: Instant,
        timers: &mut Timers,
        links: &mut Links,
    ) {
        let streams = telemetry.kind().streams();
        if self.next_stream < streams.len() {
            return;
        }
        for &(id, interval_us) in streams.iter().filter(|(_, interval_us)| *interval_us > 0.0) {
            if telemetry.stream_age(u32::from(id), now) > STREAM_LOST_AFTER {
                timers.set(Timer::Streams, now + STREAMS_RETRY_EVERY);
                links.push(Link::Autopilot, Outgoing::SetMessageInterval(id, interval_us));
            }
        }
    }

    /// Handles the autopilot's COMMAND_ACK if it is addressed to this companion or to nobody, and
    /// reports a refusal on both links; `own` is this vehicle's system id.
    pub(crate) fn handle_ack(
        &mut self,
        ack: &Ack,
        own: u8,
        state: State,
        now: Instant,
        links: &mut Links,
    ) {
        if ack.to != (0, 0) && ack.to != (own, COMPANION_COMPONENT) {
            return;
        }
        if let Some((text, numbers)) = self.arming.handle_ack(state, ack, now) {
            links.send_text_with_numbers(Severity::Warning, text, numbers);
        }
    }
}

impl HandshakeContext {
    /// Whether, after this time in the state, the column below has been checked for long enough,
    /// 0.1 s (`LAND_REQUEST_AFTER`), to request the landing mode if it is clear.
    pub(crate) fn is_column_checked(time_in_state: Duration) -> bool {
        time_in_state >= LAND_REQUEST_AFTER
    }
}

/// Whether the battery's charge was reported in the last 5 s (`MAX_BATTERY_AGE`); also true where
/// the charge is not checked, with `low_percent` ≤ 0.
pub(crate) fn is_battery_known_or_unchecked(
    telemetry: &Telemetry,
    low_percent: i8,
    now: Instant,
) -> bool {
    low_percent <= 0 || telemetry.battery_at.is_some_and(|at| now - at <= MAX_BATTERY_AGE)
}
