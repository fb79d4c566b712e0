//! Compares our lanes with those of Fields2Cover 2.1: on its test fields, 12 and 13, on fields with
//! obstacles from its tests, and on its test fields with obstacles of ours.
//!
//! `--fields2cover DIR` is a checkout of Fields2Cover/Fields2Cover; `tests/peers/fields2cover.cpp`
//! is built with it, once. The same fields in metres, lane angle (ours of least width) and lane
//! width; no headland, straight connections, one vehicle, no transit. Ours is from the vertices to
//! all lanes in order, around obstacles; theirs is the best of what it offers ([`routes`]). Its
//! route planner on OR-tools is not built.
//!
//! Lengths are of all lanes and the connections between them. Ours twice: as boards plan, which
//! look at few changes of the lanes' order, and `searched` as long as the host does. `length with
//! its lanes` is our order, as boards plan, of the very lanes of their best way ([`same_lanes`]).
//! `length for what is swept` divides both lengths by the share of the field that lies beside a
//! lane, no further than half its width.
//!
//! Our lanes are longer, as they photograph slanted borders whole; theirs end at the border.

mod routes;
mod same_lanes;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use companion::planner::coverage::BOARD_SEARCH_STEPS;
use flockmate_tests::{shared_data, workspace};
use host_sim::coverage::{HOST_SEARCH_STEPS, MAX_LANES, MAX_NO_FLY_CORNERS};
use host_sim::scenario;
use planner_core::coverage::Flat;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::footprint::{Footprint, Spacing};
use planner_core::coverage::tracks::{self, LanePattern, Tracks};
use planner_core::coverage::transit::TransitGraph;

use self::routes::{BestRoute, EastNorth, Obstacles, to_f64};
use crate::row::Row;

/// Runs of each field; their median time counts.
const RUNS: usize = 11;
const MAX_VERTICES: usize = 1024;
/// Least ratio of Fields2Cover's length to ours: ours may be at most 3 % longer.
const MIN_LENGTH_RATIO: f64 = 0.971;
/// Folders of Fields2Cover's sources that are compiled: without route planner (OR-tools) and
/// drawing.
const SOURCE_FOLDERS: [&str; 5] =
    ["types", "route_planning", "swath_generator", "objectives", "decomposition"];
const EXCLUDED_SOURCES: [&str; 3] = ["route_planner_base.cpp", "Path.cpp", "pp_obj"];
/// File, lane width in metres and coordinates of each field.
const FIELDS: [(&str, f32, &str); 4] = [
    ("fields2cover_test.json", 10.0, "wgs84"),
    ("fields2cover_test_2_cell.json", 10.0, "wgs84"),
    ("12.json", 1.0, "metres"),
    ("13.json", 1.0, "metres"),
];

/// A field of Fields2Cover's tests: corners of its outer ring and its obstacles, and their scale to
/// metres.
type Rings = (&'static [&'static [[f32; 2]]], f32);

/// The field of Fields2Cover's `route_planner_base_test.cpp` and `visualizer_test.cpp`.
const TWO_SQUARES: Rings = (
    &[
        &[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]],
        &[[0.4, 0.4], [0.4, 0.6], [0.6, 0.6], [0.6, 0.4]],
        &[[1.2, 1.2], [1.2, 1.6], [1.6, 1.6], [1.6, 1.2]],
    ],
    30.0,
);
/// The field of Fields2Cover's `n_swath_modified_test.cpp`, scaled to the size of a field in
/// metres.
const TWO_SLOTS: Rings = (
    &[
        &[[0.0, 0.0], [4.0, 0.0], [4.0, 5.0], [0.0, 4.0]],
        &[[0.1, 0.1], [0.1, 3.0], [0.2, 3.6], [0.2, 0.1]],
        &[[2.1, 0.1], [2.1, 3.0], [2.2, 3.6], [2.2, 0.1]],
    ],
    50.0,
);
/// The field of Fields2Cover's `data/test_ring.json`, scaled to the size of a field in metres.
const RING: Rings = (
    &[
        &[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]],
        &[[1.0, 1.0], [9.0, 1.0], [9.0, 9.0], [1.0, 9.0]],
    ],
    20.0,
);
/// Name, lane width in metres and rings of each field with obstacles.
const FIELDS_WITH_OBSTACLES: [(&str, f32, Rings); 4] = [
    ("two squares, its lanes of 5 m", 5.0, TWO_SQUARES),
    ("two squares, its lanes of 3 m", 3.0, TWO_SQUARES),
    ("two slots", 5.0, TWO_SLOTS),
    ("ring", 5.0, RING),
];
/// Side of the square obstacles put into fields without any, as a share of the square root of the
/// area of the field's bounding box.
const OBSTACLE_SHARE: f32 = 0.12;
/// Number of points of an edge that are tested for being inside a field.
const EDGE_STEPS: u8 = 50;

/// An outer ring and the obstacles in it.
struct Field {
    vertices: Vec<Flat>,
    rings: Vec<Ring>,
}

impl Field {
    fn new((rings, scale): Rings) -> Self {
        let mut field = Self { vertices: Vec::new(), rings: Vec::new() };
        for ring in rings {
            field.add_ring(ring.iter().map(|[x, y]| Flat::new(scale * x, scale * y)));
        }
        field
    }

    fn add_ring(&mut self, corners: impl Iterator<Item = Flat>) {
        self.vertices.extend(corners);
        let kind = if self.rings.is_empty() { RingKind::Outer } else { RingKind::NoFly };
        self.rings.push(Ring { end: self.vertices.len() as u16, kind });
    }

    /// The field with up to three square obstacles in a row through its middle: those that lie
    /// inside with some space around them.
    fn with_square_obstacles(&self) -> Self {
        let mut field = Self { vertices: self.vertices.clone(), rings: self.rings.clone() };
        let outer = self.vertices.clone();
        let (mut low, mut high) = (outer[0], outer[0]);
        outer.iter().for_each(|at| (low, high) = (low.inf(at), high.sup(at)));
        let side = OBSTACLE_SHARE * ((high.x - low.x) * (high.y - low.y)).sqrt();
        for [east, north] in [[0.3, 0.35], [0.5, 0.5], [0.68, 0.6]] {
            let middle =
                Flat::new(low.x + east * (high.x - low.x), low.y + north * (high.y - low.y));
            // The tested square is twice as wide, so that a corridor is left between obstacle and
            // border.
            let square = |half: f32| {
                [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                    .map(|[x, y]| middle + Flat::new(half * x, half * y))
            };
            let corners = square(side);
            let edges = corners.iter().zip(corners.iter().cycle().skip(1));
            let inside = |(a, b): (&Flat, &Flat)| {
                (0..EDGE_STEPS)
                    .all(|k| ring_contains(&outer, &(a + (b - a) * (k as f32 / EDGE_STEPS as f32))))
            };
            if edges.into_iter().all(inside) {
                field.add_ring(square(side / 2.0).into_iter());
            }
        }
        field
    }

    /// Share of the field's area that lanes sweep.
    fn swept_share(&self, lanes: &[[EastNorth; 2]], lane_m: f32) -> f64 {
        let outer = &self.vertices[..usize::from(self.rings[0].end)];
        let (mut low, mut high) = (outer[0], outer[0]);
        outer.iter().for_each(|at| (low, high) = (low.inf(at), high.sup(at)));
        let holds = |at: &[f64; 2]| {
            let at = Flat::new(at[0] as f32, at[1] as f32);
            ring_contains(outer, &at) && !self.obstacles().any(|ring| ring_contains(ring, &at))
        };
        let corners = [low, high].map(to_f64);
        routes::swept_share(lanes, f64::from(lane_m), holds, corners)
    }

    fn convex_obstacles(&self) -> Obstacles {
        Obstacles::new(self.obstacles().map(|ring| ring.iter().copied().map(to_f64).collect()))
    }

    /// The corners of each obstacle.
    fn obstacles(&self) -> impl Iterator<Item = &[Flat]> {
        self.rings
            .windows(2)
            .map(|pair| &self.vertices[usize::from(pair[0].end)..usize::from(pair[1].end)])
    }
}

/// Whether a ring contains a point; shares no code with the planner.
fn ring_contains(ring: &[Flat], at: &Flat) -> bool {
    let mut inside = false;
    for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        if (a.y > at.y) != (b.y > at.y) && at.x < (b.x - a.x) * (at.y - a.y) / (b.y - a.y) + a.x {
            inside = !inside;
        }
    }
    inside
}

/// Our route over a field: lengths, planning time, and number of legs that cross an obstacle.
struct OurRoute {
    /// Length of the lanes, metres.
    lanes_m: f64,
    /// Length of the route, metres.
    total_m: f64,
    time_us: f64,
    /// Number of legs that cross an obstacle.
    crossings: usize,
    /// Both ends of each lane, metres.
    lanes: Vec<[EastNorth; 2]>,
}

/// Rows of length and time for each field; none without a checkout.
///
/// # Errors
/// The C++ program cannot be built or run.
pub fn rows(checkout: Option<&Path>) -> Result<Vec<Row>> {
    let Some(checkout) = checkout else {
        println!(
            "fields2cover: skipped, no --fields2cover DIR, a checkout of Fields2Cover/Fields2Cover"
        );
        return Ok(Vec::new());
    };
    let folder = tempfile::tempdir()?;
    let program = build_fields2cover(checkout, folder.path())?;
    let mut rows = Vec::new();
    for (name, lane_m, rings) in FIELDS_WITH_OBSTACLES {
        rows.extend(compare(&program, name, &Field::new(rings), lane_m)?);
    }
    for (file, lane_m, coordinates) in FIELDS {
        let Some(path) = shared_data(&format!("coverage/{file}")) else { return Ok(rows) };
        for (k, field) in read_fields(&path, lane_m, coordinates)?.iter().enumerate() {
            let name = format!("{} {}", file.trim_end_matches(".json"), k + 1);
            rows.extend(compare(&program, &name, field, lane_m)?);
            let with = field.with_square_obstacles();
            if with.rings.len() > 1 {
                let name = format!("{name} with {} squares", with.rings.len() - 1);
                rows.extend(compare(&program, &name, &with, lane_m)?);
            }
        }
    }
    Ok(rows)
}

/// The rows of one field: lengths and times of our routes and of its shortest one.
fn compare(program: &Path, name: &str, field: &Field, lane_m: f32) -> Result<Vec<Row>> {
    let (first, angle) = plan_our_route(field, lane_m, BOARD_SEARCH_STEPS)?;
    let (searched, _) = plan_our_route(field, lane_m, HOST_SEARCH_STEPS)?;
    println!(
        "{name}: ours {:.1} m ({:.1} m of lanes), {} crossings",
        first.total_m, first.lanes_m, first.crossings
    );
    ensure!(first.crossings + searched.crossings == 0, "{name}: our way crosses an obstacle");
    let theirs = plan_their_routes(program, field, angle, lane_m)?;
    for best in &theirs {
        println!(
            "  theirs by {}: {:.1} m ({:.1} m of lanes), {:.0} us, {} crossings if straight, {:.2} % swept",
            best.name,
            best.total_m,
            best.lanes_m,
            best.time_us,
            best.crossings,
            100.0 * field.swept_share(&best.lanes, lane_m)
        );
    }
    let shortest =
        theirs.iter().min_by(|a, b| a.total_m.total_cmp(&b.total_m)).context("theirs has a way")?;
    let (total_m, time_us) = (shortest.total_m, shortest.time_us);
    let swept = [&first.lanes, &shortest.lanes].map(|lanes| field.swept_share(lanes, lane_m));
    let outer = &field.vertices[..usize::from(field.rings[0].end)];
    let same_lanes_m = same_lanes::our_length_on_lanes_m(
        outer,
        &field.convex_obstacles(),
        &shortest.lanes,
        lane_m,
    )?;
    println!("  ours with its lanes: {same_lanes_m:.1} m; swept by ours {:.2} %", 100.0 * swept[0]);
    let row = |what, ours: f64, theirs: f64, required, unit| Row {
        name: format!("{name}, {what}"),
        ours,
        theirs,
        ratio: theirs / ours,
        required,
        unit,
        n: field.vertices.len(),
    };
    Ok(vec![
        row("length", first.total_m, total_m, MIN_LENGTH_RATIO, "m"),
        row("length with its lanes", same_lanes_m, total_m, MIN_LENGTH_RATIO, "m"),
        row("length for what is swept", first.total_m / swept[0], total_m / swept[1], 0.0, "m"),
        row("time", first.time_us, time_us, 10.0, "us"),
        row("searched, length", searched.total_m, total_m, 0.0, "m"),
        row("searched, time", searched.time_us, time_us, 0.0, "us"),
    ])
}

fn read_fields(path: &Path, lane_m: f32, coordinates: &str) -> Result<Vec<Field>> {
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
        field.add_ring(vertices.iter().copied());
    }
    Ok(fields)
}

/// Our route, and the angle of its lanes, radians counter-clockwise from east.
fn plan_our_route(field: &Field, lane_m: f32, search_steps: u32) -> Result<(OurRoute, f64)> {
    let footprint = Footprint { along_m: lane_m, across_m: lane_m };
    let spacing = Spacing { footprint, max_lane_spacing_m: lane_m, max_waypoint_spacing_m: lane_m };
    let pattern = LanePattern {
        spacing,
        angle_from_east_deg: None,
        border_overshoot_m: 0.0,
        max_search_steps: search_steps,
    };
    let mut found: Box<Tracks<MAX_LANES>> = Box::default();
    let mut workspace: Box<tracks::LaneWorkspace<MAX_VERTICES>> = Box::default();
    let mut transit = Box::new(TransitGraph::<MAX_NO_FLY_CORNERS>::empty());
    let mut times = Vec::new();
    for _ in 0..RUNS {
        let began = Instant::now();
        let area = Area::new(&field.vertices, &field.rings)
            .map_err(|error| anyhow::anyhow!("{error:?}"))?;
        transit.set_area(area).map_err(|error| anyhow::anyhow!("{error:?}"))?;
        tracks::build_lanes(&area, &pattern, &transit, &mut workspace, &mut found)
            .map_err(|error| anyhow::anyhow!("{error:?}"))?;
        times.push(began.elapsed().as_secs_f64() * 1e6);
    }
    times.sort_by(f64::total_cmp);
    let legs = found.lanes().windows(2).map(|pair| (pair[0].to, pair[1].from));
    let mut crossings = 0;
    for (from, to) in legs {
        let mut corners = heapless::Vec::<Flat, MAX_NO_FLY_CORNERS>::new();
        transit
            .shortest_path(&from, &to, &mut corners)
            .map_err(|error| anyhow::anyhow!("{error:?}"))?;
        let way = [&[from], corners.as_slice(), &[to]].concat();
        crossings += way.windows(2).filter(|leg| crosses_obstacle(field, &leg[0], &leg[1])).count();
    }
    crossings +=
        found.lanes().iter().filter(|lane| crosses_obstacle(field, &lane.from, &lane.to)).count();
    let way = OurRoute {
        lanes_m: found.lanes().iter().map(|lane| f64::from(lane.length_m())).sum(),
        total_m: f64::from(found.length_m()),
        time_us: times[RUNS / 2],
        crossings,
        lanes: found.lanes().iter().map(|lane| [lane.from, lane.to].map(to_f64)).collect(),
    };
    Ok((way, f64::from(found.lane_direction().y).atan2(f64::from(found.lane_direction().x))))
}

/// Whether a leg enters an obstacle; tests a point every centimetre.
fn crosses_obstacle(field: &Field, from: &Flat, to: &Flat) -> bool {
    let steps = ((to - from).norm() / 0.01).ceil().max(1.0) as usize;
    field.obstacles().any(|ring| {
        (0..=steps).any(|k| ring_contains(ring, &(from + (to - from) * (k as f32 / steps as f32))))
    })
}

/// Fields2Cover's best routes: over the field as one cell, and over a decomposition into cells.
fn plan_their_routes(
    program: &Path,
    field: &Field,
    angle: f64,
    lane_m: f32,
) -> Result<Vec<BestRoute>> {
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
    let obstacles = field.convex_obstacles();
    let best = routes::best_routes(&String::from_utf8_lossy(&output.stdout), &obstacles)?;
    ensure!(best[0].is_some(), "theirs printed nothing");
    Ok(best.into_iter().flatten().collect())
}

/// Compiles our driver with Fields2Cover's sources; returns the program's path.
fn build_fields2cover(checkout: &Path, folder: &Path) -> Result<PathBuf> {
    let source = checkout.join("src/fields2cover");
    let mut sources = Vec::new();
    for part in SOURCE_FOLDERS {
        collect_sources(&source.join(part), &mut sources)?;
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
        "Fields2Cover in {} does not build: apt-get install libgdal-dev libgeos-dev libeigen3-dev",
        checkout.display()
    );
    Ok(program)
}

fn collect_sources(folder: &Path, sources: &mut Vec<PathBuf>) -> Result<()> {
    for entry in
        std::fs::read_dir(folder).with_context(|| format!("no sources in {}", folder.display()))?
    {
        let path = entry?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        if EXCLUDED_SOURCES.contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() {
            collect_sources(&path, sources)?;
        } else if name.ends_with(".cpp") {
            sources.push(path);
        }
    }
    sources.sort();
    Ok(())
}
