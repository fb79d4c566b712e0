extern crate std;
use std::boxed::Box;
use std::vec::Vec as StdVec;

use proptest::prelude::*;

use super::*;
use crate::coverage::area::{Area, Ring, RingKind};
use crate::detour::ZoneKind;

/// Place above the pad at which detours home end, ENU metres.
const OVER: Point = Point::new(5.0, 5.0, 12.0);
/// Height of the transit layer, metres.
const LAYER_M: f32 = 40.0;

fn request(here: Point) -> DetourRequest {
    DetourRequest {
        land_aside: false,
        here,
        leg: [here, here],
        leg_clearance_m: 10.0,
        goal: DetourGoal::Point { end: OVER, layer_z_m: LAYER_M },
        descent_m: 12.0,
        required_clearance_m: 1.2,
        fence: None,
    }
}

fn column(place: Flat, low_m: f32, high_m: f32, radius_m: f32) -> KeepOutZone {
    let at = |height_m| Point::new(place.x, place.y, height_m);
    KeepOutZone { from: at(high_m), to: at(low_m), radius_m, kind: ZoneKind::Static }
}

/// A field of 400 m, and no-fly zones in it: each in a cell of its own, so that none crosses
/// another. A zone is given by its rotation, outer radius, ratio of inner to outer radius, and
/// number of corners.
fn field(zones: &[Option<(f32, f32, f32, u8)>]) -> (StdVec<Flat>, StdVec<Ring>) {
    let mut vertices = StdVec::from(
        [(0.0, 0.0), (400.0, 0.0), (400.0, 400.0), (0.0, 400.0)].map(|(x, y)| Flat::new(x, y)),
    );
    let mut rings = StdVec::from([Ring { end: 4, kind: RingKind::Outer }]);
    for (i, zone) in zones.iter().enumerate() {
        let Some((turn, far_m, slim, corners)) = *zone else { continue };
        let middle = Flat::new(80.0 + 100.0 * (i % 3) as f32, 80.0 + 100.0 * (i / 3) as f32);
        for corner in 0..corners {
            let angle = turn + core::f32::consts::TAU * f32::from(corner) / f32::from(corners);
            // Every other corner further in: concave.
            let far_m = if corner % 2 == 0 { far_m } else { far_m * slim };
            vertices.push(middle + Flat::new(cosf(angle), sinf(angle)) * far_m);
        }
        rings.push(Ring { end: vertices.len() as u16, kind: RingKind::NoFly });
    }
    (vertices, rings)
}

type Way = Result<StdVec<Point>, DetourError>;

/// Plans a path, and checks what holds for every path. Also returns the length of the shortest path
/// around the zones alone.
fn planned(
    zones: &[Option<(f32, f32, f32, u8)>],
    request: &DetourRequest,
    obstacles: &[KeepOutZone],
) -> Option<(Way, f32)> {
    let (vertices, rings) = field(zones);
    let area = Area::new(&vertices, &rings).ok()?;
    let mut transit = Box::new(TransitGraph::<128>::empty());
    transit.set_area(area).unwrap();
    if area.is_in_no_fly_zone(&request.here.xy()) {
        return None;
    }
    let mut known = obstacles.to_vec();
    let mut out = Path::<64>::new();
    let found = plan_detour(&transit, None, request, &mut known, &mut out);
    let way = found.map(|()| out.waypoints().iter().map(|w| w.position).collect::<StdVec<_>>());
    if let Ok(points) = &way {
        assert_eq!(points[0], request.here);
        for leg in points.windows(2) {
            assert!(transit.is_line_clear(&leg[0].xy(), &leg[1].xy()), "{leg:?} meets a zone");
            // Where the vehicle was too near already, the path leads no nearer.
            for obstacle in &known {
                assert!(
                    !obstacle.impassable_part(&request.here).intersects(&leg[0], &leg[1]),
                    "{leg:?} meets {obstacle:?}"
                );
            }
        }
        if let Some((low, high)) = request.fence {
            let inside = |p: &Point| (0..3).all(|a| p[a] >= low[a] && p[a] <= high[a]);
            assert!(points[1..].iter().all(inside), "{points:?} leave {low:?} to {high:?}");
        }
        let end = points.last().unwrap();
        if request.land_aside {
            assert!(
                (end - request.here).norm() <= MAX_SIDESTEP_RINGS as f32 + 0.01
                    && points.len() == 2
            );
            assert!(!known.iter().any(|o| o.contains(end)), "{end:?} is no place to rest");
        } else {
            assert!((end - OVER).norm() <= SAME_CORNER_M, "{end:?}");
            // Up or down to one height, its layer's or its own, along that, then down.
            let level = points[1..points.len() - 1].iter().all(|p| p.z == points[1].z);
            assert!(level && [LAYER_M, request.here.z].contains(&points[1].z), "{points:?}");
        }
    }
    Some((way, transit.distance_m(&request.here.xy(), &OVER.xy())))
}

fn length_m(points: &[Point]) -> f32 {
    points.windows(2).map(|leg| (leg[1] - leg[0]).xy().norm()).sum()
}

#[test]
fn the_way_home_is_straight_in_its_layer_where_nothing_is_there() {
    let here = Point::new(300.0, 200.0, 25.0);
    let (way, _) = planned(&[], &request(here), &[]).unwrap();
    let up = |place: Point| Point::new(place.x, place.y, LAYER_M);
    assert_eq!(way, Ok(StdVec::from([here, up(here), up(OVER), OVER])));
}

#[test]
fn where_the_layer_is_barred_above_it_flies_at_its_own_height() {
    let here = Point::new(300.0, 200.0, 25.0);
    let lid = column(here.xy(), 32.0, 40.0, 3.0);
    let (way, _) = planned(&[], &request(here), &[lid]).unwrap();
    assert_eq!(way, Ok(StdVec::from([here, Point::new(OVER.x, OVER.y, 25.0), OVER])));
}

#[test]
fn a_pad_below_somebody_is_no_home_and_nobody_flies_through_a_ring_of_columns() {
    let here = Point::new(300.0, 200.0, 25.0);
    let (way, _) = planned(&[], &request(here), &[column(OVER.xy(), 0.0, 20.0, 3.0)]).unwrap();
    assert_eq!(way, Err(DetourError::GoalBlocked));
    let around = |i: usize| {
        let angle = core::f32::consts::TAU * i as f32 / 16.0;
        column(here.xy() + Flat::new(cosf(angle), sinf(angle)) * 10.0, 0.0, 100.0, 3.0)
    };
    let ring: StdVec<_> = (0..16).map(around).collect();
    let (way, _) = planned(&[], &request(here), &ring).unwrap();
    assert_eq!(way, Err(DetourError::Search(SearchError::NoPath)));
    let (way, _) =
        planned(&[], &DetourRequest { land_aside: true, ..request(here) }, &ring).unwrap();
    assert!(way.is_ok(), "inside the ring there is room to stand aside");
}

#[test]
fn what_is_no_number_is_refused() {
    let here = Point::new(300.0, 200.0, 25.0);
    let bad = [f32::NAN, f32::INFINITY]
        .map(|layer_m| DetourGoal::Point { end: OVER, layer_z_m: layer_m });
    for goal in bad {
        let (way, _) = planned(&[], &DetourRequest { goal, ..request(here) }, &[]).unwrap();
        assert!(matches!(way, Err(DetourError::Config(_))));
    }
    let node = DetourRequest { goal: DetourGoal::RoadmapGoal(0), ..request(here) };
    assert!(planned(&[], &node, &[]).unwrap().0.is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn no_way_meets_a_zone_or_a_thing_and_around_zones_it_is_the_shortest(
        zones in prop::collection::vec(
            prop::option::of((0f32..6.3, 5f32..45.0, 0.3f32..1.0, 3u8..9)),
            9,
        ),
        things in prop::collection::vec(
            (0f32..400.0, 0f32..400.0, 0f32..30.0, 0f32..60.0, 0.5f32..8.0, any::<bool>()),
            0..12,
        ),
        here in (0f32..400.0, 0f32..400.0, 5f32..60.0),
        aside in any::<bool>(),
        room_m in 0f32..40.0,
    ) {
        let here = Point::new(here.0, here.1, here.2);
        let request = DetourRequest { land_aside: aside, ..request(here) };
        let thing = |&(x, y, low_m, high_m, radius_m, lands): &(f32, f32, f32, f32, f32, bool)| {
            KeepOutZone {
                kind: if lands { ZoneKind::LandingColumn } else { ZoneKind::Static },
                ..column(Flat::new(x, y), low_m, low_m + high_m, radius_m)
            }
        };
        let things: StdVec<_> = things.iter().map(thing).collect();
        let Some((way, shortest_m)) = planned(&zones, &request, &things) else { return Ok(()) };
        // A fence that contains both ends of the path rules out some paths, and allows no new ones.
        let room = Point::repeat(room_m);
        let fence = Some((
            here.inf(&OVER) - room,
            Point::new(here.x, here.y, LAYER_M).sup(&OVER).sup(&here) + room,
        ));
        if let Some((Ok(fenced), _)) = planned(&zones, &DetourRequest { fence, ..request }, &things)
        {
            let free = way.as_ref().expect("the same way without a fence");
            prop_assert!(
                aside || length_m(free) < length_m(&fenced) + 0.1 || free[1].z != fenced[1].z
            );
        }
        let Some((alone, _)) = planned(&zones, &request, &[]) else { return Ok(()) };
        if !aside && shortest_m.is_finite() {
            let alone = alone.expect("a way around the zones");
            prop_assert!((length_m(&alone) - shortest_m).abs() < 0.01 * shortest_m + 0.1);
            if let Ok(way) = way {
                prop_assert!(length_m(&way) > shortest_m - 0.1);
            }
        }
    }
}
