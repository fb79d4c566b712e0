//! What the guards of the table are asked of: a snapshot.

use crate::time::Duration;

/// Inputs of the guards: a snapshot of the vehicle, the commands and the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuardInputs {
    /// Time in the state.
    pub in_state: Duration,
    /// Time since the autopilot's last HEARTBEAT.
    pub heartbeat_age: Duration,
    /// Time since the last usable position.
    pub position_age: Duration,
    /// The position jumped lately.
    pub jumped: bool,
    /// Time without progress along the path.
    pub stalled_for: Duration,
    /// Time for which the vehicle has not come to its setpoint, and the setpoint has not gone on.
    pub unfollowed_for: Duration,
    /// Time since its path was first blocked, short of where it has come no further; clear in
    /// between or not.
    pub blocked_for: Duration,
    /// Time in the state without any neighbour heard; zero when all have landed.
    pub neighbour_age: Duration,
    /// Whether its next gate is open, so that it flies on unheard.
    pub way_free: bool,
    /// All others are out of radio range.
    pub out_of_range: bool,
    /// A neighbour was heard within the last second.
    pub neighbour_heard: bool,
    /// Others have divided the share of this vehicle, or count it as lost.
    pub excluded: bool,
    /// More is photographed than its plan leaves out.
    pub more_is_done: bool,
    /// Another plan of this mission is heard.
    pub plans_differ: bool,
    /// The vehicle stands where it promised to wait for a division.
    pub holds_to_divide: bool,
    /// The part that the last division gives has come.
    pub division_ready: bool,
    /// No division is under way.
    pub undivided: bool,
    /// A plan is held.
    pub plan_ready: bool,
    /// The shell has none.
    pub plan_failed: bool,
    /// The shell has none because the roadmap is missing or not the mission's.
    pub roadmap_bad: bool,
    /// The plan has a goal.
    pub has_goal: bool,
    /// In a coverage mission: all vehicles heard have this one's plan, and had time to report
    /// otherwise.
    pub plans_as_others: bool,
    /// Near the pad below the start point, in height too.
    pub at_start: bool,
    /// On the pad: the estimate's bound does not fit into the margin at cruise speed.
    pub imprecise: bool,
    /// Time for which it has not even fitted at a crawl.
    pub imprecise_for: Duration,
    /// The EKF origin moved while armed.
    pub origin_moved: bool,
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
    /// The mission is a coverage mission.
    pub area: bool,
    /// In a coverage mission: the path home can be planned from here.
    pub over_field: bool,
    /// It is on the last descent of its path, above its pad.
    pub descends: bool,
    /// The vehicle may fly around what blocks its path, and back to its path.
    pub may_fly_beside: bool,
    /// The vehicle stands where its detour comes back to its path.
    pub around_flown: bool,
    /// The vehicle's own plan has come there.
    pub own_plan_ready: bool,
    /// The vehicle's own plan will not come there.
    pub own_plan_lost: bool,
    /// The vehicle is to fly home, or does.
    pub homeward: bool,
    /// Time for which the vehicle has sought its path home, if it does.
    pub seeking_home_for: Option<Duration>,
    /// The vehicle stands, and may request its path home.
    pub stands_to_return: bool,
    /// The climb is not done: it continues after the interruption.
    pub in_climb: bool,
    /// Motors on.
    pub armed: bool,
    /// Arming was accepted, and the armed bit is overdue.
    pub armed_unseen: bool,
    /// Arming was not requested yet.
    pub arming_unrequested: bool,
    /// Arming was requested as often as allowed, and not answered.
    pub arming_unanswered: bool,
    /// Disarming was refused.
    pub disarm_refused: bool,
    /// The setpoint mode was entered for this mission and not left since.
    pub own_mode: bool,
    /// The mode is the one that lands.
    pub landing: bool,
    /// The mode is Offboard or Guided.
    pub offboard: bool,
    /// The mode is neither the one before nor the one asked for.
    pub mode_foreign: bool,
    /// `MAV_STATE_CRITICAL` or worse.
    pub critical: bool,
    /// The landing detector reports ground.
    pub on_ground: bool,
    /// The landing detector reported flight since the motors were armed.
    pub has_flown: bool,
    /// Moves up or down.
    pub vertical: bool,
    /// Motors on, and the landing detector reports flight.
    pub airborne: bool,
    /// The landing detector reports flight, or no row waits for that report.
    pub lifted_off: bool,
    /// The neighbours leave room to go.
    pub gates_open: bool,
    /// At the altitude of the start.
    pub climb_done: bool,
    /// At the end of the path with room to land.
    pub path_done: bool,
    /// The path was flown to the goal.
    pub at_goal: bool,
    /// The way back to the path is free.
    pub near_path: bool,
    /// Time for which another vehicle has been in the column to the ground, or before take-off in
    /// the column to its top.
    pub column_blocked_for: Duration,
    /// Time for which a vehicle that stands for good, or is lost, has been in that column.
    pub column_blocked_for_good_for: Duration,
    /// Time for which the column, or the path, has kept the vehicle on its pad.
    pub start_barred_for: Duration,
    /// Over an area another vehicle is in flight that takes part.
    pub others_fly: bool,
    /// Time for which that column has been free.
    pub column_clear_for: Duration,
    /// On its path, and not on the way back yet; over a field only while it finds no way home.
    pub can_turn_back: bool,
    /// Time for which the descent to the own pad, or the way to that pad, has been blocked: the
    /// way, and at the end of a path over an area the descent, by one that stands for good.
    pub pad_blocked_for: Duration,
    /// A place aside to land at may be sought.
    pub can_land_aside: bool,
    /// A place aside to land at is sought.
    pub seeks_landing: bool,
    /// Such a place is sought, or flown to.
    pub lands_aside: bool,
    /// The vehicle stands at the end of the path aside.
    pub aside_reached: bool,
    /// The vehicle must land: the battery is nearly empty, or the place to hold at is unknown.
    pub must_land: bool,
    /// Time for which the safety filter has made it yield.
    pub yielded_for: Duration,
    /// Time for which the safety filter has kept it from moving on.
    pub hindered_for: Duration,
    /// Battery charge below the configured limit.
    pub battery_low: bool,
    /// Battery charge below half of it.
    pub battery_critical: bool,
    /// No neighbour is in the column to the ground.
    pub room_below: bool,
    /// Outside the geofence.
    pub outside: bool,
    /// An obstacle or a vehicle out of the plan is on the path ahead.
    pub blocked: bool,
    /// All others stand, and it is this vehicle's turn to fly around.
    pub our_turn: bool,
    /// The detour has come.
    pub detour_ready: bool,
    /// No detour was found, often enough.
    pub no_way_around: bool,
    /// Time it waited under a vehicle that lands, unable to go elsewhere along its path.
    pub time_below_landing: Duration,
    /// The vehicle moves more slowly than a hovering vehicle sways.
    pub standing: bool,
}

/// Longest wait above a vehicle that rests: a vehicle that rests makes no room.
const MAX_WAIT_ABOVE_RESTING: Duration = Duration::from_secs(5);

impl GuardInputs {
    /// Whether it may turn home over a field, and has not yet.
    pub(super) fn may_turn_home(&self) -> bool {
        self.over_field && self.seeking_home_for.is_none()
    }

    /// Whether the column has not been free for `limit`, or a vehicle stands in it for good.
    pub(super) fn is_landing_blocked_for(&self, limit: Duration) -> bool {
        self.column_blocked_for >= limit
            || self.column_blocked_for_good_for >= MAX_WAIT_ABOVE_RESTING
    }
}
