//! Queue of the messages to be sent on one link. Setpoints, heartbeats, positions and intents are
//! not queued: they are composed when the link is polled. A full queue drops the newest message and
//! counts it.

use core::fmt::Write as _;

use heapless::{Deque, String};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavCmd, MavParamType, MavSeverity, PARAM_ERROR_DATA,
    PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA, STATUSTEXT_DATA, TIMESYNC_DATA,
};

use crate::link::frame::{self, AUTOPILOT_COMPONENT, COMPANION_COMPONENT, Header};
use crate::link::severity::Severity;

/// Most messages in a link's queue.
pub const QUEUE_DEPTH: usize = 32;

/// A message in the queue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outgoing {
    /// SET_MESSAGE_INTERVAL to the autopilot: message id, and interval in microseconds, −1 for off.
    SetMessageInterval(u16, f32),
    /// REQUEST_MESSAGE to the autopilot: message id.
    RequestMessage(u16),
    /// DO_SET_MODE to the autopilot: parameters 2 and 3, as
    /// [`crate::autopilot::AutopilotKind::mode_params`] gives them.
    SetMode(f32, f32),
    /// NAV_TAKEOFF to the autopilot: target height above home, metres.
    TakeOff(f32),
    /// PARAM_REQUEST_READ to the autopilot, by name.
    ReadParameter(&'static str),
    /// PARAM_SET to the autopilot of a REAL32: name and value.
    SetParameter(&'static str, f32),
    /// TIMESYNC that answers a request.
    Timesync {
        /// This companion's clock, nanoseconds.
        tc1: i64,
        /// The requester's time stamp, nanoseconds, sent back as it came.
        ts1: i64,
        /// Addressee, the requester: system and component id. With it the autopilot does not
        /// forward the answer to others.
        to: (u8, u8),
    },
    /// PARAM_VALUE of one of the companion's own parameters.
    ParameterValue {
        /// Index of the parameter in the companion's table.
        index: usize,
        /// Number of parameters in the companion's table.
        count: u16,
        /// Name of the parameter.
        name: &'static str,
        /// Value of the parameter.
        value: f32,
    },
    /// PARAM_ERROR: the companion has no such parameter, or rejects its value.
    ParameterError {
        /// Index that was requested; −1 if the request had a name.
        index: i16,
        /// Name that was requested.
        id: [u8; 16],
        /// `MAV_PARAM_ERROR`.
        why: u8,
        /// Addressee, the requester: system and component id.
        to: (u8, u8),
    },
    /// COMPONENT_ARM_DISARM to the autopilot: true arms, false disarms.
    Arm(bool),
    /// DO_SET_CAM_TRIGG_DIST to the autopilot: from now on it takes a picture each `step_m` metres.
    TriggerEvery {
        /// Distance from one picture to the next, metres; 0 stops taking pictures.
        step_m: f32,
        /// Whether one picture is taken at once.
        at_once: bool,
    },
    /// DO_DIGICAM_CONTROL to the autopilot: it takes one picture at once.
    TakePicture,
    /// COMMAND_ACK that answers a command to the companion.
    Ack {
        /// `MAV_CMD` that is answered.
        command: u16,
        /// `MAV_RESULT`.
        result: u8,
        /// Addressee, the command's sender: system and component id.
        to: (u8, u8),
    },
    /// STATUSTEXT.
    Text {
        /// Severity.
        severity: Severity,
        /// At most 50 bytes.
        text: &'static str,
    },
    /// STATUSTEXT with numbers: each `#` of the text is replaced by the next number.
    TextWithNumbers {
        /// Severity.
        severity: Severity,
        /// The text, at most 50 bytes with its numbers.
        text: &'static str,
        /// Numbers that replace the text's `#`, in order.
        numbers: [u32; 3],
    },
}

/// The queue of one link, and the sequence number of the link's frames.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    /// Messages that wait to be sent, oldest first.
    queue: Deque<Outgoing, QUEUE_DEPTH>,
    /// Sequence number of the next frame.
    sequence: u8,
    /// Number of messages dropped since the start.
    dropped: u32,
}

impl Outbox {
    /// Puts a message at the end of the queue; a full queue drops it and counts it. Requests for
    /// streams, modes and arming are repeated anyway; a dropped text or ack is lost.
    pub fn push(&mut self, message: Outgoing) {
        if self.queue.push_back(message).is_err() {
            self.dropped = self.dropped.wrapping_add(1);
        }
    }

    /// Number of messages dropped since the start.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Number of free entries in the queue.
    pub fn free_entries(&self) -> usize {
        QUEUE_DEPTH - self.queue.len()
    }

    /// The MAVLink header of the link's next frame; increments the sequence number.
    pub fn next_header(&mut self, system: u8) -> Header {
        let sequence = self.sequence;
        self.sequence = self.sequence.wrapping_add(1);
        Header { system, component: COMPANION_COMPONENT, sequence }
    }

    /// Removes the first queued message and writes it as a frame. Returns its length, 0 if the
    /// queue is empty.
    pub fn write_first(&mut self, system: u8, out: &mut [u8]) -> usize {
        let Some(message) = self.queue.pop_front() else { return 0 };
        let header = self.next_header(system);
        let command = |command, param1: f32, param2: f32, param3: f32| COMMAND_LONG_DATA {
            command,
            param1,
            param2,
            param3,
            target_system: system,
            target_component: AUTOPILOT_COMPONENT,
            ..COMMAND_LONG_DATA::default()
        };
        let long = match message {
            Outgoing::SetMessageInterval(id, us) => {
                command(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, f32::from(id), us, 0.0)
            }
            Outgoing::RequestMessage(id) => {
                command(MavCmd::MAV_CMD_REQUEST_MESSAGE, f32::from(id), 0.0, 0.0)
            }
            Outgoing::SetMode(main, sub) => command(MavCmd::MAV_CMD_DO_SET_MODE, 1.0, main, sub),
            Outgoing::TakeOff(height_m) => COMMAND_LONG_DATA {
                param7: height_m,
                ..command(MavCmd::MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0)
            },
            Outgoing::TriggerEvery { step_m, at_once } => command(
                MavCmd::MAV_CMD_DO_SET_CAM_TRIGG_DIST,
                step_m,
                0.0,
                f32::from(u8::from(at_once)),
            ),
            Outgoing::TakePicture => COMMAND_LONG_DATA {
                param5: 1.0,
                ..command(MavCmd::MAV_CMD_DO_DIGICAM_CONTROL, 0.0, 0.0, 0.0)
            },
            Outgoing::ReadParameter(name) => {
                let read = PARAM_REQUEST_READ_DATA {
                    param_index: -1,
                    target_system: system,
                    target_component: AUTOPILOT_COMPONENT,
                    param_id: name.into(),
                };
                return frame::encode(header, &read, out);
            }
            Outgoing::SetParameter(name, param_value) => {
                let set = PARAM_SET_DATA {
                    param_value,
                    target_system: system,
                    target_component: AUTOPILOT_COMPONENT,
                    param_id: name.into(),
                    param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
                };
                return frame::encode(header, &set, out);
            }
            Outgoing::ParameterValue { index, count, name, value } => {
                let reported = PARAM_VALUE_DATA {
                    param_value: value,
                    param_count: count,
                    param_index: index as u16,
                    param_id: name.into(),
                    param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
                };
                return frame::encode(header, &reported, out);
            }
            Outgoing::ParameterError { index, id, why, to } => {
                // Encoded field by field: the requested name may be any bytes.
                let mut payload = [0; PARAM_ERROR_DATA::ENCODED_LEN];
                payload[..2].copy_from_slice(&index.to_le_bytes());
                (payload[2], payload[3]) = to;
                payload[4..20].copy_from_slice(&id);
                payload[20] = why;
                return frame::encode_raw(
                    header,
                    PARAM_ERROR_DATA::ID,
                    PARAM_ERROR_DATA::EXTRA_CRC,
                    &payload,
                    out,
                );
            }
            Outgoing::Timesync { tc1, ts1, to } => {
                // Encoded field by field: the crate's type lacks the target fields.
                let mut payload = [0; TIMESYNC_DATA::ENCODED_LEN + 2];
                payload[..8].copy_from_slice(&tc1.to_le_bytes());
                payload[8..16].copy_from_slice(&ts1.to_le_bytes());
                (payload[16], payload[17]) = to;
                return frame::encode_raw(
                    header,
                    TIMESYNC_DATA::ID,
                    TIMESYNC_DATA::EXTRA_CRC,
                    &payload,
                    out,
                );
            }
            Outgoing::Arm(arm) => {
                command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, f32::from(u8::from(arm)), 0.0, 0.0)
            }
            Outgoing::Ack { command, result, to } => {
                // Encoded field by field: the crate may not know the command, and its type lacks
                // the target fields.
                let [low, high] = command.to_le_bytes();
                let payload = [low, high, result, 0, 0, 0, 0, 0, to.0, to.1];
                return frame::encode_raw(
                    header,
                    COMMAND_ACK_DATA::ID,
                    COMMAND_ACK_DATA::EXTRA_CRC,
                    &payload,
                    out,
                );
            }
            Outgoing::Text { severity, text } => {
                let severity = mav_severity(severity);
                return frame::encode(
                    header,
                    &STATUSTEXT_DATA { severity, text: text.into() },
                    out,
                );
            }
            Outgoing::TextWithNumbers { severity, text, numbers } => {
                let (severity, text) = (mav_severity(severity), format_text(text, numbers));
                return frame::encode(
                    header,
                    &STATUSTEXT_DATA { severity, text: text.as_str().into() },
                    out,
                );
            }
        };
        frame::encode(header, &long, out)
    }
}

/// The severity as MAVLink has it.
fn mav_severity(severity: Severity) -> MavSeverity {
    match severity {
        Severity::Info => MavSeverity::MAV_SEVERITY_INFO,
        Severity::Warning => MavSeverity::MAV_SEVERITY_WARNING,
    }
}

/// The text with each `#` replaced by the next number, cut to 50 bytes.
fn format_text(text: &str, numbers: [u32; 3]) -> String<50> {
    let mut out = String::new();
    let mut numbers = numbers.iter();
    for piece in text.split_inclusive('#') {
        let (words, number) = match piece.strip_suffix('#') {
            Some(words) => (words, numbers.next()),
            None => (piece, None),
        };
        // An error means that the text is full: its end is left out.
        let _ = match number {
            Some(number) => write!(out, "{words}{number}"),
            None => out.write_str(words),
        };
    }
    out
}

#[cfg(test)]
mod tests;
