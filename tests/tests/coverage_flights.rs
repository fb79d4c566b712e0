//! Coverage missions flown whole: companions plan from the mission file, the autopilots trigger their cameras, and the
//! pictures are judged by where they were truly taken.

use flockmate_tests::areas::{self, Shape};
use flockmate_tests::{covered, number};
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Why a random area is not flown.
const NO_FLIGHT: [&str; 5] =
    ["too many corners", "bad area", "bad scenario", "no-fly zone", "cannot keep vehicles apart"];

/// `FLOCKMATE_FLOWN=N` flies more, `FLOCKMATE_FLOWN_FROM` others.
#[test]
fn random_areas_are_photographed_whole() {
    are_photographed_whole(areas::flown);
}

#[test]
fn random_areas_are_photographed_whole_fast_and_from_high() {
    are_photographed_whole(areas::fast);
}

fn are_photographed_whole(draw: fn(&mut Pcg32, Shape, usize) -> String) {
    let (from, count) = (number("FLOCKMATE_FLOWN_FROM", 0), number("FLOCKMATE_FLOWN", 16));
    let outcome = |seed: u64| -> Result<Option<&str>, String> {
        let mut random = Pcg32::seed_from_u64(seed);
        let shape = if seed.is_multiple_of(2) { Shape::Any } else { Shape::Convex };
        let text = draw(&mut random, shape, [1, 3, 5][(seed % 3) as usize]);
        match covered::fly_text(&text) {
            Ok((result, log)) => match covered::faults(&result) {
                None => Ok(None),
                Some(faults) => Err(format!(
                    "seed {seed}: {faults}
{log}{text}"
                )),
            },
            Err(error) => match NO_FLIGHT.iter().find(|known| error.contains(**known)) {
                Some(known) => Ok(Some(known)),
                None => Err(format!("seed {seed}: {error}\n{text}")),
            },
        }
    };
    let all: Vec<_> = (from..from + count).into_par_iter().map(outcome).collect();
    let wrong: Vec<_> = all.iter().filter_map(|outcome| outcome.as_ref().err()).collect();
    for wrong in &wrong {
        println!("{}\n", wrong.chars().take(3000).collect::<String>());
    }
    let ended = |how: Option<&str>| all.iter().filter(|outcome| outcome.as_ref() == Ok(&how)).count() as u64;
    for known in NO_FLIGHT {
        println!("{known}: {}", ended(Some(known)));
    }
    let flown = ended(None);
    println!("{flown} of {count} areas flown, {} wrong", wrong.len());
    assert!(wrong.is_empty() && flown >= count / 4, "{flown} flown, {} wrong", wrong.len());
}
