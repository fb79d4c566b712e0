//! One step of `priority` deconfliction in instructions, the worst of ten thousand random cases.
//!
//! The bench runs itself under valgrind's callgrind, which counts the instructions of [`priority_step`] alone and writes the
//! count down each time it returns: every case is counted, so the worst is the worst. In these rows "ours" is that worst
//! case, "theirs" what a step may cost. It is this machine's instruction set; a board's differs by a small factor.
//!
//! Half of the cases are made to be hard: everybody near and without a shared plan, every gate within reach and passed.

use std::hint::black_box;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use planner_core::Point;
use planner_core::deconflict::{self, Advice, DeconflictConfig, Method, Neighbour, Own};
use planner_core::path::Path;
use planner_core::schedule::Gate;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::Row;

const CASES: usize = 10_000;
const SEED: u64 = 1;
/// The function whose instructions are counted, as callgrind calls it.
const COUNTED: &str = "bench::steps::priority_step";
/// Waypoints of a path and gates of a vehicle on the default board.
const WAYPOINTS: usize = 64;
const GATES: usize = 128;

/// A row for ten neighbours and one for thirty-two, thousands of instructions.
pub fn rows() -> Result<Vec<Row>> {
    [(10, 20.0), (32, 60.0)].map(|(neighbours, limit)| row(neighbours, limit)).into_iter().collect()
}

fn row(neighbours: usize, limit: f64) -> Result<Row> {
    let mut counts = counted(neighbours)?;
    ensure!(counts.len() == CASES, "{} of {CASES} cases were counted", counts.len());
    counts.sort_unstable();
    let thousands = |count: u64| count as f64 * 1e-3;
    let worst = thousands(counts[CASES - 1]);
    println!(
        "{neighbours} neighbours: median {:.1}, worst {worst:.1} thousand instructions of {CASES} cases",
        thousands(counts[CASES / 2])
    );
    Ok(Row {
        name: "priority step".into(),
        ours: worst,
        theirs: limit,
        ratio: limit / worst,
        required: 1.0,
        unit: "ki",
        n: neighbours,
    })
}

/// Instructions of each case.
fn counted(neighbours: usize) -> Result<Vec<u64>> {
    let dir = tempfile::tempdir()?;
    let file = dir.path().join("counts");
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet", "--combine-dumps=yes"])
        .args([format!("--toggle-collect={COUNTED}"), format!("--dump-after={COUNTED}")])
        .arg(format!("--callgrind-out-file={}", file.display()))
        .arg(std::env::current_exe()?)
        .args(["--steps-beside", &neighbours.to_string()])
        .stdout(Stdio::null())
        .status()
        .context("valgrind does not start")?;
    ensure!(status.success(), "valgrind: {status}");
    let counts = std::fs::read_to_string(&file)?;
    // One block for each return; a last one, at the end of the process, counts nothing.
    let totals = counts.lines().filter_map(|line| line.strip_prefix("summary: "));
    Ok(totals.filter_map(|count| count.trim().parse().ok()).filter(|&count| count > 0).collect())
}

/// What is counted.
#[inline(never)]
fn priority_step(
    cfg: &DeconflictConfig,
    own: &Own<'_, WAYPOINTS>,
    gates: &[Gate],
    neighbours: &[Neighbour],
) -> Advice {
    // Not the last thing done, or the call would be a jump and callgrind would not see the return.
    black_box(deconflict::advise(cfg, own, gates, neighbours))
}

/// Every case once.
pub fn run(neighbours: usize) {
    let mut rng = Pcg32::seed_from_u64(SEED);
    for number in 0..CASES {
        let case = Case::new(&mut rng, neighbours, number % 2 == 0);
        let own =
            Own { rank: 0, position: case.position, along_m: case.along_m, path: &case.path, detours: false };
        black_box(priority_step(&case.cfg, &own, &case.gates, black_box(&case.neighbours)));
    }
}

struct Case {
    cfg: DeconflictConfig,
    position: Point,
    along_m: f32,
    path: Path<WAYPOINTS>,
    gates: Vec<Gate>,
    neighbours: Vec<Neighbour>,
}

impl Case {
    fn new(rng: &mut Pcg32, neighbours: usize, hard: bool) -> Self {
        let cfg = DeconflictConfig {
            method: Method::Priority,
            safety_distance_m: uniform(rng, 0.5, 3.0),
            cruise_mps: uniform(rng, 0.5, 5.0),
            accel_mps2: 1.5,
        };
        let mut path = Path::new();
        let mut at = Point::zeros();
        for _ in 0..2 + rng.next_u32() as usize % (WAYPOINTS - 1) {
            path.push(at, 1.0).expect("there is room");
            at += anywhere(rng, 5.0);
        }
        let along_m = uniform(rng, -1.0, path.length_m());
        let position = path.point_at(along_m).expect("a path") + anywhere(rng, 0.2);
        let reach_m = if hard { 3.0 } else { path.length_m() };
        let gate = |rng: &mut Pcg32| Gate {
            at_m: along_m + uniform(rng, 0.0, reach_m),
            id: 2 + (rng.next_u32() as usize % neighbours) as u8,
            until_m: uniform(rng, 0.0, 60.0),
        };
        let mut gates: Vec<_> = (0..rng.next_u32() as usize % (GATES + 1)).map(|_| gate(rng)).collect();
        gates.sort_by(|a, b| a.at_m.total_cmp(&b.at_m));
        let unplanned = if hard { 1.0 } else { uniform(rng, 0.0, 1.0) };
        // Half of the hard cases pass all gates, the other half have nobody's progress.
        let passed = hard && rng.next_u32() % 2 == 0;
        let neighbours = (0..neighbours)
            .map(|k| Neighbour {
                id: 2 + k as u8,
                rank: 1 + k as u16,
                position: position + anywhere(rng, if hard { 12.0 } else { 40.0 }),
                velocity: anywhere(rng, 3.0),
                age_s: uniform(rng, 0.0, 2.0),
                progress_m: match passed {
                    true => Some(100.0),
                    false => (uniform(rng, 0.0, 1.0) > unplanned).then(|| uniform(rng, 0.0, 60.0)),
                },
                grounded: !hard && rng.next_u32() % 8 == 0,
                ..Neighbour::default()
            })
            .collect();
        Self { cfg, position, along_m, path, gates, neighbours }
    }
}

fn uniform(rng: &mut Pcg32, low: f32, high: f32) -> f32 {
    low + (rng.next_u32() >> 8) as f32 / (1u32 << 24) as f32 * (high - low)
}

fn anywhere(rng: &mut Pcg32, reach_m: f32) -> Point {
    Point::from_fn(|_, _| uniform(rng, -reach_m, reach_m))
}
