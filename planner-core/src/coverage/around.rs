//! One vehicle's detour over level ground or a height field, without a roadmap: home, or to a place
//! aside to land there. It leads around no-fly zones and vehicles that are out of the plan.
//!
//! Home: the path leads vertically to the vehicle's own layer, in the layer on the shortest path to
//! above its pad, and down. Obstacles in the layer are flown around: a visibility graph over the
//! zones' corners ([`TransitGraph::corners`]) and eight corners around each end of every
//! [`KeepOutZone`] that reaches the layer is searched by A*. Legs stay above terrain. If there is
//! no path in the layer, the same is tried at the height at which the vehicle hovers. Aside: the
//! path leads straight to the nearest free point on rings around the vehicle.
//!
//! No leg ends outside the request's fence. ENU metres. Cost for n nodes: at most n² / 2 visibility
//! checks, each against all edges of zones and all [`KeepOutZone`]s.

use heapless::Vec;
use libm::{ceilf, cosf, fabsf, fminf, sinf};

use super::Flat;
use super::transit::TransitGraph;
use crate::detour::{self, DetourError, DetourGoal, DetourRequest, KeepOutZone};
use crate::flight::{Path, PathError, Task, VehiclePlan};
use crate::map::field::FieldView;
use crate::roadmap::search::SearchError;
use crate::{Length, Point};

/// Most nodes of the visibility graph.
const MAX_GRAPH_NODES: usize = 320;
/// Corners around each end of a keep-out zone's axis.
const CORNERS_PER_END: usize = 8;
/// Distance of the corners from the zone's axis, as a multiple of its radius: the line between two
/// neighbouring corners still stays outside the radius.
const CORNER_RADIUS_FACTOR: f32 = 1.09;
/// Distance added to the corners' distance from the axis, against rounding, metres.
const CORNER_ROUNDING_M: f32 = 0.05;
/// Points nearer than this count as one, metres.
const SAME_CORNER_M: f32 = 0.01;
/// Most height samples of one leg: on a longer leg the samples are further apart.
const MAX_LEG_SAMPLES: f32 = 65_536.0;
/// Least height of a leg above the field, metres; vertical legs are exempt.
const MIN_HEIGHT_OVER_FIELD_M: f32 = 1.5;
/// Number of rings, a metre apart, around the vehicle on which a place aside is sought.
const MAX_SIDESTEP_RINGS: usize = 20;
/// Number of directions on each ring in which a place aside is sought.
const SIDESTEP_DIRECTIONS: usize = 16;

/// Fence, no-fly zones, terrain and keep-out zones that legs have to respect.
struct LegConstraints<'a, 't, const N: usize> {
    /// The area's no-fly zones, and the ways around them.
    transit: &'a TransitGraph<'t, N>,
    /// Heights of the ground; `None` if it is level.
    field: Option<FieldView<'a>>,
    /// Keep-out zones.
    obstacles: &'a [KeepOutZone],
    /// The detour that is sought, with the fence.
    request: &'a DetourRequest,
}

impl<const N: usize> LegConstraints<'_, '_, N> {
    /// Whether the leg from `a` to `b` ends inside the fence, stays above terrain, and enters
    /// neither no-fly zones nor keep-out zones.
    fn is_leg_free(&self, a: &Point, b: &Point) -> bool {
        let touches =
            |obstacle: &KeepOutZone| obstacle.impassable_part(&self.request.here).intersects(a, b);
        // The fence is a box, so a leg between two points inside is inside. Only the leg's end is
        // checked: the vehicle, where the first leg begins, may have strayed outside.
        self.request.is_inside_fence(b)
            && self.transit.is_line_clear(&a.xy(), &b.xy())
            && self.is_above_field(a, b)
            && !self.obstacles.iter().any(touches)
    }

    /// Whether a leg keeps [`MIN_HEIGHT_OVER_FIELD_M`] above the height field, at samples half a
    /// node spacing apart.
    fn is_above_field(&self, a: &Point, b: &Point) -> bool {
        let (Some(field), step) = (&self.field, b - a) else { return true };
        let length_m = step.xy().length();
        if length_m < SAME_CORNER_M {
            return true;
        }
        let count = fminf(ceilf(2.0 * length_m / field.shape().cell_m), MAX_LEG_SAMPLES) as u32;
        (0..=count).all(|sample| {
            let place = a + step * (sample as f32 / count as f32);
            place.z >= field.height_at(&place.xy()) + MIN_HEIGHT_OVER_FIELD_M
        })
    }
}

/// Writes a path to `out`: to the goal ([`DetourGoal::Point`]), or, with
/// [`DetourRequest::land_aside`], to a point aside. The path keeps out of all `obstacles` and of
/// the no-fly zones of `transit`, and stays above the field. An obstacle that already contains the
/// vehicle is shrunk, unless it is a descending vehicle's.
///
/// # Errors
/// The reason why there is no such path.
pub fn plan_detour<const N: usize, const W: usize>(
    transit: &TransitGraph<'_, N>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    out: &mut Path<W>,
) -> Result<(), DetourError> {
    request.check().map_err(DetourError::Config)?;
    obstacles.iter().try_for_each(KeepOutZone::check).map_err(DetourError::Config)?;
    let DetourGoal::Point { end: over, layer_z_m: layer_m } = request.goal else {
        return Err(DetourError::Search(SearchError::NoPath));
    };
    detour::shrink_zones(obstacles, &request.here);
    let clear = LegConstraints { transit, field, obstacles, request };
    let from = |points: &[Point], out: &mut Path<W>| {
        write_path(request, points, out).map_err(DetourError::Path)
    };
    if request.land_aside {
        let place =
            nearest_reachable_place(&clear).ok_or(DetourError::Search(SearchError::NoPath))?;
        return from(&[place], out);
    }
    let mut graph = VisibilityGraph::EMPTY;
    for height_m in [layer_m, request.here.z] {
        let level = |place: &Point| Point::new(place.x, place.y, height_m);
        let (up, down) = (level(&request.here), level(&over));
        if !clear.is_leg_free(&request.here, &up) {
            continue;
        }
        if !clear.is_leg_free(&down, &over) {
            return Err(DetourError::GoalBlocked);
        }
        let mut points = Vec::<Point, W>::new();
        if graph.find_shortest_path(&clear, &up, &down, &mut points)? {
            points.push(over).map_err(|_| DetourError::Path(PathError::PathFull))?;
            return from(&points, out);
        }
    }
    Err(DetourError::Search(SearchError::NoPath))
}

/// As [`plan_detour`], written as the plan of one vehicle that leaves the shared plan: a path with
/// a descent at its end, without gates.
///
/// # Errors
/// The reason why there is no such path.
pub fn plan_detour_for_vehicle<const N: usize, const W: usize, const G: usize>(
    transit: &TransitGraph<'_, N>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    out: &mut VehiclePlan<W, G>,
) -> Result<(), DetourError> {
    plan_detour(transit, field, request, obstacles, &mut out.path)?;
    out.task = Task::Goto(0);
    (out.climb_m, out.descent_m, out.depart_s) = (0.0, request.descent_m, 0.0);
    out.gates.clear();
    out.swarm_plan_crc = 0;
    Ok(())
}

/// The nearest point on the rings around the vehicle, at its height, that is outside all zones and
/// reached by a free straight leg; `None` if there is none.
fn nearest_reachable_place<const N: usize>(clear: &LegConstraints<'_, '_, N>) -> Option<Point> {
    let here = clear.request.here;
    let step = core::f32::consts::TAU / SIDESTEP_DIRECTIONS as f32;
    let place = |i: usize| {
        let (far_m, angle) =
            ((i / SIDESTEP_DIRECTIONS + 1) as f32, (i % SIDESTEP_DIRECTIONS) as f32 * step);
        here + Point::new(cosf(angle), sinf(angle), 0.0) * far_m
    };
    let rests = |place: &Point| {
        !clear.transit.is_in_no_fly_zone(&place.xy())
            && !clear.obstacles.iter().any(|obstacle| obstacle.contains(place))
    };
    (0..MAX_SIDESTEP_RINGS * SIDESTEP_DIRECTIONS)
        .map(place)
        .find(|place| rests(place) && clear.is_leg_free(&here, place))
}

/// Nodes at one height, and the state of the search for the shortest path from the first to the
/// second.
struct VisibilityGraph {
    /// Places of the nodes, metres in the mission frame.
    nodes: Vec<Flat, MAX_GRAPH_NODES>,
    /// Length of the shortest path so far from the start to each node, metres.
    distance_m: [f32; MAX_GRAPH_NODES],
    /// For each node, the index of the one before it on that path.
    previous: [u16; MAX_GRAPH_NODES],
    /// Whether that path is the shortest of all.
    settled: [bool; MAX_GRAPH_NODES],
}

impl VisibilityGraph {
    /// A graph without nodes.
    const EMPTY: Self = Self {
        nodes: Vec::new(),
        distance_m: [0.0; MAX_GRAPH_NODES],
        previous: [0; MAX_GRAPH_NODES],
        settled: [false; MAX_GRAPH_NODES],
    };

    /// Searches the shortest path between two points of the same height, and writes its points to
    /// `points`, both ends included. Returns false if there is none.
    fn find_shortest_path<const N: usize, const W: usize>(
        &mut self,
        clear: &LegConstraints<'_, '_, N>,
        from: &Point,
        to: &Point,
        points: &mut Vec<Point, W>,
    ) -> Result<bool, DetourError> {
        /// Index of the path's start in the visibility graph.
        const START_NODE: usize = 0;
        /// Index of the path's end in the visibility graph.
        const END_NODE: usize = 1;
        let height_m = from.z;
        self.collect_nodes(clear, from, to);
        let level = |place: &Flat| Point::new(place.x, place.y, height_m);
        self.distance_m.fill(f32::INFINITY);
        self.settled.fill(false);
        self.distance_m[START_NODE] = 0.0;
        loop {
            let open = (0..self.nodes.len())
                .filter(|&i| !self.settled[i] && self.distance_m[i].is_finite());
            let whole = |i: usize| self.distance_m[i] + (self.nodes[i] - to.xy()).length();
            let Some(next) = open.min_by(|&a, &b| whole(a).total_cmp(&whole(b))) else {
                return Ok(false);
            };
            if next == END_NODE {
                break;
            }
            self.settled[next] = true;
            let place = level(&self.nodes[next]);
            for i in 0..self.nodes.len() {
                let far_m = self.distance_m[next] + (self.nodes[i] - place.xy()).length();
                // A visibility check costs more than the sum, so only links that would be shorter
                // are checked.
                if !self.settled[i]
                    && far_m < self.distance_m[i]
                    && clear.is_leg_free(&place, &level(&self.nodes[i]))
                {
                    (self.distance_m[i], self.previous[i]) = (far_m, next as u16);
                }
            }
        }
        let mut at = END_NODE;
        while at != START_NODE {
            points
                .push(level(&self.nodes[at]))
                .map_err(|_| DetourError::Path(PathError::PathFull))?;
            at = usize::from(self.previous[at]);
        }
        points.push(*from).map_err(|_| DetourError::Path(PathError::PathFull))?;
        points.reverse();
        Ok(true)
    }

    /// Collects the nodes at the height of `from`: both ends, corners of no-fly zones, and corners
    /// around keep-out zones that reach this height. Nodes beyond the capacity are dropped.
    fn collect_nodes<const N: usize>(
        &mut self,
        clear: &LegConstraints<'_, '_, N>,
        from: &Point,
        to: &Point,
    ) {
        self.nodes.clear();
        let mut add = |place: Flat| _ = self.nodes.push(place);
        add(from.xy());
        add(to.xy());
        clear.transit.corners().iter().for_each(|corner| add(*corner));
        let step = core::f32::consts::TAU / CORNERS_PER_END as f32;
        for obstacle in clear.obstacles {
            let (low_m, high_m) = match obstacle.from.z < obstacle.to.z {
                true => (obstacle.from.z, obstacle.to.z),
                false => (obstacle.to.z, obstacle.from.z),
            };
            let beside_m = fabsf(from.z - fminf(from.z.max(low_m), high_m));
            if beside_m > obstacle.radius_m {
                continue;
            }
            let far_m = obstacle.radius_m * CORNER_RADIUS_FACTOR + CORNER_ROUNDING_M;
            let twice = (obstacle.from - obstacle.to).xy().length() > SAME_CORNER_M;
            let ends = [Some(obstacle.from), twice.then_some(obstacle.to)];
            for end in ends.into_iter().flatten() {
                for i in 0..CORNERS_PER_END {
                    let angle = i as f32 * step;
                    let place = end.xy() + Flat::new(cosf(angle), sinf(angle)) * far_m;
                    if !clear.transit.is_in_no_fly_zone(&place) {
                        add(place);
                    }
                }
            }
        }
    }
}

/// Writes the path from the vehicle over `points` to `out`; a point at the place of the one before
/// is left out.
fn write_path<const W: usize>(
    request: &DetourRequest,
    points: &[Point],
    out: &mut Path<W>,
) -> Result<(), PathError> {
    *out = Path::new();
    out.push(request.here, request.leg_clearance_m)?;
    let mut before = request.here;
    for point in points {
        if (point - before).length() > SAME_CORNER_M {
            out.push(*point, request.leg_clearance_m)?;
            before = *point;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
