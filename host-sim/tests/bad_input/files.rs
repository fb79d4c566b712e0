//! Files that are none, endless, or damaged, wherever a command reads one.

use std::fs::File;

use crate::{Cases, scenarios};

/// The commands that read a file, each with the file named `FILE` and results named `OUT`.
const READERS: &[(&str, &[&str])] = &[
    ("plan", &["plan", "FILE.toml", "--out", "OUT"]),
    ("fly", &["fly", "FILE.toml", "--out", "OUT"]),
    ("roadmap build", &["roadmap", "build", "FILE.toml", "--out", "OUT/r.bin"]),
    ("companion", &["companion", "FILE.toml", "--id", "1", "--autopilot", "udp:127.0.0.1:9"]),
    ("roadmap info", &["roadmap", "info", "FILE.bin"]),
    ("map info", &["map", "info", "FILE.bt"]),
    ("map convert", &["map", "convert", "FILE.bt", "OUT/m.bt"]),
    ("upload", &["upload", "FILE.bin", "--link", "udp:127.0.0.1:9"]),
];

pub fn add(cases: &mut Cases) {
    let good = cases.file("toml", scenarios::good().as_bytes());
    for end in ["toml", "bin", "bt", "txt"] {
        make(cases, end);
    }
    let kinds =
        ["missing", "dir", "fifo", "zero", "loop", "empty", "huge", "text", "random", "null"];
    for (command, args) in READERS {
        for kind in kinds {
            let out = cases.out();
            let args: Vec<String> = args
                .iter()
                .map(|arg| arg.replace("FILE", &cases.path(kind)).replace("OUT", &out))
                .collect();
            let args: Vec<&str> = args.iter().map(String::as_str).collect();
            cases.push(format!("{command} of {kind}"), &args);
        }
    }
    for kind in kinds {
        let goals = format!("\"{}\"", cases.path(&format!("{kind}.txt")));
        let text = scenarios::with("[mission]", "goals", "")
            .replace("[mission]", &format!("[mission]\ngoals_file = {goals}"));
        cases.scenario(format!("goals from {kind}"), &text);
        let map = format!("\"{}\"", cases.path(&format!("{kind}.bt")));
        cases.scenario(format!("map from {kind}"), &scenarios::with("[map]", "file", &map));
        // An empty flash file and a missing one are no errors: the companion makes them.
        if kind != "missing" && kind != "empty" {
            let flash = cases.path(&format!("{kind}.bin"));
            let args = [
                "companion",
                &good,
                "--id",
                "1",
                "--autopilot",
                "udp:127.0.0.1:9",
                "--flash",
                &flash,
            ];
            cases.push(format!("flash in {kind}"), &args);
        }
    }
    add_maps(cases);
    add_roadmaps(cases);
}

/// Makes one file with this ending of each kind that no command can read.
fn make(cases: &Cases, end: &str) {
    use std::os::unix::fs::symlink;
    let path = |kind: &str| cases.path(&format!("{kind}.{end}"));
    std::fs::create_dir(path("dir")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(path("fifo")).status().unwrap().success());
    symlink("/dev/zero", path("zero")).unwrap();
    symlink("/dev/null", path("null")).unwrap();
    symlink(path("loop"), path("loop")).unwrap();
    File::create(path("empty")).unwrap();
    // Twenty gigabytes that take no room on the disk.
    File::create(path("huge")).unwrap().set_len(20 << 30).unwrap();
    std::fs::write(path("text"), "one two three\n\u{1b}[31m four\n").unwrap();
    let mut state = 1u32;
    let mut random = Vec::new();
    for _ in 0..20_000 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random.push((state >> 24) as u8);
    }
    std::fs::write(path("random"), random).unwrap();
}

/// `.bt` files with a word of the header wrong, cut, or with data that is none.
fn add_maps(cases: &mut Cases) {
    let head = "# Octomap OcTree binary file\n";
    let headers = [
        ("no magic", "id OcTree\nsize 2\nres 0.1\ndata\n"),
        ("another id", &format!("{head}id CountingOcTree\nsize 2\nres 0.1\ndata\n")),
        ("no size", &format!("{head}id OcTree\nres 0.1\ndata\n")),
        ("a negative size", &format!("{head}id OcTree\nsize -2\nres 0.1\ndata\n")),
        (
            "a size beyond all",
            &format!("{head}id OcTree\nsize 18446744073709551615\nres 0.1\ndata\n"),
        ),
        ("resolution 0", &format!("{head}id OcTree\nsize 2\nres 0\ndata\n")),
        ("resolution nan", &format!("{head}id OcTree\nsize 2\nres nan\ndata\n")),
        ("a resolution of a planet", &format!("{head}id OcTree\nsize 2\nres 1e9\ndata\n")),
        ("an endless line", &format!("{head}{}", "x".repeat(9000))),
        ("codes in a header", &format!("{head}\u{1b}]0;pwned\u{7}\n")),
    ];
    for (name, header) in headers {
        let file = cases.file("bt", &[header.as_bytes(), &[2, 0]].concat());
        cases.push(format!("map info, {name}"), &["map", "info", &file]);
    }
    let right = format!("{head}id OcTree\nsize 3\nres 0.1\ndata\n");
    for (name, data) in [
        ("no data", vec![]),
        ("half a word", vec![10]),
        ("a word too many", vec![10, 0, 10, 0]),
        ("an inner node without its word", vec![0xff, 0xff]),
        ("a node without children", vec![0, 0]),
        ("deeper than a tree is", [3u8, 0].repeat(17)),
    ] {
        let file = cases.file("bt", &[right.as_bytes(), &data].concat());
        cases.push(format!("map info, {name}"), &["map", "info", &file]);
        let out = cases.out();
        cases.push(
            format!("map convert, {name}"),
            &["map", "convert", &file, &format!("{out}/a.bt")],
        );
    }
    // A leaf of 3 km: a grid of it would have more cells than fit.
    let large = cases.file(
        "bt",
        &[format!("{head}id OcTree\nsize 2\nres 0.1\ndata\n").as_bytes(), &[2, 0]].concat(),
    );
    cases.push("a grid of a large map", &["map", "info", &large, "--resolution", "0.1"]);
    cases.scenario(
        "planning on a large map",
        &scenarios::with("[map]", "file", &format!("\"{large}\"")),
    );
}

/// Roadmap and mission files cut and changed.
fn add_roadmaps(cases: &mut Cases) {
    let scenario = cases.file("toml", scenarios::good().as_bytes());
    let plan = cases.path("good");
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["plan", &scenario, "--out", &plan])
        .stdout(std::process::Stdio::null())
        .status();
    assert!(status.unwrap().success(), "the scenario that is varied is right");
    for name in ["roadmap", "mission"] {
        let bytes = std::fs::read(format!("{plan}/{name}.bin")).unwrap();
        let mut broken = Vec::new();
        for part in [1, 4, 8, 12] {
            broken.push((format!("cut to {part}/16"), bytes[..bytes.len() * part / 16].to_vec()));
        }
        for at in [0, 8, 9, 12, 16, 20, 24, 40, 60, bytes.len() / 2, bytes.len() - 1] {
            let mut changed = bytes.clone();
            changed[at] ^= 0x41;
            broken.push((format!("byte {at} changed"), changed));
        }
        broken.push(("bytes behind its end".into(), [&bytes[..], b"more"].concat()));
        for (what, bytes) in broken {
            let file = cases.file("bin", &bytes);
            cases.push(
                format!("upload of a {name}, {what}"),
                &["upload", &file, "--link", "udp:127.0.0.1:9"],
            );
            cases.push(format!("roadmap info of a {name}, {what}"), &["roadmap", "info", &file]);
        }
        if name == "mission" {
            cases.push(
                "roadmap info of a mission",
                &["roadmap", "info", &format!("{plan}/mission.bin")],
            );
        }
    }
}
