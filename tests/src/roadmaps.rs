//! Forged roadmap files with a right CRC and wrong contents: each must be refused, or every search
//! on it must be right and end within its bound.
//!
//! One body ([`Forger::forge`]) serves the fuzzer ([`attack_with_bytes`]) and the test. What a
//! search must find is computed by Dijkstra 1959 in f64. A search may read each half-edge once.

use std::cell::Cell;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::Vec as Few;
use planner_core::Point;
use planner_core::flight::{Flight, Path, Task};
use planner_core::geo::frames::Geodetic;
use planner_core::roadmap::prm::squared_length;
use planner_core::roadmap::search::{
    SearchError, SearchWorkspace, astar, cost_matrix, dijkstra_all, path_lengths_to,
};
use planner_core::roadmap::{
    Edge, HEADER_LEN, HalfEdge, LANDMARK_COUNT, RoadmapError, RoadmapHeader, RoadmapView,
    encoded_len, write_with_landmarks,
};
use planner_core::schedule::sipp::{self, RouteQuery, SippWorkspace};
use planner_core::schedule::{DEFAULT_MAX_SEGMENT_M, ScheduleConfig};

use crate::hostile::{Entropy, FuzzBytes};
use crate::meeting::dice::Dice;

/// Most nodes of a file: 300, with some room.
const MAX_NODES: usize = 512;
const HEADER: RoadmapHeader = RoadmapHeader {
    origin: Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 },
    edge_min_m: 0.5,
    edge_max_m: 8.0,
    tested_clearance_m: 0.25,
    max_clearance_m: 10.0,
    start_count: 2,
    goal_count: 2,
};
const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.7,
    cruise_mps: 2.0,
    vertical_mps: 1.0,
};
/// Required clearance of a wide vehicle, for which some edges are too narrow, metres.
const WIDE_CLEARANCE_M: f32 = 1.5;
/// Bytes of a word, of a node, and of a node's distances to the landmarks.
const WORD_BYTES: usize = 4;
const NODE_BYTES: usize = 12;
const LANDMARK_ROW_BYTES: usize = WORD_BYTES * LANDMARK_COUNT;

/// Forges files from one random roadmap, one after the other.
pub struct Forger {
    /// The file that is changed.
    original: Vec<u8>,
    search: Box<SearchWorkspace<MAX_NODES>>,
    sipp: Box<SippWorkspace<MAX_NODES, 8>>,
}

/// Forges one file as a fuzzer's bytes choose.
///
/// # Panics
/// The file is accepted, and a search on it is wrong.
pub fn attack_with_bytes(data: &[u8]) {
    let mut bytes = FuzzBytes(data);
    let seed = bytes.bits() % 256;
    let _ = Forger::new(&mut Dice::new(seed)).forge(&mut bytes);
}

impl Forger {
    /// A forger of a random roadmap.
    ///
    /// # Panics
    /// A search on the unchanged roadmap is wrong.
    pub fn new(dice: &mut Dice) -> Self {
        let mut search = Box::new(SearchWorkspace::new());
        let original = random_roadmap(dice, &mut search);
        let mut forger = Self { original, search, sipp: Box::new(SippWorkspace::new()) };
        forger.check_if_accepted(&forger.original.clone(), dice).expect("nothing is changed yet");
        forger
    }

    /// Changes some words of the roadmap's file, corrects its CRC, and runs every search on it if
    /// it is accepted.
    ///
    /// # Errors
    /// Why the file is refused.
    ///
    /// # Panics
    /// The file is accepted, and a search on it is wrong.
    pub fn forge(&mut self, entropy: &mut impl Entropy) -> Result<(), RoadmapError> {
        let mut bytes = self.original.clone();
        if entropy.bits().is_multiple_of(8) {
            lengthen_landmark_distances(&mut bytes);
        } else {
            mutate(entropy, &mut bytes);
        }
        let end = bytes.len() - WORD_BYTES;
        let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&bytes[..end]);
        bytes[end..].copy_from_slice(&crc.to_le_bytes());
        self.check_if_accepted(&bytes, entropy)
    }

    fn check_if_accepted(
        &mut self,
        bytes: &[u8],
        entropy: &mut impl Entropy,
    ) -> Result<(), RoadmapError> {
        let view = RoadmapView::parse(bytes)?;
        assert_readable(&view);
        if view.node_count() == 0 {
            return Ok(());
        }
        if view.has_landmarks() {
            assert_landmarks_right(&view, bytes);
        }
        for required_m in [0.0, WIDE_CLEARANCE_M] {
            let mut node = || (entropy.bits() % view.node_count() as u64) as u16;
            let (from, to) = ([node(), node()], [node(), node()]);
            assert_searches_right(&view, from, to, required_m, &mut self.search);
        }
        self.assert_routes_right(&view);
        Ok(())
    }

    /// Without other flights, the route that safe-interval search finds must be the shortest path.
    fn assert_routes_right(&mut self, view: &RoadmapView<'_>) {
        let (starts, goals) = (view.header().start_count, view.header().goal_count);
        if starts == 0 || goals == 0 {
            return;
        }
        let route = RouteQuery {
            cfg: &SCHEDULE,
            from: 0,
            to: starts,
            not_before_s: 0.0,
            parked: &[],
            handover_s: 0.0,
        };
        let way = shortest_lengths_from(view, route.from, 0.0)[usize::from(route.to)];
        let mut flight = Flight::<MAX_NODES> {
            vehicle_id: 1,
            task: Task::Goto(0),
            path: Path::new(),
            climb_m: 1.5,
            descent_m: 1.5,
            depart_s: 0.0,
            max_segment_m: DEFAULT_MAX_SEGMENT_M,
        };
        let asked = Cell::new(0);
        let any = |_: u16, _: &HalfEdge| {
            asked.set(asked.get() + 1);
            true
        };
        let found = sipp::find_route(view, &route, any, [].iter(), &mut self.sipp, &mut flight);
        assert!(asked.get() <= view.half_edge_count(), "{} half-edges asked about", asked.get());
        match found {
            Ok(()) => assert_near(f64::from(flight.path.length_m()), way),
            Err(error) => assert!(way.is_infinite(), "{error:?} {way}"),
        }
    }
}

/// Asserts that the length `found` equals the expected length `way` up to rounding, metres.
#[track_caller]
fn assert_near(found: f64, way: f64) {
    assert!(found == way || (found - way).abs() <= 1e-5 * (1.0 + way), "{found} in place of {way}");
}

/// A file of random nodes, of which near ones are joined at random: some may be unreachable.
fn random_roadmap(dice: &mut Dice, search: &mut SearchWorkspace<MAX_NODES>) -> Vec<u8> {
    let count = 20 + dice.below(281);
    let side_m = 4.0 * (count as f32).cbrt() * dice.real(0.5, 1.5);
    let corner = Point::new(side_m, side_m, side_m);
    let nodes: Vec<Point> = (0..count).map(|_| dice.point(Point::zeros(), corner)).collect();
    let range = HEADER.edge_min_m * HEADER.edge_min_m..=HEADER.edge_max_m * HEADER.edge_max_m;
    let mut edges = Vec::new();
    for (a, b) in (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b))) {
        if range.contains(&squared_length(nodes[a].into(), nodes[b].into())) && dice.chance(0.5) {
            edges.push(Edge { a: a as u16, b: b as u16, clearance_m: dice.real(0.25, 3.25) });
        }
    }
    // Half of the files are of version 1 of the format, without heights.
    let heights_m: Vec<f32> =
        if dice.chance(0.5) { nodes.iter().map(|node| node.z).collect() } else { Vec::new() };
    let columns = LANDMARK_COUNT + usize::from(!heights_m.is_empty());
    let mut out = vec![0; encoded_len(nodes.len(), edges.len(), columns).expect("it is small")];
    let written = write_with_landmarks(&HEADER, &nodes, &edges, &heights_m, search, &mut out);
    assert_eq!(written, Ok(out.len()));
    out
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + WORD_BYTES].try_into().expect("four bytes"))
}

/// Bytes of header, nodes, offsets, half-edges, distances to the landmarks and heights, as the
/// file's header states them.
fn section_bytes(bytes: &[u8]) -> [usize; 6] {
    let (nodes, half_edges) = (u32_at(bytes, 60) as usize, u32_at(bytes, 64) as usize);
    let heights = if bytes[8] == 2 { nodes * WORD_BYTES } else { 0 };
    [
        HEADER_LEN,
        nodes * NODE_BYTES,
        (nodes + 1) * WORD_BYTES,
        half_edges * WORD_BYTES,
        nodes * LANDMARK_ROW_BYTES,
        heights,
    ]
}

/// Changes one to three words of a file: of the header, a node, an offset, a half-edge, a distance
/// to a landmark; or all distances to a landmark by a constant, which the differences between
/// neighbours do not show.
fn mutate(entropy: &mut impl Entropy, bytes: &mut [u8]) {
    let sizes = section_bytes(bytes);
    for _ in 0..1 + entropy.bits() % 3 {
        let (choice, value) = (entropy.bits(), entropy.bits());
        // Four of nine changes go to the distances to the landmarks, which no other part of the
        // file implies.
        let part = [0, 1, 2, 3, 4, 4, 4, 4, 5][(choice % 9) as usize];
        let begin: usize = sizes[..part].iter().sum();
        // In a file without heights the last part is empty: a change of it hits the CRC, which is
        // corrected afterwards.
        let at = begin + (choice >> 32) as usize % (sizes[part] / WORD_BYTES).max(1) * WORD_BYTES;
        let (old, share) = (u32_at(bytes, at), (value >> 40) as f32 / (1 << 24) as f32);
        let new = match (choice >> 8) % 8 {
            0 => old ^ 1 << (value % 32),
            1 => value as u32,
            2 => (f32::from_bits(old) * (0.5 + share)).to_bits(),
            3 => (f32::from_bits(old) + 4.0 * share - 2.0).to_bits(),
            4 => old.wrapping_add((value % 3) as u32).wrapping_sub(1),
            5 => [f32::NAN, f32::INFINITY, -0.0, 0.0, 1e30, -1.0, 16_384.0, 65_536.0]
                [(value % 8) as usize]
                .to_bits(),
            6 => u32_at(
                bytes,
                HEADER_LEN
                    + value as usize % ((bytes.len() - HEADER_LEN) / WORD_BYTES) * WORD_BYTES,
            ),
            _ => {
                let landmarks = sizes[..4].iter().sum::<usize>();
                let column = bytes[landmarks..landmarks + sizes[4]].as_chunks_mut::<WORD_BYTES>().0;
                for way in column.iter_mut().skip((value % 2) as usize).step_by(LANDMARK_COUNT) {
                    *way = (f32::from_le_bytes(*way) + 60_000.0 * share).to_le_bytes();
                }
                continue;
            }
        };
        bytes[at..at + WORD_BYTES].copy_from_slice(&new.to_le_bytes());
    }
}

/// Replaces the shortest distances to the landmarks by lengths along paths of fewest edges: each is
/// a sum of edges, and many are right.
fn lengthen_landmark_distances(bytes: &mut [u8]) {
    let view = RoadmapView::parse(bytes).expect("nothing is changed yet");
    let mut ways = vec![[0.0_f32; LANDMARK_COUNT]; view.node_count()];
    let mut landmark = 0;
    for column in 0..LANDMARK_COUNT {
        let (mut seen, mut open) = (vec![false; ways.len()], VecDeque::from([landmark]));
        seen[usize::from(landmark)] = true;
        while let Some(node) = open.pop_front() {
            for edge in view.half_edges(node) {
                let target = usize::from(edge.target);
                if !std::mem::replace(&mut seen[target], true) {
                    ways[target][column] =
                        ways[usize::from(node)][column] + view.distance_m(node, edge.target);
                    open.push_back(edge.target);
                }
            }
        }
        let farther =
            |best: u16, node: u16| ways[usize::from(node)][0] > ways[usize::from(best)][0];
        landmark = (0..ways.len() as u16)
            .fold(0, |best, node| if farther(best, node) { node } else { best });
    }
    let sizes = section_bytes(bytes);
    let begin: usize = sizes[..4].iter().sum();
    let column = &mut bytes[begin..begin + sizes[4]];
    for (stored, way) in
        column.as_chunks_mut::<WORD_BYTES>().0.iter_mut().zip(ways.iter().flatten())
    {
        *stored = way.to_le_bytes();
    }
}

/// Asserts that every node and half-edge of an accepted file can be read and is sound.
fn assert_readable(view: &RoadmapView<'_>) {
    for node in 0..view.node_count() as u16 {
        let at = view.node(node);
        assert!(at.iter().all(|c| c.is_finite()));
        assert!(view.ground_z_m(node).is_none_or(|ground_m| ground_m <= at.z));
        assert!(
            view.ground_z_range_near(&at)
                .is_none_or(|(low_m, high_m)| low_m <= high_m && high_m <= at.z)
        );
        for edge in view.half_edges(node) {
            assert!(view.distance_m(node, edge.target) > 0.0);
            let back = view.edge_between(edge.target, node).expect("each edge has its opposite");
            assert_eq!(back.clearance_m, edge.clearance_m);
        }
    }
}

/// Lengths of the shortest paths from a node over edges with a clearance, in f64 (Dijkstra 1959).
fn shortest_lengths_from(view: &RoadmapView<'_>, from: u16, required_m: f32) -> Vec<f64> {
    let mut ways = vec![f64::INFINITY; view.node_count()];
    ways[usize::from(from)] = 0.0;
    // `f64` is not `Ord`; non-negative floats order like their bits.
    let mut open = BinaryHeap::from([(Reverse(0_u64), from)]);
    while let Some((Reverse(bits), node)) = open.pop() {
        let here = f64::from_bits(bits);
        if here > ways[usize::from(node)] {
            continue;
        }
        for edge in view.half_edges(node).filter(|edge| view.has_clearance(edge, required_m)) {
            let way = here + (view.node(edge.target) - view.node(node)).cast::<f64>().norm();
            if way < ways[usize::from(edge.target)] {
                ways[usize::from(edge.target)] = way;
                open.push((Reverse(way.to_bits()), edge.target));
            }
        }
    }
    ways
}

/// Asserts that the distances to the landmarks (node 0, and the node farthest from it) are as
/// stored in the file; 0 for unreachable nodes.
fn assert_landmarks_right(view: &RoadmapView<'_>, bytes: &[u8]) {
    let begin: usize = section_bytes(bytes)[..4].iter().sum();
    let stored = |node: usize, landmark: usize| {
        f32::from_bits(u32_at(bytes, begin + node * LANDMARK_ROW_BYTES + landmark * WORD_BYTES))
    };
    let farthest = (0..view.node_count())
        .fold(0, |best, node| if stored(node, 0) > stored(best, 0) { node } else { best });
    for (landmark, from) in [0, farthest as u16].into_iter().enumerate() {
        for (node, way) in shortest_lengths_from(view, from, 0.0).into_iter().enumerate() {
            assert_near(f64::from(stored(node, landmark)), if way.is_finite() { way } else { 0.0 });
        }
    }
}

/// Asserts that every kind of search between four nodes finds the shortest paths, and reads each
/// half-edge at most once.
fn assert_searches_right(
    view: &RoadmapView<'_>,
    from: [u16; 2],
    to: [u16; 2],
    required_m: f32,
    ws: &mut SearchWorkspace<MAX_NODES>,
) {
    let asked = Cell::new(0);
    let passable = |_: u16, edge: &HalfEdge| {
        asked.set(asked.get() + 1);
        view.has_clearance(edge, required_m)
    };
    let bounded = |searches: usize| {
        assert!(
            asked.get() <= searches * view.half_edge_count(),
            "{} half-edges asked about",
            asked.get()
        );
        asked.set(0);
    };
    let ways = from.map(|node| shortest_lengths_from(view, node, required_m));
    let way = |i: usize, node: u16| ways[i][usize::from(node)];

    let mut path = Few::<u16, MAX_NODES>::new();
    match astar(view, from[0], to[0], passable, ws, &mut path) {
        Ok(length_m) => {
            assert_near(f64::from(length_m), way(0, to[0]));
            assert_eq!((path.first(), path.last()), (Some(&from[0]), Some(&to[0])));
            let legs = path.windows(2).map(|leg| {
                let edge = view.edge_between(leg[0], leg[1]).expect("a path joins nodes by edges");
                assert!(view.has_clearance(&edge, required_m), "{edge:?}");
                f64::from(view.distance_m(leg[0], leg[1]))
            });
            assert_near(legs.sum(), way(0, to[0]));
        }
        error => {
            assert!(error == Err(SearchError::NoPath) && way(0, to[0]).is_infinite(), "{error:?}");
        }
    }
    bounded(1);

    let mut row = [0.0; 2];
    path_lengths_to(view, from[0], &to, passable, ws, &mut row).expect("the nodes exist");
    bounded(1);
    let mut matrix = [0.0; 4];
    cost_matrix(view, &from, &to, passable, ws, &mut matrix).expect("the nodes exist");
    bounded(2);
    for (j, &node) in to.iter().enumerate() {
        assert_near(f64::from(row[j]), way(0, node));
        (0..2).for_each(|i| assert_near(f64::from(matrix[2 * i + j]), way(i, node)));
    }

    dijkstra_all(view, from[1], passable, ws).expect("the node exists");
    bounded(1);
    (0..view.node_count() as u16)
        .for_each(|node| assert_near(f64::from(ws.distance_m(node)), way(1, node)));
}
