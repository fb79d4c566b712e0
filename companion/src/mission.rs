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
    /// Stopped on the path: what left the plan is in its way. Waits until all others stand.
    Blocked,
    /// Hovers; the shell was asked for a way around.
    Replanning,
    /// The same on the ground.
    PadReplanning,
    /// Brakes along the path, then lands.
    Stopping,
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
    /// The position jumped, or the EKF origin moved, within the last second.
    PositionJumped,
    /// Motors on and off the ground.
    FoundFlying,
    /// The plan has come.
    PlanReady,
    /// There will be no plan.
    PlanFailed,
    /// There will be no plan, for want of the mission's roadmap.
    RoadmapBad,
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
    /// A fresh position, and the way back to the path is free.
    BackOnPath,
    /// A fresh position, but elsewhere than where it stopped on the path.
    BackOffPath,
    /// Offboard or Guided again, DO_PAUSE_CONTINUE 1, and the way back to the path is free.
    ResumedOnPath,
    /// Offboard or Guided again, DO_PAUSE_CONTINUE 1, but too far from the path.
    ResumedOffPath,
    /// NAV_LAND.
    LandCommanded,
    /// NAV_RETURN_TO_LAUNCH.
    ReturnCommanded,
    /// Battery charge below half of the configured limit.
    BatteryCritical,
    /// Battery charge below the configured limit, and no neighbour below.
    BatteryLow,
    /// Outside the configured volume.
    OutsideGeofence,
    /// Of the neighbours that fly, none was heard for the limit.
    NeighboursSilent,
    /// A neighbour was heard within the last second.
    NeighbourHeard,
    /// On the ground.
    OnGround,
    /// Something that left the plan is in the way, or we left it ourselves.
    PathBlocked,
    /// Nothing is in the way any more.
    PathClear,
    /// The path is blocked, all others stand, and it is this vehicle's turn.
    OurTurn,
    /// The way around has come.
    DetourReady,
    /// There is no way around.
    DetourFailed,
    /// There was none several times.
    NoWayAround,
    /// Standing still.
    Standing,
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
    /// Ask the shell for a way around, from here.
    RequestDetour,
    /// Give the shell up, this time.
    MissDetour,
    /// Fly it.
    FlyDetour,
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
    /// The position jumped lately.
    pub jumped: bool,
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
    /// The shell has none because the roadmap is missing or not the mission's.
    pub roadmap_bad: bool,
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
    /// Motors on, and the landing detector says air.
    pub airborne: bool,
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
    /// Battery charge below the configured limit.
    pub battery_low: bool,
    /// Battery charge below half of it.
    pub battery_critical: bool,
    /// No neighbour is in the column to the ground.
    pub room_below: bool,
    /// Outside the geofence.
    pub outside: bool,
    /// The path is blocked.
    pub blocked: bool,
    /// All others stand, and it is this vehicle's turn to fly around.
    pub our_turn: bool,
    /// The way around has come.
    pub detour_ready: bool,
    /// Ways around that were not found, in a row.
    pub detours_failed: u8,
    /// Slower than a hovering vehicle sways.
    pub standing: bool,
}

/// So many ways around that are not found are enough.
const DETOURS_TRIED: u8 = 4;

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
            Self::PositionJumped => i.jumped,
            Self::FoundFlying => i.airborne,
            Self::PlanReady => i.plan_ready,
            Self::PlanFailed => i.plan_failed,
            Self::RoadmapBad => i.roadmap_bad,
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
            Self::BackOnPath => i.position_age < FRESH && i.near_path,
            Self::BackOffPath => i.position_age < FRESH && !i.near_path,
            Self::ResumedOnPath => i.offboard && i.resume && i.near_path,
            Self::ResumedOffPath => i.offboard && i.resume && !i.near_path,
            Self::LandCommanded => i.land,
            Self::ReturnCommanded => i.turn_back,
            Self::BatteryCritical => i.battery_critical,
            Self::BatteryLow => i.battery_low && i.room_below,
            Self::OutsideGeofence => i.outside,
            Self::NeighboursSilent => i.neighbour_age > limit,
            Self::NeighbourHeard => i.neighbour_heard,
            Self::OnGround => i.on_ground,
            Self::PathBlocked => i.blocked,
            Self::PathClear => !i.blocked,
            Self::OurTurn => i.our_turn,
            Self::DetourReady => i.detour_ready,
            Self::DetourFailed => i.plan_failed,
            Self::NoWayAround => i.detours_failed >= DETOURS_TRIED,
            Self::Standing => i.standing,
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
const WAITING: &[State] = &[WaitPosition, Planning, Ready, Scheduled, PadReplanning];
/// In the air, or about to be, under our setpoints.
const FLYING: &[State] =
    &[TakeOff, Climb, Follow, Paused, Alone, Blocked, Replanning, Stopping, AutopilotSilent, PositionLost];
/// In the air, with links and position as they should be.
const SOUND: &[State] = &[TakeOff, Climb, Follow, Paused, Alone, Blocked, Replanning, Stopping];
/// The same, on its path under way or stopped: it can stop along it.
const ON_PATH: &[State] = &[Follow, Paused, Alone, Blocked, Replanning];

/// In the air, and the autopilot was heard.
const LINKED: &[State] =
    &[TakeOff, Climb, Follow, Paused, Alone, Blocked, Replanning, Stopping, PositionLost];

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
    // Started anew in the air: what flies the vehicle goes on doing so; without setpoints that is the autopilot alone.
    warn(WAITING,             G::FoundFlying,      NOW,    Failsafe,        A::ForgetStart, "Found in flight: no mission"),
    // Links and position.
    warn(WAITING,             G::NoHeartbeat,      s(3),   WaitAutopilot,   A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(&[Streaming, Engaging, Arming], G::NoHeartbeat, s(3), Aborted,     A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(LINKED,              G::NoHeartbeat,      s(3),   AutopilotSilent, A::BrakeOnPath, "Autopilot silent: stopping"),
    warn(&[Land, Disarm, PilotControl, Failsafe], G::NoHeartbeat, s(60), Aborted, A::ForgetStart, "Autopilot lost"),
    warn(&[Planning, Ready, Scheduled, PadReplanning], G::NoPosition, s(2), WaitPosition,  A::ForgetStart, "Position lost: start cancelled"),
    warn(&[Streaming, Engaging, Arming], G::NoPosition, s(1), Aborted,      A::ForgetStart, "Position lost: start cancelled"),
    warn(SOUND,               G::PositionJumped,   NOW,    PositionLost,    A::BrakeOnPath, "Position jumped: stopping"),
    warn(SOUND,               G::NoPosition,       s(1),   PositionLost,    A::BrakeOnPath, "Position lost: stopping"),
    // Orders and limits in flight.
    info(ON_PATH,             G::LandCommanded,    NOW,    Stopping,        A::BrakeOnPath, "Landing as commanded"),
    info(&[TakeOff, Climb, PositionLost, AutopilotSilent], G::LandCommanded, NOW, Land, A::AskLand, "Landing as commanded"),
    warn(ON_PATH,             G::BatteryCritical,  NOW,    Stopping,        A::BrakeOnPath, "Battery critical: landing"),
    warn(ON_PATH,             G::BatteryLow,       NOW,    Stopping,        A::BrakeOnPath, "Battery low: landing"),
    warn(&[TakeOff, Climb],   G::BatteryCritical,  NOW,    Land,            A::AskLand,     "Battery critical: landing"),
    warn(&[TakeOff, Climb],   G::BatteryLow,       NOW,    Land,            A::AskLand,     "Battery low: landing"),
    warn(SOUND,               G::OutsideGeofence,  NOW,    Land,            A::AskLand,     "Geofence reached: landing"),
    info(&[Stopping],         G::Standing,         NOW,    Land,            A::AskLand,     ""),
    info(&[Stopping],         G::Elapsed,          s(5),   Land,            A::AskLand,     ""),
    info(ON_PATH,             G::ReturnCommanded,  NOW,    Follow,          A::TurnBack,    "Flying back to the start"),
    info(&[TakeOff, Climb],   G::ReturnCommanded,  NOW,    Land,            A::AskLand,     "Landing on the pad"),
    // The mission in order.
    info(&[WaitAutopilot],    G::AutopilotHeard,   NOW,    WaitPosition,    A::Connect,     "Autopilot found"),
    info(&[WaitPosition],     G::PositionKnown,    NOW,    Planning,        A::RequestPlan, "Position known: planning"),
    warn(&[Planning],         G::RoadmapBad,       NOW,    Aborted,         A::ForgetStart, "Roadmap missing or wrong: mission aborted"),
    warn(&[Planning],         G::PlanFailed,       NOW,    Aborted,         A::ForgetStart, "No plan: mission aborted"),
    info(&[Planning],         G::PlanReady,        NOW,    Ready,           A::None,        "Ready"),
    warn(&[Planning],         G::Elapsed,          s(30),  Planning,        A::RequestPlan, "Plan is late: asked again"),
    info(&[Ready],            G::StartWithoutGoal, NOW,    Done,            A::ForgetStart, "No goal for this vehicle: staying"),
    warn(&[Ready],            G::StartElsewhere,   NOW,    Aborted,         A::ForgetStart, "Not at its start: start refused"),
    warn(&[Ready],            G::StartArmed,       NOW,    Aborted,         A::ForgetStart, "Armed by someone else: start refused"),
    info(&[Ready],            G::StartCommanded,   NOW,    Scheduled,       A::None,        "Started"),
    info(&[Ready, Scheduled, PadReplanning, Streaming, Engaging, Arming], G::LandCommanded, NOW, Aborted, A::AskDisarm, "Start cancelled as commanded"),
    info(&[Ready, Scheduled, PadReplanning, Streaming, Engaging, Arming], G::ReturnCommanded, NOW, Aborted, A::AskDisarm, "Start cancelled as commanded"),
    info(&[Scheduled],        G::OurTurn,          NOW,    PadReplanning,   A::RequestDetour, "All others stand: planning around"),
    info(&[PadReplanning],    G::DetourReady,      NOW,    Scheduled,       A::None,        "A way around is found"),
    warn(&[PadReplanning],    G::DetourFailed,     NOW,    Scheduled,       A::None,        "No way around yet"),
    warn(&[PadReplanning],    G::Elapsed,          s(5),   Scheduled,       A::MissDetour,  "The way around is late"),
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
    info(&[Climb, Follow, Alone, Blocked, Replanning], G::PauseCommanded, NOW, Paused, A::BrakeOnPath, "Paused"),
    warn(&[Follow, Blocked],  G::NeighboursSilent, s(2),   Alone,           A::BrakeOnPath, "Neighbours silent: stopping"),
    warn(&[Follow],           G::PathBlocked,      NOW,    Blocked,         A::BrakeOnPath, "Path blocked: waiting until all others stand"),
    warn(&[Follow],           G::Stalled,          s(600), Land,            A::AskLand,     "No progress for 10 min: landing"),
    info(&[Blocked],          G::PathClear,        NOW,    Follow,          A::RunPath,     "Path clear again"),
    warn(&[Blocked],          G::NoWayAround,      NOW,    Land,            A::AskLand,     "No way around: landing"),
    warn(&[Blocked],          G::Elapsed,          s(600), Land,            A::AskLand,     "Path blocked for 10 min: landing"),
    info(&[Blocked],          G::OurTurn,          NOW,    Replanning,      A::RequestDetour, "All others stand: planning around"),
    info(&[Replanning],       G::DetourReady,      NOW,    Follow,          A::FlyDetour,   "Flying around"),
    warn(&[Replanning],       G::DetourFailed,     NOW,    Blocked,         A::None,        "No way around yet"),
    warn(&[Replanning],       G::Elapsed,          s(5),   Blocked,         A::MissDetour,  "The way around is late"),
    info(&[Paused],           G::ResumeCommanded,  NOW,    Follow,          A::RunPath,     "Resumed"),
    warn(&[Paused],           G::Elapsed,          s(600), Land,            A::AskLand,     "Paused for 10 min: landing"),
    info(&[Alone],            G::NeighbourHeard,   NOW,    Follow,          A::RunPath,     "Neighbours heard again"),
    warn(&[Alone],            G::Elapsed,          s(20),  Land,            A::AskLand,     "Neighbours still silent: landing"),
    info(&[AutopilotSilent],  G::AutopilotHeard,   NOW,    PositionLost,    A::BrakeOnPath, "Autopilot heard again"),
    warn(&[AutopilotSilent],  G::Elapsed,          s(60),  Aborted,         A::ForgetStart, "Autopilot lost"),
    info(&[PositionLost],     G::BackOnPath,       NOW,    Follow,          A::Rejoin,      "Position known again"),
    warn(&[PositionLost],     G::BackOffPath,      NOW,    Land,            A::AskLand,     "Position is elsewhere: landing"),
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
