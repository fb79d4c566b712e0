//! Calls on roadmap files, searches and assignments with extreme and invalid arguments.

use heapless::Vec;
use planner_core::Point;
use planner_core::assignment::{self, AssignmentError, AssignmentWorkspace};
use planner_core::geo::frames::Geodetic;
use planner_core::roadmap::search::{self, RoadmapWithLengths, SearchError, SearchWorkspace};
use planner_core::roadmap::{self, Edge, HalfEdge, LANDMARK_COUNT, RoadmapHeader, RoadmapView};

use super::limits_results::{CallListener, EXTREME_NUMBERS, Results, extreme_points};

/// Most nodes of the search workspace in these calls.
pub(super) const MAX_NODES: usize = 8;

const HEADER: RoadmapHeader = RoadmapHeader {
    origin: Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 700.0 },
    edge_min_m: 0.5,
    edge_max_m: 9.0,
    tested_clearance_m: 0.0,
    max_clearance_m: 2.0,
    start_count: 2,
    goal_count: 2,
};

/// Positions of the roadmap's nodes, m (ENU): two starts, two goals opposite, two nodes between.
pub(super) const NODE_POSITIONS: [Point; 6] = [
    Point::new(0.0, 0.0, 2.0),
    Point::new(0.0, 6.0, 2.0),
    Point::new(12.0, 6.0, 2.0),
    Point::new(12.0, 0.0, 2.0),
    Point::new(6.0, 1.0, 2.0),
    Point::new(6.0, 5.0, 2.0),
];

/// Height of each node above the ground, metres; infinite: no ground is known below the last one.
const HEIGHTS_ABOVE_GROUND_M: [f32; 6] = [2.0, 2.0, 2.0, 2.0, 2.0, f32::INFINITY];

fn edges() -> Vec<Edge, 9> {
    let pairs = [(0, 4), (0, 5), (1, 4), (1, 5), (2, 4), (2, 5), (3, 4), (3, 5), (4, 5)];
    pairs.iter().map(|&(a, b)| Edge { a, b, clearance_m: 1.0 }).collect()
}

pub(super) fn any_edge_passable(_: u16, _: &HalfEdge) -> bool {
    true
}

/// Writes roadmap files from good and bad inputs. Leaves a good file in `file` and returns its
/// length.
pub(super) fn call_roadmap_files(
    to: &mut Results<'_, impl CallListener>,
    ws: &mut SearchWorkspace<MAX_NODES>,
    file: &mut [u8; 512],
) -> usize {
    let all = [0, 1, 7, u32::MAX as usize / 4, usize::MAX / 8, usize::MAX];
    for i in 0..all.len() * all.len() {
        let len = to.call("format::encoded_len", || {
            roadmap::encoded_len(all[i % 6], all[i / 6], all[(i * 7) % 6])
        });
        assert!(len.is_none_or(|len| len <= u32::MAX as usize));
    }
    let edges = edges();
    for hard in EXTREME_NUMBERS {
        for header in [
            RoadmapHeader { edge_min_m: hard, ..HEADER },
            RoadmapHeader { edge_max_m: hard, ..HEADER },
            RoadmapHeader { tested_clearance_m: hard, ..HEADER },
            RoadmapHeader { max_clearance_m: hard, ..HEADER },
            RoadmapHeader { start_count: hard as u16, goal_count: u16::MAX, ..HEADER },
            RoadmapHeader { origin: Geodetic { lat_deg: hard.into(), ..HEADER.origin }, ..HEADER },
        ] {
            let written =
                to.call("write::write", || roadmap::write(&header, &NODE_POSITIONS, &edges, file));
            // A file that `write` accepts must parse.
            let read =
                written.and_then(|len| RoadmapView::parse(&file[..len]).map(|view| view.crc()));
            assert_eq!(written.is_ok(), read.is_ok(), "{header:?}");
            to.add_count(usize::from(written.is_ok()));
        }
        let with = [Edge { clearance_m: hard, ..edges[0] }];
        to.add_count(usize::from(roadmap::write(&HEADER, &NODE_POSITIONS, &with, file).is_ok()));
    }
    for (a, b) in [(0, 0), (0, 6), (u16::MAX, 0)] {
        assert!(
            roadmap::write(&HEADER, &NODE_POSITIONS, &[Edge { a, b, clearance_m: 1.0 }], file)
                .is_err()
        );
    }
    for p in extreme_points() {
        let mut places = NODE_POSITIONS;
        places[5] = p;
        to.add_count(usize::from(roadmap::write(&HEADER, &places, &edges, file).is_ok()));
    }
    assert!(roadmap::write(&HEADER, &NODE_POSITIONS, &edges, &mut file[..100]).is_err());
    let mut small = SearchWorkspace::<2>::new();
    assert!(
        roadmap::write_with_landmarks(&HEADER, &NODE_POSITIONS, &edges, &[], &mut small, file)
            .is_err()
    );
    for hard in EXTREME_NUMBERS {
        let heights_m = [2.0, hard, 2.0, 2.0, 2.0, f32::INFINITY];
        let written =
            roadmap::write_with_landmarks(&HEADER, &NODE_POSITIONS, &edges, &heights_m, ws, file);
        let good =
            (0.0..=roadmap::MAX_LANDMARK_DISTANCE_M).contains(&hard) || hard == f32::INFINITY;
        assert_eq!(written.is_ok(), good, "{hard}");
    }
    assert!(
        roadmap::write_with_landmarks(&HEADER, &NODE_POSITIONS, &edges, &[1.0; 5], ws, file)
            .is_err()
    );
    let len = to
        .call("write::write_with_landmarks", || {
            roadmap::write_with_landmarks(
                &HEADER,
                &NODE_POSITIONS,
                &edges,
                &HEIGHTS_ABOVE_GROUND_M,
                ws,
                file,
            )
        })
        .expect("a good roadmap");
    let mut head = [0; roadmap::HEADER_LEN];
    head.copy_from_slice(&file[..roadmap::HEADER_LEN]);
    assert_eq!(to.call("format::declared_len", || roadmap::declared_len(&head)), Ok(len));
    for at in 0..head.len() {
        let mut head = head;
        head[at] ^= 0xff;
        let answer = to.call("format::declared_len", || roadmap::declared_len(&head));
        assert!(answer == Ok(len) || answer.is_err());
    }
    for cut in 0..len {
        assert!(RoadmapView::parse(&file[..cut]).is_err());
    }
    assert_eq!(
        roadmap::encoded_len(NODE_POSITIONS.len(), edges.len(), LANDMARK_COUNT + 1),
        Some(len)
    );
    len
}

/// Node numbers that are tried: the roadmap has nodes 0 to 5, so the last three are invalid.
pub(super) const NODE_INDICES: [u16; 6] = [0, 1, 5, 6, 8, u16::MAX];

pub(super) fn call_roadmap_views(to: &mut Results<'_, impl CallListener>, view: &RoadmapView<'_>) {
    let nodes = to.call("view::RoadmapView::node_count", || view.node_count());
    let half_edges = to.call("view::RoadmapView::half_edge_count", || view.half_edge_count());
    assert_eq!((nodes, half_edges), (6, 18));
    let bytes = to.call("view::RoadmapView::byte_len", || view.byte_len());
    to.add_count(bytes);
    assert!(to.call("view::RoadmapView::has_landmarks", || view.has_landmarks()));
    assert_eq!(to.call("view::RoadmapView::header", || *view.header()), HEADER);
    assert_eq!(to.call("view::RoadmapView::origin", || *view.origin()), HEADER.origin);
    let crc = to.call("view::RoadmapView::crc", || view.crc());
    to.add_count(crc as usize);
    for i in 0..NODE_INDICES.len() * NODE_INDICES.len() {
        let (a, b) = (NODE_INDICES[i / NODE_INDICES.len()], NODE_INDICES[i % NODE_INDICES.len()]);
        let there = usize::from(a.max(b)) < nodes;
        let place = to.call("view::RoadmapView::node", || view.node(a));
        assert_eq!(place.iter().all(|c| c.is_finite()), usize::from(a) < nodes);
        let length_m = to.call("view::RoadmapView::distance_m", || view.distance_m(a, b));
        assert_eq!(length_m.is_finite(), there);
        let edge = to.call("view::RoadmapView::edge_between", || view.edge_between(a, b));
        assert!(there || edge.is_none());
        let ground_m = to.call("ground::RoadmapView::ground_z_m", || view.ground_z_m(a));
        assert_eq!(ground_m, (a < 5).then_some(0.0));
        let degree = to.call("view::RoadmapView::half_edges", || view.half_edges(a).count());
        assert!(usize::from(a) < nodes || degree == 0);
        to.add_count(degree);
    }
    for p in extreme_points() {
        let around =
            to.call("ground::RoadmapView::ground_z_range_near", || view.ground_z_range_near(&p));
        assert!(around.is_none_or(|(low_m, high_m)| low_m == 0.0 && high_m == 0.0 && p.z >= 0.0));
        to.add_count(usize::from(around.is_some()));
    }
    let edge = view.edge_between(0, 4).expect("an edge");
    for hard in EXTREME_NUMBERS {
        let clears =
            to.call("view::RoadmapView::has_clearance", || view.has_clearance(&edge, hard));
        assert_eq!(clears, hard < 1.0, "{hard}");
    }
}

pub(super) fn call_searches(
    to: &mut Results<'_, impl CallListener>,
    view: &RoadmapView<'_>,
    ws: &mut SearchWorkspace<MAX_NODES>,
) {
    let fresh = to.call("search::SearchWorkspace::new", SearchWorkspace::<MAX_NODES>::new);
    let mut way: Vec<u16, MAX_NODES> = Vec::new();
    for node in NODE_INDICES {
        // Before the first search every node is unreached.
        assert!(
            to.call("search::SearchWorkspace::distance_m", || fresh.distance_m(node)).is_infinite()
        );
        assert!(
            to.call("search::SearchWorkspace::path_to", || fresh.path_to(node, &mut way)).is_err()
        );
    }
    let mut small = SearchWorkspace::<2>::new();
    let mut lengths = [0.0; 18];
    assert!(RoadmapWithLengths::new(*view, &mut lengths[..17]).is_err());
    let with = to
        .call("search::RoadmapWithLengths::new", || RoadmapWithLengths::new(*view, &mut lengths))
        .expect("18 half-edges");
    for i in 0..NODE_INDICES.len() * NODE_INDICES.len() {
        let (a, b) = (NODE_INDICES[i / NODE_INDICES.len()], NODE_INDICES[i % NODE_INDICES.len()]);
        let there = usize::from(a.max(b)) < view.node_count();
        let found =
            to.call("search::astar", || search::astar(view, a, b, any_edge_passable, ws, &mut way));
        assert_eq!(found.is_ok(), there);
        assert_eq!(search::astar(&with, a, b, any_edge_passable, ws, &mut way), found);
        to.add(found.unwrap_or(-1.0));
        let closed = search::astar(view, a, b, |_, _| false, ws, &mut way);
        assert_eq!(closed.is_ok(), there && a == b);
        let mut short: Vec<u16, 1> = Vec::new();
        assert!(a == b || search::astar(view, a, b, any_edge_passable, ws, &mut short).is_err());
        assert!(search::astar(view, a, b, any_edge_passable, &mut small, &mut way).is_err());
        let all = to
            .call("search::dijkstra_all", || search::dijkstra_all(view, a, any_edge_passable, ws));
        assert_eq!(all.is_ok(), usize::from(a) < view.node_count());
        let mut row = [0.0; 2];
        let answer = to.call("search::path_lengths_to", || {
            search::path_lengths_to(view, a, &[b, 0], any_edge_passable, ws, &mut row)
        });
        assert_eq!(answer.is_ok(), there);
        assert_eq!(
            search::path_lengths_to(view, a, &[b, 0], any_edge_passable, ws, &mut row[..1]),
            Err(SearchError::OutputLength)
        );
        let mut costs = [0.0; 4];
        let answer = to.call("search::cost_matrix", || {
            search::cost_matrix(view, &[a, 0], &[b, 1], any_edge_passable, ws, &mut costs)
        });
        assert_eq!(answer.is_ok(), there);
        assert!(
            search::cost_matrix(view, &[a, 0], &[b, 1], any_edge_passable, ws, &mut costs[..3])
                .is_err()
        );
    }
    assert_eq!(search::cost_matrix(view, &[], &[1], any_edge_passable, ws, &mut []), Ok(()));
}

pub(super) fn call_assignments(to: &mut Results<'_, impl CallListener>) {
    let mut ws = to.call("assignment::AssignmentWorkspace::new", AssignmentWorkspace::<3>::new);
    let mut out = [None; 3];
    let mut both = |costs: &[f32], rows: usize, cols: usize, out: &mut [Option<u16>]| {
        let total =
            to.call("assignment::assign", || assignment::assign(costs, rows, cols, &mut ws, out));
        let most = to.call("assignment::assign_bottleneck", || {
            assignment::assign_bottleneck(costs, rows, cols, &mut ws, out)
        });
        assert_eq!(total.map(|a| a.pair_count), most.map(|a| a.pair_count));
        to.add(most.map_or(-1.0, |a| a.largest_cost));
        total
    };
    for i in 0..EXTREME_NUMBERS.len() * EXTREME_NUMBERS.len() {
        let (a, b) = (
            EXTREME_NUMBERS[i / EXTREME_NUMBERS.len()],
            EXTREME_NUMBERS[i % EXTREME_NUMBERS.len()],
        );
        let costs = [a, b, a, b, a, 1.0, 2.0, b, a];
        let bad = costs.iter().any(|c| c.is_nan() || *c == f32::NEG_INFINITY);
        for (rows, cols) in [(3, 3), (1, 3), (3, 1), (2, 3)] {
            let found = both(&costs[..rows * cols], rows, cols, &mut out[..rows]);
            assert!(found.is_ok() || bad, "{costs:?}");
        }
    }
    let costs = [1.0; 16];
    assert_eq!(both(&costs, 4, 4, &mut out).unwrap_err(), AssignmentError::WorkspaceTooSmall);
    assert_eq!(both(&costs[..9], 3, 3, &mut out[..2]).unwrap_err(), AssignmentError::OutputLength);
    assert_eq!(both(&costs[..8], 3, 3, &mut out).unwrap_err(), AssignmentError::Shape);
    assert!(both(&[], 0, 0, &mut []).is_err() && both(&[], 3, 0, &mut out).is_err());
    assert!(both(&costs, usize::MAX, 2, &mut out).is_err());
}
