//! Which vehicles of a coverage mission still fly, and the division of what the others left: agreed
//! on with nobody in charge.
//!
//! Each vehicle keeps an entry for every vehicle of the roster. Entries only grow and are merged by
//! maximum, so lost, repeated and reordered messages do no harm. Where a vehicle is lost or leaves,
//! each of the others states once how far it flies on: its promise. It holds there. From the
//! entries all compute the same division, report its hash, and fly on once all that live have
//! reported the same one and hold ([`Fleet::step`]). A vehicle photographs only while it has its
//! lease: within [`LEASE`] a majority said that it hears it. Others take its part no sooner than
//! [`SILENT_AFTER`] after each of them last heard it. Why no waypoint has two owners is in
//! `docs/coverage.md`, claim by claim; `tests/tests/fleet_model` searches it.

use heapless::Vec;
use planner_core::file::CRC32;

use crate::link::roster::{MAX_ENTRIES, MemberStatus, RosterReport, RosterReportEntry};
use crate::time::{Duration, Instant};

mod lots;
mod timeouts;

pub use lots::{DivisionInput, DivisionInputs};
pub use timeouts::{FleetTimeouts, LEASE, LEASE_HEARD_WITHIN, SILENT_AFTER};

/// Time for which a vehicle commits itself to fly on, seconds, up to the last picture that it takes
/// within it. A vehicle requests a division this long before its path ends if its route continues
/// there.
pub const COMMITMENT_S: f32 = 10.0;
/// Most divisions of a mission; after the last one the waypoints that a vehicle leaves stay
/// unphotographed.
pub const MAX_DIVISIONS: usize = 12;
/// Number of distinct incarnations: 3 bits.
const INCARNATIONS: u8 = 8;

/// State that a vehicle reports of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnReport {
    /// Whether it takes part.
    pub status: MemberStatus,
    /// Whether it has not been started: it may come back as one that is new.
    pub waits: bool,
    /// Divisions that count for the path it flies: what follows is along that.
    pub division: usize,
    /// Progress of the vehicle along its path, decimetres.
    pub progress_dm: u16,
    /// Place where the vehicle would hold if it were requested now; none while it cannot say.
    pub commitment_dm: Option<u16>,
    /// Whether it stands where it promised.
    pub holds: bool,
    /// Whether its path, a stretch of its route, ends soon: all are to divide what is left.
    pub wants_division: bool,
}

/// State of another vehicle, as this one hears it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MemberReception {
    /// When it was last heard itself.
    pub heard_at: Option<Instant>,
    /// Whether that said that it hears this one.
    pub hears_us: bool,
    /// Whether another one that is heard said that it hears it.
    pub heard_by_others: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct FleetMember {
    entry: RosterReportEntry,
    /// Whether it was alive when the last division began to count.
    in_roster: bool,
    /// When it was last heard, by this vehicle or one that this one hears.
    heard_at: Instant,
    /// Whether this vehicle heard it lately itself.
    heard_itself: bool,
    /// The vehicle's hash of the division under way; 0 for none.
    hash: u32,
}

/// All vehicles of the roster, this one among them.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Fleet<const V: usize> {
    own: usize,
    members: Vec<FleetMember, V>,
    /// The divisions that count.
    divisions: Vec<DivisionInputs<V>, MAX_DIVISIONS>,
    committed_hash: u32,
    /// Inputs of the division under way, once all of them are known.
    division_inputs: DivisionInputs<V>,
    hash: u32,
    /// Inputs as they were reported before the last change.
    previous_inputs: DivisionInputs<V>,
    previous_hash: u32,
    lease_at: Instant,
    excluded: bool,
    limits: FleetTimeouts,
}

impl<const V: usize> Fleet<V> {
    /// A fleet of so many vehicles (at most `V`), seen by the one of rank `own`.
    pub fn new(own: usize, count: usize, limits: FleetTimeouts) -> Self {
        let member = FleetMember { in_roster: true, ..FleetMember::default() };
        Self {
            own,
            members: core::iter::repeat_n(member, count.min(V)).collect(),
            divisions: Vec::new(),
            committed_hash: 0,
            division_inputs: Vec::new(),
            hash: 0,
            previous_inputs: Vec::new(),
            previous_hash: 0,
            lease_at: Instant::ZERO,
            excluded: false,
            limits,
        }
    }

    /// Starts a flight, or a new plan: no vehicle counts as silent from before.
    pub fn begin_flight(&mut self, now: Instant) {
        let entry = self.members[self.own].entry;
        if entry.status != MemberStatus::Alive || self.excluded || !self.divisions.is_empty() {
            self.rejoin((entry.incarnation + 1) % INCARNATIONS);
        }
        self.members.iter_mut().for_each(|member| member.heard_at = now);
        self.lease_at = now;
    }

    /// Forgets the fleet's state and takes part again under this incarnation number.
    fn rejoin(&mut self, incarnation: u8) {
        *self = Self {
            lease_at: self.lease_at,
            ..Self::new(self.own, self.members.len(), self.limits)
        };
        self.members[self.own].entry.incarnation = incarnation;
    }

    /// One step: the knowledge of all vehicles, the lease, and the division under way.
    pub fn step(
        &mut self,
        now: Instant,
        own: &OwnReport,
        hearing: impl Fn(usize) -> MemberReception,
    ) {
        // The vehicle's path may be that of the division before yet.
        let caught_up = own.division == self.divisions.len();
        let entry = &mut self.members[self.own].entry;
        // The path that the vehicle flies after it has left is not its share.
        if caught_up && entry.status == MemberStatus::Alive {
            entry.progress_dm = entry.progress_dm.max(own.progress_dm);
        }
        entry.status = entry.status.max(status_in_division(own.status, caught_up));
        let mut linked = 1u32 << self.own.min(31);
        for (rank, member) in self.members.iter_mut().enumerate() {
            let heard = hearing(rank);
            let lately = heard.heard_at.is_some_and(|at| now - at <= self.limits.heard);
            if rank == self.own || lately || heard.heard_by_others {
                member.heard_at = now;
            }
            member.heard_itself = lately;
            linked |= u32::from(lately && heard.hears_us) << rank.min(31);
        }
        if self.is_majority(|rank, _| linked >> rank & 1 != 0) {
            self.lease_at = now;
        }
        if self.has_lease(now) {
            let silent = self.limits.silent;
            for member in
                self.members.iter_mut().filter(|m| m.in_roster && now - m.heard_at >= silent)
            {
                member.entry.status = member.entry.status.max(MemberStatus::Lost);
            }
        }
        let asks = own.wants_division && self.is_alive(self.own) && !self.divisions.is_full();
        if (self.is_dividing() || asks) && caught_up {
            // The promise shows others that this vehicle requests a division.
            let entry = &mut self.members[self.own].entry;
            entry.commitment_dm = entry.commitment_dm.or(own.commitment_dm);
            entry.holds |= own.holds && entry.commitment_dm.is_some();
            self.prepare_division_inputs(now);
            if self.is_division_agreed(now) {
                self.commit_division();
            }
        }
    }

    /// Whether what some vehicle left is to be divided. What was promised binds until a division
    /// counts, even if the lost vehicle turns out to have finished: it may count for others
    /// already.
    pub fn is_dividing(&self) -> bool {
        let asks = |m: &FleetMember| match m.entry.status {
            MemberStatus::Alive => m.entry.commitment_dm.is_some(),
            MemberStatus::Lost | MemberStatus::Left => true,
            MemberStatus::Finished => false,
        };
        let asked = self.members.iter().any(|m| m.in_roster && asks(m));
        self.is_alive(self.own) && !self.divisions.is_full() && asked
    }

    /// Whether this vehicle of the roster takes part.
    pub(crate) fn is_alive(&self, rank: usize) -> bool {
        let member = &self.members[rank];
        member.in_roster && member.entry.status == MemberStatus::Alive
    }

    /// Whether these are a majority of those that take part, or were lost: of half of them, the
    /// half with the lowest rank.
    fn is_majority(&self, among: impl Fn(usize, &FleetMember) -> bool) -> bool {
        let counts = |m: &FleetMember| m.in_roster && m.entry.status <= MemberStatus::Lost;
        let all = || self.members.iter().enumerate().filter(|(_, m)| counts(m));
        let these = all().filter(|(rank, m)| among(*rank, m)).count();
        let lowest = all().next().is_some_and(|(rank, m)| among(rank, m));
        2 * these > all().count() || (2 * these == all().count() && lowest)
    }

    /// The inputs of the division, once all vehicles that live have stated their promise, and every
    /// lost vehicle has been silent here too.
    fn prepare_division_inputs(&mut self, now: Instant) {
        let known = |m: &FleetMember| match m.entry.status {
            MemberStatus::Alive => m.entry.commitment_dm.is_some(),
            MemberStatus::Lost => now - m.heard_at >= self.limits.silent,
            MemberStatus::Left | MemberStatus::Finished => true,
        };
        if !self.has_lease(now) || !self.members.iter().filter(|m| m.in_roster).all(known) {
            self.withdraw_inputs();
            self.division_inputs.clear();
            return;
        }
        // A vehicle without a part in the division before has none in this one.
        let lot = |m: &FleetMember| {
            if m.in_roster { DivisionInput::from_entry(&m.entry) } else { DivisionInput::default() }
        };
        if !self.members.iter().map(lot).eq(self.division_inputs.iter().copied()) {
            self.withdraw_inputs();
            self.division_inputs = self.members.iter().map(lot).collect();
        }
    }

    /// Withdraws the last reported inputs.
    fn withdraw_inputs(&mut self) {
        if self.hash != 0 {
            (self.previous_inputs, self.previous_hash) = (self.division_inputs.clone(), self.hash);
            self.hash = 0;
        }
    }

    /// The division to be computed, if there is one: all that count, and the one under way.
    pub fn needs_division(&self) -> bool {
        self.hash == 0 && !self.division_inputs.is_empty()
    }

    /// The lots of every division that counts, and of the one under way where that is to be
    /// computed.
    pub fn losses(&self) -> impl Iterator<Item = &[DivisionInput]> {
        let under_way = self.needs_division().then_some(&self.division_inputs);
        self.divisions.iter().chain(under_way).map(|lots| &lots[..])
    }

    /// Takes the CRC of the plan that was computed. The hash covers what it follows from as well:
    /// plans may be alike of which one counts on a vehicle that the other has given up.
    pub fn take_plan_crc(&mut self, plan_crc: u32) {
        if self.needs_division() {
            let mut digest = CRC32.digest();
            digest.update(&plan_crc.to_le_bytes());
            for lot in &self.division_inputs {
                let [low, high] = lot.along_dm.to_le_bytes();
                digest.update(&[u8::from(lot.alive), low, high]);
            }
            // 0 is none.
            self.hash = digest.finalize().max(1);
            self.members[self.own].hash = self.hash;
        }
    }

    fn is_division_agreed(&self, now: Instant) -> bool {
        let agrees = |rank: usize| {
            let member = &self.members[rank];
            member.hash == self.hash && member.entry.holds
        };
        let is_down = |m: &FleetMember| {
            m.entry.status != MemberStatus::Lost || now - m.heard_at >= self.limits.down
        };
        self.hash != 0
            && self.members.iter().filter(|m| m.in_roster).all(is_down)
            && (0..self.members.len()).filter(|rank| self.is_alive(*rank)).all(agrees)
            && self.is_majority(|rank, _| self.is_alive(rank))
    }

    /// Makes the division under way binding.
    fn commit_division(&mut self) {
        let lots = core::mem::take(&mut self.division_inputs);
        self.committed_hash = self.hash;
        (self.hash, self.previous_hash) = (0, 0);
        self.previous_inputs.clear();
        for (member, lot) in self.members.iter_mut().zip(&lots) {
            member.in_roster &= lot.alive;
            member.hash = 0;
            let RosterReportEntry { incarnation, status: standing, .. } = member.entry;
            let standing = status_in_division(standing, !lot.alive);
            member.entry =
                RosterReportEntry { incarnation, status: standing, ..RosterReportEntry::default() };
        }
        // No division is under way where they are full.
        let _ = self.divisions.push(lots);
    }

    /// Handles what the vehicle of rank `sender` reports.
    pub fn handle_roster(&mut self, sender: usize, roster: &RosterReport, waits: bool) {
        if sender >= self.members.len() || sender == self.own {
            return;
        }
        let here = self.divisions.len() as u8;
        if roster.divisions > here && !self.adopt_division(roster) {
            self.excluded = !waits;
        }
        let same = usize::from(roster.divisions) == self.divisions.len();
        if same {
            self.members[sender].hash = roster.hash;
        }
        for (rank, entry) in
            roster.entries.iter().enumerate().map(|(i, e)| (i + usize::from(roster.first), e))
        {
            if rank == self.own {
                self.handle_own_entry(entry, waits);
            } else if rank < self.members.len() {
                let behind = roster.divisions < self.divisions.len() as u8 && rank != sender;
                // The vehicle may have finished its share of a division that the sender does not
                // know; it reports that itself.
                if !(behind
                    && entry.status == MemberStatus::Left
                    && self.members[rank].heard_itself)
                {
                    self.merge_entry(rank, entry, same);
                }
                if same && entry.agrees && rank != sender && roster.hash != 0 {
                    self.members[rank].hash = roster.hash;
                }
            }
        }
    }

    /// Lets the division count that counts for the sender, if it was reported here: then the others
    /// counted on that.
    fn adopt_division(&mut self, roster: &RosterReport) -> bool {
        let here = self.divisions.len() as u8;
        if roster.divisions != here + 1 || roster.committed_hash == 0 || self.divisions.is_full() {
            return false;
        }
        if roster.committed_hash == self.previous_hash {
            (self.division_inputs, self.hash) = (self.previous_inputs.clone(), self.previous_hash);
        }
        let reported = roster.committed_hash == self.hash;
        if reported {
            self.commit_division();
        }
        reported
    }

    fn merge_entry(&mut self, rank: usize, entry: &RosterReportEntry, same: bool) {
        let member = &mut self.members[rank];
        let newer = entry.incarnation.wrapping_sub(member.entry.incarnation) % INCARNATIONS;
        if newer >= INCARNATIONS / 2 {
            return;
        }
        if newer > 0 {
            let RosterReportEntry { incarnation, .. } = *entry;
            member.entry = RosterReportEntry { incarnation, ..RosterReportEntry::default() };
        }
        let known = &mut member.entry;
        known.status = known.status.max(status_in_division(entry.status, same));
        if same {
            known.progress_dm = known.progress_dm.max(entry.progress_dm);
            known.commitment_dm = known.commitment_dm.or(entry.commitment_dm);
            known.holds |= entry.holds;
        }
    }

    /// Handles the entry that another vehicle reports about this one.
    fn handle_own_entry(&mut self, entry: &RosterReportEntry, waits: bool) {
        let own = self.members[self.own].entry;
        let newer = entry.incarnation.wrapping_sub(own.incarnation) % INCARNATIONS;
        let outlived = newer < INCARNATIONS / 2 && (newer > 0 || entry.status > own.status);
        match (outlived, waits) {
            (false, _) => {}
            // This vehicle was restarted: what others know is of its flight before.
            (true, true) => self.rejoin((entry.incarnation + 1) % INCARNATIONS),
            (true, false) => self.excluded = true,
        }
    }

    /// The vehicles from rank `first` on, as they are to be reported.
    pub fn roster_message(&self, first: usize) -> RosterReport {
        // A vehicle that has left computes no more, so its knowledge of the division under way gets
        // old.
        let hash = if self.is_alive(self.own) { self.hash } else { 0 };
        let entry =
            |m: &FleetMember| RosterReportEntry { agrees: hash != 0 && m.hash == hash, ..m.entry };
        RosterReport {
            divisions: self.divisions.len() as u8,
            first: first as u8,
            committed_hash: self.committed_hash,
            hash,
            entries: self.members.iter().skip(first).take(MAX_ENTRIES).map(entry).collect(),
            ..RosterReport::default()
        }
    }

    /// The same fleet on a clock that shows `then` where this one's shows `now`. A time past every
    /// limit keeps only that: fleets that will act alike are equal then, so a search recognises a
    /// state that it has visited.
    pub fn move_to_clock(&mut self, now: Instant, then: Instant) {
        let FleetTimeouts { lease, silent, down, .. } = self.limits;
        let moved = |at: Instant, most: Duration| {
            let age = (now - at).min(most);
            Instant::from_micros(then.as_micros().saturating_sub(age.as_micros()))
        };
        self.lease_at = moved(self.lease_at, Duration::from_micros(2 * lease.as_micros()));
        for member in &mut self.members {
            let counts = member.in_roster && member.entry.status <= MemberStatus::Lost;
            member.heard_at = if counts { moved(member.heard_at, silent.max(down)) } else { then };
        }
    }

    /// Number of vehicles.
    pub(crate) fn vehicle_count(&self) -> usize {
        self.members.len()
    }

    /// Whether it has its lease.
    pub fn has_lease(&self, now: Instant) -> bool {
        now - self.lease_at <= self.limits.lease
    }

    /// Time since a majority last said that it hears this vehicle; nothing where it takes no part
    /// any more, and needs no lease.
    pub fn unheard_for(&self, now: Instant) -> Duration {
        if self.is_alive(self.own) { now - self.lease_at } else { Duration::default() }
    }

    /// Hash of the inputs of the division to be computed, or of the last one that counts.
    pub fn division_hash(&self) -> u32 {
        let mut digest = CRC32.digest();
        for lot in self.losses().flatten() {
            let [low, high] = lot.along_dm.to_le_bytes();
            digest.update(&[u8::from(lot.alive), low, high]);
        }
        digest.finalize()
    }

    /// Place where this vehicle is to hold, decimetres along its path, while a division is under
    /// way.
    pub fn commitment_dm(&self) -> Option<u16> {
        self.members[self.own].entry.commitment_dm.filter(|_| self.is_dividing())
    }

    /// Place where this vehicle held for the last division that counts, decimetres along its path
    /// before.
    pub fn held_at_dm(&self) -> u16 {
        let lots = self.divisions.last().and_then(|lots| lots.get(self.own));
        lots.map_or(0, |lot| lot.along_dm)
    }

    /// Number of divisions that are binding.
    pub fn division_count(&self) -> usize {
        self.divisions.len()
    }

    /// The hash of the last division that counts.
    pub fn committed_hash(&self) -> u32 {
        self.committed_hash
    }

    /// Whether the others have counted it as lost, or have divided its part; one that has finished
    /// its part has none.
    pub fn is_excluded(&self) -> bool {
        self.excluded && self.members[self.own].entry.status != MemberStatus::Finished
    }

    /// Whether this vehicle flies its part of the area, or will fly it.
    pub(crate) fn takes_part(&self) -> bool {
        self.is_alive(self.own)
    }

    /// Whether this vehicle has left the mission and has reported it.
    pub(crate) fn has_reported_leaving(&self) -> bool {
        self.members[self.own].entry.status == MemberStatus::Left
    }

    /// Whether another vehicle that lives has not been heard for `span`.
    pub fn is_any_missing(&self, now: Instant, span: Duration) -> bool {
        let missed =
            |rank: &usize| self.is_alive(*rank) && now - self.members[*rank].heard_at >= span;
        (0..self.members.len()).any(|rank| missed(&rank))
    }
}

/// Status carried over to another division: a vehicle that finished its part may get another part.
fn status_in_division(standing: MemberStatus, same: bool) -> MemberStatus {
    if standing == MemberStatus::Finished && !same { MemberStatus::Left } else { standing }
}
