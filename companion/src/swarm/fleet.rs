//! The fleet of a coverage mission: which vehicles still fly, and the division of what the others
//! left among them, agreed on without a leader.
//!
//! Each vehicle keeps an entry for every vehicle of the roster. Entries only grow and are merged by
//! maximum, so lost, repeated and reordered messages do no harm. When a vehicle is lost or leaves,
//! each of the others reports its commitment once: the place along its path up to which it still
//! flies, and where it then holds. From the entries all compute the same division, and report its
//! hash. Once all that live have reported the same hash and hold, the division is binding, and all
//! fly on ([`Fleet::step`]). A vehicle photographs only while it has its lease: within [`LEASE`] a
//! majority reported that they hear it. Others take its part no sooner than [`LOST_AFTER_SILENCE`]
//! after each of them last heard it. Why no waypoint has two owners:
//! `docs/coverage-losses.md`, claim by claim; `tests/tests/fleet_model` searches a counterexample.

use heapless::Vec;
use planner_core::file::CRC32;

use crate::link::roster::{RosterReportEntry, ShareStatus};
use crate::time::{Duration, Instant};

mod division_input;
mod lease;
mod reports;
#[cfg(test)]
mod tests;
mod timeouts;

pub use division_input::{DivisionInputs, VehicleDivisionInput};
pub use timeouts::{FleetTimeouts, LEASE, LEASE_HEARD_WITHIN, LOST_AFTER_SILENCE};

/// Time of flight up to a vehicle's commitment, seconds: it commits itself to fly to the last
/// picture that it takes in that time. A vehicle whose path ends before its route requests a
/// division this long before that end.
pub const COMMITMENT_S: f32 = 10.0;
/// Maximum number of divisions of a mission after its first plan; after the last one the waypoints
/// that a vehicle leaves stay unphotographed.
pub const MAX_DIVISIONS: usize = 12;
/// Silence after which a vehicle may be lost, and may get no part in a division: the others wait
/// above their pads until it is heard again or counts as lost.
pub(crate) const MISSED_AFTER: Duration = Duration::from_secs(3);
/// Silence after which a vehicle that was in flight has landed, however it flew on: its battery is
/// empty.
const LANDED_AFTER_SILENCE: Duration = Duration::from_secs(1800);
/// Number of distinct incarnations, the counts of a vehicle's flights: 3 bits.
const INCARNATIONS: u8 = 8;

/// Whether this vehicle was started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartStatus {
    /// Not yet, or no more after a restart: it may take part again as a new vehicle.
    NotStarted,
    /// It was started.
    Started,
}

/// This vehicle's state, as it reports it to the fleet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnReport {
    /// Whether this vehicle takes part in the mission, was lost, has left or has finished.
    pub status: ShareStatus,
    /// Whether this vehicle was not started yet: it may take part again as a new vehicle.
    pub waits_for_start: bool,
    /// Whether this vehicle is in the air.
    pub airborne: bool,
    /// Number of binding divisions from which its present path follows; the progress and the
    /// commitment below are along that path.
    pub path_division_count: usize,
    /// Progress along its path, decimetres.
    pub progress_dm: u16,
    /// The commitment that this vehicle would report now, decimetres along its path: where it would
    /// hold. `None` if it cannot make one.
    pub new_commitment_dm: Option<u16>,
    /// Whether this vehicle holds at its commitment.
    pub holds: bool,
    /// Whether this vehicle requests a division: its path, only the first part of its route, ends
    /// soon.
    pub wants_division: bool,
}

/// Reception of another vehicle: whether this one and others hear it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VehicleReception {
    /// When this vehicle last received an intent from the other one; `None` before.
    pub heard_at: Option<Instant>,
    /// Whether the other vehicle lately reported that it hears this one.
    pub hears_us: bool,
    /// Whether a vehicle heard by this one lately reported that it hears the other one.
    pub heard_by_others: bool,
    /// Ranks of the vehicles that the other vehicle reported to hear, as bits.
    pub heard_bits: u32,
}

/// What this vehicle knows of one vehicle of the roster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct FleetVehicle {
    /// What is known of the vehicle, as roster reports state it.
    entry: RosterReportEntry,
    /// Whether the vehicle has a part of the area: all have one at first, those alive when a
    /// division becomes binding keep one.
    has_part: bool,
    /// When the vehicle was last heard, by this one or by one that this one hears.
    heard_at: Instant,
    /// Whether this vehicle itself lately heard that one.
    heard_by_us: bool,
    /// Hash of the division under way that the vehicle has computed; 0 for none.
    pending_hash: u32,
}

impl FleetVehicle {
    /// Whether the vehicle has a part, and is neither lost nor has left or finished.
    fn takes_part(&self) -> bool {
        self.has_part && self.entry.status == ShareStatus::Alive
    }
}

/// What this vehicle knows of all vehicles of the roster, itself included, and of their divisions.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Fleet<const V: usize> {
    own_rank: u8,
    /// All vehicles of the roster by rank, this one included.
    vehicles: Vec<FleetVehicle, V>,
    /// Inputs of the binding divisions, oldest first.
    divisions: Vec<DivisionInputs<V>, MAX_DIVISIONS>,
    /// Hash of the last binding division; 0 before the first.
    committed_hash: u32,
    /// Inputs of the division under way; empty until all of them are known.
    pending_inputs: DivisionInputs<V>,
    /// Hash of the division under way, as this vehicle computed it; 0 before.
    pending_hash: u32,
    /// Inputs of the division whose hash this vehicle reported last and withdrew since.
    withdrawn_inputs: DivisionInputs<V>,
    /// Hash of that withdrawn division; 0 for none.
    withdrawn_hash: u32,
    /// When a majority last reported that they hear this vehicle.
    lease_renewed_at: Instant,
    /// Whether the others count this vehicle as lost, or have divided its part.
    excluded: bool,
    /// 8 bits of the CRC of the plan that this flight began with; 0 while there is none.
    plan_crc8: u8,
    /// Whether this vehicle waits for its start, and knows of none that was started: there is no
    /// flight in which one could be lost or leave.
    idle: bool,
    /// Ranks of the vehicles that were started and take part, by their own reports, as bits.
    started_bits: u32,
    /// Ranks of the other vehicles that report that they hear a started one, as bits.
    hears_started_bits: u32,
    /// Ranks of the vehicles that have reported their own entry, as bits.
    introduced_bits: u32,
    /// Whether this vehicle is in the air.
    airborne: bool,
    /// When the last of the vehicles that may be lost is down; 0 if there is none.
    down_at: Instant,
    /// Whether a vehicle that takes part was not heard for [`MISSED_AFTER`], or hears no majority.
    any_missing: bool,
    limits: FleetTimeouts,
}

impl<const V: usize> Fleet<V> {
    /// A fleet of `count` vehicles (at most `V`), as known to the vehicle of rank `own`.
    pub fn new(own: usize, count: usize, limits: FleetTimeouts) -> Self {
        let vehicle = FleetVehicle { has_part: true, ..FleetVehicle::default() };
        Self {
            own_rank: own as u8,
            vehicles: core::iter::repeat_n(vehicle, count.min(V)).collect(),
            divisions: Vec::new(),
            committed_hash: 0,
            pending_inputs: Vec::new(),
            pending_hash: 0,
            withdrawn_inputs: Vec::new(),
            withdrawn_hash: 0,
            lease_renewed_at: Instant::ZERO,
            excluded: false,
            plan_crc8: 0,
            idle: false,
            started_bits: 0,
            hears_started_bits: 0,
            introduced_bits: 0,
            airborne: false,
            down_at: Instant::ZERO,
            any_missing: false,
            limits,
        }
    }

    /// Begins a flight, or a new plan: all silence before, and what was flown of the plan before,
    /// is forgotten. A vehicle that was lost, excluded, has left, finished or flew a division takes
    /// part again under a new incarnation number.
    pub fn begin_flight(&mut self, now: Instant) {
        let entry = self.vehicles[usize::from(self.own_rank)].entry;
        if entry.status != ShareStatus::Alive || self.excluded || !self.divisions.is_empty() {
            self.rejoin((entry.incarnation + 1) % INCARNATIONS);
        }
        self.forget_plan();
        (self.started_bits, self.hears_started_bits) = (0, 0);
        self.vehicles.iter_mut().for_each(|vehicle| vehicle.heard_at = now);
        // A majority has to hear this vehicle before it takes off.
        self.lease_renewed_at = Instant::ZERO;
    }

    /// Sets the plan of this flight, by its CRC: places along paths and divisions that others
    /// report count only if they are of the same plan.
    pub fn set_plan(&mut self, plan_crc: u32) {
        // 0 stands for no plan.
        self.plan_crc8 = plan_crc.to_le_bytes().into_iter().fold(0, |crc, byte| crc ^ byte).max(1);
    }

    /// Forgets the plan, its divisions, and all places along its paths.
    fn forget_plan(&mut self) {
        (self.plan_crc8, self.committed_hash, self.pending_hash, self.withdrawn_hash) =
            (0, 0, 0, 0);
        self.divisions.clear();
        self.pending_inputs.clear();
        self.withdrawn_inputs.clear();
        for vehicle in &mut self.vehicles {
            vehicle.entry = vehicle.entry.seen_from_another_division();
            (vehicle.has_part, vehicle.pending_hash) = (true, 0);
        }
    }

    /// Forgets what is known of the fleet, and takes part again under this incarnation number, by
    /// the plan that this vehicle holds. Called for a new flight or plan, when a vehicle that left
    /// could start again, and after a restart. When each other one was heard last stays known:
    /// otherwise all would count as lost.
    fn rejoin(&mut self, incarnation: u8) {
        let fresh = FleetVehicle { has_part: true, ..FleetVehicle::default() };
        for vehicle in &mut self.vehicles {
            *vehicle = FleetVehicle { heard_at: vehicle.heard_at, ..fresh };
        }
        *self = Self {
            vehicles: core::mem::take(&mut self.vehicles),
            lease_renewed_at: self.lease_renewed_at,
            started_bits: self.started_bits,
            hears_started_bits: self.hears_started_bits,
            airborne: self.airborne,
            plan_crc8: self.plan_crc8,
            idle: self.idle,
            ..Self::new(usize::from(self.own_rank), 0, self.limits)
        };
        self.vehicles[usize::from(self.own_rank)].entry.incarnation = incarnation;
    }

    /// One step: updates this vehicle's entry, the reception of the others, the lease, and the
    /// division under way. `hearing` returns the reception of the vehicle of a rank.
    pub fn step(
        &mut self,
        now: Instant,
        own: &OwnReport,
        hearing: impl Fn(usize) -> VehicleReception,
    ) {
        (self.airborne, self.down_at, self.any_missing) = (own.airborne, Instant::ZERO, false);
        // This vehicle may not yet have the path of the last division.
        let caught_up = own.path_division_count == self.divisions.len();
        let entry = &mut self.vehicles[usize::from(self.own_rank)].entry;
        // The path of a vehicle that has left is no part of its share: its progress does not count.
        if caught_up && entry.status == ShareStatus::Alive {
            entry.progress_dm = entry.progress_dm.max(own.progress_dm);
        }
        let status = if caught_up { own.status } else { own.status.seen_from_another_division() };
        entry.status = entry.status.max(status);
        let takes_off = !own.waits_for_start && entry.status == ShareStatus::Alive;
        let bit = self.own_bit();
        self.started_bits = self.started_bits & !bit | if takes_off { bit } else { 0 };
        self.hears_started_bits &= !bit;
        let mut linked = bit;
        let counted = self.counted_ranks();
        for (rank, vehicle) in self.vehicles.iter_mut().enumerate() {
            let heard = hearing(rank);
            let lately = heard.heard_at.is_some_and(|at| now - at <= self.limits.heard_within);
            if rank == usize::from(self.own_rank) || lately || heard.heard_by_others {
                vehicle.heard_at = now;
            }
            vehicle.heard_by_us = lately;
            let (silence, bit) = (now - vehicle.heard_at, 1 << rank.min(31));
            if silence >= MISSED_AFTER && vehicle.has_part {
                let falls = vehicle.entry.status <= ShareStatus::Lost;
                let down_at = vehicle.heard_at + self.limits.down_after;
                self.down_at = if falls { self.down_at.max(down_at) } else { self.down_at };
            }
            // A vehicle that hears no majority is to land, and leaves its part when its lease ends.
            let cut_off = lately && !Self::is_majority_of(heard.heard_bits | bit, counted);
            self.any_missing |= (silence >= MISSED_AFTER || cut_off) && vehicle.takes_part();
            if silence >= self.limits.lost_after {
                self.hears_started_bits &= !bit;
                // The vehicle counts as lost and has landed by now; or its battery is empty.
                let lost = vehicle.entry.status == ShareStatus::Lost;
                if (lost && silence >= self.limits.down_after) || silence >= LANDED_AFTER_SILENCE {
                    self.started_bits &= !bit;
                }
            }
            linked |= u32::from(lately && heard.hears_us) << rank.min(31);
        }
        if self.is_majority(|rank, _| linked >> rank & 1 != 0) {
            self.lease_renewed_at = now;
        }
        self.idle = own.waits_for_start && !self.is_another_started();
        if self.idle {
            self.forget_earlier_flight(now);
        }
        self.rejoin_if_ready(now, own.status);
        // A vehicle that has left may be deaf: the others may hear those that it does not.
        if self.has_lease(now) && self.vehicle_takes_part(usize::from(self.own_rank)) {
            self.count_silent_as_lost(now);
        }
        if caught_up {
            self.step_division(now, own);
        }
    }

    /// Whether another vehicle was started and takes part, as far as this one has heard, or as a
    /// vehicle that it hears has heard. One that fell silent in flight may still fly.
    pub(crate) fn is_another_started(&self) -> bool {
        self.other_started_ranks() | self.hears_started_bits & !self.own_bit() != 0
    }

    /// Ranks of the other vehicles that this one knows to be started, as bits.
    fn other_started_ranks(&self) -> u32 {
        let counts = |rank: &usize| self.vehicles[*rank].entry.status <= ShareStatus::Lost;
        let known = (0..self.vehicles.len()).filter(counts).fold(0, |bits, rank| bits | 1 << rank);
        self.started_bits & known & !self.own_bit()
    }

    fn own_bit(&self) -> u32 {
        1 << self.own_rank.min(31)
    }

    /// Before a start vehicles come up one after the other, and report places along their paths of
    /// an earlier flight: neither silence nor progress counts yet.
    fn forget_earlier_flight(&mut self, now: Instant) {
        for (rank, vehicle) in self.vehicles.iter_mut().enumerate() {
            vehicle.heard_at = now;
            if rank != usize::from(self.own_rank) {
                vehicle.entry = vehicle.entry.seen_from_another_division();
            }
        }
    }

    /// Whether a division is under way: a vehicle was lost or left, or one (this one too) has
    /// reported its commitment, the place where it will hold. False while this vehicle takes no
    /// part or knows of no flight yet, and after the last possible division. A vehicle keeps its
    /// commitment until a division is binding, even if the lost vehicle turns out to have
    /// finished: others may already count on it.
    pub fn is_dividing(&self) -> bool {
        let asks = |v: &FleetVehicle| match v.entry.status {
            ShareStatus::Alive => v.entry.commitment_dm.is_some(),
            ShareStatus::Lost | ShareStatus::Left => true,
            ShareStatus::Finished => false,
        };
        self.may_divide() && self.vehicles.iter().any(|v| v.has_part && asks(v))
    }

    /// Whether this vehicle takes part in a flight in which a division is still possible.
    fn may_divide(&self) -> bool {
        self.vehicle_takes_part(usize::from(self.own_rank))
            && !self.idle
            && !self.divisions.is_full()
    }

    /// Whether the vehicle of this rank has a part, and was not lost, has not left or finished.
    pub(crate) fn vehicle_takes_part(&self, rank: usize) -> bool {
        self.vehicles[rank].takes_part()
    }

    /// Computes the inputs of the division under way, once all vehicles that live have reported
    /// commitments, and this vehicle has not heard the lost ones for [`LOST_AFTER_SILENCE`] either;
    /// without its lease this vehicle computes none.
    fn prepare_division_inputs(&mut self, now: Instant) {
        let known = |v: &FleetVehicle| match v.entry.status {
            ShareStatus::Alive => v.entry.commitment_dm.is_some(),
            ShareStatus::Lost => now - v.heard_at >= self.limits.lost_after,
            ShareStatus::Left | ShareStatus::Finished => true,
        };
        if !self.has_lease(now) || !self.vehicles.iter().filter(|v| v.has_part).all(known) {
            self.withdraw_inputs();
            self.pending_inputs.clear();
            return;
        }
        // A vehicle that has no part since an earlier division gets none in this one.
        let input = |v: &FleetVehicle| {
            if v.has_part {
                VehicleDivisionInput::from_entry(&v.entry)
            } else {
                VehicleDivisionInput::default()
            }
        };
        if !self.vehicles.iter().map(input).eq(self.pending_inputs.iter().copied()) {
            self.withdraw_inputs();
            self.pending_inputs = self.vehicles.iter().map(input).collect();
        }
    }

    /// Withdraws the inputs that were reported last, and remembers them.
    fn withdraw_inputs(&mut self) {
        if self.pending_hash != 0 {
            (self.withdrawn_inputs, self.withdrawn_hash) =
                (self.pending_inputs.clone(), self.pending_hash);
            self.pending_hash = 0;
        }
    }

    /// Whether the shell is to compute the division under way: all its inputs are known.
    pub fn is_division_to_be_computed(&self) -> bool {
        self.pending_hash == 0 && !self.pending_inputs.is_empty()
    }

    /// The inputs of every binding division, and of the one under way where its hash is still to be
    /// computed.
    pub fn inputs_of_divisions(&self) -> impl Iterator<Item = &[VehicleDivisionInput]> + Clone {
        let under_way = self.is_division_to_be_computed().then_some(&self.pending_inputs);
        self.divisions.iter().chain(under_way).map(|inputs| &inputs[..])
    }

    /// Sets the hash of the division under way from the CRC of the computed plan and from the
    /// inputs: the same plan may follow from inputs with another lost vehicle.
    pub fn set_hash_from_plan(&mut self, plan_crc: u32) {
        if self.is_division_to_be_computed() {
            let mut digest = CRC32.digest();
            digest.update(&plan_crc.to_le_bytes());
            for input in &self.pending_inputs {
                let [low, high] = input.along_dm.to_le_bytes();
                digest.update(&[u8::from(input.alive), low, high]);
            }
            // 0 stands for no hash.
            self.pending_hash = digest.finalize().max(1);
            self.vehicles[usize::from(self.own_rank)].pending_hash = self.pending_hash;
        }
    }

    /// Whether the division under way is to become binding: all that take part have reported the
    /// hash that this vehicle computed, and hold; they are a majority; the lost ones are down.
    fn is_division_agreed(&self, now: Instant) -> bool {
        let agrees = |rank: usize| {
            let vehicle = &self.vehicles[rank];
            vehicle.pending_hash == self.pending_hash && vehicle.entry.holds
        };
        let is_down = |v: &FleetVehicle| {
            v.entry.status != ShareStatus::Lost || now - v.heard_at >= self.limits.down_after
        };
        self.pending_hash != 0
            && self.vehicles.iter().filter(|v| v.has_part).all(is_down)
            && (0..self.vehicles.len()).filter(|rank| self.vehicle_takes_part(*rank)).all(agrees)
            && self.is_majority(|rank, _| self.vehicle_takes_part(rank))
    }

    /// Makes the division under way binding: vehicles not alive in it have no part any more.
    fn commit_division(&mut self) {
        let inputs = core::mem::take(&mut self.pending_inputs);
        self.committed_hash = self.pending_hash;
        (self.pending_hash, self.withdrawn_hash) = (0, 0);
        self.withdrawn_inputs.clear();
        for (vehicle, input) in self.vehicles.iter_mut().zip(&inputs) {
            vehicle.has_part &= input.alive;
            vehicle.pending_hash = 0;
            vehicle.entry = match input.alive {
                true => vehicle.entry.seen_from_another_division(),
                false => vehicle.entry.without_places(),
            };
        }
        // With `MAX_DIVISIONS` no further one is ever under way.
        let _ = self.divisions.push(inputs);
    }

    /// Number of vehicles in the roster.
    pub(crate) fn vehicle_count(&self) -> usize {
        self.vehicles.len()
    }

    /// Hash of the inputs of all binding divisions, and of the one under way if that is to be
    /// computed.
    pub fn division_inputs_hash(&self) -> u32 {
        let mut digest = CRC32.digest();
        for input in self.inputs_of_divisions().flatten() {
            let [low, high] = input.along_dm.to_le_bytes();
            digest.update(&[u8::from(input.alive), low, high]);
        }
        digest.finalize()
    }

    /// This vehicle's commitment, the place where it is to hold, decimetres along its path, while a
    /// division is under way; `None` before it was reported.
    pub fn commitment_dm(&self) -> Option<u16> {
        // An own commitment alone means that a division is under way.
        self.vehicles[usize::from(self.own_rank)].entry.commitment_dm.filter(|_| self.may_divide())
    }

    /// Where this vehicle held for the last binding division, decimetres along the path that it
    /// flew before that division; 0 before the first.
    pub fn held_at_dm(&self) -> u16 {
        let inputs = self.divisions.last().and_then(|all| all.get(usize::from(self.own_rank)));
        inputs.map_or(0, |input| input.along_dm)
    }

    /// Number of divisions that are binding.
    pub fn division_count(&self) -> usize {
        self.divisions.len()
    }

    /// Hash of the last binding division; 0 before the first.
    pub fn committed_hash(&self) -> u32 {
        self.committed_hash
    }
}
