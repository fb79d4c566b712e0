//! Coverage missions flown whole: companions plan from the mission file, the autopilots trigger
//! their cameras, and the pictures are judged by where they were truly taken.

use std::sync::atomic::{AtomicUsize, Ordering};

use companion::margins::{self, CRUISE_TRACKING_ERROR_M};
use flockmate_tests::areas::{self, Shape};
use flockmate_tests::{covered, number_from_env};
use host_sim::coverage::CoveragePlan;
use host_sim::mission::{PreparedMission, flight_by_companion_s};
use host_sim::progress::Progress;
use host_sim::result::MissionResult;
use host_sim::scenario;
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Reasons for which a random area may be refused.
const NO_FLIGHT: [&str; 6] = [
    "too many corners",
    "area too large",
    "bad area",
    "bad scenario",
    "no-fly zone",
    "cannot keep vehicles apart",
];

/// `FLOCKMATE_FLOWN=N` flies N areas, `FLOCKMATE_FLOWN_FROM=SEED` from another seed on.
#[test]
fn random_areas_are_photographed_whole() {
    are_photographed_whole(areas::flyable_scenario, 0);
}

#[test]
fn random_areas_are_photographed_whole_fast_and_from_high() {
    are_photographed_whole(areas::survey_scenario, 0);
}

#[test]
fn large_random_areas_are_photographed_whole_in_stretches() {
    are_photographed_whole(areas::many_lanes_scenario, 1);
}

#[test]
fn random_areas_are_flown_over_whole_without_a_trigger() {
    let draw = |random: &mut Pcg32, shape, vehicles| {
        let text = areas::flyable_scenario(random, shape, vehicles);
        text.replace("\"distance\"", "\"none\"").replace("\"waypoint\"", "\"none\"")
    };
    are_photographed_whole(draw, 0);
}

/// Flies random areas of `draw`; at least `stretched` of them must be flown in stretches.
fn are_photographed_whole(draw: fn(&mut Pcg32, Shape, usize) -> String, stretched: usize) {
    let (from, count) =
        (number_from_env("FLOCKMATE_FLOWN_FROM", 0), number_from_env("FLOCKMATE_FLOWN", 16));
    let in_stretches = AtomicUsize::new(0);
    let outcome = |seed: u64| -> Result<Option<&str>, String> {
        let mut random = Pcg32::seed_from_u64(seed);
        let shape = if seed.is_multiple_of(2) { Shape::Any } else { Shape::Convex };
        let text = draw(&mut random, shape, [1, 3, 5][(seed % 3) as usize]);
        match covered::fly_text(&text) {
            Ok((result, log)) => {
                match covered::faults_text(&result).or_else(|| late(&text, &result)) {
                    None => {
                        let divided = log.contains("Area divided again");
                        in_stretches.fetch_add(usize::from(divided), Ordering::Relaxed);
                        Ok(None)
                    }
                    Some(faults) => Err(format!("seed {seed}: {faults}\n{log}{text}")),
                }
            }
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
    let ended = |how: Option<&str>| {
        all.iter().filter(|outcome| outcome.as_ref() == Ok(&how)).count() as u64
    };
    for known in NO_FLIGHT {
        println!("{known}: {}", ended(Some(known)));
    }
    let flown = ended(None);
    let in_stretches = in_stretches.into_inner();
    println!(
        "{flown} of {count} areas flown, {in_stretches} of them in stretches, {} wrong",
        wrong.len()
    );
    assert!(in_stretches >= stretched);
    assert!(wrong.is_empty() && flown >= count / 4, "{flown} flown, {} wrong", wrong.len());
}

/// Greatest flight time of a vehicle that flies alone, as a multiple of the time by which its
/// battery is checked.
const MOST_BEYOND_PLAN: f64 = 1.07;

/// Names a vehicle alone over its area that flew much longer than its battery was checked for.
fn late(text: &str, result: &MissionResult) -> Option<String> {
    let [vehicle] = &result.vehicles[..] else { return None };
    let scenario = scenario::parse(text, "area").expect("it was flown");
    let planned = CoveragePlan::plan_as_companions(&scenario).expect("it was flown");
    let planned_s = f64::from(flight_by_companion_s(&planned, &planned.plan.routes[0]));
    let flown_s = vehicle.flight_time_s;
    println!("RATIO {} {flown_s} {planned_s}", flown_s / planned_s);
    (flown_s > MOST_BEYOND_PLAN * planned_s)
        .then(|| format!("planned for {planned_s:.0} s, flown in {flown_s:.0} s"))
}

/// The tracks of paper CPP, Tables A1 to A12, as docs/coverage-checked.md derives them from the
/// paper's times: east and north, metres.
const TRACKS: [(&str, [u32; 2]); 2] = [("short", [150, 180]), ("long", [320, 420])];

/// Scenario of one of these tracks: lanes 10 m apart, flown at 35 m height and 5 m/s as in the
/// paper, in gusts of 3 m/s.
fn track([east_m, north_m]: [u32; 2], vehicles: usize, autopilot: &str, estimator: &str) -> String {
    let separation_m = if estimator == "recorded" { 3.6 } else { 2.0 };
    let pads = (0..vehicles).map(|k| {
        format!(
            "[[vehicles]]\nid = {}\nstart = [{}, -20, 0]\npersonality = \"{autopilot}\"\nspeed_max_mps = 8.0\n\
             climb_mps = 3.0\ndescend_mps = 1.0\nendurance_s = 2400.0\n",
            k + 1,
            5 * k
        )
    });
    format!(
        "[area]\npolygon = [[0, 0], [{east_m}, 0], [{east_m}, {north_m}], [0, {north_m}]]\n\
         camera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = 35.0\nlane_m = 10.0\nwaypoint_m = 10.0\n\
         [mission]\ncruise_mps = 5.0\n[deconfliction]\nseparation_m = {separation_m}\n[simulation]\n\
         estimator = \"{estimator}\"\ngust_mps = 3.0\nradio_range_m = 2000.0\ntime_limit_s = 7200.0\n{}",
        pads.collect::<String>()
    )
}

/// The short and the long track by 3 and by 5 vehicles of either autopilot with either estimator.
#[test]
fn the_papers_tracks_are_photographed_whole() {
    let mut cases = Vec::new();
    for (name, sides) in &TRACKS {
        for vehicles in [3, 5] {
            for autopilot in ["px4", "ardupilot"] {
                for estimator in ["rtk", "recorded"] {
                    cases.push((*name, *sides, vehicles, autopilot, estimator));
                }
            }
        }
    }
    let one =
        |(name, sides, vehicles, autopilot, estimator): &(&str, [u32; 2], usize, &str, &str)| {
            let case = format!("{name} | {vehicles} | {autopilot} | {estimator}");
            let (result, log) = covered::fly_text(&track(*sides, *vehicles, autopilot, estimator))
                .unwrap_or_else(|error| panic!("{case}: {error}"));
            let coverage = result.coverage.as_ref().expect("it has an area");
            println!(
                "| {case} | {:.0} | {} | {:.2} % | {} | {} | {:.2} |",
                result.totals.makespan_s,
                coverage.photos,
                100.0 * coverage.covered_share,
                coverage.missed_waypoints,
                coverage.repeated_waypoints,
                result.safety.min_separation_m.unwrap_or(f64::NAN),
            );
            covered::faults_text(&result).map(|faults| format!("{case}: {faults}\n{log}"))
        };
    let wrong: Vec<String> = cases.par_iter().filter_map(one).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n").chars().take(4000).collect::<String>());
}

/// With `trigger = "none"` no pictures are requested: the mission is complete once all of the area
/// is flown over, and not if a vehicle fell before that.
#[test]
fn without_a_trigger_a_mission_is_complete_once_it_is_flown() {
    let field = "[area]\npolygon = [[0, 0], [80, 0], [80, 60], [0, 60]]\ntrigger = \"none\"\n\
                 camera = { fov_deg = 73.7, aspect = 1.5 }\nheight_m = 35.0\n[mission]\n\
                 cruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [0, -20, 0]\nspeed_max_mps = 8.0\n";
    let fly = |more: &str| covered::fly_text(&format!("{field}{more}")).expect("it is flown").0;
    let whole = fly("");
    let coverage = whole.coverage.as_ref().expect("it has an area");
    let found =
        (coverage.trigger, coverage.photos, coverage.covered_share, coverage.missed_waypoints);
    assert_eq!((whole.complete, found), (true, ("none", 0, 1.0, 0)));
    let cut = fly("[[faults]]\nkind = \"kill\"\nat_s = 70.0\nvehicle = 1\n");
    let coverage = cut.coverage.as_ref().expect("it has an area");
    assert!(!cut.complete && coverage.photos == 0, "{coverage:?}");
    assert!(
        (0.1..0.9).contains(&coverage.covered_share) && coverage.missed_waypoints > 5,
        "{coverage:?}"
    );
}

/// A vehicle that is paused and resumed photographs its part, whether on the pad, during its start
/// or in the air.
#[test]
fn a_vehicle_paused_at_any_time_goes_on_when_it_is_resumed() {
    let one = |seed: u64| {
        let mut random = Pcg32::seed_from_u64(seed);
        // Two of three are paused near the start, since the times on the pad are short.
        let at_s = 0.5 + (random.next_u32() % [600, 6000][(seed % 3 / 2) as usize]) as f32 / 100.0;
        let (duration_s, vehicle) =
            ((1 + random.next_u32() % 40) as f32 / 10.0, 1 + random.next_u32() % 2);
        let autopilot = ["px4", "ardupilot"][(seed % 2) as usize];
        let text = format!(
            "seed = {seed}\n[area]\npolygon = [[0, 0], [80, 0], [80, 60]]\ncamera = {{ fov_deg = 73.7, aspect = 1.5 }}\n\
             height_m = 25.0\n[mission]\ncruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [0, -20, 0]\n\
             personality = \"{autopilot}\"\nspeed_max_mps = 15.0\n[[vehicles]]\nid = 2\nstart = [12, -20, 0]\n\
             personality = \"{autopilot}\"\nspeed_max_mps = 15.0\n[[faults]]\nkind = \"pause-order\"\nat_s = {at_s}\n\
             duration_s = {duration_s}\nvehicle = {vehicle}\n"
        );
        let (result, log) = covered::fly_text(&text).expect("it is flown");
        covered::faults_text(&result).map(|faults| format!("seed {seed}: {faults}\n{log}{text}"))
    };
    let count = number_from_env("FLOCKMATE_PAUSES", 40);
    let wrong: Vec<String> = (0..count).into_par_iter().filter_map(one).collect();
    assert!(
        wrong.is_empty(),
        "{} of {count}\n{}",
        wrong.len(),
        wrong[0].chars().take(4000).collect::<String>()
    );
}

/// Two vehicles whose estimates each err as much as is possible without a stop keep the safety
/// distance, whatever the separation.
#[test]
fn over_fields_estimates_have_the_room_that_the_separation_leaves() {
    let mut random = Pcg32::seed_from_u64(7);
    for _ in 0..40 {
        let mut between =
            |low: f32, high: f32| low + (high - low) * (random.next_u32() as f32 / u32::MAX as f32);
        let safety_m = between(0.8, 2.0);
        let separation_m = safety_m + 2.0 * CRUISE_TRACKING_ERROR_M + between(0.0, 8.0);
        let text = format!(
            "[area]\npolygon = [[0, 0], [90, 0], [90, 70]]\ncamera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = 30.0\n\
             [mission]\ncruise_mps = 12.0\n[[vehicles]]\nid = 1\nstart = [0, -20, 0]\nspeed_max_mps = 15.0\n\
             [deconfliction]\nsafety_distance_m = {safety_m}\nseparation_m = {separation_m}\n"
        );
        let scenario = scenario::parse(&text, "area").expect("a scenario");
        let mission = PreparedMission::prepare(scenario, &Progress::hidden()).expect("a mission");
        let radius_m = mission.scenario.vehicles[0].radius_m;
        let pace = |bound_m: f32| {
            margins::speed_share_for_error_bound(
                bound_m,
                mission.tasks[0].required_clearance_m,
                radius_m,
            )
        };
        let room_m = (separation_m - safety_m) / 2.0 - CRUISE_TRACKING_ERROR_M;
        assert_eq!(pace(room_m - 0.01), 1.0, "{separation_m} m beyond {safety_m} m");
        assert!(pace(room_m + 0.01) < 1.0, "{separation_m} m beyond {safety_m} m");
    }
}

/// Judged by the autopilot's true heading at each picture.
#[test]
fn pictures_look_along_all_lanes_alike_or_the_way_that_is_flown() {
    for (autopilot, heading) in
        [("px4", "sweep"), ("px4", "lane"), ("ardupilot", "sweep"), ("ardupilot", "lane")]
    {
        let text = format!(
            "[area]\npolygon = [[0, 0], [150, 0], [150, 60], [0, 60]]\nangle_deg = 0.0\n\
             camera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = 25.0\n\
             heading = \"{heading}\"\n\
             [mission]\ncruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [0, -20, 0]\n\
             personality = \"{autopilot}\"\n"
        );
        let scenario = scenario::parse(&text, "area").expect("a scenario");
        let mut mission =
            PreparedMission::prepare(scenario, &Progress::hidden()).expect("a mission");
        let mut pictures = Vec::new();
        covered::fly_adding_pictures(&mut mission, &mut pictures).expect("a flight");
        // Pictures in the middle of lanes: the angle between the nose and the direction of flight.
        let off_deg = pictures.windows(3).filter_map(|three| {
            let way = three[2].position - three[0].position;
            let along_lane = way.y.abs() < 1.0 && (20.0..130.0).contains(&three[1].position.x);
            let off = three[1].yaw_enu_rad - way.y.atan2(way.x);
            along_lane.then(|| f64::from(off).sin().atan2(f64::from(off).cos()).to_degrees().abs())
        });
        let off_deg: Vec<f64> = off_deg.collect();
        let share = |within: std::ops::Range<f64>| {
            let count = off_deg.iter().filter(|off| within.contains(off)).count();
            count as f64 / off_deg.len() as f64
        };
        let (ahead, back) = (share(0.0..15.0), share(165.0..181.0));
        let said =
            format!("{autopilot}, {heading}: {ahead} ahead, {back} back of {}", off_deg.len());
        assert!(off_deg.len() > 40, "{said}");
        match heading {
            "lane" => assert!(ahead > 0.999, "{said}"),
            // Every other lane is flown backwards.
            _ => assert!((0.35..0.65).contains(&ahead) && ahead + back > 0.999, "{said}"),
        }
    }
}

/// Pads as near to each other as a scenario may have them, low and fast flights, gusts: vehicles
/// come back over their pads and descend beside vehicles that stand there.
#[test]
fn vehicles_land_on_pads_as_near_as_they_may_be() {
    let outcome = |seed: u64| -> Result<(), String> {
        let mut random = Pcg32::seed_from_u64(seed);
        let mut one_of = |choices: &[f32]| choices[random.next_u32() as usize % choices.len()];
        let (height_m, cruise_mps) = (one_of(&[5.0, 8.0, 12.0, 20.0]), one_of(&[5.0, 8.0, 12.0]));
        let (gust_mps, side_m) = (one_of(&[0.0, 1.0, 3.0]), one_of(&[35.0, 42.0, 50.0]));
        let mut text = format!(
            "seed = {seed}\n[area]\npolygon = [[0, 0], [60, 0], [60, {side_m}], [0, {side_m}]]\ncamera = {{ fov_deg = 73.7 }}\n\
             height_m = {height_m}\n[mission]\ncruise_mps = {cruise_mps}\n[simulation]\ngust_mps = {gust_mps}\n"
        );
        let mut accepted = None;
        for centimetres in (150..400).step_by(5) {
            let apart_m = centimetres as f32 / 100.0;
            let pads = (0..3).map(|k| {
                format!(
                    "[[vehicles]]\nid = {}\nspeed_max_mps = 15.0\nstart = [{:.2}, -20, 0]\n",
                    k + 1,
                    20.0 + k as f32 * apart_m
                )
            });
            let all = text.clone() + &pads.collect::<String>();
            match scenario::parse(&all, "pads") {
                Ok(_) => {
                    text = all;
                    accepted = Some(centimetres);
                    break;
                }
                Err(error) => assert!(error.why.contains("to land beside each other"), "{error}"),
            }
        }
        let apart_cm = accepted.ok_or("no pads are far enough apart")?;
        let (result, log) = covered::fly_text(&text)?;
        match covered::faults_text(&result) {
            None => Ok(()),
            Some(faults) => {
                Err(format!("seed {seed}, pads {apart_cm} cm apart: {faults}\n{log}{text}"))
            }
        }
    };
    let count = number_from_env("FLOCKMATE_PADS", 16);
    let wrong: Vec<_> = (0..count).into_par_iter().filter_map(|seed| outcome(seed).err()).collect();
    println!("{count} flown, {} wrong", wrong.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n").chars().take(3000).collect::<String>());
}

#[test]
fn pictures_are_refused_so_low_that_an_error_reaches_the_ground() {
    for (estimator, autopilot, lower_m) in
        [("rtk", "px4", 0.15), ("recorded", "px4", 1.1), ("recorded", "ardupilot", 0.3)]
    {
        let prepared = |height_m: f32| {
            let text = format!(
                "[area]\npolygon = [[0, 0], [30, 0], [30, 20]]\nlane_m = 4\nheight_m = {height_m}\n[simulation]\n\
                 estimator = \"{estimator}\"\n[[vehicles]]\nid = 1\nstart = [0, -8, 0]\npersonality = \"{autopilot}\"\n"
            );
            let scenario = scenario::parse(&text, "area").expect("a scenario");
            PreparedMission::prepare(scenario, &Progress::hidden())
                .map(|mission| mission.scenario.vehicles[0].radius_m)
        };
        let radius_m = prepared(35.0).expect("a mission");
        let least_m = lower_m + radius_m + CRUISE_TRACKING_ERROR_M;
        assert!(prepared(least_m + 0.01).is_ok(), "{estimator} {autopilot}");
        let error = prepared(least_m - 0.01).expect_err("too low");
        assert!(format!("{error:#}").contains("pictures too low"), "{error:#}");
    }
}
