extern crate std;
use std::boxed::Box;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

const CAPACITY: usize = 8;

/// The best of all assignments, by number of pairs and then by `objective`, found by trying all.
fn brute_force(costs: &[f32], rows: usize, cols: usize, objective: Objective) -> Assignment {
    fn extend(
        costs: &[f32],
        cols: usize,
        row: usize,
        used: u32,
        so_far: Assignment,
        best: &mut dyn FnMut(Assignment),
    ) {
        if row * cols == costs.len() {
            return best(so_far);
        }
        extend(costs, cols, row + 1, used, so_far, best);
        for col in (0..cols).filter(|col| used & 1 << col == 0) {
            let cost = costs[row * cols + col];
            if cost < f32::INFINITY {
                let next = Assignment {
                    pair_count: so_far.pair_count + 1,
                    total_cost: so_far.total_cost + f64::from(cost),
                    largest_cost: so_far.largest_cost.max(cost),
                };
                extend(costs, cols, row + 1, used | 1 << col, next, best);
            }
        }
    }
    let none = Assignment { pair_count: 0, total_cost: 0.0, largest_cost: f32::NEG_INFINITY };
    let mut best = none;
    extend(costs, cols, 0, 0, none, &mut |found| {
        let better = match objective {
            Objective::Total => found.total_cost < best.total_cost,
            Objective::Makespan => {
                (found.largest_cost, found.total_cost) < (best.largest_cost, best.total_cost)
            }
        };
        if found.pair_count > best.pair_count || (found.pair_count == best.pair_count && better) {
            best = found;
        }
    });
    assert_eq!(rows * cols, costs.len());
    best
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Objective {
    Total,
    Makespan,
}

/// Checks an assignment: each column at most once, only possible pairs, and figures that are those
/// of the pairs.
fn check_assignment(costs: &[f32], cols: usize, out: &[Option<u16>], said: Assignment) {
    let mut used = vec![false; cols];
    let mut sum = Assignment { pair_count: 0, total_cost: 0.0, largest_cost: f32::NEG_INFINITY };
    for (row, col) in
        out.iter().enumerate().filter_map(|(row, col)| col.map(|col| (row, usize::from(col))))
    {
        assert!(!core::mem::replace(&mut used[col], true), "column {col} twice");
        let cost = costs[row * cols + col];
        assert!(cost.is_finite(), "row {row} sent where it cannot go");
        sum = Assignment {
            pair_count: sum.pair_count + 1,
            total_cost: sum.total_cost + f64::from(cost),
            largest_cost: sum.largest_cost.max(cost),
        };
    }
    assert_eq!((sum.pair_count, sum.largest_cost), (said.pair_count, said.largest_cost));
    assert!((sum.total_cost - said.total_cost).abs() <= 1e-9 * sum.total_cost.abs().max(1.0));
}

fn solve_checked<const N: usize>(
    costs: &[f32],
    rows: usize,
    cols: usize,
    objective: Objective,
    ws: &mut AssignmentWorkspace<N>,
) -> Assignment {
    let mut out = vec![None; rows];
    let result = match objective {
        Objective::Total => assign(costs, rows, cols, ws, &mut out),
        Objective::Makespan => assign_bottleneck(costs, rows, cols, ws, &mut out),
    };
    let result = result.unwrap();
    check_assignment(costs, cols, &out, result);
    result
}

/// Square, wide and tall matrices; reals, and small integers with many ties; some of the pairs are
/// impossible.
fn matrices() -> impl Strategy<Value = (usize, usize, Vec<f32>)> {
    (1usize..=6, 1usize..=6, any::<bool>(), 0u8..=9).prop_flat_map(
        |(rows, cols, integers, blocked)| {
            let cost =
                (-5.0f32..20.0, 0u8..10).prop_map(move |(cost, dice)| match dice < blocked {
                    true => f32::INFINITY,
                    false if integers => libm::roundf(cost / 4.0),
                    false => cost,
                });
            (Just(rows), Just(cols), proptest::collection::vec(cost, rows * cols))
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn equals_brute_force((rows, cols, costs) in matrices()) {
        let mut ws = AssignmentWorkspace::<CAPACITY>::new();
        for objective in [Objective::Total, Objective::Makespan] {
            let best = brute_force(&costs, rows, cols, objective);
            let ours = solve_checked(&costs, rows, cols, objective, &mut ws);
            prop_assert_eq!(ours.pair_count, best.pair_count);
            prop_assert!(
                (ours.total_cost - best.total_cost).abs() < 1e-4,
                "{:?} {:?} {:?}",
                objective,
                ours,
                best
            );
            if objective == Objective::Makespan {
                prop_assert_eq!(ours.largest_cost, best.largest_cost);
            }
        }
    }
}

#[test]
fn or_library_instances_reach_their_published_optimum() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/assignment");
    let Ok(optima) = std::fs::read_to_string(format!("{folder}/assignopt.txt")) else {
        std::println!("skipped: no ../shared/data/assignment");
        return;
    };
    let optimum = |name: &str| -> f64 {
        let line =
            optima.lines().find(|line| line.split_whitespace().next() == Some(name)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    let mut ws = Box::new(AssignmentWorkspace::<200>::new());
    for name in ["assign100", "assign200"] {
        let text: String = std::fs::read_to_string(format!("{folder}/{name}.txt")).unwrap();
        let mut numbers = text.split_whitespace().map(|word| word.parse::<f32>().unwrap());
        let n = numbers.next().unwrap() as usize;
        let costs: Vec<f32> = numbers.collect();
        let result = solve_checked(&costs, n, n, Objective::Total, &mut ws);
        assert_eq!((result.pair_count, result.total_cost), (n, optimum(name)), "{name}");
        // The same problem seen from the tasks.
        let transposed: Vec<f32> = (0..n * n).map(|k| costs[k % n * n + k / n]).collect();
        assert_eq!(
            solve_checked(&transposed, n, n, Objective::Total, &mut ws).total_cost,
            optimum(name)
        );
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    let mut ws = AssignmentWorkspace::<CAPACITY>::new();
    let mut refuse = |costs: &[f32], rows, cols, out: usize| {
        let out = &mut [None; CAPACITY + 1][..out];
        let total = assign(costs, rows, cols, &mut ws, out);
        assert_eq!(total, assign_bottleneck(costs, rows, cols, &mut ws, out));
        total.unwrap_err()
    };
    assert_eq!(refuse(&[], 0, 3, 0), AssignmentError::Empty);
    assert_eq!(refuse(&[], 3, 0, 3), AssignmentError::Empty);
    assert_eq!(refuse(&[1.0; 5], 2, 3, 2), AssignmentError::Shape);
    assert_eq!(refuse(&[1.0; 6], 2, 3, 3), AssignmentError::OutputLength);
    assert_eq!(refuse(&[1.0; 9], 9, 1, 9), AssignmentError::WorkspaceTooSmall);
    assert_eq!(refuse(&[1.0; 9], 1, 9, 1), AssignmentError::WorkspaceTooSmall);
    let mut costs = [1.0; 6];
    costs[5] = f32::NAN;
    assert_eq!(refuse(&costs, 2, 3, 2), AssignmentError::NotANumber { row: 1, col: 2 });
    costs[3] = f32::NEG_INFINITY;
    assert_eq!(refuse(&costs, 2, 3, 2), AssignmentError::MinusInfinity { row: 1, col: 0 });
}

#[test]
fn huge_and_tiny_costs_lose_nothing_to_a_stand_in_for_infinity() {
    // With 1e38 for impossible pairs, the thousandths would vanish.
    let costs =
        [1e-3, 2e-3, f32::INFINITY, 3e-3, 1e-3, 1e37, f32::INFINITY, f32::INFINITY, f32::INFINITY];
    let mut ws = AssignmentWorkspace::<CAPACITY>::new();
    let result = solve_checked(&costs, 3, 3, Objective::Total, &mut ws);
    assert_eq!((result.pair_count, result.total_cost as f32), (2, 2e-3));
}
