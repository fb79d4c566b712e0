//! One vehicle's detour around a vehicle that left the plan and lies, stands or hovers off its
//! schedule. Over a field, where there is no roadmap, [`crate::coverage::around`] plans it.
//!
//! It is flown alone, while all others stand (`companion/src/swarm/detour.rs` waits for that), so
//! there is no time in it: the shortest path on the roadmap from where the vehicle hovers to its
//! goal that keeps clear of every [`KeepOutZone`]. It begins with the rest of the current leg,
//! forward or back, which is known to be clear of walls. Where the vehicle is nearer to something
//! already than it should be, it only comes no nearer. A column ends at the ground, as far as the
//! roadmap says where that is.
//!
//! ENU metres. Cost: two A*, each edge checked against every [`KeepOutZone`]; each of these against
//! every node.

use core::ops::Range;

use fpu::sqrtf;
use heapless::Vec;
use libm::{fmaxf, fminf};

use crate::flight::{Path, PathError, Task, VehiclePlan};
use crate::geometry::segments_distance_sq;
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::search::{self, SearchError, SearchWorkspace};
use crate::{ConfigError, Length, Point};

/// Sway of a hovering vehicle, metres: an approach by less than this is not counted as one.
const HOVER_SWAY_M: f32 = 0.05;
/// Rounding of a planned path, metres: an approach by less than this is not counted as one. The
/// safety filter allows no more.
const PATH_APPROACH_ROUNDING_M: f32 = 0.002;

/// A capsule or column that a detour keeps clear of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeepOutZone {
    /// One end of the zone's axis.
    pub from: Point,
    /// The other end.
    pub to: Point,
    /// Distance to keep, metres.
    pub radius_m: f32,
    /// Kind of the zone.
    pub kind: ZoneKind,
}

/// Kind of a keep-out zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZoneKind {
    /// A zone that may be occupied all along its axis.
    Static,
    /// A vehicle at `from` that descends to `to`: not to be rested below, nor flown up to.
    Descending,
    /// A vehicle on the ground below `from`: where the roadmap knows the ground, that place only is
    /// kept clear.
    Grounded,
}

impl KeepOutZone {
    /// Whether its ends are finite and its radius is finite and not negative; the error names the
    /// first that is not.
    pub fn check(&self) -> Result<(), ConfigError> {
        check_finite("from", &self.from)?;
        check_finite("to", &self.to)?;
        check_not_negative("radius_m", self.radius_m)
    }

    /// The zone, shrunk so that `here` is not inside it: a vehicle that is too near already may fly
    /// off.
    fn shrunk_to(&self, here: &Point, nearer_m: f32) -> Self {
        let now_sq = segments_distance_sq((here, here), (&self.from, &self.to));
        let far_m = self.radius_m + nearer_m;
        if now_sq >= far_m * far_m {
            return *self;
        }
        let now_m = sqrtf(now_sq);
        Self { radius_m: fminf(self.radius_m, fmaxf(now_m - nearer_m, 0.0)), ..*self }
    }

    /// The zone no deeper than the ground below it: a vehicle does not fall through a floor. A
    /// vehicle that lies is on the ground.
    fn clipped_to_ground(&self, view: &RoadmapView<'_>) -> Self {
        let falls = self.to.z < self.from.z;
        let Some((low_m, high_m)) = view.ground_range_near(&self.from).filter(|_| falls) else {
            return *self;
        };
        let (mut from, mut to) = (self.from, self.to);
        to.z = fmaxf(to.z, low_m);
        if self.kind == ZoneKind::Grounded {
            from.z = fmaxf(high_m, to.z);
        }
        Self { from, to, ..*self }
    }

    /// The part of the zone that may not be flown through. A vehicle that descends may be met half
    /// way by one that climbs as fast: of its column the lower third above `here` is left to cross.
    pub(crate) fn impassable_part(&self, here: &Point) -> Self {
        if self.kind != ZoneKind::Descending {
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

    /// Whether a place is inside the zone.
    pub fn contains(&self, place: &Point) -> bool {
        self.intersects(place, place)
    }

    pub(crate) fn intersects(&self, a: &Point, b: &Point) -> bool {
        // Most are apart along one axis alone, which is cheaper to see than a distance.
        let sorted = |a: f32, b: f32| if a < b { (a, b) } else { (b, a) };
        let beside = |axis: usize| {
            let (low, high) = sorted(a[axis], b[axis]);
            let (least, most) = sorted(self.from[axis], self.to[axis]);
            high + self.radius_m < least || low - self.radius_m > most
        };
        !(0..3).any(beside) && self.comes_near(a, b)
    }

    fn comes_near(&self, a: &Point, b: &Point) -> bool {
        segments_distance_sq((a, b), (&self.from, &self.to)) < self.radius_m * self.radius_m
    }
}

/// Bounding box of a zone, for a quick check of many legs: most legs are outside it.
struct BoundingBox {
    low: Point,
    high: Point,
}

impl BoundingBox {
    fn of_zone(of: &KeepOutZone) -> Self {
        let (from, to) = (&of.from, &of.to);
        let radius = Point::repeat(of.radius_m);
        Self { low: from.inf(to) - radius, high: from.sup(to) + radius }
    }

    /// Beyond which of its six sides a place is, a bit for each: what is between two places beyond
    /// the same side is too.
    fn outer_faces(&self, p: &Point) -> u8 {
        let (low, high) = (&self.low, &self.high);
        u8::from(p.x < low.x)
            | u8::from(p.x > high.x) << 1
            | u8::from(p.y < low.y) << 2
            | u8::from(p.y > high.y) << 3
            | u8::from(p.z < low.z) << 4
            | u8::from(p.z > high.z) << 5
    }
}

/// Whether a path between two arc lengths, `ahead`, comes too near: with the climb if that begins
/// before 0, and with the descent if it ends beyond the path. Nearer than `here`, where the vehicle
/// is, has to be: what it leaves is not in its way.
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
    let next = count_legs_begun(path, along_m);
    let descends = until_m > path.length_m() && obstacle.intersects(&last.position, &ground);
    if climbs || descends {
        return true;
    }
    let waypoints = &path.waypoints()[next.saturating_sub(1)..];
    let Some((begun, waypoints)) = waypoints.split_first() else { return false };
    let place = if along_m > begun.along_m { path.point_at(along_m) } else { Some(begun.position) };
    let mut from = place.unwrap_or(first.position);
    let room = BoundingBox::of_zone(&obstacle);
    let mut beside = room.outer_faces(&from);
    let mut from_m = fmaxf(along_m, begun.along_m);
    let mut touches = |to: Point| {
        let was_beside = core::mem::replace(&mut beside, room.outer_faces(&to));
        let leg = (core::mem::replace(&mut from, to), to);
        was_beside & beside == 0 && obstacle.comes_near(&leg.0, &leg.1)
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

/// Number of stretches that [`is_path_blocked`] checks: the legs ahead, the climb, the descent.
pub fn count_segments_ahead<const W: usize>(path: &Path<W>, along_m: f32) -> usize {
    path.waypoints().len() - count_legs_begun(path, along_m) + 2
}

/// Number of waypoints up to an arc length.
fn count_legs_begun<const W: usize>(path: &Path<W>, along_m: f32) -> usize {
    path.waypoints().partition_point(|w| w.along_m <= along_m)
}

/// Target of a detour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// A goal of the roadmap, by its index.
    Node(u16),
    /// Over a field, without a roadmap: to this place over the vehicle's pad.
    Home {
        /// The place.
        over: Point,
        /// Height of the layer in which the vehicle crosses the field, metres.
        layer_m: f32,
    },
}

/// The detour to plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetourRequest {
    /// Whether it is not the goal that is sought but the nearest node to rest at, away from all
    /// there is to keep off.
    pub aside: bool,
    /// Place where the vehicle hovers, on a leg whose ends follow.
    pub here: Point,
    /// The ends of that leg; nodes of the roadmap, but that one may be where an earlier detour
    /// began.
    pub leg: [Point; 2],
    /// Clearance of that leg, metres.
    pub leg_clearance_m: f32,
    /// Target of the detour.
    pub goal: Goal,
    /// Height of the goal over its ground, metres.
    pub descent_m: f32,
    /// Radius + safety margin, metres.
    pub required_clearance_m: f32,
    /// Lowest and highest corner of the volume that no leg over a field leaves, ENU metres.
    pub fence: Option<(Point, Point)>,
}

impl DetourRequest {
    /// Whether its places are finite, and its height and clearances are finite and not negative;
    /// the error names the first that is not.
    pub fn check(&self) -> Result<(), ConfigError> {
        check_finite("here", &self.here)?;
        check_finite("leg", &self.leg[0])?;
        check_finite("leg", &self.leg[1])?;
        if let Goal::Home { over, layer_m } = &self.goal {
            check_finite("over", over)?;
            check_finite("layer_m", &Point::repeat(*layer_m))?;
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

fn check_finite(name: &'static str, place: &Point) -> Result<(), ConfigError> {
    if place.iter().all(|c| c.is_finite()) { Ok(()) } else { Err(ConfigError(name)) }
}

fn check_not_negative(name: &'static str, number: f32) -> Result<(), ConfigError> {
    if number >= 0.0 && number.is_finite() { Ok(()) } else { Err(ConfigError(name)) }
}

/// Reason why no detour was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DetourError {
    /// The request, or something to keep off, holds a number that it may not.
    Config(ConfigError),
    /// The search found none.
    Search(SearchError),
    /// The path was refused.
    Path(PathError),
    /// The goal, or the column below it, is too near something.
    GoalBlocked,
}

/// Greatest length of a path to a landing place aside, and greatest distance of that place, metres.
const MAX_SIDESTEP_M: f32 = 20.0;

/// The shortest path to the goal, or aside, that keeps clear of all `obstacles`, written to `out`.
/// Of an obstacle that is nearer already the distance is shortened; `nodes` is scratch.
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
    let Goal::Node(number) = request.goal else {
        return Err(DetourError::Search(SearchError::NoPath));
    };
    let goal = view.header().starts.saturating_add(number);
    if number >= view.header().goals {
        return Err(DetourError::Search(SearchError::BadNode(goal)));
    }
    let above = view.node(goal);
    if !request.aside && !clear(&above, &(above - Point::new(0.0, 0.0, request.descent_m))) {
        return Err(DetourError::GoalBlocked);
    }
    let passable = |from: u16, edge: &HalfEdge| {
        let to = view.node(edge.target);
        let near = !request.aside || (to - here).length() < MAX_SIDESTEP_M;
        near && view.has_clearance(edge, request.required_clearance_m)
            && clear(&view.node(from), &to)
    };
    let mut search = |entry: u16, nodes: &mut Vec<u16, W>| {
        if !request.aside {
            return search::astar(view, entry, goal, passable, ws, nodes);
        }
        search::dijkstra_all(view, entry, passable, ws)?;
        let nearest = nearest_place_aside(view, obstacles, ws).ok_or(SearchError::NoPath)?;
        ws.path_to(nearest, nodes)?;
        Ok(ws.distance_m(nearest))
    };
    let mut best = f32::INFINITY;
    let mut failed = Err(DetourError::Search(SearchError::NoPath));
    for end in request.leg.iter().filter(|end| clear(&here, end)) {
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

/// The nearest node that was reached and that no obstacle takes.
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

/// Shrinks each zone that already contains the vehicle, so that the vehicle is on its border.
pub(crate) fn shrink_zones(obstacles: &mut [KeepOutZone], here: &Point) {
    for obstacle in obstacles.iter_mut().filter(|obstacle| obstacle.kind != ZoneKind::Descending) {
        *obstacle = obstacle.shrunk_to(here, PATH_APPROACH_ROUNDING_M);
    }
}

/// As [`plan_detour`], as the plan of one vehicle: without gates, since all others stand while it
/// is flown.
pub fn plan_vehicle_detour<const N: usize, const W: usize, const G: usize>(
    view: &RoadmapView<'_>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    ws: &mut SearchWorkspace<N>,
    nodes: &mut Vec<u16, W>,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), DetourError> {
    plan_detour(view, request, obstacles, ws, nodes, &mut out.path)?;
    out.task = match request.goal {
        Goal::Node(goal) => Task::Goto(goal),
        Goal::Home { .. } => Task::Stay,
    };
    (out.climb_m, out.descent_m, out.depart_s) = (0.0, request.descent_m, 0.0);
    out.gates.clear();
    out.plan_crc = 0;
    Ok(())
}

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
