//! The safety filter's geometry: where can a vehicle be until it has stopped, and do two such sets
//! meet?
//!
//! The set of this vehicle ([`ReachableSet::along`], [`ReachableSet::vertical`]) is what it can no
//! longer take back: [`REACTION_S`] at its present speed, then a stop at its limits along its
//! reference. The set of a neighbour ([`NeighbourMotion::reachable_set`]) follows from what was
//! last heard and from nothing else: no gate, no progress, no advice.
//!
//! Two sets conflict ([`OwnSet::conflicts`]) where they come nearer than the safety distance. A
//! motion that does not reduce a distance that is already too small never does. A vehicle that
//! stops as soon as its set conflicts stays inside the set of the step before, which did not: that
//! is the safety argument (`docs/safety.md`).
//!
//! ENU metres. Sets are not compared by time, so an order in which two vehicles pass is no reason
//! to come near. Cost: the segments of one set times those of the other;
//! [`NeighbourMotion::reach_m`] is a cheap bound for the many that are far. The own set is prepared
//! once ([`OwnSet`]), so that most segments of the others are seen to be apart without a distance.

mod own;

use fpu::sqrtf;
use heapless::Vec;

pub use self::own::{Legs, OwnSet};
use crate::geometry::clamp_share;
use crate::{ConfigError, Point, all_positive};

/// Time from a decision to the first motion that follows it, seconds: two setpoints.
pub const REACTION_S: f32 = 0.1;
/// Greatest lag of a vehicle behind its reference, as seconds of flight: the vehicle flies on that
/// far.
pub const MAX_LAG_S: f32 = 0.25;
/// A neighbour heard within this time counts as heard, seconds.
pub const FRESH_S: f32 = 1.0;
/// A vehicle further than this from the path points that it reports does not fly along them,
/// metres: real vehicles lag by up to 0.5 m and deviate by 0.4 m.
pub const OFF_REPORTED_PATH_M: f32 = 0.9;
/// Most points of the set that a vehicle may occupy: its place and the eight path points that it
/// reports.
const MAX_SET_POINTS: usize = 9;

/// How a vehicle stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// Braking that is counted on, m/s².
    pub accel_mps2: f32,
    /// Jerk with which braking begins, m/s³.
    pub jerk_mps3: f32,
}

impl Braking {
    /// Distance that a vehicle flies on that begins to brake at this speed, metres.
    #[inline]
    pub fn stop_m(&self, speed_mps: f32) -> f32 {
        let ramp_s = self.accel_mps2 / self.jerk_mps3;
        0.5 * speed_mps * (speed_mps / self.accel_mps2 + ramp_s)
    }
}

/// Places where a vehicle can be: a polyline, perhaps a vertical column below its first point, and
/// how much wider than a line both are.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachableSet {
    points: Vec<Point, MAX_SET_POINTS>,
    /// Lower end of the column.
    foot: Option<Point>,
    /// Distance beside the line up to which the vehicle can be, metres.
    pub widened_by_m: f32,
}

impl ReachableSet {
    /// A set of one place.
    #[inline]
    pub fn at(place: Point) -> Self {
        let mut points = Vec::new();
        // The first of nine.
        let _ = points.push(place);
        Self { points, foot: None, widened_by_m: 0.0 }
    }

    /// Appends a straight leg to a point. Returns false if the set is full.
    fn push(&mut self, to: Point) -> bool {
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

    /// Adds to a set of one place what [`Self::along`] leads it along: a board takes long to copy
    /// what that returns.
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
                // The set has no memory for more corners: assume any place within the remaining
                // length.
                self.widened_by_m = left_m.max(0.0);
                return;
            }
            left_m -= leg_m;
            if left_m <= 0.0 {
                return;
            }
        }
    }

    /// The set from `place` straight up or down to the height `to_m`.
    pub fn vertical(place: Point, to_m: f32) -> Self {
        let mut set = Self::at(place);
        set.push(Point::new(place.x, place.y, to_m));
        set
    }

    /// Adds the column below the first point, down to a height.
    fn add_column(&mut self, to_m: Option<f32>) {
        let first = self.points[0];
        self.foot = to_m.filter(|z| *z < first.z).map(|z| Point::new(first.x, first.y, z));
    }

    /// Legs of the set, at least one, and the column.
    #[inline]
    fn segments(&self) -> Segments<'_> {
        let first = &self.points[0];
        let next = if self.points.len() > 1 { &self.points[1..] } else { &self.points[..] };
        Segments {
            from: first,
            next: next.iter(),
            column: self.foot.as_ref().map(|foot| (first, foot)),
        }
    }
}

/// What [`ReachableSet::segments`] gives: from point to point, and the column at last.
struct Segments<'a> {
    from: &'a Point,
    next: core::slice::Iter<'a, Point>,
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

/// Inputs of a neighbour's set.
#[derive(Clone, Copy, Debug)]
pub struct NeighbourMotion<'a> {
    /// Place, ENU metres.
    pub position: Point,
    /// ENU m/s.
    pub velocity: Point,
    /// Speed, m/s: the length of the velocity.
    pub speed_mps: f32,
    /// Seconds since both were heard.
    pub age_s: f32,
    /// How late messages are when they are heard, seconds.
    pub delay_s: f32,
    /// Points that it flies along next; empty while a pilot or a failsafe flies it.
    pub points: &'a [Point],
    /// Place of the neighbour on its points.
    pub place_on_points: PlaceOnPoints,
    /// Greatest distance to which the points lead from the first of them, metres.
    pub extent_m: f32,
    /// Distance along its points up to which the neighbour may have stopped since, unheard for
    /// long, metres; 0 for one that is heard.
    pub rests_within_m: f32,
    /// Whether it stands on the ground.
    pub grounded: bool,
    /// Height down to which its column counts, metres; none while it stays on its points.
    pub column_to_m: Option<f32>,
}

/// Place of a vehicle on the points that it reports: the same as long as neither is heard again.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PlaceOnPoints {
    /// The place was not sought yet.
    #[default]
    Unknown,
    /// The vehicle is further than [`OFF_REPORTED_PATH_M`] beside its points.
    Beside,
    /// On them.
    On {
        /// Number of the point at which the leg ends on which it is at first.
        leg: u8,
        /// Points that turn back lead past it again: as far along them it may be already,
        /// decimetres, rounded up. Two bytes, since there is one for each contact.
        more_dm: u16,
    },
}

/// A path that comes nearer again by less than this does not come back, metres.
const RETURN_TOLERANCE_M: f32 = 0.05;

impl PlaceOnPoints {
    /// Looks for the places on the points at which it may be: the first one, and how far from there
    /// the last one is.
    #[inline(never)]
    pub fn find(position: &Point, points: &[Point]) -> Self {
        let (mut found, mut more_m): (Option<u8>, f32) = (None, 0.0);
        let Some(mut from) = points.first() else { return Self::Beside };
        let away_m = |place: &Point| sqrtf((position - place).norm_squared());
        // Distance of the first place and, from there along the points, of the leg; whether the
        // points have led away since.
        let (mut least_m, mut along_m, mut left) = (OFF_REPORTED_PATH_M, 0.0, false);
        let mut start_m = away_m(from);
        for (i, to) in points.iter().enumerate() {
            let place = nearest(position, from, to);
            let (apart_m, upto_m) = (away_m(&place), sqrtf((place - from).norm_squared()));
            if !left && apart_m < least_m {
                (found, least_m, along_m) = (Some(i as u8), apart_m, -upto_m);
            } else if left
                && apart_m < OFF_REPORTED_PATH_M
                && apart_m + RETURN_TOLERANCE_M < start_m
            {
                more_m = along_m + upto_m;
            }
            along_m += sqrtf((to - from).norm_squared());
            start_m = away_m(to);
            left |= found.is_some() && start_m > least_m + RETURN_TOLERANCE_M;
            from = to;
        }
        // The cast saturates.
        found.map_or(Self::Beside, |leg| Self::On {
            leg,
            more_dm: libm::ceilf(10.0 * more_m) as u16,
        })
    }

    /// The place on the points, and the points after it; none where the vehicle is beside them.
    fn ahead<'a>(&self, position: &Point, points: &'a [Point]) -> Option<(Point, &'a [Point])> {
        let Self::On { leg, .. } = *self else { return None };
        let leg = usize::from(leg);
        let to = points.get(leg)?;
        // No leg ends at the first point: it is the place itself, and would take the room of
        // another one.
        let ahead = &points[leg.max(1).min(points.len())..];
        Some((nearest(position, &points[leg.saturating_sub(1)], to), ahead))
    }

    /// Distance along the points from that place that the vehicle may have flown already, metres.
    #[inline]
    pub fn flown_beyond_m(&self) -> f32 {
        if let Self::On { more_dm, .. } = *self { 0.1 * f32::from(more_dm) } else { 0.0 }
    }
}

/// The place on a leg that is nearest to another place. One copy of it: a board has little room.
#[inline(never)]
fn nearest(position: &Point, from: &Point, to: &Point) -> Point {
    let leg = to - from;
    let length_sq = leg.norm_squared();
    let share = if length_sq > 0.0 { (position - from).dot(&leg) / length_sq } else { 0.0 };
    from + leg * clamp_share(share)
}

/// Bounds of a neighbour's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionBounds {
    /// How it stops.
    pub braking: Braking,
    /// Fastest flight, m/s.
    pub speed_max_mps: f32,
    /// Time after which a vehicle that no other vehicle hears has stopped, seconds.
    pub silent_s: f32,
}

impl MotionBounds {
    /// Whether all are positive and finite; the error names the first that is not.
    pub fn check(&self) -> Result<(), ConfigError> {
        all_positive(&[
            ("accel_mps2", self.braking.accel_mps2),
            ("jerk_mps3", self.braking.jerk_mps3),
            ("speed_max_mps", self.speed_max_mps),
            ("silent_s", self.silent_s),
        ])
    }
}

/// The lesser of two, `b` where `a` is no number. A board takes three times as long for `min`,
/// which asks the same of `b`.
#[inline]
fn less(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

impl NeighbourMotion<'_> {
    /// Distance from its place that the neighbour can reach in any direction, `ahead_s` of flight
    /// included, metres.
    #[inline]
    pub fn reach_m(&self, bounds: &MotionBounds, ahead_s: f32) -> f32 {
        if self.grounded {
            return 0.0;
        }
        if self.age_s > FRESH_S {
            return self.reach_any_direction_m(bounds);
        }
        let along_m = self.distance_until_stop_m(bounds, ahead_s);
        let Some(first) = self.points.first() else {
            return along_m + self.lateral_reach_m(bounds);
        };
        let away = (first - self.position).abs();
        // No less than the distance, and no square root.
        let first_m = away.x + away.y + away.z;
        // Where the place on the points was not sought yet only their extent is known.
        let more_m = if self.place_on_points == PlaceOnPoints::Unknown {
            2.0 * self.extent_m
        } else {
            self.place_on_points.flown_beyond_m()
        };
        if first_m < OFF_REPORTED_PATH_M {
            // On its points, and no further than those lead.
            return less(along_m + more_m + OFF_REPORTED_PATH_M, first_m + self.extent_m);
        }
        along_m + more_m + self.lateral_reach_m(bounds) + OFF_REPORTED_PATH_M
    }

    /// Age of the neighbour's last report, seconds.
    #[inline]
    fn data_age_s(&self) -> f32 {
        self.age_s + self.delay_s
    }

    #[inline]
    fn reach_any_direction_m(&self, bounds: &MotionBounds) -> f32 {
        // The neighbour learns that no vehicle hears it by messages that are as late as its own.
        bounds.speed_max_mps * less(self.data_age_s(), bounds.silent_s + 2.0 * self.delay_s)
    }

    /// Distance that the neighbour flies until it has stopped.
    #[inline]
    fn distance_until_stop_m(&self, bounds: &MotionBounds, ahead_s: f32) -> f32 {
        if self.rests_within_m > 0.0 {
            return self.rests_within_m;
        }
        // The neighbour may have begun to speed up since it was heard.
        let gained_mps = bounds.braking.accel_mps2 * (self.data_age_s() + REACTION_S);
        let max_mps = bounds.speed_max_mps;
        let most_mps = if self.speed_mps > max_mps { self.speed_mps } else { max_mps };
        let speed_mps = less(less(self.speed_mps + gained_mps, most_mps), 2.0 * max_mps);
        let stop_m = bounds.braking.stop_m(speed_mps);
        speed_mps * (self.data_age_s() + REACTION_S + MAX_LAG_S)
            + stop_m
            + ahead_s * bounds.speed_max_mps
    }

    #[inline]
    fn lateral_reach_m(&self, bounds: &MotionBounds) -> f32 {
        0.5 * bounds.braking.accel_mps2 * self.data_age_s() * self.data_age_s()
    }

    /// Set of places where the neighbour can be; with `ahead_s` also where its points lead it in so
    /// much time.
    pub fn reachable_set(&self, bounds: &MotionBounds, ahead_s: f32) -> ReachableSet {
        let mut set = ReachableSet::at(self.position);
        if self.grounded {
            // Its height on the ground may be unknown.
            set.add_column(self.column_to_m);
            return set;
        }
        if self.age_s > FRESH_S {
            set.widened_by_m = self.reach_any_direction_m(bounds);
        } else {
            self.add_motion(&mut set, bounds, ahead_s);
        }
        set.add_column(self.column_to_m);
        set
    }

    fn add_motion(&self, set: &mut ReachableSet, bounds: &MotionBounds, ahead_s: f32) {
        let joint = self.place_on_points();
        if let Some((nearest, ahead)) = joint.ahead(&self.position, self.points) {
            let ahead = core::iter::once(nearest).chain(ahead.iter().copied());
            set.extend_along(
                ahead,
                joint.flown_beyond_m() + self.distance_until_stop_m(bounds, ahead_s),
            );
        } else {
            let share = if self.speed_mps > 0.0 {
                self.distance_until_stop_m(bounds, 0.0) / self.speed_mps
            } else {
                0.0
            };
            set.push(self.position + self.velocity * share);
            set.widened_by_m = self.lateral_reach_m(bounds);
        }
    }

    #[inline]
    fn place_on_points(&self) -> PlaceOnPoints {
        if self.place_on_points == PlaceOnPoints::Unknown {
            PlaceOnPoints::find(&self.position, self.points)
        } else {
            self.place_on_points
        }
    }
}

#[cfg(test)]
mod plain_tests;
#[cfg(test)]
mod tests;
