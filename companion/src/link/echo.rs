//! Delay of the swarm's radio: a vehicle's intent echoes the sequence number of another vehicle's
//! intent.
//!
//! A vehicle that receives an echo of its own sequence number knows the round trip: the time since
//! it sent that intent, minus the time for which the other vehicle held it. A message's one-way
//! delay is half of that, if both ways take equally long. The vehicles' clocks need not agree.

use crate::time::{Duration, Instant};

/// Number of sent intents that are stored: those of three seconds at the default rate.
const MAX_SENT_INTENTS: usize = 16;
/// Unit of [`IntentEcho::held_ticks`], the time between reception of an intent and its echo.
const HELD_TICK: Duration = Duration::from_millis(10);
/// Greatest delay that an echo can show, seconds: a wrong echo cannot make a vehicle's messages
/// count as arbitrarily late.
const MAX_DELAY_S: f32 = 1.0;
/// One-way delay of a neighbour's messages that is assumed before the first echo, seconds.
const ASSUMED_DELAY_S: f32 = 0.2;
/// Weight of a newly measured delay that is shorter than the estimate; a longer one replaces the
/// estimate at once.
const FALLING_DELAY_GAIN: f32 = 0.125;

/// Echo of another vehicle's last intent, sent within this vehicle's intent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntentEcho {
    /// Rank of the other vehicle in the roster, below 255.
    pub rank: u8,
    /// MAVLink sequence number of the other vehicle's intent.
    pub sequence: u8,
    /// Time from the reception of that intent to its echo, in units of 10 ms, at most 254.
    pub held_ticks: u8,
}

impl IntentEcho {
    /// The echo of the intent with this sequence number, received `held` ago. `None` from a rank of
    /// 255 or a time of 2.55 s on.
    pub(crate) fn new(rank: u16, sequence: u8, held: Duration) -> Option<Self> {
        let rank = u8::try_from(rank).ok().filter(|rank| *rank < u8::MAX)?;
        let held = u8::try_from(held.as_micros() / HELD_TICK.as_micros())
            .ok()
            .filter(|held| *held < u8::MAX)?;
        Some(Self { rank, sequence, held_ticks: held })
    }
}

/// The part of its path that a vehicle reports in an intent, metres along the path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReportedPath {
    /// Where the vehicle was when it sent the intent.
    pub(crate) along_m: f32,
    /// Where the intent's points end.
    pub(crate) points_end_m: f32,
}

/// An intent that this vehicle sent: sequence number, time of sending, and the reported path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SentIntent {
    sequence: u8,
    /// When the intent was sent.
    pub(crate) at: Instant,
    /// The path that the intent reports.
    pub(crate) path: ReportedPath,
}

/// Ring of the intents that this vehicle sent last.
#[derive(Clone, Debug, Default)]
pub(crate) struct SentIntents {
    /// The intents; the n-th sent one, from 0, at n modulo the length.
    ring: [Option<SentIntent>; MAX_SENT_INTENTS],
    /// Number of intents sent so far, which wraps around.
    count: usize,
    /// When the newest intent was sent that is known to have arrived.
    newest_arrived_sent_at: Instant,
}

impl SentIntents {
    /// Keeps an intent that was sent at `now`, in place of the oldest.
    pub(crate) fn note_sent(&mut self, sequence: u8, path: ReportedPath, now: Instant) {
        self.ring[self.count % MAX_SENT_INTENTS] = Some(SentIntent { sequence, at: now, path });
        self.count = self.count.wrapping_add(1);
    }

    /// Number of intents that this vehicle has sent.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The sent intent with the echoed sequence number; `None` if it is no longer kept.
    fn find(&self, echo: &IntentEcho) -> Option<SentIntent> {
        self.ring.iter().flatten().find(|sent| sent.sequence == echo.sequence).copied()
    }

    /// The sent intent whose arrival this echo shows, now stored as the newest that arrived. `None`
    /// if a newer one has arrived before, or if the intent is no longer stored.
    pub(crate) fn note_arrival(&mut self, echo: &IntentEcho) -> Option<SentIntent> {
        let sent = self.find(echo).filter(|sent| sent.at > self.newest_arrived_sent_at)?;
        self.newest_arrived_sent_at = sent.at;
        Some(sent)
    }

    /// One-way delay of messages, seconds, by an echo of an intent of this vehicle; `None` if that
    /// intent is no longer stored.
    pub(crate) fn message_delay_s(&self, echo: &IntentEcho, now: Instant) -> Option<f32> {
        let round_s = (now - self.find(echo)?.at).as_secs_f32()
            - f32::from(echo.held_ticks) * HELD_TICK.as_secs_f32();
        Some((0.5 * round_s).clamp(0.0, MAX_DELAY_S))
    }
}

/// Estimated one-way delay of the messages between this vehicle and a neighbour.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MessageDelay {
    /// The estimate, seconds.
    pub(crate) delay_s: f32,
    /// Whether `delay_s` was measured; before, it is [`ASSUMED_DELAY_S`].
    measured: bool,
}

impl Default for MessageDelay {
    fn default() -> Self {
        Self { delay_s: ASSUMED_DELAY_S, measured: false }
    }
}

impl MessageDelay {
    /// Updates the estimate from a newly measured one-way delay.
    pub(crate) fn update(&mut self, delay_s: f32) {
        let share = if self.measured && delay_s < self.delay_s { FALLING_DELAY_GAIN } else { 1.0 };
        self.delay_s += (delay_s - self.delay_s) * share;
        self.measured = true;
    }
}

#[cfg(test)]
mod tests;
