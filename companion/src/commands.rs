//! Commands to the companion: COMMAND_LONG and COMMAND_INT, read by field, since the crate refuses a whole message whose
//! command it does not know and UNSUPPORTED must still be answered.
//!
//! Obeyed on either link, from a ground station that the mission names (`senders`), when addressed to our system or to all (0),
//! and to our component or to all (0). From others a command that acts is DENIED. Answered only
//! when addressed to our system: a broadcast to the swarm acts on each and is answered by none. A command to all
//! components that we do not know is somebody else's and stays unanswered.

use crate::frame::Frame;
use crate::mission::{Guard, State, awaits};
use crate::time::{Duration, Instant};

const COMMAND_INT: u32 = 75;
const COMMAND_LONG: u32 = 76;

/// `MAV_RESULT`.
pub const ACCEPTED: u8 = 0;
/// Not in this state.
pub const TEMPORARILY_REJECTED: u8 = 1;
/// Parameters make no sense.
pub const DENIED: u8 = 2;
/// Unknown command.
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

/// The same frame within this time is a repetition, not a new command.
const REPEAT: Duration = Duration::from_secs(5);

/// A command that concerns us.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// `MAV_CMD`.
    pub command: u16,
    /// First parameter.
    pub param1: f32,
    /// Second parameter.
    pub param2: f32,
    /// COMMAND_INT: latitude and longitude, 1e-7 degrees, and altitude, metres.
    pub place: Option<(i32, i32, f32)>,
    /// Sender: system and component.
    pub from: (u8, u8),
    /// Whether our system was named, so that an answer is due.
    pub to_us: bool,
    /// Whether our component was named.
    pub to_component: bool,
}

impl Command {
    /// Whether it is one of those that change something, and so counts only from a ground station of the mission.
    pub(crate) fn acts(&self) -> bool {
        let restarts = self.command == RESTART && (self.to_component || self.param2 == 1.0);
        restarts || matches!(self.command, RETURN | LAND | PAUSE_CONTINUE | START | EXCLUDE)
    }
}

/// Reads a command addressed to `system` or to all; `None` for other frames and other addressees.
pub fn read(frame: &Frame, system: u8) -> Option<Command> {
    let p = frame.padded();
    if frame.message_id != COMMAND_INT && frame.message_id != COMMAND_LONG {
        return None;
    }
    // Both lay out 28 bytes of parameters, then command, target system, target component.
    let (target_system, target_component) = (p[30], p[31]);
    let for_system = target_system == 0 || target_system == system;
    let for_component = target_component == 0 || target_component == crate::COMPONENT;
    let own_echo = frame.system == system && frame.component == crate::COMPONENT;
    if !for_system || !for_component || own_echo {
        return None;
    }
    let word = |at: usize| [p[at], p[at + 1], p[at + 2], p[at + 3]];
    let (whole, float) = (|at| i32::from_le_bytes(word(at)), |at| f32::from_le_bytes(word(at)));
    Some(Command {
        command: u16::from_le_bytes([p[28], p[29]]),
        param1: float(0),
        param2: float(4),
        place: (frame.message_id == COMMAND_INT).then(|| (whole(16), whole(20), float(24))),
        from: (frame.system, frame.component),
        to_us: target_system == system,
        to_component: target_component == crate::COMPONENT,
    })
}

/// What tells one command frame from another: system, component, sequence, command.
type Print = (u8, u8, u8, u16);

/// Remembers the last few command frames, so that a repeated one acts once.
#[derive(Clone, Copy, Debug, Default)]
pub struct Repeats {
    seen: [Option<(Print, Instant)>; 4],
    next: usize,
}

impl Repeats {
    /// Whether this very frame was seen lately; remembers it.
    pub fn is_repeat(&mut self, frame: &Frame, command: u16, now: Instant) -> bool {
        let print = (frame.system, frame.component, frame.sequence, command);
        if self.seen.iter().flatten().any(|&(seen, at)| seen == print && now - at < REPEAT) {
            return true;
        }
        self.seen[self.next] = Some((print, now));
        self.next = (self.next + 1) % self.seen.len();
        false
    }
}

/// What the commander wants; each flag holds until a row of the mission table uses it, or the state changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wishes {
    /// MISSION_START.
    pub start: bool,
    /// DO_PAUSE_CONTINUE 0.
    pub pause: bool,
    /// DO_PAUSE_CONTINUE 1.
    pub resume: bool,
    /// NAV_LAND.
    pub land: bool,
    /// NAV_RETURN_TO_LAUNCH.
    pub turn_back: bool,
}

/// Takes a mission command in and says the result; `None` for a command that is not one of the mission's.
pub fn apply(wishes: &mut Wishes, state: State, command: &Command) -> Option<u8> {
    use State::*;
    let (flag, guard, already): (_, _, &[State]) = match command.command {
        // A start in time for the plan is kept; a repeated one changes nothing.
        START if state == Planning => {
            wishes.start = true;
            return Some(ACCEPTED);
        }
        START => (
            &mut wishes.start,
            Guard::StartCommanded,
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
            ],
        ),
        PAUSE_CONTINUE if command.param1 == 0.0 => (&mut wishes.pause, Guard::PauseCommanded, &[Paused]),
        PAUSE_CONTINUE if command.param1 == 1.0 && state == PilotControl => {
            wishes.resume = true;
            return Some(ACCEPTED);
        }
        PAUSE_CONTINUE if command.param1 == 1.0 => {
            (&mut wishes.resume, Guard::ResumeCommanded, &[Climb, Follow, Blocked, Replanning])
        }
        PAUSE_CONTINUE => return Some(DENIED),
        LAND => (&mut wishes.land, Guard::LandCommanded, &[Stopping, Land, Disarm, Done, Aborted]),
        RETURN => (&mut wishes.turn_back, Guard::ReturnCommanded, &[Land, Disarm, Done, Aborted]),
        _ => return None,
    };
    if awaits(state, guard) {
        *flag = true;
        return Some(ACCEPTED);
    }
    Some(if already.contains(&state) { ACCEPTED } else { TEMPORARILY_REJECTED })
}
