//! Coverage missions in which a vehicle stands still or cannot start: paused, in its climb, without
//! a position. The others may neither fly into it nor wait for it for ever.
//!
//! `FLOCKMATE_STANDS=N` flies N missions of each test, `FLOCKMATE_STANDS_FROM=SEED` from another
//! seed on; with N = 1 the scenario is printed.

use flockmate_tests::{areas, assert_no_seed_is_wrong, covered};
use host_sim::result::{MissionResult, VehicleResult};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

const MISSIONS: u64 = 6;

fn fault(at_s: f64, kind: &str, vehicle: usize, rest: &str) -> String {
    format!("[[faults]]\nat_s = {at_s:.1}\nkind = \"{kind}\"\nvehicle = {vehicle}\n{rest}")
}

/// An area for so many vehicles, their pads side by side.
fn area(random: &mut Pcg32, count: usize) -> String {
    areas::lossy_radio_scenario(random, count, 0.1)
}

fn is_not_whole(result: &MissionResult) -> bool {
    result.coverage.as_ref().is_none_or(|coverage| coverage.covered_share < 1.0)
}

/// Flies the scenarios that `draw` draws; fails if `wrong` is true for a result and its log.
fn fly_all(draw: fn(&mut Pcg32) -> String, wrong: impl Fn(&MissionResult, &str) -> bool + Sync) {
    let one = |seed: u64| -> Option<bool> {
        let text = draw(&mut Pcg32::seed_from_u64(seed));
        if std::env::var("FLOCKMATE_STANDS").is_ok_and(|n| n == "1") {
            println!("{text}");
        }
        let (result, log) = covered::fly_text(&text).ok()?;
        let (safety, coverage) =
            (&result.safety, result.coverage.as_ref().expect("it has an area"));
        let wrong = safety.violations + safety.wall_contacts > 0 || wrong(&result, &log);
        if wrong {
            let share = 100.0 * coverage.covered_share;
            println!(
                "seed {seed}: {share:.2} %, left {}, {safety:?}\n{log}",
                coverage.missed_waypoints
            );
        }
        Some(wrong)
    };
    assert_no_seed_is_wrong("FLOCKMATE_STANDS", MISSIONS, one);
}

/// After a while others assume that a silent vehicle is down, and fly where it was. So no state may
/// keep it up for longer, not even a pause or a slow climb.
#[test]
fn a_vehicle_that_stands_unheard_is_down_before_others_fly_there() {
    let draw = |random: &mut Pcg32| {
        let count = 3 + (random.next_u32() % 2) as usize;
        let mut text = area(random, count);
        let vehicle = 1 + random.next_u32() as usize % count;
        let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
        match random.next_u32() % 3 {
            0 => {
                let slow = "climb_mps = 0.7\nspeed_max_mps";
                text = text.replace("speed_max_mps", slow);
                text + &fault(5.0 + 60.0 * share, "radio-cut", vehicle, "")
            }
            _ => {
                let paused_s = 20.0 + 180.0 * share;
                let silent_s = paused_s + f64::from(random.next_u32() % 60) - 10.0;
                text += &fault(paused_s, "pause-order", vehicle, "");
                text + &fault(silent_s, "radio-cut", vehicle, "")
            }
        }
    };
    fly_all(draw, |result, _| is_not_whole(result));
}

/// A vehicle that has no position or plan on its pad, hears no other, or has no position after a
/// restart in the field is heard but commits to nothing. The others divide its share all the same,
/// after a loss and without one.
#[test]
fn what_cannot_start_leaves_its_share_to_the_others() {
    let draw = |random: &mut Pcg32| {
        let count = 4;
        let mut text = area(random, count);
        let vehicle = 1 + random.next_u32() as usize % count;
        let for_long = "duration_s = 3000.0\n";
        text += &match random.next_u32() % 5 {
            0 => fault(0.0, "gps-loss", vehicle, for_long),
            1 => fault(0.0, "late-plan", vehicle, for_long),
            2 => {
                let deaf = format!("{for_long}direction = \"rx\"\n");
                fault(0.0, "radio-cut", vehicle, &deaf)
            }
            3 => {
                let held = fault(0.5, "pause-order", vehicle, "duration_s = 20.0\n");
                held + &fault(15.0, "gps-loss", vehicle, for_long)
            }
            // Autopilot and board lose power in flight.
            _ => {
                ["autopilot-reboot", "companion-reset"]
                    .map(|kind| fault(60.0, kind, vehicle, ""))
                    .concat()
                    + &fault(60.0, "gps-loss", vehicle, for_long)
            }
        };
        if random.next_u32().is_multiple_of(2) {
            text += &fault(90.0, "kill", 1 + vehicle % count, "");
        }
        text
    };
    // Without a majority the remaining vehicles land.
    let lands = |log: &str| log.contains("Neighbours still silent: landing");
    fly_all(draw, |result, log| is_not_whole(result) && !lands(log));
}

/// As above, with pads so near to each other that the gates of the others may wait for the vehicle
/// that cannot start, and without another one in flight.
#[test]
fn what_cannot_start_keeps_no_other_on_its_pad() {
    let draw = |random: &mut Pcg32| {
        let count = [2, 2, 3, 5][(random.next_u32() % 4) as usize];
        let apart_m = 3.0 + f64::from(random.next_u32() % 30) / 10.0;
        let stuck = 1 + random.next_u32() as usize % count;
        // With RTK the positions, and so the plans, come after the fault has begun.
        let kind = ["gps-loss", "late-plan"][(random.next_u32() % 2) as usize];
        let pad = |k: usize| {
            let [x, y] = [(k % 3) as f64 * apart_m, -20.0 - (k / 3) as f64 * apart_m];
            format!("[[vehicles]]\nid = {}\nstart = [{x:.1}, {y:.1}, 0]\n", k + 1)
        };
        "[area]\npolygon = [[0, 0], [150, 10], [170, 90], [80, 120], [-10, 80]]\n\
         camera = { fov_deg = 73.7, aspect = 1.5 }\nheight_m = 35.0\n\
         [mission]\ncruise_mps = 5.0\n[deconfliction]\nseparation_m = 5.2\n\
         [simulation]\nestimator = \"rtk\"\ntime_limit_s = 2400.0\n"
            .to_owned()
            + &(0..count).map(pad).collect::<String>()
            + &fault(0.0, kind, stuck, "duration_s = 20000.0\n")
    };
    fly_all(draw, |result, _| is_not_whole(result));
}

/// Of small areas several vehicles have no part: once the others are home, the mission ends for
/// them too.
#[test]
fn vehicles_in_reserve_end_once_no_other_flies() {
    let draw = |random: &mut Pcg32| {
        let [wide_m, high_m] = [0, 1].map(|_| 20 + random.next_u32() % 40);
        let vehicles: String = (1..=5)
            .map(|id| format!("[[vehicles]]\nid = {id}\nstart = [{}, -20, 0]\n", 5 * id))
            .collect();
        format!(
            "[area]\npolygon = [[0, 0], [{wide_m}, 0], [{wide_m}, {high_m}], [0, {high_m}]]\n\
             method = \"powell\"\ncamera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = 70.0\n\
             [mission]\ncruise_mps = 3.0\n[simulation]\nradio_loss = 0.2\n{vehicles}"
        )
    };
    let waits = |result: &MissionResult, log: &str| {
        let stays = ["No goal for this vehicle: staying"];
        let ended =
            |v: &VehicleResult| v.end.starts_with("Done") || covered::has_logged(log, v.id, &stays);
        is_not_whole(result) || !result.vehicles.iter().all(ended)
    };
    fly_all(draw, waits);
}

/// A pause during the take-offs delays the mission, but ends it for no vehicle.
#[test]
fn a_pause_in_the_start_ends_no_mission() {
    let draw = |random: &mut Pcg32| {
        let count = 2;
        let text = area(random, count);
        let vehicle = 1 + random.next_u32() as usize % count;
        // ArduPilots are ready after 40 s, PX4s at once.
        let ready_s = f64::from(random.next_u32() % 2) * 40.0;
        let at_s = ready_s + 0.5 + f64::from(random.next_u32() % 100) / 10.0;
        let for_s = 12.0 + f64::from(random.next_u32() % 20);
        text + &fault(at_s, "pause-order", vehicle, &format!("duration_s = {for_s:.1}\n"))
    };
    fly_all(draw, |result, _| !result.complete);
}

/// A second vehicle is lost while the others wait until the first one, which is high or descends
/// slowly, is down: they wait for the second one too, and then divide.
#[test]
fn a_loss_during_a_division_delays_it_and_lands_nobody() {
    let draw = |random: &mut Pcg32| {
        let height_m = [25, 90][random.next_u32() as usize % 2];
        let descend_mps = 0.4 + f64::from(random.next_u32() % 16) / 10.0;
        let mut text = String::from(
            "[area]\npolygon = [[0, 0], [350, 10], [380, 190], [180, 260], [-10, 170]]\n\
             camera = { fov_deg = 73.7, aspect = 1.5 }\n\
             [mission]\ncruise_mps = 5.0\n[simulation]\ntime_limit_s = 7200.0\n",
        );
        text = text.replace("[mission]", &format!("height_m = {height_m}.0\n[mission]"));
        for id in 1..=5 {
            let x = 10 * id;
            text += &format!(
                "[[vehicles]]\nid = {id}\nstart = [{x}, -20, 0]\nendurance_s = 7200.0\n\
                 descend_mps = {descend_mps:.1}\n"
            );
        }
        let first = 1 + random.next_u32() as usize % 5;
        let second = 1 + (first + random.next_u32() as usize % 4) % 5;
        let at_s = 120.0 + f64::from(random.next_u32() % 60);
        let after_s = f64::from(random.next_u32() % 300);
        text += &fault(at_s, "kill", first, "");
        text + &fault(at_s + after_s, "kill", second, "")
    };
    fly_all(draw, |result, _| is_not_whole(result));
}

/// A vehicle whose pad is so far away that the others finish sooner without it has no part. It
/// stays in reserve, and takes over where one of two others is lost.
#[test]
fn a_vehicle_without_a_part_takes_over_from_a_lost_one() {
    let draw = |random: &mut Pcg32| {
        let far_m = 600 + random.next_u32() % 300;
        let far = 1 + random.next_u32() as usize % 3;
        let mut text = String::from(
            "[area]\npolygon = [[0, 0], [160, 0], [160, 100], [0, 100]]\n\
             camera = { fov_deg = 73.7, aspect = 1.5 }\nheight_m = 25.0\n\
             [mission]\ncruise_mps = 5.0\n\
             [simulation]\nradio_range_m = 3000.0\ntime_limit_s = 7200.0\n",
        );
        for id in 1..=3 {
            let x = if id == far { -f64::from(far_m) } else { 10.0 * id as f64 };
            text +=
                &format!("[[vehicles]]\nid = {id}\nstart = [{x}, -20, 0]\nendurance_s = 7200.0\n");
        }
        let lost = 1 + (far + random.next_u32() as usize % 2) % 3;
        text + &fault(30.0 + f64::from(random.next_u32() % 100), "kill", lost, "")
    };
    fly_all(draw, |result, _| is_not_whole(result) || !result.complete);
}
