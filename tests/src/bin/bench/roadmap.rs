//! Times our roadmap and searches beside `algorithm1.cpp`: paper P3D's Algorithm 1 as printed, over
//! all pairs, with OctoMap's `castRay`.
//!
//! Both programs get the same map (the built-in building at 0.25 m, for theirs written as `.bt`),
//! the same ten starts and goals, 2300 random nodes, Dmin 0.5 m, Dmax 8 m, margin 0, and are run
//! alternately. Loading the map is in neither time: theirs holds an octree, ours the voxel grid.
//! Both times include random nodes, the grid of nodes, neighbours, rays, and the graph in both
//! directions with the lengths of its edges (theirs an adjacency list, ours the roadmap file with
//! its CRC-32 and a list of lengths beside it). Nothing is kept from one repeat to the next. Our
//! reader's check of the file is in neither time, since their graph is not read from a file.
//!
//! `roadmap_s of plan` is what `host-sim plan` reports for the same building, on two cores, for
//! vehicles of 0.3 m without a safety margin: in addition to the above, starts and goals are
//! checked and every edge gets its clearance, which theirs has not.
//!
//! Ten A*: both search each pair by itself. The matrix: theirs is a hundred A*, ours
//! [`cost_matrix`].

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use host_sim::map::{UnknownSpace, bt, building};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::result::Timing;
use host_sim::scenario;
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::map::voxel::VoxelGrid;
use planner_core::roadmap::prm::{self, NodeGrid, PrmConfig, PrmEdge, Sampling, squared_length};
use planner_core::roadmap::search::{RoadmapWithLengths, SearchWorkspace, astar, cost_matrix};
use planner_core::roadmap::{self, LANDMARK_COUNT, RoadmapHeader, RoadmapView};
use serde::Deserialize;

use crate::row::Row;

/// Edge of a cell, metres.
const RESOLUTION_M: f32 = 0.25;
/// Number of random nodes.
const NODES: usize = 2300;
/// Least length of an edge, metres.
const EDGE_MIN_M: f32 = 0.5;
/// Greatest length of an edge, metres.
const EDGE_MAX_M: f32 = 8.0;
const VEHICLES: usize = 10;
/// Rounds, each of one run of theirs and [`REPEATS`] of ours on one core and on two.
const ROUNDS: usize = 9;
const REPEATS: usize = 3;
/// Workspace with the capacities of the default board.
type BoardNodeGrid = NodeGrid<4096, 4096>;

/// The JSON line that the baseline program prints.
#[derive(Deserialize)]
struct BaselineResult {
    nodes: usize,
    rays: usize,
    edges: usize,
    /// Number of vehicles with a path from start to goal.
    solved: usize,
    /// Sum of the lengths of these paths, metres.
    labelled_m: f64,
    nodes_ms: f64,
    edges_ms: f64,
    labelled_search_ms: f64,
    matrix_search_ms: f64,
}

/// Rows for the roadmap (in `host-sim plan`, on one core, on two), for ten A* and for the 10 × 10
/// cost matrix, milliseconds.
pub fn rows(peer: &Path) -> Result<Vec<Row>> {
    let map = building::building_map(building::DEFAULT_SEED, RESOLUTION_M)?;
    let dir = tempfile::tempdir()?;
    let files = ["building.bt", "starts.txt", "goals.txt"].map(|name| dir.path().join(name));
    bt::write(&map.to_octree("builtin:building")?, &files[0])?;
    let terminals = starts_and_goals();
    write_terminals(&files, &terminals)?;
    let voxels = map.to_voxel_map(UnknownSpace::Blocked);
    let grid = voxels.grid();
    let mut ours = OurBench::new(&grid, &terminals);
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let mut theirs = Vec::new();
    let mut times: [Vec<f64>; 4] = Default::default();
    let mut whole = Vec::new();
    for round in 0..ROUNDS {
        theirs.push(run_baseline(peer, &files)?);
        whole.extend(
            two.install(|| (0..REPEATS).map(|_| time_host_sim_plan()).collect::<Result<Vec<_>>>())?,
        );
        for repeat in 0..REPEATS {
            let seed = (1000 + round * REPEATS + repeat) as u64;
            let by_two = two.install(|| ours.build(seed, Threads::All))?;
            let built_by_two = ours.bytes.clone();
            let by_one = ours.build(seed, Threads::One)?;
            ensure!(
                ours.bytes == built_by_two,
                "seed {seed}: two cores built another roadmap than one"
            );
            let [lengths, labelled, matrix] = ours.search()?;
            for (times, time) in
                times.iter_mut().zip([by_one + lengths, by_two + lengths, labelled, matrix])
            {
                times.push(time);
            }
        }
    }
    print_sizes(&theirs, &ours);
    print_plan_timing(&whole);
    let build: TimeOfBaseline = |t| t.nodes_ms + t.edges_ms;
    let [by_one, by_two, labelled, matrix] = times;
    let whole = whole.iter().map(|timing| timing.roadmap_s * 1e3).collect();
    let all: [(&str, TimeOfBaseline, f64, usize, Vec<f64>); 5] = [
        ("roadmap_s of plan", build, 7.0, NODES, whole),
        ("roadmap, one core", build, 8.0, NODES, by_one),
        ("roadmap, two cores", build, 14.0, NODES, by_two),
        ("ten A*", |t| t.labelled_search_ms, 2.0, VEHICLES, labelled),
        ("10x10 matrix", |t| t.matrix_search_ms, 5.0, VEHICLES, matrix),
    ];
    Ok(all
        .into_iter()
        .map(|(name, value, required, n, times)| row(name, (required, n), times, &theirs, value))
        .collect())
}

/// Reads one time, milliseconds, from the JSON line of the baseline program.
type TimeOfBaseline = fn(&BaselineResult) -> f64;

/// A row of the bench: our `times` beside `value` of theirs, the required ratio of theirs to ours,
/// and `n`, the number of nodes or vehicles.
fn row(
    name: &str,
    (required, n): (f64, usize),
    times: Vec<f64>,
    theirs: &[BaselineResult],
    value: TimeOfBaseline,
) -> Row {
    // One ratio for each round, since a slow spell of the machine slows both programs.
    let ratios =
        theirs.iter().zip(times.chunks(REPEATS)).map(|(t, ours)| value(t) / median(ours.to_vec()));
    let ratio = median(ratios.collect());
    Row {
        name: name.into(),
        ours: median(times),
        theirs: median(theirs.iter().map(value).collect()),
        ratio,
        required,
        unit: "ms",
        n,
    }
}

/// Times of map and roadmap as a user of `host-sim plan` waits for them, with all parts, in the
/// same building, for ten vehicles without a safety margin.
fn time_host_sim_plan() -> Result<Timing> {
    let mut text = format!(
        "[map]\nfile = \"builtin:building\"\nresolution_m = {RESOLUTION_M}\n\
         [roadmap]\nnodes = {NODES}\nedge_min_m = {EDGE_MIN_M}\nedge_max_m = {EDGE_MAX_M}\nsafety_margin_m = 0.0\n\
         [mission]\ngoals = ["
    );
    let terminals = starts_and_goals();
    let (starts, goals) = terminals.split_at(VEHICLES);
    for (i, goal) in goals.iter().enumerate() {
        // The goals of the ninth and tenth vehicle would be above others, so they are moved aside.
        let x = if i < 8 { goal.x } else { goal.x + 2.0 };
        text += &format!("[{x}, {}, {}], ", goal.y, goal.z);
    }
    text += "]\n";
    for (i, start) in starts.iter().enumerate() {
        text += &format!(
            "[[vehicles]]\nid = {}\nstart = [{}, {}, {}]\n",
            i + 1,
            start.x,
            start.y,
            start.z
        );
    }
    Ok(PreparedMission::prepare(scenario::parse(&text, "bench.toml")?, &Progress::hidden())?.timing)
}

/// Prints the median time of each part of `host-sim plan`'s map and roadmap.
fn print_plan_timing(whole: &[Timing]) {
    let part = |value: fn(&Timing) -> f64| median(whole.iter().map(|t| value(t) * 1e3).collect());
    println!(
        "plan:   map {:.2} ms, roadmap {:.2} ms: boxes {:.2}, nodes {:.2}, edges with clearances {:.2}, file {:.2}",
        part(|t| t.map_s),
        part(|t| t.roadmap_s),
        part(|t| t.roadmap_parts.box_tree_s),
        part(|t| t.roadmap_parts.nodes_s),
        part(|t| t.roadmap_parts.edges_s),
        part(|t| t.roadmap_parts.encoding_s)
    );
}

/// Writes starts and goals to the second and third file, for the baseline program.
fn write_terminals(files: &[PathBuf; 3], terminals: &[Point]) -> Result<()> {
    for (file, points) in files[1..].iter().zip(terminals.chunks(VEHICLES)) {
        let mut out = std::fs::File::create(file)?;
        for p in points {
            writeln!(out, "{} {} {}", p.x, p.y, p.z)?;
        }
    }
    Ok(())
}

/// Prints the sizes of the roadmaps that both programs built last.
fn print_sizes(theirs: &[BaselineResult], ours: &OurBench<'_>) {
    let Some(last) = theirs.last() else { return };
    println!(
        "theirs: {} nodes, {} rays, {} edges, {} of {VEHICLES} solved, {:.1} m",
        last.nodes, last.rays, last.edges, last.solved, last.labelled_m
    );
    println!(
        "ours:   {} nodes, {} rays, {} edges, {} of {VEHICLES} solved, {:.1} m (other random nodes)",
        ours.nodes.len(),
        ours.ray_count(),
        ours.edges.len(),
        ours.solved,
        ours.labelled_m
    );
}

/// Ten starts in the building's lobby, then ten goals in the corridors above.
fn starts_and_goals() -> Vec<Point> {
    let along = |i: usize| 8.5 + 2.5 * i as f32;
    let starts = (0..VEHICLES).map(|i| Point::new(along(i), 4.0, 1.5));
    let goals = (0..VEHICLES).map(|i| {
        let floor = 1 + i % (building::FLOORS as usize - 1);
        Point::new(
            if i % 2 == 0 { 12.1 } else { 29.1 },
            12.1,
            floor as f32 * building::FLOOR_HEIGHT_M + 1.6,
        )
    });
    starts.chain(goals).collect()
}

fn run_baseline(peer: &Path, files: &[std::path::PathBuf]) -> Result<BaselineResult> {
    let out = Command::new(peer)
        .args(files)
        .args([
            EDGE_MIN_M.to_string(),
            EDGE_MAX_M.to_string(),
            NODES.to_string(),
            REPEATS.to_string(),
        ])
        .output()
        .with_context(|| format!("cannot run {}", peer.display()))?;
    let text = String::from_utf8_lossy(&out.stdout);
    let line = text.lines().find(|line| line.starts_with('{'));
    let line =
        line.with_context(|| format!("{} printed no JSON line but: {text}", peer.display()))?;
    Ok(serde_json::from_str(line)?)
}

/// Threads that build a roadmap.
#[derive(Clone, Copy)]
enum Threads {
    All,
    One,
}

/// Our program: its input, its workspaces, and what it computed last.
struct OurBench<'a> {
    grid: &'a VoxelGrid<'a>,
    /// Starts, then goals.
    terminals: &'a [Point],
    workspace: Box<BoardNodeGrid>,
    search: Box<SearchWorkspace<4096>>,
    nodes: Vec<Point>,
    edges: Vec<roadmap::Edge>,
    bytes: Vec<u8>,
    solved: usize,
    labelled_m: f64,
}

impl<'a> OurBench<'a> {
    fn new(grid: &'a VoxelGrid<'a>, terminals: &'a [Point]) -> Self {
        Self {
            grid,
            terminals,
            workspace: Box::new(NodeGrid::new()),
            search: Box::new(SearchWorkspace::new()),
            nodes: Vec::new(),
            edges: Vec::new(),
            bytes: Vec::new(),
            solved: 0,
            labelled_m: 0.0,
        }
    }

    /// Builds the roadmap file once; returns the milliseconds it took.
    fn build(&mut self, seed: u64, threads: Threads) -> Result<f64> {
        let config = PrmConfig {
            random_nodes: NODES,
            edge_min_m: EDGE_MIN_M,
            edge_max_m: EDGE_MAX_M,
            clearance_m: 0.0,
            seed,
            sampling: Sampling::Uniform,
        };
        self.nodes = Vec::new();
        self.edges = Vec::new();
        self.bytes = Vec::new();
        let start = Instant::now();
        self.nodes = vec![Point::zeros(); self.terminals.len() + NODES];
        prm::sample_nodes(self.grid, None, self.terminals, &config, &mut self.nodes)
            .map_err(to_anyhow)?;
        let edge = |e: PrmEdge| roadmap::Edge { a: e.a, b: e.b, clearance_m: 0.0 };
        let (grid, nodes) = (self.grid, &self.nodes);
        match threads {
            Threads::All => {
                let edges = host_sim::roadmap::connect(grid, nodes, &config, &mut self.workspace)
                    .map_err(to_anyhow)?;
                self.edges = edges.into_iter().map(edge).collect();
            }
            Threads::One => {
                self.workspace.sort_nodes(nodes, &config).map_err(to_anyhow)?;
                prm::connect_range(grid, &self.workspace, &config, 0..nodes.len(), |e| {
                    self.edges.push(edge(e));
                    Ok(())
                })
                .map_err(to_anyhow)?;
            }
        }
        let header = RoadmapHeader {
            origin: Geodetic::default(),
            edge_min_m: EDGE_MIN_M,
            edge_max_m: EDGE_MAX_M,
            tested_clearance_m: 0.0,
            max_clearance_m: 4.0,
            start_count: VEHICLES as u16,
            goal_count: VEHICLES as u16,
        };
        let len = roadmap::encoded_len(self.nodes.len(), self.edges.len(), LANDMARK_COUNT)
            .context("the roadmap fits 32 bits")?;
        self.bytes = vec![0; len];
        roadmap::write_with_landmarks(
            &header,
            &self.nodes,
            &self.edges,
            &[],
            &mut self.search,
            &mut self.bytes,
        )
        .map_err(to_anyhow)?;
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }

    /// Computes the lengths of the edges, ten labelled A* and the cost matrix; milliseconds of
    /// each.
    fn search(&mut self) -> Result<[f64; 3]> {
        let view = RoadmapView::parse(&self.bytes).map_err(to_anyhow)?;
        let start = Instant::now();
        let mut lengths = vec![0.0; view.half_edge_count()];
        let graph = RoadmapWithLengths::new(view, &mut lengths).map_err(to_anyhow)?;
        let measured = start.elapsed();
        let mut path = heapless::Vec::<u16, 256>::new();
        (self.solved, self.labelled_m) = (0, 0.0);
        let start = Instant::now();
        for i in 0..VEHICLES as u16 {
            let goal = VEHICLES as u16 + i;
            if let Ok(length) = astar(&graph, i, goal, |_, _| true, &mut self.search, &mut path) {
                self.solved += 1;
                self.labelled_m += f64::from(length);
            }
        }
        let labelled = start.elapsed();
        let starts: Vec<u16> = (0..VEHICLES as u16).collect();
        let goals: Vec<u16> = (VEHICLES as u16..2 * VEHICLES as u16).collect();
        let mut matrix = [0.0; VEHICLES * VEHICLES];
        let start = Instant::now();
        cost_matrix(&graph, &starts, &goals, |_, _| true, &mut self.search, &mut matrix)
            .map_err(to_anyhow)?;
        std::hint::black_box(&matrix);
        Ok([measured, labelled, start.elapsed()].map(|time| time.as_secs_f64() * 1e3))
    }

    /// Number of node pairs within the range of edge lengths, for each of which Algorithm 1 casts a
    /// ray.
    fn ray_count(&self) -> usize {
        let range = EDGE_MIN_M * EDGE_MIN_M..=EDGE_MAX_M * EDGE_MAX_M;
        let near = |k: usize, l: usize| {
            range.contains(&squared_length(self.nodes[k].into(), self.nodes[l].into()))
        };
        (0..self.nodes.len())
            .map(|k| (k + 1..self.nodes.len()).filter(|&l| near(k, l)).count())
            .sum()
    }
}

fn to_anyhow(error: impl std::fmt::Debug) -> anyhow::Error {
    anyhow::anyhow!("{error:?}")
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
