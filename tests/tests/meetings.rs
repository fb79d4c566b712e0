//! Whole companions meet at random; `cargo xtask bench --only meetings --n 10000` flies more, and can replay a seed.

use flockmate_tests::meeting::{self, Outcome, scene};
use rayon::prelude::*;

/// Pairs that pass at exactly the scheduled separation.
const PASSINGS: u64 = 60;
/// A stop that lasts no longer is none, seconds.
const STOP_S: f32 = 0.5;

fn report(outcomes: &[Outcome]) {
    outcomes.iter().filter(|o| o.is_bad()).for_each(|outcome| println!("{}", meeting::line(outcome)));
    println!("{}", meeting::summary(outcomes));
}

#[test]
fn nobody_is_stopped_who_passes_at_the_scheduled_separation() {
    let outcomes: Vec<Outcome> =
        (0..PASSINGS).into_par_iter().map(|seed| meeting::fly(&scene::passing(seed), false)).collect();
    report(&outcomes);
    let stops: u32 = outcomes.iter().map(|outcome| outcome.filter_stops).sum();
    println!("{stops} stops by the safety filter in {PASSINGS} passings");
    for outcome in &outcomes {
        assert!(!outcome.is_bad(), "{}", meeting::line(outcome));
        assert_eq!(outcome.arrived, 2, "{}", meeting::line(outcome));
        assert!(
            outcome.longest_stop_s <= STOP_S,
            "{:.2} s: {}",
            outcome.longest_stop_s,
            meeting::line(outcome)
        );
    }
}
