//! The model: what a vehicle knows, what it may do in a tick, and what must hold.

mod search;

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex};

use companion::link::roster::{RosterReport, ShareStatus};
use companion::swarm::fleet::{Fleet, FleetTimeouts, OwnReport, StartStatus, VehicleReception};
use companion::time::{Duration, Instant};
use flockmate_tests::parts::{WAYPOINT_DM, divide_waypoints};

use crate::links::{Links, one_way, partitions};

/// Most vehicles of a fleet.
pub const MOST: usize = 4;
/// Duration of a lease, ticks.
const LEASE: u64 = 3;
/// Silence after which a vehicle is lost, ticks.
const SILENT: u64 = 6;
/// Ticks within which a vehicle that has lost its lease stops.
const STOP: u64 = 1;
/// Ticks within which the fleet comes to rest.
pub const SETTLES: usize = 80;
/// The time that every clock shows between two ticks.
const NOW: Instant = Instant::from_millis(100_000);

/// Duration of `count` ticks by the clocks of this model, which count a tick as a second.
const fn ticks(count: u64) -> Duration {
    Duration::from_secs(count)
}

type ModelFleet = Fleet<MOST>;

/// An error that the search must find.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Planted {
    Nothing,
    /// Vehicles whose lease has run out photograph on, and do not land.
    LeaseIgnored,
    /// Others take a part over after four ticks of silence.
    TakenOverEarly,
    /// Silent vehicles do not count: a majority of those heard is enough.
    PresentAlone,
    /// A vehicle flies on beyond where it promised to hold.
    PromiseBroken,
}

/// Which messages arrive.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Radio {
    /// Any message may be lost by itself.
    Any,
    /// Messages over a set of one-way links, which changes at most so many times.
    Links(u8),
    /// Messages within each part of a partition, which changes at most so many times.
    Parts(u8),
}

/// Whether a vehicle flies, has landed (`Down`), or has no power (`Dead`).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Flight {
    Flies,
    Down,
    Dead,
}

/// What one vehicle knows and has done; its clock says [`NOW`].
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Vehicle {
    pub rank: usize,
    pub fleet: ModelFleet,
    pub flight: Flight,
    /// Number of divisions that its present part counts, and (`along`) waypoints of the part flown.
    pub division: usize,
    pub along: u16,
    /// Bit mask of the ranks that it heard in the last tick.
    pub hears: u32,
    /// Whether its clock is a tick slow.
    pub slow: bool,
    /// Whether it stands, and continues only to its commitment.
    pub stands: bool,
    /// Bit mask of the waypoints that it has photographed.
    pub taken: u32,
    /// Ticks since it last heard each other vehicle; counted only for [`Planted::PresentAlone`].
    pub silent: [u8; MOST],
}

/// Message that a vehicle sends in a tick.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
struct Message {
    hears: u32,
    roster: RosterReport,
}

/// What one vehicle may do in a tick.
#[derive(Clone, Copy)]
struct Choice {
    /// Whether it advances even if it stands.
    advances: bool,
    slow: bool,
    leaves: bool,
}

const BEST: Choice = Choice { advances: true, slow: false, leaves: false };

/// State of the fleet.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct State {
    /// Number of each vehicle's state in [`Known`].
    pub vehicles: [u32; MOST],
    /// Number of vehicles that may still be lost.
    pub losses: u8,
    /// Links over which messages may arrive.
    pub links: Links,
    /// Number of times that `links` may still change.
    pub changes: u8,
}

/// Next states of a vehicle, each with the number of losses that it uses up.
type Next = Arc<Vec<(u32, u8)>>;

/// Every vehicle state by number, with its message and next states, each computed once.
#[derive(Default)]
pub struct Known {
    numbers: HashMap<Vehicle, u32>,
    pub vehicles: Vec<Arc<Vehicle>>,
    /// Number of each state's message; 0: it sends none.
    sends: Vec<u32>,
    message_numbers: HashMap<Message, u32>,
    messages: Vec<Message>,
    /// Next states by the number of the vehicle's state and those of the messages that may reach
    /// it.
    next: HashMap<(u32, [u32; MOST]), Next>,
    best: HashMap<(u32, [u32; MOST]), u32>,
    /// Bit mask of the waypoints that each state may still photograph.
    owned: HashMap<u32, u32>,
    settled: HashSet<State>,
}

pub struct FleetModel {
    pub count: usize,
    pub whole: Vec<u32>,
    pub radio: Radio,
    pub losses: u8,
    /// Rank of the vehicle whose clock may be slow.
    pub slow: Option<usize>,
    pub planted: Planted,
    /// Most waypoints of a vehicle's path, which is the first stretch of a longer part.
    pub most: usize,
    pub limits: FleetTimeouts,
    /// All sets of links to which `links` may change.
    pub all_links: Vec<Links>,
    pub known: Mutex<Known>,
}

impl FleetModel {
    pub fn new(count: usize, radio: Radio, planted: Planted) -> Self {
        let silent = if planted == Planted::TakenOverEarly { 4 } else { SILENT };
        let limits = FleetTimeouts {
            lease: ticks(LEASE),
            heard_within: ticks(0),
            lost_after: ticks(silent),
            down_after: ticks(silent),
        };
        Self {
            count,
            whole: (0..count as u32 * 2).collect(),
            radio,
            losses: 2,
            slow: None,
            planted,
            most: usize::MAX,
            limits,
            all_links: match radio {
                Radio::Any => Vec::new(),
                Radio::Links(_) => one_way(count),
                Radio::Parts(_) => partitions(count),
            },
            known: Mutex::default(),
        }
    }

    /// The waypoints of a vehicle's path, and whether its part continues after them.
    fn path(&self, vehicle: &Vehicle) -> (Vec<u32>, bool) {
        let mut part =
            divide_waypoints(&self.whole, &vehicle.fleet, self.count).0.swap_remove(vehicle.rank);
        let goes_on = part.len() > self.most;
        part.truncate(self.most);
        (part, goes_on)
    }

    /// Whether a vehicle may photograph: it has its lease, or has not stopped since it lost it.
    fn flies(&self, vehicle: &Vehicle) -> bool {
        let unheard = vehicle.fleet.time_without_majority(NOW);
        vehicle.flight == Flight::Flies
            && (unheard <= ticks(LEASE + STOP) || self.planted == Planted::LeaseIgnored)
    }

    /// Number of waypoints of its part up to which a vehicle flies.
    fn end(&self, vehicle: &Vehicle) -> u16 {
        let promise =
            vehicle.fleet.commitment_dm().filter(|_| self.planted != Planted::PromiseBroken);
        promise.map_or(u16::MAX, |dm| dm / WAYPOINT_DM)
    }

    /// Bit mask of the waypoints that a vehicle may still photograph.
    fn owned(&self, vehicle: &Vehicle) -> u32 {
        if !self.flies(vehicle) {
            return 0;
        }
        let yet = self.path(vehicle).0;
        let yet = yet.iter().take(usize::from(self.end(vehicle))).skip(usize::from(vehicle.along));
        yet.fold(0, |bits, waypoint| bits | 1 << waypoint)
    }

    /// A vehicle one tick later, once these messages have reached it.
    fn step(&self, before: &Vehicle, heard: &[(usize, &Message)], choice: Choice) -> Vehicle {
        let mut vehicle = before.clone();
        if vehicle.flight == Flight::Dead {
            return vehicle;
        }
        let passed = 1 + u64::from(before.slow) - u64::from(choice.slow);
        let now = NOW + ticks(passed);
        vehicle.slow = choice.slow;
        vehicle.hears = 0;
        for (from, message) in heard {
            vehicle.hears |= 1 << from;
            vehicle.fleet.handle_roster_report(*from, &message.roster, StartStatus::Started);
        }
        if self.planted == Planted::PresentAlone {
            self.forget_silent(&mut vehicle);
        }
        let bit = |bits: u32, rank: usize| bits >> rank & 1 != 0;
        let hearing = |rank: usize| VehicleReception {
            heard_at: bit(vehicle.hears, rank).then_some(now),
            hears_us: heard.iter().any(|(from, m)| *from == rank && bit(m.hears, vehicle.rank)),
            heard_by_others: heard.iter().any(|(from, m)| *from != rank && bit(m.hears, rank)),
            heard_bits: heard.iter().find(|(from, _)| *from == rank).map_or(0, |(_, m)| m.hears),
        };
        let (path, goes_on) = self.path(&vehicle);
        let done = usize::from(vehicle.along) >= path.len();
        let lands = choice.leaves || vehicle.flight == Flight::Down || vehicle.fleet.is_excluded();
        let standing = match (lands, done && !goes_on) {
            (false, _) => ShareStatus::Alive,
            (true, false) => ShareStatus::Left,
            (true, true) => ShareStatus::Finished,
        };
        let promise = vehicle.fleet.commitment_dm();
        let own = OwnReport {
            status: standing,
            waits_for_start: false,
            airborne: true,
            path_division_count: vehicle.division,
            progress_dm: vehicle.along * WAYPOINT_DM,
            new_commitment_dm: Some((vehicle.along + 1).min(path.len() as u16) * WAYPOINT_DM),
            holds: done || promise.is_some_and(|dm| vehicle.along * WAYPOINT_DM >= dm),
            wants_division: done && goes_on,
        };
        vehicle.fleet.step(now, &own, hearing);
        if vehicle.fleet.is_division_to_be_computed() {
            let hash = divide_waypoints(&self.whole, &vehicle.fleet, self.count).1;
            vehicle.fleet.set_hash_from_plan(hash);
        }
        if vehicle.fleet.division_count() > vehicle.division {
            vehicle.division = vehicle.fleet.division_count();
            vehicle.along = 0;
        }
        let hovered = vehicle.fleet.time_without_majority(now) >= ticks(2 * LEASE);
        if lands || (hovered && self.planted != Planted::LeaseIgnored) {
            vehicle.flight = Flight::Down;
        }
        vehicle.fleet.normalise_for_search(now, NOW);
        let waypoint = self.path(&vehicle).0;
        let waypoint =
            waypoint.get(usize::from(vehicle.along)).filter(|_| vehicle.along < self.end(&vehicle));
        let promised =
            vehicle.fleet.commitment_dm().is_some_and(|dm| vehicle.along < dm / WAYPOINT_DM);
        let advances = choice.advances || !vehicle.stands || promised;
        if let Some(waypoint) = waypoint.filter(|_| advances && self.flies(&vehicle)) {
            vehicle.taken |= 1 << waypoint;
            vehicle.along += 1;
        }
        vehicle
    }

    /// Plants the error: a silent vehicle does not count any more, as if it had left.
    fn forget_silent(&self, vehicle: &mut Vehicle) {
        let mut roster = vehicle.fleet.roster_report(0);
        roster.pending_hash = 0;
        for rank in (0..self.count).filter(|rank| *rank != vehicle.rank) {
            let silent = &mut vehicle.silent[rank];
            *silent =
                if vehicle.hears >> rank & 1 != 0 { 0 } else { (*silent + 1).min(SILENT as u8) };
            if u64::from(*silent) == SILENT {
                roster.entries[rank].status = roster.entries[rank].status.max(ShareStatus::Left);
            }
        }
        for sender in (0..self.count).filter(|rank| *rank != vehicle.rank).take(1) {
            vehicle.fleet.handle_roster_report(sender, &roster, StartStatus::Started);
        }
    }

    /// The number of a vehicle's state.
    fn number(&self, known: &mut Known, vehicle: Vehicle) -> u32 {
        if let Some(number) = known.numbers.get(&vehicle) {
            return *number;
        }
        let number = known.vehicles.len() as u32;
        let sends = if vehicle.flight == Flight::Dead {
            0
        } else {
            let message = Message { hears: vehicle.hears, roster: vehicle.fleet.roster_report(0) };
            let messages = &mut known.messages;
            *known.message_numbers.entry(message).or_insert_with_key(|message| {
                messages.push(message.clone());
                messages.len() as u32
            })
        };
        known.sends.push(sends);
        known.owned.insert(number, self.owned(&vehicle));
        known.numbers.insert(vehicle.clone(), number);
        known.vehicles.push(Arc::new(vehicle));
        number
    }

    fn dead(&self, rank: usize, taken: u32) -> Vehicle {
        Vehicle {
            rank,
            fleet: ModelFleet::new(rank, self.count, self.limits),
            flight: Flight::Dead,
            division: 0,
            along: 0,
            hears: 0,
            slow: false,
            stands: false,
            taken,
            silent: [0; MOST],
        }
    }

    /// Numbers of the messages that may reach vehicle `rank`, by sender; 0: none.
    fn reach(&self, known: &Known, state: &State, rank: usize) -> [u32; MOST] {
        std::array::from_fn(|from| match state.links[rank] >> from & 1 {
            0 => 0,
            _ => known.sends[state.vehicles[from] as usize],
        })
    }

    /// All states that vehicle state `at` may have a tick later, each with the losses that it uses
    /// up.
    fn next(&self, known: &mut Known, at: u32, reach: [u32; MOST]) -> Next {
        if let Some(next) = known.next.get(&(at, reach)) {
            return next.clone();
        }
        let vehicle = known.vehicles[at as usize].clone();
        let mut all = Vec::new();
        let senders: Vec<usize> = (0..MOST).filter(|from| reach[*from] != 0).collect();
        let subsets = match self.radio {
            Radio::Any => 0..1usize << senders.len(),
            Radio::Links(_) | Radio::Parts(_) => (1 << senders.len()) - 1..1 << senders.len(),
        };
        let clocks: &[bool] =
            if self.slow == Some(vehicle.rank) { &[false, true] } else { &[false] };
        for subset in subsets.filter(|_| vehicle.flight != Flight::Dead) {
            let arrived = (0..senders.len()).filter(|k| subset >> k & 1 != 0).map(|k| senders[k]);
            let messages: Vec<(usize, Message)> = arrived
                .map(|from| (from, known.messages[reach[from] as usize - 1].clone()))
                .collect();
            let heard: Vec<(usize, &Message)> =
                messages.iter().map(|(from, m)| (*from, m)).collect();
            for &slow in clocks {
                for leaves in [false, true] {
                    if leaves && vehicle.flight == Flight::Down {
                        continue;
                    }
                    let next =
                        self.step(&vehicle, &heard, Choice { advances: false, slow, leaves });
                    all.push((self.number(known, next), u8::from(leaves)));
                }
            }
        }
        let cost = u8::from(vehicle.flight != Flight::Dead);
        all.push((self.number(known, self.dead(vehicle.rank, vehicle.taken)), cost));
        all.sort_unstable();
        all.dedup_by_key(|(number, _)| *number);
        let all = Arc::new(all);
        known.next.insert((at, reach), all.clone());
        all
    }

    /// Adds all states of the fleet a tick later to `all`.
    fn tick(&self, known: &mut Known, state: &State, all: &mut Vec<State>) {
        let from = all.len();
        all.push(*state);
        for rank in 0..self.count {
            let reach = self.reach(known, state, rank);
            let next = self.next(known, state.vehicles[rank], reach);
            for part in all.split_off(from) {
                for &(number, cost) in next.iter().filter(|(_, cost)| *cost <= part.losses) {
                    let mut vehicles = part.vehicles;
                    vehicles[rank] = number;
                    all.push(State { vehicles, losses: part.losses - cost, ..part });
                }
            }
        }
    }

    /// The state a tick later if all messages arrive, all advance, and nothing more happens.
    pub fn best(&self, known: &mut Known, state: &State) -> State {
        let mut next = *state;
        for rank in 0..self.count {
            let (at, reach) = (state.vehicles[rank], self.reach(known, state, rank));
            next.vehicles[rank] = match known.best.get(&(at, reach)) {
                Some(number) => *number,
                None => {
                    let messages: Vec<(usize, Message)> = (0..MOST)
                        .filter(|from| reach[*from] != 0)
                        .map(|from| (from, known.messages[reach[from] as usize - 1].clone()))
                        .collect();
                    let heard: Vec<(usize, &Message)> =
                        messages.iter().map(|(from, m)| (*from, m)).collect();
                    let vehicle = known.vehicles[at as usize].clone();
                    let number = self.number(known, self.step(&vehicle, &heard, BEST));
                    known.best.insert((at, reach), number);
                    number
                }
            };
        }
        next
    }

    /// Whether the fleet comes to rest from here with nothing left out, if nothing more happens.
    fn ends_well(&self, state: &State) -> bool {
        let known = &mut *self.known.lock().unwrap();
        let mut passed = Vec::new();
        let mut state = *state;
        while !known.settled.contains(&state) {
            passed.push(state);
            let next = self.best(known, &state);
            if next == state {
                let all = |f: &dyn Fn(&Vehicle) -> bool| {
                    (0..self.count).any(|rank| f(&known.vehicles[state.vehicles[rank] as usize]))
                };
                let flies = all(&|vehicle| vehicle.flight == Flight::Flies);
                let taken = (0..self.count).fold(0, |bits, rank| {
                    bits | known.vehicles[state.vehicles[rank] as usize].taken
                });
                if flies && taken.count_ones() as usize != self.whole.len() {
                    return false;
                }
                break;
            }
            if passed.len() > SETTLES {
                return false;
            }
            state = next;
        }
        known.settled.extend(passed);
        true
    }

    fn one_owner(&self, state: &State) -> bool {
        let known = &*self.known.lock().unwrap();
        let mut all = 0;
        (0..self.count).all(|rank| {
            let owned = known.owned[&state.vehicles[rank]];
            let twice = all & owned;
            all |= owned;
            twice == 0
        })
    }
}
