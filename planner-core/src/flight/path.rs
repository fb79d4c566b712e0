//! A path: a polyline with the clearance of its legs and the times at its corners.

use heapless::Vec;
use libm::{fmaxf, fminf};

use crate::{Length, Point};

/// A corner of a path, with the times that the schedule gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Position, ENU metres in the mission frame.
    pub position: Point,
    /// Clearance of the leg that ends at this waypoint: distance from the leg to the nearest
    /// obstacle, metres.
    pub leg_clearance_m: f32,
    /// Arc length from the first waypoint to this one, metres.
    pub along_m: f32,
    /// Scheduled arrival, seconds after take-off at nominal speed. In flight only the order of
    /// these times matters.
    pub arrive_s: f32,
    /// Scheduled departure, seconds after take-off: later than `arrive_s` where the vehicle hovers
    /// here to let another vehicle pass.
    pub leave_s: f32,
}

/// Reason why a path was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathError {
    /// The path has more than `W` waypoints, or its [`PicturePlan`](super::PicturePlan) has no room
    /// for a stretch.
    PathFull,
    /// A coordinate, a clearance or the length is NaN or infinite.
    NotFinite,
    /// The path is longer than the progress that vehicles can report over the radio:
    /// [`crate::coverage::flights::MAX_PATH_LENGTH_M`].
    TooLong,
}

/// A polyline through free space, from the point above the pad to the goal. Arc length is 0 at the
/// first waypoint, negative during take-off, and beyond [`Path::length_m`] during landing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path<const W: usize> {
    waypoints: Vec<Waypoint, W>,
}

impl<const W: usize> Path<W> {
    /// Creates a path without waypoints.
    pub const fn new() -> Self {
        Self { waypoints: Vec::new() }
    }

    /// Index of the path's last waypoint; `None` if the path is empty.
    pub fn last_index(&self) -> Option<usize> {
        self.waypoints.len().checked_sub(1)
    }

    /// Sets the times of all waypoints for a flight without stops: `first_s` at the first one; each
    /// other one is later than the one before by `seconds` of the leg between the two.
    pub fn set_times_by_leg(&mut self, first_s: f32, seconds: impl Fn(&Point, &Point) -> f32) {
        let mut before: Option<(Point, f32)> = None;
        for waypoint in &mut self.waypoints {
            waypoint.arrive_s =
                before.map_or(first_s, |(from, at_s)| at_s + seconds(&from, &waypoint.position));
            waypoint.leave_s = waypoint.arrive_s;
            before = Some((waypoint.position, waypoint.arrive_s));
        }
    }

    /// Appends a waypoint. One that does not add to the f32 arc length is dropped, and the last
    /// waypoint keeps the smaller of both clearances.
    #[inline(never)]
    pub fn push(&mut self, position: Point, clearance_m: f32) -> Result<(), PathError> {
        if !(position.iter().all(|c| c.is_finite()) && clearance_m.is_finite()) {
            return Err(PathError::NotFinite);
        }
        let along_m = match self.waypoints.last_mut() {
            Some(last) => {
                let along_m = last.along_m + (position - last.position).length();
                if !along_m.is_finite() {
                    return Err(PathError::NotFinite);
                }
                if along_m == last.along_m {
                    last.leg_clearance_m = fminf(last.leg_clearance_m, clearance_m);
                    return Ok(());
                }
                along_m
            }
            None => 0.0,
        };
        let waypoint = Waypoint {
            position,
            leg_clearance_m: clearance_m,
            along_m,
            arrive_s: 0.0,
            leave_s: 0.0,
        };
        self.waypoints.push(waypoint).map_err(|_| PathError::PathFull)
    }

    /// Sets the times of all waypoints for a flight without stops: `first_s` at the first one, at
    /// the others later by arc length over `speed_mps`.
    pub fn set_times_at_speed(&mut self, first_s: f32, speed_mps: f32) {
        for waypoint in &mut self.waypoints {
            waypoint.arrive_s = first_s + waypoint.along_m / speed_mps;
            waypoint.leave_s = waypoint.arrive_s;
        }
    }

    /// Sets arrival and departure of the last waypoint, seconds after take-off.
    pub fn set_last_waypoint_times(&mut self, at_s: f32, leave_s: f32) {
        if let Some(last) = self.waypoints.last_mut() {
            (last.arrive_s, last.leave_s) = (at_s, leave_s);
        }
    }

    /// Time at which the vehicle is at an arc length by the schedule, at the end of a hold there,
    /// seconds after take-off. 0 before the first waypoint; beyond the last one the time at which
    /// the vehicle leaves it.
    pub(crate) fn scheduled_s(&self, along_m: f32) -> f32 {
        let next = self.waypoints.partition_point(|w| w.along_m <= along_m);
        let Some(from) = next.checked_sub(1).map(|at| &self.waypoints[at]) else { return 0.0 };
        self.waypoints.get(next).map_or(from.leave_s, |to| {
            let share = (along_m - from.along_m) / (to.along_m - from.along_m);
            from.leave_s + share * (to.arrive_s - from.leave_s)
        })
    }

    /// All waypoints, in the order of flight.
    pub fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    /// Arc length of the whole path, metres; 0 for an empty path.
    pub fn length_m(&self) -> f32 {
        self.waypoints.last().map_or(0.0, |w| w.along_m)
    }

    /// The point at an arc length, which is clamped to the path; `None` if the path is empty.
    // Not inlined: it has many callers, and a copy of the search in each would take flash on a
    // board.
    #[inline(never)]
    pub fn point_at(&self, along_m: f32) -> Option<Point> {
        self.point_on(self.leg_end_index_at(along_m), along_m)
    }

    /// The points at arc lengths `from_m`, `from_m + step_m` and so on (`step_m` > 0), as
    /// [`Self::point_at`] computes them, in one pass along the path. Never ends; empty on an empty
    /// path.
    pub fn points_from(&self, from_m: f32, step_m: f32) -> impl Iterator<Item = Point> {
        let mut leg = self.leg_end_index_at(from_m);
        let mut steps = 0u16;
        core::iter::from_fn(move || {
            let along_m = from_m + f32::from(steps) * step_m;
            steps = steps.saturating_add(1);
            while leg < self.waypoints.len() && along_m > self.waypoints[leg].along_m {
                leg += 1;
            }
            self.point_on(leg, along_m)
        })
    }

    /// Index of the waypoint that ends the leg on which an arc length lies: 0 at or before the
    /// first waypoint, the number of waypoints beyond the last one.
    fn leg_end_index_at(&self, along_m: f32) -> usize {
        self.waypoints.partition_point(|w| w.along_m < along_m)
    }

    /// The point at an arc length on the leg that ends at waypoint `leg`.
    fn point_on(&self, leg: usize, along_m: f32) -> Option<Point> {
        let (first, last) = (self.waypoints.first()?, self.waypoints.last()?);
        let Some(to) = self.waypoints.get(leg) else { return Some(last.position) };
        if leg == 0 || along_m <= 0.0 {
            return Some(first.position);
        }
        let from = &self.waypoints[leg - 1];
        let share = (along_m - from.along_m) / (to.along_m - from.along_m);
        Some(from.position + (to.position - from.position) * share)
    }

    /// Arc length, metres, of the point of the path that is nearest to `position`, sought only at
    /// arc lengths within `window_m` of `near_m`: a vehicle's progress, without a jump to another
    /// part of the path that passes close by.
    pub fn project(&self, position: &Point, near_m: f32, window_m: f32) -> f32 {
        let (low, high) = (near_m - window_m, near_m + window_m);
        let mut best = (f32::INFINITY, near_m);
        let first = self.leg_end_index_at(low).max(1);
        for leg in self.waypoints.get(first - 1..).unwrap_or_default().windows(2) {
            if leg[0].along_m > high {
                break;
            }
            let direction = leg[1].position - leg[0].position;
            let share = (position - leg[0].position).dot(&direction) / direction.norm_squared();
            let length = leg[1].along_m - leg[0].along_m;
            // Not `clamp`: it panics where the window is NaN or negative.
            let along_m = fminf(fmaxf(leg[0].along_m + share.clamp(0.0, 1.0) * length, low), high);
            let share = ((along_m - leg[0].along_m) / length).clamp(0.0, 1.0);
            let distance = (leg[0].position + direction * share - position).norm_squared();
            if distance < best.0 {
                best = (distance, along_m);
            }
        }
        best.1
    }
}

#[cfg(test)]
pub(crate) mod tests;
