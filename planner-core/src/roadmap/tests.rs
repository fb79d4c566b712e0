extern crate std;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::search::{SearchError, SearchWorkspace, astar};

pub(crate) fn header(starts: u16, goals: u16) -> RoadmapHeader {
    RoadmapHeader {
        origin: Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 },
        edge_min_m: 0.5,
        edge_max_m: 80.0,
        tested_clearance_m: 0.25,
        max_clearance_m: 10.0,
        starts,
        goals,
    }
}

pub(crate) fn encode(header: &RoadmapHeader, nodes: &[Point], edges: &[Edge]) -> Vec<u8> {
    let mut out = vec![0xa5; encoded_len(nodes.len(), edges.len(), 0).unwrap()];
    assert_eq!(write(header, nodes, edges, &mut out), Ok(out.len()));
    out
}

pub(crate) fn encode_with_landmarks(header: &RoadmapHeader, nodes: &[Point], edges: &[Edge]) -> Vec<u8> {
    let mut out = vec![0xa5; encoded_len(nodes.len(), edges.len(), LANDMARKS).unwrap()];
    let mut ws = SearchWorkspace::<32>::new();
    assert_eq!(write_with_landmarks(header, nodes, edges, &mut ws, &mut out), Ok(out.len()));
    out
}

/// A roadmap of distinct points with any edges among them.
fn graphs() -> impl Strategy<Value = (Vec<Point>, Vec<Edge>)> {
    (2usize..24).prop_flat_map(|n| {
        let heights = proptest::collection::vec(-20.0f32..20.0, n);
        let clearances = proptest::collection::vec(proptest::option::of(0.25f32..70.0), n * (n - 1) / 2);
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

fn small() -> (Vec<Point>, Vec<Edge>) {
    let nodes = vec![Point::new(0.0, 0.0, 1.0), Point::new(3.0, 4.0, 1.0), Point::new(-1.0, 0.0, 2.0)];
    (nodes, vec![Edge { a: 0, b: 1, clearance_m: 0.7 }, Edge { a: 2, b: 0, clearance_m: 0.25 }])
}

/// Bytes of a file with its CRC made good again: what only the other checks can catch.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 4;
    let crc = CRC.checksum(&bytes[..end]).to_le_bytes();
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
    fn any_bytes_are_refused_or_sound(tail in proptest::collection::vec(any::<u8>(), 0..200), nodes in 0u32..9) {
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
    assert!(view.clears(&wide, 0.698) && !view.clears(&wide, 0.699) && !view.clears(&wide, f32::NAN));
    // Tested at 0.25 m, so clear at 0.25 m whatever the stored figure.
    assert!(view.clears(&narrow, 0.25) && !view.clears(&narrow, 0.251));
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
    assert!(encoded_len(4096, 65536 / 2, LANDMARKS).unwrap() <= 384 * 1024);
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
    assert_eq!(refuse(|_, _, edges| edges[0].clearance_m = f32::NAN), RoadmapError::Clearance(0));
    assert_eq!(refuse(|_, _, edges| edges[0].clearance_m = -0.1), RoadmapError::Clearance(0));
    assert_eq!(refuse(|_, _, edges| edges[1].clearance_m = 0.248), RoadmapError::EdgeClearance(2));
    assert_eq!(refuse(|_, nodes, _| nodes[1] *= 16.0), RoadmapError::EdgeLength(0));
    assert_eq!(refuse(|header, _, _| header.edge_min_m = 2.0), RoadmapError::EdgeLength(2));
    assert_eq!(refuse(|header, _, _| header.edge_max_m = 101.0), RoadmapError::Header("edge_max_m"));
    assert_eq!(
        refuse(|_, _, edges| edges.push(Edge { a: 1, b: 0, clearance_m: 0.7 })),
        RoadmapError::Duplicate(0, 1)
    );
    assert_eq!(refuse(|header, _, _| header.goals = 3), RoadmapError::Header("terminals"));
    assert_eq!(refuse(|header, _, _| header.origin.lat_deg = f64::NAN), RoadmapError::Header("origin"));
    assert_eq!(refuse(|header, _, _| header.edge_max_m = 0.4), RoadmapError::Header("edge_max_m"));
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
    // Node 0, and node 1, five metres away; from there node 2 is reached through node 0.
    let aside = 2.0f32.sqrt();
    for (node, ways) in [(0, [0.0, 5.0]), (1, [5.0, 0.0]), (2, [aside, 5.0 + aside])] {
        assert_eq!(view.ways_to_landmarks_m(node), ways, "node {node}");
    }
    for few in 0..2 {
        let bytes = encode_with_landmarks(&header(0, 0), &nodes[..few], &[]);
        assert!(RoadmapView::parse(&bytes).is_ok_and(|view| view.node_count() == few));
    }
    let first = out.len() - 4 - 3 * LANDMARKS_LEN;
    for wrong in [f32::NAN, f32::INFINITY, -1.0, 5.01, 1e30] {
        let mut changed = out.clone();
        changed[first..first + 4].copy_from_slice(&wrong.to_le_bytes());
        let refused = RoadmapView::parse(&sealed(changed)).map(|_| ());
        assert!(matches!(refused, Err(RoadmapError::Landmark(_))), "{wrong}: {refused:?}");
    }
    let small =
        write_with_landmarks(&header(1, 1), &nodes, &edges, &mut SearchWorkspace::<2>::new(), &mut out);
    assert_eq!(small, Err(RoadmapError::WorkspaceTooSmall));
}

/// A roadmap of random nodes, joined where they are near: some of it may be apart from the rest.
fn random_roadmap(rng: &mut Pcg32) -> Vec<u8> {
    let header = RoadmapHeader { edge_max_m: 8.0, ..header(2, 2) };
    let count = 20 + rng.next_u32() % 281;
    let side_m = 4.0 * libm::cbrtf(count as f32) * (0.5 + uniform(rng));
    let mut place = || Point::new(uniform(rng) * side_m, uniform(rng) * side_m, uniform(rng) * side_m);
    let nodes: Vec<Point> = (0..count).map(|_| place()).collect();
    let mut edges = Vec::new();
    for (a, b) in (0..count as u16).flat_map(|a| (a + 1..count as u16).map(move |b| (a, b))) {
        if header.holds_length(&nodes[usize::from(a)], &nodes[usize::from(b)]) && uniform(rng) < 0.5 {
            edges.push(Edge { a, b, clearance_m: 0.25 + 3.0 * uniform(rng) });
        }
    }
    let mut out = vec![0; encoded_len(nodes.len(), edges.len(), LANDMARKS).unwrap()];
    let mut ws = std::boxed::Box::new(SearchWorkspace::<512>::new());
    assert_eq!(write_with_landmarks(&header, &nodes, &edges, &mut ws, &mut out), Ok(out.len()));
    out
}

fn uniform(rng: &mut Pcg32) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1 << 24) as f32
}

/// Changes one or a few values of a file: a header field, a node, an offset, a half-edge, a way to a landmark, a count.
fn mutate(rng: &mut Pcg32, bytes: &mut [u8]) {
    let at = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let (nodes, half_edges) = (at(bytes, 60), at(bytes, 64));
    let ends =
        [HEADER_LEN, nodes * NODE_LEN, (nodes + 1) * WORD_LEN, half_edges * WORD_LEN, nodes * LANDMARKS_LEN];
    for _ in 0..1 + rng.next_u32() % 3 {
        // Half of the changes go to the landmarks, which nothing else in the file explains.
        let part = (rng.next_u32() % 8).min(4) as usize;
        let words = (ends[part] / WORD_LEN).max(1) as u32;
        let word = ends[..part].iter().sum::<usize>() + (rng.next_u32() % words) as usize * WORD_LEN;
        let old = at(bytes, word) as u32;
        let new = match rng.next_u32() % 8 {
            0 => old ^ 1 << (rng.next_u32() % 32),
            1 => rng.next_u32(),
            2 => (f32::from_bits(old) * (0.5 + uniform(rng))).to_bits(),
            3 => (f32::from_bits(old) + 4.0 * uniform(rng) - 2.0).to_bits(),
            4 => old.wrapping_add(rng.next_u32() % 3).wrapping_sub(1),
            5 => [f32::NAN, f32::INFINITY, -0.0, 0.0, 1e30, -1.0, 16_384.0, 65_536.0]
                [(rng.next_u32() % 8) as usize]
                .to_bits(),
            6 => at(bytes, HEADER_LEN + WORD_LEN * (rng.next_u32() as usize % (bytes.len() / WORD_LEN - 19)))
                as u32,
            // The whole column by a constant, which differences between neighbours do not show.
            _ => {
                let column =
                    bytes.len() - WORD_LEN - nodes * LANDMARKS_LEN + WORD_LEN * (rng.next_u32() % 2) as usize;
                let shift = 60_000.0 * uniform(rng);
                for node in 0..nodes {
                    let place = column + node * LANDMARKS_LEN;
                    let way = f32::from_bits(at(bytes, place) as u32) + shift;
                    bytes[place..place + 4].copy_from_slice(&way.to_le_bytes());
                }
                continue;
            }
        };
        bytes[word..word + 4].copy_from_slice(&new.to_le_bytes());
    }
}

/// Puts the lengths along ways of fewest edges in place of the shortest: each is a sum of edges, and all but some right.
fn forge_ways(bytes: &mut [u8]) {
    let view = RoadmapView::parse(bytes).unwrap();
    let mut ways = vec![[0.0f32; LANDMARKS]; view.node_count()];
    let mut landmark = 0;
    for column in 0..LANDMARKS {
        let (mut seen, mut open) = (vec![false; ways.len()], std::collections::VecDeque::from([landmark]));
        seen[usize::from(landmark)] = true;
        while let Some(node) = open.pop_front() {
            for edge in
                view.half_edges(node).filter(|e| !std::mem::replace(&mut seen[usize::from(e.target)], true))
            {
                ways[usize::from(edge.target)][column] =
                    ways[usize::from(node)][column] + view.distance_m(node, edge.target);
                open.push_back(edge.target);
            }
        }
        let farther = |best: u16, node: u16| ways[usize::from(node)][0] > ways[usize::from(best)][0];
        landmark = (0..ways.len() as u16).fold(0, |best, node| if farther(best, node) { node } else { best });
    }
    let end = bytes.len() - WORD_LEN;
    let column = &mut bytes[end - ways.len() * LANDMARKS_LEN..end];
    for (stored, way) in column.as_chunks_mut::<4>().0.iter_mut().zip(ways.iter().flatten()) {
        *stored = way.to_le_bytes();
    }
}

/// Lengths of the shortest ways from a node over all edges, in f64, by relaxing until nothing changes.
fn lengths_from(view: &RoadmapView<'_>, from: u16) -> Vec<f64> {
    let mut ways = vec![f64::INFINITY; view.node_count()];
    ways[usize::from(from)] = 0.0;
    let mut open = vec![from];
    while let Some(node) = open.pop() {
        for edge in view.half_edges(node) {
            let d = (view.node(edge.target) - view.node(node)).cast::<f64>();
            let way = ways[usize::from(node)] + d.norm();
            if way < ways[usize::from(edge.target)] {
                ways[usize::from(edge.target)] = way;
                open.insert(0, edge.target);
            }
        }
    }
    ways
}

/// Every search that an accepted file allows is right, and none takes more than each node and half-edge once.
fn search_all(view: &RoadmapView<'_>, rng: &mut Pcg32, ws: &mut SearchWorkspace<512>) {
    if view.node_count() == 0 {
        return;
    }
    if view.has_landmarks() {
        let from_first = lengths_from(view, 0);
        for (node, way) in from_first.iter().enumerate() {
            let stored = f64::from(view.ways_to_landmarks_m(node as u16)[0]);
            let way = if way.is_finite() { *way } else { 0.0 };
            assert!((stored - way).abs() <= 1e-5 * (1.0 + way), "node {node}: {stored} {way}");
        }
    }
    let mut node = || (rng.next_u32() as usize % view.node_count()) as u16;
    for _ in 0..3 {
        let (from, to) = (node(), node());
        let ways = lengths_from(view, from);
        let asked = core::cell::Cell::new(0);
        let mut path = heapless::Vec::<u16, 512>::new();
        let any = |_, _: &HalfEdge| {
            asked.set(asked.get() + 1);
            true
        };
        let found = astar(view, from, to, any, ws, &mut path);
        assert!(asked.get() <= view.half_edge_count());
        let way = ways[usize::from(to)];
        match found {
            Ok(length) => {
                let along =
                    path.windows(2).map(|pair| f64::from(view.distance_m(pair[0], pair[1]))).sum::<f64>();
                let error = 1e-5 * (1.0 + way);
                assert!(
                    (along - way).abs() < error && (f64::from(length) - way).abs() < error,
                    "{length} {way}"
                );
                assert!(path.windows(2).all(|pair| view.edge_between(pair[0], pair[1]).is_some()));
            }
            error => assert!(error == Err(SearchError::NoPath) && way.is_infinite(), "{error:?} {way}"),
        }
    }
}

/// Files whose CRC is right and whose contents are not: refused, or every search is right. `FLOCKMATE_FILES` sets how many.
#[test]
fn mutated_files_are_refused_or_searched_right() {
    let files = std::env::var("FLOCKMATE_FILES").map_or(20_000, |count| count.parse().unwrap());
    let mut rng = Pcg32::seed_from_u64(1);
    let mut ws = std::boxed::Box::new(SearchWorkspace::<512>::new());
    let (mut original, mut accepted) = (Vec::new(), 0);
    for file in 0..files {
        if file % 50 == 0 {
            original = random_roadmap(&mut rng);
            search_all(&RoadmapView::parse(&original).unwrap(), &mut rng, &mut ws);
        }
        let mut bytes = original.clone();
        if rng.next_u32() % 8 == 0 {
            forge_ways(&mut bytes);
        } else {
            mutate(&mut rng, &mut bytes);
        }
        let bytes = sealed(bytes);
        if let Ok(view) = RoadmapView::parse(&bytes) {
            accepted += 1;
            read_all(&view);
            search_all(&view, &mut rng, &mut ws);
        }
    }
    std::println!("{accepted} of {files} mutated files are roadmaps");
    assert!(accepted > files / 100, "{accepted} of {files}");
}
