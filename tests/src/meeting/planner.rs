//! A planner of detours in the open, where vehicles are the only obstacles.

use planner_core::Point;
use planner_core::detour::{DetourRequest, KeepOutZone, ZoneKind};
use planner_core::flight::Path;

use super::referee;
use super::scene::Plan;

/// A detour in the open around the zones in `keep`: straight, or past one or two points beside and
/// above; if the request is to land aside, to a place aside. `None` if none is clear.
pub(super) fn detour_in_the_open(
    request: &DetourRequest,
    keep: &[KeepOutZone],
    own: &Plan,
) -> Option<Plan> {
    let last = own.path.waypoints().last()?.position;
    let ground = last - Point::new(0.0, 0.0, request.descent_m);
    let here = request.here;
    let clear = |from: Point, to: Point| {
        keep.iter().all(|k| {
            let now_m = referee::distance((here, here), (k.from, k.to));
            let apart_m = k.radius_m.min((now_m - 0.002).max(0.0));
            let solid =
                if k.kind == ZoneKind::LandingColumn { (k.from, k.from) } else { (k.from, k.to) };
            referee::distance((from, to), solid) >= apart_m
        })
    };
    let mut ways: Vec<Vec<Point>> = Vec::new();
    let offs = (0..8).map(|i| {
        let angle = i as f32 * core::f32::consts::FRAC_PI_4;
        Point::new(angle.cos(), angle.sin(), 0.0)
    });
    let offs: Vec<Point> = offs.collect();
    if request.land_aside {
        for rise in [0.0, 2.5, 5.0].map(|rise| Point::new(0.0, 0.0, rise)) {
            for length in [3.0, 5.0, 8.0] {
                for off in &offs {
                    let way = [here, here + rise, here + rise + off * length];
                    ways.push(if rise.z > 0.0 { way.to_vec() } else { vec![here, way[2]] });
                }
            }
        }
        let rests = |at: &Point| {
            keep.iter().all(|k| referee::distance((*at, *at), (k.from, k.to)) >= k.radius_m)
        };
        let way = ways.into_iter().find(|way| {
            way.windows(2).all(|leg| clear(leg[0], leg[1])) && way.last().is_some_and(rests)
        })?;
        return plan_along(&way, own, request.descent_m);
    }
    ways.push(vec![here, last]);
    for length in [2.5, 4.0, 6.0] {
        for off in &offs {
            for rise in [0.0, 2.5] {
                let beside = off * length + Point::new(0.0, 0.0, rise);
                ways.push(vec![here, here + beside, last]);
                ways.push(vec![here, last + beside, last]);
                ways.push(vec![here, here + beside, last + beside, last]);
            }
        }
    }
    let length = |way: &Vec<Point>| way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum::<f32>();
    ways.sort_by(|a, b| length(a).total_cmp(&length(b)));
    let way = ways.into_iter().find(|way| {
        way.iter().all(|p| p.z > 0.5)
            && way.windows(2).all(|leg| clear(leg[0], leg[1]))
            && keep.iter().all(|k| referee::distance((last, ground), (k.from, k.to)) >= k.radius_m)
    })?;
    plan_along(&way, own, request.descent_m)
}

fn plan_along(way: &[Point], own: &Plan, descent_m: f32) -> Option<Plan> {
    let mut path = Path::new();
    for point in way {
        path.push(*point, 2.0).ok()?;
    }
    Some(Plan { path, descent_m, gates: heapless::Vec::new(), ..own.clone() })
}
