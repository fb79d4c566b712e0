//! Coverage missions in which all vehicles but one are lost: the last one photographs what they
//! leave.
//!
//! `FLOCKMATE_ALONE=N` flies N missions in place of [`MISSIONS`], `FLOCKMATE_ALONE_FROM=SEED` from
//! another seed on.

use flockmate_tests::owners::{self, FlownMission};
use flockmate_tests::{areas, assert_no_seed_is_wrong, covered};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

const MISSIONS: u64 = 10;

/// Time after a loss within which the last vehicle may land without taking over, seconds: the loss
/// is noticed after 45 s.
const NOTICED_S: f64 = 45.0 + 15.0;

/// The scenario, and when the last fault strikes. Of two vehicles the one with the higher id is
/// lost; of three two are lost, one long after the other. Of two the lower id continues
/// (docs/coverage-losses.md).
fn drawn(seed: u64) -> (String, f64) {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = 2 + (seed % 2) as usize;
    let loss = [0.0, 0.1, 0.3][(seed / 2 % 3) as usize];
    // One vehicle alone may take hours for the area of three.
    let text = areas::lossy_radio_scenario(&mut random, count, loss);
    let mut text = text.replace("time_limit_s = 3600.0", "time_limit_s = 14400.0");
    let (mut at_s, mut last_s) = (20 + random.next_u32() % 150, 0);
    for vehicle in (2..=count).rev() {
        text += &format!("[[faults]]\nat_s = {at_s}.0\nkind = \"kill\"\nvehicle = {vehicle}\n");
        // Silence counts from the start on; after it the others hold until the lost vehicle is
        // down.
        (last_s, at_s) = (at_s, (at_s + 180).max(300) + random.next_u32() % 60);
    }
    (text, f64::from(last_s))
}

#[test]
fn the_last_vehicle_photographs_all_that_is_left() {
    let one = |seed: u64| -> Option<bool> {
        let (text, struck_s) = drawn(seed);
        if std::env::var("FLOCKMATE_ALONE").is_ok_and(|n| n == "1") {
            println!("{text}");
        }
        let lost: Vec<u8> = (2..=2 + (seed % 2) as u8).collect();
        let FlownMission { result, log, ownership_faults: owned, .. } =
            owners::fly(&text, &lost).ok()?;
        let (safety, coverage) = (result.safety, result.coverage.expect("it has an area"));
        let last = result.vehicles.iter().find(|vehicle| vehicle.id == 1).expect("it has one");
        // A vehicle without a part, or kept on its pad by one that fell beside it, takes over no
        // part; nor does one that has landed with all of its own part flown.
        let flies = last.flown_m > 20.0;
        let landed =
            last.end == "Done" && covered::last_other_ended_s(&log, 0) < struck_s + NOTICED_S;
        let broken = safety.violations + safety.wall_contacts + safety.deadlocks > 0;
        let whole = coverage.covered_share >= 1.0;
        let wrong = broken || !owned.is_empty() || (flies && !landed && !whole);
        if wrong || !whole {
            println!(
                "seed {seed}: {:.2} %, left {}, {safety:?}, {owned:?}\n{log}",
                100.0 * coverage.covered_share,
                coverage.missed_waypoints
            );
        }
        Some(wrong)
    };
    assert_no_seed_is_wrong("FLOCKMATE_ALONE", MISSIONS, one);
}

/// A pilot takes one of two vehicles, which is unheard after a while. No lease lands it, so the
/// other one keeps clear of where it was last heard for as long as it flies.
#[test]
fn an_unheard_vehicle_that_its_pilot_keeps_in_the_air_is_kept_clear_of() {
    let one = |seed: u64| -> Option<bool> {
        let mut random = Pcg32::seed_from_u64(seed);
        let mut text = areas::lossy_radio_scenario(&mut random, 2, 0.1);
        let taken_s = 20 + random.next_u32() % 150;
        let silent_s = taken_s + 1 + random.next_u32() % 60;
        for (at_s, kind) in [(taken_s, "pilot-takeover"), (silent_s, "radio-cut")] {
            text += &format!("[[faults]]\nat_s = {at_s}.0\nkind = \"{kind}\"\nvehicle = 2\n");
        }
        let (result, log) = covered::fly_text(&text).ok()?;
        let safety = result.safety;
        let wrong = safety.violations + safety.wall_contacts > 0;
        if wrong {
            println!("seed {seed}: {safety:?}\n{text}\n{log}");
        }
        Some(wrong)
    };
    assert_no_seed_is_wrong("FLOCKMATE_ALONE", MISSIONS, one);
}
