//! Command lines: arguments left out, doubled and garbled, links that are none, results that cannot
//! be written.

use crate::{Cases, Output, areas, scenarios};

/// Every command with what it needs; `S` stands for a scenario, `A` for one with an area, `O` for
/// results.
const COMMANDS: &[&[&str]] = &[
    &["demo", "--out", "O"],
    &["map", "info", "builtin:building"],
    &["map", "convert", "builtin:building", "O/a.bt"],
    &["roadmap", "build", "S", "--out", "O/r.bin"],
    &["roadmap", "info", "S"],
    &["plan", "S", "--out", "O"],
    &["fly", "S", "--out", "O"],
    &["cover", "A", "--out", "O"],
    &["paper", "cpp", "--out", "O"],
    &["autopilot", "--listen", "udp-listen:127.0.0.1:0"],
    &["companion", "S", "--autopilot", "udp:127.0.0.1:9", "--id", "1"],
    &["upload", "S", "--link", "udp:127.0.0.1:9"],
    &["radio", "--listen", "udp-listen:127.0.0.1:0"],
];

pub fn add(cases: &mut Cases) {
    let scenario = cases.file("toml", scenarios::good().as_bytes());
    let area = cases.file("toml", areas::good().as_bytes());
    for (number, command) in COMMANDS.iter().enumerate() {
        let name = command[..command.len().min(2)].join(" ");
        let out = cases.out();
        let given: Vec<String> = command
            .iter()
            .map(|arg| {
                if *arg == "S" {
                    scenario.clone()
                } else if *arg == "A" {
                    area.clone()
                } else {
                    arg.replacen('O', &out, usize::from(arg.starts_with('O')))
                }
            })
            .collect();
        let given: Vec<&str> = given.iter().map(String::as_str).collect();
        let add = |cases: &mut Cases, what: &str, more: &[&str]| {
            cases.push(format!("{number} {name}, {what}"), &[&given[..], more].concat());
        };
        add(cases, "an unknown option", &["--no-such-option"]);
        add(cases, "an endless option", &[&format!("--{}", "x".repeat(100_000))]);
        add(cases, "codes in an option", &["--\u{1b}[2J\u{202e}"]);
        add(cases, "an argument too many", &["one", "two", "three"]);
        // Without the last argument: a required one is missing, or the value of an option.
        if given.len() > 2 || given[0] != "demo" {
            cases.push(format!("{number} {name}, cut"), &given[..given.len() - 1]);
        }
    }
    let out = cases.out();
    cases.push("a roadmap of an area", &["roadmap", "build", &area, "--out", &format!("{out}/r")]);
    cases.push("cover without an area", &["cover", &scenario, "--out", &out]);
    for (name, args) in [
        ("no command", &[][..]),
        ("an unknown command", &["flyy"]),
        ("cover alone", &["cover"]),
        ("map alone", &["map"]),
        ("map of nothing", &["map", "show"]),
        ("roadmap alone", &["roadmap"]),
        ("help of nothing", &["help", "nothing"]),
        ("an empty argument", &[""]),
    ] {
        cases.push(name, args);
    }
    add_values(cases, &scenario);
    add_outputs(cases, &scenario);
}

/// Options with values that are wrong.
fn add_values(cases: &mut Cases, scenario: &str) {
    let out = &cases.out();
    let companion = ["companion", scenario, "--autopilot"];
    let mut option = |name: &str, args: &[&str], values: &[&str]| {
        for value in values {
            cases.push(format!("{name} {value:?}"), &[args, &[*value]].concat());
        }
    };
    let links = [
        "",
        "x",
        "tcp",
        "tcp:",
        "tcp::1",
        "tcp:localhost",
        "tcp:localhost:x",
        "udp:localhost:65536",
        "http://localhost:80",
        "serial:/dev/null",
        "serial:/dev/null:0",
        "serial:/no/such/device:57600",
    ];
    option("radio --listen", &["radio", "--listen"], &links);
    option("upload --link", &["upload", scenario, "--link"], &links[..6]);
    option("companion --autopilot", &companion, &links[..6]);
    option(
        "map info --resolution",
        &["map", "info", "builtin:building", "--resolution"],
        &["nan", "inf", "0", "1e-9", "1e9", "x", "", "0.03", "2"],
    );
    option(
        "map info",
        &["map", "info"],
        &["", "hall", "hall.obj", "builtin:", "builtin:building?seed=-1", "."],
    );
    let autopilot = ["autopilot", "--listen", "udp-listen:127.0.0.1:0"];
    for (flag, values) in [
        ("--home", &["", "1,2", "91,0,0", "nan,0,0", "a,b,c", "1,2,3,4"][..]),
        ("--sysid", &["0", "256", "-1", "x"]),
        ("--personality", &["", "betaflight", "PX4"]),
        ("--ready-after", &["", "x", "nan", "-1", "inf", "1e30"]),
    ] {
        option(&format!("autopilot {flag}"), &[&autopilot[..], &[flag]].concat(), values);
    }
    let radio = ["radio", "--listen", "udp-listen:127.0.0.1:0"];
    for (flag, values) in [
        ("--loss", &["-0.1", "1.1", "nan", "x"][..]),
        ("--delay", &["-1", "61", "nan"]),
        ("--seed", &["-1", "x"]),
    ] {
        option(&format!("radio {flag}"), &[&radio[..], &[flag]].concat(), values);
    }
    option(
        "fly --seed",
        &["fly", scenario, "--out", out, "--seed"],
        &["-1", "x", "1e3", "99999999999999999999"],
    );
    option("fly --qgc", &["fly", scenario, "--out", out, "--qgc"], &["x", "tcp:127.0.0.1:1"]);
    let board = ["companion", scenario, "--autopilot", "udp:127.0.0.1:9", "--id"];
    option("companion --id", &board, &["0", "3", "256", "x", ""]);
}

/// Results that cannot be written, and lines that cannot be printed.
fn add_outputs(cases: &mut Cases, scenario: &str) {
    let taken = cases.file("txt", b"a file\n");
    let folder = cases.path("taken");
    std::fs::create_dir_all(format!("{folder}/result.json")).unwrap();
    let (beyond, long) = (format!("{taken}/x"), format!("/tmp/{}", "y".repeat(5000)));
    for dir in [&taken, &beyond, &folder, &long, "/dev/full", "/dev/null", "/proc/no/such"] {
        cases.push(format!("demo --out {dir}"), &["demo", "--out", dir]);
        if dir != folder {
            cases.push(format!("fly --out {dir}"), &["fly", scenario, "--out", dir]);
            cases.push(
                format!("roadmap build --out {dir}/"),
                &["roadmap", "build", scenario, "--out", &format!("{dir}/..")],
            );
        }
    }
    for (name, output) in
        [("full", Output::Full), ("closed", Output::Closed), ("and errors full", Output::AllFull)]
    {
        for (command, args) in [
            ("help", &["--help"][..]),
            ("version", &["--version"]),
            ("map info", &["map", "info", "builtin:building", "--resolution", "1"]),
            ("autopilot", &["autopilot", "--listen", "udp-listen:127.0.0.1:0"]),
            ("radio", &["radio", "--listen", "udp-listen:127.0.0.1:0"]),
        ] {
            cases.push_to(format!("{command}, output {name}"), args, output);
        }
    }
}
