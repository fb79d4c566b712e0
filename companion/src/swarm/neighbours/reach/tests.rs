//! Vehicles in a row, each of which follows the one before it through gates, lose radio contact:
//! the progress that each assumes of the others is never more than they have flown, and it is
//! enough for the whole row to reach its end.

extern crate std;
use std::vec::Vec as List;

use planner_core::Point;
use planner_core::flight::MAX_REPORTED_PROGRESS_LAG_M;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::config::RosterEntry;
use crate::link::intent::{Intent, ON_PLAN};
use crate::time::Duration;

/// CRC of the mission file.
const MISSION: u32 = 7;
/// CRC of the plan.
const PLAN: u32 = 9;
/// Time of a step, milliseconds.
const STEP_MS: u64 = 200;
/// Time of a step, seconds.
const STEP_S: f32 = 0.2;
const CRUISE_MPS: f32 = 2.0;
/// Distance between a vehicle's gates, metres.
const GATES_M: f32 = 1.4;
/// A gate opens once the vehicle ahead has passed it by this distance, metres.
const AHEAD_M: f32 = 3.0;

/// A row of vehicles.
struct Row {
    /// What each vehicle knows of the others.
    tables: List<Neighbours<8>>,
    /// Cruise speed of each.
    cruise_mps: List<f32>,
    /// True progress of each, metres.
    flown_m: List<f32>,
    /// Present speed of each, which changes at random.
    pace_mps: List<f32>,
    /// Gates of each.
    gates: List<List<Gate>>,
    /// Length of each path, metres.
    length_m: f32,
    now: Instant,
    rng: Pcg32,
}

impl Row {
    /// Vehicles that fly at these speeds at most.
    fn new(cruise_mps: &[f32], length_m: f32, seed: u64) -> Self {
        let count = cruise_mps.len() as u8;
        let fold = |f: fn(f32, f32) -> f32| cruise_mps.iter().copied().reduce(f).expect("a row");
        let (slowest_vehicle_mps, fastest_vehicle_mps) = (fold(f32::min), fold(f32::max));
        let entry = |id: u8| RosterEntry { system_id: id, path_start: Point::zeros() };
        let roster: List<_> = (1..=count).map(entry).collect();
        let gate = |id: u8, at_m: f32| Gate {
            at_m,
            wait_for_id: id,
            open_from_progress_m: at_m + AHEAD_M,
        };
        let gates = |rank: u8| {
            let most_m =
                if rank == 0 { 0.0 } else { length_m - AHEAD_M - MAX_REPORTED_PROGRESS_LAG_M };
            let places = (0..100).map(|i| i as f32 * GATES_M).take_while(|at_m| *at_m < most_m);
            places.map(|at_m| gate(rank, at_m)).collect()
        };
        Self {
            tables: (1..=count)
                .map(|id| Neighbours::new(&roster, id, slowest_vehicle_mps, fastest_vehicle_mps))
                .collect(),
            cruise_mps: cruise_mps.to_vec(),
            flown_m: (0..count).map(|_| 0.0).collect(),
            pace_mps: cruise_mps.iter().map(|mps| 0.45 * mps).collect(),
            gates: (0..count).map(gates).collect(),
            length_m,
            now: Instant::from_millis(1000),
            rng: Pcg32::seed_from_u64(seed),
        }
    }

    fn draw(&mut self) -> f32 {
        self.rng.next_u32() as f32 / u32::MAX as f32
    }

    /// Gates of a vehicle that are still closed.
    fn closed(&self, rank: usize) -> &[Gate] {
        let gates = &self.gates[rank];
        let open = gates
            .iter()
            .take_while(|gate| self.tables[rank].is_open_for_good(gate, self.now))
            .count();
        &gates[open..]
    }

    fn intent(&self, rank: usize) -> Intent {
        let progress_m = self.flown_m[rank];
        let (closed_m, delay_s) =
            self.tables[rank].own_unheard_reach(self.closed(rank), progress_m, self.now);
        Intent {
            system_id: rank as u8 + 1,
            flags: ON_PLAN,
            mission_crc: MISSION,
            plan_crc: PLAN,
            progress_m,
            gates_open_up_to_m: closed_m.min(self.length_m),
            unheard_flight_delay_s: delay_s,
            heard_bits: self.tables[rank].heard_bits(self.now),
            ..Intent::default()
        }
    }

    /// All fly on for a step, up to their next closed gate.
    fn fly(&mut self) {
        self.now = self.now + Duration::from_millis(STEP_MS);
        for rank in 0..self.tables.len() {
            let stop_m = self.closed(rank).first().map_or(self.length_m, |gate| gate.at_m);
            if self.draw() < 0.04 {
                self.pace_mps[rank] = self.cruise_mps[rank] * (0.425 + 0.55 * self.draw());
            }
            let pace_mps = self.pace_mps[rank];
            let flown_m = &mut self.flown_m[rank];
            *flown_m = flown_m.max((*flown_m + pace_mps * STEP_S).min(stop_m).min(self.length_m));
        }
    }

    /// Each vehicle hears its neighbours in the row, except for a quarter of their messages.
    fn hear(&mut self) {
        for from in 0..self.tables.len() {
            let intent = self.intent(from);
            let relay = self.tables[from].next_relay(self.now, MISSION, PLAN);
            for to in [from.wrapping_sub(1), from + 1] {
                let lost = self.draw() < 0.25;
                let Some(table) = self.tables.get_mut(to).filter(|_| !lost) else { continue };
                table.handle_intent(self.now, to as u16, &intent, MISSION, Some(PLAN));
                table.handle_relay(self.now, intent.system_id, &relay);
            }
        }
    }

    fn check(&mut self) {
        for of in 0..self.tables.len() {
            for state in self.tables[of].states_with_age(self.now).iter() {
                let (other, believed_m) =
                    (usize::from(state.id) - 1, state.progress_m.unwrap_or(0.0));
                let flown_m = self.flown_m[other];
                assert!(
                    believed_m <= flown_m + 0.01,
                    "{of} believes {believed_m} of {other} at {flown_m}"
                );
            }
        }
    }
}

#[test]
fn no_vehicle_is_reckoned_to_be_further_than_it_is() {
    let mut rng = Pcg32::seed_from_u64(3);
    for seed in 0..300 {
        let mut cruise_mps = [CRUISE_MPS; 6];
        if seed % 2 == 1 {
            cruise_mps.fill_with(|| 0.5 + (rng.next_u32() % 40) as f32 * 0.1);
        }
        let cruise_mps = &cruise_mps[..2 + rng.next_u32() as usize % 5];
        let mut row = Row::new(cruise_mps, 20.0 + (rng.next_u32() % 40) as f32, seed);
        let parts = rng.next_u32() % 60;
        for step in 0..300 {
            row.fly();
            if step < parts || (step > parts + 40 && step < parts + 50) {
                row.hear();
            }
            row.check();
        }
    }
}

#[test]
fn rows_that_lose_one_another_come_to_their_ends() {
    let arrives = |seed: &u64| {
        let mut row = Row::new(&[CRUISE_MPS; 4][..2 + *seed as usize % 3], 20.0, *seed);
        for step in 0..300 {
            row.fly();
            if step < 50 {
                row.hear();
            }
        }
        row.flown_m.iter().all(|m| *m >= 20.0)
    };
    let arrived = (0..200).filter(arrives).count();
    assert!(arrived >= 175, "{arrived} of 200");
}
