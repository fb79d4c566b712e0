//! What the vehicles of a fleet report to each other, and how a report changes a vehicle's
//! knowledge.

use super::{Fleet, FleetVehicle, INCARNATIONS, StartStatus};
use crate::link::roster::{MAX_ENTRIES_PER_MESSAGE, RosterReport, RosterReportEntry, ShareStatus};

impl<const V: usize> Fleet<V> {
    /// Handles the roster report of the vehicle of rank `sender`; `own`: whether this vehicle was
    /// started.
    pub fn handle_roster(&mut self, sender: usize, roster: &RosterReport, own: StartStatus) {
        if sender >= self.members.len() || sender == usize::from(self.own) {
            return;
        }
        self.note_flight(sender, roster);
        let here = self.divisions.len() as u8;
        // The sender may fly, or have flown, by another plan: before a restart, or without what was
        // photographed meanwhile. Its divisions and places then belong to another plan than ours.
        let same_plan = roster.plan == self.plan;
        if same_plan && roster.divisions > here {
            let status = self.sender_status(sender, roster);
            if !self.adopt_division(roster, status) && status != ShareStatus::Left {
                self.excluded = own == StartStatus::Started;
            }
        }
        let same = same_plan && usize::from(roster.divisions) == self.divisions.len();
        if same || !same_plan {
            self.members[sender].hash = if same { roster.hash } else { 0 };
        }
        for (rank, entry) in
            roster.entries.iter().enumerate().map(|(i, e)| (i + usize::from(roster.first), e))
        {
            if rank == usize::from(self.own) {
                self.handle_own_entry(entry, own);
            } else if rank < self.members.len() {
                if rank == sender {
                    self.take_first_incarnation(sender, entry.incarnation, own);
                }
                let behind =
                    same_plan && roster.divisions < self.divisions.len() as u8 && rank != sender;
                // The member may have finished its share of a division that the sender does not
                // know; it reports that itself.
                if !(behind && entry.status == ShareStatus::Left && self.members[rank].heard_itself)
                {
                    let counts = if same { *entry } else { entry.seen_from_another_division() };
                    self.merge_entry(rank, &counts, own);
                }
                if same && entry.agrees && rank != sender && roster.hash != 0 {
                    self.members[rank].hash = roster.hash;
                }
            }
        }
    }

    /// Notes what the vehicle of this rank reports: whether it is in flight, and hears one that is.
    fn note_flight(&mut self, rank: usize, roster: &RosterReport) {
        let bit = 1u32 << rank.min(31);
        for (bits, set) in
            [(&mut self.in_flight, roster.in_flight), (&mut self.hear_flight, roster.hears_flight)]
        {
            *bits = if set { *bits | bit } else { *bits & !bit };
        }
    }

    /// Status of the sender of a report, as this report or an earlier one says. A division that
    /// only a sender that has left had agreed to before it was cut off excludes nobody: the sender
    /// flew by it until its lease ended, and the others divide what they had heard of the sender.
    fn sender_status(&self, sender: usize, roster: &RosterReport) -> ShareStatus {
        let own = sender.checked_sub(usize::from(roster.first)).and_then(|i| roster.entries.get(i));
        let known = &self.members[sender].entry;
        own.unwrap_or(known).status
    }

    /// Makes the sender's last division binding here too, if this vehicle had reported its hash:
    /// then the others counted on that. Returns whether it did so. Where the sender has left, by
    /// its `status`, the others may meanwhile have counted on a later hash instead.
    fn adopt_division(&mut self, roster: &RosterReport, status: ShareStatus) -> bool {
        let here = self.divisions.len() as u8;
        if roster.divisions != here + 1 || roster.committed_hash == 0 || self.divisions.is_full() {
            return false;
        }
        let left = status == ShareStatus::Left;
        if roster.committed_hash == self.previous_hash && (self.hash == 0 || !left) {
            (self.division_inputs, self.hash) = (self.previous_inputs.clone(), self.previous_hash);
        }
        let reported = roster.committed_hash == self.hash;
        if reported {
            self.commit_division();
        }
        reported
    }

    /// Takes a sender's incarnation as it is the first time that it reports itself: this vehicle,
    /// just switched on, knew none, and could not tell a newer one from an older one.
    fn take_first_incarnation(&mut self, sender: usize, incarnation: u8, own: StartStatus) {
        let bit = 1 << sender.min(31);
        if self.introduced & bit == 0 && self.members[sender].entry.incarnation != incarnation {
            self.take_newer_incarnation(sender, incarnation, own);
        }
        self.introduced |= bit;
    }

    /// Merges what another vehicle reports of the vehicle of this rank, as far as it counts in our
    /// plan and last division; `own`: whether this vehicle was started.
    fn merge_entry(&mut self, rank: usize, entry: &RosterReportEntry, own: StartStatus) {
        let newer =
            entry.incarnation.wrapping_sub(self.members[rank].entry.incarnation) % INCARNATIONS;
        if newer >= INCARNATIONS / 2 {
            return;
        }
        if newer > 0 {
            self.take_newer_incarnation(rank, entry.incarnation, own);
        }
        let known = &mut self.members[rank].entry;
        known.status = known.status.max(entry.status);
        known.progress_dm = known.progress_dm.max(entry.progress_dm);
        known.commitment_dm = known.commitment_dm.or(entry.commitment_dm);
        known.holds |= entry.holds;
    }

    /// The vehicle of this rank was started again. In a flight under way it keeps its status and
    /// progress: of two sides that do not hear each other one might count it again and the other
    /// not, and both be a majority. Before that flight and after it, it is a new vehicle.
    fn take_newer_incarnation(&mut self, rank: usize, incarnation: u8, own: StartStatus) {
        let started = own == StartStatus::Started;
        let (takes_part, flight) =
            (self.vehicle_takes_part(usize::from(self.own)), self.is_another_in_flight());
        if started && !takes_part && !flight && !self.airborne {
            // The flight in which this vehicle left is over, and another one begins.
            self.forget_plan();
        }
        let member = &mut self.members[rank];
        let RosterReportEntry { status, progress_dm, .. } = member.entry;
        let kept = RosterReportEntry { status, progress_dm, ..RosterReportEntry::default() };
        let kept =
            if takes_part && (started || flight) { kept } else { RosterReportEntry::default() };
        member.entry = RosterReportEntry { incarnation, ..kept };
        member.hash = 0;
    }

    /// Handles the entry about this vehicle in another one's report; `start`: whether it was
    /// started.
    fn handle_own_entry(&mut self, entry: &RosterReportEntry, start: StartStatus) {
        let flies = self.is_another_in_flight();
        let own = &mut self.members[usize::from(self.own)].entry;
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
    pub fn roster_message(&self, first: usize) -> RosterReport {
        // A vehicle that has left computes no divisions: its hash would soon be outdated.
        let hash = if self.vehicle_takes_part(usize::from(self.own)) { self.hash } else { 0 };
        let entry =
            |m: &FleetVehicle| RosterReportEntry { agrees: hash != 0 && m.hash == hash, ..m.entry };
        RosterReport {
            divisions: self.divisions.len() as u8,
            first: first as u8,
            plan: self.plan,
            in_flight: self.in_flight & self.own_bit() != 0,
            hears_flight: self.heard_flights() != 0,
            committed_hash: self.committed_hash,
            hash,
            entries: self
                .members
                .iter()
                .skip(first)
                .take(MAX_ENTRIES_PER_MESSAGE)
                .map(entry)
                .collect(),
            ..RosterReport::default()
        }
    }
}
