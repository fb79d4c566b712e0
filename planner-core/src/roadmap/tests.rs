extern crate std;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::format::{HEIGHT_LEN, LANDMARK_DISTANCES_LEN, WORD_LEN};
use super::*;
use crate::Point;
use crate::file::{CRC32, FileError};
use crate::geo::frames::Geodetic;
use crate::roadmap::search::SearchWorkspace;

pub(crate) fn header(starts: u16, goals: u16) -> RoadmapHeader {
    RoadmapHeader {
        origin: Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 },
        edge_min_m: 0.5,
        edge_max_m: 80.0,
        tested_clearance_m: 0.25,
        max_clearance_m: 10.0,
        start_count: starts,
        goal_count: goals,
    }
}

pub(crate) fn encode(header: &RoadmapHeader, nodes: &[Point], edges: &[Edge]) -> Vec<u8> {
    let mut out = vec![0xa5; encoded_len(nodes.len(), edges.len(), 0).unwrap()];
    assert_eq!(write(header, nodes, edges, &mut out), Ok(out.len()));
    out
}

pub(crate) fn encode_with_landmarks(
    header: &RoadmapHeader,
    nodes: &[Point],
    edges: &[Edge],
) -> Vec<u8> {
    let mut out = vec![0xa5; encoded_len(nodes.len(), edges.len(), LANDMARK_COUNT).unwrap()];
    let mut ws = SearchWorkspace::<32>::new();
    assert_eq!(write_with_landmarks(header, nodes, edges, &[], &mut ws, &mut out), Ok(out.len()));
    out
}

/// A roadmap of distinct points with any edges among them.
fn graphs() -> impl Strategy<Value = (Vec<Point>, Vec<Edge>)> {
    (2usize..24).prop_flat_map(|n| {
        let heights = proptest::collection::vec(-20.0f32..20.0, n);
        let clearances =
            proptest::collection::vec(proptest::option::of(0.25f32..70.0), n * (n - 1) / 2);
        (heights, clearances).prop_map(move |(heights, clearances)| {
            let nodes =
                heights.iter().enumerate().map(|(i, &z)| Point::new(i as f32, -z, z)).collect();
            let pairs = (0..n as u16).flat_map(|a| (a + 1..n as u16).map(move |b| (a, b)));
            let edges = pairs.zip(clearances);
            let edges =
                edges.filter_map(|((a, b), c)| c.map(|clearance_m| Edge { a, b, clearance_m }));
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
                prop_assert!(
                    stored <= expected && expected - stored < 0.00101,
                    "{} {}",
                    stored,
                    expected
                );
            }
        }
    }
}

fn small() -> (Vec<Point>, Vec<Edge>) {
    let nodes =
        vec![Point::new(0.0, 0.0, 1.0), Point::new(3.0, 4.0, 1.0), Point::new(-1.0, 0.0, 2.0)];
    (nodes, vec![Edge { a: 0, b: 1, clearance_m: 0.7 }, Edge { a: 2, b: 0, clearance_m: 0.25 }])
}

/// Bytes of a file with its CRC corrected, so that only the other checks can find the fault.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 4;
    let crc = CRC32.checksum(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&crc);
    bytes
}

/// Whatever was accepted can be read everywhere.
fn read_all(view: &RoadmapView<'_>) {
    for node in 0..view.node_count() as u16 {
        assert!(view.node(node).iter().all(|c| c.is_finite()));
        for edge in view.half_edges(node) {
            assert!(view.distance_m(node, edge.target) > 0.0);
            assert_eq!(view.edge_between(edge.target, node).unwrap().clearance_m, edge.clearance_m);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn a_changed_byte_or_a_cut_is_refused((nodes, edges) in graphs(), flip in 1u8..) {
        let bytes = encode(&header(1, 1), &nodes, &edges);
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= flip;
            prop_assert!(RoadmapView::parse(&changed).is_err(), "byte {at}");
            prop_assert!(RoadmapView::parse(&bytes[..at]).is_err(), "cut at {at}");
            if let Ok(view) = RoadmapView::parse(&sealed(changed)) {
                read_all(&view);
            }
        }
    }

    #[test]
    fn any_bytes_are_refused_or_sound(
        tail in proptest::collection::vec(any::<u8>(), 0..200),
        nodes in 0u32..9,
    ) {
        let (some_nodes, some_edges) = small();
        let mut bytes = encode(&header(1, 1), &some_nodes, &some_edges)[..HEADER_LEN].to_vec();
        bytes.extend(tail);
        let total = bytes.len() as u32;
        bytes[12..16].copy_from_slice(&total.to_le_bytes());
        bytes[60..64].copy_from_slice(&nodes.to_le_bytes());
        let half_edges = total.saturating_sub(HEADER_LEN as u32 + 16 * nodes + 8) / 4;
        bytes[64..68].copy_from_slice(&half_edges.to_le_bytes());
        if let Ok(view) = RoadmapView::parse(&sealed(bytes)) {
            read_all(&view);
        }
    }
}

#[test]
fn the_bytes_are_where_the_readme_says() {
    let (nodes, edges) = small();
    let bytes = encode(&header(1, 1), &nodes, &edges);
    assert_eq!(&bytes[..8], b"FLKROAD\n");
    assert_eq!(bytes[8..16], [1, 0, 72, 0, 144, 0, 0, 0]);
    assert_eq!(bytes[16..24], 40.3327f64.to_le_bytes());
    assert_eq!(bytes[40..44], 0.5f32.to_le_bytes());
    assert_eq!(bytes[52..72], [0, 0, 0x20, 0x41, 1, 0, 1, 0, 3, 0, 0, 0, 4, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bytes[84..88], 3.0f32.to_le_bytes());
    assert_eq!(bytes[108..124], [0, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0]);
    // 0.7 in f32 lies below seven tenths, so 699 mm.
    assert_eq!(bytes[124..140], [1, 0, 0xbb, 2, 2, 0, 250, 0, 0, 0, 0xbb, 2, 0, 0, 250, 0]);
    // The CRC-32 that zlib gives for these 140 bytes.
    assert_eq!(bytes[140..], 0xe734_f881u32.to_le_bytes());
}

#[test]
fn a_vehicle_passes_where_it_fits() {
    let (nodes, edges) = small();
    let bytes = encode(&header(1, 1), &nodes, &edges);
    let view = RoadmapView::parse(&bytes).unwrap();
    let (wide, narrow) = (view.edge_between(0, 1).unwrap(), view.edge_between(0, 2).unwrap());
    assert!(
        view.has_clearance(&wide, 0.698)
            && !view.has_clearance(&wide, 0.699)
            && !view.has_clearance(&wide, f32::NAN)
    );
    // Tested at 0.25 m, so clear at 0.25 m whatever the stored figure.
    assert!(view.has_clearance(&narrow, 0.25) && !view.has_clearance(&narrow, 0.251));
    assert_eq!(view.edge_between(1, 2), None);
    assert_eq!(view.edge_between(7, 0), None);
    assert_eq!(view.half_edges(7).len(), 0);
}

#[test]
fn what_follows_the_roadmap_in_its_slot_is_ignored() {
    let (nodes, edges) = small();
    let mut bytes = encode(&header(1, 1), &nodes, &edges);
    bytes.resize(1000, 0xff);
    assert_eq!(RoadmapView::parse(&bytes).unwrap().byte_len(), 144);
}

#[test]
fn the_default_board_fits_its_slot() {
    // A slot of 384 kB begins with three words of 32 bytes.
    assert!(encoded_len(4096, 65536 / 2, LANDMARK_COUNT + 1).unwrap() <= 384 * 1024 - 96);
}

#[test]
fn bad_input_is_refused_by_name() {
    fn refuse(change: impl Fn(&mut RoadmapHeader, &mut [Point], &mut Vec<Edge>)) -> RoadmapError {
        let (mut header, (mut nodes, mut edges)) = (header(1, 1), small());
        change(&mut header, &mut nodes, &mut edges);
        write(&header, &nodes, &edges, &mut [0; 1000]).unwrap_err()
    }
    assert_eq!(refuse(|_, nodes, _| nodes[1].y = f32::NAN), RoadmapError::Node(1));
    assert_eq!(refuse(|_, nodes, _| nodes[2].x = 1.1e6), RoadmapError::Node(2));
    assert_eq!(refuse(|_, nodes, _| nodes[2] = nodes[0]), RoadmapError::ZeroLength(2));
    assert_eq!(refuse(|_, _, edges| edges[1].b = 3), RoadmapError::EdgeNode(1));
    assert_eq!(refuse(|_, _, edges| edges[1].b = 2), RoadmapError::SelfLoop(1));
    assert_eq!(
        refuse(|_, _, edges| edges[0].clearance_m = f32::NAN),
        RoadmapError::InvalidClearance(0)
    );
    assert_eq!(
        refuse(|_, _, edges| edges[0].clearance_m = -0.1),
        RoadmapError::InvalidClearance(0)
    );
    assert_eq!(refuse(|_, _, edges| edges[1].clearance_m = 0.248), RoadmapError::EdgeClearance(2));
    assert_eq!(refuse(|_, nodes, _| nodes[1] *= 16.0), RoadmapError::EdgeLength(0));
    assert_eq!(refuse(|header, _, _| header.edge_min_m = 2.0), RoadmapError::EdgeLength(2));
    assert_eq!(
        refuse(|header, _, _| header.edge_max_m = 101.0),
        FileError::Header("edge_max_m").into()
    );
    assert_eq!(
        refuse(|_, _, edges| edges.push(Edge { a: 1, b: 0, clearance_m: 0.7 })),
        RoadmapError::Duplicate(0, 1)
    );
    assert_eq!(refuse(|header, _, _| header.goal_count = 3), FileError::Header("terminals").into());
    assert_eq!(
        refuse(|header, _, _| header.origin.lat_deg = f64::NAN),
        FileError::Header("origin").into()
    );
    assert_eq!(
        refuse(|header, _, _| header.edge_max_m = 0.4),
        FileError::Header("edge_max_m").into()
    );
    let (nodes, edges) = small();
    let full = write(&header(1, 1), &nodes, &edges, &mut [0; 143]);
    assert_eq!(full, Err(RoadmapError::RoadmapFull { needed: 144 }));
    let many = vec![Point::zeros(); MAX_NODES + 1];
    assert_eq!(write(&header(0, 0), &many, &[], &mut [0; 1000]), Err(RoadmapError::TooManyNodes));
}

#[test]
fn the_order_of_edges_does_not_change_the_bytes() {
    let (nodes, edges) = small();
    let turned: Vec<_> = edges.iter().rev().map(|e| Edge { a: e.b, b: e.a, ..*e }).collect();
    assert_eq!(encode(&header(1, 1), &nodes, &edges), encode(&header(1, 1), &nodes, &turned));
}

#[test]
fn ways_to_landmarks_are_written_and_checked() {
    let (nodes, edges) = small();
    let mut out = encode_with_landmarks(&header(1, 1), &nodes, &edges);
    let view = RoadmapView::parse(&out).unwrap();
    assert!(view.has_landmarks());
    assert_eq!(view.byte_len(), out.len());
    // The landmarks are node 0, and node 1, five metres away; from node 1, node 2 is reached
    // through node 0.
    let aside = 2.0f32.sqrt();
    for (node, ways) in [(0, [0.0, 5.0]), (1, [5.0, 0.0]), (2, [aside, 5.0 + aside])] {
        assert_eq!(view.landmark_distances_m(node), ways, "node {node}");
    }
    for few in 0..2 {
        let bytes = encode_with_landmarks(&header(0, 0), &nodes[..few], &[]);
        assert!(RoadmapView::parse(&bytes).is_ok_and(|view| view.node_count() == few));
    }
    let first = out.len() - 4 - 3 * LANDMARK_DISTANCES_LEN;
    for wrong in [f32::NAN, f32::INFINITY, -1.0, 5.01, 1e30] {
        let mut changed = out.clone();
        changed[first..first + 4].copy_from_slice(&wrong.to_le_bytes());
        let refused = RoadmapView::parse(&sealed(changed)).map(|_| ());
        assert!(matches!(refused, Err(RoadmapError::Landmark(_))), "{wrong}: {refused:?}");
    }
    let small = write_with_landmarks(
        &header(1, 1),
        &nodes,
        &edges,
        &[],
        &mut SearchWorkspace::<2>::new(),
        &mut out,
    );
    assert_eq!(small, Err(RoadmapError::WorkspaceTooSmall));
}

fn with_heights(heights_m: &[f32]) -> Result<Vec<u8>, RoadmapError> {
    let (nodes, edges) = small();
    let mut out = vec![0xa5; encoded_len(nodes.len(), edges.len(), LANDMARK_COUNT + 1).unwrap()];
    let mut ws = SearchWorkspace::<32>::new();
    let len = write_with_landmarks(&header(1, 1), &nodes, &edges, heights_m, &mut ws, &mut out)?;
    out.truncate(len);
    Ok(out)
}

#[test]
fn heights_over_ground_are_written_and_checked() {
    let bytes = with_heights(&[1.0, 0.25, f32::INFINITY]).unwrap();
    assert_eq!(bytes[8], 2);
    let view = RoadmapView::parse(&bytes).unwrap();
    assert_eq!((view.byte_len(), view.has_landmarks()), (bytes.len(), true));
    let grounds = [0, 1, 2, 3, u16::MAX].map(|node| view.ground_z_m(node));
    assert_eq!(grounds, [Some(0.0), Some(0.75), None, None, None]);
    for wrong in [f32::NAN, f32::NEG_INFINITY, -1.0, -1e-9, 65_537.0] {
        assert_eq!(with_heights(&[1.0, wrong, 1.0]), Err(RoadmapError::Height(1)));
        let mut changed = bytes.clone();
        let at = bytes.len() - WORD_LEN - 2 * HEIGHT_LEN;
        changed[at..at + 4].copy_from_slice(&wrong.to_le_bytes());
        assert_eq!(RoadmapView::parse(&sealed(changed)).map(|_| ()), Err(RoadmapError::Height(1)));
    }
    assert_eq!(with_heights(&[1.0; 2]), Err(RoadmapError::Height(2)));
    assert_eq!(with_heights(&[1.0; 4]), Err(RoadmapError::Height(3)));
    // A file of version 1 has no ground heights.
    let old = with_heights(&[]).unwrap();
    let view = RoadmapView::parse(&old).unwrap();
    assert_eq!(
        (old[8], view.ground_z_m(0), view.ground_z_range_near(&Point::zeros())),
        (1, None, None)
    );
}

#[test]
fn the_ground_of_a_place_is_that_of_nodes_on_its_storey() {
    // Two storeys, the upper floor at 4 m; nodes 0 and 1 above it, node 2 below, node 3 on the
    // upper one but far away.
    let places = [(0.0, 5.0, 1.0), (2.0, 6.0, 1.5), (1.0, 3.0, 3.0), (9.0, 5.0, 3.0)];
    let nodes: Vec<Point> = places.iter().map(|&(x, z, _)| Point::new(x, 0.0, z)).collect();
    let heights: Vec<f32> = places.iter().map(|&(.., height_m)| height_m).collect();
    let mut out = vec![0; encoded_len(4, 0, LANDMARK_COUNT + 1).unwrap()];
    let mut ws = SearchWorkspace::<4>::new();
    write_with_landmarks(&header(0, 0), &nodes, &[], &heights, &mut ws, &mut out).unwrap();
    let view = RoadmapView::parse(&out).unwrap();
    let around = |x: f32, z: f32| view.ground_z_range_near(&Point::new(x, 0.0, z));
    assert_eq!(
        around(1.0, 5.2),
        Some((4.0, 4.5)),
        "0.25 m of clearance: node 0 may be lower by 0.5 m"
    );
    assert_eq!(around(1.0, 5.6), Some((4.5, 4.5)));
    assert_eq!(around(1.0, 2.0), Some((0.0, 0.0)));
    assert_eq!(around(1.0, 3.6), None, "between the storeys");
    assert_eq!(around(9.0, 5.0), Some((2.0, 2.0)));
    assert_eq!(around(20.0, 5.0), None);
    assert_eq!(view.ground_z_range_near(&Point::new(f32::NAN, 0.0, 1.0)), None);
}
