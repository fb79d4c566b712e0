//! Coverage missions that are interrupted and started again: the rest is flown, and nothing is left
//! out.
//!
//! `FLOCKMATE_RESUMED=N` flies N missions in place of [`MISSIONS`], `FLOCKMATE_RESUMED_FROM=SEED`
//! from another seed on; `FLOCKMATE_SEAMS` and `FLOCKMATE_SEAMS_FROM` do the same for low
//! batteries.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use companion::config::parameters::Parameters;
use companion::storage::store::{ErasePermission, MAX_READ_LEN, Store};
use flockmate_tests::areas::{self, SMALL_FIELD_SCENARIO};
use flockmate_tests::{covered, host_sim_path, number_from_env};
use host_sim::coverage::check::Picture;
use host_sim::flash::{HOST_FLASH_LAYOUT, HostFlash};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::result::MissionResult;
use host_sim::scenario::{self, CompanionHost};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

const MISSIONS: u64 = 6;
/// Most starts until the area is whole.
const STARTS: usize = 4;
/// When three vehicles have photographed 40 % of the small field, seconds.
const FORTY_PERCENT_S: f64 = 112.0;
/// Faults that bring a vehicle down early; then it is carried to its pad, charged and switched on.
const KINDS: [&str; 5] =
    ["battery-low", "battery-low", "pilot-takeover", "companion-reset", "kill"];

/// The scenario without faults, and the faults of the first flights.
fn drawn(seed: u64) -> (String, Vec<String>) {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = [1, 3, 5][(seed % 3) as usize];
    let loss = if seed.is_multiple_of(2) { 0.5 } else { 0.1 };
    let text = areas::lossy_radio_scenario(&mut random, count, if count == 1 { 0.0 } else { loss });
    let flights = 1 + random.next_u32() % 2;
    let mut faults = Vec::new();
    for _ in 0..flights {
        let mut lines = String::new();
        // All vehicles are struck, or some: then the others divide what these leave.
        let all = random.next_u32().is_multiple_of(2);
        let kind = KINDS[(random.next_u32() % 5) as usize];
        for vehicle in 1..=count {
            let many = kind != "kill" && kind != "companion-reset";
            if vehicle == 1 || (many && (all || random.next_u32().is_multiple_of(2))) {
                let at_s = 20 + random.next_u32() % 160;
                let _ = write!(
                    lines,
                    "[[faults]]\nat_s = {at_s}.0\nkind = \"{kind}\"\nvehicle = {vehicle}\n"
                );
            }
        }
        faults.push(lines);
    }
    (text, faults)
}

fn fly(
    text: &str,
    dir: &Path,
    pictures: &mut Vec<Picture>,
) -> Result<(MissionResult, String), String> {
    let said = |error: anyhow::Error| format!("{error:#}");
    let mut scenario = scenario::parse(text, "area").map_err(|error| error.to_string())?;
    for vehicle in &mut scenario.vehicles {
        let flash = Some(dir.join(format!("{}.flash", vehicle.id)));
        vehicle.companion = CompanionHost::InProcess { flash };
    }
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden()).map_err(said)?;
    let (result, log) = covered::fly_adding_pictures(&mut mission, pictures).map_err(said)?;
    Ok((result, covered::log_lines(&log)))
}

/// How a mission ended.
struct Outcome {
    seed: u64,
    /// Number of starts until the area was whole; `None` if it never was.
    starts: Option<usize>,
    /// Number of waypoints photographed more than once.
    twice: u64,
    /// Whether a wall was touched, vehicles came too near, or a vehicle did not come home in a
    /// start without a fault.
    broken: bool,
    said: String,
}

fn outcome(seed: u64) -> Option<Outcome> {
    let (text, faults) = drawn(seed);
    let dir = tempfile::tempdir().expect("a directory");
    let (mut pictures, mut said) = (Vec::new(), String::new());
    let mut outcome = Outcome { seed, starts: None, twice: 0, broken: false, said: String::new() };
    for start in 0..STARTS {
        let struck = format!("{text}{}", faults.get(start).map_or("", |lines| lines));
        if std::env::var("FLOCKMATE_RESUMED").is_ok_and(|n| n == "1") {
            println!("{struck}");
        }
        let (result, log) = match fly(&struck, dir.path(), &mut pictures) {
            Ok(flown) => flown,
            Err(error) => {
                let known = ["too many corners", "cannot keep", "to land beside"]
                    .iter()
                    .any(|why| error.contains(why));
                assert!(known, "seed {seed}: {error}");
                return None;
            }
        };
        let coverage = result.coverage.expect("it has an area");
        let safety = &result.safety;
        outcome.broken |= (safety.wall_contacts, safety.violations) != (0, 0);
        // In a start without faults all come home.
        let home = |end: &str| end == "Done" || end.starts_with("no goal");
        outcome.broken |= start >= faults.len() && !result.vehicles.iter().all(|v| home(&v.end));
        outcome.twice = coverage.repeated_waypoints;
        let _ = writeln!(
            said,
            "start {start}: {:.2} % {:?}\n{log}",
            100.0 * coverage.covered_share,
            safety
        );
        if coverage.covered_share >= 1.0 {
            outcome.starts = Some(start + 1);
            break;
        }
    }
    outcome.said = said;
    Some(outcome)
}

#[test]
fn what_an_interrupted_mission_left_is_photographed_after_the_next_start() {
    let (from, count) = (
        number_from_env("FLOCKMATE_RESUMED_FROM", 0),
        number_from_env("FLOCKMATE_RESUMED", MISSIONS),
    );
    let all: Vec<Outcome> = (from..from + count).into_par_iter().filter_map(outcome).collect();
    let wrong = |o: &&Outcome| o.broken || o.starts.is_none();
    for o in all.iter().filter(wrong) {
        println!(
            "seed {}: whole after {:?} starts, {} twice\n{}",
            o.seed, o.starts, o.twice, o.said
        );
    }
    let after = |starts| all.iter().filter(|o| o.starts == Some(starts)).count();
    let twice: u64 = all.iter().map(|o| o.twice).sum();
    println!(
        "{} flown, whole after 1 to {STARTS} starts: {:?}, {twice} waypoints twice",
        all.len(),
        [1, 2, 3, 4].map(after)
    );
    assert_eq!(all.iter().filter(wrong).count(), 0);
}

/// Sets a parameter in the flash of each companion, as a ground station does between flights.
fn set_parameter(dir: &Path, name: &str, value: f32) {
    for entry in fs::read_dir(dir).expect("a directory") {
        let mut flash = HostFlash::open(Some(&entry.expect("a file").path())).expect("a flash");
        let mut store = Store::mount(HOST_FLASH_LAYOUT, &mut flash);
        let index = Parameters::index_of(name.as_bytes()).expect("a parameter");
        store.set_parameter(index, value).expect("in range");
        let mut read = [0; MAX_READ_LEN];
        while let Some(request) = store.poll_request(ErasePermission::Allowed) {
            let outcome = flash.execute_request(request, &mut read);
            store.handle_flash_outcome(outcome);
        }
    }
}

/// With `FLK_RESUME` 1 the second flight photographs the rest alone, with 0 the whole area again.
#[test]
fn flk_resume_0_photographs_the_whole_area_again() {
    let flown = |resume: f32| {
        let dir = tempfile::tempdir().expect("a directory");
        let low = |vehicle| {
            format!("[[faults]]\nkind = \"battery-low\"\nvehicle = {vehicle}\nat_s = 90.0\n")
        };
        let struck = format!("{SMALL_FIELD_SCENARIO}{}{}{}", low(1), low(2), low(3));
        let (mut first, mut second) = (Vec::new(), Vec::new());
        fly(&struck, dir.path(), &mut first).expect("it flies");
        set_parameter(dir.path(), "FLK_RESUME", resume);
        let (result, log) = fly(SMALL_FIELD_SCENARIO, dir.path(), &mut second).expect("it flies");
        let coverage = result.coverage.expect("it has an area");
        assert!(first.len() > 20, "{} pictures before the batteries were low", first.len());
        (coverage, second.len() as u64, log)
    };
    let (whole, pictures, log) = flown(0.0);
    assert!(whole.covered_share >= 1.0 && whole.missed_waypoints == 0, "{whole:?}\n{log}");
    assert!(pictures >= u64::from(whole.waypoint_count), "{pictures} pictures: {whole:?}");
    let (rest, fewer, _) = flown(1.0);
    assert!(rest.missed_waypoints > 20 && fewer + 20 < pictures, "{fewer} pictures: {rest:?}");
}

/// A pilot takes a vehicle, which hovers, and others fly around it. Returns whether they left
/// waypoints out, and what is wrong after the next start, which is to fly only those.
fn around(seed: u64) -> (bool, Option<String>) {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = [3, 5][(seed % 2) as usize];
    // Estimates are good, because what is left out is judged by true places.
    let text =
        areas::lossy_radio_scenario(&mut random, count, 0.1).replace("\"recorded\"", "\"rtk\"");
    let (vehicle, at_s) = (1 + random.next_u32() % count as u32, 60 + random.next_u32() % 150);
    let struck = format!(
        "{text}[[faults]]\nat_s = {at_s}.0\nkind = \"pilot-takeover\"\nvehicle = {vehicle}\n"
    );
    let dir = tempfile::tempdir().expect("a directory");
    let mut pictures = Vec::new();
    let Ok((result, log)) = fly(&struck, dir.path(), &mut pictures) else { return (false, None) };
    let left = result.coverage.expect("it has an area").missed_waypoints;
    let around =
        |line: &str| line.split_once("Flown around: ")?.1.split(' ').next()?.parse::<usize>().ok();
    let reported: usize = log.lines().filter_map(around).sum();
    if left == 0 || !log.contains("Replanning → Follow: Flying around") {
        return (false, None);
    }
    let first = pictures.len();
    let (result, then) = fly(&text, dir.path(), &mut pictures).expect("it was flown before");
    let (coverage, second) = (result.coverage.expect("it has an area"), pictures.len() - first);
    // A new start of an area that counts as whole would fly all of it.
    let wrong = coverage.covered_share < 1.0
        || coverage.missed_waypoints > 0
        || second < reported
        || 2 * second > first;
    let said = || {
        let after = format!(
            "{left} left, then {} of {:.2} %",
            coverage.missed_waypoints,
            100.0 * coverage.covered_share
        );
        format!(
            "seed {seed}: {first} pictures, {reported} reported, {after}, {second} pictures\n\
             {struck}\n{log}\n{then}"
        )
    };
    (true, wrong.then(said))
}

#[test]
fn what_was_flown_around_is_photographed_after_the_next_start() {
    let (from, count) =
        (number_from_env("FLOCKMATE_RESUMED_FROM", 0), number_from_env("FLOCKMATE_AROUND", 12));
    let all: Vec<_> = (from..from + count).into_par_iter().map(around).collect();
    let left = all.iter().filter(|(left, _)| *left).count();
    let wrong: Vec<_> = all.iter().filter_map(|(_, wrong)| wrong.as_ref()).collect();
    wrong.iter().for_each(|wrong| println!("{wrong}"));
    println!("{left} of {count} left waypoints out that they flew around, {} wrong", wrong.len());
    assert!(wrong.is_empty() && left > 0, "{left} of {count}");
}

/// After a low battery a journal may be some waypoints behind: the next start flies these, and an
/// area that was whole before is still judged whole.
#[test]
fn an_area_that_was_whole_is_judged_whole_at_the_next_start() {
    let program = host_sim_path();
    let flown = |at_s: u64| -> Result<usize, String> {
        let dir = tempfile::tempdir().expect("a directory");
        let at = |name: &str| dir.path().join(name);
        let fault = format!("[[faults]]\nkind = \"battery-low\"\nvehicle = 1\nat_s = {at_s}.0\n");
        fs::write(at("struck.toml"), format!("{SMALL_FIELD_SCENARIO}{fault}")).expect("a file");
        fs::write(at("sound.toml"), SMALL_FIELD_SCENARIO).expect("a file");
        let mut whole = Vec::new();
        for name in ["struck.toml", "sound.toml", "sound.toml", "sound.toml"] {
            let done = Command::new(&program)
                .arg("fly")
                .arg(at(name))
                .args([OsStr::new("--flash"), at("flash").as_os_str()])
                .args([OsStr::new("--out"), at("out").as_os_str()])
                .output()
                .expect("it runs");
            whole.push(done.status.success());
        }
        // The last flight began the area again, and is judged by its own pictures alone.
        let result = fs::read_to_string(at("out").join("result.json")).expect("a result");
        let result: serde_json::Value = serde_json::from_str(&result).expect("JSON");
        let coverage = &result["coverage"];
        let (photos, waypoints) = (&coverage["photos"], &coverage["waypoints"]);
        if photos.as_f64() > waypoints.as_f64().map(|count| 1.2 * count) {
            return Err(format!("struck at {at_s} s: {photos} pictures of {waypoints} waypoints"));
        }
        match whole[..] {
            [first, true, true, true] => Ok(usize::from(first)),
            _ => Err(format!("struck at {at_s} s: whole {whole:?}")),
        }
    };
    let all: Result<Vec<usize>, String> =
        [40, 80, 100, 120, 140, 200].into_par_iter().map(flown).collect();
    let whole_at_once: usize = all.expect("whole once, whole again").iter().sum();
    assert!(whole_at_once >= 3, "{whole_at_once} of 6 missions were whole after a takeover");
}

/// A battery-low fault for each vehicle from 1 on, at its time in `at_s`, seconds.
fn batteries_low(at_s: &[f64]) -> String {
    let low = |(vehicle, at_s): (usize, &f64)| {
        format!("[[faults]]\nkind = \"battery-low\"\nvehicle = {vehicle}\nat_s = {at_s:.1}\n")
    };
    (1..).zip(at_s).map(low).collect()
}

/// A scenario without gusts, with good estimates, and the low batteries that cut its first flight
/// or two short. Seed 0 lands at about 40 % of the area, the others anywhere.
fn cut_short(seed: u64) -> (String, Vec<String>) {
    let mut random = Pcg32::seed_from_u64(seed);
    let autopilot = ["px4", "ardupilot"][(seed % 2) as usize];
    let place = format!("personality = \"{autopilot}\"\nstart");
    let mut text = SMALL_FIELD_SCENARIO.replace("start", &place);
    if seed > 0 {
        let cruise = areas::between(&mut random, 3.0, 5.0);
        text = text.replace("cruise_mps = 5.0", &format!("cruise_mps = {cruise:.1}"));
        let trigger = ["distance", "distance", "waypoint"][(random.next_u32() % 3) as usize];
        let front = areas::between(&mut random, 0.6, 0.8);
        let camera = format!("trigger = \"{trigger}\"\noverlap_front = {front:.2}\ncamera");
        text = text.replace("camera", &camera);
    }
    if seed == 0 {
        return (text, vec![batteries_low(&[FORTY_PERCENT_S; 3])]);
    }
    let one = |random: &mut Pcg32| {
        let (low, at_s) = (40.0, areas::between(random, 40.0, 192.0));
        // The batteries of all are low at once, or each at its own time.
        let spread = [0.0, 30.0][(random.next_u32() % 2) as usize];
        let each = [0; 3].map(|_| (at_s + areas::between(random, -1.0, 1.0) * spread).max(low));
        batteries_low(&each)
    };
    let flights = 1 + random.next_u32() % 2;
    (text, (0..flights).map(|_| one(&mut random)).collect())
}

/// Flies a mission of [`cut_short`] until it is whole. Returns how many flights were cut short
/// before, or what is wrong.
fn seam(seed: u64) -> Result<usize, String> {
    let (text, faults) = cut_short(seed);
    let dir = tempfile::tempdir().expect("a directory");
    let (mut pictures, mut said) = (Vec::new(), String::new());
    let mut cut = 0;
    // Batteries may be low only after the last picture: then nothing is left to fly.
    for fault in faults.iter().map(String::as_str).chain([""]) {
        let (result, log) =
            fly(&format!("{text}{fault}"), dir.path(), &mut pictures).expect("it flies");
        let coverage = result.coverage.expect("it has an area");
        let _ = writeln!(said, "{fault}{coverage:?}\n{log}");
        let (left, waypoints) = (coverage.missed_waypoints, u64::from(coverage.waypoint_count));
        // For each flight that is cut short, a few waypoints of each of the three vehicles are
        // flown again.
        let again = 3 * 4 * cut as u64;
        let right =
            coverage.repeated_waypoints <= again && pictures.len() as u64 <= waypoints + 2 * again;
        let forty =
            seed > 0 || cut > 0 || (35..=45).contains(&(100 * (waypoints - left) / waypoints));
        match (coverage.covered_share >= 1.0 && left == 0, right && forty) {
            (true, true) => return Ok(cut),
            (false, true) => cut += 1,
            (_, false) => break,
        }
    }
    Err(format!("seed {seed}, start {}:\n{text}{said}", cut + 1))
}

/// Low batteries land the vehicles at any moment, and they restart from flash. The start after the
/// last flight that was cut short flies all of the rest.
#[test]
fn what_low_batteries_left_is_flown_by_the_next_start_and_nothing_is_left_at_the_seam() {
    let (from, count) =
        (number_from_env("FLOCKMATE_SEAMS_FROM", 0), number_from_env("FLOCKMATE_SEAMS", 12));
    let all: Vec<_> = (from..from + count).into_par_iter().map(seam).collect();
    let wrong: Vec<_> = all.iter().filter_map(|outcome| outcome.as_ref().err()).collect();
    wrong.iter().for_each(|wrong| println!("{wrong}"));
    let after = |cut: usize| all.iter().filter(|outcome| **outcome == Ok(cut)).count();
    println!("whole after 0, 1 and 2 flights that were cut short: {:?}", [0, 1, 2].map(after));
    assert!(wrong.is_empty(), "{} of {count} are not whole", wrong.len());
    assert!(10 * (after(1) + after(2)) as u64 >= 9 * count && (after(2) > 0 || count < 4));
}
