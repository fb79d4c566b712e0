//! Three boards plan an area from the mission file in their flash, divide it alike and photograph it. The pictures are judged
//! by where they were truly taken.

use flockmate_tests::vehicle::mission;
use flockmate_tests::{board, covered};

/// A field with a zone that nobody enters, small: boards in QEMU are no faster than a few times the clock.
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
    let Some(program) = board::program("flockmate") else { return };
    let folder = tempfile::tempdir().expect("a temporary directory");
    let mut mission = mission(FIELD);
    board::put_on_boards(&mut mission, &program, folder.path());
    let (result, log) = covered::fly(&mut mission).expect("the boards fly it");
    let said = || log.iter().map(|event| (event.t_s, event.vehicle, &event.text)).collect::<Vec<_>>();
    assert_eq!(covered::faults(&result), None, "{:?}", said());
    println!("{:?}", result.coverage);
    for vehicle in &result.vehicles {
        assert!(vehicle.flown_m > 60.0, "a board had no part of the area: {vehicle:?}");
    }
}
