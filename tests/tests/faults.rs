//! Every kind of fault strikes a vehicle of the ten-UAV building mission, with each seed another
//! vehicle at another time.
//!
//! Whatever strikes, no other vehicle touches anything, no two others come nearer to each other
//! than the safety distance, and all others reach their goals. The struck vehicle ends in a row of
//! the companion's table, and the log says so. A fault that passes leaves the mission complete. One
//! exception is permitted: a vehicle may be hit by one that falls if there was provably no time to
//! leave ([`is_unavoidable`]).
//!
//! Counted but not asserted: vehicles nearer than the safety distance to the struck one while it
//! descends blindly, or to one that it hit. That none touches it is asserted.
//! `FLOCKMATE_FAULT_SEEDS=20 cargo test --release --workspace --test faults -- --nocapture` sweeps
//! twenty seeds and prints a line for each kind. `FLOCKMATE_FAULT_ONLY=kill` flies only the kinds
//! whose lines contain this text, `FLOCKMATE_FAULT_SEED=17` one seed, and prints its logs.

use flockmate_tests::vehicle::widest_late_leg_middle;
use host_sim::mission::{HostPlan, PreparedMission};
use host_sim::progress::Progress;
use host_sim::report::LogEvent;
use host_sim::result::VehicleResult;
use host_sim::scenario::{self, FAULT_OBSTACLE, Fault, Geofence, VEHICLE_FAULT_KINDS};
use host_sim::swarm::{self, SwarmFlight};
use planner_core::Point;
use rayon::prelude::*;

const DEMO: &str = include_str!("../../host-sim/scenarios/demo.toml");
/// Number of seeds unless `FLOCKMATE_FAULT_SEEDS` sets another.
const SEEDS: u64 = 2;
/// Time limit of a flight, seconds: every vehicle that is not held up has landed by then.
const TIME_LIMIT_S: f32 = 500.0;

/// What is expected of a kind of fault.
#[derive(Clone, Copy, PartialEq)]
enum Then {
    /// It passes: the mission is flown to its end.
    GoesOn,
    /// The vehicle is out of the plan.
    Out,
}
use Then::{GoesOn, Out};

/// One kind of fault.
struct Case {
    /// The TOML lines of `[[faults]]` besides `at_s` and `vehicle`. ID stands for the vehicle,
    /// LATER for a time 8 s later, AHEAD for a place on its path.
    script: &'static str,
    then: Then,
    /// A vehicle struck on its path must log one of these.
    says: &'static [&'static str],
}

/// The companion's text when the autopilot's own failsafe acts: the companion stops sending
/// setpoints.
const FAILSAFE_ACTS: &str = "Autopilot failsafe: setpoints stopped";
const FOUND: &str = "Found in flight: no mission";
const AT_GOAL: &str = "At the goal: landing";
/// Distance from starts and goals to the geofence around them, metres: what the roadmap requires,
/// and more so that passages are found.
const ROOM_AT_FENCE_M: f32 = 1.5;
const FLIES_BACK: &str = "No way around, no room below: flying back";
/// Where another vehicle landed on the only way, one that waits on its pad stays there.
const STAYS: &str = "PadReplanning → Scheduled: No way around yet";
const AT_FENCE: &str = "Geofence reached: landing";
/// Not a fault of the scenario: a geofence that the paths of some vehicles leave.
const GEOFENCE: &str = "geofence";
const RETURNED: &str =
    "kind = 'pilot-takeover'\n[[faults]]\nkind = 'pilot-return'\nat_s = LATER\nvehicle = ID";
#[rustfmt::skip]
const CASES: &[Case] = &[
    Case { script: "kind = 'kill'", then: Out, says: &["fault begins: kill"] },
    Case { script: "kind = 'radio-cut'\ndirection = 'tx'\nduration_s = 20", then: GoesOn, says: &[AT_GOAL] },
    Case { script: "kind = 'radio-cut'\ndirection = 'rx'\nduration_s = 20", then: GoesOn, says: &[AT_GOAL] },
    Case { script: "kind = 'radio-cut'\nduration_s = 20", then: GoesOn, says: &[AT_GOAL] },
    Case { script: "kind = 'radio-cut'", then: Out, says: &[AT_GOAL, "Neighbours still silent: landing"] },
    Case { script: "kind = 'serial-stall'\nduration_s = 0.8", then: GoesOn, says: &[AT_GOAL] },
    Case { script: "kind = 'serial-stall'", then: Out, says: &["Position lost: stopping"] },
    Case { script: "kind = 'serial-stall'\nduration_s = 6", then: Out, says: &["Autopilot silent: stopping"] },
    Case { script: "kind = 'serial-stall'\nduration_s = 600", then: Out, says: &["Autopilot silent: stopping"] },
    Case { script: "kind = 'serial-corrupt'", then: GoesOn, says: &[AT_GOAL] },
    Case { script: "kind = 'position-jump'", then: Out, says: &["Position is elsewhere: landing"] },
    Case { script: "kind = 'position-jump'\noffset_m = [0, 0, -5]", then: Out, says: &["Position is elsewhere: landing"] },
    Case { script: "kind = 'origin-change'", then: Out, says: &["EKF origin moved: landing"] },
    Case { script: "kind = 'gps-loss'", then: Out, says: &[FAILSAFE_ACTS, "Position still lost: landing"] },
    Case { script: "kind = 'gps-loss'\nduration_s = 0.5", then: Out, says: &[FAILSAFE_ACTS, AT_GOAL] },
    Case { script: "kind = 'battery-low'", then: Out, says: &["Battery low: landing", "Battery critical: landing", AT_GOAL] },
    Case { script: "kind = 'pilot-takeover'", then: Out, says: &["Pilot has control: mission stopped"] },
    Case { script: "kind = 'pilot-takeover'\nduration_s = 8", then: GoesOn, says: &["Resumed after the pilot"] },
    Case { script: RETURNED, then: GoesOn, says: &["Resumed after the pilot"] },
    Case { script: "kind = 'autopilot-reboot'", then: Out, says: &["Disarmed in flight: mission over"] },
    Case { script: "kind = 'companion-reset'", then: Out, says: &[FOUND] },
    Case { script: "kind = 'late-plan'\nduration_s = 40", then: GoesOn, says: &["Plan is late: asked again"] },
    Case { script: "kind = 'obstacle'\nradius_m = 0.4\nposition = AHEAD", then: GoesOn, says: &["Flying around", AT_GOAL] },
    // Detours stay inside the fence too: past a vehicle that has landed at it there may be no path.
    Case { script: GEOFENCE, then: Out, says: &[AT_FENCE, "No way around: landing", FLIES_BACK, STAYS] },
    Case { script: "kind = 'pause-order'\nduration_s = 8", then: GoesOn, says: &["Resumed"] },
    Case { script: "kind = 'return-order'", then: Out, says: &["Flying back to the start", "Landing on the pad", CANCELLED] },
    Case { script: "kind = 'land-order'", then: Out, says: &["Landing as commanded", CANCELLED] },
    Case { script: "kind = 'bad-roadmap'", then: Out, says: &["Roadmap or field missing or wrong: mission aborted"] },
];

const CANCELLED: &str = "Start cancelled as commanded";
const UNFOLLOWED: &str = "Setpoint not followed: landing";
/// Not solved yet: if a vehicle's autopilot is silent for good, others may land short of their
/// goals.
const OTHERS_LAND_SHORT: &str = "duration_s = 600";
/// States in which the mission of a struck vehicle may end.
const RESTS: &[&str] = &["Done", "Aborted", "WaitAutopilot", "Killed", "PilotControl", "Scheduled"];

impl Case {
    fn on_ground(&self) -> bool {
        self.script.contains("late-plan") || self.script.contains("bad-roadmap")
    }

    fn faults(&self, at_s: f32, vehicle: u8, plan: &HostPlan) -> Vec<Fault> {
        let [x, y, z] = widest_late_leg_middle(&plan.flights[usize::from(vehicle) - 1].path).into();
        let script = self
            .script
            .replace("LATER", &(at_s + 8.0).to_string())
            .replace("ID", &vehicle.to_string())
            .replace("AHEAD", &format!("[{x}, {y}, {z}]"));
        let text = format!("{DEMO}\n[[faults]]\nat_s = {at_s}\nvehicle = {vehicle}\n{script}\n");
        let scenario = scenario::parse(&text, "faults.toml").expect("the script is good");
        scenario.check_supported().expect("every kind can be played");
        scenario.faults
    }
}

/// The demo's mission by a seed, and its plan.
fn prepare(seed: u64) -> (PreparedMission, Box<HostPlan>) {
    prepare_inside(None, seed)
}

/// As [`prepare`], planned inside a geofence.
fn prepare_inside(geofence: Option<Geofence>, seed: u64) -> (PreparedMission, Box<HostPlan>) {
    let mut scenario = scenario::parse(DEMO, "demo.toml").expect("the demo is good");
    scenario.seed = seed;
    scenario.simulation.time_limit_s = TIME_LIMIT_S;
    scenario.mission.geofence = geofence;
    let mut mission =
        PreparedMission::prepare(scenario, &Progress::on_terminal()).expect("the demo has room");
    let plan = mission.plan().expect("the demo has a plan");
    (mission, plan)
}

fn fly(mission: &PreparedMission, plan: &HostPlan) -> SwarmFlight {
    swarm::fly(mission, plan, "fly", swarm::Pace::Fastest, &Progress::on_terminal())
        .expect("the script can be played")
}

/// How one flight ended; `wrong` has a text for each broken rule.
struct Outcome {
    complete: bool,
    /// Events in which a falling vehicle hits another.
    hit: usize,
    /// Events in which two vehicles come nearer than the safety distance.
    too_near: usize,
    notes: Vec<String>,
    wrong: Vec<String>,
}

fn judge(case: &Case, flight: &SwarmFlight, at_s: f32, struck: &[u8]) -> Outcome {
    let result = &flight.result;
    let (mut wrong, mut notes) = (Vec::new(), Vec::new());
    let is_struck = |e: &LogEvent| e.vehicle.is_some_and(|id| struck.contains(&id));
    let said = |text: &str| flight.log.iter().any(|e| is_struck(e) && e.text.contains(text));
    // A vehicle that is out of the plan descends where it is, whatever is there.
    let own_contacts_count = case.then == GoesOn;
    // A fault that passes may still end the mission: before take-off a mode change by the pilot
    // cancels the start for good; armed but not yet up, the autopilot disarms; and a pilot's
    // takeover at the end of a landing ends it.
    let goes_on = case.then == GoesOn
        && !["start cancelled", "Disarmed in flight", "landing stopped"]
            .iter()
            .any(|text| said(text));
    let (mut too_near, mut hit) = (0, 0);
    // A vehicle that was unavoidably hit counts as struck from then on; the simulation lets it fly
    // on.
    let is_hit =
        |e: &&LogEvent| e.text.contains("is hit by falling") && is_unavoidable(flight, at_s, e);
    let hit_at: Vec<(u8, f32)> =
        flight.log.iter().filter(is_hit).filter_map(|e| Some((e.vehicle?, e.t_s))).collect();
    for e in &flight.log {
        let now_struck = hit_at.iter().filter(|(_, t_s)| *t_s <= e.t_s).map(|(id, _)| id);
        let by_or_at_struck = struck
            .iter()
            .chain(now_struck)
            .any(|id| e.vehicle == Some(*id) || e.text.ends_with(&format!(" vehicle {id}")));
        let own_wall = e.text.contains("touches an obstacle") && is_struck(e);
        let text = format!("{:.1} s vehicle {:?} {}", e.t_s, e.vehicle, e.text);
        let is_wrong = if e.text.contains("nearer than") {
            too_near += 1;
            notes.push(text.clone());
            goes_on || !by_or_at_struck
        } else if e.text.contains("is hit by falling") {
            hit += 1;
            notes.push(text.clone());
            !is_unavoidable(flight, at_s, e)
        } else {
            e.text.contains("touches") && (!own_wall || own_contacts_count)
        };
        if is_wrong {
            wrong.push(text);
        }
    }
    let did_its_task = |v: &&VehicleResult| v.reached && v.landed && v.end == "Done";
    // The struck vehicle hangs on an obstacle above others: it can neither leave nor land before
    // its battery is nearly empty.
    let hangs = said(UNFOLLOWED) && said("Vehicle still below: landing waits");
    for v in result.vehicles.iter().filter(|v| !did_its_task(v)) {
        let state = v.end.split(':').next().unwrap_or_default();
        let others_short = (hangs || case.script.contains(OTHERS_LAND_SHORT)) && v.landed;
        let rests =
            RESTS.contains(&state) || (hangs && struck.contains(&v.id) && state == "LandingHeld");
        if goes_on || !(struck.contains(&v.id) || others_short) || !rests {
            wrong.push(format!("vehicle {} ends in {}", v.id, v.end));
        }
    }
    if case.script == GEOFENCE && !said(AT_FENCE) {
        wrong.push(format!("none of {struck:?} said {AT_FENCE:?}"));
    }
    for vehicle in struck {
        let log: Vec<&LogEvent> =
            flight.log.iter().filter(|e| e.vehicle == Some(*vehicle)).collect();
        let by = |text: &str, t_s: f32| log.iter().any(|e| e.t_s < t_s && e.text.contains(text));
        let on_path = by("Following the path", at_s) && !by(AT_GOAL, at_s + 3.0);
        let says = |text: &&str| log.iter().any(|e| e.t_s >= at_s && e.text.contains(*text));
        if (on_path || case.on_ground() || case.script == GEOFENCE) && !case.says.iter().any(says) {
            let said: Vec<_> = log.iter().map(|e| e.text.as_str()).collect();
            wrong.push(format!("vehicle {vehicle} did not say {:?} but {said:?}", case.says));
        }
    }
    Outcome { complete: result.complete, hit, too_near, notes, wrong }
}

/// Whether no vehicle could have evaded a wreck. Others notice a fall only after 1 s without
/// positions (shorter gaps are common: see the stall of 0.8 s), 0.2 s until the next message, 0.05
/// s of radio delay and two steps of 0.05 s. The airframe responds 0.55 s later, then gains
/// distance at 1.5 m/s². The missing distance is the horizontal overlap of both hulls (radius 0.3 m
/// each).
fn is_unavoidable(flight: &SwarmFlight, at_s: f32, hit: &LogEvent) -> bool {
    let wreck = hit.text.rsplit(' ').next().and_then(|n| n.parse::<usize>().ok());
    let (Some(wreck), Some(vehicle)) = (wreck, hit.vehicle) else { return false };
    // The track nearest to the hit: positions are recorded every 0.2 s.
    let place = |i: usize| {
        let off = |point: &&(f32, Point)| (point.0 - hit.t_s).abs();
        flight.tracks[i].iter().min_by(|a, b| off(a).total_cmp(&off(b))).map(|point| point.1)
    };
    let (Some(a), Some(b)) = (place(usize::from(vehicle) - 1), place(wreck - 1)) else {
        return false;
    };
    let missing_m = 0.6 - (a - b).xy().norm();
    let left_s = (hit.t_s - at_s - 1.0 - 0.2 - 0.05 - 0.1 - 0.55).max(0.0);
    missing_m > 0.5 * 1.5 * left_s * left_s
}

/// A geofence that the paths of one to three vehicles leave and from which all other paths keep the
/// greatest distance, and the ids of these vehicles.
fn fence_for_some(plan: &HostPlan) -> (Vec<u8>, Geofence) {
    let reach = |axis: usize, sign: f32, i: usize| {
        let points = plan.flights[i].path.waypoints().iter();
        points.map(|w| sign * w.position[axis]).fold(f32::NEG_INFINITY, f32::max)
    };
    let mut best = (0.0, Vec::new(), 0, 1.0, 0.0);
    for (axis, sign) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0), (2, 1.0)] {
        let mut reaches: Vec<_> = (0..plan.flights.len())
            .map(|i| (reach(axis, sign, i), plan.flights[i].vehicle_id))
            .collect();
        reaches.sort_by(|a, b| b.0.total_cmp(&a.0));
        for out in 1..=3 {
            let (last, next) = (reaches[out - 1].0, reaches[out].0);
            if last - next > best.0 {
                let ids = reaches[..out].iter().map(|reach| reach.1).collect();
                best = (last - next, ids, axis, sign, 0.5 * (last + next));
            }
        }
    }
    let (gap_m, outside, axis, sign, at_m) = best;
    assert!(gap_m > 0.8, "nobody flies far enough from the others: {gap_m} m");
    let (mut min, mut max) = (Point::repeat(-1e3), Point::repeat(1e3));
    let corner = if sign < 0.0 { &mut min } else { &mut max };
    corner[axis] = sign * at_m;
    (outside, Geofence { min, max })
}

/// The seeds to fly, and whether their logs are printed.
fn seeds() -> (std::ops::RangeInclusive<u64>, bool) {
    let asked = |name| std::env::var(name).ok().map(|n| n.parse().expect("a number"));
    match (asked("FLOCKMATE_FAULT_SEED"), asked("FLOCKMATE_FAULT_SEEDS")) {
        (Some(seed), _) => (seed..=seed, true),
        (None, seeds) => (1..=seeds.unwrap_or(SEEDS), false),
    }
}

fn print_log(flight: &SwarmFlight) {
    let mut log: Vec<&LogEvent> = flight.log.iter().collect();
    log.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    for e in log {
        println!("{:7.2} s {:?} {}", e.t_s, e.vehicle, e.text);
    }
}

#[test]
fn every_kind_of_fault_has_a_case() {
    for kind in VEHICLE_FAULT_KINDS.iter().chain([&FAULT_OBSTACLE]) {
        assert!(
            CASES.iter().any(|case| case.script.contains(&format!("'{kind}'"))),
            "no case of {kind}"
        );
    }
}

#[test]
fn whatever_strikes_the_others_touch_nothing_and_the_log_says_why() {
    let (seeds, prints_log) = seeds();
    let only = std::env::var("FLOCKMATE_FAULT_ONLY").unwrap_or_default();
    let chosen = |case: &Case| case.script.contains(&only);
    let by_seed = |seed: u64| -> Vec<Outcome> {
        let (mut mission, plan) = prepare(seed);
        let strike = |(k, case): (usize, &Case)| {
            let k = k as u64;
            let mut struck = vec![(1 + (seed * 7 + k) % 10) as u8];
            let at_s = if case.on_ground() || case.script == GEOFENCE {
                0.0
            } else if case.script.contains("AHEAD") {
                // Before any vehicle can have reached the place.
                5.0
            } else {
                (6 + (seed * 13 + k * 5) % 26) as f32
            };
            mission.scenario.mission.geofence = None;
            if case.script == GEOFENCE {
                let (outside, fence) = fence_for_some(&plan);
                struck = outside;
                mission.scenario.mission.geofence = Some(fence);
                mission.scenario.faults.clear();
            } else {
                mission.scenario.faults = case.faults(at_s, struck[0], &plan);
            }
            let flight = fly(&mission, &plan);
            if prints_log {
                print_log(&flight);
            }
            let outcome = judge(case, &flight, at_s, &struck);
            let with_scene = |wrong| {
                format!("seed {seed}, vehicle {struck:?} at {at_s} s, {}: {wrong}", case.script)
            };
            let notes = outcome.notes.into_iter().map(with_scene).collect();
            Outcome { wrong: outcome.wrong.into_iter().map(with_scene).collect(), notes, ..outcome }
        };
        CASES.iter().enumerate().filter(|(_, case)| chosen(case)).map(strike).collect()
    };
    let flown: Vec<Vec<Outcome>> = seeds.into_par_iter().map(by_seed).collect();
    println!("{:62} flights complete hit too-near wrong", "fault");
    for (k, case) in CASES.iter().filter(|case| chosen(case)).enumerate() {
        let sum = |count: fn(&Outcome) -> usize| {
            flown.iter().map(|outcomes| count(&outcomes[k])).sum::<usize>()
        };
        println!(
            "{:62} {:7} {:8} {:3} {:8} {:5}",
            case.script.replace('\n', ", "),
            flown.len(),
            sum(|o| usize::from(o.complete)),
            sum(|o| o.hit),
            sum(|o| o.too_near),
            sum(|o| o.wrong.len())
        );
    }
    for note in flown.iter().flatten().flat_map(|o| &o.notes) {
        println!("{note}");
    }
    let wrong: Vec<&str> =
        flown.iter().flatten().flat_map(|o| &o.wrong).map(String::as_str).collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Number of paths that leave a box.
fn count_outside(plan: &HostPlan, fence: &Geofence) -> usize {
    let paths = plan.flights.iter().map(|flight| flight.path.waypoints());
    paths.filter(|points| points.iter().any(|w| !fence.contains(&w.position))).count()
}

#[test]
fn plans_stay_inside_the_geofence_and_no_flight_meets_it() {
    let mut left = 0;
    for seed in 1..=SEEDS {
        let (mission, plan) = prepare(seed);
        let starts = mission.scenario.vehicles.iter().map(|v| v.start);
        let ends: Vec<Point> = starts.chain(mission.scenario.mission.goals.clone()).collect();
        let room = Point::repeat(ROOM_AT_FENCE_M);
        let fence = Geofence {
            min: ends.iter().copied().reduce(|a, b| a.inf(&b)).expect("there are starts") - room,
            max: ends.iter().copied().reduce(|a, b| a.sup(&b)).expect("there are starts") + room,
        };
        left += count_outside(&plan, &fence);
        let (mission, plan) = prepare_inside(Some(fence.clone()), seed);
        assert_eq!(count_outside(&plan, &fence), 0, "seed {seed}");
        let flight = fly(&mission, &plan);
        assert!(flight.result.complete, "seed {seed}");
        let met = flight.log.iter().find(|e| e.text.contains("eofence"));
        assert!(met.is_none(), "seed {seed}: {met:?}");
    }
    assert!(left > 0, "no path of the missions without a fence would leave it");
}

#[test]
fn a_struck_flight_is_the_same_each_time() {
    let (mut mission, plan) = prepare(1);
    mission.scenario.simulation.serial_corruption_per_byte = 1e-4;
    mission.scenario.simulation.radio_loss = 0.1;
    let some = CASES.iter().filter(|case| !case.on_ground()).step_by(2);
    mission.scenario.faults =
        some.zip(1..=10).flat_map(|(case, id)| case.faults(12.0, id, &plan)).collect();
    let once = || {
        let flight = fly(&mission, &plan);
        let log: Vec<_> = flight.log.iter().map(|e| (e.t_s, e.vehicle, e.text.clone())).collect();
        (serde_json::to_string(&flight.result).expect("it can be written"), log)
    };
    assert_eq!(once(), once());
}
