//! A vehicle that flies around one that hovers on its lane is struck by a fault itself: none
//! touches anything, and all come down.
//!
//! `FLOCKMATE_BESIDE=N` looks for such vehicles in N missions in place of [`MISSIONS`],
//! `FLOCKMATE_BESIDE_FROM=SEED` from another seed on.

use flockmate_tests::{areas, covered, number_from_env};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

const MISSIONS: u64 = 8;

/// Faults that leave a vehicle hovering.
const HOVERS: [&str; 2] = ["pilot-takeover", "companion-reset"];

/// Faults that strike the vehicle that flies around it, with further keys.
const STRIKES: [&str; 14] = [
    "kill",
    "radio-cut",
    "radio-cut\"\ndirection = \"rx\"\nduration_s = \"12",
    "battery-low",
    "pilot-takeover",
    "pilot-takeover\"\nduration_s = \"8",
    "pilot-takeover\"\nduration_s = \"40",
    "companion-reset",
    "return-order",
    "land-order",
    "pause-order",
    "pause-order\"\nduration_s = \"15",
    "position-jump\"\nduration_s = \"4",
    "serial-stall\"\nduration_s = \"2",
];

fn fault(kind: &str, at_s: f32, vehicle: u8) -> String {
    let keys =
        format!("[[faults]]\nkind = \"{kind}\"\n").replace("duration_s = \"", "duration_s = ");
    // A number has no quotes behind it.
    let keys = match keys.contains("duration_s") {
        true => keys.trim_end().trim_end_matches('"').to_owned() + "\n",
        false => keys,
    };
    format!("{keys}at_s = {at_s:.2}\nvehicle = {vehicle}\n")
}

/// When the first vehicle begins to fly around an obstacle, seconds, and its id.
fn flies_around(log: &str) -> Option<(f32, u8)> {
    let line = log.lines().find(|line| line.ends_with("Replanning → Follow: Flying around"))?;
    let mut words = line.split_whitespace();
    let at_s = words.next()?.parse().ok()?;
    let vehicle = words.next()?.strip_prefix("Some(")?.strip_suffix(')')?.parse().ok()?;
    Some((at_s, vehicle))
}

/// Whether a vehicle flew around the hovering one, and what was wrong with the mission in which it
/// was struck then.
fn struck(seed: u64) -> (bool, Option<String>) {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = [3, 5][(seed % 2) as usize];
    let mut text = areas::lossy_radio_scenario(
        &mut random,
        count,
        if (seed / 2).is_multiple_of(2) { 0.4 } else { 0.1 },
    );
    let hovers = 1 + (random.next_u32() % count as u32) as u8;
    let at_s = 60.0 + (random.next_u32() % 150) as f32;
    text += &fault(HOVERS[(seed / 4 % 2) as usize], at_s, hovers);
    let Ok((_, log)) = covered::fly_text(&text) else { return (false, None) };
    let Some((from_s, vehicle)) = flies_around(&log) else { return (false, None) };
    let kind = STRIKES[random.next_u32() as usize % STRIKES.len()];
    text += &fault(kind, from_s + 0.1 + 30.0 * areas::unit_random(&mut random) as f32, vehicle);
    let (result, log) = covered::fly_text(&text).expect("it was flown before");
    let safety = &result.safety;
    let touches = (safety.wall_contacts, safety.violations, safety.deadlocks) != (0, 0, 0);
    // A vehicle that was struck may hover under its pilot, or be lost.
    let ends = |end: &str| ["Done", "Aborted", "no goal"].iter().any(|all| end.starts_with(all));
    let others = result.vehicles.iter().filter(|v| v.id != hovers && v.id != vehicle);
    let stays = others.filter(|v| !ends(&v.end)).count();
    let disarmed = log.lines().any(|line| {
        line.contains("Disarmed in flight")
            && !(kind == "kill" && line.contains(&format!("Some({vehicle})")))
    });
    let wrong = touches || stays > 0 || disarmed;
    (true, wrong.then(|| format!("seed {seed} {kind}: {safety:?}, {stays} stay\n{log}\n{text}")))
}

#[test]
fn a_vehicle_struck_on_its_detour_touches_nothing() {
    let (from, count) = (
        number_from_env("FLOCKMATE_BESIDE_FROM", 0),
        number_from_env("FLOCKMATE_BESIDE", MISSIONS),
    );
    let all: Vec<_> = (from..from + count).into_par_iter().map(struck).collect();
    let around = all.iter().filter(|(around, _)| *around).count();
    let wrong: Vec<_> = all.iter().filter_map(|(_, wrong)| wrong.as_ref()).collect();
    wrong.iter().for_each(|wrong| println!("{wrong}"));
    println!("{around} of {count} flew around something and were struck, {} wrong", wrong.len());
    assert!(wrong.is_empty() && 4 * around as u64 >= count, "{around} of {count}");
}

/// A field for two vehicles at 15 m/s whose radios lose half of all messages.
const FAST_FIELD: &str = "[area]
polygon = [[0, 0], [300, 0], [300, 160], [0, 160]]
camera = { fov_deg = 73.7, aspect = 1.5 }
height_m = 40.0
[mission]
cruise_mps = 15.0
[[vehicles]]
id = 1
speed_max_mps = 20.0
start = [0, -20, 0]
[[vehicles]]
id = 2
speed_max_mps = 20.0
personality = \"ardupilot\"
start = [10, -20, 0]
[deconfliction]
separation_m = 6.0
[simulation]
gust_mps = 1.0
radio_loss = 0.5
";

/// A stop that is advised too late takes longer than advised: the safety filter counts all of it.
#[test]
fn a_fast_vehicle_stops_before_one_that_hovers() {
    let one = |at_s: u16| -> Option<String> {
        let text = FAST_FIELD.to_owned() + &fault("companion-reset", f32::from(at_s), 2);
        let (result, log) = covered::fly_text(&text).expect("it can be flown");
        let safety = &result.safety;
        let touches = (safety.wall_contacts, safety.violations) != (0, 0);
        touches.then(|| format!("struck at {at_s} s: {safety:?}\n{log}"))
    };
    let wrong: Vec<String> = (102..126).into_par_iter().step_by(6).filter_map(one).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Log texts of a vehicle that gave up its part because another one hovers on its path.
const GIVES_UP: [&str; 3] = [
    "Vehicle on the path: planning the way home",
    "Path blocked for 2 min: planning the way home",
    "Yielded for 60 s: planning the way home",
];

/// Flies a mission at 8 to 15 m/s with one vehicle that hovers. Returns how many vehicles flew
/// around it, and how many gave up; the error says what was wrong.
fn met_fast(seed: u64) -> Result<[usize; 2], String> {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = [3, 5][(seed % 2) as usize];
    let loss = [0.0, 0.1, 0.3][(seed % 3) as usize];
    let text = areas::lossy_radio_scenario(&mut random, count, loss);
    let cruise = areas::between(&mut random, 8.0, 15.0);
    let drawn = |line: &str| match line.starts_with("cruise_mps") {
        true => format!("cruise_mps = {cruise:.1}\n"),
        false => format!("{line}\n"),
    };
    let mut text: String = text.lines().map(drawn).collect();
    let hovers = 1 + (random.next_u32() % count as u32) as u8;
    let at_s = 30.0 + (random.next_u32() % 90) as f32;
    text += &fault(HOVERS[(seed / 4 % 2) as usize], at_s, hovers);
    let Ok((result, log)) = covered::fly_text(&text) else { return Ok([0; 2]) };
    let safety = &result.safety;
    if (safety.wall_contacts, safety.violations, safety.deadlocks) != (0, 0, 0) {
        return Err(format!("seed {seed}: {safety:?}\n{log}{text}"));
    }
    let own = |vehicle: u8, end: &dyn Fn(&str) -> bool| {
        let own = format!(" Some({vehicle}) ");
        log.lines().any(|line| line.contains(&own) && end(line))
    };
    let others = || (1..=count as u8).filter(|vehicle| *vehicle != hovers);
    let gives_up = |line: &str| GIVES_UP.iter().any(|text| line.contains(text));
    let left = |vehicle: &u8| own(*vehicle, &gives_up);
    let around = |vehicle: &u8| own(*vehicle, &|line| line.contains("Flying around"));
    Ok([
        others().filter(|vehicle| around(vehicle) && !left(vehicle)).count(),
        others().filter(left).count(),
    ])
}

/// At 8 to 15 m/s, too, most vehicles that meet a hovering one fly around it and do not go home.
/// `FLOCKMATE_FAST=N` flies N missions, `FLOCKMATE_FAST_FROM=SEED` from another seed on.
#[test]
fn a_fast_vehicle_flies_around_one_that_hovers() {
    let (from, count) =
        (number_from_env("FLOCKMATE_FAST_FROM", 82), number_from_env("FLOCKMATE_FAST", 1));
    let all: Vec<_> = (from..from + count).into_par_iter().map(met_fast).collect();
    let wrong: Vec<_> = all.iter().filter_map(|met| met.as_ref().err()).collect();
    let sum = |k: usize| all.iter().flatten().map(|met| met[k]).sum::<usize>();
    println!("{count} missions: {} flew around, {} gave up, {} wrong", sum(0), sum(1), wrong.len());
    wrong.iter().for_each(|wrong| println!("{wrong}"));
    assert!(wrong.is_empty() && sum(0) >= 2 * sum(1) && sum(0) > 0);
}
