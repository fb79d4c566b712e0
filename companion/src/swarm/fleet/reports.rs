//! What the vehicles of a fleet report to each other, and how a report changes a vehicle's
//! knowledge.

use super::{Fleet, FleetVehicle, INCARNATIONS, StartStatus};
use crate::link::roster::{MAX_ENTRIES_PER_MESSAGE, RosterReport, RosterReportEntry, ShareStatus};

impl<const V: usize> Fleet<V> {
    /// Handles the roster report of the vehicle of rank `sender`; `own`: whether this vehicle was
    /// started.
    pub fn handle_roster_report(&mut self, sender: usize, roster: &RosterReport, own: StartStatus) {
        if sender >= self.vehicles.len() || sender == usize::from(self.own_rank) {
            return;
        }
        self.note_flight(sender, roster);
        let here = self.divisions.len() as u8;
        // The sender may fly, or have flown, by another plan: one from before a restart, or one
        // that leaves out what was photographed meanwhile. Its divisions and places along paths
        // then belong to that plan, not to ours.
        let same_plan = roster.plan_crc8 == self.plan_crc8;
        if same_plan && roster.division_count > here {
            let status = self.sender_status(sender, roster);
            if !self.adopt_division(roster, status) && status != ShareStatus::Left {
                self.excluded = own == StartStatus::Started;
            }
        }
        let same = same_plan && usize::from(roster.division_count) == self.divisions.len();
        if same || !same_plan {
            self.vehicles[sender].pending_hash = if same { roster.pending_hash } else { 0 };
        }
        for (rank, entry) in
            roster.entries.iter().enumerate().map(|(i, e)| (i + usize::from(roster.first_rank), e))
        {
            if rank == usize::from(self.own_rank) {
                self.handle_own_entry(entry, own);
            } else if rank < self.vehicles.len() {
                if rank == sender {
                    self.take_first_incarnation(sender, entry.incarnation, own);
                }
                let behind = same_plan
                    && roster.division_count < self.divisions.len() as u8
                    && rank != sender;
                // The vehicle of this rank may have finished its share of a division that the
                // sender does not know. This vehicle hears it directly, and learns its status from
                // itself.
                if !(behind && entry.status == ShareStatus::Left && self.vehicles[rank].heard_by_us)
                {
                    let counts = if same { *entry } else { entry.seen_from_another_division() };
                    self.merge_entry(rank, &counts, own);
                }
                if same && entry.agrees && rank != sender && roster.pending_hash != 0 {
                    self.vehicles[rank].pending_hash = roster.pending_hash;
                }
            }
        }
    }

    /// Notes what the vehicle of this rank reports: whether it was started, and hears one that was.
    fn note_flight(&mut self, rank: usize, roster: &RosterReport) {
        let bit = 1u32 << rank.min(31);
        for (bits, set) in [
            (&mut self.started_bits, roster.has_started),
            (&mut self.hears_started_bits, roster.hears_started_vehicle),
        ] {
            *bits = if set { *bits | bit } else { *bits & !bit };
        }
    }

    /// Status of the sender of a report, as this report or an earlier one says. It matters where
    /// the sender has left: a division that it alone took as binding before it was cut off excludes
    /// nobody. The sender flew by that division until its lease ended; the others divide by what
    /// they had heard of the sender.
    fn sender_status(&self, sender: usize, roster: &RosterReport) -> ShareStatus {
        let own =
            sender.checked_sub(usize::from(roster.first_rank)).and_then(|i| roster.entries.get(i));
        let known = &self.vehicles[sender].entry;
        own.unwrap_or(known).status
    }

    /// Makes the sender's last division binding here too, if it is the one after ours and this
    /// vehicle had reported its hash: then the others counted on that. Returns whether it did so.
    /// If the sender has left, by its `status`, a hash that this vehicle withdrew counts only while
    /// it has reported no later one, on which the others may have counted instead.
    fn adopt_division(&mut self, roster: &RosterReport, status: ShareStatus) -> bool {
        let here = self.divisions.len() as u8;
        if roster.division_count != here + 1
            || roster.committed_hash == 0
            || self.divisions.is_full()
        {
            return false;
        }
        let left = status == ShareStatus::Left;
        if roster.committed_hash == self.withdrawn_hash && (self.pending_hash == 0 || !left) {
            (self.pending_inputs, self.pending_hash) =
                (self.withdrawn_inputs.clone(), self.withdrawn_hash);
        }
        let reported = roster.committed_hash == self.pending_hash;
        if reported {
            self.commit_division();
        }
        reported
    }

    /// Takes the sender's incarnation as the sender states it in its first report, whether it looks
    /// newer or older than the stored one: this vehicle, just switched on, knew none.
    fn take_first_incarnation(&mut self, sender: usize, incarnation: u8, own: StartStatus) {
        let bit = 1 << sender.min(31);
        if self.introduced_bits & bit == 0 && self.vehicles[sender].entry.incarnation != incarnation
        {
            self.take_newer_incarnation(sender, incarnation, own);
        }
        self.introduced_bits |= bit;
    }

    /// Merges what another vehicle reports of the vehicle of this rank, as far as it counts in our
    /// plan and last division; `own`: whether this vehicle was started.
    fn merge_entry(&mut self, rank: usize, entry: &RosterReportEntry, own: StartStatus) {
        let newer =
            entry.incarnation.wrapping_sub(self.vehicles[rank].entry.incarnation) % INCARNATIONS;
        if newer >= INCARNATIONS / 2 {
            return;
        }
        if newer > 0 {
            self.take_newer_incarnation(rank, entry.incarnation, own);
        }
        let known = &mut self.vehicles[rank].entry;
        known.status = known.status.max(entry.status);
        known.progress_dm = known.progress_dm.max(entry.progress_dm);
        known.commitment_dm = known.commitment_dm.or(entry.commitment_dm);
        known.holds |= entry.holds;
    }

    /// Stores a newer incarnation of the vehicle of this rank: it was started again. In a flight
    /// under way it keeps its status and progress: of two groups that do not hear each other one
    /// might count that vehicle again and the other not, and both be a majority. Before that flight
    /// and after it, it is a new vehicle.
    fn take_newer_incarnation(&mut self, rank: usize, incarnation: u8, own: StartStatus) {
        let started = own == StartStatus::Started;
        let (takes_part, flight) =
            (self.vehicle_takes_part(usize::from(self.own_rank)), self.is_another_started());
        if started && !takes_part && !flight && !self.airborne {
            // The flight in which this vehicle left is over, and another one begins.
            self.forget_plan();
        }
        let vehicle = &mut self.vehicles[rank];
        let RosterReportEntry { status, progress_dm, .. } = vehicle.entry;
        let kept = RosterReportEntry { status, progress_dm, ..RosterReportEntry::default() };
        let kept =
            if takes_part && (started || flight) { kept } else { RosterReportEntry::default() };
        vehicle.entry = RosterReportEntry { incarnation, ..kept };
        vehicle.pending_hash = 0;
    }

    /// Handles the entry about this vehicle in another one's report; `start`: whether it was
    /// started.
    fn handle_own_entry(&mut self, entry: &RosterReportEntry, start: StartStatus) {
        let flies = self.is_another_started();
        let own = &mut self.vehicles[usize::from(self.own_rank)].entry;
        let newer = entry.incarnation.wrapping_sub(own.incarnation) % INCARNATIONS;
        let outlived = newer < INCARNATIONS / 2 && (newer > 0 || entry.status > own.status);
        match (outlived, start) {
            (false, _) => {}
            // This vehicle was restarted: the others report its flight before.
            (true, StartStatus::NotStarted) if !flies => {
                self.rejoin((entry.incarnation + 1) % INCARNATIONS);
            }
            // This vehicle was restarted during the others' flight, in which it is no new vehicle.
            (true, StartStatus::NotStarted) => own.incarnation = entry.incarnation,
            (true, StartStatus::Started) => {
                (own.incarnation, self.excluded) = (entry.incarnation, true);
            }
        }
    }

    /// The roster report of this vehicle, with the entries from rank `first` on.
    pub fn roster_report(&self, first: usize) -> RosterReport {
        // A vehicle that has left computes no divisions: its hash would soon be outdated.
        let hash =
            if self.vehicle_takes_part(usize::from(self.own_rank)) { self.pending_hash } else { 0 };
        let entry = |v: &FleetVehicle| RosterReportEntry {
            agrees: hash != 0 && v.pending_hash == hash,
            ..v.entry
        };
        RosterReport {
            division_count: self.divisions.len() as u8,
            first_rank: first as u8,
            plan_crc8: self.plan_crc8,
            has_started: self.started_bits & self.own_bit() != 0,
            hears_started_vehicle: self.other_started_ranks() != 0,
            committed_hash: self.committed_hash,
            pending_hash: hash,
            entries: self
                .vehicles
                .iter()
                .skip(first)
                .take(MAX_ENTRIES_PER_MESSAGE)
                .map(entry)
                .collect(),
            ..RosterReport::default()
        }
    }
}
