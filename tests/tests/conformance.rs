//! Other projects' ground tools work with us: pymavlink and MAVSDK fly `host-sim autopilot`, and
//! with MAVProxy they use a companion's services.
//!
//! The scripts in `tests/conformance` run with the Python of the virtual environment that
//! `cargo xtask test` makes (`FLOCKMATE_PYTHON`); without it each test prints a line and passes.
//! Flights are in real time: half a minute each.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use companion::config::parameters;
use flockmate_tests::{
    ChildGuard, free_port, host_sim_path, python, shared_data, start_autopilot, workspace,
};

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
    let mut child = ChildGuard(child);
    let output = BufReader::new(child.0.stdout.take().expect("stdout is piped"));
    let reader =
        std::thread::spawn(move || output.lines().map_while(Result::ok).collect::<Vec<_>>());
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
    let (_autopilot, addresses) = start_autopilot(&[listen], options);
    run(&python, script, &[&format!("{scheme}:{}", addresses[0])]);
}

/// Runs a MAVSDK script: it listens and the autopilot speaks first, as PX4's SITL does on 14540.
fn mavsdk(script: &str, arguments: &[&str], options: &[&str]) {
    let Some(python) = python() else { return };
    let address = format!("127.0.0.1:{}", free_port());
    let _autopilot = start_autopilot(&[&format!("udp:{address}")], options);
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

/// Pads of a survey's vehicles: latitude and longitude, degrees.
const PADS: [&str; 2] = ["47.3977,8.5463", "47.3981,8.5463"];

/// Plans the polygon of QGroundControl's sample survey for some vehicles, as `cover` does; `None`
/// where the sample is not there.
fn survey(autopilot: &str, vehicles: usize, camera: &str, out: &Path) -> Option<()> {
    let sample = shared_data("plans/qgroundcontrol_sample_with_survey.plan")?;
    let mut scenario = format!(
        "[area]\nfile = {sample:?}\nheight_m = 8.0\nlayer_m = 2.0\n{camera}\n[mission]\ncruise_mps = 10.0\n"
    );
    for (k, pad) in PADS[..vehicles].iter().enumerate() {
        let (latitude, longitude) = pad.split_once(',').expect("two numbers");
        scenario += &format!(
            "[[vehicles]]\nid = {}\nspeed_max_mps = 10.0\npersonality = \"{autopilot}\"\n\
             start = {{ lat_deg = {latitude}, lon_deg = {longitude}, alt_m = 0.0 }}\n",
            k + 1
        );
    }
    let file = out.join("survey.toml");
    std::fs::write(&file, scenario).expect("a scenario");
    let cover = Command::new(host_sim_path()).arg("cover").arg(file).arg("--out").arg(out).status();
    assert!(cover.expect("host-sim starts").success(), "it is planned and covers everything");
    Some(())
}

/// MAVSDK and pymavlink read the plan that `cover` wrote; MAVSDK starts its flight, and pymavlink
/// counts the pictures on a second link.
fn vehicle_flies(python: &str, out: &Path, vehicle: usize, autopilot_kind: &str, trigger: &str) {
    let address = format!("127.0.0.1:{}", free_port());
    let (id, home) = (vehicle.to_string(), format!("{},488", PADS[vehicle - 1]));
    let mut options = vec!["--home", &home, "--sysid", &id];
    if autopilot_kind == "ardupilot" {
        options.extend(ARDUPILOT);
    }
    let (_autopilot, at) =
        start_autopilot(&[&format!("udp:{address}"), "udp-listen:127.0.0.1:0"], &options);
    let urls = [format!("udpin://{address}"), format!("udpout:{}", at[1])];
    let folder = out.display().to_string();
    run(python, "plan_flight.py", &[&urls[0], &urls[1], &folder, &id, autopilot_kind, trigger]);
}

/// Flies one vehicle that takes a picture at each waypoint and, at the same time, two that trigger
/// by distance.
fn plans_fly(autopilot: &str) {
    let Some(python) = python() else { return };
    let (alone, fleet) =
        (tempfile::tempdir().expect("a directory"), tempfile::tempdir().expect("a directory"));
    let by_waypoint = "lane_m = 25.0\nwaypoint_m = 20.0\ntrigger = \"waypoint\"";
    let Some(()) = survey(autopilot, 1, by_waypoint, alone.path()) else { return };
    // Without a trigger in the scenario pictures are triggered by distance.
    let Some(()) = survey(autopilot, 2, "lane_m = 13.0\nwaypoint_m = 9.0", fleet.path()) else {
        return;
    };
    std::thread::scope(|scope| {
        scope.spawn(|| vehicle_flies(&python, alone.path(), 1, autopilot, "waypoint"));
        for vehicle in [1, 2] {
            let (python, fleet) = (&python, fleet.path());
            scope.spawn(move || vehicle_flies(python, fleet, vehicle, autopilot, "distance"));
        }
    });
}

#[test]
fn mavsdk_has_the_simulated_px4_fly_survey_plans() {
    plans_fly("px4");
}

#[test]
fn mavsdk_has_the_simulated_ardupilot_fly_survey_plans() {
    plans_fly("ardupilot");
}

/// A companion of the lobby's first vehicle, for the autopilot that sends to a port, and the two
/// files that may be uploaded to it.
struct Onboard {
    _companion: ChildGuard,
    files: tempfile::TempDir,
}

impl Onboard {
    fn new(port: u16) -> Self {
        let files = tempfile::tempdir().expect("a directory");
        // MAVSDK is system 245 unless set otherwise.
        let text = std::fs::read_to_string(workspace().join("host-sim/scenarios/lobby.toml"));
        let text = text
            .expect("it is there")
            .replace("[mission]", "[mission]\nground_stations = [255, 245]");
        assert!(text.contains("245"));
        let lobby = files.path().join("lobby.toml");
        std::fs::write(&lobby, text).expect("a scenario");
        let program = host_sim_path();
        let plan =
            Command::new(&program).arg("plan").arg(&lobby).arg("--out").arg(files.path()).status();
        assert!(plan.expect("host-sim starts").success());
        let companion = Command::new(program)
            .args([
                "companion",
                "--id",
                "1",
                "--autopilot",
                &format!("udp-listen:127.0.0.1:{port}"),
                "--flash",
            ])
            .arg(files.path().join("flash.bin"))
            .arg(lobby)
            .spawn()
            .expect("host-sim starts");
        Self { _companion: ChildGuard(companion), files }
    }

    fn file(&self, name: &str) -> String {
        self.files.path().join(name).display().to_string()
    }
}

/// Runs a script on another link of the autopilot than the companion's.
fn onboard(script: &str, listen: &str, options: &[&str], address: impl Fn(&str) -> String) {
    let Some(python) = python() else { return };
    let port = free_port();
    let (_autopilot, at) = start_autopilot(&[listen, &format!("udp:127.0.0.1:{port}")], &[]);
    let companion = Onboard::new(port);
    let (address, roadmap, mission) =
        (address(&at[0]), companion.file("roadmap.bin"), companion.file("mission.bin"));
    run(&python, script, &[&[&address[..], &roadmap, &mission], options].concat());
}

#[test]
fn pymavlink_uses_the_companions_files_and_parameters_through_the_autopilot() {
    onboard("onboard_pymavlink.py", "udp-listen:127.0.0.1:0", &[], |at| format!("udpout:{at}"));
}

#[test]
fn mavsdk_uses_the_companions_files_and_parameters_through_the_autopilot() {
    let address = format!("127.0.0.1:{}", free_port());
    onboard("onboard_mavsdk.py", &format!("udp:{address}"), &[], |_| format!("udpin://{address}"));
}

#[test]
fn mavproxy_uses_the_companions_files_and_parameters_through_the_autopilot() {
    let Some(python) = python() else { return };
    if !Path::new(&python).with_file_name("mavproxy.py").exists() {
        println!("skipped: no MAVProxy beside {python}");
        return;
    }
    let count = parameters::PARAMETER_COUNT.to_string();
    onboard("onboard_mavproxy.py", "udp-listen:127.0.0.1:0", &[&count], |at| {
        format!("udpout:{at}")
    });
}

#[test]
fn pymavlink_watches_the_swarm_and_talks_to_each_vehicle() {
    let Some(python) = python() else { return };
    let out = tempfile::tempdir().expect("a directory");
    let address = format!("udp:127.0.0.1:{}", free_port());
    let fly = Command::new(host_sim_path())
        .arg("fly")
        .arg(workspace().join("host-sim/scenarios/demo.toml"))
        .args(["--qgc", &address, "--out"])
        .arg(out.path())
        .spawn()
        .expect("host-sim starts");
    let _fly = ChildGuard(fly);
    run(&python, "ground_station.py", &[&address.replace("udp:", "udpin:")]);
}
