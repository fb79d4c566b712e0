//! A vehicle fails where its radio no longer reaches the others: no two vehicles without a fault
//! come too near to each other, and none touches another.
//!
//! `FLOCKMATE_EDGES=60 FLOCKMATE_EDGES_FROM=1000 cargo test --release -p flockmate-tests --test edge`
//! flies other seeds; the bench `range --strikes 8` does the same. A sweep still finds failures:
//! docs/safety.md, "Figures".

use flockmate_tests::edge::RadioEdgeMission;
use flockmate_tests::number_from_env;
use rayon::prelude::*;

/// Number of flights with a fault per seed.
const STRIKES: usize = 3;

#[test]
fn a_failure_at_the_edge_of_the_range_brings_no_two_others_together() {
    let from = number_from_env("FLOCKMATE_EDGES_FROM", 1);
    let of_seed = |seed: u64| -> (usize, Vec<String>) {
        let mut edge = RadioEdgeMission::new(seed).expect("the demo can be flown");
        let struck: Vec<_> = (0..STRIKES)
            .filter_map(|_| edge.fly_with_fault().expect("the fault can be played"))
            .collect();
        let text = |wrong: &String, what: &str| format!("seed {seed}, {what}: {wrong}");
        let wrong =
            struck.iter().flat_map(|o| o.forbidden.iter().map(|wrong| text(wrong, &o.description)));
        (struck.len(), wrong.collect())
    };
    let seeds = from..from + number_from_env("FLOCKMATE_EDGES", 4);
    let flown: Vec<_> = seeds.into_par_iter().map(of_seed).collect();
    let flights: usize = flown.iter().map(|(flights, _)| flights).sum();
    println!("{flights} flights with a failure at the edge of the range");
    assert!(flights >= STRIKES, "hardly anybody leaves the range: {flights} flights");
    let wrong: Vec<&str> = flown.iter().flat_map(|(_, wrong)| wrong).map(String::as_str).collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}
