//! The fleet of a coverage mission, and which vehicles hear each other: by that the fleet decides.

use super::Neighbours;
use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::config::UnevenGround;
use crate::link::intent::{GROUNDED, LANDED, OUT_OF_PLAN};
use crate::link::roster::{MAX_ENTRIES_PER_MESSAGE, RosterReport};
use crate::swarm::fleet::{
    Fleet, FleetTimeouts, LEASE_HEARD_WITHIN, OwnReport, StartStatus, VehicleReception,
};
use crate::time::{Duration, Instant};

/// Time for which a neighbour's report of another plan counts.
const PLAN_REPORT_LIFETIME: Duration = Duration::from_secs(3);

impl<const V: usize> Neighbours<V> {
    /// Whether, in a coverage mission, this vehicle holds its lease: a majority lately reported
    /// that they hear it.
    #[inline(never)]
    pub(crate) fn holds_lease(&self, now: Instant) -> bool {
        self.fleet().is_some_and(|fleet| fleet.has_lease(now))
    }

    /// Makes the mission a coverage mission, with a fleet that divides what a vehicle leaves.
    /// `down_s`: silence after which a lost vehicle is on the ground, seconds; `ground`: heights of
    /// ground that is not level; `pair_error_m`: distance by which two vehicles may be nearer than
    /// their estimates say, metres.
    pub(crate) fn form_fleet(
        &mut self,
        down_s: f32,
        ground: Option<UnevenGround>,
        pair_error_m: f32,
    ) {
        (self.ground, self.pair_position_error_m) = (ground, pair_error_m);
        self.down_after = DOWN_AFTER.max(Duration::from_millis((down_s * 1000.0) as u64));
        let down = Duration::from_millis((down_s * 1000.0) as u64);
        self.fleet = Some(Fleet::new(
            usize::from(self.own_rank),
            self.roster_count + 1,
            FleetTimeouts::of_flight(down),
        ));
    }

    /// The fleet; `None` where the mission is no coverage mission.
    pub(crate) fn fleet(&self) -> Option<&Fleet<V>> {
        self.fleet.as_ref()
    }

    /// The fleet, mutable; `None` where the mission is no coverage mission.
    pub(crate) fn fleet_mut(&mut self) -> Option<&mut Fleet<V>> {
        self.fleet.as_mut()
    }

    /// One step of the fleet, with this vehicle's report and which vehicles hear each other.
    pub(crate) fn step_fleet(&mut self, own: &OwnReport, now: Instant) {
        let Some(fleet) = &mut self.fleet else { return };
        let roster = &self.entries[..self.roster_count];
        let lately =
            |c: &&NeighbourEntry| c.intent_at.is_some_and(|at| now - at <= LEASE_HEARD_WITHIN);
        let by_others = roster.iter().filter(lately).fold(0, |bits, c| bits | c.heard_bits);
        let own_rank = usize::from(self.own_rank);
        fleet.step(now, own, |rank| {
            let entry =
                rank.checked_sub(usize::from(rank > own_rank)).and_then(|at| roster.get(at));
            let bit = 1u32.checked_shl(rank as u32).unwrap_or(0);
            entry.filter(|_| rank != own_rank).map_or(VehicleReception::default(), |entry| {
                VehicleReception {
                    heard_at: entry.intent_at,
                    hears_us: entry.hears_us_at.is_some_and(|at| now - at <= LEASE_HEARD_WITHIN),
                    heard_by_others: by_others & bit != 0,
                    heard_bits: entry.heard_bits,
                }
            })
        });
    }

    /// Whether a vehicle was heard lately that follows another plan of this mission.
    pub(crate) fn hears_another_plan(&self, now: Instant) -> bool {
        let lately =
            |c: &NeighbourEntry| c.intent_at.is_some_and(|at| now - at <= PLAN_REPORT_LIFETIME);
        self.entries[..self.roster_count].iter().any(|c| c.follows_other_plan && lately(c))
    }

    /// Whether the flight of others has begun: one has finished, left or was lost, or one was
    /// started and not all were heard lately on the ground.
    pub(crate) fn is_flight_under_way(&self, now: Instant) -> bool {
        let on_ground = |c: &NeighbourEntry| {
            c.intent_at.is_some_and(|at| now - at <= PLAN_REPORT_LIFETIME)
                && c.reports_any(GROUNDED)
        };
        let all_on_ground = || self.entries[..self.roster_count].iter().all(on_ground);
        self.fleet.as_ref().is_some_and(|fleet| {
            fleet.has_any_ended() || (fleet.is_another_started() && !all_on_ground())
        })
    }

    /// Whether another vehicle that takes part is in flight, heard within `missed_after`, and none
    /// may be lost and no division is under way: while a vehicle may be lost, each that lives is
    /// needed for a majority.
    pub(crate) fn may_leave_part_to_others(&self, now: Instant, missed_after: Duration) -> bool {
        let whole = |fleet: &Fleet<V>| !fleet.is_dividing() && !fleet.is_any_missing();
        self.fleet.as_ref().is_some_and(whole) && self.is_another_in_flight(now, missed_after)
    }

    /// Whether another vehicle that takes part is in flight, heard within `missed_after`.
    pub(crate) fn is_another_in_flight(&self, now: Instant, missed_after: Duration) -> bool {
        let heard = |c: &NeighbourEntry| c.heard_at.is_some_and(|at| now - at < missed_after);
        let flies =
            |c: &&NeighbourEntry| heard(c) && !c.reports_any(GROUNDED | LANDED | OUT_OF_PLAN);
        let mut others = self.entries[..self.roster_count].iter().filter(flies);
        self.fleet
            .as_ref()
            .is_some_and(|fleet| others.any(|c| fleet.vehicle_takes_part(usize::from(c.rank))))
    }

    /// Handles another vehicle's roster report; `own`: whether this vehicle was started.
    pub(crate) fn handle_roster_report(&mut self, id: u8, roster: &RosterReport, own: StartStatus) {
        let rank = self.roster_index(id).map(|at| usize::from(self.entries[at].rank));
        if let (Some(fleet), Some(rank)) = (&mut self.fleet, rank) {
            fleet.handle_roster_report(rank, roster, own);
        }
    }

    /// The next roster report: all vehicles, or in turn as many as one message holds.
    pub(crate) fn next_roster_report(&mut self) -> Option<RosterReport> {
        let fleet = self.fleet.as_ref()?;
        let next = usize::from(self.next_reported_rank);
        let first = if next < fleet.vehicle_count() { next } else { 0 };
        self.next_reported_rank = (first + MAX_ENTRIES_PER_MESSAGE) as u16;
        Some(fleet.roster_report(first))
    }
}
