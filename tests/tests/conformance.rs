//! Ground tools that others wrote must be able to fly `host-sim autopilot`: pymavlink and MAVSDK.
//!
//! The scripts in `tests/conformance` run with the Python of the virtual environment that `cargo xtask test` makes
//! (`FLOCKMATE_PYTHON`); without it each test says so and passes. Flights are in real time: half a minute each.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Duration;

use flockmate_tests::{Guard, Profile, autopilot, free_udp_port, host_sim, python, workspace};

const TIME_LIMIT: Duration = Duration::from_secs(160);
/// ArduCopter, whose estimator is ready sooner than the real one's.
const ARDUPILOT: &[&str] = &["--personality", "ardupilot", "--ready-after", "5"];

/// Runs a script to its end and shows what it printed if it fails.
fn run(python: &str, script: &str, arguments: &[&str]) {
    let path = workspace().join("tests/conformance").join(script);
    let child = Command::new(python)
        .arg(path)
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap_or_else(|why| panic!("{python} does not start: {why}"));
    let mut child = Guard(child);
    let output = BufReader::new(child.0.stdout.take().expect("stdout is piped"));
    let reader = std::thread::spawn(move || output.lines().map_while(Result::ok).collect::<Vec<_>>());
    let status = child.wait_for(TIME_LIMIT);
    drop(child);
    let lines = reader.join().expect("the reader does not panic").join("\n");
    assert!(status.is_some_and(|status| status.success()), "{script}: {status:?}\n{lines}");
    let held = lines.lines().filter(|line| line.starts_with("ok ")).count();
    assert!(held >= 15, "{script} checked only {held} things\n{lines}");
    println!("{script}: {held} things held");
}

/// Runs a pymavlink script against an autopilot that listens.
fn pymavlink(script: &str, scheme: &str, listen: &str, options: &[&str]) {
    let Some(python) = python() else { return };
    let (_autopilot, addresses) = autopilot(&[listen], options);
    run(&python, script, &[&format!("{scheme}:{}", addresses[0])]);
}

/// Runs a MAVSDK script: it listens and the autopilot speaks first, as PX4's SITL does on 14540.
fn mavsdk(script: &str, arguments: &[&str], options: &[&str]) {
    let Some(python) = python() else { return };
    let address = format!("127.0.0.1:{}", free_udp_port());
    let _autopilot = autopilot(&[&format!("udp:{address}")], options);
    run(&python, script, &[&[format!("udpin://{address}").as_str()], arguments].concat());
}

#[test]
fn pymavlink_flies_the_simulated_px4_over_udp() {
    pymavlink("px4_pymavlink.py", "udpout", "udp-listen:127.0.0.1:0", &[]);
}

#[test]
fn pymavlink_flies_the_simulated_px4_over_tcp() {
    pymavlink("px4_pymavlink.py", "tcp", "tcp-listen:127.0.0.1:0", &[]);
}

#[test]
fn pymavlink_flies_the_simulated_ardupilot_over_udp() {
    pymavlink("ardupilot_pymavlink.py", "udpout", "udp-listen:127.0.0.1:0", ARDUPILOT);
}

#[test]
fn pymavlink_flies_the_simulated_ardupilot_over_tcp() {
    pymavlink("ardupilot_pymavlink.py", "tcp", "tcp-listen:127.0.0.1:0", ARDUPILOT);
}

#[test]
fn mavsdk_flies_the_simulated_px4_over_udp() {
    mavsdk("px4_mavsdk.py", &[], &[]);
}

#[test]
fn mavsdk_uses_the_simulated_px4s_parameters_and_missions() {
    mavsdk("mavsdk_services.py", &["MPC_XY_VEL_MAX", "COM_OBL_RC_ACT"], &[]);
}

#[test]
fn mavsdk_uses_the_simulated_ardupilots_parameters_and_missions() {
    mavsdk("mavsdk_services.py", &["FS_GCS_TIMEOUT", "FS_GCS_ENABLE"], ARDUPILOT);
}

#[test]
fn pymavlink_watches_the_swarm_and_talks_to_each_vehicle() {
    let Some(python) = python() else { return };
    let out = tempfile::tempdir().expect("a directory");
    let address = format!("udp:127.0.0.1:{}", free_udp_port());
    let fly = Command::new(host_sim(Profile::Debug))
        .arg("fly")
        .arg(workspace().join("host-sim/scenarios/demo.toml"))
        .args(["--qgc", &address, "--out"])
        .arg(out.path())
        .spawn()
        .expect("host-sim starts");
    let _fly = Guard(fly);
    run(&python, "ground_station.py", &[&address.replace("udp:", "udpin:")]);
}
