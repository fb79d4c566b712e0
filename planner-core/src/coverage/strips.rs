//! An area in strips, one lane wide: what of each is to be photographed, and where a lane is laid.

use heapless::Vec;
use libm::{ceilf, fmaxf, fminf};

use super::area::{Area, RingKind, edges_of};
use super::intervals::{Intervals, Span};
use super::lanes::{Lane, LanePattern, Tracks};
use super::sweep::LaneDirection;
use super::transit::ZONE_CLEARANCE_M;
use super::{CoverageError, Flat};
use crate::geometry::{Length as _, clamp_to};
use crate::sort;

/// A width that is a whole number of lanes is often a rounding above it: up to this share of a
/// lane. More is not in their pictures.
pub(super) const WIDTH_ROUNDING: f32 = 1e-4;

/// Memory lent: `V` is at least the number of the area's vertices.
pub struct Workspace<const V: usize> {
    /// The convex hull; then the vertices in the lanes' frame.
    pub(super) vertices: Vec<Flat, V>,
    pub(super) sets: Sets<V>,
}

/// Places along a line.
pub(super) struct Sets<const V: usize> {
    crossings: Vec<f32, V>,
    pub(super) needed: Intervals<V>,
    /// What a zone holds, or bars.
    barred: Intervals<V>,
    free: Intervals<V>,
}

impl<const V: usize> Workspace<V> {
    /// Creates it empty.
    pub const fn new() -> Self {
        let sets = Sets {
            crossings: Vec::new(),
            needed: Intervals::new(),
            barred: Intervals::new(),
            free: Intervals::new(),
        };
        Self { vertices: Vec::new(), sets }
    }
}

impl<const V: usize> Default for Workspace<V> {
    fn default() -> Self {
        Self::new()
    }
}

/// The lanes' frame: `u` along them and `v` across, metres from the first vertex.
pub(super) struct LaneFrame {
    pub(super) base: Flat,
    pub(super) direction: LaneDirection,
}

impl LaneFrame {
    pub(super) fn new(area: &Area<'_>, direction: LaneDirection) -> Self {
        Self { base: area.vertices()[0], direction }
    }

    /// A place in this frame.
    pub(super) fn to_frame(&self, place: &Flat) -> Flat {
        let from_base = place - self.base;
        Flat::new(self.direction.along.dot(&from_base), self.direction.across.dot(&from_base))
    }

    /// The place of a point of this frame.
    pub(super) fn to_place(&self, point: &Flat) -> Flat {
        self.base + self.direction.along * point.x + self.direction.across * point.y
    }
}

/// An area in strips. It and the lanes that are laid are in the lanes' frame.
pub(super) struct Strips<'a> {
    pub(super) area: Area<'a>,
    pub(super) pattern: LanePattern,
    low: f32,
    pub(super) strip_width_m: f32,
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
        let count = fmaxf(ceilf((high - low) / pattern.spacing.lane_m - WIDTH_ROUNDING), 1.0);
        if count > f32::from(u16::MAX) {
            return Err(CoverageError::LanesFull);
        }
        let wide = (high - low) / count;
        Ok(Self { area: *area, pattern: *pattern, low, strip_width_m: wide, count: count as usize })
    }

    /// Both borders of a strip, across the lanes.
    pub(super) fn strip_borders(&self, strip: usize) -> Span {
        let low = self.low + strip as f32 * self.strip_width_m;
        [low, low + self.strip_width_m]
    }

    pub(super) fn centre_line(&self, [low, high]: Span) -> f32 {
        (low + high) / 2.0
    }

    /// Sets `ws.needed` to every `u` at which there is something to photograph between two `v`.
    pub(super) fn compute_needed<const V: usize>(
        &self,
        span: Span,
        ws: &mut Sets<V>,
    ) -> Result<(), CoverageError> {
        ws.needed.clear();
        project_rings(self.area.edges(), self.inset(span), &mut ws.crossings, &mut ws.needed)
    }

    /// A little less than what lies between two `v`: a ring that only touches the border of a strip
    /// is its neighbour's.
    fn inset(&self, [low, high]: Span) -> Span {
        let inset = self.strip_width_m * 1e-4;
        [low + inset, high - inset]
    }

    /// Takes from `ws.needed` every `u` at which one no-fly zone holds all between two `v`: those
    /// inside it on both border lines, without those of its edges between them.
    pub(super) fn subtract_no_fly_zones<const V: usize>(
        &self,
        span: Span,
        ws: &mut Sets<V>,
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

    /// Sets `ws.barred` to every `u` at which the line `v` comes nearer than the clearance to a
    /// no-fly zone.
    fn compute_barred<const V: usize>(
        &self,
        v: f32,
        ws: &mut Sets<V>,
    ) -> Result<(), CoverageError> {
        ws.barred.clear();
        for (_, ring) in self.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly) {
            line_crossings(edges_of(ring), v, &mut ws.crossings)?;
            for pair in ws.crossings.chunks_exact(2) {
                ws.barred.add([pair[0], pair[1]])?;
            }
            for span in edges_of(ring).filter_map(|edge| near_edge(edge, v)) {
                ws.barred.add(span)?;
            }
        }
        Ok(())
    }

    /// Lays lanes along the line `v` for what `ws.needed` holds, from border to border.
    pub(super) fn lay_lanes<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        ws: &mut Sets<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        self.compute_barred(v, ws)?;
        line_crossings(self.area.edges(), v, &mut ws.crossings)?;
        self.lay_between_borders(strip, v, ws, out)
    }

    /// Lays lanes along the line `v` no longer than shows what `ws.needed` holds.
    pub(super) fn lay_missing<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        ws: &mut Sets<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        self.compute_barred(v, ws)?;
        ws.crossings.clear();
        self.lay_between_borders(strip, v, ws, out)
    }

    /// Lays lanes where `ws.barred` lets them be, from border to border of those in `ws.crossings`.
    /// What one picture shows that is on no border gets one, as near to its middle as can be.
    #[inline(never)]
    fn lay_between_borders<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        ws: &mut Sets<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        let mut push = |[from, to]: Span| {
            let (from, to) = (Flat::new(from, v), Flat::new(to, v));
            let lane = Lane { from, to, first: 0, count: 0, start_m: 0.0, strip };
            out.lanes.push(lane).map_err(|_| CoverageError::LanesFull)
        };
        let margin = self.pattern.margin_m;
        let Sets { crossings, needed, barred, free } = ws;
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

    /// Where a lane begins and ends for an area that reaches over `need` in its strip: from border
    /// to border, further where the first or last picture would else leave a part out. It ends
    /// before it begins where one picture between both shows all.
    fn lane_extent(&self, need: &Span, borders: &[f32]) -> Span {
        let reach = self.picture_half_width();
        let inside = borders.iter().filter(|u| (need[0]..=need[1]).contains(u));
        inside.fold([need[0] + reach, need[1] - reach], |[from, to], u| {
            [fminf(from, *u), fmaxf(to, *u)]
        })
    }

    /// Distance beyond its middle to which a picture shows the lane: half its side, less a
    /// rounding. Where pictures overlap, one of them is to show all of a cell, a tenth of the
    /// spacing, that a border cuts: two of them that meet overlap by more than that.
    pub(super) fn picture_half_width(&self) -> f32 {
        let spacing = self.pattern.spacing;
        let half = spacing.footprint.along_m / 2.0;
        let cell_m = spacing.lane_m / 10.0;
        let overlap_m = fminf(
            spacing.footprint.across_m - spacing.lane_m,
            spacing.footprint.along_m - spacing.waypoint_m,
        );
        if overlap_m < cell_m / 100.0 {
            half - cell_m / 100.0
        } else {
            half - fminf(0.56 * cell_m, half / 2.0)
        }
    }
}

/// Places where the line `v` crosses these edges, in rising order.
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
    sort::sort_by(out, f32::total_cmp);
    Ok(())
}

/// Projects these rings on the strip between two `v`: adds every `u` at which they hold a place
/// there, those of the places on the lines at both borders, and those of the rings' own edges
/// between them. A place inside that is not on a border line crosses an edge before it.
fn project_rings<const V: usize>(
    edges: impl Iterator<Item = (Flat, Flat)> + Clone,
    [low, high]: Span,
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

/// Range of an edge between two `v`; none where it does not reach them.
fn clip_edge((mut a, mut b): (Flat, Flat), [low, high]: Span) -> Option<Span> {
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

/// Range of the line `v` that is nearer than the clearance to an edge: between the circles around
/// its ends and the lines beside it.
fn near_edge((a, b): (Flat, Flat), v: f32) -> Option<Span> {
    const CLEAR_M: f32 = ZONE_CLEARANCE_M;
    if fmaxf(a.y, b.y) < v - CLEAR_M || fminf(a.y, b.y) > v + CLEAR_M {
        return None;
    }
    let [mut low, mut high] = [f32::INFINITY, f32::NEG_INFINITY];
    let mut hold = |u: f32| (low, high) = (fminf(low, u), fmaxf(high, u));
    for end in [a, b] {
        let square = CLEAR_M * CLEAR_M - (v - end.y) * (v - end.y);
        if square >= 0.0 {
            let half = fpu::sqrtf(square);
            hold(end.x - half);
            hold(end.x + half);
        }
    }
    let edge = b - a;
    let beside = Flat::new(-edge.y, edge.x) * (CLEAR_M / edge.length());
    for from in [a - beside, a + beside] {
        let share = (v - from.y) / edge.y;
        if (0.0..=1.0).contains(&share) {
            hold(from.x + share * edge.x);
        }
    }
    (low <= high).then_some([low, high])
}
