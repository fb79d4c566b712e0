//! What the rows of the table ask of a snapshot.

use super::inputs::GuardInputs;
use crate::time::Duration;

/// Age up to which a position is known.
pub(crate) const MAX_POSITION_AGE: Duration = Duration::from_millis(500);

/// Condition of a row. Every guard is a field, or a comparison of fields, of [`GuardInputs`].
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
    /// No plan will come.
    PlanFailed,
    /// No plan will come, for want of the mission's roadmap.
    RoadmapBad,
    /// MISSION_START was commanded, there is a goal, and the estimate's bound fits into the margin.
    StartCommanded,
    /// MISSION_START was commanded.
    StartAgain,
    /// MISSION_START in a coverage mission.
    StartOverField,
    /// MISSION_START, and no goal is left for this vehicle.
    StartWithoutGoal,
    /// MISSION_START, but not at the start point.
    StartElsewhere,
    /// MISSION_START, but the motors are armed.
    StartArmed,
    /// MISSION_START, but the battery charge is below the configured limit.
    StartBatteryLow,
    /// MISSION_START, but outside the configured volume.
    StartOutside,
    /// A fresh position, away from the start point.
    AwayFromStart,
    /// Battery charge below the configured limit.
    ChargeLow,
    /// Outside the configured volume.
    Outside,
    /// MISSION_START, and for the limit, in which it may first be reported, the estimate's bound is
    /// worse than the margin leaves.
    StartVague,
    /// The estimate's bound has been worse than the margin leaves at a crawl for the limit.
    EstimateVague,
    /// The EKF origin moved while armed.
    OriginMoved,
    /// The schedule's take-off is due, and the neighbours leave room.
    GatesOpen,
    /// The state has lasted as long as the limit.
    Elapsed,
    /// The mode is the one that follows setpoints: Offboard (PX4) or Guided (ArduCopter).
    Offboard,
    /// The mode is neither the one before nor the one we asked for, and the autopilot reports no
    /// failsafe.
    ModeTaken,
    /// The mode is not ours, and the autopilot reports `MAV_STATE_CRITICAL`.
    FailsafeActs,
    /// Motors on.
    Armed,
    /// Motors off.
    Disarmed,
    /// Motors off, at the goal.
    DisarmedAtGoal,
    /// Motors on, and the state has lasted as long as the limit.
    StaysArmed,
    /// Motors off, the autopilot is heard, and the state has lasted as long as the limit.
    StaysDisarmed,
    /// As [`Guard::StaysDisarmed`], and the start is only paused.
    StaysDisarmedPaused,
    /// Arming was accepted, but the armed bit did not come.
    ArmedUnseen,
    /// As [`Guard::ColumnBlocked`], and arming was not requested yet.
    ArmingHeld,
    /// Arming was requested and not answered.
    ArmingUnanswered,
    /// Motors on, and off the ground or moving up or down.
    InAir,
    /// In the air, in Offboard or Guided that this companion entered, without setpoints.
    Unattended,
    /// Disarming was refused, and no mode lands the vehicle.
    DisarmRefused,
    /// In the air, or of an autopilot that needs no command to take off.
    LiftedOff,
    /// At the altitude of the start point.
    ClimbDone,
    /// At the end of the path, and the neighbours leave room to land.
    PathDone,
    /// No progress along the path for the limit.
    Stalled,
    /// For the limit the vehicle has not come to its setpoint: something holds it, or carries it
    /// away.
    Unfollowed,
    /// DO_PAUSE_CONTINUE 0.
    PauseCommanded,
    /// DO_PAUSE_CONTINUE 1.
    ResumeCommanded,
    /// A fresh position, and the way back to the path is free.
    BackOnPath,
    /// A fresh position, but elsewhere than where it stopped on the path.
    BackOffPath,
    /// Offboard or Guided, DO_PAUSE_CONTINUE 1, and the way back to the interrupted state is free.
    ResumedOnPath,
    /// Offboard or Guided, DO_PAUSE_CONTINUE 1, but too far from the path.
    ResumedOffPath,
    /// DO_PAUSE_CONTINUE 0, and the state has lasted as long as the limit.
    PausedOnPad,
    /// NAV_LAND.
    LandCommanded,
    /// NAV_LAND, motors on, in Offboard or Guided.
    LandUnattended,
    /// NAV_RETURN_TO_LAUNCH.
    ReturnCommanded,
    /// NAV_RETURN_TO_LAUNCH, and the climb is not done.
    ReturnInClimb,
    /// NAV_RETURN_TO_LAUNCH in a coverage mission, where the path home is planned.
    ReturnOverField,
    /// In a coverage mission the path has been blocked for the limit, and the path home can be
    /// planned.
    BlockedOverField,
    /// As [`Guard::BlockedOverField`], and the vehicle may fly around what blocks it and back to
    /// its path.
    AroundOverField,
    /// The vehicle stands where its detour comes back to its path.
    AroundFlown,
    /// The vehicle stands where its detour comes back to its path, and its own plan has come.
    OwnPlanReady,
    /// The vehicle stands where its detour comes back to its path, and no own plan will come.
    OwnPlanLost,
    /// As [`Guard::BlockedOverField`], but the safety filter has made the vehicle yield for the
    /// limit.
    YieldedOverField,
    /// As [`Guard::BlockedOverField`], but the safety filter has hindered the vehicle for the
    /// limit.
    HinderedOverField,
    /// As [`Guard::Stalled`] where the path home can be planned.
    StalledOverField,
    /// The vehicle is to fly home, and stands.
    StandsToReturn,
    /// The way home has come.
    WayHomeReady,
    /// No way home was found for the limit, and the vehicle can fly back as it came.
    NoWayHome,
    /// The safety filter finds another vehicle in the column to the ground.
    LandingBlocked,
    /// No vehicle was in the column for the limit.
    LandingClear,
    /// The column was occupied for the limit (5 s by a vehicle that rests), and the path leads to
    /// the pad.
    NoRoomToLand,
    /// Before the take-off: the column above has not been free for the limit.
    ColumnBlocked,
    /// Over an area, on the pad: another vehicle has been above it, or something on the path, for
    /// the limit, and others fly on.
    StartBarred,
    /// The safety filter has made this vehicle yield for the limit, and it does not seek its path
    /// home.
    Yielded,
    /// The safety filter has kept this vehicle from continuing for the limit, and it does not seek
    /// its path home.
    Hindered,
    /// As [`Guard::NoRoomToLand`], but the path does not lead back: a place aside may yet be
    /// sought.
    NoRoomHere,
    /// The way back to its pad, or the end of a path over an area, has been barred for the limit by
    /// a vehicle that rests, or the descent of one that flies back by any.
    PadTaken,
    /// No place aside to land at exists, or the answer has not come within the limit.
    NoPlaceAside,
    /// The vehicle stands at the place aside where it is to land.
    AsideReached,
    /// Battery charge below half of the configured limit.
    BatteryCritical,
    /// Battery charge below the configured limit, no neighbour below, and no place aside to land at
    /// sought or flown to.
    BatteryLow,
    /// Outside the configured volume, and no neighbour below.
    OutsideGeofence,
    /// None of the neighbours that fly was heard for the limit.
    NeighboursSilent,
    /// The vehicle's next gate is open, or none is left.
    WayFree,
    /// All others are out of radio range, and the state has lasted for the limit.
    OutOfRange,
    /// A neighbour was heard within the last second.
    NeighbourHeard,
    /// On the ground after a flight or in the mode that lands, and at rest.
    OnGround,
    /// A vehicle that left the plan, or an obstacle, blocks the path, or this vehicle left the plan
    /// itself.
    PathBlocked,
    /// No keep-out zone blocks the path any more.
    PathClear,
    /// The path is blocked, all others stand, and it is this vehicle's turn.
    OurTurn,
    /// The detour has come.
    DetourReady,
    /// No detour exists.
    DetourFailed,
    /// Several searches found no detour, and no neighbour is below.
    NoWayAround,
    /// Several searches found no detour, a neighbour lies below, and the path leads back to the
    /// pad.
    NoWayOn,
    /// For the limit the vehicle waited below one that lands without looking, and its path led
    /// nowhere better.
    Underneath,
    /// Standing still.
    Standing,
    /// Others have divided the share of this vehicle, or count it as lost.
    Excluded,
    /// Others on the ground know of more photographed waypoints than the plan leaves out.
    MoreIsDone,
    /// A vehicle that follows another plan of this mission is heard.
    PlansDiffer,
    /// The vehicle stands as far along its path as it promised to fly before the division.
    HoldsToDivide,
    /// The division counts, and its part of that has come.
    DivisionReady,
    /// No division is under way any more.
    NothingToDivide,
}

/// Age up to which HEARTBEAT counts as heard: it comes at 1 Hz, and one late is not yet silence.
pub(super) const MAX_HEARTBEAT_AGE: Duration = Duration::from_millis(1500);

impl Guard {
    /// Whether the condition is met and has been met for `limit`.
    pub fn is_met(self, i: &GuardInputs, limit: Duration) -> bool {
        match self {
            Self::AutopilotHeard => i.heartbeat_age < MAX_HEARTBEAT_AGE,
            Self::NoHeartbeat => i.heartbeat_age > limit,
            Self::PositionKnown => i.position_age < MAX_POSITION_AGE,
            Self::NoPosition => i.position_age > limit,
            Self::PositionJumped => i.jumped,
            Self::FoundFlying => i.airborne,
            Self::PlanReady => i.plan_ready,
            Self::PlanFailed => i.plan_failed,
            Self::RoadmapBad => i.roadmap_bad,
            Self::StartCommanded => i.start && !i.imprecise && i.has_goal,
            Self::StartAgain => i.start,
            Self::AroundOverField => i.blocked && i.may_fly_beside && i.blocked_for >= limit,
            Self::AroundFlown => i.around_flown,
            Self::OwnPlanReady => i.own_plan_ready,
            Self::OwnPlanLost => i.own_plan_lost,
            Self::StartOverField => i.start && i.area,
            Self::StartWithoutGoal => i.start && !i.has_goal && i.plans_as_others,
            Self::StartElsewhere => i.start && !i.at_start,
            Self::StartArmed => i.start && i.armed,
            Self::StartBatteryLow => i.start && i.battery_low,
            Self::StartOutside => i.start && i.outside,
            Self::AwayFromStart => i.position_age < MAX_POSITION_AGE && !i.at_start,
            Self::ChargeLow => i.battery_low,
            Self::Outside => i.outside,
            Self::StartVague => i.start && i.imprecise && i.in_state >= limit,
            Self::EstimateVague => i.imprecise_for > limit,
            Self::OriginMoved => i.origin_moved,
            Self::GatesOpen => i.gates_open,
            Self::Elapsed => i.in_state >= limit,
            Self::Offboard => i.offboard,
            Self::ModeTaken => i.mode_foreign && !i.critical,
            Self::FailsafeActs => i.mode_foreign && i.critical,
            Self::Armed => i.armed,
            Self::Disarmed => !i.armed,
            Self::DisarmedAtGoal => !i.armed && i.at_goal,
            Self::StaysArmed => i.armed && i.in_state >= limit,
            Self::StaysDisarmed => {
                !i.armed && i.in_state >= limit && i.heartbeat_age < MAX_HEARTBEAT_AGE
            }
            Self::StaysDisarmedPaused => {
                !i.armed
                    && i.in_state >= limit
                    && i.heartbeat_age < MAX_HEARTBEAT_AGE
                    && i.start
                    && i.pause
            }
            Self::ArmedUnseen => i.armed_unseen,
            Self::ArmingHeld => {
                i.arming_unrequested && i.column_blocked_for.min(i.in_state) >= limit
            }
            Self::ArmingUnanswered => i.arming_unanswered,
            Self::InAir => i.armed && (i.airborne || i.vertical),
            Self::Unattended => {
                i.airborne && i.offboard && i.own_mode && i.heartbeat_age < MAX_HEARTBEAT_AGE
            }
            Self::DisarmRefused => i.armed && i.disarm_refused && !i.landing,
            Self::LiftedOff => i.lifted_off,
            Self::ClimbDone => i.climb_done,
            Self::PathDone => i.path_done,
            Self::Stalled => i.stalled_for >= limit,
            Self::Unfollowed => i.unfollowed_for >= limit,
            Self::PauseCommanded => i.pause,
            Self::ResumeCommanded => i.resume,
            Self::BackOnPath => i.position_age < MAX_POSITION_AGE && i.near_path,
            Self::BackOffPath => i.position_age < MAX_POSITION_AGE && !i.near_path,
            Self::ResumedOnPath => i.offboard && i.resume && i.near_path,
            Self::ResumedOffPath => i.offboard && i.resume && !i.near_path,
            Self::PausedOnPad => i.pause && i.in_state >= limit,
            Self::LandCommanded => i.land,
            Self::LandUnattended => i.land && i.armed && i.offboard,
            Self::ReturnCommanded => i.turn_back,
            Self::ReturnInClimb => i.turn_back && i.in_climb,
            Self::ReturnOverField => i.turn_back && i.over_field,
            Self::BlockedOverField => i.blocked && i.blocked_for >= limit && i.may_turn_home(),
            Self::YieldedOverField => i.yielded_for >= limit && i.may_turn_home() && !i.descends,
            Self::HinderedOverField => i.hindered_for >= limit && i.may_turn_home() && !i.descends,
            Self::StalledOverField => i.stalled_for >= limit && i.may_turn_home(),
            Self::StandsToReturn => i.stands_to_return,
            Self::WayHomeReady => i.detour_ready && i.homeward,
            Self::NoWayHome => {
                i.seeking_home_for.is_some_and(|sought| sought >= limit) && i.can_turn_back
            }
            Self::LandingBlocked => i.column_blocked_for > Duration::default() && !i.must_land,
            Self::NoRoomToLand => i.is_landing_blocked_for(limit) && i.offboard && i.can_turn_back,
            Self::NoRoomHere => i.is_landing_blocked_for(limit) && i.offboard && i.can_land_aside,
            Self::PadTaken => i.pad_blocked_for >= limit && i.can_land_aside,
            Self::NoPlaceAside => i.seeks_landing && (i.plan_failed || i.in_state >= limit),
            Self::AsideReached => i.aside_reached,
            Self::LandingClear => i.column_clear_for >= limit,
            Self::ColumnBlocked => i.column_blocked_for.min(i.in_state) >= limit,
            Self::StartBarred => i.start_barred_for >= limit && i.others_fly,
            Self::Yielded => i.yielded_for >= limit && i.seeking_home_for.is_none(),
            Self::Hindered => i.hindered_for >= limit && i.seeking_home_for.is_none(),
            Self::BatteryCritical => i.battery_critical,
            Self::BatteryLow => i.battery_low && i.room_below && !i.lands_aside,
            Self::OutsideGeofence => i.outside && i.room_below,
            Self::NeighboursSilent => i.neighbour_age > limit,
            Self::WayFree => i.way_free,
            Self::OutOfRange => i.out_of_range && i.in_state >= limit,
            Self::NeighbourHeard => i.neighbour_heard,
            Self::OnGround => i.on_ground && !i.vertical && (i.has_flown || i.landing),
            Self::PathBlocked => i.blocked,
            Self::PathClear => !i.blocked,
            Self::OurTurn => i.our_turn,
            Self::DetourReady => i.detour_ready,
            Self::DetourFailed => i.plan_failed,
            Self::NoWayAround => i.no_way_around && i.room_below,
            Self::NoWayOn => i.no_way_around && i.can_turn_back,
            Self::Underneath => i.time_below_landing > limit,
            Self::Standing => i.standing,
            Self::Excluded => i.excluded,
            Self::MoreIsDone => i.more_is_done,
            Self::PlansDiffer => i.plans_differ && i.in_state >= limit,
            Self::HoldsToDivide => i.holds_to_divide,
            Self::DivisionReady => i.division_ready,
            Self::NothingToDivide => i.undivided,
        }
    }
}
