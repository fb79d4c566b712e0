//! One vehicle's way home over a field, or aside: around no-fly zones and whatever left the plan,
//! without a roadmap.
//!
//! Home: straight up or down to the vehicle's own layer, there the shortest way to above its pad,
//! and down. What is to be kept off is walked around: a visibility graph over the zones' corners
//! ([`Transit::corners`]) and eight corners around either end of each [`KeepOutZone`] that reaches
//! the layer, searched by A*. Legs keep above the ground, where that is not level. Where the layer
//! leaves no way, the same at the height at which the vehicle hovers. Aside: the nearest of places
//! on rings around it, straight there.
//!
//! No leg leaves the request's fence. ENU metres. Cost: n² / 2 looks at most for n places, each at
//! all edges of zones and all [`KeepOutZone`]s.

use heapless::Vec;
use libm::{ceilf, cosf, fabsf, fminf, sinf};

use super::Flat;
use super::transit::Transit;
use crate::detour::{self, DetourError, DetourRequest, Goal, KeepOutZone};
use crate::field::FieldView;
use crate::flight::{Path, PathError, Task, VehiclePlan};
use crate::search::SearchError;
use crate::{Length, Point};

/// Most places of the visibility graph.
const MAX_PLACES: usize = 320;
/// Corners of the polygon around an end of a keep-out zone's axis.
const CORNERS_PER_END: usize = 8;
/// Radius of those corners, as a share of the distance to keep: the line between two neighbouring
/// corners still keeps that distance.
const CORNER_RADIUS_SHARE: f32 = 1.09;
/// Rounding added to the radius of the corners, metres.
const CORNER_ROUNDING_M: f32 = 0.05;
/// Two corners nearer than this are one place, metres.
const SAME_CORNER_M: f32 = 0.01;
/// Most height samples of one leg: on a longer leg the samples are further apart.
const MAX_LEG_SAMPLES: f32 = 65_536.0;
/// Least height of a leg above the field, metres; a leg straight up or down is exempt.
const MIN_HEIGHT_OVER_FIELD_M: f32 = 1.5;
/// Rings around a vehicle on which a landing place aside is sought, a metre apart.
const MAX_SIDESTEP_RINGS: usize = 20;
/// Directions on each ring in which a landing place aside is sought.
const SIDESTEP_DIRECTIONS: usize = 16;

/// No-fly zones, ground and obstacles that legs keep clear of.
struct FreeSpace<'a, 't, const N: usize> {
    transit: &'a Transit<'t, N>,
    field: Option<FieldView<'a>>,
    obstacles: &'a [KeepOutZone],
    here: Point,
    fence: Option<(Point, Point)>,
}

impl<const N: usize> FreeSpace<'_, '_, N> {
    fn is_leg_free(&self, a: &Point, b: &Point) -> bool {
        let touches =
            |obstacle: &KeepOutZone| obstacle.impassable_part(&self.here).intersects(a, b);
        // A box holds what is between two places in it; where the vehicle is it may have deviated
        // beyond.
        self.is_inside(b)
            && self.transit.is_line_clear(&a.xy(), &b.xy())
            && self.is_above_field(a, b)
            && !self.obstacles.iter().any(touches)
    }

    fn is_inside(&self, place: &Point) -> bool {
        self.fence
            .is_none_or(|(low, high)| (0..3).all(|a| place[a] >= low[a] && place[a] <= high[a]))
    }

    /// Whether a leg stays above the height field, checked at samples half a node apart.
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

/// The way to the goal ([`Goal::Home`]), or aside, that keeps clear of all `obstacles`, above the
/// field and out of the zones that `transit` knows, written to `out`. Of an obstacle that is nearer
/// already the distance is shortened.
///
/// # Errors
/// Reason why there is none.
pub fn plan_detour<const N: usize, const W: usize>(
    transit: &Transit<'_, N>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    out: &mut Path<W>,
) -> Result<(), DetourError> {
    request.check().map_err(DetourError::Config)?;
    obstacles.iter().try_for_each(KeepOutZone::check).map_err(DetourError::Config)?;
    let Goal::Home { over, layer_m } = request.goal else {
        return Err(DetourError::Search(SearchError::NoPath));
    };
    detour::shrink_zones(obstacles, &request.here);
    let clear = FreeSpace { transit, field, obstacles, here: request.here, fence: request.fence };
    let from = |points: &[Point], out: &mut Path<W>| {
        write_path(request, points, out).map_err(DetourError::Path)
    };
    if request.aside {
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

/// As [`plan_detour`], as the plan of one vehicle that leaves the others' plan: only the path of
/// that plan counts; the plan has no gates.
///
/// # Errors
/// Reason why there is none.
pub fn plan_vehicle_detour<const N: usize, const W: usize, const G: usize>(
    transit: &Transit<'_, N>,
    field: Option<FieldView<'_>>,
    request: &DetourRequest,
    obstacles: &mut [KeepOutZone],
    out: &mut VehiclePlan<W, G>,
) -> Result<(), DetourError> {
    plan_detour(transit, field, request, obstacles, &mut out.path)?;
    out.task = Task::Goto(0);
    (out.climb_m, out.descent_m, out.depart_s) = (0.0, request.descent_m, 0.0);
    out.gates.clear();
    out.plan_crc = 0;
    Ok(())
}

/// The nearest free place that a straight leg reaches.
fn nearest_reachable_place<const N: usize>(clear: &FreeSpace<'_, '_, N>) -> Option<Point> {
    let here = clear.here;
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

/// Nodes at one height, with the shortest distances found to them so far.
struct VisibilityGraph {
    places: Vec<Flat, MAX_PLACES>,
    distance_m: [f32; MAX_PLACES],
    previous: [u16; MAX_PLACES],
    settled: [bool; MAX_PLACES],
}

impl VisibilityGraph {
    const EMPTY: Self = Self {
        places: Vec::new(),
        distance_m: [0.0; MAX_PLACES],
        previous: [0; MAX_PLACES],
        settled: [false; MAX_PLACES],
    };

    /// The shortest way between two places of one height: all its points but the first, none where
    /// it stays. Whether there is one.
    fn find_shortest_path<const N: usize, const W: usize>(
        &mut self,
        clear: &FreeSpace<'_, '_, N>,
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
            let open = (0..self.places.len())
                .filter(|&i| !self.settled[i] && self.distance_m[i].is_finite());
            let whole = |i: usize| self.distance_m[i] + (self.places[i] - to.xy()).length();
            let Some(next) = open.min_by(|&a, &b| whole(a).total_cmp(&whole(b))) else {
                return Ok(false);
            };
            if next == END_NODE {
                break;
            }
            self.settled[next] = true;
            let place = level(&self.places[next]);
            for i in 0..self.places.len() {
                let far_m = self.distance_m[next] + (self.places[i] - place.xy()).length();
                // A look costs more than the sum: only at what would be shorter.
                if !self.settled[i]
                    && far_m < self.distance_m[i]
                    && clear.is_leg_free(&place, &level(&self.places[i]))
                {
                    (self.distance_m[i], self.previous[i]) = (far_m, next as u16);
                }
            }
        }
        let mut at = END_NODE;
        while at != START_NODE {
            points
                .push(level(&self.places[at]))
                .map_err(|_| DetourError::Path(PathError::PathFull))?;
            at = usize::from(self.previous[at]);
        }
        points.push(*from).map_err(|_| DetourError::Path(PathError::PathFull))?;
        points.reverse();
        Ok(true)
    }

    /// Collects both ends, corners of zones, and corners around obstacles at this height, up to the
    /// capacity.
    fn collect_nodes<const N: usize>(
        &mut self,
        clear: &FreeSpace<'_, '_, N>,
        from: &Point,
        to: &Point,
    ) {
        self.places.clear();
        let mut add = |place: Flat| _ = self.places.push(place);
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
            let far_m = obstacle.radius_m * CORNER_RADIUS_SHARE + CORNER_ROUNDING_M;
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
