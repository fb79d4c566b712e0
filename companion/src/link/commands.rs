//! Commands to the companion, by COMMAND_LONG or COMMAND_INT. They are decoded field by field: the
//! `mavlink` crate rejects a whole message whose command it does not know, and such a command must
//! still be answered UNSUPPORTED.
//!
//! A command counts on either link, if it is addressed to this vehicle's system id or to all (0),
//! and to this component or to all (0). A command that changes something counts only from a ground
//! station that the mission names (`answer_limits`); from other senders it is DENIED. A command is
//! answered only if it names this system id: a broadcast acts on every vehicle, and none answers.
//! An unknown command to all components belongs to another component and stays unanswered.

use crate::link::frame::{COMPANION_COMPONENT, Frame};
use crate::time::{Duration, Instant};

/// Message id of COMMAND_INT.
const COMMAND_INT: u32 = 75;
/// Message id of COMMAND_LONG.
const COMMAND_LONG: u32 = 76;

/// `MAV_RESULT` of an accepted command.
pub const ACCEPTED: u8 = 0;
/// `MAV_RESULT` of a command that the companion cannot obey in its current state.
pub const TEMPORARILY_REJECTED: u8 = 1;
/// `MAV_RESULT` of a command with invalid parameters, or from a sender without authority.
pub const DENIED: u8 = 2;
/// `MAV_RESULT` of a command that the companion does not know.
pub const UNSUPPORTED: u8 = 3;

/// NAV_RETURN_TO_LAUNCH: fly back to the start and land there.
pub const RETURN_TO_LAUNCH: u16 = 20;
/// NAV_LAND: land where the vehicle is.
pub const LAND: u16 = 21;
/// DO_PAUSE_CONTINUE: `param1` 0 pauses on the path, 1 resumes.
pub const PAUSE_CONTINUE: u16 = 193;
/// MISSION_START: arm, take off and fly the mission.
pub const MISSION_START: u16 = 300;
/// NAV_FENCE_CIRCLE_EXCLUSION as COMMAND_INT: adds an obstacle, a sphere of radius `param1` metres
/// about the command's place; radius 0 revokes it.
pub const FENCE_EXCLUSION: u16 = 5004;
/// REQUEST_MESSAGE: send the message whose id is `param1`.
pub const REQUEST_MESSAGE: u16 = 512;
/// PREFLIGHT_REBOOT_SHUTDOWN: restart the companion.
pub const REBOOT: u16 = 246;

/// `MAV_FRAME_GLOBAL`: altitude above mean sea level.
const FRAME_GLOBAL: u8 = 0;
/// `MAV_FRAME_GLOBAL_INT`: altitude above mean sea level.
const FRAME_GLOBAL_INT: u8 = 5;

/// Time after a command frame within which an identical frame, with the same MAVLink sequence
/// number, counts as its copy. A retry by the sender has another number: it is a new command.
const DUPLICATE_FRAME_WINDOW: Duration = Duration::from_secs(5);

/// A command addressed to this companion, to all components or to all vehicles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// `MAV_CMD`.
    pub command: u16,
    /// First parameter.
    pub param1: f32,
    /// Second parameter.
    pub param2: f32,
    /// Place of a COMMAND_INT whose frame has altitudes above mean sea level: latitude and
    /// longitude, 1e-7 degrees, and altitude, metres. `None` for any other frame: vehicles do not
    /// agree where a relative altitude counts from.
    pub place: Option<(i32, i32, f32)>,
    /// Sender: system and component id.
    pub from: (u8, u8),
    /// Whether the command names this vehicle's system id, so that it is answered.
    pub to_our_system: bool,
    /// Whether the command names the companion's component id.
    pub to_our_component: bool,
}

impl Command {
    /// Whether the command changes something (mission, obstacles, a restart), and so counts only
    /// from a ground station that the mission names.
    pub(crate) fn needs_authority(&self) -> bool {
        let restarts = self.command == REBOOT && (self.to_our_component || self.param2 == 1.0);
        restarts
            || matches!(
                self.command,
                RETURN_TO_LAUNCH | LAND | PAUSE_CONTINUE | MISSION_START | FENCE_EXCLUSION
            )
    }

    /// The STATUSTEXT sent once the command took effect; its two `#` stand for the sender's system
    /// and component id.
    pub(crate) fn log_text(&self) -> &'static str {
        match self.command {
            MISSION_START => "Start from #/#",
            PAUSE_CONTINUE if self.param1 == 0.0 => "Pause from #/#",
            PAUSE_CONTINUE => "Resume from #/#",
            LAND => "Landing from #/#",
            RETURN_TO_LAUNCH => "Return from #/#",
            FENCE_EXCLUSION if self.param1 > 0.0 => "Obstacle from #/#",
            FENCE_EXCLUSION => "Obstacle revoked from #/#",
            REBOOT => "Restart from #/#",
            _ => "Command from #/#",
        }
    }
}

/// Decodes a command for the vehicle of system id `system`. `None` for a frame that is no command,
/// is addressed to others, or was sent by this companion itself.
pub fn read_command(frame: &Frame, system: u8) -> Option<Command> {
    let p = frame.padded_payload();
    if frame.message_id != COMMAND_INT && frame.message_id != COMMAND_LONG {
        return None;
    }
    // COMMAND_INT and COMMAND_LONG both have 28 bytes of parameters, then command, target system,
    // target component.
    let (target_system, target_component) = (p[30], p[31]);
    let for_system = target_system == 0 || target_system == system;
    let for_component = target_component == 0 || target_component == COMPANION_COMPONENT;
    let own_echo = frame.system == system && frame.component == COMPANION_COMPONENT;
    if !for_system || !for_component || own_echo {
        return None;
    }
    let word = |at: usize| [p[at], p[at + 1], p[at + 2], p[at + 3]];
    let (whole, float) = (|at| i32::from_le_bytes(word(at)), |at| f32::from_le_bytes(word(at)));
    Some(Command {
        command: u16::from_le_bytes([p[28], p[29]]),
        param1: float(0),
        param2: float(4),
        place: (frame.message_id == COMMAND_INT
            && matches!(p[32], FRAME_GLOBAL | FRAME_GLOBAL_INT))
        .then(|| (whole(16), whole(20), float(24))),
        from: (frame.system, frame.component),
        to_our_system: target_system == system,
        to_our_component: target_component == COMPANION_COMPONENT,
    })
}

/// Number of leading payload bytes by which two command frames are compared: all fields of either
/// message (COMMAND_LONG has 33 bytes, COMMAND_INT 35).
const COMPARED_LEN: usize = 35;

/// A received command frame and the `MAV_RESULT` it was answered with.
#[derive(Clone, Copy, Debug)]
struct AnsweredCommand {
    /// System id and component id of the sender.
    from: (u8, u8),
    /// Sequence number of the frame.
    sequence: u8,
    /// Message id: that of COMMAND_INT or COMMAND_LONG.
    message: u32,
    /// The part of the payload by which frames are compared.
    payload: [u8; COMPARED_LEN],
    /// `None`: the command was not answered.
    result: Option<u8>,
    /// When the frame was received.
    at: Instant,
}

/// The last four command frames with their answers: a repeated frame gets the same answer and does
/// not act again. The same sequence number with other parameters is another command.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommandHistory {
    /// The frames; `None` in an entry not used yet.
    seen: [Option<AnsweredCommand>; 4],
    /// Index in `seen` of the entry that the next frame replaces, the oldest.
    next: usize,
}

impl CommandHistory {
    /// The `MAV_RESULT` that this same frame was answered with in the last 5 s; `Some(None)` if it
    /// was received but not answered. `None` for a frame not received before.
    pub fn previous_answer(&self, frame: &Frame, now: Instant) -> Option<Option<u8>> {
        let same = |seen: &&AnsweredCommand| {
            seen.from == (frame.system, frame.component)
                && (seen.sequence, seen.message) == (frame.sequence, frame.message_id)
                && seen.payload[..] == frame.padded_payload()[..COMPARED_LEN]
                && now - seen.at < DUPLICATE_FRAME_WINDOW
        };
        self.seen.iter().flatten().find(same).map(|seen| seen.result)
    }

    /// Stores a frame and its answer in place of the oldest one.
    pub fn remember(&mut self, frame: &Frame, result: Option<u8>, at: Instant) {
        let mut payload = [0; COMPARED_LEN];
        payload.copy_from_slice(&frame.padded_payload()[..COMPARED_LEN]);
        let (from, sequence, message) =
            ((frame.system, frame.component), frame.sequence, frame.message_id);
        self.seen[self.next] =
            Some(AnsweredCommand { from, sequence, message, payload, result, at });
        self.next = (self.next + 1) % self.seen.len();
    }
}
