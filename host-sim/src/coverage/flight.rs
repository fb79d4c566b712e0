//! The points of one vehicle's flight: up to its layer, over to the first waypoint, down, along the
//! lanes, up, home in its layer, down.
//!
//! Metres, ENU in the mission frame. Over level ground all pictures are at one height above the
//! mission's origin. Over terrain, lanes and the paths between them have corners where they rise
//! and fall.

use std::convert::Infallible;

use heapless::Vec as Fixed;
use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::pack::Route;

use super::{CoveragePlan, MAX_NO_FLY_CORNERS};
use crate::scenario::coverage::Trigger;

/// A corner of the path within this distance of a picture counts as at the picture's position,
/// metres.
const SAME_PLACE_M: f32 = 0.01;

/// Action of a vehicle at a point of its flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaypointAction {
    /// The vehicle stands on its pad.
    OnPad,
    /// The vehicle passes at the height of its layer.
    Transit,
    /// The vehicle passes at the height of the lanes, on a lane or between two, without a picture.
    AtLaneHeight,
    /// The vehicle takes the picture of the waypoint of this number.
    Photo(u32),
}

/// A point that a flight passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightPoint {
    /// Position, metres ENU.
    pub position: Point,
    /// Action at the point.
    pub action: WaypointAction,
    /// Index of the lane that the point lies on; `None` outside lanes.
    pub lane: Option<u16>,
}

/// The flight of one vehicle: its points, and the time at which it passes each.
pub struct TimedFlight<'a> {
    /// MAVLink system id of the vehicle.
    pub vehicle: u8,
    /// The points, in the order of flight.
    pub points: &'a [FlightPoint],
    /// Time at which each point is passed, seconds after the mission's start.
    pub times_s: &'a [f32],
}

/// All points of a route's flight, from pad to pad.
pub fn flight_points(planned: &CoveragePlan<'_>, route: &Route) -> Vec<FlightPoint> {
    let (vehicle, pad) = {
        let index = usize::from(route.vehicle_index);
        (&planned.vehicles[index], planned.scenario.vehicles[index].start)
    };
    let heights = planned.area_settings.heights;
    let layer_m = heights.max_picture_height_m + f32::from(route.layer) * heights.layer_spacing_m;
    let at = |place: &Flat, height_m: f32| Point::new(place.x, place.y, height_m);
    let point =
        |position: Point, act: WaypointAction| FlightPoint { position, action: act, lane: None };
    let (first, last) = route.first_and_last();
    let ends = [first, last]
        .map(|number| planned.tracks.waypoint(number).unwrap_or(vehicle.transit_start));
    let mut points = vec![
        point(pad, WaypointAction::OnPad),
        point(at(&vehicle.transit_start, layer_m), WaypointAction::Transit),
    ];
    points.extend(
        corners_around_no_fly_zones(planned, &vehicle.transit_start, &ends[0])
            .iter()
            .map(|c| point(at(c, layer_m), WaypointAction::Transit)),
    );
    points.push(point(at(&ends[0], layer_m), WaypointAction::Transit));
    add_lane_points(planned, route, &mut points);
    points.push(point(at(&ends[1], layer_m), WaypointAction::Transit));
    points.extend(
        corners_around_no_fly_zones(planned, &ends[1], &vehicle.home)
            .iter()
            .map(|c| point(at(c, layer_m), WaypointAction::Transit)),
    );
    points.push(point(at(&vehicle.home, layer_m), WaypointAction::Transit));
    points.push(point(Point::new(vehicle.home.x, vehicle.home.y, pad.z), WaypointAction::OnPad));
    points
}

/// Appends the points on the lanes of a route and on the paths between them.
fn add_lane_points(planned: &CoveragePlan<'_>, route: &Route, points: &mut Vec<FlightPoint>) {
    let numbers: Vec<u32> = route.waypoints().collect();
    let mut here: Option<Point> = None;
    for own in numbers.chunk_by(|a, b| planned.tracks.lane_of(*a) == planned.tracks.lane_of(*b)) {
        let lane = Some(planned.tracks.lane_of(own[0]) as u16);
        let places: Vec<(u32, Flat)> = own
            .iter()
            .filter_map(|number| Some((*number, planned.tracks.waypoint(*number)?)))
            .collect();
        let (Some((_, begin)), Some((_, end))) = (places.first(), places.last()) else { continue };
        let from = match here {
            None => first_lane_start(planned, begin, end),
            Some(mut from) => {
                let mut between = Vec::new();
                for corner in
                    corners_around_no_fly_zones(planned, &from.xy(), begin).iter().chain([begin])
                {
                    between.extend(leg_corners(planned, &from, corner));
                    from = between.last().copied().unwrap_or(from);
                }
                // The last point is the lane's first waypoint, which is added with the lane.
                between.pop();
                let point = |position: Point| FlightPoint {
                    position,
                    action: WaypointAction::AtLaneHeight,
                    lane: None,
                };
                points.extend(between.into_iter().map(point));
                from
            }
        };
        let path: Vec<Point> =
            std::iter::once(from).chain(leg_corners(planned, &from, end)).collect();
        add_picture_points(planned, &path, &places, lane, points);
        here = path.last().copied();
    }
}

/// Point where the vehicle begins its first lane: at the height of the pictures, or over terrain at
/// the height from which the lane has the fewest corners.
fn first_lane_start(planned: &CoveragePlan<'_>, begin: &Flat, end: &Flat) -> Point {
    match &planned.terrain_following {
        Some(following) => following.start_point(begin, end),
        None => Point::new(begin.x, begin.y, planned.area_settings.heights.max_picture_height_m),
    }
}

/// Corners of the straight leg from `from` to above `to`. The last is the point above `to`; over
/// level ground it is the only one.
fn leg_corners(planned: &CoveragePlan<'_>, from: &Point, to: &Flat) -> Vec<Point> {
    let mut corners = Vec::new();
    let Some(following) = &planned.terrain_following else {
        return vec![Point::new(to.x, to.y, from.z)];
    };
    let followed: Result<(), Infallible> = following.corners_to(from, to, |corner| {
        corners.push(corner);
        Ok(())
    });
    match followed {
        Ok(()) => corners,
        Err(never) => match never {},
    }
}

/// Appends the points along one lane: the pictures at `places` (waypoint number and place), and
/// between them the corners of `path`, which there are over terrain.
fn add_picture_points(
    planned: &CoveragePlan<'_>,
    path: &[Point],
    places: &[(u32, Flat)],
    lane: Option<u16>,
    points: &mut Vec<FlightPoint>,
) {
    let along_m = |place: &Flat| (place - path[0].xy()).norm();
    let by_waypoint = planned.area_settings.trigger == Trigger::Waypoint;
    let mut leg = 0;
    for (number, place) in places {
        let at_m = along_m(place);
        while leg + 2 < path.len() && along_m(&path[leg + 1].xy()) <= at_m + SAME_PLACE_M {
            leg += 1;
            let corner = path[leg];
            // With trigger by waypoint the point of the picture already stands for this corner.
            if !by_waypoint || (along_m(&corner.xy()) - at_m).abs() > SAME_PLACE_M {
                points.push(FlightPoint {
                    position: corner,
                    action: WaypointAction::AtLaneHeight,
                    lane,
                });
            }
        }
        let end = path[(leg + 1).min(path.len() - 1)];
        let length_m = (end - path[leg]).xy().norm();
        let share = if length_m > 0.0 {
            ((at_m - along_m(&path[leg].xy())) / length_m).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let height_m = path[leg].z + (end.z - path[leg].z) * share;
        let position = Point::new(place.x, place.y, height_m);
        points.push(FlightPoint { position, action: WaypointAction::Photo(*number), lane });
    }
}

/// Corners of the shortest path around no-fly zones between two points; empty for a straight path.
fn corners_around_no_fly_zones(
    planned: &CoveragePlan<'_>,
    from: &Flat,
    to: &Flat,
) -> Fixed<Flat, MAX_NO_FLY_CORNERS> {
    let mut corners = Fixed::new();
    // The planner found a finite length of the path between any two points of a plan, so this
    // never fails.
    if planned.transit.shortest_path(from, to, &mut corners).is_err() {
        corners.clear();
    }
    corners
}

/// Course from `from` to `to`, degrees clockwise from north, 0 to 360.
pub fn course_deg(from: &Point, to: &Point) -> f32 {
    (to.x - from.x).atan2(to.y - from.y).to_degrees().rem_euclid(360.0)
}

/// Time at which each point is passed, seconds after the departure: at cruise speed and the
/// vehicle's climb and descent speeds, without braking at corners.
pub fn passing_times_s(
    planned: &CoveragePlan<'_>,
    route: &Route,
    points: &[FlightPoint],
) -> Vec<f32> {
    let vehicle = &planned.vehicles[usize::from(route.vehicle_index)];
    let mut time_s = 0.0;
    let mut times = vec![time_s];
    for pair in points.windows(2) {
        let step = pair[1].position - pair[0].position;
        let vertical =
            if step.z > 0.0 { step.z / vehicle.climb_mps } else { -step.z / vehicle.descend_mps };
        time_s += step.xy().norm() / vehicle.cruise_mps + vertical;
        times.push(time_s);
    }
    times
}
