//! The rows of the mission's transition table; [`State`], [`Guard`] and [`Action`] explain their
//! terms.

use super::guard::Guard;
use super::row::{AT_ONCE, Action, TransitionRow, state_mask};
use crate::link::severity::Severity;
use crate::state::State;
use crate::state::interruption::TargetState;
use crate::time::Duration;

/// A whole number of seconds.
pub(crate) const fn secs(secs: u64) -> Duration {
    Duration::from_secs(secs)
}

/// Row whose text has the severity INFO.
pub(crate) const fn info_row(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    to: State,
    action: Action,
    text: &'static str,
) -> TransitionRow {
    TransitionRow {
        from,
        from_mask: state_mask(from),
        guard,
        limit,
        to: TargetState::State(to),
        action,
        text,
        severity: Severity::Info,
    }
}

/// Row whose text is a warning: the mission leaves its usual course.
pub(crate) const fn warning_row(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    to: State,
    action: Action,
    text: &'static str,
) -> TransitionRow {
    TransitionRow {
        from,
        from_mask: state_mask(from),
        guard,
        limit,
        to: TargetState::State(to),
        action,
        text,
        severity: Severity::Warning,
    }
}

/// Row that resumes the interrupted state.
pub(crate) const fn resume_row(
    from: &'static [State],
    guard: Guard,
    limit: Duration,
    action: Action,
    text: &'static str,
) -> TransitionRow {
    TransitionRow {
        from,
        from_mask: state_mask(from),
        guard,
        limit,
        to: TargetState::Interrupted,
        action,
        text,
        severity: Severity::Info,
    }
}

/// Least time in `CancelStart` after which a HEARTBEAT without the armed bit is believed: about
/// twice the time by which that bit lags behind the COMMAND_ACK of arming.
const ARMED_BIT_TIMEOUT: Duration = Duration::from_millis(2500);

/// Time for which the column above the pad may be occupied after the gates have opened, before
/// arming; then the start goes back to waiting. Meanwhile arming is not requested.
const MAX_PAD_COLUMN_BLOCKED: Duration = Duration::from_millis(200);
/// Longest time for which the setpoint stands (advances by at most 0.35 m, `ARRIVED_WITHIN_M`) and
/// the vehicle does not come that near to it; then something holds the vehicle or carries it away,
/// and it lands. While the vehicle is within 2 m of the setpoint in a coverage mission, it has
/// `EXTRA_UNFOLLOWED_IN_SWAY` more.
pub(crate) const MAX_UNFOLLOWED: Duration = secs(20);
/// Time for which the start of a vehicle in a coverage mission may be barred; then it leaves its
/// share to those that fly. A lost vehicle that may come down above its pad is down sooner.
const MAX_START_BARRED: Duration = secs(180);

use Action as A;
use Guard as G;
use State::*;

/// States on the ground in which the companion sends no setpoints yet.
pub(crate) const WAITING_ON_GROUND: &[State] =
    &[WaitPosition, Planning, Ready, Scheduled, PadReplanning];
/// States on the pad after MISSION_START, before arming is requested.
pub(crate) const STARTED_BEFORE_ARMING: &[State] = &[Scheduled, PadReplanning, Streaming, Engaging];
/// States on the pad after MISSION_START, before take-off.
pub(crate) const STARTED_ON_PAD: &[State] =
    &[Scheduled, PadReplanning, Streaming, Engaging, Arming, CancelStart];
/// States in the air, or about to take off, in which the companion flies the vehicle: by setpoints,
/// in `TakeOff` by a command.
pub(crate) const FLYING: &[State] = &[
    TakeOff,
    Climb,
    Follow,
    Paused,
    SwarmLinkLost,
    Blocked,
    Replanning,
    Dividing,
    Stopping,
    LandingHeld,
    AutopilotSilent,
    PositionLost,
];
/// States of [`FLYING`] in which the autopilot is heard and its position is known.
pub(crate) const FLYING_WITH_POSITION: &[State] = &[
    TakeOff,
    Climb,
    Follow,
    Paused,
    SwarmLinkLost,
    Blocked,
    Replanning,
    Dividing,
    Stopping,
    LandingHeld,
];
/// States of [`FLYING_WITH_POSITION`] on the path, moving or standing: the vehicle can brake along
/// its path.
pub(crate) const ON_PATH_WITH_POSITION: &[State] =
    &[Follow, Paused, SwarmLinkLost, Blocked, Replanning, Dividing];

/// States of [`FLYING_WITH_POSITION`] except `LandingHeld`. The descent at the path's end, in
/// `Follow`, does not count as a landing yet.
pub(crate) const FLYING_BEFORE_LANDING: &[State] =
    &[TakeOff, Climb, Follow, Paused, SwarmLinkLost, Blocked, Replanning, Dividing, Stopping];

/// States of [`FLYING`] in which the autopilot does not count as silent.
pub(crate) const FLYING_WITH_AUTOPILOT: &[State] = &[
    TakeOff,
    Climb,
    Follow,
    Paused,
    SwarmLinkLost,
    Blocked,
    Replanning,
    Dividing,
    Stopping,
    LandingHeld,
    PositionLost,
];

/// The transition table of the mission; earlier rows have priority.
#[rustfmt::skip]
pub static TABLE: &[TransitionRow] = &[
    // The pilot's and the autopilot's own actions have priority over everything else.
    warning_row(FLYING,              G::Disarmed,        AT_ONCE,    Aborted,     A::ForgetStart,       "Disarmed in flight: mission over"),
    warning_row(FLYING,              G::FailsafeActs,    AT_ONCE,    Failsafe,    A::None,              "Autopilot failsafe: setpoints stopped"),
    warning_row(FLYING,              G::ModeTaken,       AT_ONCE,    PilotControl, A::None,             "Pilot has control: mission stopped"),
    warning_row(&[Land, Disarm],     G::FailsafeActs,    AT_ONCE,    Failsafe,    A::None,              "Autopilot failsafe while landing"),
    warning_row(&[Land, Disarm],     G::ModeTaken,       AT_ONCE,    PilotControl, A::None,             "Pilot has control: landing stopped"),
    // Once armed the vehicle may be in the air, or be flown on by its pilot: these rows act as in
    // flight.
    warning_row(&[Arming, CancelStart], G::FailsafeActsArmed, AT_ONCE, Failsafe,  A::None,              "Autopilot failsafe: setpoints stopped"),
    warning_row(&[Arming, CancelStart], G::ModeTakenArmed, AT_ONCE,  PilotControl, A::None,             "Pilot has control: mission stopped"),
    warning_row(STARTED_ON_PAD,      G::FailsafeActs,    AT_ONCE,    Aborted,     A::ForgetStart,       "Failsafe before take-off: start cancelled"),
    warning_row(STARTED_ON_PAD,      G::ModeTaken,       AT_ONCE,    Aborted,     A::ForgetStart,       "Mode changed by pilot: start cancelled"),
    // The companion was restarted in the air: it sends no setpoints, and pilot or autopilot go on
    // flying the vehicle.
    warning_row(WAITING_ON_GROUND,   G::FoundFlying,     AT_ONCE,    Failsafe,    A::ForgetStart,       "Found in flight: no mission"),
    // Loss of the autopilot's HEARTBEAT, of the position, or of the EKF origin.
    warning_row(WAITING_ON_GROUND,   G::NoHeartbeat,     secs(3),    WaitAutopilot, A::ForgetStart,     "Autopilot silent: start cancelled"),
    warning_row(&[Streaming, Engaging], G::NoHeartbeat,  secs(3),    Aborted,     A::ForgetStart,       "Autopilot silent: start cancelled"),
    warning_row(&[Arming],           G::NoHeartbeat,     secs(3),    CancelStart, A::CancelStart,       "Autopilot silent: start cancelled"),
    warning_row(&[CancelStart],      G::NoHeartbeat,     secs(60),   Aborted,     A::ForgetStart,       "Autopilot lost"),
    warning_row(FLYING_WITH_AUTOPILOT,       G::NoHeartbeat,     secs(3),    AutopilotSilent, A::BrakeOnPath,   "Autopilot silent: stopping"),
    warning_row(&[Disarm, Failsafe], G::NoHeartbeat,     secs(60),   Aborted,     A::ForgetStart,       "Autopilot lost"),
    warning_row(&[Land],             G::NoHeartbeat,     secs(120),  Aborted,     A::ForgetStart,       "Autopilot lost"),
    warning_row(&[PilotReturned],    G::NoHeartbeat,     secs(60),   Land,        A::RequestLandMode,   "Autopilot still silent: landing"),
    warning_row(&[PilotReturned],    G::StillNoPosition, secs(20),   Land,        A::RequestLandMode,   "Position still lost: landing"),
    warning_row(&[Planning, Ready, Scheduled, PadReplanning], G::NoPosition, secs(2), WaitPosition, A::ForgetStart, "Position lost: start cancelled"),
    warning_row(&[Streaming, Engaging], G::NoPosition,   secs(1),    Aborted,     A::ForgetStart,       "Position lost: start cancelled"),
    warning_row(&[Arming],           G::NoPosition,      secs(1),    CancelStart, A::CancelStart,       "Position lost: start cancelled"),
    // On the pad: somebody else arms or moves the vehicle, or a condition of the start fails before
    // arming.
    warning_row(STARTED_BEFORE_ARMING, G::Armed,           AT_ONCE,    Aborted,     A::ForgetStart,       "Armed by someone else: start cancelled"),
    warning_row(STARTED_BEFORE_ARMING, G::AwayFromPad,     AT_ONCE,    Aborted,     A::ForgetStart,       "Not at its start: start cancelled"),
    warning_row(STARTED_BEFORE_ARMING, G::BatteryLowOnPad,       AT_ONCE,    Aborted,     A::ForgetStart,       "Battery low: start cancelled"),
    warning_row(STARTED_BEFORE_ARMING, G::OutsideGeofenceOnPad,         AT_ONCE,    Aborted,     A::ForgetStart,       "Outside the geofence: start cancelled"),
    warning_row(&[Arming],           G::AwayFromPad,     AT_ONCE,    CancelStart, A::CancelStart,       "Not at its start: start cancelled"),
    warning_row(&[Arming],           G::BatteryLowOnPad,       AT_ONCE,    CancelStart, A::CancelStart,       "Battery low: start cancelled"),
    warning_row(&[Arming],           G::OutsideGeofenceOnPad,         AT_ONCE,    CancelStart, A::CancelStart,       "Outside the geofence: start cancelled"),
    warning_row(FLYING_WITH_AUTOPILOT,       G::OriginMoved,     AT_ONCE,    Land,        A::RequestLandMode,   "EKF origin moved: landing"),
    warning_row(&[PilotReturned],    G::OriginMoved,     AT_ONCE,    Land,        A::RequestLandMode,   "EKF origin moved: landing"),
    warning_row(FLYING_WITH_POSITION,        G::PositionJumped,  AT_ONCE,    PositionLost, A::BrakeOnPath,      "Position jumped: stopping"),
    warning_row(FLYING_WITH_POSITION,        G::NoPosition,      secs(1),    PositionLost, A::BrakeOnPath,      "Position lost: stopping"),
    // Operator's commands and limits in flight.
    info_row(ON_PATH_WITH_POSITION,          G::LandCommanded,   AT_ONCE,    Stopping,    A::BrakeOnPath,       "Landing as commanded"),
    info_row(&[TakeOff, Climb, PositionLost, AutopilotSilent, PilotReturned], G::LandCommanded, AT_ONCE, Land, A::RequestLandMode, "Landing as commanded"),
    info_row(&[Failsafe, Aborted],   G::LandUnattended,  AT_ONCE,    Land,        A::RequestLandMode,   "Landing as commanded"),
    warning_row(ON_PATH_WITH_POSITION,       G::BatteryCritical, AT_ONCE,    Stopping,    A::BrakeOnPath,       "Battery critical: landing"),
    warning_row(ON_PATH_WITH_POSITION,       G::BatteryLow,      AT_ONCE,    Stopping,    A::BrakeOnPath,       "Battery low: landing"),
    warning_row(&[TakeOff, Climb, PilotReturned], G::BatteryCritical, AT_ONCE, Land, A::RequestLandMode, "Battery critical: landing"),
    warning_row(&[TakeOff, Climb, PilotReturned], G::BatteryLow, AT_ONCE, Land,   A::RequestLandMode,   "Battery low: landing"),
    warning_row(FLYING_BEFORE_LANDING, G::EstimateImprecise, secs(30),   Land,        A::RequestLandMode,   "Estimate worse than margin for 30 s: landing"),
    warning_row(FLYING_BEFORE_LANDING, G::OutsideGeofence, AT_ONCE,   Land,        A::RequestLandMode,   "Geofence reached: landing"),
    // This vehicle's share was divided among the others while they did not hear it.
    warning_row(&[TakeOff, Climb, PilotReturned], G::Excluded, AT_ONCE, Land,     A::RequestLandMode,   "Its part was given away: landing"),
    warning_row(ON_PATH_WITH_POSITION,       G::Excluded,        AT_ONCE,    Stopping,    A::BrakeOnPath,       "Its part was given away: landing"),
    info_row(&[Stopping],            G::Standing,        AT_ONCE,    Land,        A::RequestLandMode,   ""),
    info_row(&[Stopping],            G::Elapsed,         secs(5),    Land,        A::RequestLandMode,   ""),
    info_row(&[Paused],              G::ReturnInClimb,   AT_ONCE,    Land,        A::RequestLandMode,   "Landing on the pad"),
    info_row(ON_PATH_WITH_POSITION,          G::ReturnInCoverage, AT_ONCE,    Blocked,     A::TurnHome,          "Planning the way home"),
    info_row(ON_PATH_WITH_POSITION,          G::ReturnCommanded, AT_ONCE,    Follow,      A::TurnBack,          "Flying back to the start"),
    info_row(&[TakeOff, Climb],      G::ReturnCommanded, AT_ONCE,    Land,        A::RequestLandMode,   "Landing on the pad"),
    // The flight in its order.
    info_row(&[WaitAutopilot],       G::AutopilotHeard,  AT_ONCE,    WaitPosition, A::Connect,          "Autopilot found"),
    info_row(&[WaitPosition],        G::PositionKnown,   AT_ONCE,    Planning,    A::RequestPlan,       "Position known: planning"),
    warning_row(&[Planning],         G::RoadmapBad,      AT_ONCE,    Aborted,     A::ForgetStart,       "Roadmap or field missing or wrong: mission aborted"),
    warning_row(&[Planning],         G::PlanFailed,      AT_ONCE,    Aborted,     A::ForgetStart,       "No plan: mission aborted"),
    info_row(&[Planning],            G::PlanReady,       AT_ONCE,    Ready,       A::None,              "Ready"),
    warning_row(&[Planning],         G::Elapsed,         secs(30),   Planning,    A::RequestPlan,       "Plan is late: asked again"),
    info_row(&[Ready],               G::StartWithoutGoal, AT_ONCE,   Done,        A::ForgetStart,       "No goal for this vehicle: staying"),
    info_row(&[Ready],               G::StartInReserve,  AT_ONCE,    Scheduled,   A::None,              "No part for this vehicle: in reserve"),
    warning_row(&[Ready],            G::StartElsewhere,  AT_ONCE,    Aborted,     A::ForgetStart,       "Not at its start: start refused"),
    warning_row(&[Ready],            G::StartArmed,      AT_ONCE,    Aborted,     A::ForgetStart,       "Armed by someone else: start refused"),
    warning_row(&[Ready],            G::StartBatteryLow, AT_ONCE,    Aborted,     A::ForgetStart,       "Battery low: start refused"),
    warning_row(&[Ready],            G::StartOutside,    AT_ONCE,    Aborted,     A::ForgetStart,       "Outside the geofence: start refused"),
    warning_row(&[Ready],            G::StartImprecise,  secs(3),    Aborted,     A::ForgetStart,       "Estimate worse than margin: start refused"),
    info_row(&[Ready],               G::StartCommanded,  AT_ONCE,    Scheduled,   A::None,              "Started"),
    info_row(&[Ready, Scheduled],    G::LeftOutSetChanged, AT_ONCE,    Planning,    A::RequestPlan,       "More is photographed: planning again"),
    warning_row(STARTED_BEFORE_ARMING, G::Excluded,        AT_ONCE,    Aborted,     A::ForgetStart,       "Its part was given away: start cancelled"),
    info_row(&[Ready, Scheduled, PadReplanning, Streaming, Engaging], G::LandCommanded, AT_ONCE, Aborted, A::ForgetStart, "Start cancelled as commanded"),
    info_row(&[Ready, Scheduled, PadReplanning, Streaming, Engaging], G::ReturnCommanded, AT_ONCE, Aborted, A::ForgetStart, "Start cancelled as commanded"),
    info_row(&[Arming, CancelStart], G::LandCommanded,   AT_ONCE,    CancelStart, A::CancelStart,       "Start cancelled as commanded"),
    info_row(&[Arming, CancelStart], G::ReturnCommanded, AT_ONCE,    CancelStart, A::CancelStart,       "Start cancelled as commanded"),
    info_row(&[Streaming, Engaging], G::PauseCommanded,  AT_ONCE,    Scheduled,   A::None,              "Paused on the pad"),
    info_row(&[Arming],              G::PauseCommanded,  AT_ONCE,    CancelStart, A::RequestDisarming,  "Paused on the pad"),
    info_row(&[Scheduled],           G::PausedOnPad,     secs(30),   Scheduled,   A::None,              "Paused on the pad: waits for resume"),
    info_row(&[Scheduled],           G::OurTurn,         AT_ONCE,    PadReplanning, A::RequestDetour,   "All others stand: planning around"),
    info_row(&[PadReplanning],       G::DetourReady,     AT_ONCE,    Scheduled,   A::None,              "A way around is found"),
    warning_row(&[PadReplanning],    G::DetourFailed,    AT_ONCE,    Scheduled,   A::None,              "No way around yet"),
    warning_row(&[PadReplanning],    G::Elapsed,         secs(5),    Scheduled,   A::NoteDetourFailure, "The way around is late"),
    warning_row(&[Scheduled],        G::ColumnBlocked,   secs(20),   Scheduled,   A::None,              "Vehicle above the pad: start waits"),
    warning_row(&[Scheduled],        G::NeighboursSilent, secs(10),  Scheduled,   A::None,              "No neighbour hears us: start waits"),
    warning_row(&[Scheduled],        G::PlansDiffer,     secs(10),   Scheduled,   A::None,              "Another plan is heard: start waits"),
    info_row(&[Scheduled],           G::GatesOpen,       AT_ONCE,    Streaming,   A::HoldHere,          ""),
    info_row(&[Scheduled],           G::ReserveEnds,     AT_ONCE,    Done,        A::ForgetStart,       "No goal for this vehicle: staying"),
    warning_row(&[Scheduled],        G::StartBarred,     MAX_START_BARRED, Aborted,  A::ForgetStart,    "Start barred for 3 min: others take its part"),
    warning_row(&[Streaming, Engaging], G::ColumnBlocked, MAX_PAD_COLUMN_BLOCKED, Scheduled, A::None,      "Vehicle above the pad: start waits"),
    info_row(&[Streaming],           G::Elapsed,         secs(1),    Engaging,    A::RequestSetpointMode,   ""),
    info_row(&[Engaging],            G::InSetpointMode,        AT_ONCE,    Arming,      A::RequestArming,     "Setpoints followed: arming"),
    warning_row(&[Engaging],         G::Elapsed,         secs(5),    Aborted,     A::ForgetStart,       "Setpoint mode refused: mission aborted"),
    info_row(&[Arming],              G::Armed,           AT_ONCE,    TakeOff,     A::RequestTakeOff,    "Taking off"),
    warning_row(&[Arming],           G::ArmingHeld,      MAX_PAD_COLUMN_BLOCKED, Scheduled, A::None,          "Vehicle above the pad: start waits"),
    warning_row(&[Arming],           G::ArmedUnseen,     AT_ONCE,    CancelStart, A::CancelStart,       "Disarmed by someone else: start cancelled"),
    warning_row(&[Arming],           G::ArmingUnanswered, AT_ONCE,   CancelStart, A::CancelStart,       "Arming not answered: start cancelled"),
    warning_row(&[Arming],           G::Elapsed,         secs(20),   CancelStart, A::CancelStart,       "Arming refused: mission aborted"),
    warning_row(&[CancelStart],      G::InAir,           AT_ONCE,    Land,        A::RequestLandMode,   "Lifted off all the same: landing"),
    info_row(&[CancelStart],         G::StaysDisarmedStarted, ARMED_BIT_TIMEOUT, Scheduled, A::None,    ""),
    info_row(&[CancelStart],         G::StaysDisarmed,   ARMED_BIT_TIMEOUT, Aborted, A::ForgetStart,    "Start is cancelled"),
    warning_row(&[CancelStart],      G::StaysArmed,      secs(5),    Land,        A::RequestLandMode,   "Still armed on the pad: landing"),
    info_row(&[TakeOff],             G::LiftedOff,       AT_ONCE,    Climb,       A::BeginClimb,        ""),
    warning_row(&[TakeOff],          G::Elapsed,         secs(12),   Land,        A::RequestLandMode,   "Take-off takes too long: landing"),
    info_row(&[Climb],               G::ClimbDone,       AT_ONCE,    Follow,      A::FollowPath,        "Following the path"),
    warning_row(&[Climb],            G::Elapsed,         secs(60),   Land,        A::RequestLandMode,   "Climb takes too long: landing"),
    warning_row(&[Follow, Blocked],  G::YieldedInCoverage, secs(60),  Blocked,     A::TurnHome,          "Yielded for 60 s: planning the way home"),
    warning_row(&[Follow, Blocked],  G::HinderedInCoverage, secs(90), Blocked,     A::TurnHome,          "Vehicle on the path: planning the way home"),
    warning_row(&[Follow, Blocked],  G::Yielded,         secs(60),   Stopping,    A::BrakeOnPath,       "Yielded for 60 s: landing"),
    warning_row(&[Follow, Blocked],  G::Hindered,        secs(90),   Stopping,    A::BrakeOnPath,       "Vehicle on the path for 90 s: landing"),
    warning_row(&[Follow],           G::PathBarred,      secs(5),    Land,        A::RequestLandMode,   "No free way to the path: landing"),
    info_row(&[Follow],              G::BackAtStart,     AT_ONCE,    Land,        A::RequestLandMode,   "Back at the start: landing"),
    info_row(&[Follow],              G::PathDone,        AT_ONCE,    Land,        A::RequestLandMode,   "At the goal: landing"),
    info_row(&[Follow, Blocked],     G::HoldsToDivide,   AT_ONCE,    Dividing,    A::BrakeOnPath,       "Area is divided again: waits"),
    info_row(&[Follow],              G::DetourFlown,     AT_ONCE,    Dividing,    A::BrakeOnPath,       ""),
    info_row(&[Dividing],            G::OwnPlanReady,    AT_ONCE,    Follow,      A::FlyDivision,       "Flown around: on its path again"),
    warning_row(&[Dividing],         G::OwnPlanLost,     AT_ONCE,    Blocked,     A::TurnHome,          "Path not found again: planning the way home"),
    info_row(&[Dividing],            G::DivisionReady,   AT_ONCE,    Follow,      A::FlyDivision,       "Area divided again: flying on"),
    info_row(&[Dividing],            G::NothingToDivide, AT_ONCE,    Follow,      A::FollowPath,        "Nothing to divide: flying on"),
    warning_row(&[Dividing],         G::NotDivided,      secs(300),  Stopping,    A::BrakeOnPath,       "No division for 5 min: landing"),
    info_row(&[Climb],               G::PausedBeforeLiftOff, AT_ONCE, CancelStart, A::RequestDisarming, "Paused on the pad"),
    // PX4 disarms after 10 s on the ground.
    warning_row(&[Climb],            G::BarredBeforeLiftOff, secs(4), CancelStart, A::RequestDisarming, "Vehicle above the pad: start waits"),
    info_row(&[Climb, Follow, SwarmLinkLost, Blocked, Replanning, Dividing], G::PauseCommanded, AT_ONCE, Paused, A::BrakeOnPath, "Paused"),
    warning_row(&[Follow, Blocked, Dividing], G::NeighboursSilent, secs(1), SwarmLinkLost, A::BrakeOnPath,      "Neighbours silent: stopping"),
    // Neighbours assume after a while that an unheard vehicle is down: no state keeps it up longer.
    warning_row(&[Paused, AutopilotSilent], G::NeighboursSilent, secs(20), Land,  A::RequestLandMode,   "Neighbours silent while it stands: landing"),
    warning_row(&[TakeOff, Climb],   G::LeaseLost,       secs(20),   Land,        A::RequestLandMode,   "Neighbours silent in the climb: landing"),
    warning_row(&[Follow],           G::PadTaken,        secs(20),   Replanning,  A::RequestLanding,    "No room to land: seeking a place aside"),
    warning_row(&[Follow],           G::WayBackBarred,   AT_ONCE,    Replanning,  A::RequestLanding,    "Obstacle on the way back: seeking a place"),
    info_row(&[Follow],              G::LandingPlaceReached, AT_ONCE, Land,        A::RequestLandMode,   "Landing aside"),
    warning_row(&[Follow],           G::PathBlocked,     AT_ONCE,    Blocked,     A::BrakeOnPath,       "Path blocked: waiting until all others stand"),
    warning_row(&[Follow, Blocked],  G::Unfollowed,      MAX_UNFOLLOWED, Land,    A::RequestLandMode,   "Setpoint not followed: landing"),
    warning_row(&[Follow],           G::StalledInCoverage, secs(600), Blocked,     A::TurnHome,          "No progress for 10 min: planning the way home"),
    warning_row(&[Follow],           G::Stalled,         secs(600),  Land,        A::RequestLandMode,   "No progress for 10 min: landing"),
    info_row(&[Blocked],             G::PathClear,       AT_ONCE,    Follow,      A::FollowPath,        "Path clear again"),
    info_row(&[Blocked],             G::StandsToReturn,  AT_ONCE,    Replanning,  A::RequestPathHome,   ""),
    warning_row(&[Blocked],          G::NoWayHome,       secs(20),   Follow,      A::TurnBack,          "No way home: flying back as it came"),
    info_row(&[Blocked],             G::MayDetourInCoverage, secs(5),    Replanning,  A::RequestDetourBackToPath, ""),
    warning_row(&[Blocked],          G::BlockedInCoverage, secs(120), Blocked,     A::TurnHome,          "Path blocked for 2 min: planning the way home"),
    warning_row(&[Blocked],          G::NoWayAround,     AT_ONCE,    Land,        A::RequestLandMode,   "No way around: landing"),
    warning_row(&[Blocked],          G::NoWayOn,         AT_ONCE,    Follow,      A::TurnBack,          "No way around, no room below: flying back"),
    warning_row(&[Blocked],          G::Stalled,         secs(300),  Land,        A::RequestLandMode,   "Path blocked for 5 min: landing"),
    warning_row(&[Follow, Blocked, Dividing], G::BelowLandingVehicle, secs(1),    Replanning,  A::RequestDetourAside, "Under one that lands: planning aside"),
    info_row(&[Blocked],             G::OurTurn,         AT_ONCE,    Replanning,  A::RequestDetour,     "All others stand: planning around"),
    info_row(&[Replanning],          G::WayHomeReady,    AT_ONCE,    Follow,      A::FlyDetour,         "Flying home"),
    info_row(&[Replanning],          G::DetourReady,     AT_ONCE,    Follow,      A::FlyDetour,         "Flying around"),
    warning_row(&[Replanning],       G::NoPlaceAside,    secs(5),    LandingHeld, A::HoldLanding,          "No place aside either: landing waits"),
    warning_row(&[Replanning],       G::DetourFailed,    AT_ONCE,    Blocked,     A::None,              "No way around yet"),
    warning_row(&[Replanning],       G::Elapsed,         secs(5),    Blocked,     A::NoteDetourFailure, "The way around is late"),
    resume_row(&[Paused],            G::ResumeCommanded, AT_ONCE,    A::Rejoin,                         "Resumed"),
    warning_row(&[Paused],           G::Elapsed,         secs(600),  Land,        A::RequestLandMode,   "Paused for 10 min: landing"),
    info_row(&[SwarmLinkLost],               G::NeighbourHeard,  AT_ONCE,    Follow,      A::FollowPath,        "Neighbours heard again"),
    info_row(&[SwarmLinkLost],               G::MayFlyUnheard,   AT_ONCE,    Follow,      A::FollowPath,        "Gates open: flying on unheard"),
    warning_row(&[SwarmLinkLost],            G::OutOfRange,      secs(16),   Land,        A::RequestLandMode,   "Still out of range: landing"),
    warning_row(&[SwarmLinkLost],            G::Elapsed,         secs(20),   Land,        A::RequestLandMode,   "Neighbours still silent: landing"),
    info_row(&[AutopilotSilent],     G::AutopilotHeard,  AT_ONCE,    PositionLost, A::BrakeOnPath,      "Autopilot heard again"),
    warning_row(&[AutopilotSilent],  G::Elapsed,         secs(60),   Land,        A::RequestLandMode,   "Autopilot still silent: landing"),
    resume_row(&[PositionLost],      G::BackOnPath,      AT_ONCE,    A::Rejoin,                         "Position known again"),
    warning_row(&[PositionLost],     G::BackOffPath,     AT_ONCE,    Land,        A::RequestLandMode,   "Position is elsewhere: landing"),
    warning_row(&[PositionLost],     G::Elapsed,         secs(3),    Land,        A::RequestLandMode,   "Position still lost: landing"),
    info_row(&[Land, Disarm],        G::DisarmedAtGoal,  AT_ONCE,    Done,        A::ForgetStart,       "Landed"),
    warning_row(&[Land, Disarm],     G::Disarmed,        AT_ONCE,    Aborted,     A::ForgetStart,       "Landed short of the goal: mission over"),
    warning_row(&[Land],             G::LandingBlocked,  AT_ONCE,    LandingHeld, A::HoldLanding,          "Vehicle below: landing stopped"),
    info_row(&[LandingHeld],         G::LandingClear,    secs(1),    Land,        A::RequestLandMode,   "Clear below: landing"),
    warning_row(&[LandingHeld],      G::BatteryCritical, AT_ONCE,    Land,        A::RequestLandMode,   "Battery critical: landing"),
    warning_row(&[LandingHeld],      G::NoRoomToLand,    secs(20),   Follow,      A::TurnBack,          "No room to land: flying back to the start"),
    warning_row(&[LandingHeld],      G::NoRoomHere,      secs(20),   Replanning,  A::RequestLanding,    "No room to land: seeking a place aside"),
    warning_row(&[LandingHeld],      G::Elapsed,         secs(25),   LandingHeld, A::HoldLanding,          "Vehicle still below: landing waits"),
    info_row(&[Land],                G::OnGround,        AT_ONCE,    Disarm,      A::RequestDisarming,  ""),
    warning_row(&[Land],             G::Elapsed,         secs(120),  Land,        A::RequestLandMode,   "Landing takes long"),
    warning_row(&[Disarm],           G::InAir,           AT_ONCE,    Land,        A::RequestLandMode,   "Still in the air: landing"),
    info_row(&[Disarm],              G::LandingModeLeft, AT_ONCE,    Land,        A::RequestLandMode,   ""),
    warning_row(&[Disarm],           G::Elapsed,         secs(30),   Aborted,     A::ForgetStart,       "On the ground, still armed"),
    // A pilot or a failsafe flies the vehicle, or has given it back; a mission that is over.
    warning_row(&[PilotControl, PilotReturned], G::Disarmed, AT_ONCE, Aborted,    A::ForgetStart,       "Pilot landed: mission over"),
    warning_row(&[PilotControl, PilotReturned], G::FailsafeActs, AT_ONCE, Failsafe, A::None,            "Autopilot failsafe: setpoints stopped"),
    info_row(&[PilotControl],        G::InSetpointMode,        AT_ONCE,    PilotReturned, A::HoldHere,        "Pilot gives back: holds, waits for resume"),
    warning_row(&[PilotReturned],    G::ModeTaken,       AT_ONCE,    PilotControl, A::None,             "Pilot has control: mission stopped"),
    resume_row(&[PilotReturned],     G::ResumedOnPath,   AT_ONCE,    A::Rejoin,                         "Resumed after the pilot"),
    warning_row(&[PilotReturned],    G::ResumedOffPath,  AT_ONCE,    Land,        A::RequestLandMode,   "Too far from the path: landing"),
    warning_row(&[PilotControl],     G::Elapsed,         secs(900),  PilotControl, A::None,             "Pilot still has control"),
    warning_row(&[PilotReturned],    G::Elapsed,         secs(900),  PilotReturned, A::None,            "Still waits for resume"),
    warning_row(&[Failsafe],         G::Disarmed,        AT_ONCE,    Aborted,     A::ForgetStart,       "Landed after failsafe: mission over"),
    warning_row(&[Failsafe],         G::Elapsed,         secs(300),  Failsafe,    A::None,              "Autopilot failsafe still acts"),
    warning_row(&[Aborted, Done],    G::Unattended,      AT_ONCE,    Land,        A::RequestLandMode,   "Still in the air: landing"),
    info_row(&[Aborted],             G::StartAgain,      AT_ONCE,    WaitPosition, A::ForgetStart,      "Planning again: start again when ready"),
    info_row(&[Done],                G::StartInCoverage,  AT_ONCE,    WaitPosition, A::ForgetStart,      "Planning again: start again when ready"),
];
