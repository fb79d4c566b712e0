//! The guards: conditions of the rows of the mission table.

use super::inputs::GuardInputs;
use crate::autopilot::telemetry::{MAX_HEARTBEAT_AGE, MAX_POSITION_AGE};
use crate::margins::MAX_HEIGHT_ERROR_ON_GROUND_M;
use crate::time::Duration;

/// Time without progress after which a vehicle at the geofence begins to land even if a neighbour
/// is below: in `Land` the landing is held then, and the vehicle flies back.
const MAX_WAIT_AT_FENCE: Duration = Duration::from_secs(30);

/// Condition of a row: a field of [`GuardInputs`], or a comparison of fields. "Limit" is the
/// row's [`limit`](super::TransitionRow::limit). "MISSION_START" and other commands mean that the
/// command is pending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// HEARTBEAT is younger than 1.5 s.
    AutopilotHeard,
    /// HEARTBEAT is older than the limit.
    NoHeartbeat,
    /// The position is younger than 0.5 s.
    PositionKnown,
    /// The position is older than the limit.
    NoPosition,
    /// For the limit the state has lasted and HEARTBEATs have come, but no position.
    StillNoPosition,
    /// The position jumped, or the EKF origin changed, within the last second.
    PositionJumped,
    /// Motors armed, and the landing detector reports flight.
    FoundFlying,
    /// The shell has returned the vehicle's plan.
    PlanReady,
    /// The shell has answered that there is no plan.
    PlanFailed,
    /// The shell has no plan, since the mission, or the roadmap or field of heights that it needs,
    /// is missing, damaged or not the mission's.
    RoadmapBad,
    /// MISSION_START, the plan leaves the pad, and the estimate's error bound fits into the margin
    /// at cruise speed.
    StartCommanded,
    /// MISSION_START.
    StartAgain,
    /// MISSION_START in a coverage mission.
    StartInCoverage,
    /// MISSION_START, but the plan does not leave the pad, and no vehicle will leave a part to this
    /// one; in a coverage mission all others heard have the same plan.
    StartWithoutGoal,
    /// MISSION_START in a coverage mission, but the plan does not leave the pad: others may leave a
    /// part to this vehicle. All others heard have the same plan.
    StartInReserve,
    /// MISSION_START, but the vehicle is not at its pad.
    StartElsewhere,
    /// MISSION_START, but the motors are already armed.
    StartArmed,
    /// MISSION_START, but the battery's charge is below the configured limit.
    StartBatteryLow,
    /// MISSION_START, but the vehicle is outside the geofence.
    StartOutside,
    /// The position is younger than 0.5 s, and not at the vehicle's pad.
    AwayFromPad,
    /// The battery's charge is below the configured limit.
    BatteryLowOnPad,
    /// The vehicle is outside the geofence, or stands at it.
    OutsideGeofenceOnPad,
    /// MISSION_START, but the estimate's error bound does not fit into the margin at cruise speed,
    /// and the state has lasted for the limit: time for the first report of the accuracy.
    StartImprecise,
    /// The estimate's error bound has not fitted into the margin, even at crawl speed, for longer
    /// than the limit.
    EstimateImprecise,
    /// The EKF origin moved while the motors were armed.
    OriginMoved,
    /// The vehicle may take off ([`GuardInputs::may_take_off`]): departure is due, and gates,
    /// safety filter, battery and radio allow the take-off.
    GatesOpen,
    /// The state has lasted for the limit.
    Elapsed,
    /// The autopilot's mode is the one that follows setpoints: Offboard (PX4) or Guided
    /// (ArduCopter).
    InSetpointMode,
    /// The pilot changed the autopilot's mode: it is foreign ([`GuardInputs::mode_foreign`]), and
    /// the autopilot reports no failsafe.
    ModeTaken,
    /// The autopilot's mode is foreign ([`GuardInputs::mode_foreign`]), and HEARTBEAT reports
    /// `MAV_STATE_CRITICAL` or worse.
    FailsafeActs,
    /// As [`Guard::ModeTaken`], with the motors armed.
    ModeTakenArmed,
    /// As [`Guard::FailsafeActs`], with the motors armed.
    FailsafeActsArmed,
    /// The motors are armed.
    Armed,
    /// The motors are disarmed.
    Disarmed,
    /// The motors are disarmed, and the vehicle is at its goal.
    DisarmedAtGoal,
    /// The motors are armed, and the state has lasted for the limit.
    StaysArmed,
    /// The motors are disarmed, HEARTBEAT is younger than 1.5 s, and the state has lasted for the
    /// limit.
    StaysDisarmed,
    /// As [`Guard::StaysDisarmed`], while MISSION_START is pending: the start waits, it is not
    /// cancelled.
    StaysDisarmedStarted,
    /// The autopilot accepted arming, but HEARTBEAT has not shown the armed bit for 2.5 s.
    ArmedUnseen,
    /// As [`Guard::ColumnBlocked`], and arming was not requested yet.
    ArmingHeld,
    /// Arming has failed for want of an answer: no COMMAND_ACK came within 2.5 s of the last
    /// request, and two requests were sent or HEARTBEAT was missing meanwhile.
    ArmingUnanswered,
    /// The motors are armed, and the landing detector reports flight, or the vehicle moves up or
    /// down, or by its estimate it is more than 2 m above the plan's ground.
    InAir,
    /// As [`Guard::InAir`], while the autopilot is still in the Offboard or Guided that the
    /// companion entered, and HEARTBEAT is younger than 1.5 s. Its row is of states that send no
    /// setpoints.
    Unattended,
    /// The autopilot is not in its landing mode.
    LandingModeLeft,
    /// The landing detector reports flight; always met for an autopilot that takes off without a
    /// command.
    LiftedOff,
    /// The vehicle has climbed to the start of its path.
    ClimbDone,
    /// The vehicle has flown back to its start, and may land there.
    BackAtStart,
    /// The vehicle is at the end of its path and may land there.
    PathDone,
    /// The vehicle has made no progress along its path for the limit
    /// ([`GuardInputs::stalled_for`]).
    Stalled,
    /// For the limit the vehicle has not reached its setpoint, nor has the setpoint moved on:
    /// something holds the vehicle, or carries it away.
    Unfollowed,
    /// The vehicle is off its path, no way to it is known to be free of walls, and the state has
    /// lasted for the limit.
    PathBarred,
    /// DO_PAUSE_CONTINUE 0 (pause), but not in a climb that has only begun.
    PauseCommanded,
    /// DO_PAUSE_CONTINUE 1 (resume).
    ResumeCommanded,
    /// The position is younger than 0.5 s, and near enough to the path to fly back to it.
    BackOnPath,
    /// The position is younger than 0.5 s, and too far from the path to fly back to it.
    BackOffPath,
    /// Offboard or Guided, DO_PAUSE_CONTINUE 1, and the vehicle is near enough to its path to fly
    /// back to it.
    ResumedOnPath,
    /// Offboard or Guided, DO_PAUSE_CONTINUE 1, and the vehicle is too far from its path.
    ResumedOffPath,
    /// DO_PAUSE_CONTINUE 0, and the state has lasted for the limit.
    PausedOnPad,
    /// NAV_LAND.
    LandCommanded,
    /// NAV_LAND, motors armed, and Offboard or Guided.
    LandUnattended,
    /// NAV_RETURN_TO_LAUNCH.
    ReturnCommanded,
    /// NAV_RETURN_TO_LAUNCH before the climb is done.
    ReturnInClimb,
    /// NAV_RETURN_TO_LAUNCH in a coverage mission, and a path home may be requested
    /// ([`GuardInputs::may_seek_path_home`]).
    ReturnInCoverage,
    /// In a coverage mission: the path is blocked, was first found blocked here the limit ago or
    /// earlier, and a path home may be requested and is not sought yet.
    BlockedInCoverage,
    /// In a coverage mission: the path has been blocked for the limit, and the vehicle may fly
    /// around the obstacle and back to its path.
    MayDetourInCoverage,
    /// The vehicle stands at the end of its detour, back on its path.
    DetourFlown,
    /// The vehicle is back on its path after a detour, and the rest of its own plan has come.
    OwnPlanReady,
    /// The vehicle is back on its path after a detour, but the rest of its own plan could not be
    /// planned.
    OwnPlanLost,
    /// In a coverage mission, before the last descent: the safety filter has made the vehicle yield
    /// for the limit, and a path home may be requested and is not sought yet.
    YieldedInCoverage,
    /// In a coverage mission, before the last descent: the safety filter has kept the vehicle from
    /// moving on for the limit, and a path home may be requested and is not sought yet.
    HinderedInCoverage,
    /// In a coverage mission: no progress along the path for the limit, and a path home may be
    /// requested and is not sought yet.
    StalledInCoverage,
    /// The vehicle seeks a path home, stands, and may request it from the shell.
    StandsToReturn,
    /// The path home has come.
    WayHomeReady,
    /// No path home was found for the limit, and the vehicle can turn back along the path that it
    /// flew.
    NoWayHome,
    /// Another vehicle is, or may be, in the column below, and nothing forces this vehicle to land.
    LandingBlocked,
    /// The column below has been free of other vehicles for the limit.
    LandingClear,
    /// In Offboard or Guided: the column below has been occupied for the limit (5 s by a vehicle
    /// that is on the ground or lost), and the vehicle can turn back along its path to the pad.
    NoRoomToLand,
    /// Before take-off: the column above the pad has been occupied for the limit.
    ColumnBlocked,
    /// In a coverage mission, on the pad without a part of the area: the vehicle will not get a
    /// part any more.
    ReserveEnds,
    /// In a coverage mission, on the pad: a vehicle above the pad or an obstacle on the path has
    /// barred the start for the limit, and another vehicle that takes part flies.
    StartBarred,
    /// The safety filter has made this vehicle yield for the limit, and the vehicle seeks no path
    /// home.
    Yielded,
    /// The safety filter has kept this vehicle from moving on for the limit, and the vehicle seeks
    /// no path home.
    Hindered,
    /// In Offboard or Guided: the column below has been occupied for the limit (5 s by a vehicle
    /// that is on the ground or lost), and a place aside to land at may be sought.
    NoRoomHere,
    /// For the limit any vehicle has blocked the descent to the pad on the way home, or one that is
    /// on the ground or lost has blocked the way home or the descent at the end of a coverage path.
    /// On the way home of a mission with goals, 5 s of the latter are enough.
    PadTaken,
    /// A reported obstacle lies ahead on the way that the vehicle flies back, or below its end.
    WayBackBarred,
    /// A place aside to land at was sought, but none exists, or the shell has not answered within
    /// the limit.
    NoPlaceAside,
    /// The vehicle stands at the place aside where it is to land.
    LandingPlaceReached,
    /// The battery's charge is below half of the configured limit.
    BatteryCritical,
    /// The battery's charge is below the configured limit, no neighbour is below, and the vehicle
    /// neither seeks nor flies to a place aside to land at.
    BatteryLow,
    /// The vehicle is outside the geofence or stands at it, and either no neighbour is below or the
    /// vehicle has made no progress for 30 s (`MAX_WAIT_AT_FENCE`).
    OutsideGeofence,
    /// For longer than the limit no neighbour that flies was heard, or none reported that it hears
    /// this vehicle. In a coverage mission as [`Guard::LeaseLost`].
    NeighboursSilent,
    /// The vehicle may fly on unheard: all others are out of radio range, and its next gate is open
    /// or none is left.
    MayFlyUnheard,
    /// All others were last heard near the edge of the radio range, and the state has lasted for
    /// the limit.
    OutOfRange,
    /// In the last second a neighbour was heard, and one reported that it hears this vehicle; in a
    /// coverage mission a majority reported that.
    NeighbourHeard,
    /// The landing detector reports ground in the landing mode, the estimated height is less than
    /// 1.5 m above the plan's ground, and the vehicle does not move up or down.
    OnGround,
    /// An obstacle, or a vehicle that left the plan, is on the path ahead, or this vehicle seeks a
    /// path home.
    PathBlocked,
    /// No obstacle or vehicle that left the plan is on the path ahead any more.
    PathClear,
    /// In a mission with goals: the path is blocked, all others stand and wait, and it is this
    /// vehicle's turn to fly a detour.
    OurTurn,
    /// The shell has returned the requested detour.
    DetourReady,
    /// The shell found no detour.
    DetourFailed,
    /// Several searches found no detour, and no neighbour is below: the vehicle can land.
    NoWayAround,
    /// Several searches found no detour, and the vehicle can turn back along its path to the pad.
    NoWayOn,
    /// For longer than the limit the vehicle has waited below one that lands, without a place along
    /// its path to evade to.
    BelowLandingVehicle,
    /// Setpoint and vehicle stand, outside a descent ([`GuardInputs::standing`]).
    Standing,
    /// Others have divided this vehicle's share of the area, or count this vehicle as lost.
    Excluded,
    /// The waypoints that this vehicle's plan is to leave out have changed since the plan was
    /// requested.
    LeftOutSetChanged,
    /// In a coverage mission: the limit has passed since 1 s before the end of the lease.
    LeaseLost,
    /// The state has lasted for the limit without a committed division, and the last lost vehicle
    /// must have been down for a minute.
    NotDivided,
    /// A pause is commanded in a climb that has not left the ground, so that the vehicle can be
    /// disarmed: the landing detector reports the ground and has not reported flight, and the
    /// vehicle has not risen and does not move up or down. Later a report of ground may be false,
    /// and the vehicle would fall when disarmed.
    PausedBeforeLiftOff,
    /// The safety filter has barred for the limit a climb that has not left the ground, as in
    /// [`Guard::PausedBeforeLiftOff`].
    BarredBeforeLiftOff,
    /// A vehicle that follows another plan of this mission has been heard, and the state has lasted
    /// for the limit.
    PlansDiffer,
    /// The vehicle stands at its commitment, as far as it was to fly before the division.
    HoldsToDivide,
    /// The division is committed, and this vehicle's plan after it has come.
    DivisionReady,
    /// No division is under way or outstanding any more, nor the rest of the vehicle's own plan
    /// after a detour.
    NothingToDivide,
}

impl Guard {
    /// Whether the condition is met, and where it has a duration, has been met for `limit`.
    pub fn is_met(self, i: &GuardInputs, limit: Duration) -> bool {
        match self {
            Self::AutopilotHeard => i.heartbeat_age < MAX_HEARTBEAT_AGE,
            Self::NoHeartbeat => i.heartbeat_age > limit,
            Self::PositionKnown => i.position_age < MAX_POSITION_AGE,
            Self::NoPosition => i.position_age > limit,
            Self::StillNoPosition => {
                i.position_age.min(i.time_in_state).min(i.autopilot_heard_for) > limit
                    && i.heartbeat_age < MAX_HEARTBEAT_AGE
            }
            Self::PositionJumped => i.position_jumped,
            Self::FoundFlying => i.airborne,
            Self::PlanReady => i.plan_ready,
            Self::PlanFailed => i.plan_failed,
            Self::RoadmapBad => i.roadmap_unusable,
            Self::StartCommanded => i.start_pending && !i.imprecise_at_cruise && i.plan_leaves_pad,
            Self::StartAgain => i.start_pending,
            Self::MayDetourInCoverage => {
                i.path_blocked && i.may_detour_and_rejoin && i.path_blocked_for >= limit
            }
            Self::DetourFlown => i.stands_at_detour_end,
            Self::OwnPlanReady => i.own_plan_ready,
            Self::OwnPlanLost => i.own_plan_failed,
            Self::StartInCoverage => i.start_pending && i.is_coverage,
            Self::StartWithoutGoal => {
                i.start_pending && !i.plan_leaves_pad && i.shares_plan_with_others && !i.in_reserve
            }
            Self::StartInReserve => i.start_pending && i.in_reserve && i.shares_plan_with_others,
            Self::StartElsewhere => i.start_pending && !i.at_pad,
            Self::StartArmed => i.start_pending && i.armed,
            Self::StartBatteryLow => i.start_pending && i.battery_low,
            Self::StartOutside => i.start_pending && i.outside_geofence,
            Self::AwayFromPad => i.position_age < MAX_POSITION_AGE && !i.at_pad,
            Self::BatteryLowOnPad => i.battery_low,
            Self::OutsideGeofenceOnPad => i.outside_geofence,
            Self::StartImprecise => {
                i.start_pending && i.imprecise_at_cruise && i.time_in_state >= limit
            }
            Self::EstimateImprecise => i.imprecise_at_crawl_for > limit,
            Self::OriginMoved => i.origin_moved,
            Self::GatesOpen => i.may_take_off,
            Self::Elapsed => i.time_in_state >= limit,
            Self::InSetpointMode => i.in_setpoint_mode,
            Self::ModeTaken => i.mode_foreign && !i.autopilot_critical,
            Self::FailsafeActs => i.mode_foreign && i.autopilot_critical,
            Self::ModeTakenArmed => i.armed && i.mode_foreign && !i.autopilot_critical,
            Self::FailsafeActsArmed => i.armed && i.mode_foreign && i.autopilot_critical,
            Self::Armed => i.armed,
            Self::Disarmed => !i.armed,
            Self::DisarmedAtGoal => !i.armed && i.reference_at_goal,
            Self::StaysArmed => i.armed && i.time_in_state >= limit,
            Self::StaysDisarmed => {
                !i.armed && i.time_in_state >= limit && i.heartbeat_age < MAX_HEARTBEAT_AGE
            }
            Self::StaysDisarmedStarted => {
                !i.armed
                    && i.time_in_state >= limit
                    && i.heartbeat_age < MAX_HEARTBEAT_AGE
                    && i.start_pending
            }
            Self::ArmedUnseen => i.armed_bit_overdue,
            Self::ArmingHeld => {
                i.arming_unrequested && i.column_blocked_for.min(i.time_in_state) >= limit
            }
            Self::ArmingUnanswered => i.arming_unanswered,
            Self::InAir => i.is_in_air(),
            Self::Unattended => {
                i.is_in_air()
                    && i.in_setpoint_mode
                    && i.in_own_mode
                    && i.heartbeat_age < MAX_HEARTBEAT_AGE
            }
            Self::LandingModeLeft => !i.in_land_mode,
            Self::LiftedOff => i.take_off_command_done,
            Self::ClimbDone => i.climb_done,
            Self::BackAtStart => i.path_done && i.returns_to_start,
            Self::PathDone => i.path_done,
            Self::Stalled => i.stalled_for >= limit,
            Self::Unfollowed => i.unfollowed_for >= limit,
            Self::PathBarred => i.join_barred && i.time_in_state >= limit,
            Self::PauseCommanded => i.pause_pending && !i.climb_just_begun,
            Self::ResumeCommanded => i.resume_pending,
            Self::BackOnPath => i.position_age < MAX_POSITION_AGE && i.near_path,
            Self::BackOffPath => i.position_age < MAX_POSITION_AGE && !i.near_path,
            Self::ResumedOnPath => i.in_setpoint_mode && i.resume_pending && i.near_path,
            Self::ResumedOffPath => i.in_setpoint_mode && i.resume_pending && !i.near_path,
            Self::PausedOnPad => i.pause_pending && i.time_in_state >= limit,
            Self::LandCommanded => i.land_pending,
            Self::LandUnattended => i.land_pending && i.armed && i.in_setpoint_mode,
            Self::ReturnCommanded => i.return_pending,
            Self::ReturnInClimb => i.return_pending && i.in_climb,
            Self::ReturnInCoverage => i.return_pending && i.may_seek_path_home,
            Self::BlockedInCoverage => {
                i.path_blocked && i.path_blocked_for >= limit && i.may_begin_seeking_home()
            }
            Self::YieldedInCoverage => {
                i.yielded_for >= limit && i.may_begin_seeking_home() && !i.in_last_descent
            }
            Self::HinderedInCoverage => {
                i.hindered_for >= limit && i.may_begin_seeking_home() && !i.in_last_descent
            }
            Self::StalledInCoverage => i.stalled_for >= limit && i.may_begin_seeking_home(),
            Self::StandsToReturn => i.ready_to_request_path_home,
            Self::WayHomeReady => i.detour_ready && i.seeks_or_flies_path_home,
            Self::NoWayHome => {
                i.seeking_home_for.is_some_and(|sought| sought >= limit) && i.can_turn_back
            }
            Self::LandingBlocked => i.column_blocked_for > Duration::default() && !i.must_land,
            Self::NoRoomToLand => {
                i.is_landing_blocked_for(limit) && i.in_setpoint_mode && i.can_turn_back
            }
            Self::NoRoomHere => {
                i.is_landing_blocked_for(limit) && i.in_setpoint_mode && i.may_seek_landing_aside
            }
            Self::WayBackBarred => i.way_back_barred,
            Self::PadTaken => i.is_pad_blocked_for(limit) && i.may_seek_landing_aside,
            Self::NoPlaceAside => {
                i.seeks_landing_aside && (i.plan_failed || i.time_in_state >= limit)
            }
            Self::LandingPlaceReached => i.landing_place_reached,
            Self::LandingClear => i.column_clear_for >= limit,
            Self::ColumnBlocked => i.column_blocked_for.min(i.time_in_state) >= limit,
            Self::ReserveEnds => i.is_coverage && !i.plan_leaves_pad && !i.in_reserve,
            Self::StartBarred => {
                i.start_barred_for >= limit && i.may_leave_part_to_others && i.plan_leaves_pad
            }
            Self::Yielded => i.yielded_for >= limit && i.seeking_home_for.is_none(),
            Self::Hindered => i.hindered_for >= limit && i.seeking_home_for.is_none(),
            Self::BatteryCritical => i.battery_critical,
            Self::BatteryLow => i.battery_low && i.room_below && !i.lands_aside,
            Self::OutsideGeofence => {
                i.outside_geofence && (i.room_below || i.stalled_for > MAX_WAIT_AT_FENCE)
            }
            Self::NeighboursSilent => i.unlinked_for > limit,
            Self::LeaseLost => i.is_coverage && i.unlinked_for > limit,
            Self::NotDivided => i.time_in_state >= limit && i.division_overdue,
            Self::PausedBeforeLiftOff => i.pause_pending && i.is_before_lift_off(),
            Self::BarredBeforeLiftOff => i.hindered_for >= limit && i.is_before_lift_off(),
            Self::MayFlyUnheard => i.may_fly_on_unheard,
            Self::OutOfRange => i.others_out_of_range && i.time_in_state >= limit,
            Self::NeighbourHeard => i.swarm_linked,
            Self::OnGround => {
                i.on_ground
                    && !i.moves_vertically
                    && i.in_land_mode
                    && i.height_if_ground_reported_m < MAX_HEIGHT_ERROR_ON_GROUND_M
            }
            Self::PathBlocked => i.path_blocked,
            Self::PathClear => !i.path_blocked,
            Self::OurTurn => i.our_turn_to_detour,
            Self::DetourReady => i.detour_ready,
            Self::DetourFailed => i.plan_failed,
            Self::NoWayAround => i.detours_given_up && i.room_below,
            Self::NoWayOn => i.detours_given_up && i.can_turn_back,
            Self::BelowLandingVehicle => i.waited_below_landing_for > limit,
            Self::Standing => i.standing,
            Self::Excluded => i.excluded,
            Self::LeftOutSetChanged => i.left_out_set_changed,
            Self::PlansDiffer => i.plans_differ && i.time_in_state >= limit,
            Self::HoldsToDivide => i.holds_to_divide,
            Self::DivisionReady => i.division_plan_ready,
            Self::NothingToDivide => i.division_settled,
        }
    }
}
