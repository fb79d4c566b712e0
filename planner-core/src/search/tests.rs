extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec as StdVec;

use proptest::prelude::*;

use super::*;
use crate::Point;
use crate::roadmap::tests::{encode, header};
use crate::roadmap::{Edge, RoadmapView};

const CAPACITY: usize = 32;
const REQUIRED_M: f32 = 1.0;

/// Sparse random graphs, often in several pieces; about half the edges are too narrow for [`REQUIRED_M`].
fn graphs() -> impl Strategy<Value = (StdVec<Point>, StdVec<Edge>)> {
    (2u16..CAPACITY as u16).prop_flat_map(|n| {
        let points = proptest::collection::vec((-9.0f32..9.0, -9.0f32..9.0, 0.0f32..9.0), usize::from(n));
        let edges = proptest::collection::btree_map((0..n, 0..n), 0.5f32..2.0, 0..3 * usize::from(n));
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
fn brute_force(view: &RoadmapView<'_>, passable: impl Fn(&HalfEdge) -> bool) -> StdVec<StdVec<f64>> {
    let n = view.node_count();
    let mut d = vec![vec![f64::INFINITY; n]; n];
    for (a, row) in d.iter_mut().enumerate() {
        row[a] = 0.0;
        for edge in view.half_edges(a as u16).filter(&passable) {
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

/// The checker of paths: joins its ends over passable edges, visits no node twice, is as long as it says.
fn check_path(view: &RoadmapView<'_>, path: &[u16], ends: (u16, u16), length: f32) {
    assert_eq!((path[0], path[path.len() - 1]), ends);
    let mut sum = 0.0f64;
    for pair in path.windows(2) {
        let edge = view.edge_between(pair[0], pair[1]).expect("consecutive nodes are joined");
        assert!(view.clears(&edge, REQUIRED_M));
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
    fn astar_and_dijkstra_equal_brute_force((nodes, edges) in graphs()) {
        let bytes = encode(&header(1, 1), &nodes, &edges);
        let view = RoadmapView::parse(&bytes).unwrap();
        let passable = |_: u16, edge: &HalfEdge| view.clears(edge, REQUIRED_M);
        let expected = brute_force(&view, |edge| view.clears(edge, REQUIRED_M));
        let all: StdVec<u16> = (0..nodes.len() as u16).collect();
        let mut ws = Box::new(SearchWorkspace::<CAPACITY>::new());
        let mut path = Vec::<u16, CAPACITY>::new();
        for &from in &all {
            let mut row = vec![f32::NAN; nodes.len()];
            dijkstra_row(&view, from, &all, passable, &mut ws, &mut row).unwrap();
            for &to in &all {
                let best = expected[usize::from(from)][usize::from(to)];
                prop_assert!(close(f64::from(row[usize::from(to)]), best));
                match ws.path_to(to, &mut path) {
                    Ok(()) => check_path(&view, &path, (from, to), row[usize::from(to)]),
                    Err(e) => prop_assert_eq!((e, best), (SearchError::NoPath, f64::INFINITY)),
                }
            }
            for &to in &all {
                let best = expected[usize::from(from)][usize::from(to)];
                match astar(&view, from, to, passable, &mut ws, &mut path) {
                    Ok(length) => {
                        prop_assert!(close(f64::from(length), best));
                        check_path(&view, &path, (from, to), length);
                    }
                    Err(e) => prop_assert_eq!((e, best), (SearchError::NoPath, f64::INFINITY)),
                }
            }
        }
    }
}
