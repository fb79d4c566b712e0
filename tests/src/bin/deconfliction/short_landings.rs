//! Finds out why a vehicle without a fault landed short of its goal: by true positions, on the map,
//! with a search of its own.
//!
//! The search joins points of a lattice if the map leaves the vehicle its required clearance
//! between them (its hull where it begins), and every other vehicle is further away than the safety
//! distance and [`DEVIATION_M`], a place where a silent one may lie than the safety distance and
//! [`SILENT_DEVIATION_M`]. It uses neither the roadmap nor the companion.

use std::collections::VecDeque;
use std::fmt;

use host_sim::mission::{HostPlan, PreparedMission};
use host_sim::swarm::SwarmFlight;
use planner_core::Point;
use planner_core::map::segment::segment_is_clear;
use serde::Serialize;

/// Distance of neighbouring lattice points, metres.
const LATTICE_M: f32 = 0.5;
/// Radius of a vehicle's hull, metres.
const HULL_RADIUS_M: f32 = 0.3;
/// Distance within which both ends of the path are joined to lattice points, metres.
const JOIN_WITHIN_M: f32 = 1.0;
/// Height above its final position from which on a vehicle counts as in the air, metres.
const ALOFT_M: f32 = 1.0;
/// How far along its path a vehicle whose radio fails comes to rest at most, metres.
const MAX_REST_STRETCH_M: f32 = 4.6;
/// For the least way that such a vehicle makes, the shorter of a stop and a fall: time for which it
/// flies on before the hardest stop, seconds, that stop, m/s², and the least time in which one
/// without power falls to the ground, seconds.
const MIN_FLY_ON_S: f32 = 0.3;
const MAX_STOP_MPS2: f32 = 3.0;
const MIN_FALL_S: f32 = 0.6;
/// Time between two positions that a vehicle reports, seconds: so old may be the last one that the
/// others heard.
const REPORTED_EVERY_S: f32 = 0.2;
/// Time over which the speed of a vehicle that falls silent is measured, seconds.
const SPEED_OVER_S: f32 = 0.5;
/// Distance kept from a vehicle that lies or stands beyond the safety distance, metres: a vehicle
/// that flies by may deviate so far from its path.
const DEVIATION_M: f32 = 0.25;
/// Distance kept from the stretch where a silent vehicle may lie, beyond the safety distance,
/// metres.
const SILENT_DEVIATION_M: f32 = 0.4;
/// Spacing of the points of the path that a silent vehicle's positions are compared with, metres.
const PATH_SAMPLE_M: f32 = 0.05;
/// Spacing of the points at which a silent vehicle may lie, metres.
const REST_PLACE_SPACING_M: f32 = 0.5;

/// What kept a vehicle from its goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum Cause {
    /// The struck vehicle lies at the goal of the vehicle that landed short.
    AtGoal,
    /// The struck vehicle lies on the only route to the goal.
    OnlyRoute,
    /// The struck vehicle was silent, and as far as others can know it may lie at the goal.
    MayBeAtGoal,
    /// The struck vehicle was silent, and as far as others can know it may lie on the only route.
    MayBeOnRoute,
    /// Vehicles that lie or stand block every route, even without the struck one.
    Others,
    /// A route was free: nothing kept the vehicle from its goal.
    RouteFree,
}

impl Cause {
    /// All causes, in the order of their numbers.
    pub const ALL: [Self; 6] = [
        Self::AtGoal,
        Self::OnlyRoute,
        Self::MayBeAtGoal,
        Self::MayBeOnRoute,
        Self::Others,
        Self::RouteFree,
    ];
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AtGoal => "struck vehicle at the goal",
            Self::OnlyRoute => "struck vehicle on the only route",
            Self::MayBeAtGoal => "struck vehicle, silent, may lie at the goal",
            Self::MayBeOnRoute => "struck vehicle, silent, may lie on the only route",
            Self::Others => "others on the only route",
            Self::RouteFree => "a way was left",
        })
    }
}

/// The vehicle that a fault struck.
#[derive(Clone, Copy, Debug)]
pub struct Struck {
    /// Its index in the order of the scenario.
    pub index: usize,
    /// When the fault struck, seconds of simulated time.
    pub at_s: f32,
    /// Whether no other vehicle hears it from then on.
    pub silent: bool,
}

/// Why vehicle `held` landed short of its goal.
pub fn cause_of_short_landing(
    mission: &PreparedMission,
    plan: &HostPlan,
    flight: &SwarmFlight,
    struck: Struck,
    held: usize,
) -> Cause {
    let safety_m = mission.scenario.deconfliction.safety_distance_m;
    let apart_m = safety_m + DEVIATION_M;
    let Some((left_s, from)) = start_of_last_descent(&flight.tracks[held]) else {
        return Cause::RouteFree;
    };
    let path = &plan.flights[held].path;
    let Some(over) = path.waypoints().last().map(|w| w.position) else { return Cause::RouteFree };
    let ground = over - Point::new(0.0, 0.0, plan.flights[held].descent_m);
    // A vehicle that never took off would have begun its path at the top of its climb.
    let from = if was_airborne(&flight.tracks[held]) { from } else { path.waypoints()[0].position };
    let others: Vec<KeepOutBall> = (0..flight.tracks.len())
        .filter(|i| *i != held && *i != struck.index)
        .filter_map(|i| first_place_since(&flight.tracks[i], left_s))
        .map(|place| (place, apart_m))
        .collect();
    let lies = flight.tracks[struck.index].last().map(|(_, place)| (*place, apart_m));
    let search = PathSearch {
        mission,
        required_m: mission.tasks[held].required_clearance_m,
        from,
        over,
        ground,
    };
    if !search.finds_path(&others) {
        return Cause::Others;
    }
    let known = [lies].into_iter().flatten().collect::<Vec<_>>();
    let with = |more: &[KeepOutBall]| others.iter().chain(more).copied().collect::<Vec<_>>();
    if search.is_goal_blocked(&known) {
        return Cause::AtGoal;
    }
    if !search.finds_path(&with(&known)) {
        return Cause::OnlyRoute;
    }
    let may = if struck.silent {
        possible_rest_places(plan, flight, struck, safety_m + SILENT_DEVIATION_M)
    } else {
        Vec::new()
    };
    if search.is_goal_blocked(&may) {
        return Cause::MayBeAtGoal;
    }
    if search.finds_path(&with(&may)) { Cause::RouteFree } else { Cause::MayBeOnRoute }
}

/// A point, and the distance to keep from it, metres.
type KeepOutBall = (Point, f32);

/// Whether a vehicle was in the air at any time.
fn was_airborne(track: &[(f32, Point)]) -> bool {
    let lowest_m = track.iter().map(|(_, place)| place.z).fold(f32::INFINITY, f32::min);
    track.iter().any(|(_, place)| place.z > lowest_m + ALOFT_M)
}

/// When a vehicle that landed short began its last descent, and where; its last point if it never
/// rose.
fn start_of_last_descent(track: &[(f32, Point)]) -> Option<(f32, Point)> {
    let (_, rest) = track.last()?;
    track.iter().rev().find(|(_, place)| place.z > rest.z + ALOFT_M).or(track.last()).copied()
}

/// Place of the first sample at this time or later, or of the last sample.
fn first_place_since(track: &[(f32, Point)], t_s: f32) -> Option<Point> {
    let after = track.partition_point(|(at_s, _)| *at_s < t_s);
    track.get(after).or(track.last()).map(|(_, place)| *place)
}

/// Place at this time, on the line between two samples; that of the last sample afterwards.
fn place_at(track: &[(f32, Point)], t_s: f32) -> Option<Point> {
    let after = track.partition_point(|(at_s, _)| *at_s < t_s);
    let [(from_s, from), (to_s, to)] = match (after.checked_sub(1), track.get(after)) {
        (Some(before), Some(next)) => [track[before], *next],
        (None, Some(first)) => return Some(first.1),
        (_, None) => return track.last().map(|(_, place)| *place),
    };
    Some(from + (to - from) * ((t_s - from_s) / (to_s - from_s)))
}

/// How far a silent vehicle lies beside its path, and how far along its path from where its radio
/// failed, metres. `None` without a track or a path.
pub fn rest_offsets_m(plan: &HostPlan, flight: &SwarmFlight, struck: Struck) -> Option<[f32; 2]> {
    let track = &flight.tracks[struck.index];
    let path = &plan.flights[struck.index].path;
    let (_, rest) = track.last()?;
    let heard = first_place_since(track, struck.at_s)?;
    let steps = (path.length_m() / PATH_SAMPLE_M) as usize;
    let nearest = |to: &Point| {
        let away = |m: f32| Some((m, (path.point_at(m)? - to).xy().norm()));
        let all = (0..=steps).filter_map(|i| away(i as f32 * PATH_SAMPLE_M));
        all.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (rest, heard) = (nearest(rest)?, nearest(&heard)?);
    Some([rest.1, rest.0 - heard.0])
}

/// Points on the ground below the path at which the vehicle may have come to rest, by where it was
/// last heard, and how fast.
fn possible_rest_places(
    plan: &HostPlan,
    flight: &SwarmFlight,
    struck: Struck,
    radius_m: f32,
) -> Vec<KeepOutBall> {
    let track = &flight.tracks[struck.index];
    let path = &plan.flights[struck.index].path;
    let heard = place_at(track, struck.at_s - REPORTED_EVERY_S);
    let (Some(heard), Some((_, rest))) = (heard, track.last()) else {
        return Vec::new();
    };
    let steps = (path.length_m() / PATH_SAMPLE_M) as usize;
    let nearest = (0..=steps)
        .map(|i| i as f32 * PATH_SAMPLE_M)
        .filter_map(|m| Some((m, (path.point_at(m)? - heard).norm())))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0.0, |(m, _)| m);
    let before = place_at(track, struck.at_s - REPORTED_EVERY_S - SPEED_OVER_S);
    let before = before.unwrap_or(heard);
    let speed_mps = (heard - before).xy().norm() / SPEED_OVER_S;
    let flies_s = MIN_FLY_ON_S + speed_mps / (2.0 * MAX_STOP_MPS2);
    let least_m = speed_mps * flies_s.min(MIN_FALL_S);
    (0..=(MAX_REST_STRETCH_M / REST_PLACE_SPACING_M) as usize)
        .map(|i| least_m + i as f32 * REST_PLACE_SPACING_M)
        .filter(|m| *m < MAX_REST_STRETCH_M)
        .chain([MAX_REST_STRETCH_M])
        .filter_map(|m| path.point_at(nearest + m))
        .map(|place| (Point::new(place.x, place.y, rest.z), radius_m))
        .collect()
}

/// A search for a path from `from` to `over`, with a descent from there to `ground`.
struct PathSearch<'a> {
    mission: &'a PreparedMission,
    /// Clearance that the path needs, metres.
    required_m: f32,
    from: Point,
    over: Point,
    ground: Point,
}

impl PathSearch<'_> {
    /// Whether the descent from `over` to `ground` enters a ball.
    fn is_goal_blocked(&self, balls: &[KeepOutBall]) -> bool {
        !keeps_out_of_balls(&self.over, &self.ground, balls)
    }

    /// Whether there is a path outside all balls.
    fn finds_path(&self, balls: &[KeepOutBall]) -> bool {
        if self.is_goal_blocked(balls) {
            return false;
        }
        // From an obstacle that is too near already, the vehicle may fly away.
        let here = |&(place, radius_m): &KeepOutBall| {
            (place, radius_m.min((place - self.from).norm() - 1e-3))
        };
        let balls: Vec<KeepOutBall> = balls.iter().map(here).collect();
        let grid = self.mission.map.grid();
        let free = |a: &Point, b: &Point| {
            segment_is_clear(&grid, a, b, self.required_m) && keeps_out_of_balls(a, b, &balls)
        };
        // A vehicle that has drifted towards a wall may fly away from it.
        let leaves = |to: &Point| {
            segment_is_clear(&grid, &self.from, to, HULL_RADIUS_M)
                && keeps_out_of_balls(&self.from, to, &balls)
        };
        let shape = self.mission.map.shape;
        let extent = shape.max() - shape.min;
        let sizes = [extent.x, extent.y, extent.z].map(|m| (m / LATTICE_M) as usize + 1);
        let at = |[i, j, k]: [usize; 3]| {
            shape.min + Point::new(i as f32, j as f32, k as f32) * LATTICE_M
        };
        let index = |[i, j, k]: [usize; 3]| (k * sizes[1] + j) * sizes[0] + i;
        let mut seen = vec![false; sizes.iter().product()];
        let mut queue = VecDeque::new();
        for i in 0..sizes[0] {
            for j in 0..sizes[1] {
                for k in 0..sizes[2] {
                    let place = at([i, j, k]);
                    if (place - self.from).norm() < JOIN_WITHIN_M
                        && leaves(&place)
                        && free(&place, &place)
                    {
                        seen[index([i, j, k])] = true;
                        queue.push_back([i, j, k]);
                    }
                }
            }
        }
        while let Some(cell) = queue.pop_front() {
            let place = at(cell);
            if (place - self.over).norm() < JOIN_WITHIN_M && free(&place, &self.over) {
                return true;
            }
            for step in 0..27_usize {
                let offsets = [step % 3, step / 3 % 3, step / 9];
                let next: [usize; 3] =
                    std::array::from_fn(|a| (cell[a] + offsets[a]).wrapping_sub(1));
                if (0..3).all(|a| next[a] < sizes[a])
                    && !seen[index(next)]
                    && free(&place, &at(next))
                {
                    seen[index(next)] = true;
                    queue.push_back(next);
                }
            }
        }
        false
    }
}

/// Whether the segment from `a` to `b` stays outside all balls.
fn keeps_out_of_balls(a: &Point, b: &Point, balls: &[KeepOutBall]) -> bool {
    let leg = b - a;
    balls.iter().all(|(place, radius_m)| {
        let share = ((place - a).dot(&leg) / leg.norm_squared().max(1e-9)).clamp(0.0, 1.0);
        (a + leg * share - place).norm() >= *radius_m
    })
}
