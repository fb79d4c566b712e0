//! The mission as an ordered transition table and a pure update function.
//!
//! [`update`] goes through [`TABLE`] from the top and takes the first row whose `from` holds the state and whose guard has
//! held for the row's limit. Order is rank: the pilot and the failsafe come first. `README.md` prints the same table, and
//! a test compares the two.

use crate::time::Duration;

/// Where the mission is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// No HEARTBEAT of the autopilot yet.
    #[default]
    WaitAutopilot,
    /// Connected; no position or no EKF origin yet.
    WaitPosition,
    /// The shell was asked for a plan.
    Planning,
    /// Planned; waits for MISSION_START.
    Ready,
    /// Started; waits on the ground for its gates, disarmed (PX4 disarms after 10 s on the ground).
    Scheduled,
    /// Setpoints at the current position, before Offboard or Guided is asked for.
    Streaming,
    /// Offboard or Guided was asked for.
    Engaging,
    /// Arming was asked for.
    Arming,
    /// NAV_TAKEOFF was asked for, of an autopilot that lifts off by command only; the others pass at once.
    TakeOff,
    /// Straight up to the start of the path.
    Climb,
    /// Along the path, slowed and stopped by the neighbours.
    Follow,
    /// Stopped on the path by DO_PAUSE_CONTINUE.
    Paused,
    /// Stopped on the path: no neighbour is heard.
    Alone,
    /// No HEARTBEAT in flight: stopped on the path.
    AutopilotSilent,
    /// No position in flight.
    PositionLost,
    /// Landing, by the autopilot.
    Land,
    /// On the ground; waits until the motors are off.
    Disarm,
    /// A mode that we did not ask for: only the current position goes out.
    PilotControl,
    /// The autopilot's own failsafe acts: no setpoints until landed.
    Failsafe,
    /// Landed and disarmed.
    Done,
    /// Given up; MISSION_START plans again.
    Aborted,
}

/// What must hold for a row. Every guard is a field, or a comparison of fields, of [`Inputs`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// HEARTBEAT was heard within the last second and a half.
    AutopilotHeard,
    /// HEARTBEAT is older than the limit.
    NoHeartbeat,
    /// A position is known, not older than half a second.
    PositionKnown,
    /// The position is older than the limit.
    NoPosition,
    /// The plan has come.
    PlanReady,
    /// There will be no plan.
    PlanFailed,
    /// MISSION_START was commanded.
    StartCommanded,
    /// MISSION_START, and no goal is left for this vehicle.
    StartWithoutGoal,
    /// MISSION_START, but not at the start point.
    StartElsewhere,
    /// MISSION_START, but the motors are armed.
    StartArmed,
    /// The schedule's take-off is due, and the neighbours leave room.
    GatesOpen,
    /// The state has lasted as long as the limit.
    Elapsed,
    /// The mode is the one that follows setpoints: Offboard (PX4) or Guided (ArduCopter).
    Offboard,
    /// The mode is neither the one before nor the one we asked for, and the autopilot reports no failsafe.
    ModeTaken,
    /// The mode is not ours, and the autopilot reports `MAV_STATE_CRITICAL`.
    FailsafeActs,
    /// Motors on.
    Armed,
    /// Motors off.
    Disarmed,
    /// In the air, or of an autopilot that needs no command to take off.
    LiftedOff,
    /// At the altitude of the start point.
    ClimbDone,
    /// At the end of the path, and the neighbours leave room to land.
    PathDone,
    /// No progress along the path for the limit.
    Stalled,
    /// DO_PAUSE_CONTINUE 0.
    PauseCommanded,
    /// DO_PAUSE_CONTINUE 1.
    ResumeCommanded,
    /// Offboard or Guided again, DO_PAUSE_CONTINUE 1, and the way back to the path is free.
    ResumedOnPath,
    /// Offboard or Guided again, DO_PAUSE_CONTINUE 1, but too far from the path.
    ResumedOffPath,
    /// NAV_LAND.
    LandCommanded,
    /// NAV_RETURN_TO_LAUNCH.
    ReturnCommanded,
    /// Battery charge at or below the configured one.
    BatteryLow,
    /// Outside the configured volume.
    OutsideGeofence,
    /// Of the neighbours that fly, none was heard for the limit.
    NeighboursSilent,
    /// A neighbour was heard within the last second.
    NeighbourHeard,
    /// On the ground.
    OnGround,
}

/// What a row does beside changing the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing.
    None,
    /// Ask for the streams and the EKF origin.
    Connect,
    /// Ask the shell for a plan.
    RequestPlan,
    /// Forget MISSION_START.
    ForgetStart,
    /// Hold here, from now on.
    HoldHere,
    /// Ask for Offboard or Guided, again every second.
    AskOffboard,
    /// Ask to arm, again every second.
    AskArm,
    /// Ask for NAV_TAKEOFF to the height of the climb, again every four seconds.
    AskTakeOff,
    /// Begin the climb.
    BeginClimb,
    /// Let the reference run along the path.
    RunPath,
    /// Brake the reference along the path.
    BrakeOnPath,
    /// Go on from the nearest point of the path.
    Rejoin,
    /// Fly the path flown so far back to the start.
    TurnBack,
    /// Ask for AUTO.LAND or LAND, again every second.
    AskLand,
    /// Ask to disarm: at once before take-off; after landing only if the autopilot has not done so in four seconds.
    AskDisarm,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// States it applies to.
    pub from: &'static [State],
    /// What must hold.
    pub guard: Guard,
    /// How long it must have held; zero: at once.
    pub limit: Duration,
    /// The next state.
    pub to: State,
    /// What is done.
    pub action: Action,
    /// STATUSTEXT for a person, at most 50 bytes; empty: none.
    pub text: &'static str,
    /// Whether the text is a warning rather than information.
    pub warning: bool,
}

/// What the guards look at: a snapshot of the vehicle, the commands and the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Time in the state.
    pub in_state: Duration,
    /// Time since the autopilot's last HEARTBEAT.
    pub heartbeat_age: Duration,
    /// Time since the last usable position.
    pub position_age: Duration,
    /// Time without progress along the path.
    pub stalled: Duration,
    /// Time in the state without any neighbour heard; zero when all have landed.
    pub neighbour_age: Duration,
    /// A neighbour was heard within the last second.
    pub neighbour_heard: bool,
    /// A plan is held.
    pub plan_ready: bool,
    /// The shell has none.
    pub plan_failed: bool,
    /// The plan has a goal.
    pub has_goal: bool,
    /// Horizontally near the start point.
    pub at_start: bool,
    /// MISSION_START holds.
    pub start: bool,
    /// DO_PAUSE_CONTINUE 0 holds.
    pub pause: bool,
    /// DO_PAUSE_CONTINUE 1 holds.
    pub resume: bool,
    /// NAV_LAND holds.
    pub land: bool,
    /// NAV_RETURN_TO_LAUNCH holds.
    pub turn_back: bool,
    /// Motors on.
    pub armed: bool,
    /// The mode is Offboard or Guided.
    pub offboard: bool,
    /// The mode is neither the one before nor the one asked for.
    pub mode_foreign: bool,
    /// `MAV_STATE_CRITICAL` or worse.
    pub critical: bool,
    /// The landing detector says ground.
    pub on_ground: bool,
    /// The landing detector says air, or nobody waits for that.
    pub lifted_off: bool,
    /// The neighbours leave room to go.
    pub gates_open: bool,
    /// At the altitude of the start.
    pub climb_done: bool,
    /// At the end of the path with room to land.
    pub path_done: bool,
    /// The way back to the path is free.
    pub near_path: bool,
    /// Battery low.
    pub battery_low: bool,
    /// Outside the geofence.
    pub outside: bool,
}

const NOW: Duration = Duration::from_millis(0);
/// HEARTBEAT comes at 1 Hz: one late is not yet silence.
const HEARD: Duration = Duration::from_millis(1500);
const FRESH: Duration = Duration::from_millis(500);

impl Guard {
    /// Whether it holds, and has held for `limit`.
    pub fn holds(self, i: &Inputs, limit: Duration) -> bool {
        match self {
            Self::AutopilotHeard => i.heartbeat_age < HEARD,
            Self::NoHeartbeat => i.heartbeat_age > limit,
            Self::PositionKnown => i.position_age < FRESH,
            Self::NoPosition => i.position_age > limit,
            Self::PlanReady => i.plan_ready,
            Self::PlanFailed => i.plan_failed,
            Self::StartCommanded => i.start,
            Self::StartWithoutGoal => i.start && !i.has_goal,
            Self::StartElsewhere => i.start && !i.at_start,
            Self::StartArmed => i.start && i.armed,
            Self::GatesOpen => i.gates_open,
            Self::Elapsed => i.in_state >= limit,
            Self::Offboard => i.offboard,
            Self::ModeTaken => i.mode_foreign && !i.critical,
            Self::FailsafeActs => i.mode_foreign && i.critical,
            Self::Armed => i.armed,
            Self::Disarmed => !i.armed,
            Self::LiftedOff => i.lifted_off,
            Self::ClimbDone => i.climb_done,
            Self::PathDone => i.path_done,
            Self::Stalled => i.stalled >= limit,
            Self::PauseCommanded => i.pause,
            Self::ResumeCommanded => i.resume,
            Self::ResumedOnPath => i.offboard && i.resume && i.near_path,
            Self::ResumedOffPath => i.offboard && i.resume && !i.near_path,
            Self::LandCommanded => i.land,
            Self::ReturnCommanded => i.turn_back,
            Self::BatteryLow => i.battery_low,
            Self::OutsideGeofence => i.outside,
            Self::NeighboursSilent => i.neighbour_age > limit,
            Self::NeighbourHeard => i.neighbour_heard,
            Self::OnGround => i.on_ground,
        }
    }
}

/// Whether some row of `state` waits for `guard`: a command that none waits for is refused.
pub fn awaits(state: State, guard: Guard) -> bool {
    TABLE.iter().any(|row| row.guard == guard && row.from.contains(&state))
}

/// The first row that applies.
pub fn update(state: State, inputs: &Inputs) -> Option<&'static Row> {
    TABLE.iter().find(|row| row.from.contains(&state) && row.guard.holds(inputs, row.limit))
}

const fn s(secs: u64) -> Duration {
    Duration::from_secs(secs)
}

const fn info(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    to: State,
    action: Action,
    text: &'static str,
) -> Row {
    Row { from, guard, limit, to, action, text, warning: false }
}

const fn warn(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    to: State,
    action: Action,
    text: &'static str,
) -> Row {
    Row { from, guard, limit, to, action, text, warning: true }
}

use Action as A;
use Guard as G;
use State::*;

/// On the ground before arming.
const WAITING: &[State] = &[WaitPosition, Planning, Ready, Scheduled];
/// In the air, or about to be, under our setpoints.
const FLYING: &[State] = &[TakeOff, Climb, Follow, Paused, Alone, AutopilotSilent, PositionLost];
/// In the air, with links and position as they should be.
const SOUND: &[State] = &[TakeOff, Climb, Follow, Paused, Alone];

/// In the air, and the autopilot was heard.
const LINKED: &[State] = &[TakeOff, Climb, Follow, Paused, Alone, PositionLost];

/// The mission.
#[rustfmt::skip]
pub static TABLE: &[Row] = &[
    // The autopilot itself, the pilot and the failsafe: before everything else.
    warn(FLYING,              G::Disarmed,         NOW,    Aborted,         A::ForgetStart, "Disarmed in flight: mission over"),
    warn(FLYING,              G::FailsafeActs,     NOW,    Failsafe,        A::None,        "Autopilot failsafe: setpoints stopped"),
    warn(FLYING,              G::ModeTaken,        NOW,    PilotControl,    A::None,        "Pilot has control: mission stopped"),
    warn(&[Land, Disarm],     G::FailsafeActs,     NOW,    Failsafe,        A::None,        "Autopilot failsafe while landing"),
    warn(&[Land, Disarm],     G::ModeTaken,        NOW,    PilotControl,    A::None,        "Pilot has control: landing stopped"),
    warn(&[Streaming, Engaging, Arming], G::FailsafeActs, NOW, Aborted,     A::ForgetStart, "Failsafe before take-off: start cancelled"),
    warn(&[Streaming, Engaging, Arming], G::ModeTaken, NOW, Aborted,        A::ForgetStart, "Mode changed by pilot: start cancelled"),
    // Links and position.
    warn(WAITING,             G::NoHeartbeat,      s(3),   WaitAutopilot,   A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(&[Streaming, Engaging, Arming], G::NoHeartbeat, s(3), Aborted,     A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(LINKED,              G::NoHeartbeat,      s(3),   AutopilotSilent, A::BrakeOnPath, "Autopilot silent: stopping"),
    warn(&[Land, Disarm, PilotControl, Failsafe], G::NoHeartbeat, s(60), Aborted, A::ForgetStart, "Autopilot lost"),
    warn(&[Planning, Ready, Scheduled], G::NoPosition, s(2), WaitPosition,  A::ForgetStart, "Position lost: start cancelled"),
    warn(&[Streaming, Engaging, Arming], G::NoPosition, s(1), Aborted,      A::ForgetStart, "Position lost: start cancelled"),
    warn(SOUND,               G::NoPosition,       s(1),   PositionLost,    A::BrakeOnPath, "Position lost: stopping"),
    // Orders and limits in flight.
    info(SOUND,               G::LandCommanded,    NOW,    Land,            A::AskLand,     "Landing as commanded"),
    info(&[PositionLost, AutopilotSilent], G::LandCommanded, NOW, Land,     A::AskLand,     "Landing as commanded"),
    warn(SOUND,               G::BatteryLow,       NOW,    Land,            A::AskLand,     "Battery low: landing"),
    warn(SOUND,               G::OutsideGeofence,  NOW,    Land,            A::AskLand,     "Geofence reached: landing"),
    info(&[Follow, Paused, Alone], G::ReturnCommanded, NOW, Follow,         A::TurnBack,    "Flying back to the start"),
    info(&[TakeOff, Climb],   G::ReturnCommanded,  NOW,    Land,            A::AskLand,     "Landing on the pad"),
    // The mission in order.
    info(&[WaitAutopilot],    G::AutopilotHeard,   NOW,    WaitPosition,    A::Connect,     "Autopilot found"),
    info(&[WaitPosition],     G::PositionKnown,    NOW,    Planning,        A::RequestPlan, "Position known: planning"),
    warn(&[Planning],         G::PlanFailed,       NOW,    Aborted,         A::ForgetStart, "No plan: mission aborted"),
    info(&[Planning],         G::PlanReady,        NOW,    Ready,           A::None,        "Ready"),
    warn(&[Planning],         G::Elapsed,          s(30),  Planning,        A::RequestPlan, "Plan is late: asked again"),
    info(&[Ready],            G::StartWithoutGoal, NOW,    Done,            A::ForgetStart, "No goal for this vehicle: staying"),
    warn(&[Ready],            G::StartElsewhere,   NOW,    Aborted,         A::ForgetStart, "Not at its start: start refused"),
    warn(&[Ready],            G::StartArmed,       NOW,    Aborted,         A::ForgetStart, "Armed by someone else: start refused"),
    info(&[Ready],            G::StartCommanded,   NOW,    Scheduled,       A::None,        "Started"),
    info(&[Ready, Scheduled, Streaming, Engaging, Arming], G::LandCommanded, NOW, Aborted, A::AskDisarm, "Start cancelled as commanded"),
    info(&[Ready, Scheduled, Streaming, Engaging, Arming], G::ReturnCommanded, NOW, Aborted, A::AskDisarm, "Start cancelled as commanded"),
    info(&[Scheduled],        G::GatesOpen,        NOW,    Streaming,       A::HoldHere,    ""),
    info(&[Streaming],        G::Elapsed,          s(1),   Engaging,        A::AskOffboard, ""),
    info(&[Engaging],         G::Offboard,         NOW,    Arming,          A::AskArm,      "Setpoints followed: arming"),
    warn(&[Engaging],         G::Elapsed,          s(5),   Aborted,         A::ForgetStart, "Setpoint mode refused: mission aborted"),
    info(&[Arming],           G::Armed,            NOW,    TakeOff,         A::AskTakeOff,  "Taking off"),
    warn(&[Arming],           G::Elapsed,          s(8),   Aborted,         A::AskDisarm,   "Arming refused: mission aborted"),
    info(&[TakeOff],          G::LiftedOff,        NOW,    Climb,           A::BeginClimb,  ""),
    warn(&[TakeOff],          G::Elapsed,          s(12),  Land,            A::AskLand,     "Take-off takes too long: landing"),
    info(&[Climb],            G::ClimbDone,        NOW,    Follow,          A::RunPath,     "Following the path"),
    warn(&[Climb],            G::Elapsed,          s(60),  Land,            A::AskLand,     "Climb takes too long: landing"),
    info(&[Follow],           G::PathDone,         NOW,    Land,            A::AskLand,     "At the goal: landing"),
    info(&[Climb, Follow, Alone], G::PauseCommanded,   NOW,    Paused,          A::BrakeOnPath, "Paused"),
    warn(&[Follow],           G::NeighboursSilent, s(10),  Alone,           A::BrakeOnPath, "Neighbours silent: stopping"),
    warn(&[Follow],           G::Stalled,          s(300), Land,            A::AskLand,     "No progress for 5 min: landing"),
    info(&[Paused],           G::ResumeCommanded,  NOW,    Follow,          A::RunPath,     "Resumed"),
    warn(&[Paused],           G::Elapsed,          s(600), Land,            A::AskLand,     "Paused for 10 min: landing"),
    info(&[Alone],            G::NeighbourHeard,   NOW,    Follow,          A::RunPath,     "Neighbours heard again"),
    warn(&[Alone],            G::Elapsed,          s(30),  Land,            A::AskLand,     "Neighbours still silent: landing"),
    info(&[AutopilotSilent],  G::AutopilotHeard,   NOW,    Follow,          A::RunPath,     "Autopilot heard again"),
    warn(&[AutopilotSilent],  G::Elapsed,          s(60),  Aborted,         A::ForgetStart, "Autopilot lost"),
    info(&[PositionLost],     G::PositionKnown,    NOW,    Follow,          A::RunPath,     "Position known again"),
    warn(&[PositionLost],     G::Elapsed,          s(3),   Land,            A::AskLand,     "Position still lost: landing"),
    info(&[Land],             G::Disarmed,         NOW,    Done,            A::ForgetStart, "Landed"),
    info(&[Land],             G::OnGround,         NOW,    Disarm,          A::AskDisarm,   ""),
    warn(&[Land],             G::Elapsed,          s(120), Land,            A::AskLand,     "Landing takes long"),
    info(&[Disarm],           G::Disarmed,         NOW,    Done,            A::ForgetStart, "Landed"),
    warn(&[Disarm],           G::Elapsed,          s(30),  Aborted,         A::ForgetStart, "On the ground, still armed"),
    // After the pilot or a failsafe.
    warn(&[PilotControl],     G::Disarmed,         NOW,    Aborted,         A::ForgetStart, "Pilot landed: mission over"),
    warn(&[PilotControl],     G::FailsafeActs,     NOW,    Failsafe,        A::None,        "Autopilot failsafe: setpoints stopped"),
    info(&[PilotControl],     G::ResumedOnPath,    NOW,    Follow,          A::Rejoin,      "Resumed after the pilot"),
    warn(&[PilotControl],     G::ResumedOffPath,   NOW,    Land,            A::AskLand,     "Too far from the path: landing"),
    warn(&[PilotControl],     G::Elapsed,          s(900), PilotControl,    A::None,        "Pilot still has control"),
    warn(&[Failsafe],         G::Disarmed,         NOW,    Aborted,         A::ForgetStart, "Landed after failsafe: mission over"),
    warn(&[Failsafe],         G::Elapsed,          s(300), Failsafe,        A::None,        "Autopilot failsafe still acts"),
    info(&[Aborted],          G::StartCommanded,   NOW,    WaitPosition,    A::ForgetStart, "Planning again: start anew when ready"),
];

#[cfg(test)]
#[path = "mission_tests.rs"]
mod tests;
