//! Scenarios: every key with values of the wrong type, range and shape; keys that are none; what
//! cannot hold together.

use crate::Cases;

/// Tables of a scenario that is right, with the keys that are varied.
const GOOD: &[(&str, &[(&str, &str)])] = &[
    ("", &[("seed", "1")]),
    (
        "[map]",
        &[
            ("file", "\"builtin:building\""),
            ("resolution_m", "0.5"),
            ("unknown", "\"blocked\""),
            ("origin", "{ lat_deg = 40.3, lon_deg = -3.7, alt_m = 700.0 }"),
        ],
    ),
    (
        "[roadmap]",
        &[
            ("nodes", "1500"),
            ("edge_min_m", "0.5"),
            ("edge_max_m", "8.0"),
            ("safety_margin_m", "0.5"),
            ("sampling", "\"halton\""),
            ("terminals", "\"joined\""),
        ],
    ),
    (
        "[mission]",
        &[
            ("mode", "\"unlabelled\""),
            ("objective", "\"total\""),
            ("cruise_mps", "2.0"),
            ("goals", "[[28.0, 3.0, 1.8], [28.0, 6.0, 1.8]]"),
            ("geofence", "{ min = [-5, -5, 0], max = [50, 30, 60] }"),
            ("ground_stations", "[255]"),
        ],
    ),
    (
        "[[vehicles]]",
        &[
            ("id", "1"),
            ("start", "[10.0, 3.0, 1.5]"),
            ("goal", "0"),
            ("radius_m", "0.3"),
            ("speed_max_mps", "5.0"),
            ("personality", "\"px4\""),
            ("home", "{ lat_deg = 40.3, lon_deg = -3.7, alt_m = 700.0 }"),
        ],
    ),
    ("[[vehicles]] ", &[("id", "2"), ("start", "[10.0, 6.0, 1.5]")]),
    (
        "[deconfliction]",
        &[("method", "\"priority\""), ("safety_distance_m", "1.5"), ("separation_m", "2.0")],
    ),
    (
        "[simulation]",
        &[
            ("wind_mps", "0.0"),
            ("gust_mps", "0.0"),
            ("position_noise_m", "0.0"),
            ("estimator", "\"rtk\""),
            ("serial_baud", "921600"),
            ("serial_corruption", "0.0"),
            ("radio_loss", "0.0"),
            ("radio_delay_s", "0.05"),
            ("radio_range_m", "500.0"),
            ("time_limit_s", "60.0"),
        ],
    ),
    (
        "[[faults]]",
        &[
            ("kind", "\"kill\""),
            ("at_s", "20.0"),
            ("duration_s", "3.0"),
            ("vehicle", "1"),
            ("direction", "\"tx\""),
            ("offset_m", "[1, 2, 3]"),
            ("position", "[1, 2, 3]"),
            ("radius_m", "1.0"),
        ],
    ),
];

/// The right scenario with `value` for a key of a table; with an empty value the key is left out.
pub fn with(table: &str, key: &str, value: &str) -> String {
    let mut text = String::new();
    for (name, keys) in GOOD {
        text += name;
        text += "\n";
        let here = *name == table;
        for (k, v) in keys.iter().filter(|(k, _)| !(here && *k == key)) {
            text += &format!("{k} = {v}\n");
        }
        if here && !value.is_empty() {
            text += &format!("{key} = {value}\n");
        }
    }
    text
}

/// The right scenario.
pub fn good() -> String {
    with("", "seed", "1")
}

/// Values that are wrong where a value like `good` is right.
pub fn wrong(good: &str) -> &'static [&'static str] {
    match good.as_bytes()[0] {
        b'"' => &["\"\"", "\"no such word\"", "\"a\\u001b[31m\\u202Eb\"", "3", "[]", "{ a = 1 }"],
        b'[' if good.starts_with("[[") => {
            &["[]", "[[1, 2]]", "[[1, 2, nan]]", "\"x\"", "[[1e9, 0, 0]]", "7"]
        }
        b'[' => &[
            "[]",
            "[1, 2]",
            "[1, 2, nan]",
            "\"x\"",
            "[1, 2, 3, 4]",
            "[1e9, 0, inf]",
            "[\"1\", 2, 3]",
        ],
        b'{' => &[
            "{}",
            "[1, 2, 3]",
            "{ lat_deg = 91.0, lon_deg = 0.0, alt_m = 0.0 }",
            "\"here\"",
            "nan",
        ],
        _ => &["nan", "-inf", "-1e30", "\"1\"", "[1]", "1e400", "true"],
    }
}

pub fn add(cases: &mut Cases) {
    for (table, keys) in GOOD {
        for (key, good) in *keys {
            for value in wrong(good) {
                cases.scenario(format!("{table} {key} = {value}"), &with(table, key, value));
            }
            cases.scenario(
                format!("{table} {key} misspelt"),
                &with(table, &format!("{key}x"), good),
            );
        }
    }
    let required = [
        ("[map]", "file"),
        ("[mission]", "goals"),
        ("[[vehicles]]", "id"),
        ("[[vehicles]]", "start"),
    ];
    for (table, key) in required.into_iter().chain([("[[faults]]", "kind"), ("[[faults]]", "at_s")])
    {
        cases.scenario(format!("{table} without {key}"), &with(table, key, ""));
    }
    add_contradictions(cases);
    add_syntax(cases);
}

/// Values that are right each by itself, but not beside the others.
fn add_contradictions(cases: &mut Cases) {
    let many: String = (0..40_000).map(|i| format!("[{i}, 0, 0], ")).collect();
    let endless = format!("\"{}\"", "x".repeat(300_000));
    let list: &[(&str, &str, &str, &str)] = &[
        ("edges", "[roadmap]", "edge_max_m", "0.4"),
        ("share and metres", "[roadmap]", "edge_max_share", "0.2"),
        ("too many nodes", "[roadmap]", "nodes", "900000"),
        ("a margin nobody keeps", "[roadmap]", "safety_margin_m", "99.0"),
        ("goals on one place", "[mission]", "goals", "[[28.0, 3.0, 1.8], [28.0, 3.0, 1.8]]"),
        ("goals too near", "[mission]", "goals", "[[28.0, 3.0, 1.8], [28.0, 4.2, 1.8]]"),
        ("a goal in a wall", "[mission]", "goals", "[[28.0, 3.0, 1.8], [0.1, 0.1, 0.1]]"),
        ("a goal outside", "[mission]", "goals", "[[28.0, 3.0, 1.8], [900.0, 3.0, 1.8]]"),
        ("forty thousand goals", "[mission]", "goals", &format!("[{many}]")),
        ("goals and file", "[mission]", "goals_file", "\"goals.txt\""),
        ("single goal of two", "[mission]", "mode", "\"single-goal\""),
        ("a mode to come", "[mission]", "mode", "\"coverage\""),
        ("a fence inside out", "[mission]", "geofence", "{ min = [5, 5, 5], max = [4, 6, 6] }"),
        (
            "a start outside the fence",
            "[mission]",
            "geofence",
            "{ min = [20, -5, 0], max = [50, 30, 60] }",
        ),
        (
            "a goal outside the fence",
            "[mission]",
            "geofence",
            "{ min = [-5, -5, 0], max = [20, 30, 60] }",
        ),
        ("a vehicle as ground station", "[mission]", "ground_stations", "[2]"),
        ("too many ground stations", "[mission]", "ground_stations", "[251, 252, 253, 254, 255]"),
        ("an id twice", "[[vehicles]]", "id", "2"),
        ("id 0", "[[vehicles]]", "id", "0"),
        ("id 251", "[[vehicles]]", "id", "251"),
        ("starts too near", "[[vehicles]]", "start", "[10.0, 5.5, 1.5]"),
        ("a start below the floor", "[[vehicles]]", "start", "[10.0, 3.0, -2.0]"),
        ("a start on the floor", "[[vehicles]]", "start", "[10.0, 3.0, 0.6]"),
        ("a hull too wide", "[[vehicles]]", "radius_m", "40.0"),
        ("a key to come", "[[vehicles]]", "endurance_s", "900"),
        ("an endless word", "[[vehicles]]", "personality", &endless),
        ("separation below safety", "[deconfliction]", "separation_m", "1.0"),
        ("recorded without room", "[simulation]", "estimator", "\"recorded\""),
        ("a fault of nobody", "[[faults]]", "vehicle", "9"),
        ("an obstacle nowhere", "[[faults]]", "kind", "\"obstacle\"\nposition = 3"),
        ("a map of no kind", "[map]", "file", "\"hall.dwg\""),
        ("a map that is missing", "[map]", "file", "\"missing.bt\""),
        ("a builtin that is none", "[map]", "file", "\"builtin:castle\""),
        ("an endless map name", "[map]", "file", &endless),
        ("cells too small", "[map]", "resolution_m", "0.002"),
        ("cells too large", "[map]", "resolution_m", "50.0"),
    ];
    for (name, table, key, value) in list {
        cases.scenario(*name, &with(table, key, value));
    }
    for table in ["[area]\nfile = \"a\"", "[formation]", "[unknown]", "[map.more]", "[[roadmap]]"] {
        cases.scenario(format!("with {table}"), &format!("{}{table}\n", good()));
    }
    let labelled = with("[mission]", "mode", "\"labelled\"");
    cases.scenario("labelled without a goal", &labelled);
    let twice = labelled.replace("id = 2\n", "id = 2\ngoal = 0\n");
    cases.scenario("labelled, one goal for two", &twice);
    cases.scenario("labelled, beyond the last", &twice.replace("goal = 0\n", "goal = 7\n"));
}

/// Text that is no TOML.
fn add_syntax(cases: &mut Cases) {
    let good = good();
    let vehicles = good.find("[[vehicles]]").unwrap();
    for part in 0..16 {
        cases.scenario(format!("cut after {part}/16"), &good[..vehicles * part / 16]);
    }
    for (at, code) in
        [(0, '\u{0}'), (40, '\u{1b}'), (90, '='), (130, '"'), (200, '\u{feff}'), (260, ']')]
    {
        let (before, after) = good.split_at(at);
        cases.scenario(format!("{code:?} at {at}"), &format!("{before}{code}{after}"));
    }
    cases.scenario("round quotes", &good.replace('"', "“"));
    cases.scenario(
        "a path with backslashes",
        &good.replace("builtin:building", "C:\\maps\\hall.bt"),
    );
    cases.scenario("single brackets", &good.replace("[[vehicles]]", "[vehicles]"));
    cases.scenario("a key twice", &format!("seed = 2\n{good}"));
    cases.scenario("a table twice", &format!("{good}[map]\nfile = \"builtin:building\"\n"));
    cases.scenario("brackets without end", &"[".repeat(200_000));
    cases.scenario(
        "a value nested deeply",
        &format!("seed = {}1{}", "[".repeat(3000), "]".repeat(3000)),
    );
    cases.scenario("a line without end", &format!("{}{}", "k".repeat(900_000), good));
    cases.scenario("a long key", &good.replace("seed", &"s".repeat(50_000)));
    cases.scenario("longer than a scenario may be", &format!("{good}{}", "#\n".repeat(600_000)));
    cases.scenario("an empty file", "");
    cases.scenario("a page of the web", "<!DOCTYPE html>\n<html></html>\n");
    cases.scenario("JSON", "{\"map\": {\"file\": \"builtin:building\"}}\n");
}
