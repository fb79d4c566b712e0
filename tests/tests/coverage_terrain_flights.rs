//! Areas above random hills, flown by companions that follow the ground: all is photographed,
//! judged by where each picture was truly taken and how high the ground is there, and no vehicle
//! touches a hill.

use flockmate_tests::areas::{self, Shape};
use flockmate_tests::hills::Hills;
use flockmate_tests::{covered, number_from_env};
use host_sim::result::VehicleResult;
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Reasons for which a random area may be refused.
const NO_FLIGHT: [&str; 5] =
    ["too many corners", "area too large", "bad area", "bad scenario", "no-fly zone"];

/// The scenario that `draw` draws, above random hills.
fn drawn(seed: u64, folder: &std::path::Path, draw: impl Fn(&mut Pcg32) -> String) -> String {
    let mut random = Pcg32::seed_from_u64(seed);
    let hills = Hills::new(&mut random, 60.0);
    let tolerance_m = 2.0 + 8.0 * areas::unit_random(&mut random);
    let text = draw(&mut random);
    let [climb, descend] = [0, 1].map(|_| 1.0 + 2.0 * areas::unit_random(&mut random));
    let speeds = format!("climb_mps = {climb:.1}\ndescend_mps = {descend:.1}\nspeed_max_mps");
    hills.put_under_scenario(
        &text.replace("speed_max_mps", &speeds),
        &folder.join(format!("{seed}.asc")),
        tolerance_m,
    )
}

/// Flies `one` for all seeds. Its `Err` says what is wrong, its `Ok` whether the mission was flown,
/// and photographed whole.
fn all_flown(
    name: &str,
    from: u64,
    count: u64,
    one: impl Fn(u64) -> Result<bool, String> + Send + Sync,
) {
    let all: Vec<_> = (from..from + count).into_par_iter().map(one).collect();
    let wrong: Vec<_> = all.iter().filter_map(|outcome| outcome.as_ref().err()).collect();
    for wrong in wrong.iter().take(10) {
        println!("{}\n", wrong.chars().take(4000).collect::<String>());
    }
    let flown = all.iter().filter(|outcome| matches!(outcome, Ok(true))).count();
    println!("{name}: {flown} of {count} flown, {} wrong", wrong.len());
    assert!(
        wrong.is_empty() && 3 * flown as u64 >= count,
        "{name}: {flown} flown, {} wrong",
        wrong.len()
    );
}

/// `FLOCKMATE_HILLS=N` flies N areas, `FLOCKMATE_HILLS_FROM=SEED` from another seed on.
#[test]
fn areas_above_random_hills_are_photographed_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let one = |seed: u64| {
        let shape = if seed.is_multiple_of(2) { Shape::Any } else { Shape::Convex };
        let kinds = [areas::flyable_scenario, areas::survey_scenario, areas::many_lanes_scenario];
        let draw = |random: &mut Pcg32| {
            kinds[(seed / 3 % 3) as usize](random, shape, [1, 3, 5][(seed % 3) as usize])
        };
        let text = drawn(seed, folder.path(), draw);
        match covered::fly_text(&text) {
            Ok((result, log)) => match covered::faults_text(&result) {
                None => Ok(true),
                Some(faults) => Err(format!("seed {seed}: {faults}\n{log}{text}")),
            },
            Err(error) if NO_FLIGHT.iter().any(|known| error.contains(known)) => Ok(false),
            Err(error) => Err(format!("seed {seed}: {error}\n{text}")),
        }
    };
    all_flown(
        "hills",
        number_from_env("FLOCKMATE_HILLS_FROM", 0),
        number_from_env("FLOCKMATE_HILLS", 12),
        one,
    );
}

/// The others, which follow the ground too, photograph what a lost vehicle leaves, or the log says
/// why not.
#[test]
fn losses_above_random_hills_touch_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let kinds =
        ["kill", "radio-cut", "battery-low", "pilot-takeover", "companion-reset", "return-order"];
    let one = |seed: u64| {
        let count = [3, 5][(seed % 2) as usize];
        let mut text =
            drawn(seed, folder.path(), |random| areas::lossy_radio_scenario(random, count, 0.2));
        let mut random = Pcg32::seed_from_u64(seed ^ 0x1055);
        let (vehicle, at_s) = (1 + random.next_u32() % count as u32, 20 + random.next_u32() % 220);
        let kind = kinds[(seed / 2 % 6) as usize];
        text += &format!("[[faults]]\nat_s = {at_s}.0\nkind = \"{kind}\"\nvehicle = {vehicle}\n");
        match covered::fly_text(&text) {
            Ok((result, log)) => {
                let safety = &result.safety;
                let clean =
                    (safety.wall_contacts, safety.violations, safety.deadlocks) == (0, 0, 0);
                let share = result.coverage.as_ref().map_or(0.0, |coverage| coverage.covered_share);
                if number_from_env("FLOCKMATE_HILLS", 0) == 1 {
                    println!("{log}{text}");
                }
                // All that were not struck have no part: such a vehicle does not take over.
                let had_none =
                    |v: &VehicleResult| v.id == vehicle as u8 || v.end.starts_with("no goal");
                let others = || result.vehicles.iter().filter(|v| v.id != vehicle as u8);
                let explained = result.vehicles.iter().all(had_none)
                    || others()
                        .any(|v| covered::has_logged(&log, v.id, &covered::EARLY_LANDING_TEXTS));
                if share < 1.0 {
                    println!("seed {seed} {kind}: {:.2} %: {explained}", 100.0 * share);
                }
                match clean && (share >= 1.0 || explained) {
                    true => Ok(true),
                    false => Err(format!("seed {seed}: {kind} {safety:?}\n{log}{text}")),
                }
            }
            Err(error) if NO_FLIGHT.iter().any(|known| error.contains(known)) => Ok(false),
            Err(error) => Err(format!("seed {seed}: {error}\n{text}")),
        }
    };
    all_flown(
        "losses",
        number_from_env("FLOCKMATE_HILLS_FROM", 0),
        number_from_env("FLOCKMATE_HILLS", 12),
        one,
    );
}
