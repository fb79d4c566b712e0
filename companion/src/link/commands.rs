//! Commands to the companion: COMMAND_LONG and COMMAND_INT, read by field, since the crate refuses
//! a whole message whose command it does not know and UNSUPPORTED must still be answered.
//!
//! Obeyed on either link, from a ground station that the mission names (`answer_limits`), when
//! addressed to our system or to all (0), and to our component or to all (0). From others a command
//! that acts is DENIED. Answered only when addressed to our system: a broadcast to the swarm acts
//! on each and is answered by none. A command to all components that we do not know belongs to
//! another component and stays unanswered.

use crate::link::frame::Frame;
use crate::mission::{Guard, GuardInputs, MAX_POSITION_AGE, State, has_row_for};
use crate::time::{Duration, Instant};

const COMMAND_INT: u32 = 75;
const COMMAND_LONG: u32 = 76;

/// `MAV_RESULT` of an accepted command.
pub const ACCEPTED: u8 = 0;
/// `MAV_RESULT` of a command that is not possible in this state.
pub const TEMPORARILY_REJECTED: u8 = 1;
/// `MAV_RESULT` of a command whose parameters make no sense.
pub const DENIED: u8 = 2;
/// `MAV_RESULT` of an unknown command.
pub const UNSUPPORTED: u8 = 3;

/// NAV_RETURN_TO_LAUNCH.
pub const RETURN: u16 = 20;
/// NAV_LAND.
pub const LAND: u16 = 21;
/// DO_PAUSE_CONTINUE.
pub const PAUSE_CONTINUE: u16 = 193;
/// MISSION_START.
pub const START: u16 = 300;
/// NAV_FENCE_CIRCLE_EXCLUSION, as COMMAND_INT: a sphere to keep out of, of radius `param1` metres.
pub const EXCLUDE: u16 = 5004;
/// REQUEST_MESSAGE.
pub const REQUEST: u16 = 512;
/// PREFLIGHT_REBOOT_SHUTDOWN.
pub const RESTART: u16 = 246;

/// `MAV_FRAME_GLOBAL`.
const GLOBAL: u8 = 0;
/// `MAV_FRAME_GLOBAL_INT`.
const GLOBAL_INT: u8 = 5;

/// Time within which the same frame is a repetition, not a new command.
const DUPLICATE_WINDOW: Duration = Duration::from_secs(5);

/// A command addressed to this companion or to all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// `MAV_CMD`.
    pub command: u16,
    /// First parameter.
    pub param1: f32,
    /// Second parameter.
    pub param2: f32,
    /// COMMAND_INT in a frame of altitudes above mean sea level: latitude and longitude, 1e-7
    /// degrees, and altitude, metres. None in any other frame: where a relative altitude counts
    /// from is not known to every vehicle alike.
    pub place: Option<(i32, i32, f32)>,
    /// Sender: system and component.
    pub from: (u8, u8),
    /// Whether our system was named, so that an answer is due.
    pub to_us: bool,
    /// Whether our component was named.
    pub to_component: bool,
}

impl Command {
    /// Whether it is one of those that change something, and so counts only from a ground station
    /// of the mission.
    pub(crate) fn needs_authority(&self) -> bool {
        let restarts = self.command == RESTART && (self.to_component || self.param2 == 1.0);
        restarts || matches!(self.command, RETURN | LAND | PAUSE_CONTINUE | START | EXCLUDE)
    }

    /// The text reported once the command took effect: its numbers name the sender.
    pub(crate) fn log_text(&self) -> &'static str {
        match self.command {
            START => "Start from #/#",
            PAUSE_CONTINUE if self.param1 == 0.0 => "Pause from #/#",
            PAUSE_CONTINUE => "Resume from #/#",
            LAND => "Landing from #/#",
            RETURN => "Return from #/#",
            EXCLUDE if self.param1 > 0.0 => "Obstacle from #/#",
            EXCLUDE => "Obstacle revoked from #/#",
            RESTART => "Restart from #/#",
            _ => "Command from #/#",
        }
    }
}

/// Reads a command addressed to `system` or to all; `None` for other frames and other addressees.
pub fn read_command(frame: &Frame, system: u8) -> Option<Command> {
    let p = frame.padded();
    if frame.message_id != COMMAND_INT && frame.message_id != COMMAND_LONG {
        return None;
    }
    // Both lay out 28 bytes of parameters, then command, target system, target component.
    let (target_system, target_component) = (p[30], p[31]);
    let for_system = target_system == 0 || target_system == system;
    let for_component = target_component == 0 || target_component == crate::COMPANION_COMPONENT;
    let own_echo = frame.system == system && frame.component == crate::COMPANION_COMPONENT;
    if !for_system || !for_component || own_echo {
        return None;
    }
    let word = |at: usize| [p[at], p[at + 1], p[at + 2], p[at + 3]];
    let (whole, float) = (|at| i32::from_le_bytes(word(at)), |at| f32::from_le_bytes(word(at)));
    Some(Command {
        command: u16::from_le_bytes([p[28], p[29]]),
        param1: float(0),
        param2: float(4),
        place: (frame.message_id == COMMAND_INT && matches!(p[32], GLOBAL | GLOBAL_INT))
            .then(|| (whole(16), whole(20), float(24))),
        from: (frame.system, frame.component),
        to_us: target_system == system,
        to_component: target_component == crate::COMPANION_COMPONENT,
    })
}

/// Bytes of a command that are compared: parameters, command, addressee, and the frame's further
/// fields.
const COMPARED_LEN: usize = 35;

/// A command frame and its answer.
#[derive(Clone, Copy, Debug)]
struct AnsweredCommand {
    from: (u8, u8),
    sequence: u8,
    message: u32,
    payload: [u8; COMPARED_LEN],
    result: Option<u8>,
    at: Instant,
}

/// Remembers the last few command frames, so that a repeated one acts once and is answered alike.
/// The same sequence number with other parameters is another command.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommandHistory {
    seen: [Option<AnsweredCommand>; 4],
    next: usize,
}

impl CommandHistory {
    /// The answer that this very frame got lately, `Some(None)` if none yet; `None` for a frame not
    /// seen.
    pub fn previous_answer(&self, frame: &Frame, now: Instant) -> Option<Option<u8>> {
        let same = |seen: &&AnsweredCommand| {
            seen.from == (frame.system, frame.component)
                && (seen.sequence, seen.message) == (frame.sequence, frame.message_id)
                && seen.payload[..] == frame.padded()[..COMPARED_LEN]
                && now - seen.at < DUPLICATE_WINDOW
        };
        self.seen.iter().flatten().find(same).map(|seen| seen.result)
    }

    /// Remembers a frame and its answer.
    pub fn remember(&mut self, frame: &Frame, result: Option<u8>, at: Instant) {
        let mut payload = [0; COMPARED_LEN];
        payload.copy_from_slice(&frame.padded()[..COMPARED_LEN]);
        let (from, sequence, message) =
            ((frame.system, frame.component), frame.sequence, frame.message_id);
        self.seen[self.next] =
            Some(AnsweredCommand { from, sequence, message, payload, result, at });
        self.next = (self.next + 1) % self.seen.len();
    }
}

/// Commands of the operator that are not done yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PendingCommands {
    /// MISSION_START, until the mission ends.
    pub start: bool,
    /// DO_PAUSE_CONTINUE 0, until it is resumed or the vehicle lands: on the pad it holds the
    /// take-off back.
    pub pause: bool,
    /// DO_PAUSE_CONTINUE 1, until a row uses it or the state changes.
    pub resume: bool,
    /// NAV_LAND, until a row uses it.
    pub land: bool,
    /// NAV_RETURN_TO_LAUNCH, until a row uses it.
    pub turn_back: bool,
}

impl PendingCommands {
    /// Forgets what a row used, and all of it when the mission `ends`.
    pub(crate) fn state_changed(&mut self, guard: Guard, to: State, ends: bool) {
        use State::*;
        self.resume = false;
        if ends {
            *self = Self::default();
        }
        let lands = matches!(to, Land | Stopping);
        let resumed =
            matches!(guard, Guard::ResumeCommanded | Guard::ResumedOnPath) && to != Paused;
        let returns = matches!(guard, Guard::ReturnCommanded | Guard::ReturnOverField);
        if lands || resumed || returns {
            self.pause = false;
        }
        if lands || matches!(to, PilotControl | Failsafe) {
            self.land = false;
        }
        if lands || returns || matches!(to, PilotControl | Failsafe) {
            self.turn_back = false;
        }
    }
}

/// Applies a mission command and returns its MAV_RESULT; `None` for any other command.
pub fn apply_command(
    pending: &mut PendingCommands,
    state: State,
    inputs: &GuardInputs,
    command: &Command,
) -> Option<u8> {
    use State::*;
    let (flag, guard, already): (_, _, &[State]) = match command.command {
        // A start in time for the plan is kept; a repeated one changes nothing.
        START if state == Planning => {
            pending.start = true;
            return Some(ACCEPTED);
        }
        // A vehicle flies the rest of an area, which others left, from the pad that it came back
        // to.
        START if state == Done && inputs.area => {
            pending.start = true;
            return Some(ACCEPTED);
        }
        START => (
            &mut pending.start,
            if state == Aborted { Guard::StartAgain } else { Guard::StartCommanded },
            &[
                Scheduled,
                PadReplanning,
                Streaming,
                Engaging,
                Arming,
                TakeOff,
                Climb,
                Follow,
                Paused,
                Alone,
                Blocked,
                Replanning,
                Dividing,
            ],
        ),
        PAUSE_CONTINUE if command.param1 == 0.0 => {
            // Before the climb, and while something else interrupts the mission, the pause waits
            // for its row.
            let waits = matches!(
                state,
                Planning
                    | Ready
                    | Scheduled
                    | PadReplanning
                    | CancelStart
                    | TakeOff
                    | AutopilotSilent
                    | PositionLost
                    | PilotReturned
            );
            if waits && (state != CancelStart || pending.start) {
                pending.pause = true;
                return Some(ACCEPTED);
            }
            (&mut pending.pause, Guard::PauseCommanded, &[Paused])
        }
        PAUSE_CONTINUE if command.param1 == 1.0 => {
            // A place to continue from has to be known.
            if state == PilotReturned && inputs.position_age >= MAX_POSITION_AGE {
                return Some(TEMPORARILY_REJECTED);
            }
            let taken = matches!(state, PilotControl | PilotReturned | Failsafe);
            if pending.pause && !taken && !has_row_for(state, Guard::ResumeCommanded) {
                pending.pause = false;
                return Some(ACCEPTED);
            }
            let guard =
                if state == PilotReturned { Guard::ResumedOnPath } else { Guard::ResumeCommanded };
            (&mut pending.resume, guard, &[Climb, Follow, Blocked, Replanning, Dividing])
        }
        PAUSE_CONTINUE => return Some(DENIED),
        LAND if matches!(state, Failsafe | Aborted) => {
            // With motors off there is nothing to do. Otherwise the row acts, or a pilot or
            // failsafe flies the vehicle.
            let acts = inputs.armed && inputs.offboard;
            pending.land = acts;
            return Some(if acts || !inputs.armed { ACCEPTED } else { TEMPORARILY_REJECTED });
        }
        LAND => (&mut pending.land, Guard::LandCommanded, &[Stopping, Land, Disarm, Done]),
        RETURN => (&mut pending.turn_back, Guard::ReturnCommanded, &[Done]),
        _ => return None,
    };
    if has_row_for(state, guard) {
        *flag = true;
        return Some(ACCEPTED);
    }
    Some(if already.contains(&state) { ACCEPTED } else { TEMPORARILY_REJECTED })
}
