//! One vehicle's detour around another vehicle that is out of the plan and lies, stands or hovers
//! on the first one's path. Over a height field, where there is no roadmap,
//! [`crate::coverage::around`] plans the detour.
//!
//! A detour is flown while all other vehicles stand (`companion/src/replanning/detour.rs` waits for
//! that), so times do not matter. It is the shortest roadmap path from where the vehicle hovers to
//! its goal that keeps out of every [`KeepOutZone`]. It begins with the rest of the current leg,
//! forward or back, which is known to be clear of walls. A vehicle that is inside a zone already
//! may fly on, but not deeper into the zone. The column below a vehicle ends at the ground if the
//! roadmap has the ground's height there.
//!
//! ENU metres. Cost: two A* (to land aside: two Dijkstra searches), with each edge checked against
//! every [`KeepOutZone`]; and for each zone one pass over all nodes, for the ground's height.

use core::ops::Range;

use fpu::sqrtf;
use heapless::Vec;
use libm::{fmaxf, fminf};

use crate::flight::{Path, PathError, Task, VehiclePlan};
use crate::geo::distance::segments_distance_sq;
use crate::roadmap::search::{self, SearchError, SearchWorkspace};
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::{Length, Point, SettingError};

/// Sway of a hovering vehicle, metres: flying deeper into a zone by less than this is allowed.
const HOVER_SWAY_M: f32 = 0.05;
/// Rounding of a planned path, metres: flying deeper into a zone by less than this is allowed. The
/// safety filter ignores an approach of up to 0.003 m (`APPROACH_ROUNDING_M`).
const PATH_APPROACH_ROUNDING_M: f32 = 0.002;

/// Distance of centres at which two vehicles of 0.3 m radius touch, metres: a vehicle this near to
/// the axis of a zone has no distance left to keep, and only has to leave.
const TOUCHING_M: f32 = 0.6;

/// Greatest height of a vehicle's position above the ground on which it lies, metres: the radius of
/// its hull.
const MAX_LYING_HEIGHT_M: f32 = 0.3;

/// A capsule, or the column below a vehicle, that a detour keeps out of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeepOutZone {
    /// One end of the zone's axis, ENU metres in the mission frame.
    pub from: Point,
    /// The other end of the zone's axis.
    pub to: Point,
    /// Distance from the axis that is to be kept, metres.
    pub radius_m: f32,
    /// Reason for the zone, which decides what part of it is kept clear.
    pub kind: ZoneKind,
}

/// Reason for a keep-out zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZoneKind {
    /// Another vehicle may be anywhere along the axis: all of the zone is kept clear.
    Static,
    /// A vehicle at `from` that descends to `to`: a detour may cross the zone well below that
    /// vehicle, but may neither climb towards the vehicle nor land aside in the zone. Also a column
    /// above a vehicle, in which a detour must not land aside.
    LandingColumn,
    /// A vehicle on the ground below `from`: where the roadmap has the ground's height, only a
    /// column from the ground to the vehicle that lies on it is kept clear.
    Grounded,
}

impl KeepOutZone {
    /// Checks that both ends of the zone's axis are finite, and that its radius is finite and not
    /// negative; the error names the first that is not.
    pub fn check(&self) -> Result<(), SettingError> {
        check_finite("from", &self.from)?;
        check_finite("to", &self.to)?;
        check_not_negative("radius_m", self.radius_m)
    }

    /// If `here` is inside the zone, or outside by less than `nearer_m`: the zone with its radius
    /// reduced to the distance of `here` from the axis less `nearer_m`. So a vehicle that is too
    /// near already may still fly away.
    fn shrunk_to(&self, here: &Point, nearer_m: f32) -> Self {
        let now_sq = segments_distance_sq((here, here), (&self.from, &self.to));
        let far_m = self.radius_m + nearer_m;
        if now_sq >= far_m * far_m {
            return *self;
        }
        let now_m = sqrtf(now_sq);
        Self { radius_m: fminf(self.radius_m, fmaxf(now_m - nearer_m, 0.0)), ..*self }
    }

    /// The zone, ended at the ground if its axis leads down and the roadmap has the ground's
    /// height: a vehicle does not fall through a floor. For [`ZoneKind::Grounded`] the top of the
    /// axis is also moved down, to the highest position of a vehicle that lies on that ground.
    fn clipped_to_ground(&self, view: &RoadmapView<'_>) -> Self {
        let falls = self.to.z < self.from.z;
        let Some((low_m, high_m)) = view.ground_z_range_near(&self.from).filter(|_| falls) else {
            return *self;
        };
        let (mut from, mut to) = (self.from, self.to);
        to.z = fmaxf(to.z, low_m);
        if self.kind == ZoneKind::Grounded {
            from.z = fmaxf(fminf(high_m + MAX_LYING_HEIGHT_M, from.z), to.z);
        }
        Self { from, to, ..*self }
    }

    /// The part of the zone that may not be flown through: all of it, unless the zone is
    /// [`ZoneKind::LandingColumn`]. A descending vehicle and one that climbs as fast may meet half
    /// way, so only the lower third of the space between `here` and the zone around the vehicle
    /// above may be crossed. If that vehicle is higher than `here` by no more than the radius, the
    /// part is empty.
    pub(crate) fn impassable_part(&self, here: &Point) -> Self {
        if self.kind != ZoneKind::LandingColumn {
            return *self;
        }
        let room_m = self.from.z - here.z - self.radius_m;
        if room_m > 0.0 {
            let low_z = fmaxf(here.z + self.radius_m + room_m / 3.0, self.to.z);
            Self { to: Point::new(self.to.x, self.to.y, low_z), ..*self }
        } else {
            Self { radius_m: 0.0, ..*self }
        }
    }

    /// Whether a point is inside the zone.
    pub fn contains(&self, place: &Point) -> bool {
        self.intersects(place, place)
    }

    /// Whether the segment from `a` to `b` comes nearer to the zone's axis than the radius.
    pub(crate) fn intersects(&self, a: &Point, b: &Point) -> bool {
        // Most legs are apart from the zone along one axis alone, which is cheaper to check than a
        // distance.
        let sorted = |a: f32, b: f32| if a < b { (a, b) } else { (b, a) };
        let beside = |axis: usize| {
            let (low, high) = sorted(a[axis], b[axis]);
            let (least, most) = sorted(self.from[axis], self.to[axis]);
            high + self.radius_m < least || low - self.radius_m > most
        };
        !(0..3).any(beside) && self.is_within_radius(a, b)
    }

    /// As [`Self::intersects`], without the quick check along the axes.
    fn is_within_radius(&self, a: &Point, b: &Point) -> bool {
        segments_distance_sq((a, b), (&self.from, &self.to)) < self.radius_m * self.radius_m
    }
}

/// Bounding box of a zone, radius included, by which most legs are ruled out quickly.
struct ZoneBox {
    /// Least corner, ENU metres.
    low: Point,
    /// Greatest corner, ENU metres.
    high: Point,
}

impl ZoneBox {
    /// The box around a zone.
    fn of_zone(of: &KeepOutZone) -> Self {
        let (from, to) = (&of.from, &of.to);
        let radius = Point::repeat(of.radius_m);
        Self { low: from.inf(to) - radius, high: from.sup(to) + radius }
    }

    /// For each of the box's six faces a bit: whether the point is beyond that face. If two points
    /// are beyond the same face, the segment between them is outside the box.
    fn outcode(&self, p: &Point) -> u8 {
        let (low, high) = (&self.low, &self.high);
        u8::from(p.x < low.x)
            | u8::from(p.x > high.x) << 1
            | u8::from(p.y < low.y) << 2
            | u8::from(p.y > high.y) << 3
            | u8::from(p.z < low.z) << 4
            | u8::from(p.z > high.z) << 5
    }
}

/// Whether a path enters the zone between the two arc lengths of `ahead`: including the climb if
/// `ahead` begins below 0, and the descent if it ends beyond the path's length. A vehicle at `here`
/// that is inside the zone already is blocked only where the path leads deeper into it.
pub fn is_path_blocked<const W: usize>(
    path: &Path<W>,
    ahead: Range<f32>,
    climb_m: f32,
    descent_m: f32,
    here: &Point,
    obstacle: &KeepOutZone,
) -> bool {
    let (Some(first), Some(last)) = (path.waypoints().first(), path.waypoints().last()) else {
        return false;
    };
    let obstacle = obstacle.shrunk_to(here, HOVER_SWAY_M);
    let up = |height_m: f32| Point::new(0.0, 0.0, height_m);
    let (along_m, until_m) = (ahead.start, ahead.end);
    let climbs =
        along_m < 0.0 && obstacle.intersects(&(first.position - up(climb_m)), &first.position);
    let ground = last.position - up(descent_m);
    let next = count_waypoints_up_to(path, along_m);
    let descends = until_m > path.length_m() && obstacle.intersects(&last.position, &ground);
    if climbs || descends {
        return true;
    }
    let waypoints = &path.waypoints()[next.saturating_sub(1)..];
    let Some((begun, waypoints)) = waypoints.split_first() else { return false };
    let place = if along_m > begun.along_m { path.point_at(along_m) } else { Some(begun.position) };
    let mut from = place.unwrap_or(first.position);
    let room = ZoneBox::of_zone(&obstacle);
    let mut beside = room.outcode(&from);
    let mut from_m = fmaxf(along_m, begun.along_m);
    let mut touches = |to: Point| {
        let was_beside = core::mem::replace(&mut beside, room.outcode(&to));
        let leg = (core::mem::replace(&mut from, to), to);
        was_beside & beside == 0 && obstacle.is_within_radius(&leg.0, &leg.1)
    };
    for waypoint in waypoints {
        if from_m >= until_m {
            return false;
        }
        from_m = waypoint.along_m;
        let cut = if from_m > until_m { path.point_at(until_m) } else { None };
        if touches(cut.unwrap_or(waypoint.position)) {
            return true;
        }
    }
    false
}

/// Most segments that [`is_path_blocked`] checks: the legs ahead of an arc length, the climb and
/// the descent.
pub fn count_segments_ahead<const W: usize>(path: &Path<W>, along_m: f32) -> usize {
    path.waypoints().len() - count_waypoints_up_to(path, along_m) + 2
}

/// Number of waypoints at or before an arc length.
fn count_waypoints_up_to<const W: usize>(path: &Path<W>, along_m: f32) -> usize {
    path.waypoints().partition_point(|w| w.along_m <= along_m)
}

/// Target of a detour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DetourGoal {
    /// A goal of the roadmap, by its index among the goals (not its node index).
    RoadmapGoal(u16),
    /// In a coverage mission, without a roadmap: the vehicle's own pad, or the place where the
    /// vehicle rejoins its path.
    Point {
        /// Point at which the detour ends, above the pad or on the path, ENU metres in the mission
        /// frame.
        end: Point,
        /// Height of the layer in which the vehicle crosses the field, metres up in the mission
        /// frame.
        layer_z_m: f32,
    },
}

/// Request for a detour: where the vehicle hovers, where it has to go, and its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetourRequest {
    /// Whether the target is not `goal` but the nearest roadmap node (without a roadmap: free
    /// point) outside all zones, to land below it.
    pub land_aside: bool,
    /// Position where the vehicle hovers, on the leg `leg` or a little beside it.
    pub here: Point,
    /// Ends of the leg on which the vehicle hovers: roadmap nodes, except that one end may be where
    /// an earlier detour began.
    pub leg: [Point; 2],
    /// Clearance of the straight flight from `here` to either end of the leg, metres.
    pub leg_clearance_m: f32,
    /// Target of the detour.
    pub goal: DetourGoal,
    /// Height of the goal above the ground below it, metres.
    pub descent_m: f32,
    /// Vehicle radius + safety margin, metres: edges must have more clearance.
    pub required_clearance_m: f32,
    /// Lowest and highest corner of the volume that no leg may leave, ENU metres; `None` without a
    /// fence.
    pub fence: Option<(Point, Point)>,
}

impl DetourRequest {
    /// Whether a place is inside the fence or on one of its faces; true without a fence.
    pub(crate) fn is_inside_fence(&self, place: &Point) -> bool {
        self.fence
            .is_none_or(|(low, high)| (0..3).all(|a| place[a] >= low[a] && place[a] <= high[a]))
    }

    /// Checks that all positions are finite, and that height and clearances are finite and not
    /// negative; the error names the first that is not.
    pub fn check(&self) -> Result<(), SettingError> {
        check_finite("here", &self.here)?;
        check_finite("leg", &self.leg[0])?;
        check_finite("leg", &self.leg[1])?;
        if let DetourGoal::Point { end, layer_z_m } = &self.goal {
            check_finite("end", end)?;
            check_finite("layer_z_m", &Point::repeat(*layer_z_m))?;
        }
        if let Some((low, high)) = &self.fence {
            check_finite("fence", low)?;
            check_finite("fence", high)?;
        }
        check_not_negative("leg_clearance_m", self.leg_clearance_m)?;
        check_not_negative("descent_m", self.descent_m)?;
        check_not_negative("required_clearance_m", self.required_clearance_m)
    }
}

/// Refuses a position that is not finite, by the given name.
fn check_finite(name: &'static str, place: &Point) -> Result<(), SettingError> {
    if place.iter().all(|c| c.is_finite()) { Ok(()) } else { Err(SettingError(name)) }
}

/// Refuses a number that is negative, NaN or infinite, by the given name.
fn check_not_negative(name: &'static str, number: f32) -> Result<(), SettingError> {
    if number >= 0.0 && number.is_finite() { Ok(()) } else { Err(SettingError(name)) }
}

/// Reason why no detour was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DetourError {
    /// A number of the request or of a keep-out zone is out of range.
    Config(SettingError),
    /// The search of the roadmap found no path.
    Search(SearchError),
    /// The path has too many waypoints, or a coordinate that is not finite.
    Path(PathError),
    /// The goal, or the column below it, enters the impassable part of a keep-out zone.
    GoalBlocked,
}

/// Greatest length of the roadmap path from the end of the current leg to a landing place aside,
/// metres. Nodes at this straight distance from the vehicle, or further, are not flown to either.
const MAX_SIDESTEP_M: f32 = 20.0;

/// Writes the shortest path to the goal, or to a node aside, that keeps out of all `obstacles` to
/// `out`. Changes `obstacles`: zones end at the ground, and a zone that contains the vehicle is
/// shrunk unless it is [`ZoneKind::LandingColumn`]. `nodes` is scratch memory.
pub fn plan_detour<const N: usize, const W: usize>(
    view: &RoadmapView<'_>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    ws: &mut SearchWorkspace<N>,
    nodes: &mut Vec<u16, W>,
    out: &mut Path<W>,
) -> Result<(), DetourError> {
    request.check().map_err(DetourError::Config)?;
    obstacles.iter().try_for_each(KeepOutZone::check).map_err(DetourError::Config)?;
    let here = request.here;
    for obstacle in obstacles.iter_mut() {
        *obstacle = obstacle.clipped_to_ground(view);
    }
    shrink_zones(obstacles, &here);
    let clear = |a: &Point, b: &Point| {
        !obstacles.iter().any(|obstacle| obstacle.impassable_part(&here).intersects(a, b))
    };
    // The fence is a box, so only the ends of legs are checked. The first leg may begin outside,
    // where the vehicle has strayed.
    let free = |a: &Point, b: &Point| request.is_inside_fence(b) && clear(a, b);
    let DetourGoal::RoadmapGoal(number) = request.goal else {
        return Err(DetourError::Search(SearchError::NoPath));
    };
    let goal = view.header().start_count.saturating_add(number);
    if number >= view.header().goal_count {
        return Err(DetourError::Search(SearchError::BadNode(goal)));
    }
    let above = view.node(goal);
    if !request.land_aside && !clear(&above, &(above - Point::new(0.0, 0.0, request.descent_m))) {
        return Err(DetourError::GoalBlocked);
    }
    let passable = |from: u16, edge: &HalfEdge| {
        let to = view.node(edge.target);
        let near = !request.land_aside || (to - here).length() < MAX_SIDESTEP_M;
        near && view.has_clearance(edge, request.required_clearance_m)
            && free(&view.node(from), &to)
    };
    let mut search = |entry: u16, nodes: &mut Vec<u16, W>| {
        if !request.land_aside {
            return search::astar(view, entry, goal, passable, ws, nodes);
        }
        search::dijkstra_all(view, entry, passable, ws)?;
        let nearest = nearest_place_aside(view, obstacles, ws).ok_or(SearchError::NoPath)?;
        ws.path_to(nearest, nodes)?;
        Ok(ws.distance_m(nearest))
    };
    let mut best = f32::INFINITY;
    let mut failed = Err(DetourError::Search(SearchError::NoPath));
    for end in request.leg.iter().filter(|end| free(&here, end)) {
        let Some(entry) = (0..view.node_count() as u16).find(|&node| view.node(node) == *end)
        else {
            continue;
        };
        let length_m = match search(entry, nodes) {
            Ok(length_m) => length_m + (end - here).length(),
            Err(SearchError::NoPath) => continue,
            Err(error) => {
                failed = Err(DetourError::Search(error));
                continue;
            }
        };
        if length_m < best {
            best = length_m;
            failed = write_path(view, request, nodes, out).map_err(DetourError::Path);
        }
    }
    failed
}

/// Of the nodes outside all `obstacles` that the search in `ws` reached by a path shorter than
/// [`MAX_SIDESTEP_M`], the one with the shortest path.
fn nearest_place_aside<const N: usize>(
    view: &RoadmapView<'_>,
    obstacles: &[KeepOutZone],
    ws: &SearchWorkspace<N>,
) -> Option<u16> {
    let rest = |node: &u16| !obstacles.iter().any(|obstacle| obstacle.contains(&view.node(*node)));
    let reached =
        (0..view.node_count() as u16).filter(|&node| ws.distance_m(node) < MAX_SIDESTEP_M);
    reached.filter(rest).min_by(|&a, &b| ws.distance_m(a).total_cmp(&ws.distance_m(b)))
}

/// Shrinks each zone that contains the vehicle, so that the vehicle is just outside; zones of
/// landing columns are not changed.
pub(crate) fn shrink_zones(obstacles: &mut [KeepOutZone], here: &Point) {
    for obstacle in obstacles.iter_mut().filter(|zone| zone.kind != ZoneKind::LandingColumn) {
        let shrunk = obstacle.shrunk_to(here, PATH_APPROACH_ROUNDING_M);
        let is_inside = shrunk.radius_m < obstacle.radius_m;
        *obstacle = shrunk;
        if is_inside && obstacle.kind == ZoneKind::Static && obstacle.radius_m < TOUCHING_M {
            // The vehicle is almost on the axis, as it is below another one that comes down: every
            // path out may first lead nearer to the axis.
            obstacle.radius_m = 0.0;
        }
    }
}

/// As [`plan_detour`], written as a vehicle's plan: with plan CRC 0 and without gates, since all
/// other vehicles stand while the detour is flown.
pub fn plan_detour_for_vehicle<const N: usize, const W: usize, const G: usize>(
    view: &RoadmapView<'_>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    ws: &mut SearchWorkspace<N>,
    nodes: &mut Vec<u16, W>,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), DetourError> {
    plan_detour(view, request, obstacles, ws, nodes, &mut out.path)?;
    out.task = match request.goal {
        DetourGoal::RoadmapGoal(goal) => Task::Goto(goal),
        DetourGoal::Point { .. } => Task::Stay,
    };
    (out.climb_m, out.descent_m, out.depart_s) = (0.0, request.descent_m, 0.0);
    out.gates.clear();
    out.swarm_plan_crc = 0;
    Ok(())
}

/// Writes the path from the vehicle along `nodes`. The first leg has the clearance of the leg on
/// which the vehicle hovers, each other one that of its edge.
fn write_path<const W: usize>(
    view: &RoadmapView<'_>,
    request: &DetourRequest,
    nodes: &[u16],
    out: &mut Path<W>,
) -> Result<(), PathError> {
    *out = Path::new();
    out.push(request.here, request.leg_clearance_m)?;
    for (i, &node) in nodes.iter().enumerate() {
        let edge = i.checked_sub(1).and_then(|before| view.edge_between(nodes[before], node));
        out.push(view.node(node), edge.map_or(request.leg_clearance_m, |e| e.clearance_m))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
