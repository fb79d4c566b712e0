//! The two links, to the autopilot and to the swarm: incoming frames, outgoing queues, and rate
//! limits of answers.

pub(crate) mod answer_limits;
pub mod commands;
pub mod echo;
pub mod frame;
pub mod intent;
pub mod outbox;
pub mod photographed;
pub mod rate_limit;
pub mod roster;
pub mod sequence;
pub mod severity;

use self::answer_limits::{AnswerKind, AnswerTokenBuckets, SenderKind};
use self::commands::{Command, CommandHistory};
use self::echo::{IntentEcho, ReportedPath, SentIntents};
use self::frame::{Counters, Frame, Framer, Header};
use self::outbox::{Outbox, Outgoing};
use self::rate_limit::RadioTokenBucket;
use self::severity::Severity;
use crate::events::Link;
use crate::time::Instant;

/// Free entries of a link's queue below which no answer to a ground station is queued: they are
/// kept for texts, commands to the autopilot, and acks of its requests.
const RESERVED_QUEUE_ENTRIES: usize = 8;
/// Further free entries below which no answer to another sender is queued: room for the answers to
/// a ground station, a list of all parameters and two more.
const RESERVED_FOR_GROUND_STATIONS: usize = 12;
/// Both links, in the order of their indices.
const BOTH_LINKS: [Link; 2] = [Link::Autopilot, Link::Swarm];

/// A message that is made from the newest state when its link is polled, instead of waiting in a
/// queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OnDemandMessage {
    /// SET_POSITION_TARGET_LOCAL_NED, the setpoint for the autopilot.
    Setpoint,
    /// HEARTBEAT.
    Heartbeat,
    /// AUTOPILOT_VERSION.
    Version,
    /// GLOBAL_POSITION_INT: this vehicle's position, for the swarm.
    Position,
    /// TUNNEL with this vehicle's intent: progress, flags and the points ahead of it.
    Intent,
    /// TUNNEL that relays reports of vehicles that others do not hear.
    Relay,
    /// TUNNEL with the roster report of a coverage mission: the state of all vehicles, on which
    /// they agree.
    Roster,
    /// TUNNEL with the waypoints of the area that are photographed.
    PhotographedReport,
    /// NAMED_VALUE_FLOAT with the number of photographed waypoints, for plots.
    PhotographedCount,
}

/// Both links, to the autopilot and to the swarm: framers, queues and rate limits.
#[derive(Clone, Debug, Default)]
pub(crate) struct Links {
    /// Framer of each link, in the order of [`Link`].
    framers: [Framer; 2],
    /// Queue of each link, in the order of [`Link`].
    outboxes: [Outbox; 2],
    /// For each link, the [`OnDemandMessage`]s that are due: bit n for the n-th variant.
    due_bits: [u16; 2],
    /// Limits the bytes that are sent to the radio beside the state messages.
    radio: RadioTokenBucket,
    /// The intents sent last, for their echoes.
    sent_intents: SentIntents,
    /// Limits the answers to requests.
    answer_buckets: AnswerTokenBuckets,
    /// The commands answered last: a repeated one gets the same answer.
    command_history: CommandHistory,
}

impl Links {
    /// Takes bytes off the front of `input`, received by `now`, up to the end of the next frame,
    /// and returns that frame; `None` once they hold no further whole frame.
    pub(crate) fn receive(&mut self, link: Link, now: Instant, input: &mut &[u8]) -> Option<Frame> {
        self.framers[link as usize].next(now, input)
    }

    /// Counters of frames and errors of a link's framer.
    pub(crate) fn counters(&self, link: Link) -> Counters {
        self.framers[link as usize].counters()
    }

    /// Number of messages dropped because a link's queue was full.
    pub(crate) fn dropped_messages(&self, link: Link) -> u32 {
        self.outboxes[link as usize].dropped()
    }

    /// Sets the due flag of a message: it is made at the next poll of the link.
    pub(crate) fn set_due(&mut self, link: Link, what: OnDemandMessage) {
        self.due_bits[link as usize] |= 1 << what as u8;
    }

    /// Clears the due flag of a message.
    pub(crate) fn clear_due(&mut self, link: Link, what: OnDemandMessage) {
        self.due_bits[link as usize] &= !(1 << what as u8);
    }

    /// Clears the due flag of a message. Returns whether it was set.
    pub(crate) fn take_due(&mut self, link: Link, what: OnDemandMessage) -> bool {
        let due = self.due_bits[link as usize] & 1 << what as u8 != 0;
        self.clear_due(link, what);
        due
    }

    /// Puts a message at the end of a link's queue.
    pub(crate) fn push(&mut self, link: Link, message: Outgoing) {
        self.outboxes[link as usize].push(message);
    }

    /// Queues a STATUSTEXT, at most 50 bytes, on both links.
    pub(crate) fn send_text(&mut self, severity: Severity, text: &'static str) {
        self.outboxes.iter_mut().for_each(|outbox| outbox.push(Outgoing::Text { severity, text }));
    }

    /// Queues a STATUSTEXT on both links; each `#` in the text is replaced by one of the numbers.
    pub(crate) fn send_text_with_numbers(
        &mut self,
        severity: Severity,
        text: &'static str,
        numbers: [u32; 2],
    ) {
        let numbers = [numbers[0], numbers[1], 0];
        self.outboxes
            .iter_mut()
            .for_each(|outbox| outbox.push(Outgoing::TextWithNumbers { severity, text, numbers }));
    }

    /// Whether an answer may be queued now: its rate limit and the link's queue have room. If so,
    /// one token of the rate limit is spent.
    pub(crate) fn take_answer_token(
        &mut self,
        now: Instant,
        link: Link,
        sender: SenderKind,
        kind: AnswerKind,
    ) -> bool {
        let kept = match sender {
            SenderKind::GroundStation => RESERVED_QUEUE_ENTRIES,
            SenderKind::Autopilot | SenderKind::Other => {
                RESERVED_QUEUE_ENTRIES + RESERVED_FOR_GROUND_STATIONS
            }
        };
        self.outboxes[link as usize].free_entries() > kept
            && self.answer_buckets.take_token(now, link, sender, kind)
    }

    /// Queues an answer, or drops it where its rate limit or the link's queue has no room.
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

    /// Queues on both links, as answers with a rate limit, a text about something that a sender
    /// did; each `#` in it is replaced by one of the numbers.
    pub(crate) fn send_rate_limited_text(
        &mut self,
        now: Instant,
        sender: SenderKind,
        severity: Severity,
        text: &'static str,
        numbers: [u32; 3],
    ) {
        for link in BOTH_LINKS {
            self.queue_answer(
                now,
                link,
                sender,
                AnswerKind::Text,
                Outgoing::TextWithNumbers { severity, text, numbers },
            );
        }
    }

    /// Queues on both links, with a rate limit, a text about something that a sender did; the
    /// sender's system and component id replace the text's two `#`.
    pub(crate) fn send_text_with_sender(
        &mut self,
        now: Instant,
        sender: SenderKind,
        text: &'static str,
        from: (u8, u8),
    ) {
        let numbers = [u32::from(from.0), u32::from(from.1), 0];
        self.send_rate_limited_text(now, sender, Severity::Info, text, numbers);
    }

    /// Queues a text with the sender of a command that took effect.
    pub(crate) fn send_command_text(
        &mut self,
        now: Instant,
        sender: SenderKind,
        command: &Command,
    ) {
        self.send_text_with_sender(now, sender, command.log_text(), command.from);
    }

    /// The `MAV_RESULT` with which an identical command frame was answered in the last 5 s;
    /// `Some(None)` if it was not answered; `None` if none was received, so that this frame is no
    /// duplicate.
    pub(crate) fn previous_answer(&self, frame: &Frame, now: Instant) -> Option<Option<u8>> {
        self.command_history.previous_answer(frame, now)
    }

    /// Remembers a command frame and the `MAV_RESULT` of its answer, so that a duplicate of the
    /// frame gets the same answer.
    pub(crate) fn remember_answer(&mut self, frame: &Frame, result: Option<u8>, now: Instant) {
        self.command_history.remember(frame, result, now);
    }

    /// Whether the radio's token bucket, which fills by `bytes_per_s`, allows another frame beside
    /// the state messages. State messages are not limited.
    pub(crate) fn may_send_by_radio(&mut self, now: Instant, bytes_per_s: u32) -> bool {
        self.radio.may_send(now, bytes_per_s)
    }

    /// Whether more than half of the radio's token bucket is full.
    pub(crate) fn is_radio_bucket_half_full(&self) -> bool {
        self.radio.is_half_full()
    }

    /// Takes the bytes of a frame other than a state message from the radio's token bucket.
    pub(crate) fn take_radio_tokens(&mut self, bytes: usize) {
        self.radio.take_tokens(bytes);
    }

    /// The header of the next frame on a link, with the next sequence number.
    pub(crate) fn next_header(&mut self, link: Link, system: u8) -> Header {
        self.outboxes[link as usize].next_header(system)
    }

    /// The header of an intent that reports `path`. Its sequence number and `path` are remembered:
    /// an echo of it by a neighbour gives the message delay, and the part of the path that the
    /// neighbour knows.
    pub(crate) fn intent_header(&mut self, system: u8, path: ReportedPath, now: Instant) -> Header {
        let header = self.next_header(Link::Swarm, system);
        self.sent_intents.note_sent(header.sequence, path, now);
        header
    }

    /// Number of intents sent since the start.
    pub(crate) fn intents_sent(&self) -> usize {
        self.sent_intents.count()
    }

    /// One-way delay of messages, seconds, measured by a neighbour's echo of an intent of this
    /// vehicle; `None` where that intent is no longer remembered.
    pub(crate) fn message_delay_s(&self, echo: &IntentEcho, now: Instant) -> Option<f32> {
        self.sent_intents.message_delay_s(echo, now)
    }

    /// This vehicle's intents sent last, and which of them are known to have arrived.
    pub(crate) fn sent_intents(&mut self) -> &mut SentIntents {
        &mut self.sent_intents
    }

    /// Writes the first message of a link's queue to `out` and removes it. Returns its length, 0
    /// where the queue is empty.
    pub(crate) fn write_queued(&mut self, link: Link, system: u8, out: &mut [u8]) -> usize {
        self.outboxes[link as usize].write_first(system, out)
    }
}
