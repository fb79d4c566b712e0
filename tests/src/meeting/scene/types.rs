//! What a scene is made of.

use companion::autopilot::AutopilotKind;
use planner_core::Point;
use planner_core::flight::VehiclePlan;
use planner_core::schedule::ScheduleConfig;

use crate::meeting::autopilot::{Catch, Failsafe};

/// Waypoints of a path.
pub const WAYPOINTS: usize = 16;
/// Gates of a plan.
pub const GATES: usize = 128;
/// Vehicles of a meeting, at most.
pub const VEHICLES: usize = 8;
/// Distance between two vehicles' centres that is kept, metres.
pub const SAFETY_M: f32 = 1.5;
/// Speed along paths, m/s.
pub const CRUISE_MPS: f32 = 2.0;
/// Speed of climbs, m/s.
pub const CLIMB_MPS: f32 = 1.0;
/// Missions are started then, seconds.
pub const START_S: f32 = 6.0;
/// A meeting is over by then, seconds after its start.
pub const LIMIT_S: f32 = 180.0;
/// A platform reaches this far around its pad, metres.
pub const PLATFORM_M: f32 = 0.7;
/// The schedule of these vehicles, as a mission's.
pub const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: SAFETY_M + 0.5,
    parked_separation_m: SAFETY_M + 0.25,
    cruise_mps: 0.9 * CRUISE_MPS,
    vertical_mps: CLIMB_MPS,
};
/// A vehicle's plan.
pub type Plan = VehiclePlan<WAYPOINTS, GATES>;

/// One vehicle.
#[derive(Clone, Debug)]
pub struct Vehicle {
    /// System id.
    pub id: u8,
    /// Its autopilot.
    pub kind: AutopilotKind,
    /// Where it stands.
    pub pad: Point,
    /// What its planner answers.
    pub plan: Plan,
    /// Shift of its streams.
    pub phase: u64,
    /// What its autopilot does without setpoints.
    pub on_loss: Failsafe,
}

/// Something that happens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What {
    /// MISSION_START.
    Start,
    /// DO_PAUSE_CONTINUE 0.
    Pause,
    /// DO_PAUSE_CONTINUE 1.
    Resume,
    /// NAV_RETURN_TO_LAUNCH.
    Return,
    /// NAV_LAND.
    Land,
    /// The pilot takes over and flies with this velocity.
    PilotTakes(Point),
    /// The pilot gives Offboard or Guided back.
    PilotReturns,
    /// The pilot lands.
    PilotLands,
    /// The autopilot's failsafe.
    Fails(Failsafe),
    /// The companion ends.
    Dies,
    /// Its radio no longer sends, or receives.
    Cut {
        /// Sends nothing.
        sends: bool,
        /// Hears nothing.
        hears: bool,
    },
    /// Its radio works again.
    Healed,
    /// It touches what is on no map, and can go no further.
    Caught(Catch),
}

/// What happens, when, and to which vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Happening {
    /// Seconds.
    pub at_s: f32,
    /// Index of the vehicle.
    pub vehicle: usize,
    /// What.
    pub what: What,
}

/// How a vehicle's reports are wrong.
#[derive(Clone, Copy, Debug)]
pub enum Lie {
    /// Its position is off by this.
    Position(Point),
    /// Its velocity is off by this.
    Velocity(Point),
    /// It reports no velocity.
    Still,
    /// Its progress is ahead by so many metres.
    Progress(f32),
    /// Its points are off by this.
    Points(Point),
}

/// A meeting.
#[derive(Clone, Debug)]
pub struct Scene {
    /// From which it follows.
    pub seed: u64,
    /// Its geometry.
    pub kind: &'static str,
    /// Whether the vehicles share a plan.
    pub on_plan: bool,
    /// The vehicles.
    pub vehicles: Vec<Vehicle>,
    /// It is over by then, seconds after its start.
    pub limit_s: f32,
    /// What happens, by time.
    pub happenings: Vec<Happening>,
    /// Least and greatest delay of the radio, seconds.
    pub delay_s: (f32, f32),
    /// Share of frames lost.
    pub loss: f32,
    /// A vehicle whose reports are wrong.
    pub liar: Option<(usize, Lie)>,
}
