//! Coverage missions in which all vehicles but one are lost: the one that may go on photographs
//! what they leave.
//!
//! `FLOCKMATE_ALONE=N` flies N missions in place of [`MISSIONS`], `FLOCKMATE_ALONE_FROM` others.

use flockmate_tests::{areas, covered, number};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

const MISSIONS: u64 = 16;

/// Two vehicles, of which the higher is lost; or three, of which two are, one long after the other.
/// The lower of two goes on (docs/coverage.md).
fn drawn(seed: u64) -> String {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = 2 + (seed % 2) as usize;
    let loss = [0.0, 0.1, 0.3][(seed / 2 % 3) as usize];
    let mut text = areas::lossy_radio_scenario(&mut random, count, loss);
    let mut at_s = 20 + random.next_u32() % 150;
    for vehicle in (2..=count).rev() {
        text += &format!("[[faults]]\nat_s = {at_s}.0\nkind = \"kill\"\nvehicle = {vehicle}\n");
        // The division after the first is over by then.
        at_s += 180 + random.next_u32() % 60;
    }
    text
}

#[test]
fn the_last_vehicle_photographs_all_that_is_left() {
    let one = |seed: u64| -> Option<(u64, bool)> {
        let text = drawn(seed);
        if std::env::var("FLOCKMATE_ALONE").is_ok_and(|n| n == "1") {
            println!("{text}");
        }
        let (result, log) = covered::fly_text(&text).ok()?;
        let (safety, coverage) = (result.safety, result.coverage.expect("it has an area"));
        let broken = safety.violations + safety.wall_contacts + safety.deadlocks > 0;
        let whole = coverage.covered_share >= 1.0 && coverage.left == 0 && !broken;
        if !whole {
            println!(
                "seed {seed}: {:.2} %, left {}, {safety:?}\n{log}",
                100.0 * coverage.covered_share,
                coverage.left
            );
        }
        Some((seed, whole))
    };
    let (from, count) = (number("FLOCKMATE_ALONE_FROM", 0), number("FLOCKMATE_ALONE", MISSIONS));
    let all: Vec<(u64, bool)> = (from..from + count).into_par_iter().filter_map(one).collect();
    let left_out: Vec<u64> =
        all.iter().filter(|(_, whole)| !whole).map(|(seed, _)| *seed).collect();
    println!("{} flown, not whole {left_out:?}", all.len());
    assert!(left_out.is_empty() && 2 * all.len() as u64 > count);
}
