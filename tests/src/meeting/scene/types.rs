//! The types of a scene, and constants of all scenes.

use companion::autopilot::AutopilotKind;
use planner_core::Point;
use planner_core::flight::VehiclePlan;
use planner_core::schedule::ScheduleConfig;

use crate::meeting::autopilot::{Catch, Failsafe};

/// Most waypoints of a path.
pub const WAYPOINTS: usize = 16;
/// Most gates of a plan.
pub const GATES: usize = 128;
/// Most vehicles of a meeting.
pub const VEHICLES: usize = 8;
/// Safety distance between two vehicles' centres, metres.
pub const SAFETY_DISTANCE_M: f32 = 1.5;
/// Nominal speed along paths, m/s.
pub const CRUISE_MPS: f32 = 2.0;
/// Speed of climbs, m/s.
pub const CLIMB_MPS: f32 = 1.0;
/// When the missions are started, seconds.
pub const START_S: f32 = 6.0;
/// Time limit of a meeting, seconds after its start.
pub const TIME_LIMIT_S: f32 = 180.0;
/// Radius of the platform around a pad above the floor, metres.
pub const PLATFORM_RADIUS_M: f32 = 0.7;
/// Schedule settings of the vehicles, as in a mission.
pub const SCHEDULE: ScheduleConfig = ScheduleConfig {
    separation_m: SAFETY_DISTANCE_M + 0.5,
    parked_separation_m: SAFETY_DISTANCE_M + 0.25,
    cruise_mps: 0.9 * CRUISE_MPS,
    vertical_mps: CLIMB_MPS,
};
/// The plan of one vehicle.
pub type Plan = VehiclePlan<WAYPOINTS, GATES>;

/// One vehicle of a scene.
#[derive(Clone, Debug)]
pub struct Vehicle {
    /// MAVLink system id.
    pub id: u8,
    /// Which autopilot flies it.
    pub kind: AutopilotKind,
    /// Position of the vehicle on its pad, ENU metres.
    pub pad: Point,
    /// Plan that the vehicle's planner returns.
    pub plan: Plan,
    /// Shift of its telemetry streams, in steps of 25 ms.
    pub stream_phase: u64,
    /// What its autopilot does after a loss of setpoints.
    pub on_setpoint_loss: Failsafe,
}

/// An event in a meeting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeetingEvent {
    /// The ground station sends MAV_CMD_MISSION_START.
    Start,
    /// The ground station sends MAV_CMD_DO_PAUSE_CONTINUE 0.
    Pause,
    /// The ground station sends MAV_CMD_DO_PAUSE_CONTINUE 1.
    Resume,
    /// The ground station sends MAV_CMD_NAV_RETURN_TO_LAUNCH.
    Return,
    /// The ground station sends MAV_CMD_NAV_LAND.
    Land,
    /// The pilot takes over, and flies with this velocity, ENU m/s.
    PilotTakes(Point),
    /// The pilot switches back to Offboard or Guided.
    PilotReturns,
    /// The pilot switches to the mode of landing.
    PilotLands,
    /// The autopilot enters a failsafe.
    EntersFailsafe(Failsafe),
    /// The companion stops for good.
    CompanionDies,
    /// Its radio fails in one or both directions.
    RadioCut {
        /// Whether sending fails.
        sending_fails: bool,
        /// Whether receiving fails.
        receiving_fails: bool,
    },
    /// Its radio works again in both directions.
    RadioHealed,
    /// Something that is on no map holds the vehicle, or carries it off.
    Caught(Catch),
}

/// An event with its time and vehicle.
#[derive(Clone, Copy, Debug)]
pub struct TimedEvent {
    /// Time of the event, seconds.
    pub at_s: f32,
    /// Index of the vehicle.
    pub vehicle: usize,
    /// The event.
    pub what: MeetingEvent,
}

/// How a lying vehicle falsifies its reports.
#[derive(Clone, Copy, Debug)]
pub enum Lie {
    /// The reported position is off by this, ENU metres.
    Position(Point),
    /// The reported velocity is off by this, ENU m/s.
    Velocity(Point),
    /// The reported velocity is 0.
    Still,
    /// The reported progress is ahead by this, metres.
    Progress(f32),
    /// The reported points are off by this, ENU metres.
    Points(Point),
}

/// A meeting: its vehicles, its radio and its events.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Seed from which the scene follows.
    pub seed: u64,
    /// Geometry of the scene, one of `KINDS` or `PASSINGS`.
    pub kind: &'static str,
    /// Whether the vehicles fly one common plan.
    pub on_plan: bool,
    /// The vehicles.
    pub vehicles: Vec<Vehicle>,
    /// Time limit, seconds after the start.
    pub limit_s: f32,
    /// Events, by rising time.
    pub events: Vec<TimedEvent>,
    /// Least and greatest delay of a radio frame, seconds.
    pub radio_delay_s: (f32, f32),
    /// Probability that a radio frame is lost.
    pub radio_loss: f32,
    /// Index of the vehicle that lies in its reports, and its lie; `None`: all are honest.
    pub liar: Option<(usize, Lie)>,
}
