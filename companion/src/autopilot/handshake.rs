//! Arming, step by step, and what the autopilot refused.

use crate::autopilot::telemetry::{Ack, Telemetry};
use crate::mission::State;
use crate::time::{Duration, Instant};

/// Time after which a denied arming is requested again.
const ARMING_RETRY_EVERY: Duration = Duration::from_millis(1000);
/// Longest time from the ack of arming to the first HEARTBEAT (1 Hz) with the armed bit.
const ARMED_TIMEOUT: Duration = Duration::from_millis(2500);
/// Arming requests that may stay without an answer; after them arming has failed.
const MAX_ARMING_TRIES: u8 = 2;
/// Most different refusals reported in one state.
const MAX_REFUSALS: usize = 4;

const NAV_TAKEOFF: u16 = 22;
const DO_SET_MODE: u16 = 176;
const ARM_DISARM: u16 = 400;
/// `MAV_RESULT` ACCEPTED.
const ACCEPTED: u8 = 0;
/// `MAV_RESULT` IN_PROGRESS.
const IN_PROGRESS: u8 = 5;

/// State of the requests of this mission state.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Handshake {
    /// When arming was last requested.
    requested_at: Option<Instant>,
    /// Requests without an answer.
    unanswered: u8,
    /// The last request was denied.
    denied: bool,
    /// When arming was accepted: from then on it is not requested again.
    accepted_at: Option<Instant>,
    /// HEARTBEAT was missing since arming was last requested: it may have been armed, and disarmed
    /// by its pilot, unseen.
    heartbeat_gap: bool,
    /// Disarming was refused.
    disarm_refused: bool,
    /// Offboard or Guided was entered for this mission, and no other mode but landing was seen
    /// since.
    in_own_mode: bool,
    /// The landing detector reported flight since arming was requested.
    flown: bool,
    /// Refusals reported in this state: command and result.
    reported: [Option<(u16, u8)>; MAX_REFUSALS],
}

impl Handshake {
    /// Clears what belongs to the state that was left.
    pub(crate) fn state_changed(&mut self, from: State, to: State) {
        self.reported = [None; MAX_REFUSALS];
        self.disarm_refused = false;
        if to == State::Arming {
            *self = Self { in_own_mode: true, ..Self::default() };
        }
        if from == State::PilotReturned {
            self.in_own_mode = true;
        }
    }

    /// Updates the handshake from the mode and the landing detector.
    pub(crate) fn update_mode_and_landed(&mut self, state: State, t: &Telemetry) {
        let kind = t.kind.unwrap_or_default();
        let on_ground = t.on_ground != Some(false);
        self.in_own_mode &=
            t.custom_mode == kind.setpoint_mode() || t.custom_mode == kind.land_mode();
        if !on_ground && t.armed {
            self.flown = true;
        }
        if matches!(state, State::Aborted | State::Done) && on_ground && !t.armed {
            self.in_own_mode = false;
        }
    }

    /// Whether the armed bit is overdue after an accepted request.
    pub(crate) fn is_armed_bit_overdue(&self, now: Instant) -> bool {
        self.accepted_at.is_some_and(|at| now - at >= ARMED_TIMEOUT)
    }

    /// Whether arming was requested as often as allowed without any answer.
    pub(crate) fn is_arming_unanswered(&self, now: Instant) -> bool {
        let waited = self.requested_at.is_some_and(|at| now - at >= ARMED_TIMEOUT);
        let silent = !self.denied && self.accepted_at.is_none();
        waited && silent && (self.unanswered >= MAX_ARMING_TRIES || self.heartbeat_gap)
    }

    /// Whether arming was not requested yet.
    pub(crate) fn is_arming_unrequested(&self) -> bool {
        self.requested_at.is_none()
    }

    /// Whether arming is to be requested now; notes that it is.
    pub(crate) fn should_request_arming(&mut self, now: Instant, armed: bool) -> bool {
        let due = match self.requested_at {
            None => true,
            Some(at) if self.denied => now - at >= ARMING_RETRY_EVERY,
            Some(at) => {
                now - at >= ARMED_TIMEOUT
                    && self.unanswered < MAX_ARMING_TRIES
                    && !self.heartbeat_gap
            }
        };
        let asks = due && !armed && self.accepted_at.is_none();
        if asks {
            (self.requested_at, self.denied, self.heartbeat_gap) = (Some(now), false, false);
            self.unanswered += 1;
        }
        asks
    }

    /// Whether disarming was refused.
    pub(crate) fn is_disarm_refused(&self) -> bool {
        self.disarm_refused
    }

    /// Whether the autopilot is in a mode of this mission's.
    pub(crate) fn is_in_own_mode(&self) -> bool {
        self.in_own_mode
    }

    /// Whether the landing detector reported flight since arming was requested.
    pub(crate) fn has_flown(&self) -> bool {
        self.flown
    }

    /// HEARTBEAT is missing.
    pub(crate) fn note_heartbeat_gap(&mut self) {
        self.heartbeat_gap = true;
    }

    /// Takes the autopilot's answer to a request: what became of arming. Returns a refusal that is
    /// to be reported: text, command and result.
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
            (State::Arming, ARM_DISARM) if refused => (self.denied, self.unanswered) = (true, 0),
            (State::Disarm, ARM_DISARM) if refused => self.disarm_refused = true,
            _ => {}
        }
        let refusal = Some((ack.command, ack.result));
        let reports = matches!(ack.command, DO_SET_MODE | ARM_DISARM | NAV_TAKEOFF);
        if !refused || !reports || self.reported.contains(&refusal) {
            return None;
        }
        *self.reported.iter_mut().find(|slot| slot.is_none())? = refusal;
        let text = match ack.command {
            DO_SET_MODE => "Autopilot refuses the mode: # (result #)",
            ARM_DISARM => "Autopilot refuses to arm or disarm: # (result #)",
            _ => "Autopilot refuses to take off: # (result #)",
        };
        Some((text, [u32::from(ack.command), u32::from(ack.result)]))
    }
}
