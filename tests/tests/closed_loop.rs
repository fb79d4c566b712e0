//! Missions flown whole: planned by planner-core, flown by companions through MAVLink, watched by the referee.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use flockmate_tests::{Guard, Profile, autopilot, host_sim, shared_data, workspace};
use host_sim::mission::Mission;
use host_sim::progress::Progress;
use host_sim::result::MissionResult;
use host_sim::{scenario, swarm};

/// The checker of flown missions.
fn assert_complete_and_clean(result: &MissionResult) {
    for vehicle in &result.vehicles {
        assert!(vehicle.reached && vehicle.landed && vehicle.end == "Done", "{vehicle:?}");
    }
    let safety = &result.safety;
    assert_eq!((safety.wall_contacts, safety.violations, safety.deadlocks), (0, 0, 0), "{safety:?}");
    assert!(safety.min_separation_m.is_none_or(|m| m >= safety.safety_distance_m), "{safety:?}");
    assert!(result.complete);
}

fn fly(path: &Path, seed: Option<u64>) -> MissionResult {
    let mut scenario = scenario::load(path).expect("the scenario is good");
    scenario.seed = seed.unwrap_or(scenario.seed);
    let mut mission = Mission::prepare(scenario, &Progress::hidden()).expect("the mission can be prepared");
    let plan = mission.plan().expect("the swarm can be planned");
    swarm::fly(&mission, &plan, "fly", false, &Progress::hidden()).expect("it flies").result
}

fn scenario_path(name: &str) -> std::path::PathBuf {
    workspace().join(name)
}

#[test]
fn demo_result_is_the_same_twice_and_in_debug_and_release() {
    let dir = tempfile::tempdir().expect("a directory");
    let (debug, release) = (host_sim(Profile::Debug), host_sim(Profile::Release));
    let mut results = Vec::new();
    for (program, name) in [(&debug, "first"), (&debug, "second"), (&release, "release")] {
        let out = dir.path().join(name);
        let demo = Command::new(program).args(["demo", "--out"]).arg(&out).output().expect("it runs");
        assert!(demo.status.success(), "{name}: {}", String::from_utf8_lossy(&demo.stderr));
        assert!(out.join("report.html").exists() && out.join("timing.json").exists());
        results.push(std::fs::read_to_string(out.join("result.json")).expect("result.json is written"));
    }
    assert_eq!(results[0], results[1], "two runs differ");
    assert_eq!(results[0], results[2], "debug and release differ");
}

#[test]
fn ten_vehicles_fly_the_building_clean_with_other_seeds() {
    for seed in 1..=8 {
        let result = fly(&scenario_path("host-sim/scenarios/demo.toml"), Some(seed));
        let served = result.vehicles.iter().filter(|v| v.goal.is_some()).count();
        // A roadmap of 2300 nodes may leave a goal out of reach (P3D Fig. 10); whoever flies, flies clean.
        assert!(served >= 8, "seed {seed}: only {served} goals in reach");
        let safety = &result.safety;
        assert_eq!(
            (safety.wall_contacts, safety.violations, safety.deadlocks),
            (0, 0, 0),
            "seed {seed}: {safety:?}"
        );
        let flown = result.vehicles.iter().filter(|v| v.goal.is_some());
        assert!(flown.into_iter().all(|v| v.reached && v.landed), "seed {seed}: {:?}", result.vehicles);
    }
}

#[test]
fn four_vehicles_fly_the_corridor_scan() {
    if shared_data("maps3d/geb079.bt").is_some() {
        assert_complete_and_clean(&fly(&scenario_path("tests/scenarios/geb079.toml"), None));
    }
}

#[test]
fn four_vehicles_fly_the_manufacturing_hall() {
    if shared_data("maps3d/manufacturing.bt").is_some() {
        assert_complete_and_clean(&fly(&scenario_path("tests/scenarios/manufacturing.toml"), None));
    }
}

#[test]
fn companion_and_autopilot_fly_in_two_processes() {
    let path = scenario_path("host-sim/scenarios/demo.toml");
    let mission = Mission::prepare(scenario::load(&path).expect("the scenario is good"), &Progress::hidden())
        .expect("the mission can be prepared");
    let pad = mission.pad(mission.index_of(7).expect("the demo has a vehicle 7"));
    let home = format!("{:.8},{:.8},{:.3}", pad.lat_deg, pad.lon_deg, pad.alt_m);
    let (_autopilot, addresses) = autopilot(&["udp-listen:127.0.0.1:0"], &["--sysid", "7", "--home", &home]);
    let companion = Command::new(host_sim(Profile::Debug))
        .args(["companion", "--autopilot", &format!("udp:{}", addresses[0]), "--id", "7", "--start"])
        .arg(&path)
        .stdout(Stdio::null())
        .spawn()
        .expect("the companion starts");
    let ended = Guard(companion).wait_for(Duration::from_secs(150));
    assert!(ended.is_some_and(|status| status.success()), "the companion ended with {ended:?}");
}
