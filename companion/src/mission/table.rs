//! The rows of the mission's transition table; [`crate::mission`] says what states, guards and actions are.

use super::guard::Guard;
use super::row::{AT_ONCE, Action, Row, bits};
use super::state::{State, To};
use crate::time::Duration;

pub(crate) const fn s(secs: u64) -> Duration {
    Duration::from_secs(secs)
}

pub(crate) const fn info(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    to: State,
    action: Action,
    text: &'static str,
) -> Row {
    Row { from, states: bits(from), guard, limit, to: To::State(to), action, text, warning: false }
}

pub(crate) const fn warn(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    to: State,
    action: Action,
    text: &'static str,
) -> Row {
    Row { from, states: bits(from), guard, limit, to: To::State(to), action, text, warning: true }
}

/// Back to the interrupted state.
pub(crate) const fn back(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    action: Action,
    text: &'static str,
) -> Row {
    Row { from, states: bits(from), guard, limit, to: To::Interrupted, action, text, warning: false }
}

/// Twice the time by which the armed bit lags behind the ack of arming.
const ARMED_BIT_TIMEOUT: Duration = Duration::from_millis(2500);

/// A vehicle that has stood beside its setpoint for this long is held by something.
pub(crate) const UNFOLLOWED_MOST: Duration = s(20);

use Action as A;
use Guard as G;
use State::*;

/// States on the ground before arming.
pub(crate) const WAITING_ON_GROUND: &[State] = &[WaitPosition, Planning, Ready, Scheduled, PadReplanning];
/// States on the pad after the start command, before arming is requested.
pub(crate) const STARTED_ON_PAD: &[State] = &[Scheduled, PadReplanning, Streaming, Engaging];
/// States on the pad after the start command.
pub(crate) const ON_PAD: &[State] = &[Scheduled, PadReplanning, Streaming, Engaging, Arming, CancelStart];
/// States in the air, or about to be, under our setpoints.
pub(crate) const FLYING: &[State] = &[
    TakeOff,
    Climb,
    Follow,
    Paused,
    Alone,
    Blocked,
    Replanning,
    Dividing,
    Stopping,
    LandingHeld,
    AutopilotSilent,
    PositionLost,
];
/// States in the air in which links and position are as they should be.
pub(crate) const FLYING_SOUND: &[State] =
    &[TakeOff, Climb, Follow, Paused, Alone, Blocked, Replanning, Dividing, Stopping, LandingHeld];
/// States of [`FLYING_SOUND`] on the path, under way or stopped: the vehicle can stop along its
/// path.
pub(crate) const SOUND_ON_PATH: &[State] = &[Follow, Paused, Alone, Blocked, Replanning, Dividing];

/// States of [`FLYING_SOUND`] before the landing.
pub(crate) const SOUND_BEFORE_LANDING: &[State] =
    &[TakeOff, Climb, Follow, Paused, Alone, Blocked, Replanning, Dividing, Stopping];

/// States in the air in which the autopilot was heard.
pub(crate) const IN_AIR_LINKED: &[State] = &[
    TakeOff,
    Climb,
    Follow,
    Paused,
    Alone,
    Blocked,
    Replanning,
    Dividing,
    Stopping,
    LandingHeld,
    PositionLost,
];

/// The transition table of the mission.
#[rustfmt::skip]
pub static TABLE: &[Row] = &[
    // The autopilot itself, the pilot and the failsafe: before everything else.
    warn(FLYING,              G::Disarmed,         AT_ONCE,    Aborted,         A::ForgetStart, "Disarmed in flight: mission over"),
    warn(FLYING,              G::FailsafeActs,     AT_ONCE,    Failsafe,        A::None,        "Autopilot failsafe: setpoints stopped"),
    warn(FLYING,              G::ModeTaken,        AT_ONCE,    PilotControl,    A::None,        "Pilot has control: mission stopped"),
    warn(&[Land, Disarm],     G::FailsafeActs,     AT_ONCE,    Failsafe,        A::None,        "Autopilot failsafe while landing"),
    warn(&[Land, Disarm],     G::ModeTaken,        AT_ONCE,    PilotControl,    A::None,        "Pilot has control: landing stopped"),
    warn(ON_PAD,              G::FailsafeActs,     AT_ONCE,    Aborted,         A::ForgetStart, "Failsafe before take-off: start cancelled"),
    warn(ON_PAD,              G::ModeTaken,        AT_ONCE,    Aborted,         A::ForgetStart, "Mode changed by pilot: start cancelled"),
    // Started again in the air: what flies the vehicle goes on doing so; without setpoints that is the autopilot alone.
    warn(WAITING_ON_GROUND,             G::FoundFlying,      AT_ONCE,    Failsafe,        A::ForgetStart, "Found in flight: no mission"),
    // Links and position.
    warn(WAITING_ON_GROUND,             G::NoHeartbeat,      s(3),   WaitAutopilot,   A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(&[Streaming, Engaging], G::NoHeartbeat,   s(3),   Aborted,     A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(&[Arming],           G::NoHeartbeat,      s(3),   CancelStart,     A::CancelStart, "Autopilot silent: start cancelled"),
    warn(&[CancelStart],      G::NoHeartbeat,      s(60),  Aborted,         A::ForgetStart, "Autopilot lost"),
    warn(IN_AIR_LINKED,              G::NoHeartbeat,      s(3),   AutopilotSilent, A::BrakeOnPath, "Autopilot silent: stopping"),
    warn(&[Disarm, PilotControl, Failsafe], G::NoHeartbeat, s(60), Aborted, A::ForgetStart, "Autopilot lost"),
    warn(&[Land],             G::NoHeartbeat,      s(120), Aborted,         A::ForgetStart, "Autopilot lost"),
    warn(&[PilotReturned],    G::NoHeartbeat,      s(60),  Land,            A::AskLand,     "Autopilot still silent: landing"),
    warn(&[Planning, Ready, Scheduled, PadReplanning], G::NoPosition, s(2), WaitPosition,  A::ForgetStart, "Position lost: start cancelled"),
    warn(&[Streaming, Engaging], G::NoPosition,    s(1),   Aborted,         A::ForgetStart, "Position lost: start cancelled"),
    warn(&[Arming],           G::NoPosition,       s(1),   CancelStart,     A::CancelStart, "Position lost: start cancelled"),
    // On the pad the pilot wins too, and what was checked at the start is checked until arming.
    warn(STARTED_ON_PAD,             G::Armed,            AT_ONCE,    Aborted,         A::ForgetStart, "Armed by someone else: start cancelled"),
    warn(STARTED_ON_PAD,             G::AwayFromStart,    AT_ONCE,    Aborted,         A::ForgetStart, "Not at its start: start cancelled"),
    warn(STARTED_ON_PAD,             G::ChargeLow,        AT_ONCE,    Aborted,         A::ForgetStart, "Battery low: start cancelled"),
    warn(STARTED_ON_PAD,             G::Outside,          AT_ONCE,    Aborted,         A::ForgetStart, "Outside the geofence: start cancelled"),
    warn(&[Arming],           G::AwayFromStart,    AT_ONCE,    CancelStart,     A::CancelStart, "Not at its start: start cancelled"),
    warn(&[Arming],           G::ChargeLow,        AT_ONCE,    CancelStart,     A::CancelStart, "Battery low: start cancelled"),
    warn(&[Arming],           G::Outside,          AT_ONCE,    CancelStart,     A::CancelStart, "Outside the geofence: start cancelled"),
    warn(IN_AIR_LINKED,              G::OriginMoved,      AT_ONCE,    Land,            A::AskLand,     "EKF origin moved: landing"),
    warn(&[PilotReturned],    G::OriginMoved,      AT_ONCE,    Land,            A::AskLand,     "EKF origin moved: landing"),
    warn(FLYING_SOUND,               G::PositionJumped,   AT_ONCE,    PositionLost,    A::BrakeOnPath, "Position jumped: stopping"),
    warn(FLYING_SOUND,               G::NoPosition,       s(1),   PositionLost,    A::BrakeOnPath, "Position lost: stopping"),
    // Orders and limits in flight.
    info(SOUND_ON_PATH,             G::LandCommanded,    AT_ONCE,    Stopping,        A::BrakeOnPath, "Landing as commanded"),
    info(&[TakeOff, Climb, PositionLost, AutopilotSilent, PilotReturned], G::LandCommanded, AT_ONCE, Land, A::AskLand, "Landing as commanded"),
    info(&[Failsafe, Aborted], G::LandUnattended,  AT_ONCE,    Land,            A::AskLand,     "Landing as commanded"),
    warn(SOUND_ON_PATH,             G::BatteryCritical,  AT_ONCE,    Stopping,        A::BrakeOnPath, "Battery critical: landing"),
    warn(SOUND_ON_PATH,             G::BatteryLow,       AT_ONCE,    Stopping,        A::BrakeOnPath, "Battery low: landing"),
    warn(&[TakeOff, Climb, PilotReturned], G::BatteryCritical, AT_ONCE,    Land,            A::AskLand,     "Battery critical: landing"),
    warn(&[TakeOff, Climb, PilotReturned], G::BatteryLow, AT_ONCE,    Land,            A::AskLand,     "Battery low: landing"),
    warn(SOUND_BEFORE_LANDING,            G::EstimateVague,    s(30),  Land,            A::AskLand,     "Estimate worse than margin for 30 s: landing"),
    warn(SOUND_BEFORE_LANDING,            G::OutsideGeofence,  AT_ONCE,    Land,            A::AskLand,     "Geofence reached: landing"),
    // The division that others decided while this vehicle was not heard.
    warn(&[TakeOff, Climb, PilotReturned], G::Excluded, AT_ONCE,   Land,            A::AskLand,     "Its part was given away: landing"),
    warn(SOUND_ON_PATH,             G::Excluded,         AT_ONCE,    Stopping,        A::BrakeOnPath, "Its part was given away: landing"),
    info(&[Stopping],         G::Standing,         AT_ONCE,    Land,            A::AskLand,     ""),
    info(&[Stopping],         G::Elapsed,          s(5),   Land,            A::AskLand,     ""),
    info(&[Paused],           G::ReturnInClimb,    AT_ONCE,    Land,            A::AskLand,     "Landing on the pad"),
    info(SOUND_ON_PATH,             G::ReturnOverField,  AT_ONCE,    Blocked,         A::TurnHome,    "Planning the way home"),
    info(SOUND_ON_PATH,             G::ReturnCommanded,  AT_ONCE,    Follow,          A::TurnBack,    "Flying back to the start"),
    info(&[TakeOff, Climb],   G::ReturnCommanded,  AT_ONCE,    Land,            A::AskLand,     "Landing on the pad"),
    // The mission in order.
    info(&[WaitAutopilot],    G::AutopilotHeard,   AT_ONCE,    WaitPosition,    A::Connect,     "Autopilot found"),
    info(&[WaitPosition],     G::PositionKnown,    AT_ONCE,    Planning,        A::RequestPlan, "Position known: planning"),
    warn(&[Planning],         G::RoadmapBad,       AT_ONCE,    Aborted,         A::ForgetStart, "Roadmap or field missing or wrong: mission aborted"),
    warn(&[Planning],         G::PlanFailed,       AT_ONCE,    Aborted,         A::ForgetStart, "No plan: mission aborted"),
    info(&[Planning],         G::PlanReady,        AT_ONCE,    Ready,           A::None,        "Ready"),
    warn(&[Planning],         G::Elapsed,          s(30),  Planning,        A::RequestPlan, "Plan is late: asked again"),
    info(&[Ready],            G::StartWithoutGoal, AT_ONCE,    Done,            A::ForgetStart, "No goal for this vehicle: staying"),
    warn(&[Ready],            G::StartElsewhere,   AT_ONCE,    Aborted,         A::ForgetStart, "Not at its start: start refused"),
    warn(&[Ready],            G::StartArmed,       AT_ONCE,    Aborted,         A::ForgetStart, "Armed by someone else: start refused"),
    warn(&[Ready],            G::StartBatteryLow,  AT_ONCE,    Aborted,         A::ForgetStart, "Battery low: start refused"),
    warn(&[Ready],            G::StartOutside,     AT_ONCE,    Aborted,         A::ForgetStart, "Outside the geofence: start refused"),
    warn(&[Ready],            G::StartVague,       s(3),    Aborted,         A::ForgetStart, "Estimate worse than margin: start refused"),
    info(&[Ready],            G::StartCommanded,   AT_ONCE,    Scheduled,       A::None,        "Started"),
    info(&[Ready, Scheduled], G::MoreIsDone,       AT_ONCE,    Planning,        A::RequestPlan, "More is photographed: planning again"),
    warn(STARTED_ON_PAD,             G::Excluded,         AT_ONCE,    Aborted,         A::ForgetStart, "Its part was given away: start cancelled"),
    info(&[Ready, Scheduled, PadReplanning, Streaming, Engaging], G::LandCommanded, AT_ONCE, Aborted, A::ForgetStart, "Start cancelled as commanded"),
    info(&[Ready, Scheduled, PadReplanning, Streaming, Engaging], G::ReturnCommanded, AT_ONCE, Aborted, A::ForgetStart, "Start cancelled as commanded"),
    info(&[Arming, CancelStart], G::LandCommanded, AT_ONCE,    CancelStart,     A::CancelStart, "Start cancelled as commanded"),
    info(&[Arming, CancelStart], G::ReturnCommanded, AT_ONCE,  CancelStart,     A::CancelStart, "Start cancelled as commanded"),
    info(&[Streaming, Engaging], G::PauseCommanded, AT_ONCE,   Scheduled,       A::None,        "Paused on the pad"),
    info(&[Arming],           G::PauseCommanded,   AT_ONCE,    CancelStart,     A::AskDisarm,   "Paused on the pad"),
    info(&[Scheduled],        G::PausedOnPad,      s(30),  Scheduled,       A::None,        "Paused on the pad: waits for resume"),
    info(&[Scheduled],        G::OurTurn,          AT_ONCE,    PadReplanning,   A::RequestDetour, "All others stand: planning around"),
    info(&[PadReplanning],    G::DetourReady,      AT_ONCE,    Scheduled,       A::None,        "A way around is found"),
    warn(&[PadReplanning],    G::DetourFailed,     AT_ONCE,    Scheduled,       A::None,        "No way around yet"),
    warn(&[PadReplanning],    G::Elapsed,          s(5),   Scheduled,       A::MissDetour,  "The way around is late"),
    warn(&[Scheduled],        G::ColumnBlocked,    s(20),  Scheduled,       A::None,        "Vehicle above the pad: start waits"),
    warn(&[Scheduled],        G::NeighboursSilent, s(10),  Scheduled,       A::None,        "No neighbour hears us: start waits"),
    warn(&[Scheduled],        G::PlansDiffer,      s(10),  Scheduled,       A::None,        "Another plan is heard: start waits"),
    info(&[Scheduled],        G::GatesOpen,        AT_ONCE,    Streaming,       A::HoldHere,    ""),
    info(&[Streaming],        G::Elapsed,          s(1),   Engaging,        A::AskOffboard, ""),
    info(&[Engaging],         G::Offboard,         AT_ONCE,    Arming,          A::AskArm,      "Setpoints followed: arming"),
    warn(&[Engaging],         G::Elapsed,          s(5),   Aborted,         A::ForgetStart, "Setpoint mode refused: mission aborted"),
    info(&[Arming],           G::Armed,            AT_ONCE,    TakeOff,         A::AskTakeOff,  "Taking off"),
    warn(&[Arming],           G::ArmedUnseen,      AT_ONCE,    CancelStart,     A::CancelStart, "Disarmed by someone else: start cancelled"),
    warn(&[Arming],           G::ArmingUnanswered, AT_ONCE,    CancelStart,     A::CancelStart, "Arming not answered: start cancelled"),
    warn(&[Arming],           G::Elapsed,          s(20),  CancelStart,     A::CancelStart, "Arming refused: mission aborted"),
    warn(&[CancelStart],      G::InAir,            AT_ONCE,    Land,            A::AskLand,     "Lifted off all the same: landing"),
    info(&[CancelStart],      G::StaysDisarmedPaused, ARMED_BIT_TIMEOUT, Scheduled,    A::None,        ""),
    info(&[CancelStart],      G::StaysDisarmed,    ARMED_BIT_TIMEOUT, Aborted,         A::ForgetStart, "Start is cancelled"),
    warn(&[CancelStart],      G::StaysArmed,       s(5),   Land,            A::AskLand,     "Still armed on the pad: landing"),
    info(&[TakeOff],          G::LiftedOff,        AT_ONCE,    Climb,           A::BeginClimb,  ""),
    warn(&[TakeOff],          G::Elapsed,          s(12),  Land,            A::AskLand,     "Take-off takes too long: landing"),
    info(&[Climb],            G::ClimbDone,        AT_ONCE,    Follow,          A::RunPath,     "Following the path"),
    warn(&[Climb],            G::Elapsed,          s(60),  Land,            A::AskLand,     "Climb takes too long: landing"),
    warn(&[Follow, Blocked],  G::YieldedOverField, s(60),  Blocked,         A::TurnHome,    "Yielded for 60 s: planning the way home"),
    warn(&[Follow, Blocked],  G::HinderedOverField, s(90), Blocked,         A::TurnHome,    "Vehicle on the path: planning the way home"),
    warn(&[Follow, Blocked],  G::Yielded,          s(60),  Stopping,        A::BrakeOnPath, "Yielded for 60 s: landing"),
    warn(&[Follow, Blocked],  G::Hindered,         s(90),  Stopping,        A::BrakeOnPath, "Vehicle on the path for 90 s: landing"),
    info(&[Follow],           G::PathDone,         AT_ONCE,    Land,            A::AskLand,     "At the goal: landing"),
    info(&[Follow, Blocked],  G::HoldsToDivide,    AT_ONCE,    Dividing,        A::BrakeOnPath, "Area is divided again: waits"),
    info(&[Follow],           G::AroundFlown,      AT_ONCE,    Dividing,        A::BrakeOnPath, ""),
    info(&[Dividing],         G::OwnPlanReady,     AT_ONCE,    Follow,          A::FlyDivision, "Flown around: on its path again"),
    warn(&[Dividing],         G::OwnPlanLost,      AT_ONCE,    Blocked,         A::TurnHome,    "Path not found again: planning the way home"),
    info(&[Dividing],         G::DivisionReady,    AT_ONCE,    Follow,          A::FlyDivision, "Area divided again: flying on"),
    info(&[Dividing],         G::NothingToDivide,  AT_ONCE,    Follow,          A::RunPath,     "Nothing to divide: flying on"),
    warn(&[Dividing],         G::Elapsed,          s(300), Stopping,        A::BrakeOnPath, "No division for 5 min: landing"),
    info(&[Climb, Follow, Alone, Blocked, Replanning, Dividing], G::PauseCommanded, AT_ONCE, Paused, A::BrakeOnPath, "Paused"),
    warn(&[Follow, Blocked, Dividing], G::NeighboursSilent, s(1), Alone,           A::BrakeOnPath, "Neighbours silent: stopping"),
    warn(&[Follow],           G::PadTaken,         s(20),  Replanning,      A::RequestLanding, "No room to land: seeking a place aside"),
    info(&[Follow],           G::AsideReached,     AT_ONCE,    Land,            A::AskLand,     "Landing aside"),
    warn(&[Follow],           G::PathBlocked,      AT_ONCE,    Blocked,         A::BrakeOnPath, "Path blocked: waiting until all others stand"),
    warn(&[Follow, Blocked],  G::Unfollowed,       UNFOLLOWED_MOST, Land,            A::AskLand,     "Setpoint not followed for 20 s: landing"),
    warn(&[Follow],           G::StalledOverField, s(600), Blocked,         A::TurnHome,    "No progress for 10 min: planning the way home"),
    warn(&[Follow],           G::Stalled,          s(600), Land,            A::AskLand,     "No progress for 10 min: landing"),
    info(&[Blocked],          G::PathClear,        AT_ONCE,    Follow,          A::RunPath,     "Path clear again"),
    info(&[Blocked],          G::StandsToReturn,   AT_ONCE,    Replanning,      A::RequestHome, ""),
    warn(&[Blocked],          G::NoWayHome,        s(20),  Follow,          A::TurnBack,    "No way home: flying back as it came"),
    info(&[Blocked],          G::AroundOverField,  s(5),   Replanning,      A::RequestBeyond, ""),
    warn(&[Blocked],          G::BlockedOverField, s(120), Blocked,         A::TurnHome,    "Path blocked for 2 min: planning the way home"),
    warn(&[Blocked],          G::NoWayAround,      AT_ONCE,    Land,            A::AskLand,     "No way around: landing"),
    warn(&[Blocked],          G::NoWayOn,          AT_ONCE,    Follow,          A::TurnBack,    "No way around, no room below: flying back"),
    warn(&[Blocked],          G::Stalled,          s(300), Land,            A::AskLand,     "Path blocked for 5 min: landing"),
    warn(&[Follow, Blocked],  G::Underneath,       s(1),   Replanning,      A::RequestAside, "Under one that lands: planning aside"),
    info(&[Blocked],          G::OurTurn,          AT_ONCE,    Replanning,      A::RequestDetour, "All others stand: planning around"),
    info(&[Replanning],       G::WayHomeReady,     AT_ONCE,    Follow,          A::FlyDetour,   "Flying home"),
    info(&[Replanning],       G::DetourReady,      AT_ONCE,    Follow,          A::FlyDetour,   "Flying around"),
    warn(&[Replanning],       G::NoPlaceAside,     AT_ONCE,    LandingHeld,     A::HoldOver,    "No place aside either: landing waits"),
    warn(&[Replanning],       G::DetourFailed,     AT_ONCE,    Blocked,         A::None,        "No way around yet"),
    warn(&[Replanning],       G::Elapsed,          s(5),   Blocked,         A::MissDetour,  "The way around is late"),
    back(&[Paused],           G::ResumeCommanded,  AT_ONCE,                     A::Rejoin,      "Resumed"),
    warn(&[Paused],           G::Elapsed,          s(600), Land,            A::AskLand,     "Paused for 10 min: landing"),
    info(&[Alone],            G::NeighbourHeard,   AT_ONCE,    Follow,          A::RunPath,     "Neighbours heard again"),
    info(&[Alone],            G::WayFree,          AT_ONCE,    Follow,          A::RunPath,     "Gates open: flying on unheard"),
    warn(&[Alone],            G::OutOfRange,       s(16),  Land,            A::AskLand,     "Still out of range: landing"),
    warn(&[Alone],            G::Elapsed,          s(20),  Land,            A::AskLand,     "Neighbours still silent: landing"),
    info(&[AutopilotSilent],  G::AutopilotHeard,   AT_ONCE,    PositionLost,    A::BrakeOnPath, "Autopilot heard again"),
    warn(&[AutopilotSilent],  G::Elapsed,          s(60),  Land,            A::AskLand,     "Autopilot still silent: landing"),
    back(&[PositionLost],     G::BackOnPath,       AT_ONCE,                     A::Rejoin,      "Position known again"),
    warn(&[PositionLost],     G::BackOffPath,      AT_ONCE,    Land,            A::AskLand,     "Position is elsewhere: landing"),
    warn(&[PositionLost],     G::Elapsed,          s(3),   Land,            A::AskLand,     "Position still lost: landing"),
    info(&[Land, Disarm],     G::DisarmedAtGoal,   AT_ONCE,    Done,            A::ForgetStart, "Landed"),
    warn(&[Land, Disarm],     G::Disarmed,         AT_ONCE,    Aborted,         A::ForgetStart, "Landed short of the goal: mission over"),
    warn(&[Land],             G::LandingBlocked,   AT_ONCE,    LandingHeld,     A::HoldOver,    "Vehicle below: landing stopped"),
    info(&[LandingHeld],      G::LandingClear,     s(1),   Land,            A::AskLand,     "Clear below: landing"),
    warn(&[LandingHeld],      G::BatteryCritical,  AT_ONCE,    Land,            A::AskLand,     "Battery critical: landing"),
    warn(&[LandingHeld],      G::NoRoomToLand,     s(20),  Follow,          A::TurnBack,    "No room to land: flying back to the start"),
    warn(&[LandingHeld],      G::NoRoomHere,       s(20),  Replanning,      A::RequestLanding, "No room to land: seeking a place aside"),
    warn(&[LandingHeld],      G::Elapsed,          s(25),  LandingHeld,     A::HoldOver,    "Vehicle still below: landing waits"),
    info(&[Land],             G::OnGround,         AT_ONCE,    Disarm,          A::AskDisarm,   ""),
    warn(&[Land],             G::Elapsed,          s(120), Land,            A::AskLand,     "Landing takes long"),
    warn(&[Disarm],           G::InAir,            AT_ONCE,    Land,            A::AskLand,     "Still in the air: landing"),
    warn(&[Disarm],           G::DisarmRefused,    AT_ONCE,    Land,            A::AskLand,     "Disarming refused: landing"),
    warn(&[Disarm],           G::Elapsed,          s(30),  Aborted,         A::ForgetStart, "On the ground, still armed"),
    // After the pilot or a failsafe.
    warn(&[PilotControl, PilotReturned], G::Disarmed, AT_ONCE,    Aborted,         A::ForgetStart, "Pilot landed: mission over"),
    warn(&[PilotControl, PilotReturned], G::FailsafeActs, AT_ONCE,    Failsafe,        A::None,        "Autopilot failsafe: setpoints stopped"),
    info(&[PilotControl],     G::Offboard,         AT_ONCE,    PilotReturned,   A::HoldHere,    "Pilot gives back: holds, waits for resume"),
    warn(&[PilotReturned],    G::ModeTaken,        AT_ONCE,    PilotControl,    A::None,        "Pilot has control: mission stopped"),
    back(&[PilotReturned],    G::ResumedOnPath,    AT_ONCE,                     A::Rejoin,      "Resumed after the pilot"),
    warn(&[PilotReturned],    G::ResumedOffPath,   AT_ONCE,    Land,            A::AskLand,     "Too far from the path: landing"),
    warn(&[PilotControl],     G::Elapsed,          s(900), PilotControl,    A::None,        "Pilot still has control"),
    warn(&[PilotReturned],    G::Elapsed,          s(900), PilotReturned,   A::None,        "Still waits for resume"),
    warn(&[Failsafe],         G::Disarmed,         AT_ONCE,    Aborted,         A::ForgetStart, "Landed after failsafe: mission over"),
    warn(&[Failsafe],         G::Elapsed,          s(300), Failsafe,        A::None,        "Autopilot failsafe still acts"),
    warn(&[Aborted, Done],    G::Unattended,       AT_ONCE,    Land,            A::AskLand,     "Still in the air: landing"),
    info(&[Aborted],          G::StartAgain,       AT_ONCE,    WaitPosition,    A::ForgetStart, "Planning again: start again when ready"),
    info(&[Done],             G::StartOverField,   AT_ONCE,    WaitPosition,    A::ForgetStart, "Planning again: start again when ready"),
];
