//! Strangers: vehicles outside the roster, known by their positions only. A few are kept, until
//! they are silent for a minute.

use super::Neighbours;
use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::time::Instant;

impl<const V: usize> Neighbours<V> {
    /// Index of the entry of the stranger `id`, added if it fits.
    pub(super) fn stranger_entry(&mut self, id: u8, now: Instant) -> Option<usize> {
        let known = self.stranger_entry_index(id);
        if known.is_some() {
            return known;
        }
        self.forget_silent_strangers(now);
        let room = self.entries.len() - self.roster_count < MAX_STRANGERS;
        let added =
            Some(id).filter(|_| room).and_then(|id| self.add_entry(id, RANK_OUTSIDE_ROSTER));
        if added.is_none() {
            self.dropped_positions = self.dropped_positions.wrapping_add(1);
        }
        added
    }

    /// Index into `entries`, where the strangers follow the roster, of the stranger `id`.
    fn stranger_entry_index(&self, id: u8) -> Option<usize> {
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
