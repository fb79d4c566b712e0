extern crate std;
use std::boxed::Box;
use std::vec::Vec as StdVec;

use super::*;
use crate::roadmap::Edge;
use crate::roadmap::tests::{encode, header};

/// A start, a goal 8 m east of it, a straight path between them, another by the north, and a shaft
/// up from the middle.
const NODES: [Point; 6] = [
    Point::new(0.0, 0.0, 5.0),
    Point::new(8.0, 0.0, 5.0),
    Point::new(4.0, 0.0, 5.0),
    Point::new(4.0, 4.0, 5.0),
    Point::new(4.0, 0.0, 12.0),
    Point::new(8.0, 0.0, 12.0),
];
const EDGES: [(u16, u16); 6] = [(0, 2), (1, 2), (0, 3), (1, 3), (2, 4), (4, 5)];

fn request() -> DetourRequest {
    DetourRequest {
        land_aside: false,
        here: Point::new(2.0, 0.0, 5.0),
        leg: [NODES[2], NODES[0]],
        leg_clearance_m: 1.2,
        goal: DetourGoal::RoadmapGoal(0),
        descent_m: 4.0,
        required_clearance_m: 0.8,
        fence: None,
    }
}

fn at(place: Point, radius_m: f32) -> KeepOutZone {
    KeepOutZone { from: place, to: place, radius_m, kind: ZoneKind::Static }
}

fn landing(from: Point) -> KeepOutZone {
    KeepOutZone {
        to: Point::new(from.x, from.y, 0.0),
        kind: ZoneKind::LandingColumn,
        ..at(from, 2.0)
    }
}

/// Plans a detour, and checks what holds for every path: it begins at the vehicle, joins nodes and
/// ends at a node.
fn planned(
    request: &DetourRequest,
    obstacles: &[KeepOutZone],
) -> Result<StdVec<Point>, DetourError> {
    let edges = EDGES.map(|(a, b)| Edge { a: a.min(b), b: a.max(b), clearance_m: 1.5 });
    let mut edges = edges.to_vec();
    edges.sort_by_key(|edge| (edge.a, edge.b));
    let bytes = encode(&header(1, 1), &NODES, &edges);
    let view = RoadmapView::parse(&bytes).unwrap();
    let (mut ws, mut out) = (Box::new(SearchWorkspace::<8>::new()), Path::<8>::new());
    plan_detour(
        &view,
        request,
        &mut obstacles.to_vec(),
        &mut ws,
        &mut Vec::<u16, 8>::new(),
        &mut out,
    )?;
    let points: StdVec<Point> = out.waypoints().iter().map(|w| w.position).collect();
    assert_eq!(points[0], request.here);
    assert!(points[1..].iter().all(|p| NODES.contains(p)), "{points:?}");
    Ok(points)
}

#[test]
fn the_shortest_way_is_taken_and_another_where_something_is_on_it() {
    let here = request().here;
    assert_eq!(planned(&request(), &[]), Ok(StdVec::from([here, NODES[2], NODES[1]])));
    let around = planned(&request(), &[at(Point::new(5.0, 0.0, 5.0), 1.5)]);
    assert_eq!(around, Ok(StdVec::from([here, NODES[0], NODES[3], NODES[1]])));
    let both = [at(Point::new(5.0, 0.0, 5.0), 1.5), at(NODES[3], 1.5)];
    assert_eq!(planned(&request(), &both), Err(DetourError::Search(SearchError::NoPath)));
}

#[test]
fn a_goal_that_something_lies_below_is_blocked() {
    let lies = at(Point::new(8.0, 1.0, 1.5), 1.5);
    assert_eq!(planned(&request(), &[lies]), Err(DetourError::GoalBlocked));
    let bad = DetourRequest { goal: DetourGoal::RoadmapGoal(9), ..request() };
    assert_eq!(planned(&bad, &[]), Err(DetourError::Search(SearchError::BadNode(10))));
}

#[test]
fn a_vehicle_that_is_too_near_may_leave_but_come_no_nearer() {
    let behind = at(Point::new(1.0, 0.0, 5.0), 1.5);
    assert!(planned(&request(), &[behind]).is_ok());
    let ahead = at(Point::new(3.0, 0.0, 5.0), 1.5);
    assert_eq!(planned(&request(), &[ahead]).unwrap()[1], NODES[0]);
}

/// Small vehicles have small zones. A zone of any size is kept out of if the vehicle is not in it
/// already.
#[test]
fn zones_of_any_size_ahead_are_kept_out_of() {
    for radius_m in [0.1, 0.3, 0.5, 0.7] {
        let ahead = at(Point::new(6.0, 0.0, 5.0), radius_m);
        assert_eq!(planned(&request(), &[ahead]).unwrap()[1], NODES[0], "{radius_m}");
    }
}

#[test]
fn no_way_leaves_the_fence() {
    let here = request().here;
    let fenced = |most: Point| {
        let fence = Some((Point::new(-1.0, -1.0, 0.0), most));
        planned(&DetourRequest { fence, ..request() }, &[at(Point::new(5.0, 0.0, 5.0), 1.0)])
    };
    let around = Ok(StdVec::from([here, NODES[0], NODES[3], NODES[1]]));
    assert_eq!(fenced(Point::new(9.0, 5.0, 6.0)), around);
    let none = Err(DetourError::Search(SearchError::NoPath));
    assert_eq!(fenced(Point::new(9.0, 3.0, 6.0)), none);
    assert_eq!(fenced(Point::new(7.0, 5.0, 6.0)), none, "the goal lies outside");
}

#[test]
fn aside_is_the_nearest_node_that_nobody_lands_on() {
    let aside = DetourRequest { land_aside: true, ..request() };
    let down = landing(Point::new(3.0, 0.0, 20.0));
    let points = planned(&aside, &[down]).unwrap();
    assert_eq!(points.last(), Some(&NODES[0]), "{points:?}");
    let taken = planned(&aside, &[down, at(NODES[0], 1.0)]).unwrap();
    assert_ne!(taken.last(), Some(&NODES[0]), "somebody is there");
    let everywhere = KeepOutZone { radius_m: 40.0, ..down };
    assert_eq!(planned(&aside, &[everywhere]), Err(DetourError::Search(SearchError::NoPath)));
}

#[test]
fn aside_does_not_lead_up_to_a_vehicle_that_lands() {
    let aside =
        DetourRequest { land_aside: true, leg: [NODES[2], NODES[2]], here: NODES[2], ..request() };
    // The nodes on the floor are taken by others: only the shaft is left, down which another
    // vehicle lands.
    let floor = [at(NODES[0], 1.0), at(NODES[1], 1.0), at(NODES[3], 1.0)];
    let with = |top_z: f32| {
        let mut all = floor.to_vec();
        all.push(landing(Point::new(4.0, 0.0, top_z)));
        planned(&aside, &all)
    };
    assert_eq!(with(13.0), Err(DetourError::Search(SearchError::NoPath)));
    assert_eq!(with(40.0).unwrap().last(), Some(&NODES[5]), "high enough to be out before");
}

#[test]
fn a_path_is_blocked_by_what_is_ahead_of_it_only() {
    let mut path = Path::<8>::new();
    for point in [NODES[0], NODES[2], NODES[1]] {
        path.push(point, 1.5).unwrap();
    }
    let far = Point::new(0.0, 50.0, 0.0);
    let between = |ahead: Range<f32>, place: Point| {
        is_path_blocked(&path, ahead, 4.0, 4.0, &far, &at(place, 1.0))
    };
    let blocked = |along_m: f32, place: Point| between(along_m..f32::INFINITY, place);
    assert!(blocked(1.0, Point::new(6.0, 0.5, 5.0)) && !blocked(7.5, Point::new(6.0, 0.5, 5.0)));
    assert!(!blocked(1.0, Point::new(6.0, 1.5, 5.0)), "beside it");
    assert!(blocked(1.0, Point::new(8.0, 0.0, 1.0)), "below the goal");
    let on_pad = Point::new(0.0, 0.0, 1.0);
    assert!(blocked(-4.0, on_pad) && !blocked(1.0, on_pad), "the climb, until it is over");
    let on_path = Point::new(6.0, 0.5, 5.0);
    assert!(between(1.0..6.0, on_path) && !between(1.0..5.0, on_path), "no further than is looked");
    assert!(!between(1.0..7.0, Point::new(8.0, 0.0, 1.0)), "the descent, once it is looked at");
}

proptest::proptest! {
    /// The quick check along the axes changes no answer.
    #[test]
    fn touching_is_being_nearer_than_the_radius(
        c in proptest::collection::vec(-4.0f32..4.0, 12),
        radius_m in 0.0f32..3.0,
    ) {
        let point = |i: usize| Point::new(c[3 * i], c[3 * i + 1], c[3 * i + 2]);
        let off = KeepOutZone { from: point(0), to: point(1), radius_m, kind: ZoneKind::Static };
        let (a, b) = (point(2), point(3));
        let apart = segments_distance_sq((&a, &b), (&off.from, &off.to));
        proptest::prop_assert_eq!(off.intersects(&a, &b), apart < radius_m * radius_m);
    }
}
