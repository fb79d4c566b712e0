//! Who hears whom: which neighbours were heard lately, and whether they hear this vehicle.

use super::Neighbours;
use super::bounds::*;
use crate::time::{Duration, Instant};

impl<const V: usize> Neighbours<V> {
    /// Vehicles heard within 0.8 s, a bit for each rank below 32.
    pub fn heard_bits(&self, now: Instant) -> u32 {
        let heard =
            self.entries.iter().filter(|c| c.rank < 32 && c.heard_within(now, HEARD_WITHIN));
        heard.fold(0, |bits, c| bits | 1 << c.rank)
    }

    /// Whether no other vehicle of the roster was heard for 3 s: this vehicle's receiver may have
    /// failed. False where there is no other.
    #[inline(never)]
    pub(crate) fn hears_nobody(&self, now: Instant) -> bool {
        self.roster_count > 0
            && self.entries[..self.roster_count]
                .iter()
                .all(|c| !c.heard_within(now, MAY_LAND_AFTER))
    }

    /// Whether, within `span`, a vehicle of the roster reported that it hears this one.
    pub(crate) fn is_reported_heard_within(&self, now: Instant, span: Duration) -> bool {
        self.reported_heard_at.is_some_and(|at| now - at < span)
    }

    /// Whether, within `span`, a vehicle of the roster was heard, and one reported that it hears
    /// this vehicle.
    pub fn linked_within(&self, now: Instant, span: Duration) -> bool {
        let lately = |at: Option<Instant>| at.is_some_and(|at| now - at < span);
        let roster = &self.entries[..self.roster_count];
        roster.iter().any(|c| lately(c.heard_at)) && roster.iter().any(|c| lately(c.hears_us_at))
    }

    /// Time since any vehicle of the roster was heard, or since one reported that it hears this
    /// vehicle, whichever is longer; counted from `since` at the earliest. Zero when all of them
    /// have landed or are out of the plan, or there are none.
    pub fn unlinked_duration(&self, now: Instant, since: Instant) -> Duration {
        if self.are_all_landed_or_out() {
            return Duration::default();
        }
        let others = || self.entries[..self.roster_count].iter();
        let heard = others().filter_map(|c| c.heard_at).max().unwrap_or(since);
        let hears_us = others().filter_map(|c| c.hears_us_at).max().unwrap_or(since);
        now - heard.min(hears_us).max(since)
    }
}
