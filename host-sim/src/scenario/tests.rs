use planner_core::Point;

use super::*;
use crate::map::UnknownSpace;

/// A valid scenario; tests replace parts of it.
const GOOD: &str = r#"
[map]
file = "builtin:building"
[mission]
goals = [[38.5, 19.0, 7.3], [3.0, 4.0, 12.5]]
[[vehicles]]
id = 1
start = [8.0, 12.0, 1.5]
[[vehicles]]
id = 2
start = [8.0, 15.0, 1.5]
"#;

#[test]
fn a_short_scenario_has_the_defaults() {
    let scenario = parse(GOOD, "good.toml").unwrap();
    scenario.check_supported().unwrap();
    assert_eq!(
        (scenario.seed, scenario.map.resolution_m, scenario.map.unknown),
        (1, 0.25, UnknownSpace::Blocked)
    );
    let roadmap = &scenario.roadmap;
    assert_eq!((roadmap.random_nodes, roadmap.edge_min_m, roadmap.edge_max_m), (2300, 0.5, 8.0));
    let mission = &scenario.mission;
    assert_eq!((mission.mode, mission.cruise_mps), (MissionMode::Unlabelled, 2.0));
    assert_eq!(mission.ground_stations, [255, 0, 0, 0]);
    assert_eq!(mission.goals[1], Point::new(3.0, 4.0, 12.5));
    let vehicles = &scenario.vehicles;
    assert_eq!((vehicles.len(), vehicles[1].id, vehicles[1].radius_m), (2, 2, 0.3));
    assert_eq!(
        scenario.deconfliction,
        Deconfliction { method: Method::Priority, safety_distance_m: 1.5, separation_m: 2.0 }
    );
    assert_eq!(
        (scenario.simulation.serial_baud, scenario.simulation.time_limit_s),
        (921_600, 600.0)
    );
    assert!((scenario.max_required_clearance_m() - 0.8).abs() < 1e-6);
}

/// `GOOD` with one text replaced by another.
fn changed(from: &str, to: &str) -> String {
    assert!(GOOD.contains(from), "{from}");
    GOOD.replacen(from, to, 1)
}

#[test]
fn errors_of_wrong_scenarios_say_where_and_why() {
    let apart = "vehicles 1 and 2 start 1.00 m apart, below the safety distance of 1.5 m";
    let words = "mission.mode must be one of \"unlabelled\", \"labelled\", \"single-goal\", \"coverage\", \
                 \"formation\", \"unlabeled\", \"labeled\"";
    let kinds = "is not a map that can be read: unknown kind of map: hall.obj: expected an OctoMap `.bt` file, or \
                 `builtin:building`, `builtin:building?seed=N`";
    let labelled = "[mission]\nmode = \"labeled\"";
    let cases: &[(&str, &str, &str, &str, Option<&str>)] = &[
        (
            "[mission]",
            "[mission]\ncruise_mp = 1",
            "5:1",
            "unknown key `cruise_mp` in mission",
            Some("did you mean `cruise_mps`?"),
        ),
        ("[mission]", "[misson]", "4:2", "unknown key `misson`", Some("did you mean `mission`?")),
        (
            "[mission]",
            "[mission]\nground_stations = [255, 2]",
            "5:25",
            "mission.ground_stations[1] is a vehicle's id: a ground station has one of its own",
            None,
        ),
        (
            "[mission]",
            "[mission]\nground_stations = []",
            "5:19",
            "mission.ground_stations takes 1 to 4 MAVLink system ids",
            None,
        ),
        (
            "[mission]",
            "[deconfliction]\nsafety_distance_m = 0\n[mission]",
            "5:21",
            "deconfliction.safety_distance_m must be a number from 0.01 to 1000",
            None,
        ),
        ("[map]", "sede = 1\n[map]", "2:1", "unknown key `sede`", Some("did you mean `seed`?")),
        (
            "start = [8.0, 15.0",
            "strat = [8.0, 15.0",
            "11:1",
            "unknown key `strat` in vehicles[1]",
            Some("did you mean `start`?"),
        ),
        (
            "id = 2",
            "id = 1",
            "10:6",
            "vehicles[1].id is 1, which another vehicle already has",
            None,
        ),
        ("id = 2", "id = 251", "10:6", "vehicles[1].id must be a whole number from 1 to 250", None),
        (
            "id = 2",
            "id = 2.0",
            "10:6",
            "vehicles[1].id must be a whole number, not a value of type float",
            None,
        ),
        (
            "id = 2",
            "",
            "9:1",
            "vehicles[1].id is missing",
            Some("each vehicle has its own MAVLink system id, 1 to 250"),
        ),
        ("15.0, 1.5]", "13.0, 1.5]", "11:9", apart, None),
        (
            "15.0, 1.5]",
            "nan, 1.5]",
            "11:15",
            "vehicles[1].start[1] must be a number from -16384 to 16384",
            None,
        ),
        (
            "15.0, 1.5]",
            "1.5]",
            "11:9",
            "vehicles[1].start must be three numbers, east, north, up in metres, not 2",
            None,
        ),
        (
            "id = 2",
            "id = 2\nradius_m = 0",
            "11:12",
            "vehicles[1].radius_m must be a number from 0.001 to 100",
            None,
        ),
        (
            "id = 2",
            "id = 2\npersonality = \"px\"",
            "11:15",
            "vehicles[1].personality must be one of \"px4\", \"ardupilot\"",
            Some("did you mean `px4`?"),
        ),
        (
            "[mission]",
            "[mission]\nmode = \"labbeled\"",
            "5:8",
            words,
            Some("did you mean `labeled`?"),
        ),
        (
            "[mission]",
            labelled,
            "7:1",
            "vehicle 1 has no goal in a labelled mission",
            Some("add `goal = N`, an index into mission.goals from 0"),
        ),
        (
            "[mission]",
            "[mission]\nmode = \"single-goal\"",
            "6:9",
            "mission.mode \"single-goal\" takes one goal, not 2",
            None,
        ),
        (
            "[[38.5, 19.0, 7.3], [3.0, 4.0, 12.5]]",
            "[]",
            "5:9",
            "mission.goals is missing or empty",
            Some(
                "add `goals = [[east, north, up], …]` in metres, or `goals_file = \"FILE\"`, to [mission]",
            ),
        ),
        (
            "[38.5, 19.0, 7.3]",
            "{ lat_deg = 40, lon_deg = -3, alt_m = 7 }",
            "5:10",
            "mission.goals[0] is given by latitude and longitude, but map.origin is missing",
            Some("add `origin = { lat_deg = …, lon_deg = …, alt_m = … }` to [map], or give metres"),
        ),
        (
            "[38.5, 19.0, 7.3]",
            "{ lat_deg = 91, lon_deg = -3, alt_m = 7 }",
            "5:22",
            "mission.goals[0].lat_deg must be a number from -90 to 90",
            None,
        ),
        (
            "[mission]",
            "[mission]\ngoals_file = \"g.txt\"",
            "5:14",
            "mission.goals_file cannot stand beside mission.goals: give one of them",
            None,
        ),
        ("builtin:building", "hall.obj", "3:8", &format!("map.file {kinds}"), None),
        (
            "[mission]",
            "[roadmap]\nedge_min_m = 9\n[mission]",
            "4:1",
            "roadmap.edge_max_m (8 m) must be above roadmap.edge_min_m (9 m)",
            None,
        ),
        (
            "[mission]",
            "[mission]\ngeofence = { min = [0, 0, 0], max = [1, 0, 1] }",
            "5:12",
            "mission.geofence must have every coordinate of min below that of max",
            None,
        ),
        (
            "[mission]",
            "[[faults]]\nat_s = 2\nkind = \"kil\"\n[mission]",
            "6:8",
            "",
            Some("did you mean `kill`?"),
        ),
        (
            "[mission]",
            "[[faults]]\nat_s = 2\nkind = \"kill\"\nvehicle = 9\n[mission]",
            "7:11",
            "faults[0].vehicle is no vehicle's id",
            None,
        ),
    ];
    for &(from, to, place, why, hint) in cases {
        let error = parse(&changed(from, to), "bad.toml").unwrap_err();
        let at = error.place.as_ref().map(|p| format!("{}:{}", p.line, p.column));
        assert_eq!(at.as_deref(), Some(place), "{error}");
        assert!(if why.is_empty() { true } else { error.why == why }, "{error}\nwant {why}");
        assert_eq!(error.hint.as_deref(), hint, "{error}");
    }
}

#[test]
fn an_error_shows_its_line() {
    let error = parse(&changed("[mission]", "[mission]\ncruise_mp = 1"), "bad.toml").unwrap_err();
    let want = "bad scenario: bad.toml:5:1: unknown key `cruise_mp` in mission\n  |\n5 | cruise_mp = 1\n  | ^^^^^^^^^\n\
                hint: did you mean `cruise_mps`?";
    assert_eq!(error.to_string(), want);
}

#[test]
fn what_is_missing_altogether_is_said() {
    let error = parse("seed = 1\n", "empty.toml").unwrap_err();
    assert_eq!((error.why.as_str(), error.place.unwrap().line), ("map is missing", 1));
    let error = parse("[map\n", "broken.toml").unwrap_err();
    assert!(error.why.starts_with("not TOML: "), "{error}");
    let error = load(Path::new("no/such.toml")).unwrap_err();
    assert!(
        error.to_string().starts_with("bad scenario: no/such.toml: cannot read it: "),
        "{error}"
    );
}

#[test]
fn what_is_not_built_yet_is_refused_by_name() {
    let cases = [
        ("[mission]", "[formation]\npure = true\n[mission]", "not available yet: [formation]"),
        ("[mission]", "[mission]\nmode = \"formation\"", "not available yet: this mission.mode"),
        ("id = 2", "id = 2\nendurance_s = 900", "not available yet: endurance_s"),
    ];
    for (from, to, why) in cases {
        let scenario = parse(&changed(from, to), "later.toml").unwrap();
        assert_eq!(scenario.check_supported().unwrap_err().why, why);
    }
}

#[test]
fn what_a_coverage_mission_does_not_act_on_is_refused_by_name() {
    const TEXT: &str = "[area]\npolygon = [[0.0, 0.0], [100.0, 0.0], [100.0, 80.0], [0.0, 80.0]]\n\
        coordinates = \"metres\"\nheight_m = 30.0\ncamera = { fov_deg = 73.7, aspect = 1.5 }\n\
        overlap_front = 0.5\noverlap_side = 0.5\n[mission]\nmode = \"coverage\"\n\
        [[vehicles]]\nid = 1\nstart = [-10.0, -10.0, 1.5]\nweight = 2.0\nendurance_s = 1500.0\n";
    let scenario = |from: &str, to: &str| parse(&TEXT.replacen(from, to, 1), "area.toml").unwrap();
    assert_eq!(scenario("", "").check_supported(), Ok(()));
    for (from, to, why) in [
        ("weight", "payload_kg = 1.0\nweight", "payload_kg"),
        ("weight", "altitude_m = 40.0\nweight", "altitude_m"),
        ("[mission]", "[formation]\npure = true\n[mission]", "[formation]"),
        ("[[veh", "goals = [[1.0, 2.0, 3.0]]\n[[veh", "mission.goals beside [area]"),
        ("[[veh", "objective = \"total\"\n[[veh", "mission.objective beside [area]"),
        ("[[veh", "goals_file = \"no.txt\"\n[[veh", "mission.goals_file beside [area]"),
    ] {
        let error = scenario(from, to).check_supported().unwrap_err();
        assert_eq!(error.why, format!("not available yet: {why}"));
    }
}

#[test]
fn faults_of_an_area_are_named_where_they_stand() {
    let polygon = "polygon = [[0, 0], [150, 10], [80, 120]]";
    let field = "[area]\nPOLYGON\ncamera = { fov_deg = 73.7, aspect = 1.5 }\nLINE\n\
                 origin = { lat_deg = 40.0, lon_deg = -3.0, alt_m = 5.0 }\n\
                 [[vehicles]]\nid = 1\nstart = START\n";
    let metres = "[0, -20, 0]";
    let crossing = "no_fly = [[[20, 20], [40, 40], [40, 20], [20, 50]]]";
    let outside = "holes = [[[20, 10], [30, 10], [30, 20]], [[900, 10], [930, 10], [930, 20]]]";
    let place = |lat: f64, lon: f64| format!("{{ lat_deg = {lat}, lon_deg = {lon}, alt_m = 5.0 }}");
    let degrees = format!(
        "polygon = [{}, {}, {}]\ncoordinates = \"metres\"",
        place(40.0, -3.0),
        place(41.0, -3.0),
        place(41.0, -2.0)
    );
    let cases = [
        (
            polygon,
            crossing,
            metres,
            "x.toml:4:11: area.no_fly: the edges from vertex 0 of no-fly zone 0 and from vertex 2 of \
             no-fly zone 0 cross",
        ),
        (polygon, outside, metres, "x.toml:4:42: area.holes: hole 1"),
        (polygon, "", &place(41.0, -3.0), "is 111 km from the origin at 40.0000, -3.0000"),
        (polygon, "", &place(-3.0, 40.0), "order of latitude and longitude"),
        (&degrees, "", metres, "area.polygon is in degrees"),
    ];
    for (polygon, line, start, wanted) in cases {
        let text = field.replace("POLYGON", polygon).replace("LINE", line).replace("START", start);
        let error = parse(&text, "x.toml").unwrap_err().to_string();
        assert!(error.contains(wanted), "{wanted}: {error}");
    }
}

#[test]
fn geodetic_goals_and_starts_are_metres_about_the_origin() {
    let place = "{ lat_deg = 40.3327, lon_deg = -3.7659, alt_m = 712.5 }";
    let origin = "origin = { lat_deg = 40.3327, lon_deg = -3.7659, alt_m = 700.0 }\n[mission]";
    let with_origin = changed("[mission]", origin);
    let scenario = parse(&with_origin.replace("[38.5, 19.0, 7.3]", place), "geo.toml").unwrap();
    let goal = scenario.mission.goals[0];
    assert!((goal - Point::new(0.0, 0.0, 12.5)).norm() < 1e-4, "{goal}");
    let text = with_origin.replace("start = [8.0, 12.0, 1.5]", &format!("start = {place}"));
    let start = parse(&text, "geo.toml").unwrap().vehicles[0].start;
    assert!((start - Point::new(0.0, 0.0, 12.5)).norm() < 1e-4, "{start}");
}

#[test]
fn paths_are_relative_to_the_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let text = changed("builtin:building", "maps/hall.bt");
    let text =
        text.replace("goals = [[38.5, 19.0, 7.3], [3.0, 4.0, 12.5]]", "goals_file = \"goals.txt\"");
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    std::fs::write(folder.path().join("goals.txt"), "# two\n1 2 3\n\n4.5 5 6\n").unwrap();
    let scenario = load(&folder.path().join("s.toml")).unwrap();
    assert_eq!(Path::new(&scenario.map.file), folder.path().join("maps/hall.bt"));
    assert_eq!(scenario.mission.goals, [Point::new(1.0, 2.0, 3.0), Point::new(4.5, 5.0, 6.0)]);
    std::fs::write(folder.path().join("goals.txt"), "1 2 3\n1 x 3\n").unwrap();
    let error = load(&folder.path().join("s.toml")).unwrap_err();
    assert!(
        error.why.ends_with("goals.txt:2: expected `x y z` in metres, found `1 x 3`"),
        "{error}"
    );
}

#[test]
fn wrong_files_of_an_area_are_named_with_key_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let ring = |ring: &str| format!(r#"{{"type":"Polygon","coordinates":[[{ring}]]}}"#);
    let line = ring("[8.0,47.0],[8.001,47.0]");
    let crossing = ring("[8.0,47.0],[8.001,47.001],[8.001,47.0],[8.0,47.001],[8.0,47.0]");
    let far = "ncols 2\nnrows 2\nxllcorner 5e5\nyllcorner 5e6\ncellsize 10\n1 2\n3 4\n";
    let point = "<kml><Placemark><Point><coordinates>1,2</coordinates></Point></Placemark></kml>";
    let missing = "FILE cannot be read: No such file";
    for (key, name, text, wanted, hint) in [
        ("file", "none.wkt", "", "is no area: FILE: cannot be read: No such file", "relative to"),
        ("file", "a.gpx", "<gpx/>", "is no area: FILE: is in no known format", "as GeoJSON"),
        ("file", "a.json", "", "is no area: FILE: is not GeoJSON: ", "export it again"),
        ("file", "a.kml", point, "is no area: FILE: holds no polygon", "a closed polygon"),
        ("file", "b.json", &line, ": polygon 0 has fewer than three", "three corners or more"),
        ("file", "c.json", &crossing, ": the edges from vertex 0 of polygon 0", "in their order"),
        ("terrain", "none.asc", "", missing, "relative to"),
        ("terrain", "a.asc", far, "FILE has no height here", "all pads"),
        ("terrain", "b.asc", "1 2 3\n", "FILE is not an ESRI grid", "export it again"),
    ] {
        let path = folder.path().join(name);
        if !name.starts_with("none") {
            std::fs::write(&path, text).unwrap();
        }
        let border = if key == "file" { "" } else { "polygon = [[0, 0], [90, 0], [90, 60]]\n" };
        let scenario = format!(
            "[area]\nheight_m = 35.0\ncamera = {{ fov_deg = 73.7, aspect = 1.5 }}\n\
             {key} = \"{name}\"\n{border}[[vehicles]]\nid = 1\nstart = [0, -20, 0]\n"
        );
        std::fs::write(folder.path().join("s.toml"), scenario).unwrap();
        let error = load(&folder.path().join("s.toml")).unwrap_err();
        let wanted = wanted.replace("FILE", &path.display().to_string());
        let place = error.place.as_ref().map(|place| place.line);
        assert_eq!(place, Some(4), "{error}");
        assert!(error.why.starts_with(&format!("area.{key}")), "{error}");
        assert!(error.why.contains(&wanted), "{wanted}: {error}");
        assert!(error.hint.as_ref().is_some_and(|said| said.contains(hint)), "{hint}: {error}");
    }
}

/// Asserts that the map loads, and that starts and goals have more than the required clearance.
fn check_places(scenario: &Scenario) {
    let map = crate::map::load(&scenario.map.file, scenario.map.resolution_m).unwrap();
    let voxels = map.to_voxel_map(scenario.map.unknown);
    let grid = voxels.grid();
    let shape = *grid.shape();
    let clearance = scenario.max_required_clearance_m();
    for point in scenario.vehicles.iter().map(|v| &v.start).chain(&scenario.mission.goals) {
        let reach = (clearance / shape.resolution_m).ceil() as i64 + 1;
        let center = shape.cell_of(point).unwrap_or_else(|| panic!("{point} is beyond the map"));
        let range = |axis: usize| {
            let c = i64::from(center[axis]);
            (c - reach).max(0) as u32..(c + reach + 1).min(i64::from(shape.dims[axis])) as u32
        };
        for k in range(2) {
            for j in range(1) {
                for i in range(0).filter(|&i| grid.is_occupied([i, j, k])) {
                    let half = Point::repeat(shape.resolution_m / 2.0);
                    let away = ((shape.center([i, j, k]) - point).abs() - half)
                        .sup(&Point::zeros())
                        .norm();
                    assert!(
                        away > clearance,
                        "{point} is {away} m from an obstacle, {clearance} m required"
                    );
                }
            }
        }
        assert!(voxels.ground_z_below_m(point).is_some(), "{point} is over nothing");
    }
}

#[test]
fn the_demo_has_room() {
    let scenario = parse(include_str!("../../scenarios/demo.toml"), "demo.toml").unwrap();
    scenario.check_supported().unwrap();
    assert_eq!((scenario.vehicles.len(), scenario.mission.goals.len()), (10, 10));
    check_places(&scenario);
}

#[test]
fn the_scanned_buildings_have_room() {
    for name in ["geb079", "manufacturing"] {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/scenarios"));
        let scenario = load(&folder.join(format!("{name}.toml"))).unwrap();
        scenario.check_supported().unwrap();
        assert_eq!((scenario.vehicles.len(), scenario.mission.goals.len()), (4, 4));
        if Path::new(&scenario.map.file).exists() {
            check_places(&scenario);
        } else {
            println!("skipped: no {}", scenario.map.file);
        }
    }
}

#[test]
fn edges_are_given_in_metres_or_as_shares() {
    let text =
        changed("[mission]", "[roadmap]\nedge_max_share = 0.2\nterminals = \"apart\"\n[mission]");
    let roadmap = parse(&text, "p2d.toml").unwrap().roadmap;
    let edges = (roadmap.edge_max_share, roadmap.terminal_edges);
    assert_eq!(edges, (Some(0.2), TerminalEdges::Forbidden));
    let text = changed("[mission]", "[roadmap]\nedge_max_share = 0.2\nedge_max_m = 8\n[mission]");
    let error = parse(&text, "p2d.toml").unwrap_err();
    assert!(error.why.contains("cannot stand beside roadmap.edge_max_m"), "{error}");
}

#[test]
fn goals_know_their_lines_and_how_far_apart_they_have_to_be() {
    let text = changed("[3.0, 4.0, 12.5]]", "\n [3.0, 4.0, 12.5]]");
    let scenario = parse(&text, "lines.toml").unwrap();
    assert_eq!(scenario.mission.goal_file_lines, ["lines.toml:5", "lines.toml:6"]);
    assert_eq!(scenario.vehicle_file_lines, ["lines.toml:9", "lines.toml:12"]);
    let error =
        parse(&text.replace("3.0, 4.0, 12.5", "38.5, 19.0, 8.3"), "lines.toml").unwrap_err();
    assert_eq!(error.place.as_ref().map(|place| place.line), Some(6), "{error}");
    assert_eq!(error.hint.as_deref(), Some("vehicles that land at both need 1.75 m between them"));
}

#[test]
fn usual_mistakes_get_a_hint() {
    let hint = |from: &str, to: &str| {
        parse(&changed(from, to), "usual.toml").unwrap_err().hint.unwrap_or_default()
    };
    assert_eq!(
        hint("\"builtin:building\"", "“builtin:building”"),
        "quotes of TOML are straight: \""
    );
    assert_eq!(
        hint("builtin:building", "C:\\maps\\hall.bt"),
        "a path is written with /, or between single quotes"
    );
    assert_eq!(hint("id = 1", "id = 1\npersonality = \"PX4\""), "did you mean `px4`?");
    let fence = "[mission]\ngeofence = { min = [0, 0, 0], max = [9, 20, 20] }";
    let error = parse(&changed("[mission]", fence), "fence.toml").unwrap_err();
    assert_eq!(error.why, "goal 0 lies outside mission.geofence");
    assert_eq!(error.place.map(|place| place.line), Some(6));
}
