//! Areas: every key with wrong values, and every kind of file that an area or its terrain is read
//! from, missing, endless and damaged.

use crate::{Cases, scenarios};

/// Keys of a right area, each with its value.
const GOOD: &[(&str, &str)] = &[
    ("polygon", "[[0, 0], [120, 0], [120, 80], [0, 80]]"),
    ("coordinates", "\"metres\""),
    ("holes", "[[[50, 30], [60, 30], [60, 40], [50, 40]]]"),
    ("no_fly", "[[[80, 30], [90, 30], [90, 40], [80, 40]]]"),
    ("camera", "{ fov_deg = 73.7, aspect = 1.5 }"),
    ("height_m", "35.0"),
    ("overlap_front", "0.7"),
    ("overlap_side", "0.6"),
    ("angle_deg", "30.0"),
    ("margin_m", "10.0"),
    ("method", "\"powell-binpat\""),
    ("origin", "{ lat_deg = 40.3, lon_deg = -3.7, alt_m = 700.0 }"),
    ("layer_m", "5.0"),
    ("heading", "\"sweep\""),
    ("trigger", "\"distance\""),
];

/// A coverage scenario whose area has these lines.
fn scenario(area: &str) -> String {
    format!(
        "[area]\n{area}\n[[vehicles]]\nid = 1\nstart = [0.0, -20.0, 0.0]\n[[vehicles]]\nid = 2\nstart = [20.0, -20.0, 0.0]\n"
    )
}

/// The right area with `value` for a key.
fn with(key: &str, value: &str) -> String {
    let lines = GOOD.iter().filter(|(k, _)| *k != key).map(|(k, v)| format!("{k} = {v}\n"));
    scenario(&(lines.collect::<String>() + &format!("{key} = {value}\n")))
}

/// The right scenario.
pub fn good() -> String {
    with("seed", "").replace("seed = \n", "")
}

pub fn add(cases: &mut Cases) {
    // If the right area were refused, all cases made from it would be, for the same reason.
    let (file, out) = (cases.file("toml", good().as_bytes()), cases.path("good-area"));
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(["cover", &file, "--out", &out])
        .stdout(std::process::Stdio::null())
        .status();
    assert!(status.unwrap().success(), "the right area is planned");
    for (key, good) in GOOD {
        for value in scenarios::wrong(good).iter().filter(|value| !is_right(key, value)) {
            cover(cases, &format!("[area] {key} = {value}"), &with(key, value));
        }
        cover(cases, &format!("[area] {key} misspelt"), &with(&format!("{key}x"), good));
    }
    for (name, value) in [
        ("self-crossing", "[[0, 0], [120, 80], [120, 0], [0, 80]]"),
        ("without area", "[[0, 0], [60, 0], [120, 0]]"),
        ("on one place", "[[5, 5], [5, 5], [5, 5]]"),
        ("of two vertices", "[[0, 0], [120, 0]]"),
        ("of a planet", "[[0, 0], [1e9, 0], [1e9, 1e9], [0, 1e9]]"),
    ] {
        cover(cases, &format!("an area {name}"), &with("polygon", value));
    }
    cover(cases, "an area without a border", &scenario("height_m = 35.0"));
    cover(cases, "degrees as metres", &with("coordinates", "\"wgs84\""));
    add_files(cases);
}

/// Whether a value from the lists of wrong ones is right for this key.
fn is_right(key: &str, value: &str) -> bool {
    matches!(key, "holes" | "no_fly") && value == "[]"
}

fn cover(cases: &mut Cases, name: &str, text: &str) {
    let (file, out) = (cases.file("toml", text.as_bytes()), cases.out());
    cases.push(format!("cover, {name}"), &["cover", &file, "--out", &out]);
}

/// Area and terrain files that are no regular files or no such files, and right ones cut short or
/// changed.
fn add_files(cases: &mut Cases) {
    let border = "[[[-3.7,40.3],[-3.698,40.3],[-3.698,40.301],[-3.7,40.301],[-3.7,40.3]]]";
    let geojson = format!("{{\"type\":\"Polygon\",\"coordinates\":{border}}}");
    let kml = "<kml><Document><Placemark><Polygon><outerBoundaryIs><LinearRing><coordinates>-3.7,40.3 -3.698,40.3 \
               -3.698,40.301</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></Document></kml>";
    let asc =
        "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value -9999\n1 2\n3 4\n";
    let right: [(&str, &[u8]); 7] = [
        ("geojson", geojson.as_bytes()),
        ("wkt", b"POLYGON ((0 0, 100 0, 100 50, 0 50, 0 0))"),
        ("kml", kml.as_bytes()),
        ("plan", b"{\"fileType\":\"Plan\",\"mission\":{\"items\":[]}}"),
        ("asc", asc.as_bytes()),
        ("tif", b"II*\0\x08\0\0\0\0\0\0\0\0\0"),
        ("las", b"LASF\0\0\0\0"),
    ];
    for (end, bytes) in right {
        let is_terrain = matches!(end, "asc" | "tif" | "las");
        let text = |path: &str| match is_terrain {
            true => with("terrain", &format!("{path:?}")),
            false => scenario(&format!("file = {path:?}\nheight_m = 35.0")),
        };
        for kind in
            ["missing", "dir", "fifo", "zero", "loop", "empty", "huge", "text", "random", "null"]
        {
            let path = cases.path(kind);
            // The link's ending names the format that the file should have.
            let link = cases.path(&format!("{kind}-area.{end}"));
            let _ = std::os::unix::fs::symlink(path + ".txt", &link);
            cover(cases, &format!("{kind} as .{end}"), &text(&link));
        }
        for cut in [1, bytes.len() / 2, bytes.len() - 1] {
            let file = cases.file(end, &bytes[..cut]);
            cover(cases, &format!(".{end} cut to {cut}"), &text(&file));
        }
        let garbled: Vec<u8> = bytes.iter().map(|byte| byte ^ 0x15).collect();
        let file = cases.file(end, &garbled);
        cover(cases, &format!(".{end} garbled"), &text(&file));
    }
}
