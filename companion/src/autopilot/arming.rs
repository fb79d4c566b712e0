//! Arming the autopilot step by step, and which of its refusals are reported as texts.

use crate::autopilot::landed::RISEN_M;
use crate::autopilot::telemetry::{Ack, MAX_HEARTBEAT_AGE, MAX_POSITION_AGE_ON_PAD, Telemetry};
use crate::state::State;
use crate::time::{Duration, Instant};

/// Time from a denied arming request to the next arming request.
const ARMING_RETRY_EVERY: Duration = Duration::from_millis(1000);
/// Longest time from the COMMAND_ACK that accepts arming to the first HEARTBEAT (1 Hz) with the
/// armed bit; also the time to wait for a COMMAND_ACK before arming is requested again.
const ARMED_TIMEOUT: Duration = Duration::from_millis(2500);
/// Rise of the estimated height since the last HEARTBEAT that counts as drift of the estimate, not
/// as flight, while the motors spin up and the landing detector reports the ground, metres;
/// `RISEN_M` comes on top.
const MAX_SPIN_UP_DRIFT_M: f32 = 0.6;
/// Age of the position up to which a vehicle whose climb had not begun is taken to stand on its
/// pad: a pilot needs longer to take over and take off.
const UNSEEN_ON_PAD_FOR: Duration = Duration::from_secs(5);
/// Most arming requests in a row without a COMMAND_ACK; after them arming has failed.
const MAX_ARMING_TRIES: u8 = 2;
/// Most different refusals (command and result) that are reported in one mission state.
const MAX_REPORTED_REFUSALS: usize = 4;

/// `MAV_CMD` number of NAV_TAKEOFF.
const NAV_TAKEOFF: u16 = 22;
/// `MAV_CMD` number of DO_SET_MODE, as COMMAND_ACK reports it.
const DO_SET_MODE: u16 = 176;
/// `MAV_CMD` number of COMPONENT_ARM_DISARM.
const ARM_DISARM: u16 = 400;
/// `MAV_RESULT` ACCEPTED.
const ACCEPTED: u8 = 0;
/// `MAV_RESULT` IN_PROGRESS.
const IN_PROGRESS: u8 = 5;

/// State of arming, disarming and flight modes between the companion and its autopilot.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ArmingHandshake {
    /// When arming was last requested; `None` before.
    requested_at: Option<Instant>,
    /// Arming requests since the last COMMAND_ACK that denied one.
    unanswered_requests: u8,
    /// Whether the autopilot denied the last arming request.
    denied: bool,
    /// When the autopilot accepted arming: from then on arming is not requested again.
    accepted_at: Option<Instant>,
    /// Whether HEARTBEAT was missing since arming was last requested: meanwhile the vehicle may
    /// have been armed, and disarmed again by its pilot. Then arming is not requested again.
    heartbeat_gap: bool,
    /// Whether the autopilot was switched to Offboard or Guided for this mission, and its HEARTBEAT
    /// has shown no mode but that and the landing mode since.
    in_own_mode: bool,
    /// Whether the landing detector has reported flight while armed, or the vehicle has risen,
    /// since the state `Arming` was entered.
    flown: bool,
    /// Whether a start that was cancelled had begun its climb: unseen, the vehicle may rise.
    climb_begun: bool,
    /// Estimated height in the mission frame at which the vehicle was last known to be disarmed,
    /// metres.
    disarmed_z_m: f32,
    /// Refusals already reported by a text in this mission state: `MAV_CMD` and `MAV_RESULT`.
    reported_refusals: [Option<(u16, u8)>; MAX_REPORTED_REFUSALS],
}

impl ArmingHandshake {
    /// To be called at each change of the mission state. Clears the refusals reported in `from`.
    /// Entering `Arming` clears everything but the height at which the vehicle was last known to be
    /// disarmed. On entering `Arming`, and on leaving `PilotReturned`, the autopilot counts as in
    /// the companion's own mode. Entering `CancelStart` notes whether the climb had begun.
    pub(crate) fn reset_for_state(&mut self, from: State, to: State) {
        self.reported_refusals = [None; MAX_REPORTED_REFUSALS];
        if to == State::Arming {
            let disarmed_z_m = self.disarmed_z_m;
            *self = Self { in_own_mode: true, disarmed_z_m, ..Self::default() };
        }
        if from == State::PilotReturned {
            self.in_own_mode = true;
        }
        if to == State::CancelStart && from != to {
            self.climb_begun = from.takes_off();
        }
    }

    /// Updates [`Self::is_in_own_mode`] and [`Self::has_flown`] from the autopilot's mode, armed
    /// bit and landing detector.
    pub(crate) fn update_mode_and_landed(&mut self, state: State, t: &Telemetry, now: Instant) {
        let kind = t.kind.unwrap_or_default();
        let on_ground = !t.last_reported_flight();
        self.in_own_mode &=
            t.custom_mode == kind.setpoint_mode() || t.custom_mode == kind.land_mode();
        if !t.armed {
            // Once arming is requested, the vehicle may be armed and rise unseen from the last
            // HEARTBEAT on. While the landing detector reports the ground, what looks like a small
            // rise is the estimate, which spinning motors disturb.
            let drifts = t.heartbeat_age(now) < MAX_HEARTBEAT_AGE && t.lately_reported_ground(now);
            let most_m = if drifts { MAX_SPIN_UP_DRIFT_M } else { 0.0 };
            self.disarmed_z_m = match self.requested_at {
                None => t.position.z,
                Some(_) => t.position.z.min(t.heartbeat_z_m + most_m),
            };
        }
        if (t.armed && !on_ground) || t.position.z > self.disarmed_z_m + RISEN_M {
            self.flown = true;
        }
        if state.is_over() && on_ground && !t.armed {
            self.in_own_mode = false;
        }
    }

    /// Whether the autopilot accepted arming 2.5 s (`ARMED_TIMEOUT`) ago or more: HEARTBEAT should
    /// show the armed bit by now.
    pub(crate) fn is_armed_bit_overdue(&self, now: Instant) -> bool {
        self.accepted_at.is_some_and(|at| now - at >= ARMED_TIMEOUT)
    }

    /// Whether arming has failed for want of an answer: 2.5 s have passed since the last arming
    /// request, no COMMAND_ACK came, and either two requests were sent or HEARTBEAT was missing
    /// meanwhile.
    pub(crate) fn is_arming_unanswered(&self, now: Instant) -> bool {
        let waited = self.requested_at.is_some_and(|at| now - at >= ARMED_TIMEOUT);
        let silent = !self.denied && self.accepted_at.is_none();
        waited && silent && (self.unanswered_requests >= MAX_ARMING_TRIES || self.heartbeat_gap)
    }

    /// Whether arming has not been requested since the state `Arming` was entered.
    pub(crate) fn is_arming_unrequested(&self) -> bool {
        self.requested_at.is_none()
    }

    /// Whether an arming request is to be sent now; if so, counts it as sent.
    pub(crate) fn should_request_arming(&mut self, now: Instant, telemetry: &Telemetry) -> bool {
        let due = match self.requested_at {
            None => true,
            Some(at) if self.denied => now - at >= ARMING_RETRY_EVERY,
            Some(at) => {
                now - at >= ARMED_TIMEOUT
                    && self.unanswered_requests < MAX_ARMING_TRIES
                    && !self.heartbeat_gap
            }
        };
        let asks = due && !telemetry.armed && self.accepted_at.is_none();
        if asks {
            (self.requested_at, self.denied, self.heartbeat_gap) = (Some(now), false, false);
            self.unanswered_requests += 1;
        }
        asks
    }

    /// Whether the autopilot is still in the mode that the companion set: Offboard or Guided, or
    /// the landing mode after it.
    pub(crate) fn is_in_own_mode(&self) -> bool {
        self.in_own_mode
    }

    /// Whether the landing detector has reported flight while armed, or the vehicle has risen,
    /// since the state `Arming` was entered.
    pub(crate) fn has_flown(&self) -> bool {
        self.flown
    }

    /// Whether a vehicle whose start is cancelled may be disarmed: it has not flown, and its
    /// position is less than 0.15 s old. If its climb had not begun, the position may be up to 5 s
    /// old: with an older one its pilot may have taken off unseen.
    pub(crate) fn may_disarm_on_pad(&self, now: Instant, telemetry: &Telemetry) -> bool {
        let seen = match self.climb_begun {
            true => telemetry.position_age(now) < MAX_POSITION_AGE_ON_PAD,
            false => telemetry.last_position_at.is_some_and(|at| now - at < UNSEEN_ON_PAD_FOR),
        };
        !self.flown && seen
    }

    /// Notes that HEARTBEAT is missing while the vehicle is to be armed.
    pub(crate) fn note_heartbeat_gap(&mut self) {
        self.heartbeat_gap = true;
    }

    /// Handles the autopilot's COMMAND_ACK. Returns a refusal that is to be reported, each command
    /// and result once in a state: the text, and as its numbers the command and the result.
    pub(crate) fn handle_ack(
        &mut self,
        state: State,
        ack: &Ack,
        now: Instant,
    ) -> Option<(&'static str, [u32; 2])> {
        let refused = !matches!(ack.result, ACCEPTED | IN_PROGRESS);
        match (state, ack.command) {
            (State::Arming, ARM_DISARM) if ack.result == ACCEPTED => {
                self.accepted_at.get_or_insert(now);
            }
            (State::Arming, ARM_DISARM) if refused => {
                (self.denied, self.unanswered_requests) = (true, 0);
            }
            _ => {}
        }
        let refusal = Some((ack.command, ack.result));
        let reports = matches!(ack.command, DO_SET_MODE | ARM_DISARM | NAV_TAKEOFF);
        if !refused || !reports || self.reported_refusals.contains(&refusal) {
            return None;
        }
        *self.reported_refusals.iter_mut().find(|slot| slot.is_none())? = refusal;
        let text = match ack.command {
            DO_SET_MODE => "Autopilot refuses the mode: # (result #)",
            ARM_DISARM => "Autopilot refuses to arm or disarm: # (result #)",
            _ => "Autopilot refuses to take off: # (result #)",
        };
        Some((text, [u32::from(ack.command), u32::from(ack.result)]))
    }
}
