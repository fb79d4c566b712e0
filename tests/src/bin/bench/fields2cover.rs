//! Coverage beside Fields2Cover 2.1: its two test fields, and 12 and 13 with their obstacles.
//!
//! `--fields2cover DIR` is a checkout of Fields2Cover/Fields2Cover; `tests/peers/fields2cover.cpp` is built with it, once. The same
//! fields in metres, lane angle (ours of least width) and lane width; no headland, straight connections, one vehicle, no
//! transit. Ours is from the vertices to all lanes in order, around obstacles; theirs lanes and the best of its orders of
//! lanes in one cell (boustrophedon, snake, spirals; each from four corners). Its route planner on OR-tools is not built.
//! Lengths are of all lanes and the connections between them. Ours twice: lanes in the order in which they are first laid,
//! which has limits, and `searched` as long as the desk does, which has none.
//!
//! Our lanes are longer by what photographs slanted borders whole; theirs end at the border.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use flockmate_tests::{shared_data, workspace};
use host_sim::coverage::{MAX_CORNERS, MAX_LANES, MAX_ORDER_CHANGES};
use host_sim::scenario;
use planner_core::coverage::Flat;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::tracks::{self, LanePattern, Tracks};
use planner_core::coverage::transit::Transit;

use crate::row::Row;

/// Runs of each field, of which the median counts.
const RUNS: usize = 11;
const VERTICES: usize = 1024;
/// At most 3 % longer than theirs.
const LENGTH: f64 = 0.971;
/// What is compiled of theirs: neither its route planner, which needs OR-tools, nor what draws.
const SOURCES: [&str; 4] = ["types", "route_planning", "swath_generator", "objectives"];
const LEFT_OUT: [&str; 3] = ["route_planner_base.cpp", "Path.cpp", "pp_obj"];
/// Fields, lane widths in metres.
const FIELDS: [(&str, f32, &str); 4] = [
    ("fields2cover_test.json", 10.0, "wgs84"),
    ("fields2cover_test_2_cell.json", 10.0, "wgs84"),
    ("12.json", 1.0, "metres"),
    ("13.json", 1.0, "metres"),
];

/// One outer ring with its obstacles.
struct Field {
    vertices: Vec<Flat>,
    rings: Vec<Ring>,
}

/// A way over a field.
struct Way {
    lanes_m: f64,
    total_m: f64,
    time_us: f64,
    crossings: usize,
}

/// Length and time for each field; without a checkout none.
///
/// # Errors
/// Theirs cannot be built or run.
pub fn rows(checkout: Option<&Path>) -> Result<Vec<Row>> {
    let Some(checkout) = checkout else {
        println!("fields2cover: skipped, no --fields2cover DIR, a checkout of Fields2Cover/Fields2Cover");
        return Ok(Vec::new());
    };
    let folder = tempfile::tempdir()?;
    let program = build(checkout, folder.path())?;
    let mut rows = Vec::new();
    for (file, lane_m, coordinates) in FIELDS {
        let Some(path) = shared_data(&format!("coverage/{file}")) else { return Ok(rows) };
        for (k, field) in fields(&path, lane_m, coordinates)?.iter().enumerate() {
            let (first, angle) = ours(field, lane_m, 0)?;
            let (searched, _) = ours(field, lane_m, MAX_ORDER_CHANGES)?;
            let theirs = theirs(&program, field, angle, lane_m)?;
            let name = format!("{} {}", file.trim_end_matches(".json"), k + 1);
            println!(
                "{name}: ours {:.1} m ({:.1} m of lanes), {} crossings; theirs {:.1} m ({:.1} m), {} crossings",
                first.total_m,
                first.lanes_m,
                first.crossings,
                theirs.total_m,
                theirs.lanes_m,
                theirs.crossings
            );
            ensure!(first.crossings + searched.crossings == 0, "{name}: our way crosses an obstacle");
            let n = field.vertices.len();
            let row = |what, ours: f64, theirs: f64, required, unit| Row {
                name: format!("{name}, {what}"),
                ours,
                theirs,
                ratio: theirs / ours,
                required,
                unit,
                n,
            };
            rows.push(row("length", first.total_m, theirs.total_m, LENGTH, "m"));
            rows.push(row("time", first.time_us, theirs.time_us, 10.0, "us"));
            rows.push(row("searched, length", searched.total_m, theirs.total_m, 0.0, "m"));
            rows.push(row("searched, time", searched.time_us, theirs.time_us, 0.0, "us"));
        }
    }
    Ok(rows)
}

fn fields(path: &Path, lane_m: f32, coordinates: &str) -> Result<Vec<Field>> {
    let text = format!(
        "[area]\nfile = {path:?}\ncoordinates = \"{coordinates}\"\nlane_m = {lane_m}\nwaypoint_m = {lane_m}\n\
         [mission]\ncruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [0.0, 0.0, 0.0]\n"
    );
    let scenario = scenario::parse(&text, "a field").map_err(|error| anyhow::anyhow!("{error}"))?;
    let area = scenario.area.context("the scenario has an area")?;
    let mut fields: Vec<Field> = Vec::new();
    let mut from = 0;
    for ring in &area.rings {
        let vertices = &area.vertices[from..usize::from(ring.end)];
        from = usize::from(ring.end);
        if ring.kind == RingKind::Outer {
            fields.push(Field { vertices: Vec::new(), rings: Vec::new() });
        }
        let field = fields.last_mut().context("an obstacle before its field")?;
        field.vertices.extend_from_slice(vertices);
        let kind = if ring.kind == RingKind::Outer { RingKind::Outer } else { RingKind::NoFly };
        field.rings.push(Ring { end: field.vertices.len() as u16, kind });
    }
    Ok(fields)
}

/// Our way, and the angle of its lanes from east to the left, radians.
fn ours(field: &Field, lane_m: f32, looks: u32) -> Result<(Way, f64)> {
    let footprint = Footprint { along_m: lane_m, across_m: lane_m };
    let spacing = Spacing { footprint, lane_m, waypoint_m: lane_m };
    let pattern = LanePattern { spacing, angle_deg: None, margin_m: 0.0, search_steps: looks };
    let mut found: Box<Tracks<MAX_LANES>> = Box::default();
    let mut workspace: Box<tracks::Workspace<VERTICES>> = Box::default();
    let mut transit = Box::new(Transit::<MAX_CORNERS>::empty());
    let mut times = Vec::new();
    for _ in 0..RUNS {
        let began = Instant::now();
        let area = Area::new(&field.vertices, &field.rings).map_err(|error| anyhow::anyhow!("{error:?}"))?;
        transit.set_area(area).map_err(|error| anyhow::anyhow!("{error:?}"))?;
        tracks::build(&area, &pattern, &transit, &mut workspace, &mut found)
            .map_err(|error| anyhow::anyhow!("{error:?}"))?;
        times.push(began.elapsed().as_secs_f64() * 1e6);
    }
    times.sort_by(f64::total_cmp);
    let legs = found.lanes().windows(2).map(|pair| (pair[0].to, pair[1].from));
    let mut crossings = 0;
    for (from, to) in legs {
        let mut corners = heapless::Vec::<Flat, MAX_CORNERS>::new();
        transit.shortest_path(&from, &to, &mut corners).map_err(|error| anyhow::anyhow!("{error:?}"))?;
        let way = [&[from], corners.as_slice(), &[to]].concat();
        crossings += way.windows(2).filter(|leg| crosses(field, &leg[0], &leg[1])).count();
    }
    crossings += found.lanes().iter().filter(|lane| crosses(field, &lane.from, &lane.to)).count();
    let way = Way {
        lanes_m: found.lanes().iter().map(|lane| f64::from(lane.length_m())).sum(),
        total_m: f64::from(found.length_m()),
        time_us: times[RUNS / 2],
        crossings,
    };
    Ok((way, f64::from(found.lane_direction().y).atan2(f64::from(found.lane_direction().x))))
}

/// Whether a leg comes into an obstacle: looked at every centimetre, by no code of the planner.
fn crosses(field: &Field, from: &Flat, to: &Flat) -> bool {
    let steps = ((to - from).norm() / 0.01).ceil().max(1.0) as usize;
    let obstacles = field.rings.windows(2).map(|pair| usize::from(pair[0].end)..usize::from(pair[1].end));
    obstacles.into_iter().any(|range| {
        let ring = &field.vertices[range];
        (0..=steps).any(|k| {
            let at = from + (to - from) * (k as f32 / steps as f32);
            let mut inside = false;
            for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
                if (a.y > at.y) != (b.y > at.y) && at.x < (b.x - a.x) * (at.y - a.y) / (b.y - a.y) + a.x {
                    inside = !inside;
                }
            }
            inside
        })
    })
}

fn theirs(program: &Path, field: &Field, angle: f64, lane_m: f32) -> Result<Way> {
    let mut input = format!("{angle} {lane_m}\n");
    let mut from = 0;
    for ring in &field.rings {
        let vertices = &field.vertices[from..usize::from(ring.end)];
        from = usize::from(ring.end);
        write!(input, "{}", vertices.len())?;
        vertices.iter().try_for_each(|vertex| write!(input, " {} {}", vertex.x, vertex.y))?;
        input.push('\n');
    }
    let mut child = Command::new(program)
        .arg(RUNS.to_string())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("theirs does not start")?;
    child.stdin.take().context("its input is piped")?.write_all(input.as_bytes())?;
    let output = child.wait_with_output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let &[lanes_m, total_m, time_us, crossings, ..] = numbers.as_slice() else {
        anyhow::bail!("theirs printed {text:?}");
    };
    Ok(Way { lanes_m, total_m, time_us, crossings: crossings as usize })
}

/// Builds our driver with their sources.
fn build(checkout: &Path, folder: &Path) -> Result<PathBuf> {
    let source = checkout.join("src/fields2cover");
    let mut sources = Vec::new();
    for part in SOURCES {
        collect(&source.join(part), &mut sources)?;
    }
    println!("fields2cover: building {} of its files, which takes minutes", sources.len());
    let program = folder.join("fields2cover");
    let built = Command::new("g++")
        .args(["-std=c++17", "-O3", "-DNDEBUG", "-w", "-I"])
        .arg(checkout.join("include"))
        .args(["-I/usr/include/gdal", "-I/usr/include/eigen3", "-o"])
        .arg(&program)
        .arg(workspace().join("tests/peers/fields2cover.cpp"))
        .args(&sources)
        .args(["-lgdal", "-lgeos_c"])
        .status()
        .context("cannot run g++")?;
    ensure!(
        built.success(),
        "Fields2Cover in {} does not build: it needs GDAL, GEOS and Eigen",
        checkout.display()
    );
    Ok(program)
}

fn collect(folder: &Path, sources: &mut Vec<PathBuf>) -> Result<()> {
    for entry in std::fs::read_dir(folder).with_context(|| format!("no sources in {}", folder.display()))? {
        let path = entry?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        if LEFT_OUT.contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() {
            collect(&path, sources)?;
        } else if name.ends_with(".cpp") {
            sources.push(path);
        }
    }
    sources.sort();
    Ok(())
}
