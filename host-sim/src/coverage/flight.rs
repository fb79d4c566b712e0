//! The flight of one vehicle: up to its layer, over to the first waypoint, down, along the lanes, up, home, down.
//!
//! Metres, ENU in the mission frame. The height of the pictures is above the mission's origin.

use heapless::Vec as Fixed;
use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::coverage::pack::Route;

use super::{CORNERS, Planned};

/// What a vehicle does at a point of its flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// It stands on its pad.
    Pad,
    /// It passes in its layer.
    Transit,
    /// It comes down to the lanes, or is about to leave them; no picture.
    Lane,
    /// It takes a picture: the waypoint of this number.
    Photo(u32),
}

/// A point of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Where.
    pub position: Point,
    /// What happens there.
    pub act: Act,
    /// The lane it lies on, where it does.
    pub lane: Option<u16>,
}

/// The whole flight of a route, from pad to pad.
pub fn stops(planned: &Planned<'_>, route: &Route) -> Vec<Stop> {
    let (vehicle, pad) = {
        let index = usize::from(route.vehicle);
        (&planned.vehicles[index], planned.scenario.vehicles[index].start)
    };
    let heights = planned.wanted.heights;
    let layer_m = heights.mission_m + f32::from(route.layer) * heights.layer_m;
    let at = |place: &Flat, height_m: f32| Point::new(place.x, place.y, height_m);
    let stop = |position: Point, act: Act| Stop { position, act, lane: None };
    let (first, last) = route.ends();
    let ends = [first, last].map(|number| planned.tracks.waypoint(number).unwrap_or(vehicle.place));
    let mut stops = vec![stop(pad, Act::Pad), stop(at(&vehicle.place, layer_m), Act::Transit)];
    stops.extend(
        corners(planned, &vehicle.place, &ends[0]).iter().map(|c| stop(at(c, layer_m), Act::Transit)),
    );
    stops.push(stop(at(&ends[0], layer_m), Act::Transit));
    let mut before: Option<(usize, Flat)> = None;
    for number in route.waypoints() {
        let lane = planned.tracks.lane_of(number);
        let Some(place) = planned.tracks.waypoint(number) else { continue };
        if let Some((_, from)) = before.filter(|(other, _)| *other != lane) {
            let around = corners(planned, &from, &place);
            stops.extend(around.iter().map(|c| stop(at(c, heights.mission_m), Act::Lane)));
        }
        let position = at(&place, heights.mission_m);
        stops.push(Stop { position, act: Act::Photo(number), lane: Some(lane as u16) });
        before = Some((lane, place));
    }
    stops.push(stop(at(&ends[1], layer_m), Act::Transit));
    stops
        .extend(corners(planned, &ends[1], &vehicle.home).iter().map(|c| stop(at(c, layer_m), Act::Transit)));
    stops.push(stop(at(&vehicle.home, layer_m), Act::Transit));
    stops.push(stop(Point::new(vehicle.home.x, vehicle.home.y, pad.z), Act::Pad));
    stops
}

/// The corners of the way between two places.
fn corners(planned: &Planned<'_>, from: &Flat, to: &Flat) -> Fixed<Flat, CORNERS> {
    let mut corners = Fixed::new();
    // The plan has a finite length, so there is a way between all that it joins.
    if planned.transit.way(from, to, &mut corners).is_err() {
        corners.clear();
    }
    corners
}

/// Where a vehicle looks on a lane, degrees from north to the right, if it flies from `from` to `to`: the way it flies, or
/// one of the two along the lanes.
pub fn heading_deg(from: &Point, to: &Point) -> f32 {
    (to.x - from.x).atan2(to.y - from.y).to_degrees().rem_euclid(360.0)
}

/// Times at which each stop is passed, seconds from the start: at cruise speed, without turns.
pub fn times_s(planned: &Planned<'_>, route: &Route, stops: &[Stop]) -> Vec<f32> {
    let vehicle = &planned.vehicles[usize::from(route.vehicle)];
    let mut time_s = 0.0;
    let mut times = vec![time_s];
    for pair in stops.windows(2) {
        let step = pair[1].position - pair[0].position;
        let vertical = if step.z > 0.0 { step.z / vehicle.climb_mps } else { -step.z / vehicle.descend_mps };
        time_s += step.xy().norm() / vehicle.cruise_mps + vertical;
        times.push(time_s);
    }
    times
}
