extern crate std;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

pub(crate) fn header(starts: u16, goals: u16) -> RoadmapHeader {
    RoadmapHeader {
        origin: Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 },
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        tested_clearance_m: 0.25,
        max_clearance_m: 10.0,
        starts,
        goals,
    }
}

pub(crate) fn encode(header: &RoadmapHeader, nodes: &[Point], edges: &[Edge]) -> Vec<u8> {
    let mut out = vec![0xa5; encoded_len(nodes.len(), edges.len()).unwrap()];
    assert_eq!(write(header, nodes, edges, &mut out), Ok(out.len()));
    out
}

/// A roadmap of distinct points with any edges among them.
fn graphs() -> impl Strategy<Value = (Vec<Point>, Vec<Edge>)> {
    (2usize..24).prop_flat_map(|n| {
        let heights = proptest::collection::vec(-50.0f32..50.0, n);
        let clearances = proptest::collection::vec(proptest::option::of(0.0f32..70.0), n * (n - 1) / 2);
        (heights, clearances).prop_map(move |(heights, clearances)| {
            let nodes = heights.iter().enumerate().map(|(i, &z)| Point::new(i as f32, -z, z)).collect();
            let pairs = (0..n as u16).flat_map(|a| (a + 1..n as u16).map(move |b| (a, b)));
            let edges = pairs.zip(clearances);
            let edges = edges.filter_map(|((a, b), c)| c.map(|clearance_m| Edge { a, b, clearance_m }));
            (nodes, edges.collect())
        })
    })
}

proptest! {
    #[test]
    fn a_roadmap_reads_back_as_written((nodes, edges) in graphs()) {
        let bytes = encode(&header(1, 1), &nodes, &edges);
        let view = RoadmapView::parse(&bytes).unwrap();
        prop_assert_eq!(*view.header(), header(1, 1));
        prop_assert_eq!(view.node_count(), nodes.len());
        prop_assert_eq!(view.half_edge_count(), 2 * edges.len());
        prop_assert_eq!(view.byte_len(), bytes.len());
        for (i, node) in nodes.iter().enumerate() {
            prop_assert_eq!(view.node(i as u16), *node);
        }
        for edge in &edges {
            for (a, b) in [(edge.a, edge.b), (edge.b, edge.a)] {
                let stored = view.edge_between(a, b).unwrap().clearance_m;
                let expected = edge.clearance_m.min(10.0);
                prop_assert!(stored <= expected && expected - stored < 0.00101, "{} {}", stored, expected);
            }
        }
    }
}
