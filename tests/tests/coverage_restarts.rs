//! Coverage missions in which some vehicles land and stay powered while others are restarted and
//! flown again, and in which vehicles come up one after the other: nothing is left out, and no
//! vehicle is kept on its pad because of another vehicle's report of an earlier flight.
//!
//! `FLOCKMATE_RESTARTED=N` flies N missions of each kind in place of [`MISSIONS`],
//! `FLOCKMATE_RESTARTED_FROM=SEED` from another seed on.

use std::fmt::Write as _;

use flockmate_tests::areas::SMALL_FIELD_SCENARIO;
use flockmate_tests::{covered, number_from_env};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::result::MissionResult;
use host_sim::scenario;
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

const MISSIONS: u64 = 8;
const START_CANCELLED: &str = "Its part was given away: start cancelled";

fn fly(text: &str) -> (MissionResult, String) {
    let scenario = scenario::parse(text, "area").expect("a scenario");
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden()).expect("a plan");
    let (result, log) = covered::fly(&mut mission).expect("a flight");
    (result, covered::log_lines(&log))
}

fn fault(lines: &mut String, kind: &str, vehicle: u32, at_s: u32) {
    let _ = write!(lines, "[[faults]]\nkind = \"{kind}\"\nvehicle = {vehicle}\nat_s = {at_s}.0\n");
}

/// All vehicles are commanded home, together or one after the other, so that those in the air
/// divide what is left; once all are down, some are restarted together.
fn restarted(seed: u64) -> String {
    let mut random = Pcg32::seed_from_u64(seed);
    let mut text = SMALL_FIELD_SCENARIO.replace("id =", "endurance_s = 4000.0\nid =");
    let together = random.next_u32().is_multiple_of(2);
    let mut at_s = 30 + random.next_u32() % 60;
    for vehicle in 1..=3 {
        fault(&mut text, "return-order", vehicle, at_s);
        at_s += if together { 0 } else { 20 + random.next_u32() % 30 };
    }
    let some = 1 + random.next_u32() % 6;
    for vehicle in (1..=3).filter(|vehicle| some >> (vehicle - 1) & 1 != 0) {
        fault(&mut text, "companion-reset", vehicle, 420);
    }
    text
}

/// What is wrong with a mission: its area is not whole, or a start was cancelled.
fn wrong(seed: u64, text: &str) -> Option<String> {
    let (result, log) = fly(text);
    let coverage = result.coverage.expect("it has an area");
    let whole = coverage.covered_share >= 1.0 && coverage.missed_waypoints == 0;
    let safe = result.safety.violations == 0;
    let fine = whole && safe && !log.contains(START_CANCELLED);
    let said = || format!("seed {seed}: {} left\n{text}\n{log}", coverage.missed_waypoints);
    (!fine).then(said)
}

fn none_is_wrong(drawn: impl Fn(u64) -> String + Sync) {
    let (from, count) = (
        number_from_env("FLOCKMATE_RESTARTED_FROM", 0),
        number_from_env("FLOCKMATE_RESTARTED", MISSIONS),
    );
    let all: Vec<String> =
        (from..from + count).into_par_iter().filter_map(|seed| wrong(seed, &drawn(seed))).collect();
    all.iter().take(2).for_each(|said| println!("{said}"));
    println!("{} of {count} wrong", all.len());
    assert!(all.is_empty(), "{} of {count}", all.len());
}

#[test]
fn what_landed_vehicles_report_of_their_flight_does_not_count_in_the_next() {
    none_is_wrong(restarted);
}

/// One vehicle is heard, and knows its position, 72 to 82 s later than the others; none is started
/// before that. From this height a lost vehicle would be down by then.
#[test]
fn a_vehicle_that_comes_up_late_flies_its_part() {
    none_is_wrong(|seed| {
        let mut random = Pcg32::seed_from_u64(seed);
        let low = SMALL_FIELD_SCENARIO.replace("height_m = 25.0", "height_m = 15.0");
        let mut text = low.replace("id =", "descend_mps = 5.0\nid =");
        let (vehicle, late_s) = (1 + random.next_u32() % 3, 72 + random.next_u32() % 10);
        for (kind, until_s) in [("gps-loss", late_s + 2), ("radio-cut", late_s)] {
            fault(&mut text, kind, vehicle, 0);
            let _ = writeln!(text, "duration_s = {until_s}.0");
        }
        text
    });
}

/// A board that is restarted on the ground increases its incarnation each time. A vehicle restarted
/// after that, which remembers nothing, accepts that incarnation.
#[test]
fn any_number_of_restarts_on_the_ground_keeps_nobody_from_dividing() {
    none_is_wrong(|seed| {
        let mut random = Pcg32::seed_from_u64(seed);
        let mut text = SMALL_FIELD_SCENARIO.replace("id =", "endurance_s = 4000.0\nid =");
        let (lands, again) = (1 + random.next_u32() % 3, random.next_u32() % 3);
        let other = 1 + (lands + again % 2) % 3;
        fault(&mut text, "land-order", lands, 50);
        (1..=3).filter(|v| *v != lands).for_each(|v| fault(&mut text, "return-order", v, 100));
        for nth in 0..1 + random.next_u32() % 9 {
            fault(&mut text, "companion-reset", lands, 250 + 20 * nth);
        }
        fault(&mut text, "companion-reset", other, 480);
        text
    });
}
