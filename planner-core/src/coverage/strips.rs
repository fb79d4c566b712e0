//! An area cut into strips, one lane wide: which parts of each strip are to be photographed, and
//! where its lanes are.

use heapless::Vec;
use libm::{ceilf, fmaxf, fminf};

use super::area::{Area, RingKind, edges_of};
use super::intervals::{Interval, Intervals};
use super::lanes::{Lane, LanePattern, Tracks};
use super::sweep::LaneDirection;
use super::transit::LANE_AND_TURN_CLEARANCE_M;
use super::{CoverageError, Flat};
use crate::geo::distance::{Length as _, clamp_to};
use crate::sort;

/// Share of a lane spacing by which rounding may raise a width that is a whole number of lane
/// spacings, without adding another strip.
pub(super) const WIDTH_ROUNDING_SHARE: f32 = 1e-4;

/// Memory of the lanes' computation; `V` must be at least the number of the area's vertices.
pub struct LaneWorkspace<const V: usize> {
    /// First the convex hull, then the area's vertices in the lane frame.
    pub(super) vertices: Vec<Flat, V>,
    /// Intervals along the lanes.
    pub(super) sets: LaneIntervalSets<V>,
}

/// Sets of coordinates `u` along the lanes, on one line `v` or in one strip.
pub(super) struct LaneIntervalSets<const V: usize> {
    /// The `u` at which the line crosses edges, ascending.
    crossings: Vec<f32, V>,
    /// The `u` at which there is ground to photograph.
    pub(super) needed: Intervals<V>,
    /// The `u` at which a no-fly zone covers all of a strip, or is too near for a lane.
    barred: Intervals<V>,
    /// The `u` at which images are wanted and not barred.
    free: Intervals<V>,
}

impl<const V: usize> LaneWorkspace<V> {
    /// Creates an empty workspace.
    pub const fn new() -> Self {
        let sets = LaneIntervalSets {
            crossings: Vec::new(),
            needed: Intervals::new(),
            barred: Intervals::new(),
            free: Intervals::new(),
        };
        Self { vertices: Vec::new(), sets }
    }
}

impl<const V: usize> Default for LaneWorkspace<V> {
    fn default() -> Self {
        Self::new()
    }
}

/// The lane frame: `u` along the lanes and `v` across them, metres from `origin`. A [`Flat`] in
/// this frame has `u` as x and `v` as y.
pub(super) struct LaneFrame {
    /// Origin of the lane frame, metres in the mission frame.
    pub(super) origin: Flat,
    /// Direction of `u`.
    pub(super) direction: LaneDirection,
}

impl LaneFrame {
    /// The lane frame whose origin is the area's first vertex.
    pub(super) fn new(area: &Area<'_>, direction: LaneDirection) -> Self {
        Self { origin: area.vertices()[0], direction }
    }

    /// A point of the mission frame in the lane frame.
    pub(super) fn to_lane_frame(&self, place: &Flat) -> Flat {
        let from_base = place - self.origin;
        Flat::new(self.direction.along.dot(&from_base), self.direction.across.dot(&from_base))
    }

    /// A point of the lane frame in the mission frame.
    pub(super) fn to_mission_frame(&self, point: &Flat) -> Flat {
        self.origin + self.direction.along * point.x + self.direction.across * point.y
    }
}

/// An area cut into strips. The area, and the lanes that are laid, are in the lane frame.
pub(super) struct Strips<'a> {
    /// The area, in the lane frame.
    pub(super) area: Area<'a>,
    /// Spacing of lanes and pictures.
    pub(super) pattern: LanePattern,
    /// Least `v` of the outer rings: the lower border of the first strip.
    low_v_m: f32,
    /// Width of each strip, metres.
    pub(super) strip_width_m: f32,
    /// Number of strips.
    pub(super) count: usize,
}

impl<'a> Strips<'a> {
    pub(super) fn new(area: &Area<'a>, pattern: &LanePattern) -> Result<Self, CoverageError> {
        let outer = area
            .rings_with_kind()
            .filter(|(kind, _)| *kind == RingKind::Outer)
            .flat_map(|(_, ring)| ring);
        let (low, high) = outer
            .map(|vertex| vertex.y)
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| {
                (fminf(low, v), fmaxf(high, v))
            });
        let count = fmaxf(
            ceilf((high - low) / pattern.spacing.max_lane_spacing_m - WIDTH_ROUNDING_SHARE),
            1.0,
        );
        if count > f32::from(u16::MAX) {
            return Err(CoverageError::LanesFull);
        }
        let wide = (high - low) / count;
        Ok(Self {
            area: *area,
            pattern: *pattern,
            low_v_m: low,
            strip_width_m: wide,
            count: count as usize,
        })
    }

    /// Lower and upper border of a strip: coordinates `v` across the lanes.
    pub(super) fn strip_borders(&self, strip: usize) -> Interval {
        let low = self.low_v_m + strip as f32 * self.strip_width_m;
        [low, low + self.strip_width_m]
    }

    /// Coordinate `v` of the line half way between two `v`.
    pub(super) fn centre_line(&self, [low, high]: Interval) -> f32 {
        (low + high) / 2.0
    }

    /// Sets `ws.needed` to all `u` along the lanes at which something is to be photographed between
    /// the two `v` of `span`. No-fly zones are ignored.
    pub(super) fn compute_needed<const V: usize>(
        &self,
        span: Interval,
        ws: &mut LaneIntervalSets<V>,
    ) -> Result<(), CoverageError> {
        ws.needed.clear();
        project_rings(
            self.area.boundary_edges(),
            self.inset(span),
            &mut ws.crossings,
            &mut ws.needed,
        )
    }

    /// `span` made slightly narrower: a ring that only touches a strip's border belongs to the
    /// neighbouring strip.
    fn inset(&self, [low, high]: Interval) -> Interval {
        let inset = self.strip_width_m * 1e-4;
        [low + inset, high - inset]
    }

    /// Removes from `ws.needed` all `u` at which one no-fly zone covers everything between the two
    /// `v` of `span`: the `u` inside the zone on both border lines, without those of its edges
    /// between the lines.
    pub(super) fn subtract_no_fly_zones<const V: usize>(
        &self,
        span: Interval,
        ws: &mut LaneIntervalSets<V>,
    ) -> Result<(), CoverageError> {
        let span = self.inset(span);
        for (_, ring) in self.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly) {
            ws.barred.clear();
            line_crossings(edges_of(ring), span[0], &mut ws.crossings)?;
            for pair in ws.crossings.chunks_exact(2) {
                ws.barred.add([pair[0], pair[1]])?;
            }
            line_crossings(edges_of(ring), span[1], &mut ws.crossings)?;
            let mut outside = f32::NEG_INFINITY;
            for pair in ws.crossings.chunks_exact(2) {
                ws.barred.remove([outside, pair[0]])?;
                outside = pair[1];
            }
            ws.barred.remove([outside, f32::INFINITY])?;
            for edge in edges_of(ring) {
                if let Some(edge) = clip_edge(edge, span) {
                    ws.barred.remove(edge)?;
                }
            }
            ws.needed.remove_all(&ws.barred)?;
        }
        Ok(())
    }

    /// Sets `ws.barred` to all `u` at which the line `v` is nearer than
    /// [`LANE_AND_TURN_CLEARANCE_M`] to a no-fly zone, or inside one.
    fn compute_barred<const V: usize>(
        &self,
        v: f32,
        ws: &mut LaneIntervalSets<V>,
    ) -> Result<(), CoverageError> {
        ws.barred.clear();
        for (_, ring) in self.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly) {
            line_crossings(edges_of(ring), v, &mut ws.crossings)?;
            for pair in ws.crossings.chunks_exact(2) {
                ws.barred.add([pair[0], pair[1]])?;
            }
            for span in edges_of(ring).filter_map(|edge| range_near_edge(edge, v)) {
                ws.barred.add(span)?;
            }
        }
        Ok(())
    }

    /// Lays lanes along the line `v` that photograph what is in `ws.needed`, from border to border
    /// of the area.
    pub(super) fn lay_lanes<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        ws: &mut LaneIntervalSets<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        self.compute_barred(v, ws)?;
        line_crossings(self.area.boundary_edges(), v, &mut ws.crossings)?;
        self.lay_between_borders(strip, v, ws, out)
    }

    /// Lays lanes along the line `v` that photograph what is in `ws.needed`, and are no longer than
    /// necessary.
    pub(super) fn lay_shortest_lanes<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        ws: &mut LaneIntervalSets<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        self.compute_barred(v, ws)?;
        ws.crossings.clear();
        self.lay_between_borders(strip, v, ws, out)
    }

    /// Lays lanes along the line `v` where `ws.barred` allows them, from border to border among
    /// `ws.crossings`, and beyond by [`LanePattern::border_overshoot_m`]. An interval of
    /// `ws.needed` that one image shows, and that contains no border, gets one image, as near to
    /// its middle as is allowed.
    #[inline(never)]
    fn lay_between_borders<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        ws: &mut LaneIntervalSets<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        let mut push = |[from, to]: Interval| {
            let (from, to) = (Flat::new(from, v), Flat::new(to, v));
            let lane =
                Lane { from, to, first_waypoint: 0, waypoint_count: 0, start_along_m: 0.0, strip };
            out.lanes.push(lane).map_err(|_| CoverageError::LanesFull)
        };
        let margin = self.pattern.border_overshoot_m;
        let LaneIntervalSets { crossings, needed, barred, free } = ws;
        free.clear();
        for need in needed.spans() {
            let [from, to] = self.lane_extent(need, crossings);
            if from <= to {
                free.add([from - margin, to + margin])?;
            }
        }
        free.remove_all(barred)?;
        free.spans().iter().try_for_each(|span| push(*span))?;
        for need in needed.spans() {
            let [last, first] = self.lane_extent(need, crossings);
            if first < last {
                free.clear();
                free.add([first, last])?;
                free.remove_all(barred)?;
                let middle = (first + last) / 2.0;
                let near = free.spans().iter().map(|[from, to]| clamp_to(middle, *from, *to));
                let far = |u: &f32| libm::fabsf(u - middle);
                if let Some(u) = near.min_by(|a, b| far(a).total_cmp(&far(b))) {
                    push([u, u])?;
                }
            }
        }
        Ok(())
    }

    /// The `u` of the first and last image of the lane that photographs `need` in its strip: from
    /// border to border, and further where a part would otherwise be beyond the first or last
    /// image. The first is greater than the last if one image between both shows all.
    fn lane_extent(&self, need: &Interval, borders: &[f32]) -> Interval {
        let reach = self.half_picture_along_m();
        let inside = borders.iter().filter(|u| (need[0]..=need[1]).contains(u));
        inside.fold([need[0] + reach, need[1] - reach], |[from, to], u| {
            [fminf(from, *u), fmaxf(to, *u)]
        })
    }

    /// Distance along the lane that an image reliably shows on each side of its middle: half of the
    /// footprint's side, less a margin for rounding. Where images overlap, the margin is such that
    /// a cell of the host's checker (its side is a tenth of the lane spacing) that a border cuts is
    /// entirely in one image: two neighbouring images overlap by more than the margin.
    pub(super) fn half_picture_along_m(&self) -> f32 {
        let spacing = self.pattern.spacing;
        let half = spacing.footprint.along_m / 2.0;
        let cell_m = spacing.max_lane_spacing_m / 10.0;
        let overlap_m = fminf(
            spacing.footprint.across_m - spacing.max_lane_spacing_m,
            spacing.footprint.along_m - spacing.max_waypoint_spacing_m,
        );
        if overlap_m < cell_m / 100.0 {
            half - cell_m / 100.0
        } else {
            half - fminf(0.56 * cell_m, half / 2.0)
        }
    }
}

/// The `u` at which the line `v` crosses these edges, in ascending order.
fn line_crossings<const V: usize>(
    edges: impl Iterator<Item = (Flat, Flat)>,
    v: f32,
    out: &mut Vec<f32, V>,
) -> Result<(), CoverageError> {
    out.clear();
    for (a, b) in edges {
        if (a.y <= v) != (b.y <= v) {
            let u = a.x + (v - a.y) * (b.x - a.x) / (b.y - a.y);
            out.push(u).map_err(|_| CoverageError::LanesFull)?;
        }
    }
    sort::heapsort_by(out, f32::total_cmp);
    Ok(())
}

/// Adds to `out` all `u` at which the rings contain a point between the two `v`: those inside on
/// either of the two border lines, and those of the rings' edges between the lines. From any other
/// inner point the line across to a border line crosses an edge first, at the same `u`.
fn project_rings<const V: usize>(
    edges: impl Iterator<Item = (Flat, Flat)> + Clone,
    [low, high]: Interval,
    crossings: &mut Vec<f32, V>,
    out: &mut Intervals<V>,
) -> Result<(), CoverageError> {
    for v in [low, high] {
        line_crossings(edges.clone(), v, crossings)?;
        for pair in crossings.chunks_exact(2) {
            out.add([pair[0], pair[1]])?;
        }
    }
    edges.filter_map(|edge| clip_edge(edge, [low, high])).try_for_each(|span| out.add(span))
}

/// Range of `u` of the part of an edge between the two `v`; `None` if there is no such part.
fn clip_edge((mut a, mut b): (Flat, Flat), [low, high]: Interval) -> Option<Interval> {
    if a.y > b.y {
        core::mem::swap(&mut a, &mut b);
    }
    if a.y > high || b.y < low {
        return None;
    }
    let at = |v: f32| a.x + (v - a.y) * (b.x - a.x) / (b.y - a.y);
    let from = if a.y < low { at(low) } else { a.x };
    let to = if b.y > high { at(high) } else { b.x };
    Some([fminf(from, to), fmaxf(from, to)])
}

/// Range of `u` on the line `v` that is nearer than [`LANE_AND_TURN_CLEARANCE_M`] to an edge:
/// within the circles around its ends and the lines beside it. `None` if no `u` is that near.
fn range_near_edge((a, b): (Flat, Flat), v: f32) -> Option<Interval> {
    if fmaxf(a.y, b.y) < v - LANE_AND_TURN_CLEARANCE_M
        || fminf(a.y, b.y) > v + LANE_AND_TURN_CLEARANCE_M
    {
        return None;
    }
    let [mut low, mut high] = [f32::INFINITY, f32::NEG_INFINITY];
    let mut hold = |u: f32| (low, high) = (fminf(low, u), fmaxf(high, u));
    for end in [a, b] {
        let square =
            LANE_AND_TURN_CLEARANCE_M * LANE_AND_TURN_CLEARANCE_M - (v - end.y) * (v - end.y);
        if square >= 0.0 {
            let half = fpu::sqrtf(square);
            hold(end.x - half);
            hold(end.x + half);
        }
    }
    let edge = b - a;
    let beside = Flat::new(-edge.y, edge.x) * (LANE_AND_TURN_CLEARANCE_M / edge.length());
    for from in [a - beside, a + beside] {
        let share = (v - from.y) / edge.y;
        if (0.0..=1.0).contains(&share) {
            hold(from.x + share * edge.x);
        }
    }
    (low <= high).then_some([low, high])
}
