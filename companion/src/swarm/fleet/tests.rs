//! Fleets whose vehicles are started again, switched off and on, or started one after another, at
//! random. Vehicles are points along an endless path; they agree by the code that flies.

extern crate std;

use std::vec::Vec;

use proptest::prelude::{ProptestConfig, any};
use proptest::{prop_assert, prop_assert_eq, proptest};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

use super::*;

/// Period of the intents and roster reports.
const STEP: Duration = Duration::from_millis(250);
/// Length flown in a step, decimetres.
const STEP_DM: u16 = 5;
/// Time for which a vehicle stands ready before it takes a start, seconds: as
/// `shares_plan_with_others` has it, and a second more.
const READY_S: u32 = 6;
const MOST: usize = 5;
/// CRCs of plans; a new flight may have the same plan as the one before.
const PLANS: [u32; 2] = [0x0102_0304, 0x1112_1325];

struct Vehicle {
    fleet: Fleet<MOST>,
    /// When the board was switched on: its clock begins at 0 then.
    booted: Instant,
    on: bool,
    waits: bool,
    on_pad: bool,
    status: ShareStatus,
    progress_dm: u16,
    division: usize,
    heard_at: [Option<Instant>; MOST],
    heard_bits: [u32; MOST],
}

impl Vehicle {
    /// A board that was just switched on.
    fn new(own: usize, count: usize, booted: Instant) -> Self {
        Self {
            booted,
            fleet: Fleet::new(own, count, FleetTimeouts::of_flight(Duration::from_secs(60))),
            on: true,
            waits: true,
            on_pad: true,
            status: ShareStatus::Alive,
            progress_dm: 0,
            division: 0,
            heard_at: [None; MOST],
            heard_bits: [0; MOST],
        }
    }

    /// The time by the vehicle's own clock at `now`.
    fn clock(&self, now: Instant) -> Instant {
        Instant::ZERO + (now - self.booted)
    }
}

fn lately(now: Instant, at: Option<Instant>, most_ms: u64) -> bool {
    at.is_some_and(|at| now - at <= Duration::from_millis(most_ms))
}

struct Swarm {
    vehicles: Vec<Vehicle>,
    /// For each vehicle, the others whose messages reach it, as bits.
    links: [u32; MOST],
    /// Share of the messages that are lost.
    loss: f32,
    now: Instant,
    random: Pcg32,
}

impl Swarm {
    /// Vehicles on their pads that were just switched on.
    fn new(count: usize, loss: f32, seed: u64) -> Self {
        Self {
            vehicles: (0..count).map(|own| Vehicle::new(own, count, Instant::ZERO)).collect(),
            links: [u32::MAX; MOST],
            loss,
            now: Instant::ZERO,
            random: Pcg32::seed_from_u64(seed),
        }
    }

    /// Vehicles in the air, by this plan.
    fn flying(count: usize, loss: f32, seed: u64, plan_crc: u32) -> Self {
        let mut swarm = Self::new(count, loss, seed);
        (0..count).for_each(|own| swarm.plan(own, plan_crc));
        swarm.run_s(READY_S);
        (0..count).for_each(|own| swarm.start(own));
        swarm.vehicles.iter_mut().for_each(|vehicle| vehicle.on_pad = false);
        swarm
    }

    /// The vehicle plans, on its pad: it becomes ready.
    fn plan(&mut self, own: usize, plan_crc: u32) {
        let vehicle = &mut self.vehicles[own];
        vehicle.fleet.begin_flight(vehicle.clock(self.now));
        vehicle.fleet.set_plan(plan_crc);
        (vehicle.waits, vehicle.on_pad, vehicle.status) = (true, true, ShareStatus::Alive);
        (vehicle.progress_dm, vehicle.division) = (0, 0);
    }

    /// The vehicle is switched off and on.
    fn reset(&mut self, own: usize) {
        self.vehicles[own] = Vehicle::new(own, self.vehicles.len(), self.now);
    }

    fn start(&mut self, own: usize) {
        self.vehicles[own].waits = false;
    }

    /// The vehicle ends its flight, and lands.
    fn end(&mut self, own: usize, status: ShareStatus) {
        (self.vehicles[own].status, self.vehicles[own].on_pad) = (status, true);
    }

    fn run_s(&mut self, s: u32) {
        (0..4 * s).for_each(|_| self.step());
    }

    fn uniform(&mut self) -> f32 {
        (self.random.next_u32() >> 8) as f32 / (1u32 << 24) as f32
    }

    fn below(&mut self, most: u32) -> u32 {
        self.random.next_u32() % most
    }

    fn step(&mut self) {
        let count = self.vehicles.len();
        let on: Vec<usize> = (0..count).filter(|own| self.vehicles[*own].on).collect();
        on.iter().for_each(|own| self.decide(*own));
        on.iter().for_each(|own| self.report(*own));
        self.now = self.now + STEP;
    }

    /// A vehicle decides, and flies on.
    fn decide(&mut self, own: usize) {
        let count = self.vehicles.len();
        let v = &mut self.vehicles[own];
        let now = v.clock(self.now);
        let (heard_at, bits) = (v.heard_at, v.heard_bits);
        let hears =
            |rank: usize, of: usize| lately(now, heard_at[rank], 1000) && bits[rank] >> of & 1 != 0;
        let hearing = |rank: usize| VehicleReception {
            heard_at: heard_at[rank],
            hears_us: hears(rank, own),
            heard_by_others: (0..count).any(|other| other != rank && hears(other, rank)),
            heard_bits: bits[rank],
        };
        let holds_dm = v.fleet.commitment_dm();
        let report = OwnReport {
            airborne: !v.on_pad,
            status: v.status,
            waits_for_start: v.waits,
            path_division_count: v.division,
            progress_dm: v.progress_dm,
            new_commitment_dm: Some(if v.on_pad { 0 } else { v.progress_dm + 50 }),
            holds: v.on_pad || holds_dm.is_some_and(|at_dm| v.progress_dm >= at_dm),
            wants_division: false,
        };
        v.fleet.step(now, &report, hearing);
        if v.fleet.is_division_to_be_computed() {
            let hash = v.fleet.division_inputs_hash();
            v.fleet.set_hash_from_plan(hash);
        }
        if v.status == ShareStatus::Alive && v.fleet.division_count() > v.division {
            (v.division, v.progress_dm) = (v.fleet.division_count(), 0);
        }
        if !v.on_pad && v.fleet.has_lease(now) && v.status == ShareStatus::Alive {
            let most_dm = v.fleet.commitment_dm().unwrap_or(u16::MAX).max(v.progress_dm);
            v.progress_dm = (v.progress_dm + STEP_DM).min(most_dm);
        }
        if !v.waits && v.status == ShareStatus::Alive && v.fleet.is_excluded() {
            (v.status, v.on_pad) = (ShareStatus::Left, true);
        }
    }

    /// A vehicle reports; what it sends reaches some of the others.
    fn report(&mut self, own: usize) {
        let (count, sender) = (self.vehicles.len(), &self.vehicles[own]);
        let now = sender.clock(self.now);
        let heard = (0..count).filter(|rank| lately(now, sender.heard_at[*rank], 800));
        let bits = heard.fold(0u32, |bits, rank| bits | 1 << rank);
        let roster = sender.fleet.roster_report(0);
        for to in 0..count {
            let arrives = self.uniform() >= self.loss && self.links[to] >> own & 1 != 0;
            let to = &mut self.vehicles[to];
            if to.on && arrives {
                (to.heard_at[own], to.heard_bits[own]) = (Some(to.clock(self.now)), bits);
                let start = if to.waits { StartStatus::NotStarted } else { StartStatus::Started };
                to.fleet.handle_roster_report(own, &roster, start);
            }
        }
    }

    /// The inputs of the divisions that count for a vehicle.
    fn inputs(&self, own: usize) -> Vec<Vec<VehicleDivisionInput>> {
        self.vehicles[own].fleet.divisions.iter().map(|inputs| inputs.to_vec()).collect()
    }

    /// A flight in which the vehicles leave one after the other, at any time: the others divide
    /// what they leave, and leave in turn.
    fn flown_and_left(count: usize, loss: f32, seed: u64, plan_crc: u32) -> Self {
        let mut swarm = Self::flying(count, loss, seed, plan_crc);
        let mut order: Vec<usize> = (0..count).collect();
        while let Some(last) = order.len().checked_sub(1) {
            let gap_s = 1 + swarm.below(60);
            swarm.run_s(gap_s);
            let next = swarm.below(last as u32 + 1) as usize;
            let finished = swarm.below(4) == 0;
            let status = if finished { ShareStatus::Finished } else { ShareStatus::Left };
            swarm.end(order.swap_remove(next), status);
        }
        swarm.run_s(10);
        swarm
    }

    /// Of a fleet on the ground, these vehicles are started again, at most some seconds after each
    /// other, half of them by switching them off and on; the others stay powered.
    fn start_again(&mut self, again: &[usize], plan_crc: u32) {
        for own in again.iter().copied() {
            if self.below(2) == 0 {
                self.reset(own);
                // Before it knows its position and plans, it already hears the others.
                self.run_s(2);
            }
            self.plan(own, plan_crc);
            let gap_s = self.below(3);
            self.run_s(gap_s);
        }
        self.run_s(READY_S);
        again.iter().for_each(|own| self.start(*own));
        self.run_s(1);
        again.iter().for_each(|own| self.vehicles[*own].on_pad = false);
    }
}

/// The vehicles of these bits, at least one.
fn some_of(count: usize, bits: u32) -> Vec<usize> {
    let some: Vec<usize> = (0..count).filter(|own| bits >> own & 1 != 0).collect();
    if some.is_empty() { std::vec![bits as usize % count] } else { some }
}

/// A vehicle that no majority heard before the start leaves, and is a new vehicle once it is heard:
/// by the plan that it holds. The vehicles that it had heard all the time do not count as lost.
#[test]
fn one_that_left_before_the_start_takes_part_again_by_its_plan() {
    let mut swarm = Swarm::new(3, 0.0, 1);
    (0..3).for_each(|own| swarm.plan(own, PLANS[0]));
    swarm.run_s(60);
    (swarm.links[2], swarm.vehicles[2].status) = (0, ShareStatus::Left);
    swarm.run_s(30);
    (swarm.links[2], swarm.vehicles[2].status) = (u32::MAX, ShareStatus::Alive);
    swarm.run_s(READY_S);
    for vehicle in &swarm.vehicles {
        assert!((0..3).all(|rank| vehicle.fleet.vehicle_takes_part(rank)), "{:?}", vehicle.fleet);
    }
    (0..3).for_each(|own| swarm.start(own));
    swarm.vehicles.iter_mut().for_each(|vehicle| vehicle.on_pad = false);
    swarm.run_s(20);
    swarm.end(0, ShareStatus::Left);
    swarm.run_s(20);
    assert_eq!([1, 2].map(|own| swarm.inputs(own).len()), [1, 1], "they divide");
}

/// A vehicle that hears nobody is to leave its part: it counts as missing, so nobody that could
/// take its part lands. Of two halves the one with the lowest id goes on, and is not missing.
#[test]
fn a_vehicle_that_hears_no_majority_is_missed_until_it_leaves() {
    for (deaf, heard_by) in [(2, 0b111), (0, 0b111), (1, 0b11), (0, 0b11)] {
        let count = if heard_by == 0b111 { 3 } else { 2 };
        let mut swarm = Swarm::flying(count, 0.0, 1, PLANS[0]);
        let other = (deaf + 1) % count;
        let missed = |swarm: &Swarm| swarm.vehicles[other].fleet.is_any_missing();
        swarm.run_s(5);
        assert!(!missed(&swarm));
        swarm.links[deaf] = 0;
        swarm.run_s(3);
        assert_eq!(missed(&swarm), (deaf, count) != (0, 2), "{deaf} of {count}");
        swarm.end(deaf, ShareStatus::Left);
        swarm.run_s(2);
        assert!(!missed(&swarm) && swarm.vehicles[other].fleet.is_dividing(), "{deaf} of {count}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 300 } else { 600 }))]

    /// A vehicle that nobody hears any more may be the only one that knows that all agreed on a
    /// division. Heard again, it goes on with the others. If it has landed, they have divided
    /// without it, or are about to: they fly on.
    #[test]
    fn a_division_that_only_one_cut_off_agreed_to_excludes_nobody(
        count in 4usize..=MOST, cut_after in 0usize..100, silent_s in 1u32..75,
        rank in 0usize..MOST - 1, deaf in any::<bool>(),
        seed in any::<u64>(), loss in proptest::sample::select(&[0.0f32, 0.1, 0.5][..]),
    ) {
        let cut = rank % (count - 1);
        let mut swarm = Swarm::flying(count, loss, seed, PLANS[0]);
        swarm.run_s(20);
        swarm.end(count - 1, ShareStatus::Left);
        (0..cut_after).for_each(|_| swarm.step());
        swarm.links.iter_mut().for_each(|from| *from &= !(1 << cut));
        swarm.links[cut] = if deaf { 0 } else { u32::MAX };
        // Its lease ends after 20 s, then it waits for 20 s, and lands.
        swarm.run_s(silent_s.min(42));
        if let Some(landed_for_s) = silent_s.checked_sub(42) {
            swarm.end(cut, ShareStatus::Left);
            swarm.run_s(landed_for_s);
        }
        swarm.links = [u32::MAX; MOST];
        swarm.run_s(90);
        let flies_on = |own: &usize| *own != cut || silent_s < 42;
        for own in (0..count - 1).filter(flies_on) {
            let vehicle = &swarm.vehicles[own];
            let fleet = &vehicle.fleet;
            prop_assert!(vehicle.status == ShareStatus::Alive, "{own} landed: {fleet:?}");
            prop_assert!(!fleet.is_dividing(), "{own} divides: {fleet:?}");
            prop_assert_eq!(swarm.inputs(own), swarm.inputs(usize::from(cut == 0)));
        }
    }

    /// Places and divisions that landed vehicles report of an earlier flight belong to its plan.
    #[test]
    fn of_an_earlier_flight_nothing_counts(
        count in 2usize..=MOST, bits in any::<u32>(), seed in any::<u64>(), lossy in any::<bool>(),
        plan_crc in proptest::sample::select(&PLANS[..]),
    ) {
        let mut swarm = Swarm::flown_and_left(count, if lossy { 0.3 } else { 0.0 }, seed, PLANS[0]);
        let again = some_of(count, bits);
        swarm.start_again(&again, plan_crc);
        swarm.run_s(60);
        for &own in &again {
            let vehicle = &swarm.vehicles[own];
            prop_assert!(!vehicle.fleet.is_excluded(), "{own} of {again:?} is excluded");
            prop_assert!(vehicle.progress_dm > 50, "{own} of {again:?} does not fly");
            let inputs = swarm.inputs(own);
            prop_assert_eq!(inputs.len(), usize::from(again.len() < count));
            for (rank, input) in inputs.iter().flat_map(|inputs| inputs.iter().enumerate()) {
                let starts = again.contains(&rank);
                prop_assert_eq!(input.alive, starts);
                prop_assert!(starts || input.along_dm == 0, "{own}: {rank} counts {input:?}");
            }
        }
    }

    /// Before the first start vehicles come up at any time, and may be started one by one.
    #[test]
    fn nobody_is_lost_before_the_start(
        count in 2usize..=MOST, seed in any::<u64>(), lossy in any::<bool>(), left in any::<u32>(),
    ) {
        let loss = if lossy { 0.3 } else { 0.0 };
        let mut swarm = Swarm::flown_and_left(count, loss, seed, PLANS[0]);
        // Some vehicles are off until their reset; the others stand as they landed.
        for own in (0..count).filter(|own| left >> own & 1 != 0) {
            swarm.vehicles[own].on = false;
        }
        let last = swarm.below(count as u32) as usize;
        for own in (0..count).map(|k| (k + last) % count) {
            let later_s = swarm.below(120);
            swarm.run_s(later_s);
            swarm.reset(own);
            swarm.run_s(2);
            swarm.plan(own, PLANS[1]);
            prop_assert!(swarm.vehicles.iter().all(|v| !v.waits || !v.fleet.is_dividing()));
        }
        swarm.run_s(READY_S);
        (0..count).for_each(|own| swarm.start(own));
        swarm.run_s(2);
        for own in 0..count {
            let fleet = &swarm.vehicles[own].fleet;
            prop_assert!(!fleet.is_excluded() && !fleet.is_dividing(), "{own}: {fleet:?}");
            prop_assert_eq!(fleet.division_count(), 0);
            prop_assert!((0..count).all(|rank| fleet.vehicle_takes_part(rank)), "{own}: {fleet:?}");
        }
    }

    /// A vehicle that has finished or left, or was lost, is started again while others fly; then
    /// the fleet is split. At most one part is a majority and takes the other's part of the area.
    #[test]
    fn one_started_again_in_the_flight_of_others_makes_no_second_majority(
        count in 3usize..=MOST, seed in any::<u64>(), lossy in any::<bool>(),
        status in proptest::sample::select(&[ShareStatus::Finished, ShareStatus::Left][..]),
        resets in any::<bool>(), side in any::<u32>(), apart_before in any::<bool>(),
        late_s in proptest::option::of(3u32..9),
    ) {
        let mut swarm =
            Swarm::flying(count, if lossy { 0.3 } else { 0.0 }, seed, PLANS[0]);
        let again = swarm.below(count as u32) as usize;
        let other = (again + 1) % count;
        if let Some(late_s) = late_s {
            // It is started again after one of the others was: the rest wait, and have heard that.
            for own in 0..count {
                swarm.end(own, ShareStatus::Left);
            }
            swarm.run_s(5);
            for own in (0..count).filter(|own| *own != again) {
                swarm.plan(own, PLANS[0]);
            }
            swarm.run_s(READY_S);
            swarm.start(other);
            swarm.run_s(late_s);
        } else {
            swarm.run_s(20);
            swarm.end(again, status);
            swarm.run_s(5);
        }
        let part = |swarm: &mut Swarm| {
            let apart = |own: usize| (0..count)
                .filter(|rank| (side >> rank ^ side >> own) & 1 == 0)
                .fold(0, |bits, rank| bits | 1 << rank);
            (0..count).for_each(|own| swarm.links[own] = apart(own));
        };
        if apart_before {
            part(&mut swarm);
            swarm.run_s(5);
        }
        if resets {
            swarm.reset(again);
            swarm.run_s(2);
        }
        swarm.plan(again, PLANS[0]);
        if late_s.is_some() {
            for own in (0..count).filter(|own| *own != again) {
                swarm.start(own);
                swarm.step();
            }
        }
        swarm.run_s(READY_S);
        swarm.start(again);
        swarm.run_s(2);
        (0..count).for_each(|own| swarm.vehicles[own].on_pad = swarm.vehicles[own].waits);
        part(&mut swarm);
        for second in 0..120 {
            swarm.run_s(1);
            // By then the lease of each side that is no majority has ended.
            let holds = |own: &usize| {
                let vehicle = &swarm.vehicles[*own];
                !vehicle.waits
                    && vehicle.status == ShareStatus::Alive
                    && vehicle.fleet.has_lease(vehicle.clock(swarm.now))
            };
            let leases = (0..count).filter(holds).fold(0u32, |bits, own| bits | 1 << own);
            let sides = [leases & side, leases & !side];
            prop_assert!(
                second < 30 || sides.contains(&0),
                "{second} s: vehicle {again}, side {:b}, leases {leases:b}: {:#?}",
                side & ((1 << count) - 1),
                swarm.vehicles.iter().map(|v| &v.fleet).collect::<Vec<_>>()
            );
        }
    }

    /// A board that restarts in the air in any flight leaves, with the progress that others heard.
    #[test]
    fn a_board_that_restarts_in_the_air_leaves_with_its_progress(
        count in 2usize..=MOST, seed in any::<u64>(), lossy in any::<bool>(),
        flights in 1u32..4, hears in 0u32..6,
    ) {
        let mut swarm = Swarm::flying(count, if lossy { 0.3 } else { 0.0 }, seed, PLANS[0]);
        for flight in 1..flights {
            swarm.run_s(10);
            for own in 0..count {
                swarm.end(own, ShareStatus::Finished);
            }
            swarm.run_s(5);
            for own in 0..count {
                swarm.plan(own, PLANS[flight as usize % 2]);
            }
            swarm.run_s(READY_S);
            for own in 0..count {
                swarm.start(own);
                swarm.vehicles[own].on_pad = false;
            }
        }
        let flown_s = 20 + swarm.below(100);
        swarm.run_s(flown_s);
        let struck = swarm.below(count as u32) as usize;
        let progress_dm = swarm.vehicles[struck].progress_dm;
        swarm.reset(struck);
        // Until the vehicle finds that it is in the air, it may hear others.
        (0..hears).for_each(|_| swarm.step());
        swarm.start(struck);
        swarm.end(struck, ShareStatus::Left);
        swarm.run_s(60);
        for own in (0..count).filter(|own| *own != struck) {
            let inputs = swarm.inputs(own);
            prop_assert_eq!(inputs.len(), 1, "{}: {:?}", own, &swarm.vehicles[own].fleet);
            let input = inputs[0][struck];
            let kept = !input.alive && input.along_dm + 50 >= progress_dm;
            prop_assert!(kept, "{progress_dm}: {input:?}");
        }
    }
}
