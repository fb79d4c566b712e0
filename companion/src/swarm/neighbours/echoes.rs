//! Echoes of intents, by which vehicles know the delay of their messages.

use super::Neighbours;
use crate::link::echo::{IntentEcho, MessageDelay};
use crate::time::Instant;

impl<const V: usize> Neighbours<V> {
    /// Rank of this vehicle in the roster.
    pub(crate) fn own_rank(&self) -> u16 {
        self.own_rank
    }

    /// Estimated delay of the messages from the vehicle `id` of the roster.
    pub(crate) fn message_delay(&mut self, id: u8) -> Option<&mut MessageDelay> {
        let at = self.roster_index(id)?;
        Some(&mut self.entries[at].message_delay)
    }

    /// Greatest message delay of the roster's vehicles, seconds.
    pub(crate) fn max_message_delay_s(&self) -> f32 {
        self.entries[..self.roster_count]
            .iter()
            .fold(0.0, |most, c| libm::fmaxf(most, c.message_delay.delay_s))
    }

    /// An echo of a neighbour's last intent, for this vehicle's next intent; the neighbours take
    /// turns by `turn`, the number of intents that this vehicle has sent.
    pub(crate) fn next_echo(&self, turn: usize, now: Instant) -> Option<IntentEcho> {
        let entry = self.entries[..self.roster_count].get(turn % self.roster_count.max(1))?;
        IntentEcho::new(entry.rank, entry.intent_sequence, now - entry.intent_at?)
    }
}
