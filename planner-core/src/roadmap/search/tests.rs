extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec as StdVec;

use proptest::prelude::*;

use super::*;
use crate::Point;
use crate::roadmap::RoadmapHeader;
use crate::roadmap::tests::{encode, encode_with_landmarks, header};
use crate::roadmap::{Edge, RoadmapView};

const CAPACITY: usize = 32;
const REQUIRED_M: f32 = 1.0;

/// Sparse random graphs, often in several pieces; about half the edges are too narrow for
/// [`REQUIRED_M`].
fn graphs() -> impl Strategy<Value = (StdVec<Point>, StdVec<Edge>)> {
    (2u16..CAPACITY as u16).prop_flat_map(|n| {
        let points =
            proptest::collection::vec((-9.0f32..9.0, -9.0f32..9.0, 0.0f32..9.0), usize::from(n));
        let edges =
            proptest::collection::btree_map((0..n, 0..n), 0.5f32..2.0, 0..3 * usize::from(n));
        (points, edges).prop_map(|(points, edges)| {
            let nodes: StdVec<_> = points.iter().map(|&(x, y, z)| Point::new(x, y, z)).collect();
            let edges = edges
                .into_iter()
                .filter(|&((a, b), _)| a < b && nodes[usize::from(a)] != nodes[usize::from(b)]);
            let edges = edges.map(|((a, b), clearance_m)| Edge { a, b, clearance_m }).collect();
            (nodes, edges)
        })
    })
}

/// All pairs by Floyd and Warshall, f64.
fn brute_force(
    view: &RoadmapView<'_>,
    passable: impl Fn(u16, &HalfEdge) -> bool,
) -> StdVec<StdVec<f64>> {
    let n = view.node_count();
    let mut d = vec![vec![f64::INFINITY; n]; n];
    for (a, row) in d.iter_mut().enumerate() {
        row[a] = 0.0;
        for edge in view.half_edges(a as u16).filter(|edge| passable(a as u16, edge)) {
            let along = view.node(edge.target).cast::<f64>() - view.node(a as u16).cast::<f64>();
            row[usize::from(edge.target)] = along.norm();
        }
    }
    for k in 0..n {
        for i in 0..n {
            for j in 0..n {
                d[i][j] = d[i][j].min(d[i][k] + d[k][j]);
            }
        }
    }
    d
}

/// Whether a roadmap stores distances to landmarks.
#[derive(Clone, Copy, Debug)]
enum Landmarks {
    Stored,
    None,
}

fn landmarks() -> impl Strategy<Value = Landmarks> {
    any::<bool>().prop_map(|stored| if stored { Landmarks::Stored } else { Landmarks::None })
}

fn encode_either(nodes: &[Point], edges: &[Edge], landmarks: Landmarks) -> StdVec<u8> {
    let any_length = RoadmapHeader { edge_min_m: 0.0, ..header(1, 1) };
    match landmarks {
        Landmarks::Stored => encode_with_landmarks(&any_length, nodes, edges),
        Landmarks::None => encode(&any_length, nodes, edges),
    }
}

/// Checks a path: it joins its ends over passable edges, visits no node twice, and has the stated
/// length.
fn check_path(view: &RoadmapView<'_>, path: &[u16], ends: (u16, u16), length: f32) {
    assert_eq!((path[0], path[path.len() - 1]), ends);
    let mut sum = 0.0f64;
    for pair in path.windows(2) {
        let edge = view.edge_between(pair[0], pair[1]).expect("consecutive nodes are joined");
        assert!(view.has_clearance(&edge, REQUIRED_M));
        sum += f64::from(view.distance_m(pair[0], pair[1]));
    }
    assert!(close(f64::from(length), sum), "says {length}, is {sum}");
    let mut nodes = path.to_vec();
    nodes.sort_unstable();
    nodes.dedup();
    assert_eq!(nodes.len(), path.len());
}

fn close(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= 1e-5 * b.abs().max(1.0)
}

proptest! {
    #[test]
    fn astar_and_dijkstra_equal_brute_force(
        (nodes, edges) in graphs(),
        landmarks in landmarks(),
    ) {
        let bytes = encode_either(&nodes, &edges, landmarks);
        let view = RoadmapView::parse(&bytes).unwrap();
        let passable = |_: u16, edge: &HalfEdge| view.has_clearance(edge, REQUIRED_M);
        let expected = brute_force(&view, passable);
        let all: StdVec<u16> = (0..nodes.len() as u16).collect();
        let mut ws = Box::new(SearchWorkspace::<CAPACITY>::new());
        let mut path = Vec::<u16, CAPACITY>::new();
        let mut lengths = vec![0.0; view.half_edge_count()];
        let with_lengths = RoadmapWithLengths::new(view, &mut lengths).unwrap();
        let mut quick = vec![f32::NAN; nodes.len()];
        for &from in &all {
            path_lengths_to(&with_lengths, from, &all, passable, &mut ws, &mut quick).unwrap();
            let mut row = vec![f32::NAN; nodes.len()];
            path_lengths_to(&view, from, &all, passable, &mut ws, &mut row).unwrap();
            for &to in &all {
                let best = expected[usize::from(from)][usize::from(to)];
                prop_assert!(close(f64::from(row[usize::from(to)]), best));
                prop_assert_eq!(row[usize::from(to)].to_bits(), quick[usize::from(to)].to_bits());
                match ws.path_to(to, &mut path) {
                    Ok(()) => check_path(&view, &path, (from, to), row[usize::from(to)]),
                    Err(e) => prop_assert_eq!((e, best), (SearchError::NoPath, f64::INFINITY)),
                }
            }
            for &to in &all {
                let best = expected[usize::from(from)][usize::from(to)];
                match astar(&view, from, to, passable, &mut ws, &mut path) {
                    Ok(length) => {
                        let (same, mut same_path) = (path.clone(), Vec::<u16, CAPACITY>::new());
                        let again =
                            astar(&with_lengths, from, to, passable, &mut ws, &mut same_path);
                        prop_assert_eq!((again, same_path), (Ok(length), same));
                        prop_assert!(close(f64::from(length), best));
                        check_path(&view, &path, (from, to), length);
                    }
                    Err(e) => prop_assert_eq!((e, best), (SearchError::NoPath, f64::INFINITY)),
                }
            }
        }
    }
}

/// A rectangle of nodes 0 to 3 with the diagonal 0–2, and node 4 without edges.
fn square() -> StdVec<u8> {
    let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0), (9.0, 9.0)];
    let nodes: StdVec<_> = corners.iter().map(|&(x, y)| Point::new(x, y, 0.0)).collect();
    let edge = |a, b| Edge { a, b, clearance_m: 2.0 };
    encode(&header(0, 0), &nodes, &[edge(0, 1), edge(1, 2), edge(2, 3), edge(3, 0), edge(0, 2)])
}

#[test]
fn blocked_nodes_and_edges_are_avoided_and_ties_go_to_the_lower_node() {
    let bytes = square();
    let view = RoadmapView::parse(&bytes).unwrap();
    let mut ws = SearchWorkspace::<8>::new();
    let mut path = Vec::<u16, 8>::new();
    assert_eq!(astar(&view, 0, 2, |_, _| true, &mut ws, &mut path), Ok(5.0));
    assert_eq!(path, [0, 2]);
    let no_diagonal = |from: u16, edge: &HalfEdge| !matches!((from, edge.target), (0, 2) | (2, 0));
    assert_eq!(astar(&view, 0, 2, no_diagonal, &mut ws, &mut path), Ok(7.0));
    assert_eq!(path, [0, 1, 2]);
    let not_past_1 = |from: u16, edge: &HalfEdge| no_diagonal(from, edge) && edge.target != 1;
    assert_eq!(astar(&view, 0, 2, not_past_1, &mut ws, &mut path), Ok(7.0));
    assert_eq!(path, [0, 3, 2]);
    assert_eq!(astar(&view, 3, 3, |_, _| true, &mut ws, &mut path), Ok(0.0));
    assert_eq!(path, [3]);
}

#[test]
fn a_search_that_cannot_answer_says_why() {
    let bytes = square();
    let view = RoadmapView::parse(&bytes).unwrap();
    let mut ws = SearchWorkspace::<8>::new();
    let mut path = Vec::<u16, 1>::new();
    let mut find = |from, to| astar(&view, from, to, |_, _| true, &mut ws, &mut path);
    assert_eq!(find(0, 4), Err(SearchError::NoPath));
    assert_eq!(find(0, 2), Err(SearchError::PathTooLong));
    assert_eq!(find(5, 2), Err(SearchError::BadNode(5)));
    assert_eq!(find(0, 5), Err(SearchError::BadNode(5)));
    let mut row = [0.0; 2];
    let mut fill =
        |targets: &[u16]| path_lengths_to(&view, 0, targets, |_, _| true, &mut ws, &mut row);
    assert_eq!(fill(&[1, 5]), Err(SearchError::BadNode(5)));
    assert_eq!(fill(&[1]), Err(SearchError::OutputLength));
    assert_eq!(fill(&[4, 1]), Ok(()));
    assert_eq!(row, [f32::INFINITY, 4.0]);
    let mut small = SearchWorkspace::<4>::new();
    let too_small = astar(&view, 0, 2, |_, _| true, &mut small, &mut path);
    assert_eq!(too_small, Err(SearchError::WorkspaceTooSmall));
}

#[test]
fn a_row_without_targets_searches_nothing_and_repeated_targets_are_all_filled() {
    let bytes = square();
    let view = RoadmapView::parse(&bytes).unwrap();
    let mut ws = SearchWorkspace::<8>::new();
    assert_eq!(
        path_lengths_to(&view, 0, &[], |_, _| panic!("an edge was asked"), &mut ws, &mut []),
        Ok(())
    );
    let mut row = [0.0; 3];
    assert_eq!(path_lengths_to(&view, 0, &[1, 0, 1], |_, _| true, &mut ws, &mut row), Ok(()));
    assert_eq!(row, [4.0, 0.0, 4.0]);
}

proptest! {
    #[test]
    fn the_cost_matrix_equals_brute_force_from_either_side(
        (nodes, edges) in graphs(),
        picks in proptest::collection::vec(any::<u16>(), 1..9),
        split in any::<proptest::sample::Index>(),
        one_way in 0u16..4,
        landmarks in landmarks(),
    ) {
        let bytes = encode_either(&nodes, &edges, landmarks);
        let view = RoadmapView::parse(&bytes).unwrap();
        let picks: StdVec<u16> = picks.iter().map(|pick| pick % nodes.len() as u16).collect();
        let (starts, goals) = picks.split_at(split.index(picks.len() + 1));
        // A rule that depends on the direction shows whether the backward search reverses it.
        let passable = |from: u16, edge: &HalfEdge| (from + 2 * edge.target) % 4 >= one_way;
        let mut ws = Box::new(SearchWorkspace::<CAPACITY>::new());
        let mut matrix = vec![f32::NAN; starts.len() * goals.len()];
        cost_matrix(&view, starts, goals, passable, &mut ws, &mut matrix).unwrap();
        let expected = brute_force(&view, passable);
        for (row, &start) in starts.iter().enumerate() {
            for (column, &goal) in goals.iter().enumerate() {
                let best = expected[usize::from(start)][usize::from(goal)];
                prop_assert!(close(f64::from(matrix[row * goals.len() + column]), best));
            }
        }
        let short = &mut [0.0; 99][..starts.len() * goals.len() + 1];
        let refused = cost_matrix(&view, starts, goals, passable, &mut ws, short);
        prop_assert_eq!(refused, Err(SearchError::OutputLength));
    }
}
