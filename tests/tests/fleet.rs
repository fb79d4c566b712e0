//! How whole fleets with bad radios agree on the work that lost vehicles left: random losses,
//! departures, partitions, one-way links, bursts, delays. Vehicles are points on numbered
//! waypoints; they agree by the code that flies.
//!
//! - No waypoint has two owners at a time, whatever happens.
//! - Waypoints that do not fit into a path are requested by a division, and photographed in the end
//!   as well.
//! - Nothing is left out if a majority lives and its vehicles hear each other in the end.
//! - Without loss of messages an agreement takes seconds, and no vehicle's part is given away while
//!   it is heard.
//!
//! `FLOCKMATE_FLEETS=N` draws N fleets in place of [`FLEETS`], `FLOCKMATE_FLEETS_FROM=SEED` from
//! another seed on.

use std::collections::VecDeque;

use companion::link::roster::{RosterReport, ShareStatus};
use companion::swarm::fleet::{Fleet, FleetTimeouts, OwnReport, StartStatus, VehicleReception};
use companion::time::{Duration, Instant};
use flockmate_tests::number_from_env;
use flockmate_tests::parts::{WAYPOINT_DM, divide_waypoints};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Number of fleets drawn.
const FLEETS: u64 = 400;
/// Shares of messages that are lost.
const LOSSES: [f32; 3] = [0.0, 0.1, 0.5];
/// Time after a loss is known within which vehicles that hear each other agree, in 99 of 100
/// fleets, for each of [`LOSSES`], seconds.
const AGREED_WITHIN_S: [f32; 3] = [3.0, 3.0, 5.0];
const STEP_S: f32 = 0.25;
/// Waypoints that a vehicle flies per second.
const PER_S: f32 = 0.5;
/// Duration of a stop, seconds.
const STOP_S: f32 = 3.0;
/// Time for which a vehicle hovers after its lease has run out, before it lands, seconds.
const HOVERS_S: f32 = 20.0;
const ENDS_S: f32 = 900.0;
/// Time for which a vehicle that has photographed its part flies home before it reports that it has
/// finished, and duration of its descent after that, seconds.
const HOME_S: f32 = 10.0;
const DESCENT_S: f32 = 15.0;

type ModelFleet = Fleet<8>;

struct Vehicle {
    fleet: ModelFleet,
    part: Vec<u32>,
    /// Most waypoints of its path, which is the first stretch of a longer part.
    most: usize,
    /// Number of divisions that its present part counts.
    division: usize,
    along_dm: u16,
    /// For how long it has hovered since its lease ran out, seconds.
    unheld_s: f32,
    /// For how long it has flown home, seconds.
    home_s: f32,
    /// Stopped for good: on the ground, or without power.
    down: bool,
    /// Without power: it sends and handles nothing.
    dead: bool,
    heard_at: Vec<Option<Instant>>,
    /// For each other vehicle a bit mask of the ranks that it last reported to hear.
    heard_bits: Vec<u32>,
    /// Messages under way: time of arrival (seconds), sender, ranks that the sender hears, report.
    inbox: VecDeque<(f32, usize, u32, Option<RosterReport>)>,
    /// Whether it has left its part, lands and reports that.
    left_by: bool,
}

impl Vehicle {
    /// The waypoints of its path, and whether its part continues after them.
    fn path(&self) -> (&[u32], bool) {
        (&self.part[..self.part.len().min(self.most)], self.part.len() > self.most)
    }

    /// Whether a vehicle that has photographed its part has no further part to expect.
    fn may_fly_home(&self) -> bool {
        !self.fleet.is_dividing() && self.fleet.division_count() == self.division
    }

    /// Flies home along its path, and down.
    fn fly_home(&mut self) {
        self.home_s += STEP_S;
        self.down |= self.home_s >= HOME_S;
        if self.home_s < HOME_S + DESCENT_S {
            self.along_dm = self.along_dm.saturating_add(5);
        }
    }
}

struct Outcome {
    wrong: Option<String>,
    /// Time from when the first vehicle knew of the loss until each knew that all have the same
    /// division, seconds. `None` unless exactly one is lost and links fail at random only.
    agreed_s: Option<f32>,
    loss: f32,
    /// Number of waypoints without a picture.
    left_out: usize,
    /// Whether some vehicle is still up at the end; without a majority all land.
    some_still_up: bool,
    /// Text about a division without a lost vehicle, or about a vehicle whose part others took
    /// although it was heard all the time.
    needless: Option<String>,
}

fn uniform(random: &mut Pcg32) -> f32 {
    (random.next_u32() >> 8) as f32 / (1u32 << 24) as f32
}

/// Whether vehicles obey their lease; `Ignored` is a planted error.
#[derive(Clone, Copy, PartialEq)]
enum Lease {
    Obeyed,
    Ignored,
}

fn fly(seed: u64, lease: Lease) -> Outcome {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = 2 + (random.next_u32() % 4) as usize;
    let whole: Vec<u32> = (0..count as u32 * (20 + random.next_u32() % 60)).collect();
    let loss = LOSSES[(random.next_u32() % 3) as usize];
    let delay_s = [0.05, 0.5, 1.9][(random.next_u32() % 3) as usize];
    let deaf = |random: &mut Pcg32| uniform(random) < 0.1;
    // One-way links that fail for good, and a partition for a while.
    let fails: Vec<Vec<bool>> =
        (0..count).map(|_| (0..count).map(|_| deaf(&mut random)).collect()).collect();
    let apart = (uniform(&mut random) < 0.5).then(|| {
        let from_s = 300.0 * uniform(&mut random);
        (from_s, from_s + 120.0 * uniform(&mut random), random.next_u32())
    });
    // In every second fleet messages are lost one by one only.
    let clean = seed.is_multiple_of(2);
    let (delay_s, apart) = if clean { (0.05, None) } else { (delay_s, apart) };
    let losses: Vec<(f32, usize, bool)> = (0..random.next_u32() % 3)
        .map(|_| {
            (
                10.0 + if clean { 50.0 } else { 200.0 } * uniform(&mut random),
                (random.next_u32() as usize) % count,
                uniform(&mut random) < if clean { 0.7 } else { 0.3 },
            )
        })
        .collect();
    // Every third fleet has more to photograph than fits into its paths.
    let most =
        if seed.is_multiple_of(3) { whole.len().div_ceil(count) * 3 / 5 } else { usize::MAX };
    let zero = Instant::ZERO;
    let mut vehicles: Vec<Vehicle> = (0..count)
        .map(|own| {
            let mut fleet =
                ModelFleet::new(own, count, FleetTimeouts::of_flight(Duration::from_secs(60)));
            fleet.begin_flight(zero);
            let part = divide_waypoints(&whole, &fleet, count).0.swap_remove(own);
            Vehicle {
                fleet,
                part,
                most,
                division: 0,
                along_dm: 0,
                unheld_s: 0.0,
                home_s: 0.0,
                down: false,
                dead: false,
                heard_at: vec![None; count],
                heard_bits: vec![0; count],
                inbox: VecDeque::new(),
                left_by: false,
            }
        })
        .collect();
    let mut taken = vec![false; whole.len()];
    let (mut detected_s, mut agreed_s) = (None, None);
    let mut wrong = None;
    let mut step = 0u32;
    while (step as f32) * STEP_S < ENDS_S {
        let t_s = step as f32 * STEP_S;
        let now = Instant::from_millis((t_s * 1000.0) as u64);
        for &(at_s, rank, leaves) in &losses {
            if at_s <= t_s && t_s < at_s + STEP_S {
                if leaves {
                    vehicles[rank].left_by = true;
                } else {
                    (vehicles[rank].dead, vehicles[rank].down) = (true, true);
                }
            }
        }
        for (own, vehicle) in vehicles.iter_mut().enumerate() {
            if vehicle.dead {
                continue;
            }
            while vehicle.inbox.front().is_some_and(|(at_s, ..)| *at_s <= t_s) {
                let (_, from, bits, roster) = vehicle.inbox.pop_front().expect("there is one");
                vehicle.heard_at[from] = Some(now);
                vehicle.heard_bits[from] = bits;
                if let Some(roster) = roster {
                    vehicle.fleet.handle_roster_report(from, &roster, StartStatus::Started);
                }
            }
            let fresh =
                |at: Option<Instant>| at.is_some_and(|at| now - at <= Duration::from_secs(1));
            let (heard_at, bits) = (vehicle.heard_at.clone(), vehicle.heard_bits.clone());
            let hearing = |rank: usize| VehicleReception {
                heard_at: heard_at[rank],
                hears_us: bits[rank] >> own & 1 != 0,
                heard_by_others: (0..count)
                    .any(|j| j != rank && fresh(heard_at[j]) && bits[j] >> rank & 1 != 0),
                heard_bits: bits[rank],
            };
            let at = usize::from(vehicle.along_dm / WAYPOINT_DM);
            let (path, goes_on) = vehicle.path();
            let length = path.len();
            let (done, asks) = (at >= length, goes_on && at + 5 >= length);
            // In the other fleets each vehicle waits at the end of its part.
            let flies_home = vehicle.home_s > 0.0 || done && vehicle.may_fly_home();
            if (seed / 2).is_multiple_of(2) && flies_home {
                vehicle.fly_home();
            }
            let ends = vehicle.left_by || vehicle.down || vehicle.fleet.is_excluded();
            let standing = match (ends, done && !goes_on) {
                (false, _) => ShareStatus::Alive,
                (true, false) => ShareStatus::Left,
                (true, true) => ShareStatus::Finished,
            };
            vehicle.down |= ends;
            let stop_dm =
                vehicle.along_dm.saturating_add((STOP_S * PER_S * f32::from(WAYPOINT_DM)) as u16);
            // On its path home a vehicle commits to a place beyond its waypoints.
            let last_dm = if goes_on { length as u16 * WAYPOINT_DM } else { u16::MAX };
            let promise_dm = stop_dm.next_multiple_of(WAYPOINT_DM).min(last_dm);
            let holds =
                vehicle.fleet.commitment_dm().is_some_and(|dm| vehicle.along_dm >= dm || done);
            let own_view = OwnReport {
                status: standing,
                waits_for_start: false,
                airborne: true,
                path_division_count: vehicle.division,
                progress_dm: vehicle.along_dm,
                new_commitment_dm: Some(promise_dm),
                holds,
                wants_division: asks,
            };
            vehicle.fleet.step(now, &own_view, hearing);
            if vehicle.fleet.is_dividing() {
                detected_s.get_or_insert(t_s);
            }
            if vehicle.fleet.is_division_to_be_computed() {
                let hash = divide_waypoints(&whole, &vehicle.fleet, count).1;
                vehicle.fleet.set_hash_from_plan(hash);
            }
            if vehicle.fleet.division_count() > vehicle.division {
                vehicle.division = vehicle.fleet.division_count();
                // The new part counts no division that is still under way.
                vehicle.part = counted_parts(&whole, &vehicle.fleet, count).swap_remove(own);
                (vehicle.along_dm, vehicle.home_s) = (0, 0.0);
            }
            if vehicle.down {
                continue;
            }
            if lease == Lease::Ignored || vehicle.fleet.has_lease(now) {
                vehicle.unheld_s = 0.0;
                let most = vehicle.fleet.commitment_dm().unwrap_or(u16::MAX);
                let next =
                    (vehicle.along_dm + (PER_S * STEP_S * f32::from(WAYPOINT_DM)) as u16).min(most);
                for k in vehicle.along_dm / WAYPOINT_DM..next / WAYPOINT_DM {
                    if let Some(waypoint) = vehicle.path().0.get(usize::from(k)) {
                        taken[*waypoint as usize] = true;
                    }
                }
                vehicle.along_dm = vehicle.along_dm.max(next);
            } else {
                vehicle.unheld_s += STEP_S;
                vehicle.down |= vehicle.unheld_s > HOVERS_S;
            }
        }
        wrong = wrong.or_else(|| {
            owned_twice(&vehicles, &whole, lease, now)
                .map(|what| format!("seed {seed}, {t_s} s: {what}"))
        });
        if let Some(detected_s) = detected_s
            && vehicles
                .iter()
                .filter(|v| !v.down)
                .all(|v| v.division > 0 || has_all_hashes(&v.fleet))
        {
            agreed_s.get_or_insert(t_s - detected_s);
        }
        // Intents are sent every 0.25 s, rosters every 0.5 s, while dividing as often as intents.
        for own in 0..count {
            if vehicles[own].dead {
                continue;
            }
            let bits = (0..count).filter(|j| {
                vehicles[own].heard_at[*j].is_some_and(|at| now - at <= Duration::from_millis(800))
            });
            let bits = bits.fold(0u32, |bits, j| bits | 1 << j);
            let due = step.is_multiple_of(2) || vehicles[own].fleet.is_dividing();
            let roster = due.then(|| vehicles[own].fleet.roster_report(0));
            for (to, vehicle) in vehicles.iter_mut().enumerate() {
                let cut = apart.is_some_and(|(from_s, to_s, side)| {
                    (from_s..to_s).contains(&t_s) && (side >> own & 1) != (side >> to & 1)
                });
                if to == own || cut || (!clean && fails[own][to]) || uniform(&mut random) < loss {
                    continue;
                }
                let at_s =
                    t_s + delay_s * if clean { 1.0 } else { 0.5 + 0.5 * uniform(&mut random) };
                vehicle.inbox.push_back((at_s, own, bits, roster.clone()));
            }
        }
        step += 1;
    }
    let alive = vehicles.iter().filter(|vehicle| !vehicle.down).count();
    if number_from_env("FLOCKMATE_FLEET_SHOWN", 0) != 0 {
        println!(
            "seed {seed}: loss {loss} delay {delay_s} apart {apart:?} losses {losses:?} fails {fails:?}"
        );
        for vehicle in &vehicles {
            println!(
                "{} of {} down {} dead {} excluded {} {:?}\n",
                vehicle.along_dm / WAYPOINT_DM,
                vehicle.part.len(),
                vehicle.down,
                vehicle.dead,
                vehicle.fleet.is_excluded(),
                vehicle.fleet
            );
        }
    }
    let lost = |rank: usize| losses.iter().any(|(_, lost, _)| *lost == rank);
    Outcome {
        wrong,
        agreed_s: agreed_s.filter(|_| clean && losses.len() == 1 && most == usize::MAX),
        loss,
        left_out: taken.iter().filter(|taken| !**taken).count(),
        some_still_up: alive > 0,
        needless: vehicles.iter().enumerate().filter(|_| clean).find_map(|(rank, vehicle)| {
            let given_away = vehicle.fleet.is_excluded() && !lost(rank);
            // If half of the messages are lost, others' reports about a vehicle may arrive before
            // its own.
            let needless = given_away
                || (loss < 0.5
                    && most == usize::MAX
                    && vehicle.fleet.division_count() > losses.len());
            needless.then(|| {
                format!("seed {seed}, vehicle {rank}: given away {given_away}, {:?}", vehicle.fleet)
            })
        }),
    }
}

/// Whether the vehicle knows that all living vehicles have computed the same division.
fn has_all_hashes(fleet: &ModelFleet) -> bool {
    let roster = fleet.roster_report(0);
    roster.pending_hash != 0
        && roster.entries.iter().all(|e| e.status != ShareStatus::Alive || e.agrees)
}

/// Each vehicle's part by the divisions that count, without one under way.
fn counted_parts(whole: &[u32], fleet: &ModelFleet, count: usize) -> Vec<Vec<u32>> {
    assert!(!fleet.is_division_to_be_computed(), "what begins to count leaves nothing under way");
    divide_waypoints(whole, fleet, count).0
}

/// Text about a waypoint that two vehicles may still photograph; `None` without one.
fn owned_twice(vehicles: &[Vehicle], whole: &[u32], lease: Lease, now: Instant) -> Option<String> {
    let mut owner = vec![None; whole.len()];
    for (rank, vehicle) in vehicles.iter().enumerate() {
        if vehicle.down || (lease == Lease::Obeyed && !vehicle.fleet.has_lease(now)) {
            continue;
        }
        let end =
            vehicle.fleet.commitment_dm().map_or(usize::MAX, |dm| usize::from(dm / WAYPOINT_DM));
        let from = usize::from(vehicle.along_dm / WAYPOINT_DM);
        for waypoint in vehicle.path().0.iter().take(end).skip(from) {
            if let Some(other) = owner[*waypoint as usize].replace(rank) {
                return Some(format!(
                    "waypoint {waypoint} is vehicle {other}'s and vehicle {rank}'s"
                ));
            }
        }
    }
    None
}

#[test]
fn no_waypoint_has_two_owners_and_none_is_left_out() {
    let (from, count) =
        (number_from_env("FLOCKMATE_FLEETS_FROM", 0), number_from_env("FLOCKMATE_FLEETS", FLEETS));
    let all: Vec<Outcome> =
        (from..from + count).into_par_iter().map(|seed| fly(seed, Lease::Obeyed)).collect();
    let wrong: Vec<&String> = all.iter().filter_map(|outcome| outcome.wrong.as_ref()).collect();
    let left_out: Vec<usize> =
        (0..all.len()).filter(|i| all[*i].left_out > 0 && all[*i].some_still_up).collect();
    println!(
        "{count} fleets: {} with two owners, {} with waypoints left out though somebody flew on",
        wrong.len(),
        left_out.len()
    );
    for (loss, most_s) in LOSSES.into_iter().zip(AGREED_WITHIN_S) {
        let of = all.iter().filter(|outcome| outcome.loss == loss);
        let mut agreed: Vec<f32> = of.filter_map(|outcome| outcome.agreed_s).collect();
        agreed.sort_by(f32::total_cmp);
        let p99 = agreed.get(agreed.len().saturating_sub(1) * 99 / 100);
        println!(
            "{loss} of messages lost: agreed within {p99:?} s, 99th percentile of {}",
            agreed.len()
        );
        // A single fleet has no 99th percentile.
        assert!(count < FLEETS || p99.is_some_and(|p99| *p99 <= most_s), "{loss}: {p99:?}");
    }
    println!("left out: {:?}", &left_out[..left_out.len().min(20)]);
    assert!(wrong.is_empty(), "{:#?}", &wrong[..wrong.len().min(5)]);
    assert!(left_out.is_empty());
    let needless: Vec<&String> =
        all.iter().filter_map(|outcome| outcome.needless.as_ref()).collect();
    assert!(
        needless.is_empty(),
        "{} needless, {:#?}",
        needless.len(),
        &needless[..needless.len().min(2)]
    );
}

/// The test detects the planted error that it is made for.
#[test]
fn vehicles_that_fly_on_without_their_lease_are_found() {
    let wrong = |seed: &u64| fly(*seed, Lease::Ignored).wrong.is_some();
    let found = (0..FLEETS).into_par_iter().filter(wrong).count();
    println!("{found} of {FLEETS} fleets have a waypoint with two owners");
    assert!(found > 0);
}

/// The fleet model found that a vehicle flew on in this case, while another one already counted on
/// its commitment.
#[test]
fn a_promise_binds_though_the_lost_vehicle_turns_out_to_have_finished() {
    let mut fleet = ModelFleet::new(1, 3, FleetTimeouts::of_flight(Duration::from_secs(60)));
    fleet.begin_flight(Instant::ZERO);
    let own = OwnReport { new_commitment_dm: Some(WAYPOINT_DM), ..OwnReport::default() };
    let step = |fleet: &mut ModelFleet, at_s: u64, heard: usize| {
        let now = Instant::from_millis(1000 * at_s);
        let hears = VehicleReception {
            heard_at: Some(now),
            hears_us: true,
            heard_bits: u32::MAX,
            ..VehicleReception::default()
        };
        fleet.step(
            now,
            &own,
            |rank| if rank == heard { hears } else { VehicleReception::default() },
        );
    };
    (1..50).for_each(|at_s| step(&mut fleet, at_s, 0));
    assert_eq!(fleet.commitment_dm(), Some(WAYPOINT_DM), "vehicle 2 is lost");
    let mut finished = fleet.roster_report(0);
    finished.entries[2].status = ShareStatus::Finished;
    fleet.handle_roster_report(2, &finished, StartStatus::Started);
    step(&mut fleet, 50, 2);
    assert_eq!(fleet.commitment_dm(), Some(WAYPOINT_DM));
}
