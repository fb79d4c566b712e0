//! Coverage missions flown whole: companions plan from the mission file, the autopilots trigger their cameras, and the
//! pictures are judged by where they were truly taken.

use flockmate_tests::areas::{self, Shape};
use flockmate_tests::covered;
use host_sim::mission::Mission;
use host_sim::progress::Progress;
use host_sim::result::MissionResult;
use host_sim::scenario;
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Flies a scenario.
fn fly(text: &str) -> Result<MissionResult, String> {
    let said = |error: anyhow::Error| format!("{error:#}");
    let scenario = scenario::parse(text, "area").map_err(|error| error.to_string())?;
    let mut mission = Mission::prepare(scenario, &Progress::hidden()).map_err(said)?;
    let (result, log) = covered::fly(&mut mission).map_err(said)?;
    if !result.complete {
        for event in log.iter().filter(|event| event.text.contains("arning") || event.text.contains(":")) {
            println!("{:8.2} {:?} {}", event.t_s, event.vehicle, event.text);
        }
    }
    Ok(result)
}

/// Why a random area is not flown.
const NO_FLIGHT: [&str; 5] =
    ["too many corners", "bad area", "bad scenario", "no-fly zone", "cannot keep vehicles apart"];

/// `FLOCKMATE_FLOWN=N` flies more, `FLOCKMATE_FLOWN_FROM` others.
#[test]
fn random_areas_are_photographed_whole() {
    let number =
        |name: &str, usual: u64| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(usual);
    let (from, count) = (number("FLOCKMATE_FLOWN_FROM", 0), number("FLOCKMATE_FLOWN", 16));
    let outcome = |seed: u64| -> Result<Option<&str>, String> {
        let mut random = Pcg32::seed_from_u64(seed);
        let shape = if seed.is_multiple_of(2) { Shape::Any } else { Shape::Convex };
        let text = areas::flown(&mut random, shape, [1, 3, 5][(seed % 3) as usize]);
        match fly(&text) {
            Ok(result) => match covered::faults(&result) {
                None => Ok(None),
                Some(faults) => Err(format!("seed {seed}: {faults}\n{text}")),
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
