//! The report page in headless Chromium: it opens without console messages, and map, paths and
//! moving vehicles are on the picture.
//!
//! Chromium is the one named by `FLOCKMATE_CHROMIUM`, else `chromium` or `google-chrome` of the
//! path; without one the tests print a line and pass.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use flockmate_tests::areas::SMALL_FIELD_SCENARIO;
use flockmate_tests::{ChildGuard, chromium, host_sim_path};
use host_sim::report::{
    Curve, Level, LogEvent, MapSurface, Plot, PlotLimit, ReportData, ReportVehicle, RoadmapLines,
    TrackPoint, page as page_of, vehicle_color,
};
use planner_core::Point;
use planner_core::map::voxel::{GridShape, Outside, VoxelGrid};
use serde_json::json;

const WINDOW: (u32, u32) = (1280, 800);
/// Software rendering on a busy machine takes seconds; a page that hangs would take for ever.
const BROWSER_LIMIT: Duration = Duration::from_secs(120);

/// Two floors of two rooms, 12 × 8 × 6 m at 0.25 m, joined by doors and a shaft.
fn building() -> MapSurface {
    let shape = GridShape { dims: [48, 32, 24], min: Point::zeros(), resolution_m: 0.25 };
    let filled = |i: u32, j: u32, k: u32| {
        let slab = k.is_multiple_of(12) || k == 23;
        let shaft = (36..42).contains(&i) && (4..10).contains(&j) && k == 12;
        let hull = i == 0 || j == 0 || i == 47 || j == 31;
        let window = (14..20).contains(&i) && (4..9).contains(&(k % 12));
        let door = (12..18).contains(&j) && (1..9).contains(&(k % 12));
        (slab && !shaft) || (hull && !window) || (i == 24 && !door)
    };
    let mut words = vec![0; shape.word_count()];
    for (i, j, k) in
        (0..48).flat_map(|i| (0..32).flat_map(move |j| (0..24).map(move |k| (i, j, k))))
    {
        if filled(i, j, k) {
            let (word, mask) = shape.word_and_mask([i, j, k]);
            words[word] |= mask;
        }
    }
    MapSurface::of(&VoxelGrid::new(shape, Outside::Blocked, &words).expect("a valid grid"))
}

/// A vehicle that follows `path` at 1 m/s.
fn vehicle(id: u8, path: Vec<Point>) -> ReportVehicle {
    let mut track = vec![TrackPoint { t_s: 0.0, position: path[0] }];
    for leg in path.windows(2) {
        let from = track.last().expect("at least the start").t_s;
        let length = (leg[1] - leg[0]).norm();
        let steps = (length * 5.0).ceil();
        track.extend((1..=steps as u32).map(|s| {
            let share = s as f32 / steps;
            TrackPoint { t_s: from + length * share, position: leg[0] + (leg[1] - leg[0]) * share }
        }));
    }
    let (start, goal) = (path[0], path.last().copied());
    ReportVehicle {
        id,
        radius_m: 0.3,
        color: None,
        goal_index: Some(0),
        start,
        goal,
        planned_path: path,
        track,
        power_lost_at_s: None,
    }
}

fn report() -> ReportData {
    let p = Point::new;
    let vehicles = vec![
        vehicle(
            1,
            vec![
                p(2.0, 2.0, 0.5),
                p(2.0, 3.7, 1.5),
                p(9.7, 3.7, 1.5),
                p(9.7, 1.7, 1.5),
                p(9.7, 1.7, 4.5),
            ],
        ),
        vehicle(
            7,
            vec![
                p(2.0, 6.5, 0.5),
                p(3.0, 6.5, 1.5),
                p(3.0, 3.7, 1.5),
                p(8.5, 3.7, 1.5),
                p(8.5, 6.5, 0.5),
            ],
        ),
    ];
    let curve = |name: &str, vehicle| Curve {
        name: name.to_owned(),
        vehicle,
        t_s: vec![0.0, 4.0, 8.0, 12.0],
        values: vec![4.5, 1.9, f32::NAN, 3.0],
    };
    let limit = Some(PlotLimit { value: 1.5, label: "safety distance".to_owned() });
    let plot = |title: &str, limit, curves| Plot {
        title: title.to_owned(),
        unit: "m".to_owned(),
        limit,
        curves,
    };
    let event =
        |t_s, vehicle, level, text: &str| LogEvent { t_s, vehicle, level, text: text.to_owned() };
    ReportData {
        title: "Two rooms </script><b>&".to_owned(),
        command: "fly".to_owned(),
        generated_by: "host-sim 0.1.0".to_owned(),
        scenario_toml: "seed = 1 # <!-- -->".to_owned(),
        map: Some(building()),
        roadmap: Some(RoadmapLines {
            nodes: vec![p(2.0, 2.0, 1.5), p(5.0, 3.7, 1.5), p(9.0, 3.7, 1.5), p(9.7, 1.7, 4.5)],
            edges: vec![[0, 1], [1, 2], [2, 3]],
        }),
        events: vec![
            event(0.0, Some(1), Level::Info, "armed"),
            event(3.0, Some(7), Level::Warning, "holds for UAV 1"),
            event(12.0, None, Level::Error, "<img src=x onerror=alert(1)>"),
        ],
        figures: Vec::new(),
        plots: vec![
            plot("Smallest separation", limit, vec![curve("separation", None)]),
            plot("Speed", None, vec![curve("UAV 1", Some(1)), curve("UAV 7", Some(7))]),
        ],
        vehicles,
        outlines: Vec::new(),
        coverage: None,
        obstacles: vec![],
        result: json!({
            "complete": true,
            "vehicles": [{
                "id": 1,
                "goal": 0,
                "reached": true,
                "landed": true,
                "path_m": 14.1,
                "end": "landed",
            }],
            "safety": {
                "wall_contacts": 0,
                "min_separation_m": 1.9,
                "safety_distance_m": 1.5,
                "min_clearance_m": null,
            },
            "totals": { "path_m": 25.0, "makespan_s": 13.0 },
        }),
        timing: None,
    }
}

/// Document and screenshot of the page as Chromium opened it.
struct Opened {
    dom: String,
    pixels: Vec<[u8; 3]>,
}

/// Opens `page` once, with `hash` after the address.
fn open(chromium: &Path, page: &Path, hash: &str) -> Opened {
    let file = page.with_extension("png");
    let dom = browse(chromium, page, hash, &file);
    Opened { dom, pixels: pixels(&file) }
}

/// The pixels of a screenshot, row by row from the top.
fn pixels(file: &Path) -> Vec<[u8; 3]> {
    let decoder = png::Decoder::new(BufReader::new(File::open(file).expect("a screenshot")));
    let mut reader = decoder.read_info().expect("a PNG header");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size that fits memory")];
    let info = reader.next_frame(&mut bytes).expect("a PNG frame");
    assert_eq!((info.width, info.height), WINDOW);
    bytes.chunks_exact(info.color_type.samples()).map(|p| [p[0], p[1], p[2]]).collect()
}

/// Runs Chromium to its end, fails on anything the page wrote to the console, writes a screenshot
/// and returns the page's document.
fn browse(chromium: &Path, page: &Path, hash: &str, screenshot: &Path) -> String {
    let profile = tempfile::tempdir().expect("a profile directory");
    let (out, err) = (profile.path().join("stdout"), profile.path().join("stderr"));
    let child = Command::new(chromium)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-background-networking",
        ])
        .args(["--disable-sync", "--enable-unsafe-swiftshader", "--enable-logging=stderr", "--v=0"])
        .args(["--virtual-time-budget=4000", "--force-device-scale-factor=1", "--hide-scrollbars"])
        .arg(format!("--user-data-dir={}", profile.path().join("profile").display()))
        .arg(format!("--window-size={},{}", WINDOW.0, WINDOW.1))
        .arg("--dump-dom")
        .arg(format!("--screenshot={}", screenshot.display()))
        .arg(format!("file://{}{hash}", page.display()))
        .stdin(Stdio::null())
        .stdout(File::create(&out).expect("a file for stdout"))
        .stderr(File::create(&err).expect("a file for stderr"))
        .spawn()
        .expect("Chromium starts");
    let status = ChildGuard(child).wait_for(BROWSER_LIMIT).expect("Chromium ends in time");
    let log = String::from_utf8_lossy(&fs::read(&err).expect("stderr")).into_owned();
    assert!(status.success(), "Chromium failed: {log}");
    // Reading pixels back for the screenshot makes the driver itself complain.
    let said: Vec<_> =
        log.lines().filter(|l| l.contains("CONSOLE") && !l.contains("GL Driver Message")).collect();
    assert!(said.is_empty(), "the page wrote to the console: {said:#?}");
    fs::read_to_string(&out).expect("stdout is text")
}

impl Opened {
    /// A number that the page wrote into a `data-` attribute.
    fn count(&self, name: &str) -> f64 {
        let (_, rest) = self
            .dom
            .split_once(&format!("data-{name}=\""))
            .unwrap_or_else(|| panic!("no data-{name}"));
        rest.split('"')
            .next()
            .and_then(|n| n.parse().ok())
            .unwrap_or_else(|| panic!("data-{name} is no number"))
    }

    /// Pixels in the scene (left of the side panel, above the plots) of this colour, within
    /// `tolerance` per channel.
    fn places(&self, color: [u8; 3], tolerance: u8) -> Vec<(u32, u32)> {
        let at = |i: usize| (i as u32 % WINDOW.0, i as u32 / WINDOW.0);
        let matches = self
            .pixels
            .iter()
            .enumerate()
            .filter(|&(_, &p)| p.iter().zip(color).all(|(&a, b)| a.abs_diff(b) <= tolerance));
        matches
            .map(|(i, _)| at(i))
            .filter(|&(x, y)| x < WINDOW.0 - 400 && y > 50 && y < WINDOW.1 - 230)
            .collect()
    }
}

#[test]
fn page_opens_clean_and_shows_map_paths_and_moving_vehicles() {
    let Some(chromium) = chromium() else { return };
    let dir = tempfile::tempdir().expect("a directory");
    let page = dir.path().join("report.html");
    std::fs::write(&page, page_of(&report()).expect("a page")).expect("the page is written");
    let size = fs::metadata(&page).expect("the page is there").len();
    assert!(size < 1_500_000, "{size} bytes");

    let start = open(&chromium, &page, "#t=0&view=iso");
    assert_eq!(start.count("ready"), 1.0);
    assert!(start.count("faces") > 20.0 && start.count("triangles") > 2.0 * start.count("faces"));
    assert!(start.count("lines") > 100.0);
    assert_eq!(
        (start.count("roadmap-edges"), start.count("paths"), start.count("tracks")),
        (3.0, 2.0, 2.0)
    );
    assert_eq!((start.count("vehicles"), start.count("t")), (2.0, 0.0));
    assert!(start.dom.contains("<h1 id=\"title\">Two rooms &lt;/script&gt;&lt;b&gt;&amp;</h1>"));
    assert!(!start.dom.contains("<img"));

    let later = open(&chromium, &page, "#t=8&view=iso");
    assert_eq!(later.count("t"), 8.0);
    for index in 0..2 {
        let color = vehicle_color(index);
        let (before, after) = (start.places(color, 3), later.places(color, 3));
        // Before the start only the disc and the markers are full colour; later the flown track is.
        assert!(before.len() > 60, "{color:?}: {} pixels at the start", before.len());
        assert!(
            after.len() > before.len() + 100,
            "{color:?}: {} then {}",
            before.len(),
            after.len()
        );
        let appeared = after.iter().filter(|place| !before.contains(place)).count();
        let left = before.iter().filter(|place| !after.contains(place)).count();
        // Planned paths cover 85 % of the ground behind them.
        let planned = color.map(|c| ((u16::from(c) * 85 + 24 * 15) / 100) as u8);
        let planned = start.places(planned, 10).len();
        assert!(planned > 100, "{color:?}: {planned} pixels of planned path");
        assert!(appeared > 100 && left > 20, "{color:?}: {appeared} appeared, {left} left");
    }
}

#[test]
fn page_of_the_demo_opens_clean_and_shows_every_vehicle_move() {
    let Some(chromium) = chromium() else { return };
    let dir = tempfile::tempdir().expect("a directory");
    let demo = Command::new(host_sim_path()).args(["demo", "--out"]).arg(dir.path()).output();
    assert!(demo.expect("the demo runs").status.success());
    let page = dir.path().join("report.html");
    assert!(fs::metadata(&page).expect("the page is there").len() < 6_000_000);
    let opened = open(&chromium, &page, "#t=12&view=iso");
    assert_eq!(
        (opened.count("ready"), opened.count("vehicles"), opened.count("paths")),
        (1.0, 10.0, 10.0)
    );
    assert!(opened.count("faces") > 1_000.0 && opened.count("roadmap-edges") > 10_000.0);
    let later = open(&chromium, &page, "#t=30&view=iso").pixels;
    let moved = opened.pixels.iter().zip(&later).filter(|(a, b)| a != b).count();
    assert!(moved > 500, "{moved} pixels differ between two times");
    for index in 0..10 {
        assert!(
            opened.places(vehicle_color(index), 3).len() > 20,
            "vehicle {index} cannot be seen"
        );
    }
}

#[test]
fn map_style_and_roadmap_change_the_picture() {
    let Some(chromium) = chromium() else { return };
    let dir = tempfile::tempdir().expect("a directory");
    let whole = dir.path().join("whole.html");
    let bare = dir.path().join("bare.html");
    std::fs::write(&whole, page_of(&report()).expect("a page")).expect("the page is written");
    let plain = page_of(&ReportData { roadmap: None, ..report() }).expect("a page");
    std::fs::write(&bare, plain).expect("the page is written");
    let pictures = [
        (&whole, "#map=x-ray"),
        (&whole, "#map=off"),
        (&whole, "#map=solid&cut=2.5"),
        (&bare, "#map=off"),
    ];
    let [glass, none, solid, bare] =
        pictures.map(|(page, hash)| open(&chromium, page, hash).pixels);
    let changed = |a: &[[u8; 3]], b: &[[u8; 3]]| a.iter().zip(b).filter(|(p, q)| p != q).count();
    assert!(changed(&glass, &none) > 20_000, "x-ray: {}", changed(&glass, &none));
    assert!(changed(&solid, &none) > 20_000, "solid: {}", changed(&solid, &none));
    assert!(changed(&solid, &glass) > 20_000, "solid against x-ray: {}", changed(&solid, &glass));
    // With the roadmap its row in the layer panel disappears, besides the lines themselves.
    assert!(changed(&none, &bare) > 300, "roadmap: {}", changed(&none, &bare));
}

#[test]
fn page_of_a_coverage_flight_shows_what_each_vehicle_photographs_after_a_loss() {
    let dir = tempfile::tempdir().expect("a directory");
    let scenario = dir.path().join("lost.toml");
    // One of three loses all power over the area.
    let fault = "[[faults]]\nat_s = 90.0\nkind = \"kill\"\nvehicle = 2\n";
    fs::write(&scenario, format!("seed = 7\n{SMALL_FIELD_SCENARIO}{fault}"))
        .expect("it is written");
    let mut fly = Command::new(host_sim_path());
    let flown =
        fly.arg("fly").arg(&scenario).arg("--out").arg(dir.path()).output().expect("it flies");
    assert!(flown.status.success(), "{}", String::from_utf8_lossy(&flown.stdout));
    let page = dir.path().join("report.html");
    let text = fs::read_to_string(&page).expect("the page is there");
    let (_, data) = text.split_once("type=\"application/json\">").expect("its data");
    let (data, _) = data.split_once("</script>").expect("their end");
    let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
    let coverage = &data["coverage"];
    let [plan, after] = &coverage["divisions"].as_array().expect("divisions")[..] else {
        panic!("{}", coverage["divisions"])
    };
    let waypoints = |division: &serde_json::Value| -> Vec<(u64, u64)> {
        let parts = division["parts"].as_array().expect("parts").iter();
        let number = |part: &serde_json::Value, key: &str| part[key].as_u64().expect("a number");
        parts.map(|part| (number(part, "vehicle"), number(part, "waypoints"))).collect()
    };
    assert_eq!(waypoints(plan).iter().map(|(id, _)| *id).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(waypoints(after).iter().map(|(id, _)| *id).collect::<Vec<_>>(), [1, 3]);
    let all: u64 = waypoints(plan).iter().map(|(_, count)| count).sum();
    assert_eq!(all, data["result"]["coverage"]["waypoints"].as_u64().expect("a number"));
    // The loss is noticed no sooner than 45 s after it; then others have what the lost vehicle
    // left.
    assert!(after["t_s"].as_f64().expect("a time") > 90.0 + 45.0);
    assert_eq!((&plan["lost"], &after["lost"]), (&json!([]), &json!([2])));
    let taken = after["taken"].as_array().expect("what changed hands").iter();
    let of_lost = taken.filter(|taken| taken["from"] == 2).map(|taken| taken["waypoints"].as_u64());
    let of_lost: u64 = of_lost.map(|count| count.expect("a number")).sum();
    assert!(of_lost > 20 && of_lost < waypoints(plan)[1].1, "{of_lost}");
    check_lost_vehicle(&data);
    let Some(chromium) = chromium() else { return };
    let (before, later) =
        (open(&chromium, &page, "#t=60&view=top"), open(&chromium, &page, "#t=220&view=top"));
    assert_eq!((before.count("lost"), later.count("lost")), (0.0, 1.0));
    assert!(!before.dom.contains(">2 lost</div>") && later.dom.contains(">2 lost</div>"));
    assert!(
        before.dom.contains("Flown tracks</label>")
            && !before.dom.contains("Planned tracks</label>")
    );
    assert_eq!((before.count("divisions"), before.count("paths")), (2.0, 5.0));
    assert_eq!(
        before.count("footprints"),
        data["result"]["coverage"]["photos"].as_f64().expect("a number")
    );
    let now = |opened: &Opened| {
        let (_, rest) =
            opened.dom.split_once("<li class=\"now\"><time>").expect("a division that counts");
        rest.contains("Without UAV 2") && !rest.contains("<b>Plan</b>")
    };
    assert_eq!((now(&before), now(&later)), (false, true));
    let changed = before.pixels.iter().zip(&later.pixels).filter(|(a, b)| a != b).count();
    assert!(changed > 20_000, "{changed} pixels differ");
}

/// Vehicle 2 is lost when its power fails, 90 s after the start; its flight ends with its fall.
fn check_lost_vehicle(data: &serde_json::Value) {
    let of_vehicles = |list: &serde_json::Value, key: &str| -> Vec<Option<f64>> {
        list.as_array().expect("vehicles").iter().map(|vehicle| vehicle[key].as_f64()).collect()
    };
    let lost_s = of_vehicles(&data["vehicles"], "lost_s");
    let [None, Some(at_s), None] = lost_s[..] else { panic!("{lost_s:?}") };
    assert!((at_s - 90.0).abs() < 0.1, "{at_s}");
    let times_s = of_vehicles(&data["result"]["vehicles"], "flight_time_s");
    assert!(times_s[1].is_some_and(|time_s| (30.0..100.0).contains(&time_s)), "{times_s:?}");
}

#[test]
fn page_of_a_plan_offers_no_flown_tracks() {
    let Some(chromium) = chromium() else { return };
    let dir = tempfile::tempdir().expect("a directory");
    let scenario = dir.path().join("field.toml");
    fs::write(&scenario, SMALL_FIELD_SCENARIO).expect("it is written");
    let mut cover = Command::new(host_sim_path());
    let planned = cover.arg("cover").arg(&scenario).arg("--out").arg(dir.path()).output();
    assert!(planned.expect("it plans").status.success());
    let opened = open(&chromium, &dir.path().join("report.html"), "#t=60&view=top");
    assert!(
        opened.dom.contains("Planned tracks</label>")
            && !opened.dom.contains("Flown tracks</label>")
    );
    assert_eq!(opened.count("lost"), 0.0);
}

/// The page draws what the tables state.
#[test]
fn page_of_a_paper_draws_its_figures() {
    let dir = tempfile::tempdir().expect("a directory");
    host_sim::paper::cpp::run(dir.path()).expect("the paper's plans");
    let page = dir.path().join("report.html");
    let text = fs::read_to_string(&page).expect("the page is there");
    let (_, data) = text.split_once("type=\"application/json\">").expect("its data");
    let (data, _) = data.split_once("</script>").expect("their end");
    let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
    let figures = data["figures"].as_array().expect("figures");
    let names: Vec<_> =
        figures.iter().map(|figure| figure["name"].as_str().expect("a name")).collect();
    assert_eq!(names, ["Fig. 8", "Fig. 9", "Fig. 10", "Fig. 12", "Fig. 13"]);
    let tables = fs::read(dir.path().join("tables.json")).expect("the tables are there");
    let tables: serde_json::Value = serde_json::from_slice(&tables).expect("JSON");
    let tables = tables.as_array().expect("rows");
    let has = |name: &str| tables.iter().any(|row| row["table"] == name);
    assert!(["2", "3", "4", "5, short", "5, long", "6", "A1", "A12"].into_iter().all(has));
    let planning = tables.iter().filter(|row| row["table"] == "3");
    let times = planning.flat_map(|row| ["ours", "theirs"].map(|whose| &row[whose]));
    let times: Vec<&serde_json::Value> =
        times.flat_map(|times| times.as_array().expect("times")).collect();
    assert_eq!(times.len(), 3 * 2 * 6, "methods, ours and theirs, 2 to 7 vehicles");
    assert!(times.iter().all(|ms| ms.as_f64().is_some_and(|ms| ms > 0.0)), "{times:?}");
    let rows: Vec<_> = tables
        .iter()
        .filter(|row| row["table"].as_str().expect("a name").starts_with('A'))
        .collect();
    for (figure, value) in [(3, "mean"), (4, "cv_percent")] {
        let panels = figures[figure]["panels"].as_array().expect("panels").iter();
        let series = panels.flat_map(|panel| panel["series"].as_array().expect("series"));
        let values = series.flat_map(|series| series["values"].as_array().expect("values"));
        let mut drawn: Vec<f64> = values.map(|value| value.as_f64().expect("a number")).collect();
        let both = rows.iter().flat_map(|row| [&row["ours_summary"], &row["theirs_summary"]]);
        let mut reported: Vec<f64> =
            both.map(|summary| summary[value].as_f64().expect("a number")).collect();
        assert_eq!(reported.len(), 2 * 12 * 6);
        drawn.sort_by(f64::total_cmp);
        reported.sort_by(f64::total_cmp);
        assert_eq!(drawn, reported, "{value}");
    }
    let paths = figures[2]["panels"].as_array().expect("panels").iter().map(|panel| {
        let routes = panel["routes"].as_array().expect("routes").iter();
        routes.filter(|route| route["path"] != "").count()
    });
    assert_eq!(paths.collect::<Vec<_>>(), [3, 2], "POWELL-BINPAT leaves one on the ground");
    let Some(chromium) = chromium() else { return };
    let opened = open(&chromium, &page, "");
    assert_eq!(opened.count("figures"), 5.0);
    let drawn = |what: &str| opened.dom.matches(what).count();
    assert_eq!((drawn("<rect "), drawn("class=\"curve\"")), (144, 24));
    // Twelve maps of three UAVs; in one of them none flies, and in one two do.
    let empty = drawn("<polyline points=\"\" class=\"route\"");
    assert_eq!((drawn("class=\"route\""), empty), (36, 4));
}
