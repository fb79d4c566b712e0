//! An area in strips, one lane wide: what of each is to be photographed, and where a lane is laid.

use heapless::Vec;
use libm::{ceilf, fmaxf, fminf};

use super::area::{Area, RingKind, edges_of};
use super::intervals::{Intervals, Span};
use super::lanes::{Lane, LanePattern, Tracks};
use super::sweep::LaneDirection;
use super::transit::ZONE_CLEARANCE_M;
use super::{CoverageError, Flat};
use crate::geometry::clamp_to;
use crate::sort;

/// Memory lent: `V` is at least the number of the area's vertices.
pub struct Workspace<const V: usize> {
    pub(super) hull: Vec<Flat, V>,
    pub(super) crossings: Vec<f32, V>,
    pub(super) needed: Intervals<V>,
    pub(super) line: Intervals<V>,
    pub(super) free: Intervals<V>,
}

impl<const V: usize> Workspace<V> {
    /// Creates it empty.
    pub const fn new() -> Self {
        Self {
            hull: Vec::new(),
            crossings: Vec::new(),
            needed: Intervals::new(),
            line: Intervals::new(),
            free: Intervals::new(),
        }
    }
}

impl<const V: usize> Default for Workspace<V> {
    fn default() -> Self {
        Self::new()
    }
}

/// The area in strips.
pub(super) struct Strips<'a> {
    pub(super) area: Area<'a>,
    pub(super) pattern: LanePattern,
    direction: LaneDirection,
    base: Flat,
    low: f32,
    pub(super) strip_width_m: f32,
    pub(super) count: usize,
}

impl<'a> Strips<'a> {
    pub(super) fn new(
        area: &Area<'a>,
        pattern: &LanePattern,
        direction: LaneDirection,
    ) -> Result<Self, CoverageError> {
        let base = area.vertices()[0];
        let outer =
            area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::Outer).flat_map(|(_, ring)| ring);
        let (low, high) = outer
            .map(|vertex| direction.across.dot(&(vertex - base)))
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| (fminf(low, v), fmaxf(high, v)));
        // A width that is a whole number of lanes is often a rounding above it.
        let count = fmaxf(ceilf((high - low) / pattern.spacing.lane_m - 1e-3), 1.0);
        if count > f32::from(u16::MAX) {
            return Err(CoverageError::LanesFull);
        }
        let wide = (high - low) / count;
        Ok(Self {
            area: *area,
            pattern: *pattern,
            direction,
            base,
            low,
            strip_width_m: wide,
            count: count as usize,
        })
    }

    /// Both borders of a strip, across the lanes.
    pub(super) fn strip_borders(&self, strip: usize) -> Span {
        let low = self.low + strip as f32 * self.strip_width_m;
        [low, low + self.strip_width_m]
    }

    pub(super) fn centre_line(&self, [low, high]: Span) -> f32 {
        (low + high) / 2.0
    }

    /// A place in the lanes' frame.
    pub(super) fn to_lane_frame(&self, place: &Flat) -> (f32, f32) {
        let from_base = place - self.base;
        (self.direction.along.dot(&from_base), self.direction.across.dot(&from_base))
    }

    /// The place of a point of the lanes' frame.
    fn to_place(&self, u: f32, v: f32) -> Flat {
        self.base + self.direction.along * u + self.direction.across * v
    }

    /// Places where the line `v` crosses these edges, in rising order.
    fn line_crossings<const V: usize>(
        &self,
        edges: impl Iterator<Item = (Flat, Flat)>,
        v: f32,
        out: &mut Vec<f32, V>,
    ) -> Result<(), CoverageError> {
        out.clear();
        for (a, b) in edges {
            let ((au, av), (bu, bv)) = (self.to_lane_frame(&a), self.to_lane_frame(&b));
            if (av <= v) != (bv <= v) {
                let u = au + (v - av) * (bu - au) / (bv - av);
                out.push(u).map_err(|_| CoverageError::LanesFull)?;
            }
        }
        sort::sort_by(out, f32::total_cmp);
        Ok(())
    }

    /// Projects these rings on the strip between two `v`: adds every `u` at which they hold a place there, those of the places on the lines at both
    /// borders, and those of the rings' own edges between them. A place inside that is not on a border line crosses
    /// an edge before it.
    fn project_rings<const V: usize>(
        &self,
        edges: impl Iterator<Item = (Flat, Flat)> + Clone,
        [low, high]: Span,
        grown: f32,
        crossings: &mut Vec<f32, V>,
        out: &mut Intervals<V>,
    ) -> Result<(), CoverageError> {
        for v in [low, high] {
            self.line_crossings(edges.clone(), v, crossings)?;
            for pair in crossings.chunks_exact(2) {
                out.add([pair[0] - grown, pair[1] + grown])?;
            }
        }
        for [from, to] in edges.filter_map(|edge| self.clip_edge(edge, [low, high])) {
            out.add([from - grown, to + grown])?;
        }
        Ok(())
    }

    /// Sets `ws.need` to every `u` at which there is something to photograph between two `v`.
    pub(super) fn compute_needed<const V: usize>(
        &self,
        span: Span,
        ws: &mut Workspace<V>,
    ) -> Result<(), CoverageError> {
        ws.needed.clear();
        // An area that only touches the border of a strip is its neighbour's.
        let inset = self.strip_width_m * 1e-4;
        let span = [span[0] + inset, span[1] - inset];
        self.project_rings(self.area.edges(), span, 0.0, &mut ws.crossings, &mut ws.needed)
    }

    /// Takes from `ws.need` every `u` at which one no-fly zone holds all between two `v`: those inside it on both border
    /// lines, without those of its edges between them.
    pub(super) fn subtract_no_fly_zones<const V: usize>(
        &self,
        span: Span,
        ws: &mut Workspace<V>,
    ) -> Result<(), CoverageError> {
        for (_, ring) in self.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly) {
            ws.line.clear();
            self.line_crossings(edges_of(ring), span[0], &mut ws.crossings)?;
            for pair in ws.crossings.chunks_exact(2) {
                ws.line.add([pair[0], pair[1]])?;
            }
            self.line_crossings(edges_of(ring), span[1], &mut ws.crossings)?;
            let mut outside = f32::NEG_INFINITY;
            for pair in ws.crossings.chunks_exact(2) {
                ws.line.remove([outside, pair[0]])?;
                outside = pair[1];
            }
            ws.line.remove([outside, f32::INFINITY])?;
            for edge in edges_of(ring) {
                if let Some(edge) = self.clip_edge(edge, span) {
                    ws.line.remove(edge)?;
                }
            }
            for span in ws.line.spans() {
                ws.needed.remove(*span)?;
            }
        }
        Ok(())
    }

    /// Range of an edge between two `v`; none where it does not reach them.
    fn clip_edge(&self, (a, b): (Flat, Flat), [low, high]: Span) -> Option<Span> {
        let (mut a, mut b) = (self.to_lane_frame(&a), self.to_lane_frame(&b));
        if a.1 > b.1 {
            core::mem::swap(&mut a, &mut b);
        }
        if a.1 > high || b.1 < low {
            return None;
        }
        let at = |v: f32| a.0 + (v - a.1) * (b.0 - a.0) / (b.1 - a.1);
        let from = if a.1 < low { at(low) } else { a.0 };
        let to = if b.1 > high { at(high) } else { b.0 };
        Some([fminf(from, to), fmaxf(from, to)])
    }

    /// Takes from `ws.free` every `u` at which the line `v` comes nearer than the clearance to a no-fly zone.
    fn subtract_zone_clearance<const V: usize>(
        &self,
        v: f32,
        ws: &mut Workspace<V>,
    ) -> Result<(), CoverageError> {
        ws.line.clear();
        let clear = ZONE_CLEARANCE_M;
        for (_, ring) in self.area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly) {
            let span = [v - clear, v + clear];
            self.project_rings(edges_of(ring), span, clear, &mut ws.crossings, &mut ws.line)?;
        }
        for span in ws.line.spans() {
            ws.free.remove(*span)?;
        }
        Ok(())
    }

    /// Lays lanes along the line `v` for what `ws.need` holds.
    pub(super) fn lay_lanes<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        ws: &mut Workspace<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        ws.free.clear();
        self.line_crossings(self.area.edges(), v, &mut ws.crossings)?;
        for &need in ws.needed.spans() {
            let inside = ws.crossings.iter().copied().filter(|u| (need[0]..=need[1]).contains(u));
            let line = inside
                .fold([f32::INFINITY, f32::NEG_INFINITY], |line, u| [fminf(line[0], u), fmaxf(line[1], u)]);
            ws.free.add(self.lane_extent(need, line))?;
        }
        if self.area.has_no_fly() {
            self.subtract_zone_clearance(v, ws)?;
        }
        ws.free.spans().iter().try_for_each(|span| self.push_lane(strip, v, *span, out))
    }

    /// Lays a lane of one waypoint on the line `v`, as near as can be to the middle of `need`, if it shows all of it.
    pub(super) fn lay_picture<const L: usize, const V: usize>(
        &self,
        strip: u16,
        v: f32,
        need: Span,
        ws: &mut Workspace<V>,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        let (middle, room) =
            ((need[0] + need[1]) / 2.0, self.picture_half_width() - (need[1] - need[0]) / 2.0);
        if room <= 0.0 {
            return Ok(());
        }
        ws.free.clear();
        ws.free.add([middle - room, middle + room])?;
        self.subtract_zone_clearance(v, ws)?;
        let near = ws.free.spans().iter().map(|[from, to]| clamp_to(middle, *from, *to));
        let far = |u: &f32| libm::fabsf(u - middle);
        let nearest = near.min_by(|a, b| far(a).total_cmp(&far(b)));
        nearest.map_or(Ok(()), |u| self.push_lane(strip, v, [u, u], out))
    }

    fn push_lane<const L: usize>(
        &self,
        strip: u16,
        v: f32,
        [from, to]: Span,
        out: &mut Tracks<L>,
    ) -> Result<(), CoverageError> {
        let (from, to) = (self.to_place(from, v), self.to_place(to, v));
        let lane = Lane { from, to, first: 0, count: 0, start_m: 0.0, strip };
        out.lanes.push(lane).map_err(|_| CoverageError::LanesFull)
    }

    /// Range of a lane for an area that reaches over `need` in its strip and over `line` along it:
    /// from border to border, further where the first or last picture would else leave a part out.
    fn lane_extent(&self, need: Span, line: Span) -> Span {
        let reach = self.picture_half_width();
        let (from, to) = (fminf(line[0], need[0] + reach), fmaxf(line[1], need[1] - reach));
        let middle = (need[0] + need[1]) / 2.0;
        let [from, to] = if from <= to { [from, to] } else { [middle, middle] };
        [from - self.pattern.margin_m, to + self.pattern.margin_m]
    }

    /// Distance beyond its middle to which a picture shows the lane: a little less than half its
    /// side.
    pub(super) fn picture_half_width(&self) -> f32 {
        let half = self.pattern.spacing.footprint.along_m / 2.0;
        half - fminf(self.strip_width_m / 10.0, half / 2.0)
    }
}
