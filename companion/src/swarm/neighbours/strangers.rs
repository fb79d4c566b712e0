//! Strangers: vehicles outside the roster, known by their positions only. A few are kept, until
//! they are silent for a minute.

use super::Neighbours;
use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::time::Instant;

impl<const V: usize> Neighbours<V> {
    /// The entry of a position's sender: that of the roster, else a stranger's, added if it fits.
    pub(super) fn entry_for_position(
        &mut self,
        id: u8,
        now: Instant,
    ) -> Option<&mut NeighbourEntry> {
        if let Some(at) = self.active_roster_index(id, now).or_else(|| self.stranger_index(id)) {
            return self.entries.get_mut(at);
        }
        self.forget_silent_strangers(now);
        let room = self.entries.len() - self.roster_count < MAX_STRANGERS;
        match Some(id).filter(|_| room).and_then(|id| self.add_entry(id, STRANGER_RANK)) {
            Some(at) => self.entries.get_mut(at),
            None => {
                self.dropped = self.dropped.wrapping_add(1);
                None
            }
        }
    }

    fn stranger_index(&self, id: u8) -> Option<usize> {
        let strangers = &self.entries[self.roster_count..];
        strangers.iter().position(|c| c.id == id).map(|at| at + self.roster_count)
    }

    /// Removes the strangers for which `keep` returns false.
    pub(super) fn retain_strangers(&mut self, mut keep: impl FnMut(&NeighbourEntry) -> bool) {
        let mut at = self.roster_count;
        while let Some(entry) = self.entries.get(at) {
            if keep(entry) {
                at += 1;
            } else {
                self.entries.remove(at);
            }
        }
    }

    /// Removes the strangers that are silent.
    pub(super) fn forget_silent_strangers(&mut self, now: Instant) {
        self.retain_strangers(|c| c.heard_within(now, STRANGER_LIFETIME));
    }
}
