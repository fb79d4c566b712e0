//! The two links, to the autopilot and to the swarm: incoming frames, outgoing queues, and rate
//! limits of answers.

pub(crate) mod answer_limits;
pub mod commands;
pub mod done;
pub mod echo;
pub mod frame;
pub mod intent;
pub mod outbox;
pub mod rate_limit;
pub mod roster;

use self::answer_limits::{AnswerKind, AnswerTokenBuckets, SenderKind};
use self::commands::{Command, CommandHistory};
use self::echo::{IntentEcho, SentIntents};
use self::frame::{Counters, Frame, Framer, Header};
use self::outbox::{Outbox, Outgoing};
use self::rate_limit::RateLimit;
use crate::events::Link;
use crate::time::Instant;

/// Entries of a link's queue that answers leave free for texts, for acks of the own requests, and
/// for commands.
const KEPT_FREE: usize = 8;
/// Further entries that are left free for answers to a ground station: a list of all parameters,
/// and two more.
const KEPT_FOR_GROUND: usize = 12;
const BOTH_LINKS: [Link; 2] = [Link::Autopilot, Link::Swarm];

/// A message that is made from the newest state when its link is polled, instead of waiting in a
/// queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OnDemandMessage {
    /// A setpoint.
    Setpoint,
    /// HEARTBEAT.
    Heartbeat,
    /// AUTOPILOT_VERSION.
    Version,
    /// GLOBAL_POSITION_INT.
    Position,
    /// The intent.
    Intent,
    /// Reports of vehicles that others do not hear, passed on.
    Relay,
    /// The roster: the state of all vehicles that a coverage mission agrees on.
    Roster,
    /// The photographed waypoints of the area.
    Done,
    /// The number of photographed waypoints, to be plotted.
    DoneCount,
}

/// Both links.
#[derive(Clone, Debug, Default)]
pub(crate) struct Links {
    framers: [Framer; 2],
    outboxes: [Outbox; 2],
    /// Bits of [`OnDemandMessage`].
    due: [u16; 2],
    radio: RateLimit,
    sent: SentIntents,
    rates: AnswerTokenBuckets,
    repeats: CommandHistory,
}

impl Links {
    /// The next frame of the bytes received by `now`.
    pub(crate) fn receive(&mut self, link: Link, now: Instant, input: &mut &[u8]) -> Option<Frame> {
        self.framers[link as usize].next(now, input)
    }

    /// Counters of a link's framer.
    pub(crate) fn counters(&self, link: Link) -> Counters {
        self.framers[link as usize].counters()
    }

    /// Messages dropped because a link's queue was full.
    pub(crate) fn dropped_messages(&self, link: Link) -> u32 {
        self.outboxes[link as usize].dropped()
    }

    /// Sets whether the message `what` is to be made at the next poll.
    pub(crate) fn set_due(&mut self, link: Link, what: OnDemandMessage, due: bool) {
        let bit = 1 << what as u8;
        let bits = &mut self.due[link as usize];
        *bits = if due { *bits | bit } else { *bits & !bit };
    }

    /// Clears the due flag of a message. Returns whether it was set.
    pub(crate) fn take_due(&mut self, link: Link, what: OnDemandMessage) -> bool {
        let due = self.due[link as usize] & 1 << what as u8 != 0;
        self.set_due(link, what, false);
        due
    }

    /// Puts a message at the end of a link's queue.
    pub(crate) fn push(&mut self, link: Link, message: Outgoing) {
        self.outboxes[link as usize].push(message);
    }

    /// Sends a person a text by STATUSTEXT on both links, at most 50 bytes.
    pub(crate) fn send_text(&mut self, warning: bool, text: &'static str) {
        self.outboxes.iter_mut().for_each(|outbox| outbox.push(Outgoing::Text { warning, text }));
    }

    /// As `send_text`, with numbers: each `#` of the text stands for one.
    pub(crate) fn send_text_with_numbers(
        &mut self,
        warning: bool,
        text: &'static str,
        numbers: [u32; 2],
    ) {
        let numbers = [numbers[0], numbers[1], 0];
        self.outboxes
            .iter_mut()
            .for_each(|outbox| outbox.push(Outgoing::Count { warning, text, numbers }));
    }

    /// Whether an answer may be queued now; if so, it is counted.
    pub(crate) fn take_answer_token(
        &mut self,
        now: Instant,
        link: Link,
        sender: SenderKind,
        kind: AnswerKind,
    ) -> bool {
        let kept = match sender {
            SenderKind::GroundStation => KEPT_FREE,
            SenderKind::Autopilot | SenderKind::Other => KEPT_FREE + KEPT_FOR_GROUND,
        };
        self.outboxes[link as usize].free_entries() > kept
            && self.rates.take_token(now, link, sender, kind)
    }

    /// Queues an answer, unless its rate or the queue is used up.
    pub(crate) fn queue_answer(
        &mut self,
        now: Instant,
        link: Link,
        sender: SenderKind,
        kind: AnswerKind,
        answer: Outgoing,
    ) {
        if self.take_answer_token(now, link, sender, kind) {
            self.push(link, answer);
        }
    }

    /// Sends on both links a text about a sender's action; each `#` of the text stands for a
    /// number.
    pub(crate) fn send_sender_text(
        &mut self,
        now: Instant,
        sender: SenderKind,
        warning: bool,
        text: &'static str,
        numbers: [u32; 3],
    ) {
        for link in BOTH_LINKS {
            self.queue_answer(
                now,
                link,
                sender,
                AnswerKind::Text,
                Outgoing::Count { warning, text, numbers },
            );
        }
    }

    /// Sends a text that names the sender of a message.
    pub(crate) fn log_sender(
        &mut self,
        now: Instant,
        sender: SenderKind,
        text: &'static str,
        from: (u8, u8),
    ) {
        self.send_sender_text(now, sender, false, text, [u32::from(from.0), u32::from(from.1), 0]);
    }

    /// Sends a text that names the sender of a command that took effect.
    pub(crate) fn log_command(&mut self, now: Instant, sender: SenderKind, command: &Command) {
        self.log_sender(now, sender, command.log_text(), command.from);
    }

    /// The answer that this very command frame got lately, `Some(None)` if none yet; `None` for a
    /// frame not seen.
    pub(crate) fn previous_answer(&self, frame: &Frame, now: Instant) -> Option<Option<u8>> {
        self.repeats.previous_answer(frame, now)
    }

    /// Remembers a command frame and its answer.
    pub(crate) fn remember_answer(&mut self, frame: &Frame, result: Option<u8>, now: Instant) {
        self.repeats.remember(frame, result, now);
    }

    /// Whether the radio's rate limit lets another frame out.
    pub(crate) fn may_send_by_radio(&mut self, now: Instant, armed: bool) -> bool {
        self.radio.may_send(now, armed)
    }

    /// Whether half of the radio's rate limit is left.
    pub(crate) fn is_radio_bucket_half_full(&self) -> bool {
        self.radio.is_half_full()
    }

    /// Counts bytes sent by radio in addition to the state messages.
    pub(crate) fn count_radio_bytes(&mut self, bytes: usize) {
        self.radio.count_bytes(bytes);
    }

    /// The header of the next frame of a link.
    pub(crate) fn next_header(&mut self, link: Link, system: u8) -> Header {
        self.outboxes[link as usize].next_header(system)
    }

    /// The header of an intent whose points lead to `ends_m` along the path: its number is
    /// remembered, so that an echo of it shows how late messages are, and what others know.
    pub(crate) fn intent_header(&mut self, system: u8, ends_m: f32, now: Instant) -> Header {
        let header = self.next_header(Link::Swarm, system);
        self.sent.note_sent(header.sequence, ends_m, now);
        header
    }

    /// Intents sent.
    pub(crate) fn intents_sent(&self) -> usize {
        self.sent.count()
    }

    /// Time that a message takes one way, seconds, by an echo of an own intent.
    pub(crate) fn message_delay_s(&self, echo: &IntentEcho, now: Instant) -> Option<f32> {
        self.sent.message_delay_s(echo, now)
    }

    /// What is known of the own intents that arrived.
    pub(crate) fn sent_intents(&mut self) -> &mut SentIntents {
        &mut self.sent
    }

    /// Writes the first message that waits on a link; 0 if none does.
    pub(crate) fn write_queued(&mut self, link: Link, system: u8, out: &mut [u8]) -> usize {
        self.outboxes[link as usize].write_first(system, out)
    }
}
