//! Relayed progress reaches vehicles out of range, and is never more than was reported.

extern crate std;
use std::vec::Vec as List;

use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::super::LOST_AFTER;
use super::*;
use crate::config::RosterEntry;
use crate::link::intent::{Intent, ON_PLAN};
use planner_core::Point;

/// CRC of the mission file.
const MISSION: u32 = 7;
/// CRC of the plan.
const PLAN: u32 = 9;
/// Time of one step of [`Swarm`].
const STEP_MS: u64 = 200;

fn padded(relay: &Relay) -> [u8; 255] {
    let (mut out, mut padded) = ([0; MAX_LEN], [0; 255]);
    let len = relay.encode(5, &mut out);
    padded[..len].copy_from_slice(&out[..len]);
    padded
}

#[test]
fn comes_back_as_sent_and_refuses_the_unsound() {
    for count in 0..=MAX_RELAYED as u8 {
        let item = |rank: u8| RelayedProgress {
            rank,
            age_ticks: 9 * rank,
            progress_m: 0.5 * f32::from(rank) - 3.0,
            gates_open_up_to_m: 1.25 * f32::from(rank) - 3.0,
            unheard_flight_delay_s: rank,
        };
        let items = (0..count).map(item).collect();
        let relay = Relay { mission_crc: 1, plan_crc: 2, items };
        assert_eq!(Relay::decode(&padded(&relay), 5), Some(relay.clone()));
        assert_eq!(Relay::decode(&padded(&relay), 6), None, "another sender");
        for (at, value) in [(0, 0), (5, 9), (7, count + 1)] {
            let mut bad = padded(&relay);
            bad[at] = value;
            assert_eq!(Relay::decode(&bad, 5), None, "byte {at}");
        }
    }
    let sound = RelayedProgress {
        rank: 0,
        age_ticks: 0,
        progress_m: 1.0,
        gates_open_up_to_m: 2.0,
        unheard_flight_delay_s: 0,
    };
    for item in [
        RelayedProgress { progress_m: f32::NAN, ..sound },
        RelayedProgress { gates_open_up_to_m: f32::NAN, ..sound },
        RelayedProgress { gates_open_up_to_m: f32::INFINITY, ..sound },
    ] {
        let relay =
            Relay { mission_crc: 1, plan_crc: 2, items: [sound, item].into_iter().collect() };
        assert_eq!(Relay::decode(&padded(&relay), 5), None);
    }
}

/// A swarm in a row: each vehicle hears only those next to it; the progress of each grows with
/// time.
struct Swarm {
    /// What each vehicle knows of the others, by rank.
    tables: List<Neighbours<8>>,
    now: Instant,
}

impl Swarm {
    fn new(count: u8) -> Self {
        let entry = |id: u8| RosterEntry { system_id: id, path_start: Point::zeros() };
        let roster: List<_> = (1..=count).map(entry).collect();
        let tables = (1..=count).map(|id| Neighbours::new(&roster, id, 2.0, 2.0)).collect();
        Self { tables, now: Instant::from_millis(1000) }
    }

    fn progress_m(&self, rank: usize) -> f32 {
        self.now.as_micros() as f32 * 1e-6 + rank as f32
    }

    fn step(&mut self, on_plan: &[bool], lost: &[bool]) {
        self.now = self.now + Duration::from_millis(STEP_MS);
        for from in 0..self.tables.len() {
            let intent = Intent {
                system_id: from as u8 + 1,
                flags: if on_plan[from] { ON_PLAN } else { 0 },
                mission_crc: MISSION,
                plan_crc: PLAN,
                progress_m: self.progress_m(from),
                heard_bits: self.tables[from].heard_bits(self.now),
                ..Intent::default()
            };
            let relay = self.tables[from].next_relay(self.now, MISSION, PLAN);
            for to in [from.wrapping_sub(1), from + 1] {
                let Some(table) = self.tables.get_mut(to).filter(|_| !lost[from]) else { continue };
                table.handle_intent(self.now, to as u16, &intent, MISSION, Some(PLAN));
                table.handle_relay(self.now, intent.system_id, &relay);
            }
        }
    }

    /// Progress, metres, that vehicle `of` takes vehicle `other` to have surely made; both by rank.
    /// `None` if it has heard of none.
    fn believed_m(&mut self, of: usize, other: usize) -> Option<f32> {
        let (now, id) = (self.now, other as u8 + 1);
        self.tables[of].states_with_age(now).iter().find(|n| n.id == id).and_then(|n| n.progress_m)
    }
}

proptest! {
    #[test]
    fn progress_comes_to_the_far_end_and_is_never_too_great(
        count in 3..8_u8, lost in proptest::collection::vec(0..4_u8, 8 * 60),
    ) {
        let mut swarm = Swarm::new(count);
        for step in 0..60 {
            let lost: List<_> = lost[step * 8..].iter().take(8).map(|draw| *draw == 0).collect();
            swarm.step(&[true; 8], &lost);
            for (of, other) in
                (0..usize::from(count)).flat_map(|a| (0..usize::from(count)).map(move |b| (a, b)))
            {
                if let (true, Some(believed_m)) = (of != other, swarm.believed_m(of, other)) {
                    prop_assert!(believed_m <= swarm.progress_m(other) + 1e-3);
                }
            }
        }
        let (last, true_m) = (usize::from(count) - 1, swarm.progress_m(0));
        let believed_m = swarm.believed_m(last, 0);
        prop_assert!(believed_m.is_some_and(|m| m > true_m - 10.0), "{believed_m:?} of {true_m}");
    }
}

#[test]
fn a_vehicle_that_was_heard_off_the_plan_is_not_believed_back_onto_it() {
    let mut swarm = Swarm::new(3);
    (0..30).for_each(|_| swarm.step(&[true; 3], &[false; 3]));
    assert!(swarm.believed_m(2, 0).is_some() && swarm.believed_m(1, 0).is_some());
    // Only the middle vehicle hears that the first left the plan; then nobody hears the first any
    // more.
    swarm.step(&[false, true, true], &[false; 3]);
    (0..30).for_each(|_| swarm.step(&[true; 3], &[true, false, false]));
    assert_eq!(swarm.believed_m(1, 0), None);
    let held_m = swarm.believed_m(2, 0);
    assert!(held_m.is_some_and(|m| m < swarm.progress_m(0) - 5.0), "{held_m:?}");
}

/// Progress that was heard of a vehicle stays known, and is passed on, when the vehicle is no
/// longer heard: perhaps nobody relayed it before.
#[test]
fn progress_outlives_the_sight_of_a_vehicle() {
    let mut rng = Pcg32::seed_from_u64(11);
    for _ in 0..200 {
        let count = 3 + rng.next_u32() as u8 % 4;
        let mut swarm = Swarm::new(count);
        let together = 1 + rng.next_u32() % 20;
        (0..together).for_each(|_| swarm.step(&[true; 8], &[false; 8]));
        let last_m = swarm.progress_m(0) - 0.2;
        let before_m = swarm.believed_m(1, 0).unwrap();
        // The first vehicle leaves the range of all.
        let lost: List<_> = (0..8).map(|i| i == 0).collect();
        let apart = 1 + rng.next_u32() % 100;
        for _ in 0..apart {
            swarm.step(&[true; 8], &lost);
            let held_m = swarm.believed_m(1, 0);
            assert!(
                held_m.is_some_and(|m| before_m <= m && m <= last_m + 0.3),
                "{held_m:?} of {before_m}"
            );
        }
        if apart > 40 {
            let passed_on_m = swarm.believed_m(usize::from(count) - 1, 0);
            assert!(passed_on_m.is_some_and(|m| m <= last_m + 0.3), "{passed_on_m:?}");
        }
    }
}

/// Vehicles that heard a failed vehicle for just as long pass on its last report: that does not
/// make it a vehicle that flies on out of range.
#[test]
fn a_vehicle_that_fails_is_not_out_of_range_to_those_that_heard_it() {
    let mut rng = Pcg32::seed_from_u64(12);
    for _ in 0..200 {
        let count = 3 + rng.next_u32() as u8 % 4;
        let mut swarm = Swarm::new(count);
        (0..20 + rng.next_u32() % 20).for_each(|_| swarm.step(&[true; 8], &[false; 8]));
        let lost: List<_> = (0..8).map(|i| i == 0).collect();
        let mut far_to_others = false;
        for _ in 0..60 {
            swarm.step(&[true; 8], &lost);
            let far = |of: usize| swarm.tables[of].entries[0].is_reported_out_of_range(swarm.now);
            assert!(!far(1), "it was heard until it failed");
            far_to_others |= far(2);
        }
        assert!(far_to_others, "another was out of its range all the while");
    }
}

/// How far a vehicle flies unheard, and its delay, belong to the progress with which they came: a
/// report of lower progress changes neither.
#[test]
fn the_delay_of_a_flight_goes_with_its_progress() {
    let roster = [1, 2, 3].map(|system_id| RosterEntry { system_id, path_start: Point::zeros() });
    let mut table = Neighbours::<8>::new(&roster, 3, 2.0, 2.0);
    let (first, second) = (Instant::from_millis(1000), Instant::from_millis(1100));
    let by = Intent {
        system_id: 2,
        flags: ON_PLAN,
        mission_crc: MISSION,
        plan_crc: PLAN,
        ..Intent::default()
    };
    table.handle_intent(first, 2, &by, MISSION, Some(PLAN));
    let report = |progress_m, unheard_flight_delay_s| {
        let item = RelayedProgress {
            rank: 0,
            age_ticks: 0,
            progress_m,
            gates_open_up_to_m: 20.0,
            unheard_flight_delay_s,
        };
        Relay { mission_crc: MISSION, plan_crc: PLAN, items: [item].into_iter().collect() }
    };
    table.handle_relay(first, 2, &report(5.0, 0));
    table.handle_relay(second, 2, &report(7.0, 10));
    table.handle_relay(second, 2, &report(6.0, 0));
    let believed_m = |after_s: u64, table: &mut Neighbours<8>| {
        let state = table
            .states_with_age(second + Duration::from_secs(after_s))
            .iter()
            .find(|n| n.id == 1)
            .copied();
        state.and_then(|n| n.progress_m).unwrap()
    };
    assert_eq!(believed_m(12, &mut table), 7.0);
    assert!(believed_m(16, &mut table) > 8.0);
}

/// However late messages are: what two vehicles relay to each other of a third one, which failed,
/// does not keep that report young.
#[test]
fn a_vehicle_that_fails_is_lost_in_time_though_messages_are_late() {
    let mut rng = Pcg32::seed_from_u64(13);
    for case in 0..100 {
        let mut swarm = Swarm::new(3);
        (0..10).for_each(|_| swarm.step(&[true; 3], &[true, false, false]));
        let delay_ms = 50 + u64::from(rng.next_u32() % 950);
        let failed_at = swarm.now;
        let mut late = List::new();
        // Vehicle 1 hears neither vehicle 2 nor 3, so these two relay what they know of each other
        // and of vehicle 1. Both heard vehicle 1 up to now.
        for of in [1, 2] {
            let delays = &mut swarm.tables[of];
            let heard = Intent {
                system_id: 1,
                flags: ON_PLAN,
                mission_crc: MISSION,
                plan_crc: PLAN,
                progress_m: 5.0,
                ..Intent::default()
            };
            delays.handle_intent(failed_at, 9, &heard, MISSION, Some(PLAN));
        }
        while swarm.now < failed_at + LOST_AFTER + Duration::from_secs(3) {
            swarm.now = swarm.now + Duration::from_millis(50);
            let now = swarm.now;
            if now.as_micros() % 1_000_000 < 50_000 {
                for from in [1, 2] {
                    let intent = Intent {
                        system_id: from as u8 + 1,
                        flags: ON_PLAN,
                        mission_crc: MISSION,
                        plan_crc: PLAN,
                        heard_bits: swarm.tables[from].heard_bits(now),
                        ..Intent::default()
                    };
                    let relay = swarm.tables[from].next_relay(now, MISSION, PLAN);
                    late.push((now + Duration::from_millis(delay_ms), 3 - from, intent, relay));
                }
            }
            late.retain(|(due, to, intent, relay)| {
                if *due <= now {
                    let sequence = (now.as_micros() / 50_000) as u16;
                    let table = &mut swarm.tables[*to];
                    table.handle_intent(now, sequence, intent, MISSION, Some(PLAN));
                    let by = table.roster_index(intent.system_id).expect("of the roster");
                    table.entries[by].message_delay.delay_s = delay_ms as f32 * 1e-3;
                    table.handle_relay(now, intent.system_id, relay);
                }
                *due > now
            });
        }
        for of in [1, 2] {
            assert!(swarm.tables[of].entries[0].is_dead(swarm.now), "{case}: {delay_ms} ms");
        }
    }
}
