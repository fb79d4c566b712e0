//! Where a neighbour is on the path points that it reports to fly along next, and how far these
//! points lead it.

use fpu::sqrtf;

use crate::Point;
use crate::geo::distance::{Length, clamp_to_unit};
use crate::track::{LEAD_PER_SPEED_S, WALKING_SPEED_MPS};

/// Greatest distance from its reported path points at which a vehicle at walking speed counts as
/// flying along them, metres: real vehicles lag by up to 0.5 m and deviate by 0.4 m.
pub const OFF_REPORTED_PATH_M: f32 = 0.9;
/// Addition to [`OFF_REPORTED_PATH_M`] behind the first reported point, which is the vehicle's
/// setpoint, for each m/s above walking speed (2 m/s), seconds: the setpoint may lead the vehicle
/// by that much more.
pub const OFF_REPORTED_PATH_PER_SPEED_S: f32 = LEAD_PER_SPEED_S;
/// Greatest distance behind its first reported point, the setpoint, at which a vehicle at this
/// speed counts as flying along its points, metres; beside the other points [`OFF_REPORTED_PATH_M`]
/// applies.
#[inline]
fn off_reported_path_m(speed_mps: f32) -> f32 {
    let faster_mps = speed_mps - WALKING_SPEED_MPS;
    // False for NaN.
    if faster_mps > 0.0 {
        OFF_REPORTED_PATH_M + OFF_REPORTED_PATH_PER_SPEED_S * faster_mps
    } else {
        OFF_REPORTED_PATH_M
    }
}

/// Place of a vehicle on the polyline of points that it reports. Valid until position or points are
/// heard again.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PlaceOnPoints {
    /// Not computed yet.
    #[default]
    Unknown,
    /// The vehicle is further from its points than one that flies along them.
    Beside,
    /// The vehicle is on its points.
    On {
        /// Index of the point that ends the first leg on which the vehicle may be; 0 if the first
        /// place where it may be is the first point.
        leg_end: u8,
        /// Distance along the points from the first place where the vehicle may be to the last one,
        /// decimetres, rounded up: above 0 where the points turn back and lead past the vehicle
        /// again. Two bytes, since this is stored for each neighbour.
        uncertainty_dm: u16,
    },
}

/// Points that come nearer to the vehicle again by less than this do not count as leading past it
/// again, metres.
const RETURN_TOLERANCE_M: f32 = 0.05;

impl PlaceOnPoints {
    /// Finds the first place on the points at which the vehicle may be, and how far along the
    /// points after it the last such place is.
    #[inline(never)]
    pub fn find(position: &Point, points: &[Point], velocity: &Point) -> Self {
        let Some((mut from, others)) = points.split_first() else { return Self::Beside };
        let away_m = |place: &Point| sqrtf((position - place).norm_squared());
        // Distance of the vehicle from `from`.
        let mut start_m = away_m(from);
        // Whether the vehicle follows its setpoint, the first point, at a distance.
        let follows = start_m > OFF_REPORTED_PATH_M
            && (from - position).dot(velocity) > 0.0
            && start_m < off_reported_path_m(velocity.length());
        // Leg of the first place, and distance of the vehicle from there.
        let (mut found, mut least_m) = if start_m < OFF_REPORTED_PATH_M || follows {
            (Some(0), start_m)
        } else {
            (None, OFF_REPORTED_PATH_M)
        };
        // Arc length from that place to the current leg; whether the points have led away from the
        // vehicle since. A vehicle that follows its setpoint flies to it even where later points
        // lead nearer past the vehicle.
        let (mut along_m, mut more_m, mut left) = (0.0, 0.0, follows);
        for (to, leg) in others.iter().zip(1_u8..) {
            let place = nearest_point_on_leg(position, from, to);
            let (apart_m, upto_m) = (away_m(&place), sqrtf((place - from).norm_squared()));
            if !left && apart_m < least_m {
                (found, least_m, along_m) = (Some(leg), apart_m, -upto_m);
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
        // The cast to `u16` saturates.
        found.map_or(Self::Beside, |leg| Self::On {
            leg_end: leg,
            uncertainty_dm: libm::ceilf(10.0 * more_m) as u16,
        })
    }

    /// The first place on the points, and the points after it; `None` where the vehicle is beside
    /// its points.
    pub(super) fn ahead<'a>(
        &self,
        position: &Point,
        points: &'a [Point],
    ) -> Option<(Point, &'a [Point])> {
        let Self::On { leg_end: leg, .. } = *self else { return None };
        let leg = usize::from(leg);
        let to = points.get(leg)?;
        // No leg ends at the first point: that point is the place itself, and would take up the
        // room of another point.
        let ahead = &points[leg.max(1).min(points.len())..];
        Some((nearest_point_on_leg(position, &points[leg.saturating_sub(1)], to), ahead))
    }

    /// Distance along the points beyond the first place that the vehicle may have flown already,
    /// metres.
    #[inline]
    pub fn place_uncertainty_m(&self) -> f32 {
        if let Self::On { uncertainty_dm, .. } = *self {
            0.1 * f32::from(uncertainty_dm)
        } else {
            0.0
        }
    }
}

/// The point of the leg from `from` to `to` that is nearest to `position`. Not inlined: a board has
/// little flash.
#[inline(never)]
fn nearest_point_on_leg(position: &Point, from: &Point, to: &Point) -> Point {
    let leg = to - from;
    let length_sq = leg.norm_squared();
    let share = if length_sq > 0.0 { (position - from).dot(&leg) / length_sq } else { 0.0 };
    from + leg * clamp_to_unit(share)
}

/// How far the path points that a neighbour reports lead it, as straight distances from its
/// position. Computed once, when the points are heard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReportedPathReach {
    /// Addition to the distance that the neighbour flies until it has stopped, metres: from its
    /// position to its place on the points, and from the first place where it may be to the last.
    pub added_reach_m: f32,
    /// Upper bound of the distance to any place on the points, metres; infinite where the neighbour
    /// may leave them.
    pub max_reach_m: f32,
}

impl ReportedPathReach {
    /// Where a neighbour has no points, or is beside them: nothing but its motion bounds its reach.
    pub const UNBOUNDED: Self = Self { added_reach_m: 0.0, max_reach_m: f32::INFINITY };

    /// The reach from `position` along `points`, of which none is further from the first one than
    /// `extent_m`, metres. Not inlined: a board has little flash.
    #[inline(never)]
    pub fn new(
        position: &Point,
        points: &[Point],
        place_on_points: &PlaceOnPoints,
        extent_m: f32,
    ) -> Self {
        let away_m = |place: &Point| sqrtf((place - position).norm_squared());
        let Some(first) = points.first() else { return Self::UNBOUNDED };
        if *place_on_points == PlaceOnPoints::Unknown {
            // Only the points' extent bounds the place. Near the first point the vehicle is on
            // them.
            let first_m = away_m(first);
            let on = first_m < OFF_REPORTED_PATH_M;
            let most_m = if on { first_m + extent_m } else { f32::INFINITY };
            return Self { added_reach_m: first_m + extent_m, max_reach_m: most_m };
        }
        place_on_points.ahead(position, points).map_or(Self::UNBOUNDED, |(place, _)| Self {
            added_reach_m: away_m(&place) + place_on_points.place_uncertainty_m(),
            max_reach_m: away_m(first) + extent_m,
        })
    }
}
