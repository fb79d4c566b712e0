//! The lease of a vehicle, and what silence of the others means.

use super::{Fleet, FleetTimeouts, FleetVehicle, INCARNATIONS, OwnReport};
use crate::link::roster::{RosterReportEntry, ShareStatus};
use crate::time::{Duration, Instant};

impl<const V: usize> Fleet<V> {
    /// Whether the vehicles of these `ranks`, as bits, are a majority of the `counted` ones, by the
    /// rule of [`Self::is_majority`].
    pub(super) fn is_majority_of(ranks: u32, counted: u32) -> bool {
        let among = ranks & counted;
        let lowest = among & counted.wrapping_neg() != 0;
        // Usually all of them: that test comes first, since boards count bits in a loop.
        among == counted || 2 * among.count_ones() + u32::from(lowest) > counted.count_ones()
    }

    /// Ranks of the vehicles that take part, or were lost, as bits.
    pub(super) fn counted_ranks(&self) -> u32 {
        let counts = |v: &FleetVehicle| v.has_part && v.entry.status <= ShareStatus::Lost;
        let ranks = self.vehicles.iter().enumerate();
        ranks.filter(|(_, v)| counts(v)).fold(0, |bits, (rank, _)| bits | 1 << rank.min(31))
    }

    /// Whether the vehicles `among` are a majority of those that take part, or were lost; of two
    /// halves, the one with the lowest rank is.
    pub(super) fn is_majority(&self, among: impl Fn(usize, &FleetVehicle) -> bool) -> bool {
        let (mut all, mut these, mut lowest) = (0, 0, false);
        for (rank, vehicle) in self.vehicles.iter().enumerate() {
            if vehicle.has_part && vehicle.entry.status <= ShareStatus::Lost {
                let is_among = among(rank, vehicle);
                lowest |= is_among && all == 0;
                all += 1;
                these += usize::from(is_among);
            }
        }
        2 * these > all || (2 * these == all && lowest)
    }

    /// Whether this vehicle has its lease: within [`FleetTimeouts::lease`] a majority reported that
    /// they hear it.
    pub fn has_lease(&self, now: Instant) -> bool {
        now - self.lease_renewed_at <= self.limits.lease
    }

    /// Time since a majority last reported that they hear this vehicle.
    pub(crate) fn lease_age(&self, now: Instant) -> Duration {
        now - self.lease_renewed_at
    }

    /// Time since a majority last reported that they hear this vehicle; zero for a vehicle that
    /// takes no part: it needs no lease.
    pub fn time_without_majority(&self, now: Instant) -> Duration {
        if self.vehicle_takes_part(usize::from(self.own_rank)) {
            self.lease_age(now)
        } else {
            Duration::default()
        }
    }

    /// Whether the others count this vehicle as lost, or have divided its part; false for one that
    /// has finished its part.
    pub fn is_excluded(&self) -> bool {
        self.excluded
            && self.vehicles[usize::from(self.own_rank)].entry.status != ShareStatus::Finished
    }

    /// Whether this vehicle flies its part of the area, or will.
    pub(crate) fn takes_part(&self) -> bool {
        self.vehicle_takes_part(usize::from(self.own_rank))
    }

    /// Whether this vehicle has left the mission and reported that.
    pub(crate) fn has_reported_leaving(&self) -> bool {
        self.vehicles[usize::from(self.own_rank)].entry.status == ShareStatus::Left
    }

    /// Whether a vehicle without a part may still get one: another vehicle takes part, or left a
    /// part that is not divided yet.
    pub(crate) fn may_reserve_get_a_part(&self) -> bool {
        let mut others =
            (0..self.vehicles.len()).filter(|rank| *rank != usize::from(self.own_rank));
        self.is_dividing() || others.any(|rank| self.vehicle_takes_part(rank))
    }

    /// Whether any vehicle has finished, left or was lost.
    pub(crate) fn has_any_ended(&self) -> bool {
        self.vehicles.iter().any(|vehicle| vehicle.entry.status != ShareStatus::Alive)
    }

    /// When the last of the vehicles that have been silent for 3 s, and so may be lost, is surely
    /// on the ground. `None` if there is none.
    pub(crate) fn last_down_at(&self) -> Option<Instant> {
        Some(self.down_at).filter(|at| *at > Instant::ZERO)
    }

    /// Whether a vehicle that takes part had not been heard for 3 s at the last step, or hears no
    /// majority: it may leave a part.
    pub fn is_any_missing(&self) -> bool {
        self.any_missing
    }

    /// Raises the status of vehicles with a part to [`ShareStatus::Lost`] if for
    /// [`FleetTimeouts::lost_after`] neither this vehicle nor one that it hears has heard them. One
    /// that has left or finished keeps its status.
    pub(super) fn count_silent_as_lost(&mut self, now: Instant) {
        let silent = self.limits.lost_after;
        let is_lost = |v: &&mut FleetVehicle| v.has_part && now - v.heard_at >= silent;
        for vehicle in self.vehicles.iter_mut().filter(is_lost) {
            vehicle.entry.status = vehicle.entry.status.max(ShareStatus::Lost);
        }
    }

    /// Takes part again, on the ground, if this vehicle has left but could start now (`own`, the
    /// status that it would report, is alive), holds its lease, and no other vehicle was started.
    pub(super) fn rejoin_if_ready(&mut self, now: Instant, own: ShareStatus) {
        let RosterReportEntry { incarnation, status, .. } =
            self.vehicles[usize::from(self.own_rank)].entry;
        if status == ShareStatus::Left
            && own == ShareStatus::Alive
            && !self.airborne
            && !self.is_another_started()
            && self.has_lease(now)
        {
            self.rejoin((incarnation + 1) % INCARNATIONS);
        }
    }

    /// Enters this vehicle's commitment and hold if a division is under way or this vehicle
    /// requests one, and makes the division binding once it is agreed. To be called only if this
    /// vehicle's path is that of the last binding division.
    pub(super) fn step_division(&mut self, now: Instant, own: &OwnReport) {
        let takes_part = self.vehicle_takes_part(usize::from(self.own_rank));
        let asks = own.wants_division && takes_part && !self.divisions.is_full();
        if !self.is_dividing() && !asks {
            return;
        }
        // By its commitment in its next report this vehicle also requests the division from the
        // others.
        let entry = &mut self.vehicles[usize::from(self.own_rank)].entry;
        entry.commitment_dm = entry.commitment_dm.or(own.new_commitment_dm);
        entry.holds |= own.holds && entry.commitment_dm.is_some();
        self.prepare_division_inputs(now);
        if self.is_division_agreed(now) {
            self.commit_division();
        }
    }

    /// Moves all times to a clock that shows `then` where the old one shows `now`; ages past every
    /// limit are cut to that limit, and which others were started or never heard is
    /// forgotten: that matters only before a start. Fleets that will act alike become equal, so a
    /// search recognises a state that it has visited.
    pub fn normalise_for_search(&mut self, now: Instant, then: Instant) {
        let FleetTimeouts { lease, lost_after: lost, down_after: down, .. } = self.limits;
        let moved = |at: Instant, most: Duration| {
            let age = (now - at).min(most);
            Instant::from_micros(then.as_micros().saturating_sub(age.as_micros()))
        };
        (self.started_bits, self.hears_started_bits) = (self.started_bits & self.own_bit(), 0);
        (self.introduced_bits, self.down_at, self.any_missing) = (u32::MAX, Instant::ZERO, false);
        self.lease_renewed_at =
            moved(self.lease_renewed_at, Duration::from_micros(2 * lease.as_micros()));
        for vehicle in &mut self.vehicles {
            let counts = vehicle.has_part && vehicle.entry.status <= ShareStatus::Lost;
            vehicle.heard_at = if counts { moved(vehicle.heard_at, lost.max(down)) } else { then };
        }
    }
}
