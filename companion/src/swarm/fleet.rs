//! Which vehicles of a coverage mission still fly, and the division of what the others left: agreed on with nobody in charge.
//!
//! Each vehicle keeps an entry for every vehicle of the roster. Entries only grow and are merged by maximum, so lost, repeated
//! and reordered messages do no harm. Where a vehicle is lost or leaves, each of the others states once how far it flies on: its
//! promise. It holds there. From the entries all compute the same division, report its hash, and fly on once all that live
//! have reported the same one and hold ([`Fleet::step`]). A vehicle photographs only while it has its lease: within
//! [`LEASE`] a majority said that it hears it. Others take its part no sooner than [`SILENT_AFTER`] after each of them last heard
//! it. Why no waypoint has two owners is in `docs/coverage.md`, claim by claim; `tests/tests/fleet_model` searches it.

use heapless::Vec;
use planner_core::file::CRC32;

use crate::link::roster::{Entry, MAX_ENTRIES, Roster, Standing};
use crate::time::{Duration, Instant};

mod lots;

pub use lots::{Lot, Lots};

/// Time for which a vehicle goes on photographing after a majority last reported that they hear it.
pub const LEASE: Duration = Duration::from_secs(20);
/// Greatest age of a report that renews the lease.
pub const LEASE_HEARD_WITHIN: Duration = Duration::from_secs(1);
/// Silence after which a vehicle's share is divided among the others.
pub const SILENT_AFTER: Duration = Duration::from_secs(45);
/// Time for which a vehicle commits itself to fly on, seconds, up to the last picture that it takes
/// within it. A vehicle requests a division this long before its path ends if its route goes on
/// there.
pub const COMMITMENT_S: f32 = 10.0;
/// Most divisions of a mission; after the last one the waypoints that a vehicle leaves stay
/// unphotographed.
pub const MAX_DIVISIONS: usize = 12;
/// Incarnations that can be told apart: 3 bits.
const INCARNATIONS: u8 = 8;

/// Time limits of a fleet. A vehicle that has no lease lands after twice the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Limits {
    /// As [`LEASE`].
    pub lease: Duration,
    /// As [`LEASE_HEARD_WITHIN`].
    pub heard: Duration,
    /// As [`SILENT_AFTER`].
    pub silent: Duration,
    /// A lost vehicle is down once it has been silent for so long.
    pub down: Duration,
}

impl Limits {
    /// Time limits of a flight in which a vehicle that no other vehicle hears any more is down
    /// after `down`.
    pub const fn of_flight(down: Duration) -> Self {
        Self { lease: LEASE, heard: LEASE_HEARD_WITHIN, silent: SILENT_AFTER, down }
    }
}

/// State that a vehicle reports of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Own {
    /// Whether it takes part.
    pub standing: Standing,
    /// Whether it has not been started: it may come back as one that is new.
    pub waits: bool,
    /// Divisions that count for the path it flies: what follows is along that.
    pub division: usize,
    /// Progress of the vehicle along its path, decimetres.
    pub done_dm: u16,
    /// Place where the vehicle would hold if it were requested now; none while it cannot say.
    pub promise_dm: Option<u16>,
    /// Whether it stands where it promised.
    pub holds: bool,
    /// Whether its path, a stretch of its route, ends soon: all are to divide what is left.
    pub asks: bool,
}

/// State of another vehicle, as this one hears it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hearing {
    /// When it was last heard itself.
    pub direct_at: Option<Instant>,
    /// Whether that said that it hears this one.
    pub hears_us: bool,
    /// Whether another one that is heard said that it hears it.
    pub by_others: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct Member {
    entry: Entry,
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
    members: Vec<Member, V>,
    /// The divisions that count.
    divisions: Vec<Lots<V>, MAX_DIVISIONS>,
    counted: u32,
    /// Inputs of the division under way, once all of them are known.
    lots: Lots<V>,
    hash: u32,
    /// Inputs as they were reported before the last change.
    before: Lots<V>,
    hash_before: u32,
    lease_at: Instant,
    excluded: bool,
    limits: Limits,
}

impl<const V: usize> Fleet<V> {
    /// A fleet of so many vehicles (at most `V`), seen by the one of rank `own`.
    pub fn new(own: usize, count: usize, limits: Limits) -> Self {
        let member = Member { in_roster: true, ..Member::default() };
        Self {
            own,
            members: core::iter::repeat_n(member, count.min(V)).collect(),
            divisions: Vec::new(),
            counted: 0,
            lots: Vec::new(),
            hash: 0,
            before: Vec::new(),
            hash_before: 0,
            lease_at: Instant::ZERO,
            excluded: false,
            limits,
        }
    }

    /// A flight begins, or is planned again: whoever was silent before is not.
    pub fn begin(&mut self, now: Instant) {
        let entry = self.members[self.own].entry;
        if entry.standing != Standing::Alive || self.excluded || !self.divisions.is_empty() {
            self.renew((entry.incarnation + 1) % INCARNATIONS);
        }
        self.members.iter_mut().for_each(|member| member.heard_at = now);
        self.lease_at = now;
    }

    /// Forgets the fleet's state and takes part again under this incarnation number.
    fn renew(&mut self, incarnation: u8) {
        *self = Self { lease_at: self.lease_at, ..Self::new(self.own, self.members.len(), self.limits) };
        self.members[self.own].entry.incarnation = incarnation;
    }

    /// One step: the knowledge of all vehicles, the lease, and the division under way.
    pub fn step(&mut self, now: Instant, own: &Own, hearing: impl Fn(usize) -> Hearing) {
        // The vehicle's path may be that of the division before yet.
        let caught_up = own.division == self.divisions.len();
        let entry = &mut self.members[self.own].entry;
        // The path that the vehicle flies after it has left is not its share.
        if caught_up && entry.standing == Standing::Alive {
            entry.done_dm = entry.done_dm.max(own.done_dm);
        }
        entry.standing = entry.standing.max(of_division(own.standing, caught_up));
        let mut linked = 1u32 << self.own.min(31);
        for (rank, member) in self.members.iter_mut().enumerate() {
            let heard = hearing(rank);
            let lately = heard.direct_at.is_some_and(|at| now - at <= self.limits.heard);
            if rank == self.own || lately || heard.by_others {
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
            for member in self.members.iter_mut().filter(|m| m.in_roster && now - m.heard_at >= silent) {
                member.entry.standing = member.entry.standing.max(Standing::Lost);
            }
        }
        let asks = own.asks && self.lives(self.own) && !self.divisions.is_full();
        if (self.is_dividing() || asks) && caught_up {
            // The promise shows others that this vehicle requests a division.
            let entry = &mut self.members[self.own].entry;
            entry.promise_dm = entry.promise_dm.or(own.promise_dm);
            entry.holds |= own.holds && entry.promise_dm.is_some();
            self.draw_lots(now);
            if self.may_count(now) {
                self.count();
            }
        }
    }

    /// Whether what some vehicle left is to be divided. What was promised binds until a division counts, even if the lost
    /// vehicle turns out to have finished: it may count for others already.
    pub fn is_dividing(&self) -> bool {
        let asks = |m: &Member| match m.entry.standing {
            Standing::Alive => m.entry.promise_dm.is_some(),
            Standing::Lost | Standing::Left => true,
            Standing::Finished => false,
        };
        let asked = self.members.iter().any(|m| m.in_roster && asks(m));
        self.lives(self.own) && !self.divisions.is_full() && asked
    }

    fn lives(&self, rank: usize) -> bool {
        let member = &self.members[rank];
        member.in_roster && member.entry.standing == Standing::Alive
    }

    /// Whether these are a majority of those that take part, or were lost: of half of them, the half with the lowest rank.
    fn is_majority(&self, among: impl Fn(usize, &Member) -> bool) -> bool {
        let counts = |m: &Member| m.in_roster && m.entry.standing <= Standing::Lost;
        let all = || self.members.iter().enumerate().filter(|(_, m)| counts(m));
        let these = all().filter(|(rank, m)| among(*rank, m)).count();
        let lowest = all().next().is_some_and(|(rank, m)| among(rank, m));
        2 * these > all().count() || (2 * these == all().count() && lowest)
    }

    /// The inputs of the division, once all vehicles that live have stated their promise, and every
    /// lost vehicle has been silent here too.
    fn draw_lots(&mut self, now: Instant) {
        let known = |m: &Member| match m.entry.standing {
            Standing::Alive => m.entry.promise_dm.is_some(),
            Standing::Lost => now - m.heard_at >= self.limits.silent,
            Standing::Left | Standing::Finished => true,
        };
        if !self.has_lease(now) || !self.members.iter().filter(|m| m.in_roster).all(known) {
            self.withdraw();
            self.lots.clear();
            return;
        }
        // A vehicle without a part in the division before has none in this one.
        let lot = |m: &Member| if m.in_roster { Lot::of(&m.entry) } else { Lot::default() };
        if !self.members.iter().map(lot).eq(self.lots.iter().copied()) {
            self.withdraw();
            self.lots = self.members.iter().map(lot).collect();
        }
    }

    /// The last reported inputs do not hold any more.
    fn withdraw(&mut self) {
        if self.hash != 0 {
            (self.before, self.hash_before) = (self.lots.clone(), self.hash);
            self.hash = 0;
        }
    }

    /// The division to be computed, if there is one: all that count, and the one under way.
    pub fn wants_hash(&self) -> bool {
        self.hash == 0 && !self.lots.is_empty()
    }

    /// The lots of every division that counts, and of the one under way where that is to be computed.
    pub fn losses(&self) -> impl Iterator<Item = &[Lot]> {
        let under_way = self.wants_hash().then_some(&self.lots);
        self.divisions.iter().chain(under_way).map(|lots| &lots[..])
    }

    /// Takes the CRC of the plan that was computed. The hash covers what it follows from as well: plans may be alike of which
    /// one counts on a vehicle that the other has given up.
    pub fn take_plan_crc(&mut self, plan_crc: u32) {
        if self.wants_hash() {
            let mut digest = CRC32.digest();
            digest.update(&plan_crc.to_le_bytes());
            for lot in &self.lots {
                let [low, high] = lot.along_dm.to_le_bytes();
                digest.update(&[u8::from(lot.lives), low, high]);
            }
            // 0 is none.
            self.hash = digest.finalize().max(1);
            self.members[self.own].hash = self.hash;
        }
    }

    fn may_count(&self, now: Instant) -> bool {
        let agrees = |rank: usize| {
            let member = &self.members[rank];
            member.hash == self.hash && member.entry.holds
        };
        let is_down = |m: &Member| m.entry.standing != Standing::Lost || now - m.heard_at >= self.limits.down;
        self.hash != 0
            && self.members.iter().filter(|m| m.in_roster).all(is_down)
            && (0..self.members.len()).filter(|rank| self.lives(*rank)).all(agrees)
            && self.is_majority(|rank, _| self.lives(rank))
    }

    /// The division under way counts from now on.
    fn count(&mut self) {
        let lots = core::mem::take(&mut self.lots);
        self.counted = self.hash;
        (self.hash, self.hash_before) = (0, 0);
        self.before.clear();
        for (member, lot) in self.members.iter_mut().zip(&lots) {
            member.in_roster &= lot.lives;
            member.hash = 0;
            let Entry { incarnation, standing, .. } = member.entry;
            let standing = of_division(standing, !lot.lives);
            member.entry = Entry { incarnation, standing, ..Entry::default() };
        }
        // No division is under way where they are full.
        let _ = self.divisions.push(lots);
    }

    /// Takes in what the vehicle of rank `sender` reports.
    pub fn handle(&mut self, sender: usize, roster: &Roster, waits: bool) {
        if sender >= self.members.len() || sender == self.own {
            return;
        }
        let here = self.divisions.len() as u8;
        if roster.divisions > here && !self.catch_up(roster) {
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
                self.hear_of_itself(entry, waits);
            } else if rank < self.members.len() {
                let behind = roster.divisions < self.divisions.len() as u8 && rank != sender;
                // The vehicle may have finished its share of a division that the sender does not
                // know; it reports that itself.
                if !(behind && entry.standing == Standing::Left && self.members[rank].heard_itself) {
                    self.merge(rank, entry, same);
                }
                if same && entry.agrees && rank != sender && roster.hash != 0 {
                    self.members[rank].hash = roster.hash;
                }
            }
        }
    }

    /// Lets the division count that counts for the sender, if it was reported here: then the others counted on that.
    fn catch_up(&mut self, roster: &Roster) -> bool {
        let here = self.divisions.len() as u8;
        if roster.divisions != here + 1 || roster.counted == 0 || self.divisions.is_full() {
            return false;
        }
        if roster.counted == self.hash_before {
            (self.lots, self.hash) = (self.before.clone(), self.hash_before);
        }
        let reported = roster.counted == self.hash;
        if reported {
            self.count();
        }
        reported
    }

    fn merge(&mut self, rank: usize, entry: &Entry, same: bool) {
        let member = &mut self.members[rank];
        let newer = entry.incarnation.wrapping_sub(member.entry.incarnation) % INCARNATIONS;
        if newer >= INCARNATIONS / 2 {
            return;
        }
        if newer > 0 {
            let Entry { incarnation, .. } = *entry;
            member.entry = Entry { incarnation, ..Entry::default() };
        }
        let known = &mut member.entry;
        known.standing = known.standing.max(of_division(entry.standing, same));
        if same {
            known.done_dm = known.done_dm.max(entry.done_dm);
            known.promise_dm = known.promise_dm.or(entry.promise_dm);
            known.holds |= entry.holds;
        }
    }

    /// Takes what others know of this vehicle.
    fn hear_of_itself(&mut self, entry: &Entry, waits: bool) {
        let own = self.members[self.own].entry;
        let newer = entry.incarnation.wrapping_sub(own.incarnation) % INCARNATIONS;
        let outlived = newer < INCARNATIONS / 2 && (newer > 0 || entry.standing > own.standing);
        match (outlived, waits) {
            (false, _) => {}
            // This vehicle was restarted: what others know is of its flight before.
            (true, true) => self.renew((entry.incarnation + 1) % INCARNATIONS),
            (true, false) => self.excluded = true,
        }
    }

    /// The vehicles from rank `first` on, as they are to be reported.
    pub fn message(&self, first: usize) -> Roster {
        // A vehicle that has left computes no more, so its knowledge of the division under way gets
        // old.
        let hash = if self.lives(self.own) { self.hash } else { 0 };
        let entry = |m: &Member| Entry { agrees: hash != 0 && m.hash == hash, ..m.entry };
        Roster {
            divisions: self.divisions.len() as u8,
            first: first as u8,
            counted: self.counted,
            hash,
            entries: self.members.iter().skip(first).take(MAX_ENTRIES).map(entry).collect(),
            ..Roster::default()
        }
    }

    /// The same fleet on a clock that shows `then` where this one's shows `now`. A time past every
    /// limit keeps only that: fleets that will act alike are equal then, so a search recognises a
    /// state that it has visited.
    pub fn set_clock(&mut self, now: Instant, then: Instant) {
        let Limits { lease, silent, down, .. } = self.limits;
        let moved = |at: Instant, most: Duration| {
            let age = (now - at).min(most);
            Instant::from_micros(then.micros().saturating_sub(age.micros()))
        };
        self.lease_at = moved(self.lease_at, Duration::from_micros(2 * lease.micros()));
        for member in &mut self.members {
            let counts = member.in_roster && member.entry.standing <= Standing::Lost;
            member.heard_at = if counts { moved(member.heard_at, silent.max(down)) } else { then };
        }
    }

    /// Number of vehicles.
    pub(crate) fn count_all(&self) -> usize {
        self.members.len()
    }

    /// Whether it has its lease.
    pub fn has_lease(&self, now: Instant) -> bool {
        now - self.lease_at <= self.limits.lease
    }

    /// Time since a majority last said that it hears this vehicle; nothing where it takes no part any more, and needs no lease.
    pub fn unheard_for(&self, now: Instant) -> Duration {
        if self.lives(self.own) { now - self.lease_at } else { Duration::default() }
    }

    /// Hash of the inputs of the division to be computed, or of the last one that counts.
    pub fn fingerprint(&self) -> u32 {
        let mut digest = CRC32.digest();
        for lot in self.losses().flatten() {
            let [low, high] = lot.along_dm.to_le_bytes();
            digest.update(&[u8::from(lot.lives), low, high]);
        }
        digest.finalize()
    }

    /// Place where this vehicle is to hold, decimetres along its path, while a division is under
    /// way.
    pub fn promise_dm(&self) -> Option<u16> {
        self.members[self.own].entry.promise_dm.filter(|_| self.is_dividing())
    }

    /// Place where this vehicle held for the last division that counts, decimetres along its path
    /// before.
    pub fn held_at_dm(&self) -> u16 {
        let lots = self.divisions.last().and_then(|lots| lots.get(self.own));
        lots.map_or(0, |lot| lot.along_dm)
    }

    /// Divisions that count.
    pub fn division(&self) -> usize {
        self.divisions.len()
    }

    /// The hash of the last division that counts.
    pub fn counted(&self) -> u32 {
        self.counted
    }

    /// Whether the others have counted it as lost, or have divided its part; one that has finished its part has none.
    pub fn is_excluded(&self) -> bool {
        self.excluded && self.members[self.own].entry.standing != Standing::Finished
    }

    /// Whether this one flies its part, or will.
    pub(crate) fn takes_part(&self) -> bool {
        self.lives(self.own)
    }

    /// Whether this one has left, and said so.
    pub(crate) fn has_left(&self) -> bool {
        self.members[self.own].entry.standing == Standing::Left
    }

    /// Whether another vehicle that lives has not been heard for `span`.
    pub fn misses_one(&self, now: Instant, span: Duration) -> bool {
        let missed = |rank: &usize| self.lives(*rank) && now - self.members[*rank].heard_at >= span;
        (0..self.members.len()).any(|rank| missed(&rank))
    }
}

/// A standing in another division: who had finished its part there may have one more here.
fn of_division(standing: Standing, same: bool) -> Standing {
    if standing == Standing::Finished && !same { Standing::Left } else { standing }
}
