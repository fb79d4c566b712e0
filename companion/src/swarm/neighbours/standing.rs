//! Queries over the neighbours of the roster: whether they have landed, are dead, wait, or claim
//! the turn to fly a detour.

use super::Neighbours;
use super::entry::NeighbourEntry;
use crate::link::intent::{BLOCKED, GROUNDED, LANDED, OUT_OF_PLAN};
use crate::time::{Duration, Instant};

impl<const V: usize> Neighbours<V> {
    /// Whether all other vehicles of the roster last reported that they have landed or are out of
    /// the plan, or have been silent for `down_after`, when a lost vehicle is on the ground.
    pub(crate) fn are_all_out_or_down(&self, now: Instant) -> bool {
        self.entries[..self.roster_count]
            .iter()
            .all(|c| c.reports_any(LANDED | OUT_OF_PLAN) || !c.heard_within(now, self.down_after))
    }

    /// Whether any other vehicle of the roster counts as dead, but may still be in the air: silent
    /// for less than `down_after`, it last reported itself neither on the ground nor out of the
    /// plan.
    pub(crate) fn any_comes_down_unheard(&self, now: Instant) -> bool {
        self.entries[..self.roster_count].iter().any(|c| c.comes_down_unheard(now, self.down_after))
    }

    /// Whether the vehicle `id` counts as dead, but may still be in the air; false for an id
    /// outside the roster.
    pub(crate) fn comes_down_unheard(&self, id: u8, now: Instant) -> bool {
        let at = self.roster_index(id);
        at.is_some_and(|at| self.entries[at].comes_down_unheard(now, self.down_after))
    }

    /// Whether the vehicle `id` has landed, or is out of the plan, dead included; false for an id
    /// outside the roster.
    pub(crate) fn is_landed_or_out(&self, id: u8, now: Instant) -> bool {
        self.roster_index(id).is_some_and(|at| {
            self.entries[at].reports_any(LANDED) || self.entries[at].is_out_of_plan(now)
        })
    }

    /// Whether the vehicle `id` of the roster was not heard yet, or stands on the ground without
    /// having flown.
    pub(crate) fn is_not_started(&self, id: u8) -> bool {
        let waits = |c: &NeighbourEntry| {
            c.heard_at.is_none()
                || (c.reports_any(GROUNDED) && !c.reports_any(LANDED | OUT_OF_PLAN))
        };
        self.roster_index(id).is_some_and(|at| waits(&self.entries[at]))
    }

    /// Whether every other vehicle of the roster is out of the plan, recently reported that it
    /// waits or has landed, or descends at the end of a detour.
    pub fn are_all_waiting(&self, now: Instant) -> bool {
        self.entries[..self.roster_count].iter().all(|c| c.is_waiting_or_out_of_plan(now))
    }

    /// Whether every other vehicle of the roster is out of the plan, waits, or claims the turn.
    pub fn are_all_standing(&self, now: Instant) -> bool {
        self.entries[..self.roster_count]
            .iter()
            .all(|c| c.is_waiting_or_out_of_plan(now) || c.claims_turn(now))
    }

    /// Whether a vehicle with a lower system id than `id` claims the turn to fly a detour.
    pub fn is_turn_claimed_by_lower_id(&self, id: u8, now: Instant) -> bool {
        self.entries.iter().any(|c| c.id < id && c.claims_turn(now))
    }

    /// Number of vehicles with a lower system id than `id` that report a blocked path.
    pub fn blocked_count_below_id(&self, id: u8) -> u64 {
        self.entries.iter().filter(|c| c.id < id && c.reports_any(BLOCKED)).count() as u64
    }

    /// Whether every other vehicle of the roster last reported that it has landed or is out of the
    /// plan; true where there is none.
    pub fn are_all_landed_or_out(&self) -> bool {
        self.entries[..self.roster_count].iter().all(|c| c.reports_any(LANDED | OUT_OF_PLAN))
    }
}

impl NeighbourEntry {
    /// Whether the neighbour counts as dead, but may still be in the air: silent for less than
    /// `down`, it last reported itself neither on the ground nor out of the plan.
    fn comes_down_unheard(&self, now: Instant, down: Duration) -> bool {
        !self.reports_any(GROUNDED | OUT_OF_PLAN)
            && self.is_dead(now)
            && self.heard_within(now, down)
    }
}
