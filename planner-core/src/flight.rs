//! Plan types: a path, the gates along it, a vehicle's flight, and the part of the swarm's plan
//! that its companion needs.
//!
//! These types hold data and compute geometry only. Metres, seconds, ENU in the mission frame; arc
//! length is measured along the path from its first waypoint.

mod done;
pub(crate) mod path;
mod photographs;

use heapless::Vec;

pub use self::done::{WaypointRange, WaypointSet};
pub use self::path::{Path, PathError, Waypoint};
pub use self::photographs::{HeadingMode, PicturePlan, PictureStretch, Trigger, WaypointOrder};

/// Most metres by which the progress that a standing vehicle reports may be behind its reference.
pub const MAX_REPORTED_PROGRESS_LAG_M: f32 = 0.25;

/// Task of a vehicle on its flight: to stay, to fly to a goal, or to photograph.
///
/// Whatever the task, the flight is one path. A task that acts along the path gives the places of
/// its actions as arc lengths.
// `repr(u8)`, so that `Stay` is all zeros and a static of plans takes .bss only.
#[repr(u8)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Task {
    /// The vehicle stays on its pad.
    #[default]
    Stay,
    /// The vehicle flies to the goal with this index among the roadmap's goals, and lands below
    /// that goal.
    Goto(u16),
    /// The vehicle takes pictures along lanes, and lands at the end of its path.
    Photograph(PicturePlan),
}

impl Task {
    /// Whether the vehicle takes off.
    pub fn leaves_pad(&self) -> bool {
        *self != Self::Stay
    }

    /// Index of the goal among the roadmap's goals; `None` for a vehicle that stays, or that
    /// photographs and lands on its own pad.
    pub fn goal(&self) -> Option<u16> {
        match self {
            Self::Goto(goal) => Some(*goal),
            _ => None,
        }
    }
}

impl From<Option<u16>> for Task {
    /// The task of flying to this goal; `None` is a vehicle that stays on its pad.
    fn from(goal: Option<u16>) -> Self {
        goal.map_or(Self::Stay, Self::Goto)
    }
}

/// One vehicle's flight from its pad to the ground below the end of its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight<const W: usize> {
    /// Id of the vehicle, unique in the swarm.
    pub vehicle_id: u8,
    /// Task of the vehicle.
    pub task: Task,
    /// The part of the flight along the path, from above the pad to above the landing place; times
    /// in seconds after take-off.
    pub path: Path<W>,
    /// Height of the path's first waypoint above the pad, metres.
    pub climb_m: f32,
    /// Height of the path's last waypoint above the ground below it, metres.
    pub descent_m: f32,
    /// Scheduled take-off, seconds after the mission's start, if all vehicles fly at nominal
    /// speeds.
    pub depart_s: f32,
    /// Greatest length that a timed segment of the flight may have, metres:
    /// [`crate::schedule::DEFAULT_MAX_SEGMENT_M`], or on a long flight that length doubled once or
    /// more.
    pub max_segment_m: f32,
}

/// "Before arc length `at_m` of its own path the vehicle waits until vehicle `wait_for_id` has
/// reported progress of at least `open_from_progress_m`."
///
/// Reported progress opens gates, so vehicles report it by these rules:
/// - On its pad a vehicle reports −`climb_m`; in its climb it reports the negative of the height
///   that is left to climb; in its descent it reports the path's length plus the height that it has
///   come down.
/// - It reports no more than the arc length that its reference has reached, and at most
///   [`MAX_REPORTED_PROGRESS_LAG_M`] less once it stands.
/// - It reports more than the path's length plus the descent only when it stands on the ground,
///   disarmed.
///
/// So a vehicle A that waits at a gate has reported enough progress to open every gate at which
/// another vehicle waits until A has left a stretch that A has flown already.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Arc length on the own path before which the vehicle waits, metres; −`climb_m` is on the pad.
    pub at_m: f32,
    /// Id of the vehicle to wait for.
    pub wait_for_id: u8,
    /// Reported progress of that vehicle from which the gate is open, metres along its path.
    pub open_from_progress_m: f32,
}

/// The part of the swarm's plan that one companion needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VehiclePlan<const W: usize, const G: usize> {
    /// Task of the vehicle.
    pub task: Task,
    /// The part of the flight along the path, from above the pad to above the landing place.
    pub path: Path<W>,
    /// Height of the path's first waypoint above the pad, metres.
    pub climb_m: f32,
    /// Height of the path's last waypoint above the ground below it, metres.
    pub descent_m: f32,
    /// Scheduled take-off, seconds after the mission's start: the vehicle waits on its pad until
    /// then, so that it need not hover at a gate. Separation does not depend on it.
    pub depart_s: f32,
    /// The vehicle's gates: arc lengths at which it waits, and for which vehicle.
    pub gates: Vec<Gate, G>,
    /// CRC-32 over the plan of the whole swarm. Vehicles with the same CRC agree on the order at
    /// every gate.
    pub swarm_plan_crc: u32,
}

impl<const W: usize, const G: usize> VehiclePlan<W, G> {
    /// The plan of a vehicle that stays on its pad. All zeros, so a static of it takes .bss only.
    pub const fn new() -> Self {
        Self {
            task: Task::Stay,
            path: Path::new(),
            climb_m: 0.0,
            descent_m: 0.0,
            depart_s: 0.0,
            gates: Vec::new(),
            swarm_plan_crc: 0,
        }
    }
}
