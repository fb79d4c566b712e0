//! A reachable set: a polyline, a column below its first point, and a distance around both.

use fpu::sqrtf;
use heapless::Vec;

use crate::Point;

/// Most points of a reachable set: the vehicle's position and the eight path points that it
/// reports.
pub(super) const MAX_SET_POINTS: usize = 9;

/// Places where a vehicle can be: all within `widened_by_m` of a polyline and of a vertical column
/// that may stand below its first point.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachableSet {
    /// Corners of the polyline, at least one; the first is the vehicle's position.
    pub(super) points: Vec<Point, MAX_SET_POINTS>,
    /// Lower end of the column; `None` if there is no column.
    pub(super) column_bottom: Option<Point>,
    /// Distance from polyline and column up to which the vehicle can be, metres.
    pub widened_by_m: f32,
}

impl ReachableSet {
    /// A set of one point.
    #[inline]
    pub fn at(place: Point) -> Self {
        let mut points = Vec::new();
        // Cannot overflow: it is the first of nine.
        let _ = points.push(place);
        Self { points, column_bottom: None, widened_by_m: 0.0 }
    }

    /// Appends a straight leg to a point. Returns false, and appends nothing, if the set is full.
    pub(super) fn push(&mut self, to: Point) -> bool {
        self.points.push(to).is_ok()
    }

    /// The set from `place` along the points `ahead`, for `length_m` from the first of them. The
    /// set ends where the points end.
    #[inline]
    pub fn along(place: Point, ahead: impl Iterator<Item = Point>, length_m: f32) -> Self {
        let mut set = Self::at(place);
        set.extend_along(ahead, length_m);
        set
    }

    /// Extends a set of one point in place as [`Self::along`] does: copying a set that
    /// [`Self::along`] returns takes long on a board.
    #[inline]
    pub fn extend_along(&mut self, ahead: impl Iterator<Item = Point>, length_m: f32) {
        let (mut left_m, mut last) = (length_m, None);
        for point in ahead {
            let Some(from) = last.replace(point) else {
                self.push(point);
                continue;
            };
            let leg: Point = point - from;
            let leg_m = sqrtf(leg.norm_squared());
            let end = if leg_m > left_m { from + leg * (left_m / leg_m) } else { point };
            if !self.push(end) {
                // There is no room for more corners: the vehicle may be anywhere within the
                // remaining length.
                self.widened_by_m = left_m.max(0.0);
                return;
            }
            left_m -= leg_m;
            if left_m <= 0.0 {
                return;
            }
        }
    }

    /// The set from `place` vertically up or down to the height `to_m`, metres up in the mission
    /// frame.
    pub fn vertical(place: Point, to_m: f32) -> Self {
        let mut set = Self::at(place);
        set.push(Point::new(place.x, place.y, to_m));
        set
    }

    /// Adds the column below the first point down to the height `to_m`; no column if `to_m` is
    /// `None` or not below the point.
    pub(super) fn add_column(&mut self, to_m: Option<f32>) {
        let first = self.points[0];
        self.column_bottom = to_m.filter(|z| *z < first.z).map(|z| Point::new(first.x, first.y, z));
    }

    /// Iterates over the lines around which the set lies: its legs (for a set of one point a leg of
    /// length 0), then the column below its first point, if there is one.
    #[inline]
    pub(super) fn segments(&self) -> Segments<'_> {
        let first = &self.points[0];
        let next = if self.points.len() > 1 { &self.points[1..] } else { &self.points[..] };
        Segments {
            from: first,
            next: next.iter(),
            column: self.column_bottom.as_ref().map(|foot| (first, foot)),
        }
    }
}

/// Iterator of [`ReachableSet::segments`]: the legs from point to point, then the column.
pub(super) struct Segments<'a> {
    /// Beginning of the next leg.
    from: &'a Point,
    /// Ends of the legs that are still to come.
    next: core::slice::Iter<'a, Point>,
    /// Upper and lower end of the column, until it was returned.
    column: Option<(&'a Point, &'a Point)>,
}

impl<'a> Iterator for Segments<'a> {
    type Item = (&'a Point, &'a Point);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        match self.next.next() {
            Some(to) => Some((core::mem::replace(&mut self.from, to), to)),
            None => self.column.take(),
        }
    }
}
