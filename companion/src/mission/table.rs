//! The rows of the mission's transition table; [`crate::mission`] says what states, guards and actions are.

use super::guard::Guard;
use super::row::{Action, NOW, Row, bits};
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
const MS2500: Duration = Duration::from_millis(2500);

use Action as A;
use Guard as G;
use State::*;

/// States on the ground before arming.
pub(crate) const WAITING: &[State] = &[WaitPosition, Planning, Ready, Scheduled, PadReplanning];
/// States on the pad after the start command, before arming is requested.
pub(crate) const STARTED: &[State] = &[Scheduled, PadReplanning, Streaming, Engaging];
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
pub(crate) const SOUND: &[State] =
    &[TakeOff, Climb, Follow, Paused, Alone, Blocked, Replanning, Dividing, Stopping, LandingHeld];
/// States of [`SOUND`] on the path, under way or stopped: the vehicle can stop along its
/// path.
pub(crate) const ON_PATH: &[State] = &[Follow, Paused, Alone, Blocked, Replanning, Dividing];

/// States of [`SOUND`] before the landing.
pub(crate) const IN_ROUTE: &[State] =
    &[TakeOff, Climb, Follow, Paused, Alone, Blocked, Replanning, Dividing, Stopping];

/// States in the air in which the autopilot was heard.
pub(crate) const LINKED: &[State] = &[
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
    warn(FLYING,              G::Disarmed,         NOW,    Aborted,         A::ForgetStart, "Disarmed in flight: mission over"),
    warn(FLYING,              G::FailsafeActs,     NOW,    Failsafe,        A::None,        "Autopilot failsafe: setpoints stopped"),
    warn(FLYING,              G::ModeTaken,        NOW,    PilotControl,    A::None,        "Pilot has control: mission stopped"),
    warn(&[Land, Disarm],     G::FailsafeActs,     NOW,    Failsafe,        A::None,        "Autopilot failsafe while landing"),
    warn(&[Land, Disarm],     G::ModeTaken,        NOW,    PilotControl,    A::None,        "Pilot has control: landing stopped"),
    warn(ON_PAD,              G::FailsafeActs,     NOW,    Aborted,         A::ForgetStart, "Failsafe before take-off: start cancelled"),
    warn(ON_PAD,              G::ModeTaken,        NOW,    Aborted,         A::ForgetStart, "Mode changed by pilot: start cancelled"),
    // Started again in the air: what flies the vehicle goes on doing so; without setpoints that is the autopilot alone.
    warn(WAITING,             G::FoundFlying,      NOW,    Failsafe,        A::ForgetStart, "Found in flight: no mission"),
    // Links and position.
    warn(WAITING,             G::NoHeartbeat,      s(3),   WaitAutopilot,   A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(&[Streaming, Engaging], G::NoHeartbeat,   s(3),   Aborted,     A::ForgetStart, "Autopilot silent: start cancelled"),
    warn(&[Arming],           G::NoHeartbeat,      s(3),   CancelStart,     A::CancelStart, "Autopilot silent: start cancelled"),
    warn(&[CancelStart],      G::NoHeartbeat,      s(60),  Aborted,         A::ForgetStart, "Autopilot lost"),
    warn(LINKED,              G::NoHeartbeat,      s(3),   AutopilotSilent, A::BrakeOnPath, "Autopilot silent: stopping"),
    warn(&[Disarm, PilotControl, Failsafe], G::NoHeartbeat, s(60), Aborted, A::ForgetStart, "Autopilot lost"),
    warn(&[Land],             G::NoHeartbeat,      s(120), Aborted,         A::ForgetStart, "Autopilot lost"),
    warn(&[PilotReturned],    G::NoHeartbeat,      s(60),  Land,            A::AskLand,     "Autopilot still silent: landing"),
    warn(&[Planning, Ready, Scheduled, PadReplanning], G::NoPosition, s(2), WaitPosition,  A::ForgetStart, "Position lost: start cancelled"),
    warn(&[Streaming, Engaging], G::NoPosition,    s(1),   Aborted,         A::ForgetStart, "Position lost: start cancelled"),
    warn(&[Arming],           G::NoPosition,       s(1),   CancelStart,     A::CancelStart, "Position lost: start cancelled"),
    // On the pad the pilot wins too, and what was checked at the start is checked until arming.
    warn(STARTED,             G::Armed,            NOW,    Aborted,         A::ForgetStart, "Armed by someone else: start cancelled"),
    warn(STARTED,             G::AwayFromStart,    NOW,    Aborted,         A::ForgetStart, "Not at its start: start cancelled"),
    warn(STARTED,             G::ChargeLow,        NOW,    Aborted,         A::ForgetStart, "Battery low: start cancelled"),
    warn(STARTED,             G::Outside,          NOW,    Aborted,         A::ForgetStart, "Outside the geofence: start cancelled"),
    warn(&[Arming],           G::AwayFromStart,    NOW,    CancelStart,     A::CancelStart, "Not at its start: start cancelled"),
    warn(&[Arming],           G::ChargeLow,        NOW,    CancelStart,     A::CancelStart, "Battery low: start cancelled"),
    warn(&[Arming],           G::Outside,          NOW,    CancelStart,     A::CancelStart, "Outside the geofence: start cancelled"),
    warn(LINKED,              G::OriginMoved,      NOW,    Land,            A::AskLand,     "EKF origin moved: landing"),
    warn(&[PilotReturned],    G::OriginMoved,      NOW,    Land,            A::AskLand,     "EKF origin moved: landing"),
    warn(SOUND,               G::PositionJumped,   NOW,    PositionLost,    A::BrakeOnPath, "Position jumped: stopping"),
    warn(SOUND,               G::NoPosition,       s(1),   PositionLost,    A::BrakeOnPath, "Position lost: stopping"),
    // Orders and limits in flight.
    info(ON_PATH,             G::LandCommanded,    NOW,    Stopping,        A::BrakeOnPath, "Landing as commanded"),
    info(&[TakeOff, Climb, PositionLost, AutopilotSilent, PilotReturned], G::LandCommanded, NOW, Land, A::AskLand, "Landing as commanded"),
    info(&[Failsafe, Aborted], G::LandUnattended,  NOW,    Land,            A::AskLand,     "Landing as commanded"),
    warn(ON_PATH,             G::BatteryCritical,  NOW,    Stopping,        A::BrakeOnPath, "Battery critical: landing"),
    warn(ON_PATH,             G::BatteryLow,       NOW,    Stopping,        A::BrakeOnPath, "Battery low: landing"),
    warn(&[TakeOff, Climb, PilotReturned], G::BatteryCritical, NOW,    Land,            A::AskLand,     "Battery critical: landing"),
    warn(&[TakeOff, Climb, PilotReturned], G::BatteryLow, NOW,    Land,            A::AskLand,     "Battery low: landing"),
    warn(IN_ROUTE,            G::EstimateVague,    s(30),  Land,            A::AskLand,     "Estimate worse than margin for 30 s: landing"),
    warn(IN_ROUTE,            G::OutsideGeofence,  NOW,    Land,            A::AskLand,     "Geofence reached: landing"),
    // The division that others decided while this vehicle was not heard.
    warn(&[TakeOff, Climb, PilotReturned], G::Excluded, NOW,   Land,            A::AskLand,     "Its part was given away: landing"),
    warn(ON_PATH,             G::Excluded,         NOW,    Stopping,        A::BrakeOnPath, "Its part was given away: landing"),
    info(&[Stopping],         G::Standing,         NOW,    Land,            A::AskLand,     ""),
    info(&[Stopping],         G::Elapsed,          s(5),   Land,            A::AskLand,     ""),
    info(&[Paused],           G::ReturnInClimb,    NOW,    Land,            A::AskLand,     "Landing on the pad"),
    info(ON_PATH,             G::ReturnOverField,  NOW,    Blocked,         A::TurnHome,    "Planning the way home"),
    info(ON_PATH,             G::ReturnCommanded,  NOW,    Follow,          A::TurnBack,    "Flying back to the start"),
    info(&[TakeOff, Climb],   G::ReturnCommanded,  NOW,    Land,            A::AskLand,     "Landing on the pad"),
    // The mission in order.
    info(&[WaitAutopilot],    G::AutopilotHeard,   NOW,    WaitPosition,    A::Connect,     "Autopilot found"),
    info(&[WaitPosition],     G::PositionKnown,    NOW,    Planning,        A::RequestPlan, "Position known: planning"),
    warn(&[Planning],         G::RoadmapBad,       NOW,    Aborted,         A::ForgetStart, "Roadmap or field missing or wrong: mission aborted"),
    warn(&[Planning],         G::PlanFailed,       NOW,    Aborted,         A::ForgetStart, "No plan: mission aborted"),
    info(&[Planning],         G::PlanReady,        NOW,    Ready,           A::None,        "Ready"),
    warn(&[Planning],         G::Elapsed,          s(30),  Planning,        A::RequestPlan, "Plan is late: asked again"),
    info(&[Ready],            G::StartWithoutGoal, NOW,    Done,            A::ForgetStart, "No goal for this vehicle: staying"),
    warn(&[Ready],            G::StartElsewhere,   NOW,    Aborted,         A::ForgetStart, "Not at its start: start refused"),
    warn(&[Ready],            G::StartArmed,       NOW,    Aborted,         A::ForgetStart, "Armed by someone else: start refused"),
    warn(&[Ready],            G::StartBatteryLow,  NOW,    Aborted,         A::ForgetStart, "Battery low: start refused"),
    warn(&[Ready],            G::StartOutside,     NOW,    Aborted,         A::ForgetStart, "Outside the geofence: start refused"),
    warn(&[Ready],            G::StartVague,       s(3),    Aborted,         A::ForgetStart, "Estimate worse than margin: start refused"),
    info(&[Ready],            G::StartCommanded,   NOW,    Scheduled,       A::None,        "Started"),
    info(&[Ready, Scheduled], G::MoreIsDone,       NOW,    Planning,        A::RequestPlan, "More is photographed: planning again"),
    warn(STARTED,             G::Excluded,         NOW,    Aborted,         A::ForgetStart, "Its part was given away: start cancelled"),
    info(&[Ready, Scheduled, PadReplanning, Streaming, Engaging], G::LandCommanded, NOW, Aborted, A::ForgetStart, "Start cancelled as commanded"),
    info(&[Ready, Scheduled, PadReplanning, Streaming, Engaging], G::ReturnCommanded, NOW, Aborted, A::ForgetStart, "Start cancelled as commanded"),
    info(&[Arming, CancelStart], G::LandCommanded, NOW,    CancelStart,     A::CancelStart, "Start cancelled as commanded"),
    info(&[Arming, CancelStart], G::ReturnCommanded, NOW,  CancelStart,     A::CancelStart, "Start cancelled as commanded"),
    info(&[Streaming, Engaging], G::PauseCommanded, NOW,   Scheduled,       A::None,        "Paused on the pad"),
    info(&[Arming],           G::PauseCommanded,   NOW,    CancelStart,     A::AskDisarm,   "Paused on the pad"),
    info(&[Scheduled],        G::PausedOnPad,      s(30),  Scheduled,       A::None,        "Paused on the pad: waits for resume"),
    info(&[Scheduled],        G::OurTurn,          NOW,    PadReplanning,   A::RequestDetour, "All others stand: planning around"),
    info(&[PadReplanning],    G::DetourReady,      NOW,    Scheduled,       A::None,        "A way around is found"),
    warn(&[PadReplanning],    G::DetourFailed,     NOW,    Scheduled,       A::None,        "No way around yet"),
    warn(&[PadReplanning],    G::Elapsed,          s(5),   Scheduled,       A::MissDetour,  "The way around is late"),
    warn(&[Scheduled],        G::ColumnBlocked,    s(20),  Scheduled,       A::None,        "Vehicle above the pad: start waits"),
    warn(&[Scheduled],        G::NeighboursSilent, s(10),  Scheduled,       A::None,        "No neighbour hears us: start waits"),
    warn(&[Scheduled],        G::PlansDiffer,      s(10),  Scheduled,       A::None,        "Another plan is heard: start waits"),
    info(&[Scheduled],        G::GatesOpen,        NOW,    Streaming,       A::HoldHere,    ""),
    info(&[Streaming],        G::Elapsed,          s(1),   Engaging,        A::AskOffboard, ""),
    info(&[Engaging],         G::Offboard,         NOW,    Arming,          A::AskArm,      "Setpoints followed: arming"),
    warn(&[Engaging],         G::Elapsed,          s(5),   Aborted,         A::ForgetStart, "Setpoint mode refused: mission aborted"),
    info(&[Arming],           G::Armed,            NOW,    TakeOff,         A::AskTakeOff,  "Taking off"),
    warn(&[Arming],           G::ArmedUnseen,      NOW,    CancelStart,     A::CancelStart, "Disarmed by someone else: start cancelled"),
    warn(&[Arming],           G::ArmingUnanswered, NOW,    CancelStart,     A::CancelStart, "Arming not answered: start cancelled"),
    warn(&[Arming],           G::Elapsed,          s(20),  CancelStart,     A::CancelStart, "Arming refused: mission aborted"),
    warn(&[CancelStart],      G::InAir,            NOW,    Land,            A::AskLand,     "Lifted off all the same: landing"),
    info(&[CancelStart],      G::StaysDisarmedPaused, MS2500, Scheduled,    A::None,        ""),
    info(&[CancelStart],      G::StaysDisarmed,    MS2500, Aborted,         A::ForgetStart, "Start is cancelled"),
    warn(&[CancelStart],      G::StaysArmed,       s(5),   Land,            A::AskLand,     "Still armed on the pad: landing"),
    info(&[TakeOff],          G::LiftedOff,        NOW,    Climb,           A::BeginClimb,  ""),
    warn(&[TakeOff],          G::Elapsed,          s(12),  Land,            A::AskLand,     "Take-off takes too long: landing"),
    info(&[Climb],            G::ClimbDone,        NOW,    Follow,          A::RunPath,     "Following the path"),
    warn(&[Climb],            G::Elapsed,          s(60),  Land,            A::AskLand,     "Climb takes too long: landing"),
    warn(&[Follow, Blocked],  G::YieldedOverField, s(60),  Blocked,         A::TurnHome,    "Yielded for 60 s: planning the way home"),
    warn(&[Follow, Blocked],  G::HinderedOverField, s(90), Blocked,         A::TurnHome,    "Vehicle on the path: planning the way home"),
    warn(&[Follow, Blocked],  G::Yielded,          s(60),  Stopping,        A::BrakeOnPath, "Yielded for 60 s: landing"),
    warn(&[Follow, Blocked],  G::Hindered,         s(90),  Stopping,        A::BrakeOnPath, "Vehicle on the path for 90 s: landing"),
    info(&[Follow],           G::PathDone,         NOW,    Land,            A::AskLand,     "At the goal: landing"),
    info(&[Follow, Blocked],  G::HoldsToDivide,    NOW,    Dividing,        A::BrakeOnPath, "Area is divided again: waits"),
    info(&[Follow],           G::AroundFlown,      NOW,    Dividing,        A::BrakeOnPath, ""),
    info(&[Dividing],         G::OwnPlanReady,     NOW,    Follow,          A::FlyDivision, "Flown around: on its path again"),
    warn(&[Dividing],         G::OwnPlanLost,      NOW,    Blocked,         A::TurnHome,    "Path not found again: planning the way home"),
    info(&[Dividing],         G::DivisionReady,    NOW,    Follow,          A::FlyDivision, "Area divided again: flying on"),
    info(&[Dividing],         G::NothingToDivide,  NOW,    Follow,          A::RunPath,     "Nothing to divide: flying on"),
    warn(&[Dividing],         G::Elapsed,          s(300), Stopping,        A::BrakeOnPath, "No division for 5 min: landing"),
    info(&[Climb, Follow, Alone, Blocked, Replanning, Dividing], G::PauseCommanded, NOW, Paused, A::BrakeOnPath, "Paused"),
    warn(&[Follow, Blocked, Dividing], G::NeighboursSilent, s(1), Alone,           A::BrakeOnPath, "Neighbours silent: stopping"),
    warn(&[Follow],           G::PadTaken,         s(20),  Replanning,      A::RequestLanding, "No room to land: seeking a place aside"),
    info(&[Follow],           G::AsideReached,     NOW,    Land,            A::AskLand,     "Landing aside"),
    warn(&[Follow],           G::PathBlocked,      NOW,    Blocked,         A::BrakeOnPath, "Path blocked: waiting until all others stand"),
    warn(&[Follow],           G::StalledOverField, s(600), Blocked,         A::TurnHome,    "No progress for 10 min: planning the way home"),
    warn(&[Follow],           G::Stalled,          s(600), Land,            A::AskLand,     "No progress for 10 min: landing"),
    info(&[Blocked],          G::PathClear,        NOW,    Follow,          A::RunPath,     "Path clear again"),
    info(&[Blocked],          G::StandsToReturn,   NOW,    Replanning,      A::RequestHome, ""),
    warn(&[Blocked],          G::NoWayHome,        s(20),  Follow,          A::TurnBack,    "No way home: flying back as it came"),
    info(&[Blocked],          G::AroundOverField,  s(5),   Replanning,      A::RequestBeyond, ""),
    warn(&[Blocked],          G::BlockedOverField, s(120), Blocked,         A::TurnHome,    "Path blocked for 2 min: planning the way home"),
    warn(&[Blocked],          G::NoWayAround,      NOW,    Land,            A::AskLand,     "No way around: landing"),
    warn(&[Blocked],          G::NoWayOn,          NOW,    Follow,          A::TurnBack,    "No way around, no room below: flying back"),
    warn(&[Blocked],          G::Stalled,          s(300), Land,            A::AskLand,     "Path blocked for 5 min: landing"),
    warn(&[Follow, Blocked],  G::Underneath,       s(1),   Replanning,      A::RequestAside, "Under one that lands: planning aside"),
    info(&[Blocked],          G::OurTurn,          NOW,    Replanning,      A::RequestDetour, "All others stand: planning around"),
    info(&[Replanning],       G::WayHomeReady,     NOW,    Follow,          A::FlyDetour,   "Flying home"),
    info(&[Replanning],       G::DetourReady,      NOW,    Follow,          A::FlyDetour,   "Flying around"),
    warn(&[Replanning],       G::NoPlaceAside,     NOW,    LandingHeld,     A::HoldOver,    "No place aside either: landing waits"),
    warn(&[Replanning],       G::DetourFailed,     NOW,    Blocked,         A::None,        "No way around yet"),
    warn(&[Replanning],       G::Elapsed,          s(5),   Blocked,         A::MissDetour,  "The way around is late"),
    back(&[Paused],           G::ResumeCommanded,  NOW,                     A::Rejoin,      "Resumed"),
    warn(&[Paused],           G::Elapsed,          s(600), Land,            A::AskLand,     "Paused for 10 min: landing"),
    info(&[Alone],            G::NeighbourHeard,   NOW,    Follow,          A::RunPath,     "Neighbours heard again"),
    info(&[Alone],            G::WayFree,          NOW,    Follow,          A::RunPath,     "Gates open: flying on unheard"),
    warn(&[Alone],            G::OutOfRange,       s(16),  Land,            A::AskLand,     "Still out of range: landing"),
    warn(&[Alone],            G::Elapsed,          s(20),  Land,            A::AskLand,     "Neighbours still silent: landing"),
    info(&[AutopilotSilent],  G::AutopilotHeard,   NOW,    PositionLost,    A::BrakeOnPath, "Autopilot heard again"),
    warn(&[AutopilotSilent],  G::Elapsed,          s(60),  Land,            A::AskLand,     "Autopilot still silent: landing"),
    back(&[PositionLost],     G::BackOnPath,       NOW,                     A::Rejoin,      "Position known again"),
    warn(&[PositionLost],     G::BackOffPath,      NOW,    Land,            A::AskLand,     "Position is elsewhere: landing"),
    warn(&[PositionLost],     G::Elapsed,          s(3),   Land,            A::AskLand,     "Position still lost: landing"),
    info(&[Land, Disarm],     G::DisarmedAtGoal,   NOW,    Done,            A::ForgetStart, "Landed"),
    warn(&[Land, Disarm],     G::Disarmed,         NOW,    Aborted,         A::ForgetStart, "Landed short of the goal: mission over"),
    warn(&[Land],             G::LandingBlocked,   NOW,    LandingHeld,     A::HoldOver,    "Vehicle below: landing stopped"),
    info(&[LandingHeld],      G::LandingClear,     s(1),   Land,            A::AskLand,     "Clear below: landing"),
    warn(&[LandingHeld],      G::BatteryCritical,  NOW,    Land,            A::AskLand,     "Battery critical: landing"),
    warn(&[LandingHeld],      G::NoRoomToLand,     s(20),  Follow,          A::TurnBack,    "No room to land: flying back to the start"),
    warn(&[LandingHeld],      G::NoRoomHere,       s(20),  Replanning,      A::RequestLanding, "No room to land: seeking a place aside"),
    warn(&[LandingHeld],      G::Elapsed,          s(25),  LandingHeld,     A::HoldOver,    "Vehicle still below: landing waits"),
    info(&[Land],             G::OnGround,         NOW,    Disarm,          A::AskDisarm,   ""),
    warn(&[Land],             G::Elapsed,          s(120), Land,            A::AskLand,     "Landing takes long"),
    warn(&[Disarm],           G::InAir,            NOW,    Land,            A::AskLand,     "Still in the air: landing"),
    warn(&[Disarm],           G::DisarmRefused,    NOW,    Land,            A::AskLand,     "Disarming refused: landing"),
    warn(&[Disarm],           G::Elapsed,          s(30),  Aborted,         A::ForgetStart, "On the ground, still armed"),
    // After the pilot or a failsafe.
    warn(&[PilotControl, PilotReturned], G::Disarmed, NOW,    Aborted,         A::ForgetStart, "Pilot landed: mission over"),
    warn(&[PilotControl, PilotReturned], G::FailsafeActs, NOW,    Failsafe,        A::None,        "Autopilot failsafe: setpoints stopped"),
    info(&[PilotControl],     G::Offboard,         NOW,    PilotReturned,   A::HoldHere,    "Pilot gives back: holds, waits for resume"),
    warn(&[PilotReturned],    G::ModeTaken,        NOW,    PilotControl,    A::None,        "Pilot has control: mission stopped"),
    back(&[PilotReturned],    G::ResumedOnPath,    NOW,                     A::Rejoin,      "Resumed after the pilot"),
    warn(&[PilotReturned],    G::ResumedOffPath,   NOW,    Land,            A::AskLand,     "Too far from the path: landing"),
    warn(&[PilotControl],     G::Elapsed,          s(900), PilotControl,    A::None,        "Pilot still has control"),
    warn(&[PilotReturned],    G::Elapsed,          s(900), PilotReturned,   A::None,        "Still waits for resume"),
    warn(&[Failsafe],         G::Disarmed,         NOW,    Aborted,         A::ForgetStart, "Landed after failsafe: mission over"),
    warn(&[Failsafe],         G::Elapsed,          s(300), Failsafe,        A::None,        "Autopilot failsafe still acts"),
    warn(&[Aborted, Done],    G::Unattended,       NOW,    Land,            A::AskLand,     "Still in the air: landing"),
    info(&[Aborted],          G::StartAgain,       NOW,    WaitPosition,    A::ForgetStart, "Planning again: start again when ready"),
    info(&[Done],             G::StartOverField,   NOW,    WaitPosition,    A::ForgetStart, "Planning again: start again when ready"),
];
