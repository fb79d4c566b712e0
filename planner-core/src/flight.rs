//! Plan types: a path, the gates along it, a vehicle's flight and what its companion needs of the
//! swarm's plan.
//!
//! They hold data and answer for geometry alone. Metres, seconds, ENU in the mission frame; arc
//! length runs along the path.

mod done;
mod photographs;

use heapless::Vec;
use libm::{fmaxf, fminf};

pub use self::done::{WaypointRange, WaypointSet};
pub use self::photographs::{HeadingMode, PicturePlan, PictureStretch, Trigger};
use crate::{Length, Point};

/// A corner of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Place, ENU metres.
    pub position: Point,
    /// Clearance of the leg that ends here, metres from its line to the nearest obstacle.
    pub clearance_m: f32,
    /// Arc length from the first waypoint, metres.
    pub along_m: f32,
    /// Label of the swarm's schedule: arrival, seconds after take-off at nominal speed. Only its
    /// order matters in flight.
    pub arrive_s: f32,
    /// Time of the departure, seconds: later than `arrive_s` where the schedule lets another
    /// vehicle pass.
    pub leave_s: f32,
}

/// Reason why a path was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathError {
    /// The path has more than `W` waypoints.
    PathFull,
    /// A coordinate, a clearance or the length is NaN or infinite.
    NotFinite,
    /// The path is longer than vehicles can report to each other:
    /// [`crate::coverage::flights::MAX_PATH_LENGTH_M`].
    TooLong,
}

/// A polyline through free space, from the point above the pad to the goal. Arc length runs from 0
/// at the first waypoint; take-off lies before 0, landing beyond [`Path::length_m`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path<const W: usize> {
    waypoints: Vec<Waypoint, W>,
}

impl<const W: usize> Path<W> {
    /// A path without waypoints.
    pub const fn new() -> Self {
        Self { waypoints: Vec::new() }
    }

    /// Index of the path's last waypoint; `None` if the path is empty.
    pub fn last(&self) -> Option<usize> {
        self.waypoints.len().checked_sub(1)
    }

    /// Labels every waypoint without a stop: the first at `first_s`, each other one `seconds` of
    /// its leg later.
    pub fn label_times_by(&mut self, first_s: f32, seconds: impl Fn(&Point, &Point) -> f32) {
        let mut before: Option<(Point, f32)> = None;
        for waypoint in &mut self.waypoints {
            waypoint.arrive_s =
                before.map_or(first_s, |(from, at_s)| at_s + seconds(&from, &waypoint.position));
            waypoint.leave_s = waypoint.arrive_s;
            before = Some((waypoint.position, waypoint.arrive_s));
        }
    }

    /// Appends a waypoint; a leg too short to count is dropped, keeping the smaller clearance of
    /// the two.
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
                    last.clearance_m = fminf(last.clearance_m, clearance_m);
                    return Ok(());
                }
                along_m
            }
            None => 0.0,
        };
        let waypoint = Waypoint { position, clearance_m, along_m, arrive_s: 0.0, leave_s: 0.0 };
        self.waypoints.push(waypoint).map_err(|_| PathError::PathFull)
    }

    /// Labels every waypoint without a stop: the first at `first_s`, the others after their arc
    /// length at `speed_mps`.
    pub fn label_times(&mut self, first_s: f32, speed_mps: f32) {
        for waypoint in &mut self.waypoints {
            waypoint.arrive_s = first_s + waypoint.along_m / speed_mps;
            waypoint.leave_s = waypoint.arrive_s;
        }
    }

    /// Labels the last waypoint.
    pub fn set_last_times(&mut self, at_s: f32, leave_s: f32) {
        if let Some(last) = self.waypoints.last_mut() {
            (last.arrive_s, last.leave_s) = (at_s, leave_s);
        }
    }

    /// The waypoints in order.
    pub fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    /// Arc length of the whole path, metres; 0 for an empty path.
    pub fn length_m(&self) -> f32 {
        self.waypoints.last().map_or(0.0, |w| w.along_m)
    }

    /// The point at an arc length, clamped to the path; `None` on an empty path.
    // Inlined in its many callers the search would take a board's flash.
    #[inline(never)]
    pub fn point_at(&self, along_m: f32) -> Option<Point> {
        self.point_on(self.leg_at(along_m), along_m)
    }

    /// The points at `from_m`, `from_m + step_m` and so on (a positive step), each as
    /// [`Self::point_at`] has it, in one walk along the path; none on an empty path.
    pub fn points_from(&self, from_m: f32, step_m: f32) -> impl Iterator<Item = Point> {
        let mut leg = self.leg_at(from_m);
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

    /// Index of the waypoint that ends the leg on which an arc length lies; beyond the last
    /// waypoint there is none.
    fn leg_at(&self, along_m: f32) -> usize {
        self.waypoints.partition_point(|w| w.along_m < along_m)
    }

    /// The point at an arc length on the leg that ends at a waypoint.
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

    /// Arc length of the point of the path nearest to `position` within `window_m` of `near_m`: how
    /// far a vehicle has come, without jumping to another stretch that passes close by.
    pub fn project(&self, position: &Point, near_m: f32, window_m: f32) -> f32 {
        let (low, high) = (near_m - window_m, near_m + window_m);
        let mut best = (f32::INFINITY, near_m);
        let first = self.leg_at(low).max(1);
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

/// Greatest error of the progress that a standing vehicle reports, metres.
pub const PROGRESS_ERROR_M: f32 = 0.25;

/// Task of a vehicle on its flight.
///
/// Every task's flight is one path: what differs is what happens along it, which the task says by
/// arc length.
// A tag of its own, so that one that stays is all zeros and a static of plans costs .bss alone.
#[repr(u8)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Task {
    /// The vehicle stays on its pad.
    #[default]
    Stay,
    /// The vehicle flies to the goal with this index and lands below it.
    Goto(u16),
    /// The vehicle photographs along lanes and lands at the end of its path.
    Photograph(PicturePlan),
}

impl Task {
    /// Whether the vehicle leaves its pad.
    pub fn leaves_pad(&self) -> bool {
        *self != Self::Stay
    }

    /// Index of the goal flown to. One that flies without a goal ends over its own pad.
    pub fn goal(&self) -> Option<u16> {
        match self {
            Self::Goto(goal) => Some(*goal),
            _ => None,
        }
    }
}

impl From<Option<u16>> for Task {
    /// The task of flying to the goal; without a goal the vehicle stays.
    fn from(goal: Option<u16>) -> Self {
        goal.map_or(Self::Stay, Self::Goto)
    }
}

/// One vehicle's flight from its pad to the ground below its goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight<const W: usize> {
    /// Id of the vehicle, unique in the swarm.
    pub id: u8,
    /// Task of the vehicle.
    pub task: Task,
    /// Air part, start to goal, labelled with seconds after take-off.
    pub path: Path<W>,
    /// Height of the start above the pad, metres.
    pub climb_m: f32,
    /// Height of the goal above the ground there, metres.
    pub descent_m: f32,
    /// Scheduled take-off, seconds after the start at nominal speeds.
    pub depart_s: f32,
    /// Longest timed segment of this flight, metres: [`crate::schedule::MAX_TIMED_SEGMENT_M`], or
    /// more on a flight that is long.
    pub segment_m: f32,
}

/// "Before my arc length `at_m`, vehicle `id` must have come past `until_m` of its own path."
///
/// Progress is what opens a gate, so a vehicle must report it by these rules:
/// - On its pad it reports −climb. In the climb it reports what is left of it, negative; in the
///   descent the path's length and how far it has come down.
/// - It reports no more than the reference that it follows has come to, and at most
///   [`PROGRESS_ERROR_M`] less once it stands.
/// - It reports more than the path's length and the descent only when it stands on the ground,
///   disarmed.
///
/// A vehicle that waits at its assigned place reports enough progress to open every gate for the
/// part behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Place of the gate, metres along the own path; −climb is the pad.
    pub at_m: f32,
    /// Which vehicle to wait for: its id.
    pub id: u8,
    /// Progress of the other that opens the gate, metres along its path.
    pub until_m: f32,
}

/// The part of the swarm's plan that one companion needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VehiclePlan<const W: usize, const G: usize> {
    /// Task of the vehicle.
    pub task: Task,
    /// Air part, start to goal.
    pub path: Path<W>,
    /// Height of the start above the pad, metres.
    pub climb_m: f32,
    /// Height of the goal above the ground there, metres.
    pub descent_m: f32,
    /// Scheduled take-off, seconds after the start. Not needed to keep apart: it waits on the pad
    /// instead of in the air.
    pub depart_s: f32,
    /// Places to wait at, and for which vehicle.
    pub gates: Vec<Gate, G>,
    /// CRC-32 over the whole swarm's plan: vehicles that agree on it agree on the order at every
    /// gate.
    pub plan_crc: u32,
}

impl<const W: usize, const G: usize> VehiclePlan<W, G> {
    /// The plan of a vehicle that stays on its pad. All zeros, so a static costs .bss alone.
    pub const fn new() -> Self {
        Self {
            task: Task::Stay,
            path: Path::new(),
            climb_m: 0.0,
            descent_m: 0.0,
            depart_s: 0.0,
            gates: Vec::new(),
            plan_crc: 0,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn corner_path(clearance_m: f32) -> Path<8> {
        let mut path = Path::new();
        for (x, y) in [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0)] {
            path.push(Point::new(x, y, 1.0), clearance_m).unwrap();
        }
        path
    }

    #[test]
    fn a_walk_along_the_path_sees_what_single_looks_see() {
        let path = corner_path(0.8);
        for (from_m, step_m) in
            [(0.0, 0.5), (-1.0, 0.7), (5.9, 0.1), (6.0, 3.0), (11.0, 0.4), (20.0, 1.0)]
        {
            for (k, point) in path.points_from(from_m, step_m).take(20).enumerate() {
                assert_eq!(
                    Some(point),
                    path.point_at(from_m + k as f32 * step_m),
                    "{from_m} {step_m} {k}"
                );
            }
        }
        assert_eq!(Path::<4>::new().points_from(0.0, 1.0).next(), None);
        assert_eq!(Path::<4>::new().point_at(0.0), None);
    }

    #[test]
    fn projection_stays_on_the_stretch_at_hand() {
        let mut path = Path::<8>::new();
        for (x, y) in [(0.0, 0.0), (5.0, 0.0), (5.0, 0.5), (0.0, 0.5)] {
            path.push(Point::new(x, y, 1.0), 1.0).unwrap();
        }
        let along = path.project(&Point::new(2.0, 0.4, 1.0), 1.5, 2.0);
        assert!((along - 2.0).abs() < 1e-4, "{along}");
    }

    #[test]
    fn refuses_nan_and_overflow_by_name() {
        let mut path = Path::<1>::new();
        assert_eq!(path.push(Point::new(f32::NAN, 0.0, 0.0), 1.0), Err(PathError::NotFinite));
        path.push(Point::zeros(), 1.0).unwrap();
        assert_eq!(path.push(Point::new(1.0, 0.0, 0.0), 1.0), Err(PathError::PathFull));
    }
}
