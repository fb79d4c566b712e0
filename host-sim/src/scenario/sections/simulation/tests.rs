use crate::scenario::{Scenario, ScenarioError, parse};

/// A mission with goals, and one over an area; faults are added to each.
const MISSIONS: [&str; 2] = [
    "[map]\nfile = \"builtin:building\"\n[mission]\ngoals = [[38.5, 19.0, 7.3]]\n\
     [[vehicles]]\nid = 1\nstart = [8.0, 12.0, 1.5]\n",
    "[area]\npolygon = [[0, 0], [150, 10], [80, 120]]\nheight_m = 35.0\n\
     camera = { fov_deg = 73.7, aspect = 1.5 }\n[[vehicles]]\nid = 1\nstart = [0, -20, 0]\n",
];

/// A fault of kind obstacle, as it stands in a scenario.
fn obstacle(east_m: usize, radius_m: &str, at_s: f32) -> String {
    format!(
        "[[faults]]\nkind = \"obstacle\"\nat_s = {at_s}\nposition = [{east_m}, 60, 30]\n\
         radius_m = {radius_m}\n"
    )
}

/// Each mission with these faults.
fn read_with(faults: &[String]) -> Vec<Result<Scenario, ScenarioError>> {
    MISSIONS.iter().map(|text| parse(&format!("{text}{}", faults.concat()), "f.toml")).collect()
}

#[test]
fn obstacles_that_no_companion_takes_are_refused() {
    for radius_m in ["20.01", "500", "0"] {
        for read in read_with(&[obstacle(80, radius_m, 1.0)]) {
            let error = read.unwrap_err();
            assert_eq!(error.why, "faults[0].radius_m must be a number from 0.001 to 20");
            let hint =
                "companions take obstacles of up to 20 m: give several in place of a larger one";
            assert_eq!(error.hint.as_deref(), Some(hint));
        }
    }
    assert!(read_with(&[obstacle(80, "20", 1.0)]).iter().all(Result::is_ok));

    let many: Vec<String> = (0..17).map(|i| obstacle(10 * i, "2", 20.0 - i as f32)).collect();
    assert!(read_with(&many[1..]).iter().all(Result::is_ok));
    for (read, mission) in read_with(&many).into_iter().zip(MISSIONS) {
        let error = read.unwrap_err();
        assert_eq!(error.why, "faults holds 17 obstacles; a companion keeps 16");
        // The one that no companion has a place for is the last to appear, not the last written.
        let line = mission.lines().count() + 1;
        assert_eq!(error.place.as_ref().map(|place| place.line), Some(line), "{error}");
    }
}

#[test]
fn an_obstacle_that_appears_again_takes_one_place() {
    let mut again: Vec<String> = (0..30).map(|i| obstacle(80, "2", i as f32)).collect();
    again.extend((0..15).map(|i| obstacle(100 + i, "2", 1.0)));
    assert!(read_with(&again).iter().all(Result::is_ok));
    // One that has grown is another one to a companion.
    again.push(obstacle(80, "3", 40.0));
    assert!(read_with(&again).iter().all(Result::is_err));
}

#[test]
fn limits_are_those_of_companions() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../companion/src/replanning/obstacles.rs");
    let source = std::fs::read_to_string(file).unwrap();
    for limit in [
        format!("MAX_OBSTACLES: usize = {};", super::MAX_KNOWN_OBSTACLES),
        format!("MAX_OBSTACLE_RADIUS_M: f32 = {:.1};", super::MAX_REPORTED_RADIUS_M),
    ] {
        assert!(source.contains(&limit), "{limit}");
    }
}
