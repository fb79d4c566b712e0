//! Missions flown whole: planned by planner-core, flown by companions through MAVLink, watched by
//! the referee.

use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use flockmate_tests::{
    ChildGuard, free_port, host_sim_path, shared_data, start_autopilot, workspace,
};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::result::MissionResult;
use host_sim::{scenario, swarm};

/// Asserts that each vehicle reached its goal and that the flight was clean.
fn assert_complete_and_clean(result: &MissionResult) {
    for vehicle in &result.vehicles {
        assert!(vehicle.reached && vehicle.landed && vehicle.end == "Done", "{vehicle:?}");
    }
    let safety = &result.safety;
    assert_eq!(
        (safety.wall_contacts, safety.violations, safety.deadlocks),
        (0, 0, 0),
        "{safety:?}"
    );
    assert!(safety.min_separation_m.is_none_or(|m| m >= safety.safety_distance_m), "{safety:?}");
    assert!(result.complete);
}

fn fly(path: &Path, seed: Option<u64>) -> MissionResult {
    let mut scenario = scenario::load(path).expect("the scenario is good");
    scenario.seed = seed.unwrap_or(scenario.seed);
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden())
        .expect("the mission can be prepared");
    let plan = mission.plan().expect("the swarm can be planned");
    swarm::fly(&mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden())
        .expect("it flies")
        .result
}

fn scenario_path(name: &str) -> std::path::PathBuf {
    workspace().join(name)
}

#[test]
fn demo_result_is_the_same_twice() {
    let dir = tempfile::tempdir().expect("a directory");
    let results = ["first", "second"].map(|name| {
        let out = dir.path().join(name);
        let demo = Command::new(host_sim_path()).args(["demo", "--out"]).arg(&out).output();
        let demo = demo.expect("it runs");
        assert!(demo.status.success(), "{name}: {}", String::from_utf8_lossy(&demo.stderr));
        assert!(out.join("report.html").exists() && out.join("timing.json").exists());
        std::fs::read_to_string(out.join("result.json")).expect("result.json is written")
    });
    assert_eq!(results[0], results[1], "two runs differ");
}

#[test]
fn ten_vehicles_fly_the_building_clean_with_other_seeds() {
    for seed in 1..=8 {
        let result = fly(&scenario_path("host-sim/scenarios/demo.toml"), Some(seed));
        let served = result.vehicles.iter().filter(|v| v.goal.is_some()).count();
        // A roadmap of 2300 nodes may leave a goal out of reach (paper P3D Fig. 10); every vehicle
        // that flies touches nothing.
        assert!(served >= 8, "seed {seed}: only {served} goals in reach");
        let safety = &result.safety;
        assert_eq!(
            (safety.wall_contacts, safety.violations, safety.deadlocks),
            (0, 0, 0),
            "seed {seed}: {safety:?}"
        );
        let flown = result.vehicles.iter().filter(|v| v.goal.is_some());
        assert!(
            flown.into_iter().all(|v| v.reached && v.landed),
            "seed {seed}: {:?}",
            result.vehicles
        );
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
    let mission = PreparedMission::prepare(
        scenario::load(&path).expect("the scenario is good"),
        &Progress::hidden(),
    )
    .expect("the mission can be prepared");
    let pad = mission.pad_position(mission.index_of(7).expect("the demo has a vehicle 7"));
    let home = format!("{:.8},{:.8},{:.3}", pad.lat_deg, pad.lon_deg, pad.alt_m);
    let (_autopilot, addresses) =
        start_autopilot(&["udp-listen:127.0.0.1:0"], &["--sysid", "7", "--home", &home]);
    let companion = Command::new(host_sim_path())
        .args([
            "companion",
            "--autopilot",
            &format!("udp:{}", addresses[0]),
            "--id",
            "7",
            "--start",
        ])
        .arg(&path)
        .stdout(Stdio::null())
        .spawn()
        .expect("the companion starts");
    let ended = ChildGuard(companion).wait_for(Duration::from_secs(150));
    assert!(ended.is_some_and(|status| status.success()), "the companion ended with {ended:?}");
}

/// Writes the demo's scenario with its first vehicles to a file.
fn first_of_the_demo(vehicles: usize, path: &Path) {
    let demo = std::fs::read_to_string(scenario_path("host-sim/scenarios/demo.toml"))
        .expect("it is there");
    let parts: Vec<_> = demo.split("[[vehicles]]").take(1 + vehicles).collect();
    std::fs::write(path, parts.join("[[vehicles]]")).expect("a writable folder");
}

/// Runs the companion of vehicle 1 in a process that listens for its autopilot and, if `options`
/// has a second one, for its radio; then `fly` with these options, each with the address of a port.
fn fly_beside_a_process(vehicles: usize, options: &[&str]) {
    let dir = tempfile::tempdir().expect("a directory");
    let scenario = dir.path().join("scenario.toml");
    first_of_the_demo(vehicles, &scenario);
    let program = host_sim_path();
    let mut companion = Command::new(&program);
    let mut fly = Command::new(&program);
    companion.args(["companion", "--id", "1"]).arg(&scenario);
    fly.arg("fly").arg(&scenario).arg("--out").arg(dir.path().join("out"));
    let ports: Vec<_> = options.iter().map(|_| free_port()).collect();
    for ((port, listens), option) in ports.iter().zip(["--autopilot", "--swarm"]).zip(options) {
        companion.args([listens, &format!("tcp-listen:127.0.0.1:{port}")]);
        fly.args([*option, &format!("tcp:127.0.0.1:{port}")]);
    }
    let _companion =
        ChildGuard(companion.stdout(Stdio::null()).spawn().expect("the companion starts"));
    let listens = |port: &u16| TcpStream::connect(("127.0.0.1", *port)).is_ok();
    let began = Instant::now();
    while !ports.iter().all(listens) {
        assert!(began.elapsed() < Duration::from_secs(120), "the companion does not listen");
        sleep(Duration::from_millis(100));
    }
    let flown = fly.output().expect("it runs");
    let text = String::from_utf8_lossy(&flown.stdout);
    assert!(flown.status.success(), "{text}{}", String::from_utf8_lossy(&flown.stderr));
    assert!(text.contains("board 1: Landed"), "{text}");
}

#[test]
fn a_companion_in_another_process_flies_among_those_of_the_simulation() {
    fly_beside_a_process(2, &["--companion", "--radio"]);
}

#[test]
fn a_companion_in_another_process_needs_no_radio_to_fly_alone() {
    fly_beside_a_process(1, &["--companion"]);
}
