//! Three boards plan an area above a hill from mission file and field in their flash, divide it
//! alike and photograph it. The pictures are judged by where they were truly taken. If one vehicle
//! loses all power in flight, the other two divide what it left.

use flockmate_tests::hills::Hills;
use flockmate_tests::vehicle::prepare_mission;
use flockmate_tests::{board, covered};
use host_sim::mission::PreparedMission;
use host_sim::swarm::SwarmFlight;
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;

/// A small area with a no-fly zone: boards in QEMU run only a few times faster than real time.
const FIELD: &str = r#"
[area]
polygon = [[0, 0], [70, 0], [80, 45], [10, 50]]
no_fly = [[[35, 20], [42, 20], [42, 28], [35, 28]]]
camera = { fov_deg = 73.7, aspect = 1.5 }
height_m = 20.0
[mission]
cruise_mps = 5.0
[[vehicles]]
id = 1
start = [-6, 0, 0]
speed_max_mps = 8.0
[[vehicles]]
id = 2
start = [-6, 8, 0]
personality = "ardupilot"
speed_max_mps = 8.0
[[vehicles]]
id = 3
start = [-6, 16, 0]
speed_max_mps = 8.0
[simulation]
gust_mps = 2.0
radio_loss = 0.1
"#;

#[test]
fn three_boards_photograph_an_area_whole() {
    let Some(program) = board::built_program("flockmate") else { return };
    let folder = tempfile::tempdir().expect("a temporary directory");
    let hills = Hills::new(&mut Pcg32::seed_from_u64(4), 25.0);
    let text = hills.put_under_scenario(FIELD, &folder.path().join("hills.asc"), 4.0);
    let mut mission = prepare_mission(&text);
    let up_m = |place: [f64; 2]| hills.height_at(place[0], place[1]);
    let heights_m = [[0.0, 0.0], [70.0, 0.0], [80.0, 45.0], [10.0, 50.0], [40.0, 24.0]].map(up_m);
    let [low_m, high_m] =
        [f64::min, f64::max].map(|which| heights_m.into_iter().reduce(which).expect("some"));
    assert!(high_m - low_m > 3.0, "it is level: {heights_m:?}");
    board::put_on_boards(&mut mission, &program, folder.path());
    let (result, log) = covered::fly(&mut mission).expect("the boards fly it");
    let said =
        || log.iter().map(|event| (event.t_s, event.vehicle, &event.text)).collect::<Vec<_>>();
    assert_eq!(covered::faults_text(&result), None, "{:?}", said());
    println!("{:?}", result.coverage);
    for vehicle in &result.vehicles {
        assert!(vehicle.flown_m > 60.0, "a board had no part of the area: {vehicle:?}");
    }
}

/// A field that three vehicles photograph in a minute; one of them loses all power amid its part.
const LOSS: &str = r#"
[area]
polygon = [[0, 0], [40, 0], [44, 24], [4, 26]]
camera = { fov_deg = 73.7, aspect = 1.5 }
height_m = 14.0
layer_m = 3.0
[mission]
cruise_mps = 5.0
[[vehicles]]
id = 1
start = [-6, 0, 0]
speed_max_mps = 8.0
[[vehicles]]
id = 2
start = [-6, 8, 0]
personality = "ardupilot"
speed_max_mps = 8.0
[[vehicles]]
id = 3
start = [-6, 16, 0]
speed_max_mps = 8.0
[simulation]
gust_mps = 2.0
radio_loss = 0.1
[[faults]]
at_s = 60.0
kind = "kill"
vehicle = 3
"#;

/// Asserts that each vehicle of `left` flies one division, the same bits as the host plans from its
/// inputs.
fn divides_as_planned(mission: &PreparedMission, flight: &SwarmFlight, left: [u8; 2]) {
    for vehicle in left {
        let reported: Vec<_> = flight.divisions.iter().filter(|d| d.vehicle == vehicle).collect();
        assert_eq!(reported.len(), 1, "vehicle {vehicle}: {:?}", flight.divisions);
        let inputs = &reported[0].inputs;
        let plan = mission
            .plan_remaining(&[], std::iter::once(&inputs[..]))
            .expect("the host divides it too");
        println!("{:?}", reported[0]);
        assert_eq!(inputs.iter().map(|input| input.alive).collect::<Vec<_>>(), [true, true, false]);
        assert_eq!(reported[0].plan_crc, plan.crc, "vehicle {vehicle}: {inputs:?}");
    }
}

#[test]
fn two_boards_photograph_what_a_third_leaves_that_is_switched_off() {
    let Some(program) = board::built_program("flockmate") else { return };
    let folder = tempfile::tempdir().expect("a temporary directory");
    let mut mission = prepare_mission(LOSS);
    let host = covered::fly_with_record(&mut mission, &mut Vec::new()).expect("the host flies it");
    board::put_on_boards(&mut mission, &program, folder.path());
    let boards =
        covered::fly_with_record(&mut mission, &mut Vec::new()).expect("the boards fly it");
    for flight in [&host, &boards] {
        let said = || flight.log.iter().map(|e| (e.t_s, e.vehicle, &e.text)).collect::<Vec<_>>();
        assert_eq!(covered::faults_text(&flight.result), None, "{:?}", said());
        println!(
            "{:.0} s in {:.1} s: {:?}",
            flight.simulated_s, flight.wall_time_s, flight.result.coverage
        );
        let third = &flight.result.vehicles[2];
        assert!(
            third.end == "Killed" && third.flown_m > 20.0,
            "it was struck on its pad: {third:?}"
        );
        divides_as_planned(&mission, flight, [1, 2]);
    }
}
