//! Paths of a meeting's vehicles: geometries in which they come close.

use planner_core::Point;
use planner_core::flight::{Flight, Path, Task};
use planner_core::schedule;

use super::types::{SAFETY_DISTANCE_M, SCHEDULE, WAYPOINTS};
use crate::meeting::dice::Dice;

/// Longest flight of a vehicle, seconds.
const LONGEST_FLIGHT_S: f32 = 60.0;
/// Names of the geometries.
pub(super) const KINDS: [&str; 6] =
    ["crossing", "shared", "vertical", "beside", "corridor", "random"];

/// The path of a vehicle: its pad on the ground, the points, and the goal's ground height.
pub(super) struct PathWithPads {
    pub(super) pad: Point,
    /// Points of the path, ENU metres.
    pub(super) points: Vec<Point>,
    /// Height of the ground at the goal, ENU up, metres.
    pub(super) goal_ground_z: f32,
}

/// The place at height `z`.
pub(super) fn at_height(place: Point, z: f32) -> Point {
    Point::new(place.x, place.y, z)
}

/// A random path of vehicle `i` in the geometry `kind`, which lies in space as `shape` says.
pub(super) fn draw_path(kind: &str, i: usize, shape: &Placement, dice: &mut Dice) -> PathWithPads {
    let up =
        |dice: &mut Dice| if dice.chance(0.2) { dice.real(1.0, 29.0) } else { dice.real(1.0, 5.0) };
    let (middle, z) = (shape.middle, shape.z);
    match kind {
        "crossing" => {
            let angle = shape.angle + dice.real(0.2, 2.9) * i as f32;
            let (reach, beyond) = (dice.real(4.0, 9.0), dice.real(4.0, 9.0));
            let direction = Point::new(angle.cos(), angle.sin(), 0.0);
            let level = z + dice.real(-0.4, 0.4);
            let from = at_height(middle - direction * reach, level);
            let to = at_height(middle + direction * beyond, level + dice.real(-0.5, 0.5));
            with_pads_below(vec![from, at_height(middle, level), to], dice)
        }
        "shared" => {
            let mut points =
                vec![middle + Point::new(dice.real(-7.0, -3.0), dice.real(-5.0, 5.0), 0.0)];
            points.extend([middle, middle + shape.along * 7.0]);
            points.push(
                points[2]
                    + Point::new(dice.real(2.0, 6.0), dice.real(-6.0, 6.0), dice.real(-0.5, 2.0)),
            );
            if dice.chance(0.25) {
                points.reverse();
            }
            points.iter_mut().for_each(|p| p.z = p.z.max(1.0) + 0.0);
            with_pads_below(points, dice)
        }
        "vertical" => {
            // Climbs and descents above the pads and goals of others.
            let here = middle + Point::new(dice.real(-0.8, 0.8), dice.real(-0.8, 0.8), 0.0);
            let away = middle + Point::new(dice.real(-9.0, 9.0), dice.real(-9.0, 9.0), 0.0);
            let (low, high) = (up(dice), up(dice));
            let beside = |p: Point, dice: &mut Dice| {
                p + Point::new(dice.real(2.0, 4.0), dice.real(2.0, 4.0), 0.0)
            };
            match i % 3 {
                0 => with_pads_below(
                    vec![at_height(here, low), at_height(away, low + dice.real(-0.5, 2.0))],
                    dice,
                ),
                1 => with_pads_below(vec![at_height(away, high), at_height(here, high)], dice),
                _ => with_pads_below(
                    vec![
                        at_height(away, high),
                        at_height(here, high),
                        at_height(beside(here, dice), high),
                    ],
                    dice,
                ),
            }
        }
        "beside" => {
            // Vehicle 0 flies a straight path; the others have pads close to it.
            let across = Point::new(-shape.along.y, shape.along.x, 0.0);
            let line = |along: f32, off: f32, z: f32| {
                at_height(middle + shape.along * along + across * off, z)
            };
            if i == 0 {
                with_pads_below(vec![line(-8.0, 0.0, z), line(8.0, 0.0, z)], dice)
            } else {
                let off = dice.real(1.6, 3.0) * if dice.chance(0.5) { 1.0 } else { -1.0 };
                let (along, top) = (dice.real(-5.0, 5.0), z + dice.real(-1.0, 3.0));
                let to = line(
                    along + dice.real(-4.0, 4.0),
                    off + off.signum() * dice.real(3.0, 8.0),
                    top,
                );
                let mut points = vec![line(along, off, top.max(1.0)), to];
                if dice.chance(0.5) {
                    points.reverse();
                }
                with_pads_below(points, dice)
            }
        }
        "corridor" => {
            let along = shape.along;
            let end = dice.real(5.0, 9.0);
            let mut points = vec![
                at_height(
                    middle - along * end
                        + Point::new(dice.real(-4.0, 4.0), dice.real(-4.0, 4.0), 0.0),
                    z,
                ),
                at_height(middle - along * 4.0, z),
                at_height(middle + along * 4.0, z),
                at_height(
                    middle
                        + along * end
                        + Point::new(dice.real(-4.0, 4.0), dice.real(-4.0, 4.0), 0.0),
                    z,
                ),
            ];
            if i % 2 == 1 {
                points.reverse();
            }
            with_pads_below(points, dice)
        }
        _ => {
            let count = 2 + dice.below(3);
            let low = Point::new(middle.x - 8.0, middle.y - 8.0, 1.0);
            let high = Point::new(middle.x + 8.0, middle.y + 8.0, 6.0);
            with_pads_below((0..count).map(|_| dice.point(low, high)).collect(), dice)
        }
    }
}

/// Puts pad and goal below a path's ends: mostly on the floor, some on a platform.
fn with_pads_below(mut points: Vec<Point>, dice: &mut Dice) -> PathWithPads {
    points.iter_mut().for_each(|p| p.z = p.z.max(0.8));
    let mut ground = |top: f32| {
        let most = (top - 0.8).max(0.0);
        if dice.chance(0.2) { dice.real(0.0, most) } else { 0.0 }
    };
    let (first, last) = (points[0], points[points.len() - 1]);
    PathWithPads { pad: at_height(first, ground(first.z)), goal_ground_z: ground(last.z), points }
}

/// Where a geometry lies: centre, direction as a vector and an angle, and height.
pub(super) struct Placement {
    pub(super) middle: Point,
    /// Direction as a unit vector.
    pub(super) along: Point,
    /// Direction, radians from east, counter-clockwise.
    pub(super) angle: f32,
    /// Height, ENU up, metres.
    pub(super) z: f32,
}

/// The flight along a path; `None` if it is too short, too low or too long.
pub(super) fn flight_along(id: u8, way: &PathWithPads) -> Option<Flight<WAYPOINTS>> {
    let mut path = Path::new();
    for point in &way.points {
        path.push(*point, 2.0).ok()?;
    }
    let first = way.points.first()?;
    let climb_m = first.z - way.pad.z;
    path.set_times_at_speed(climb_m / SCHEDULE.vertical_mps, SCHEDULE.cruise_mps);
    let descent_m = way.points.last()?.z - way.goal_ground_z;
    let length_s = path.length_m() / SCHEDULE.cruise_mps + climb_m + descent_m;
    (path.length_m() > 2.0 && climb_m > 0.5 && descent_m > 0.5 && length_s < LONGEST_FLIGHT_S)
        .then_some(Flight {
            vehicle_id: id,
            task: Task::Goto(u16::from(id)),
            path,
            climb_m,
            descent_m,
            depart_s: 0.0,
            max_segment_m: schedule::DEFAULT_MAX_SEGMENT_M,
        })
}

/// Ground positions where a flight begins and ends.
pub(super) fn pad_and_goal(flight: &Flight<WAYPOINTS>) -> [Point; 2] {
    let down = |length| Point::new(0.0, 0.0, length);
    let points = flight.path.waypoints();
    [
        points[0].position - down(flight.climb_m),
        points[points.len() - 1].position - down(flight.descent_m),
    ]
}

/// Whether `next` fits beside `flights`: no flight passes close over a platform, all pads lie
/// apart.
pub(super) fn fits_beside(flights: &[Flight<WAYPOINTS>], next: &Flight<WAYPOINTS>) -> bool {
    let own = pad_and_goal(next);
    let over = |pads: &[Point; 2], path: &Path<WAYPOINTS>| {
        let steps = (path.length_m() / 0.3) as usize;
        path.points_from(0.0, 0.3)
            .take(steps + 1)
            .any(|p| pads.iter().any(|pad| (pad - p).xy().norm() < 1.2 && p.z < pad.z + 0.7))
    };
    !over(&own, &next.path)
        && flights.iter().all(|other| {
            let theirs = pad_and_goal(other);
            let apart = own.iter().zip(&theirs).all(|(a, b)| {
                (a - b).norm() > SAFETY_DISTANCE_M + 0.5
                    && ((a - b).xy().norm() > 1.6 || (a.z - b.z).abs() < 0.1)
            });
            let crossed = (own[0] - theirs[1]).norm().min((own[1] - theirs[0]).norm())
                > SAFETY_DISTANCE_M + 0.3;
            apart && crossed && !over(&theirs, &next.path) && !over(&own, &other.path)
        })
}
