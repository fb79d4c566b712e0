//! Times our assignment beside the crate `lapjv`, on the same f32 cost matrices: uniform reals, and
//! small integers full of ties.
//!
//! Both are run alternately, so that a slow spell of the machine strikes both, and the medians are
//! compared. A run of ours includes its check of the input, a run of theirs the allocation that it
//! cannot do without.

use std::hint::black_box;
use std::time::{Duration, Instant};

use planner_core::assignment::{AssignmentWorkspace, assign};

use crate::row::Row;

const LARGEST: usize = 1000;

/// Two rows, one for each kind of matrix, for N = 10, 100 and 1000; times in microseconds.
pub fn rows() -> Vec<Row> {
    let mut ws = Box::new(AssignmentWorkspace::<LARGEST>::new());
    let mut rows = Vec::new();
    for (n, instances) in [(10, 2000), (100, 60), (LARGEST, 5)] {
        for kind in [Kind::Real, Kind::Integer] {
            rows.push(compare(n, instances, kind, &mut ws));
        }
    }
    rows
}

/// Kind of the costs.
#[derive(Clone, Copy)]
enum Kind {
    Real,
    Integer,
}

fn compare(n: usize, instances: u64, kind: Kind, ws: &mut AssignmentWorkspace<LARGEST>) -> Row {
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let mut out = vec![None; n];
    for seed in 1..=instances {
        let costs = random_costs(n, kind, seed);
        let matrix = lapjv::Matrix::from_shape_vec((n, n), costs.clone()).expect("n by n costs");
        for _ in 0..3 {
            let start = Instant::now();
            let result = assign(black_box(&costs), n, n, ws, &mut out).expect("finite costs");
            ours.push(start.elapsed());
            let start = Instant::now();
            let (columns, _) = lapjv::lapjv(black_box(&matrix)).expect("a square matrix");
            theirs.push(start.elapsed());
            let their_total: f64 =
                columns.iter().enumerate().map(|(i, &j)| f64::from(costs[i * n + j])).sum();
            // `lapjv` sums prices in f32 and may miss the optimum by their rounding; ours must
            // never cost more.
            assert!(
                result.total_cost <= their_total + 1e-9 * their_total,
                "seed {seed}: not the optimum"
            );
        }
    }
    let (ours, theirs) = (median_us(ours), median_us(theirs));
    let kind = match kind {
        Kind::Real => "real",
        Kind::Integer => "integer",
    };
    Row {
        name: format!("assignment, {kind}"),
        ours,
        theirs,
        ratio: theirs / ours,
        required: 1.0,
        unit: "us",
        n,
    }
}

/// A random cost matrix, values uniform in [1, 100) from a seeded SplitMix64; integers are rounded
/// down.
fn random_costs(n: usize, kind: Kind, seed: u64) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut unit = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u32 << 24) as f32
    };
    (0..n * n)
        .map(|_| match kind {
            Kind::Real => 1.0 + 99.0 * unit(),
            Kind::Integer => (1.0 + 99.0 * unit()).floor(),
        })
        .collect()
}

fn median_us(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    times[times.len() / 2].as_secs_f64() * 1e6
}
