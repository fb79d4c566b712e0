//! Geometry of the safety filter: the set of places where a vehicle can be until it has stopped,
//! and whether two such sets come too near each other.
//!
//! The own vehicle's set ([`ReachableSet::along`], [`ReachableSet::vertical`]) is the motion that
//! it can no longer avoid: [`REACTION_S`] at its present speed, then a stop at its limits along its
//! reference. A neighbour's set ([`NeighbourMotion::reachable_set`]) depends only on the
//! neighbour's last reports: on no gate, no progress, no advice.
//!
//! Two sets conflict ([`OwnSet::conflicts`]) where they come nearer than the safety distance. A
//! motion that does not reduce a distance that is already too small never conflicts. A vehicle that
//! stops as soon as its set conflicts stays inside its set of the step before, which did not
//! conflict: that is the safety argument (`docs/safety.md`).
//!
//! ENU metres. Sets have no times, so two vehicles that pass a place one after the other still
//! conflict there. Cost: the segments of one set times those of the other;
//! [`NeighbourMotion::max_reach_m`] is a cheap bound that rules out the many far neighbours. The
//! own set is prepared once ([`OwnSet`]), so that most segments of the others are ruled out without
//! computing a distance.

mod own;
mod place;
mod set;

pub use self::own::{Legs, OwnSet};
pub use self::place::{
    OFF_REPORTED_PATH_M, OFF_REPORTED_PATH_PER_SPEED_S, PlaceOnPoints, ReportedPathReach,
};
pub use self::set::ReachableSet;
use crate::{Point, SettingError, check_positive};

/// Time from a decision of the filter to the first motion that follows it, seconds: two setpoint
/// periods.
pub const REACTION_S: f32 = 0.1;
/// Greatest lag of a vehicle behind its reference, seconds: in a stop the vehicle flies on for this
/// time.
pub const MAX_LAG_S: f32 = 0.25;
/// Age up to which the last report of a neighbour is fresh, seconds; after that the neighbour is
/// stale.
pub const FRESH_S: f32 = 1.0;

/// Limits by which a vehicle stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// Deceleration that is counted on, m/s².
    pub accel_mps2: f32,
    /// Jerk with which braking begins, m/s³.
    pub jerk_mps3: f32,
}

impl Braking {
    /// Distance from the beginning of braking at this speed to rest, metres.
    #[inline]
    pub fn stop_distance_m(&self, speed_mps: f32) -> f32 {
        let ramp_s = self.accel_mps2 / self.jerk_mps3;
        0.5 * speed_mps * (speed_mps / self.accel_mps2 + ramp_s)
    }
}

/// Last reports of a neighbour and values derived from them, from which its reachable set is
/// computed.
#[derive(Clone, Copy, Debug)]
pub struct NeighbourMotion<'a> {
    /// Position of the neighbour when it was last heard, ENU metres in the mission frame.
    pub position: Point,
    /// Velocity of the neighbour when it was last heard, ENU m/s.
    pub velocity: Point,
    /// Speed of the neighbour, m/s: the length of `velocity`.
    pub speed_mps: f32,
    /// Seconds since position and velocity were heard.
    pub age_s: f32,
    /// Delay of the neighbour's messages on the radio link, seconds.
    pub delay_s: f32,
    /// Points that the neighbour reports to fly along next; empty while a pilot or a failsafe flies
    /// it.
    pub reported_points: &'a [Point],
    /// Where the neighbour is on its reported points.
    pub place_on_points: PlaceOnPoints,
    /// How far its reported points lead the neighbour, from its position.
    pub reported_path_reach: ReportedPathReach,
    /// Distance along its points within which a neighbour that has been silent for long may have
    /// stopped, metres; 0 for a neighbour that is heard.
    pub rests_within_m: f32,
    /// Whether the neighbour stands on the ground.
    pub grounded: bool,
    /// Height down to which the column below the neighbour belongs to its set, metres up in the
    /// mission frame; `None` while it flies along its points.
    pub column_bottom_z_m: Option<f32>,
}

/// Bounds of a neighbour's motion, from which its reachable set is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionBounds {
    /// Limits by which the neighbour stops.
    pub braking: Braking,
    /// Greatest speed that a neighbour is assumed to fly at, m/s.
    pub speed_max_mps: f32,
    /// Time after which a vehicle that no other vehicle hears has stopped, seconds.
    pub stopped_when_unheard_for_s: f32,
}

impl MotionBounds {
    /// Checks that all numbers are positive and finite; the error names the first that is not.
    pub fn check(&self) -> Result<(), SettingError> {
        check_positive(&[
            ("accel_mps2", self.braking.accel_mps2),
            ("jerk_mps3", self.braking.jerk_mps3),
            ("speed_max_mps", self.speed_max_mps),
            ("stopped_when_unheard_for_s", self.stopped_when_unheard_for_s),
        ])
    }
}

/// The lesser of two numbers; `b` if `a` is NaN. `f32::min`, which also checks `b` for NaN, takes
/// three times as long on a board.
#[inline]
fn fast_min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

impl NeighbourMotion<'_> {
    /// Upper bound of the distance from `position` to any place of the neighbour's set, with
    /// `ahead_s` more seconds of flight, metres. The column is not counted.
    #[inline]
    pub fn max_reach_m(&self, bounds: &MotionBounds, ahead_s: f32) -> f32 {
        if self.grounded {
            return 0.0;
        }
        if self.age_s > FRESH_S {
            return self.reach_any_direction_m(bounds);
        }
        let until_stop_m = self.distance_until_stop_m(bounds, ahead_s);
        let ReportedPathReach { added_reach_m: beyond_m, max_reach_m: most_m } =
            self.reported_path_reach;
        fast_min(until_stop_m + beyond_m + self.lateral_reach_m(bounds), most_m)
    }

    /// Age of the neighbour's position and velocity, the radio's delay included, seconds.
    #[inline]
    fn data_age_s(&self) -> f32 {
        self.age_s + self.delay_s
    }

    /// Greatest distance, in any direction, of a stale neighbour from its last reported position,
    /// metres.
    #[inline]
    fn reach_any_direction_m(&self, bounds: &MotionBounds) -> f32 {
        // The neighbour learns that no vehicle hears it from messages that are delayed as much as
        // its own.
        bounds.speed_max_mps
            * fast_min(self.data_age_s(), bounds.stopped_when_unheard_for_s + 2.0 * self.delay_s)
    }

    /// Distance that the neighbour may fly until it has stopped, with `ahead_s` more seconds of
    /// flight, metres.
    #[inline]
    fn distance_until_stop_m(&self, bounds: &MotionBounds, ahead_s: f32) -> f32 {
        if self.rests_within_m > 0.0 {
            return self.rests_within_m;
        }
        // The neighbour may have begun to accelerate since it was heard.
        let gained_mps = bounds.braking.accel_mps2 * (self.data_age_s() + REACTION_S);
        let max_mps = bounds.speed_max_mps;
        let most_mps = if self.speed_mps > max_mps { self.speed_mps } else { max_mps };
        let speed_mps = fast_min(fast_min(self.speed_mps + gained_mps, most_mps), 2.0 * max_mps);
        let stop_m = bounds.braking.stop_distance_m(speed_mps);
        speed_mps * (self.data_age_s() + REACTION_S + MAX_LAG_S)
            + stop_m
            + ahead_s * bounds.speed_max_mps
    }

    /// Distance to the side that acceleration may have carried the neighbour since its data,
    /// metres.
    #[inline]
    fn lateral_reach_m(&self, bounds: &MotionBounds) -> f32 {
        0.5 * bounds.braking.accel_mps2 * self.data_age_s() * self.data_age_s()
    }

    /// Set of places where the neighbour can be until it has stopped. Along its points it flies on
    /// for `ahead_s` seconds before it brakes.
    pub fn reachable_set(&self, bounds: &MotionBounds, ahead_s: f32) -> ReachableSet {
        let mut set = ReachableSet::at(self.position);
        if self.grounded {
            // A column too, since the height of the ground may be unknown.
            set.add_column(self.column_bottom_z_m);
            return set;
        }
        if self.age_s > FRESH_S {
            set.widened_by_m = self.reach_any_direction_m(bounds);
        } else {
            self.add_motion(&mut set, bounds, ahead_s);
        }
        set.add_column(self.column_bottom_z_m);
        set
    }

    /// Adds the motion of a fresh neighbour: along its points if it is on them, else straight on,
    /// widened by what it may accelerate to the side.
    fn add_motion(&self, set: &mut ReachableSet, bounds: &MotionBounds, ahead_s: f32) {
        let place = self.place_on_points();
        if let Some((nearest, ahead)) = place.ahead(&self.position, self.reported_points) {
            let ahead = core::iter::once(nearest).chain(ahead.iter().copied());
            set.extend_along(
                ahead,
                place.place_uncertainty_m() + self.distance_until_stop_m(bounds, ahead_s),
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

    /// Where the neighbour is on its points; computed here if that was not done when it was heard.
    #[inline]
    fn place_on_points(&self) -> PlaceOnPoints {
        if self.place_on_points == PlaceOnPoints::Unknown {
            PlaceOnPoints::find(&self.position, self.reported_points, &self.velocity)
        } else {
            self.place_on_points
        }
    }
}

#[cfg(test)]
mod tests;
