use super::*;
use proptest::prelude::*;

/// For each node, the lowest node that it reaches over edges wider than `required_m`.
fn reached(nodes: usize, edges: &[Edge], required_m: f32) -> Vec<u16> {
    let mut least: Vec<u16> = (0..nodes as u16).collect();
    for _ in 0..nodes {
        for edge in edges.iter().filter(|e| e.clearance_m > required_m) {
            let (a, b) = (usize::from(edge.a), usize::from(edge.b));
            let both = least[a].min(least[b]);
            (least[a], least[b]) = (both, both);
        }
    }
    least
}

proptest! {
    #[test]
    fn whoever_was_connected_stays_so_at_any_clearance(
        places in proptest::collection::vec(proptest::array::uniform3(0.0f32..9.0), 2..40),
        clearances in proptest::collection::vec(proptest::option::of(0.0f32..2.0), 780),
        room in 0usize..300,
    ) {
        let nodes: Vec<Point> = places.iter().map(|&p| Point::from(p)).collect();
        let pairs = (0..nodes.len() as u16).flat_map(|a| (0..a).map(move |b| (b, a)));
        let edges: Vec<Edge> = pairs
            .zip(clearances)
            .filter_map(|((a, b), c)| c.map(|clearance_m| Edge { a, b, clearance_m }))
            .collect();
        let parts: std::collections::BTreeSet<u16> =
            reached(nodes.len(), &edges, -1.0).into_iter().collect();
        let forest = nodes.len() - parts.len();
        let kept = limit_edges(&nodes, &edges, room);
        prop_assert_eq!(kept.is_some(), room >= forest.min(edges.len()));
        let Some(kept) = kept else { return Ok(()) };
        prop_assert_eq!(kept.len(), room.min(edges.len()));
        prop_assert!(kept.iter().all(|edge| edges.contains(edge)));
        for required_m in [-1.0, 0.1, 0.3, 0.55, 0.8, 1.2, 1.7] {
            prop_assert_eq!(
                reached(nodes.len(), &kept, required_m),
                reached(nodes.len(), &edges, required_m)
            );
        }
    }
}
