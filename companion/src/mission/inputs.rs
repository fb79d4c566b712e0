//! The inputs of the guards of the mission table.

use crate::autopilot::telemetry::MAX_POSITION_AGE_ON_PAD;
use crate::margins::MAX_HEIGHT_ERROR_ON_GROUND_M;
use crate::time::Duration;

/// Snapshot of the vehicle, of pending commands, of neighbours and of the plan, by which the guards
/// are evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuardInputs {
    /// Time since the mission state was entered.
    pub time_in_state: Duration,
    /// Time since the autopilot's last HEARTBEAT.
    pub heartbeat_age: Duration,
    /// Time for which HEARTBEATs have come without a gap of 4.5 s.
    pub autopilot_heard_for: Duration,
    /// Time since the last usable position.
    pub position_age: Duration,
    /// Whether the position jumped, or the EKF origin changed, within the last second.
    pub position_jumped: bool,
    /// Time since this vehicle last made progress along its path; zero in states other than
    /// `Follow` and `Blocked`. In `Blocked` at least `path_blocked_for`, and exactly that while a
    /// path home may still be sought.
    pub stalled_for: Duration,
    /// Time for which this vehicle has not reached its setpoint, nor its setpoint moved on. In a
    /// coverage mission 60 s less while the vehicle is within 2 m of its setpoint.
    pub unfollowed_for: Duration,
    /// Time since this vehicle's path was first found blocked about where it was last found
    /// blocked, even if it was clear meanwhile.
    pub path_blocked_for: Duration,
    /// Time for which this vehicle has heard no neighbour, or none has reported that it hears this
    /// vehicle, in this state; zero once all have landed or left the plan. In a coverage mission
    /// it counts from 1 s before the lease ends.
    pub unlinked_for: Duration,
    /// Whether all lost vehicles must have been down for a minute: a division under way is then
    /// overdue.
    pub division_overdue: bool,
    /// Whether this vehicle may fly on unheard: all others are out of radio range, and its next
    /// gate is open or none is left.
    pub may_fly_on_unheard: bool,
    /// Whether all other vehicles that still fly were last heard near the edge of the radio range
    /// or beyond it, or never. False where that range is not set.
    pub others_out_of_range: bool,
    /// Whether in the last second a neighbour was heard, and one reported that it hears this
    /// vehicle; in a coverage mission, whether a majority reported that.
    pub swarm_linked: bool,
    /// Whether other vehicles have divided this vehicle's share of the area, or count this vehicle
    /// as lost.
    pub excluded: bool,
    /// Whether the waypoints that this vehicle's plan is to leave out have changed since the plan
    /// was requested.
    pub left_out_set_changed: bool,
    /// Whether a neighbour that follows another plan of this mission was heard lately.
    pub plans_differ: bool,
    /// Whether, in `Follow` or `Blocked`, the setpoint stands at this vehicle's commitment: the
    /// place along its path where it holds until it has its plan of the division under way.
    pub holds_to_divide: bool,
    /// Whether the plan after the last division has come while the vehicle held for it
    /// (`Dividing`), and is not flown yet.
    pub division_plan_ready: bool,
    /// Whether no division is under way or outstanding, nor this vehicle's own plan after a detour.
    pub division_settled: bool,
    /// Whether the shell has returned the requested plan.
    pub plan_ready: bool,
    /// Whether the shell answered the request for a plan or detour with a failure.
    pub plan_failed: bool,
    /// Whether the shell has no plan because the mission, or the roadmap or field of heights that
    /// it needs, is missing, damaged or not the mission's.
    pub roadmap_unusable: bool,
    /// Whether the plan makes this vehicle leave its pad.
    pub plan_leaves_pad: bool,
    /// In a coverage mission: whether this vehicle has no part, but may get one of a vehicle that
    /// is lost: a majority heard it within the last 5 min, and others take part.
    pub in_reserve: bool,
    /// In a coverage mission: whether all neighbours heard have this vehicle's plan, after time
    /// enough to report another one. True in other missions.
    pub shares_plan_with_others: bool,
    /// Whether the position is within the start tolerance of the pad, horizontally and in height;
    /// in height also within 1.5 m.
    pub at_pad: bool,
    /// Whether, in `Ready`, the position estimate's error bound exceeds what the margin leaves for
    /// it at cruise speed.
    pub imprecise_at_cruise: bool,
    /// Time for which the position estimate's error bound has exceeded what the margin leaves for
    /// it even at crawl speed.
    pub imprecise_at_crawl_for: Duration,
    /// Whether the EKF origin moved while the motors were armed.
    pub origin_moved: bool,
    /// Whether MISSION_START is pending.
    pub start_pending: bool,
    /// Whether DO_PAUSE_CONTINUE 0 is pending.
    pub pause_pending: bool,
    /// Whether, in `Climb`, the vehicle is less than 1 m, and less than half the climb, above its
    /// pad: a pause then waits, unless the vehicle has not left the ground.
    pub climb_just_begun: bool,
    /// Whether DO_PAUSE_CONTINUE 1 is pending.
    pub resume_pending: bool,
    /// Whether NAV_LAND is pending.
    pub land_pending: bool,
    /// Whether NAV_RETURN_TO_LAUNCH is pending and this vehicle does not fly back yet.
    pub return_pending: bool,
    /// Whether the mission is a coverage mission.
    pub is_coverage: bool,
    /// Whether this vehicle may request a path home from the shell: in a coverage mission, on its
    /// path, while it has turned home fewer than `MAX_TURNS_HOME` times. Perhaps there is no such
    /// path.
    pub may_seek_path_home: bool,
    /// Whether this vehicle is on the last descent of its path, above its pad.
    pub in_last_descent: bool,
    /// Whether this vehicle stands and may fly around the obstacle on its path and back to its
    /// path.
    pub may_detour_and_rejoin: bool,
    /// Whether this vehicle stands at the end of its detour, back on its path.
    pub stands_at_detour_end: bool,
    /// Whether the rest of its own plan has come to this vehicle, back on its path after a detour.
    pub own_plan_ready: bool,
    /// Whether the rest of its own plan could not be planned for this vehicle, back on its path.
    pub own_plan_failed: bool,
    /// Whether this vehicle seeks a path home over the field of heights, or flies one.
    pub seeks_or_flies_path_home: bool,
    /// Time for which this vehicle has sought its path home; `None` if it seeks none.
    pub seeking_home_for: Option<Duration>,
    /// Whether this vehicle stands, seeks its path home, and may request it from the shell now.
    pub ready_to_request_path_home: bool,
    /// Whether the flight, apart from interruptions, is still in the take-off or the climb.
    pub in_climb: bool,
    /// Whether the autopilot reports the motors armed.
    pub armed: bool,
    /// Whether the autopilot accepted arming 2.5 s ago or more, so that HEARTBEAT should show it.
    pub armed_bit_overdue: bool,
    /// Whether arming has not been requested yet.
    pub arming_unrequested: bool,
    /// Whether arming has failed for want of an answer from the autopilot.
    pub arming_unanswered: bool,
    /// Whether the autopilot is still in Offboard or Guided as entered for this mission, or in the
    /// landing mode after it.
    pub in_own_mode: bool,
    /// Whether the autopilot's mode is the landing mode.
    pub in_land_mode: bool,
    /// Whether the autopilot's mode is Offboard or Guided.
    pub in_setpoint_mode: bool,
    /// Whether a pilot or a failsafe has changed the autopilot's mode: it is not Offboard or
    /// Guided, nor, before arming, the mode at the start, nor, in a landing, the landing mode.
    /// False after a landing once the motors are off.
    pub mode_foreign: bool,
    /// Whether HEARTBEAT reports `MAV_STATE_CRITICAL` or worse.
    pub autopilot_critical: bool,
    /// Whether the landing detector reports the vehicle on the ground.
    pub on_ground: bool,
    /// Estimated height above the ground as far as the plan says, metres; NaN while unknown, and
    /// where the landing detector last reported flight.
    pub height_if_ground_reported_m: f32,
    /// Whether the landing detector has reported flight while armed, or the vehicle has risen,
    /// since the state `Arming` was entered.
    pub has_flown: bool,
    /// Whether the vehicle moves up or down by more than 0.5 m/s.
    pub moves_vertically: bool,
    /// Whether the motors are armed and the landing detector reports flight.
    pub airborne: bool,
    /// Whether the landing detector reports flight; always true for an autopilot that takes off
    /// without a command.
    pub take_off_command_done: bool,
    /// Whether the vehicle may take off: its departure is due, it is not paused, gates and safety
    /// filter let it go, its path is not blocked, the battery's charge is known, no other plan is
    /// heard, and another vehicle hears it. In a mission with goals no other vehicle has to hear it
    /// once all others have landed or left the plan.
    pub may_take_off: bool,
    /// Whether, in the state `Climb`, setpoint and vehicle are at the start of the path; false in
    /// all other states.
    pub climb_done: bool,
    /// Whether the vehicle is at the end of its path and may land there, or is on the ground in its
    /// last descent.
    pub path_done: bool,
    /// Whether the vehicle flies back to its start, along its path or straight home.
    pub returns_to_start: bool,
    /// Whether the reference is at the goal of the plan, and the vehicle does not fly home.
    pub reference_at_goal: bool,
    /// Whether the vehicle is near enough to its path to fly back to it, in the states that wait
    /// for that.
    pub near_path: bool,
    /// Time for which the column below the vehicle, before take-off the column above its pad, has
    /// not been free of other vehicles.
    pub column_blocked_for: Duration,
    /// Time for which a vehicle that is on the ground, or lost, has been in the column below this
    /// vehicle, or before take-off above its pad.
    pub column_blocked_for_good_for: Duration,
    /// Time for which another vehicle in the column above its pad, or an obstacle on its path, has
    /// kept this vehicle on its pad.
    pub start_barred_for: Duration,
    /// Whether, in a coverage mission, another vehicle that takes part is in flight, none is
    /// missing, and no division is under way.
    pub may_leave_part_to_others: bool,
    /// Time for which the column below this vehicle, or before take-off above its pad, has been
    /// free of other vehicles.
    pub column_clear_for: Duration,
    /// Whether the vehicle can turn back along the path flown so far: it is on that path, or the
    /// way there is known to be free of walls; it does not fly back yet, follows its setpoints, and
    /// hears another vehicle. In a coverage mission only while it seeks a path home.
    pub can_turn_back: bool,
    /// Whether the vehicle flies back as it came, and a reported obstacle lies ahead on that way,
    /// near where the vehicle can stop, or below its end.
    pub way_back_barred: bool,
    /// Time for which the last leg of this vehicle has been blocked: on its way home the descent to
    /// its pad by any vehicle; the way home before that, and the descent at the end of a coverage
    /// path, by a vehicle that is on the ground or lost.
    pub pad_blocked_for: Duration,
    /// Time for which a vehicle that is on the ground or lost has barred this vehicle's way back to
    /// its pad. Zero in a coverage mission, where that vehicle may only be silent.
    pub way_back_blocked_for_good_for: Duration,
    /// Whether the vehicle is to join its path, but no way there is known to be free of walls.
    pub join_barred: bool,
    /// Whether a place aside to land at may be sought, from the path or over an area.
    pub may_seek_landing_aside: bool,
    /// Whether a place aside to land at is being sought.
    pub seeks_landing_aside: bool,
    /// Whether a place aside to land at is being sought, flown to, or reached.
    pub lands_aside: bool,
    /// Whether the vehicle stands at the end of its path to a place aside where it is to land.
    pub landing_place_reached: bool,
    /// Whether the vehicle must land whatever is below it: the battery is nearly empty, the
    /// position is not known, or the EKF origin moved.
    pub must_land: bool,
    /// Time for which the safety filter has kept this vehicle from moving on so that another one
    /// goes first. Waits for a vehicle that comes down unheard do not count at first.
    pub yielded_for: Duration,
    /// Time for which the safety filter has kept this vehicle from moving on, whatever goes first.
    /// Waits for a vehicle that comes down unheard do not count at first.
    pub hindered_for: Duration,
    /// Whether the battery's charge is below the configured limit.
    pub battery_low: bool,
    /// Whether the battery's charge is below half of the configured limit.
    pub battery_critical: bool,
    /// Whether no neighbour was last heard below this vehicle, near its vertical, and no reported
    /// obstacle is there.
    pub room_below: bool,
    /// Whether the vehicle is outside its geofence, or stands at it.
    pub outside_geofence: bool,
    /// Whether an obstacle, or a vehicle that left the plan, is on the path ahead, or this vehicle
    /// seeks its path home.
    pub path_blocked: bool,
    /// Whether, in a mission with goals, all others stand and wait, and it is this vehicle's turn
    /// to fly a detour.
    pub our_turn_to_detour: bool,
    /// Whether the requested detour has come.
    pub detour_ready: bool,
    /// Whether the search for a detour has been given up after several failures.
    pub detours_given_up: bool,
    /// Time for which the vehicle has waited below one that lands, without a place along its path
    /// to evade to.
    pub waited_below_landing_for: Duration,
    /// Whether, outside a descent, setpoint and vehicle stand: the vehicle is slower than a
    /// hovering one that sways.
    pub standing: bool,
}

/// Longest time that a vehicle waits above another that is on the ground or lost, or, on its way
/// back, before such a vehicle: it will not leave.
const MAX_WAIT_ABOVE_RESTING: Duration = Duration::from_secs(5);

/// Height above [`MAX_HEIGHT_ERROR_ON_GROUND_M`] from which an estimate shows that the vehicle is
/// in the air, metres: an estimate near that bound does not switch between ground and air.
const IN_AIR_HYSTERESIS_M: f32 = 0.5;
/// Estimated height above the plan's ground from which a vehicle is in the air, metres.
const SURELY_IN_AIR_M: f32 = MAX_HEIGHT_ERROR_ON_GROUND_M + IN_AIR_HYSTERESIS_M;

impl GuardInputs {
    /// Whether the vehicle can request a path home, and does not seek one yet.
    pub(super) fn may_begin_seeking_home(&self) -> bool {
        self.may_seek_path_home && self.seeking_home_for.is_none()
    }

    /// Whether the vehicle surely has not left the ground: its position is new, the landing
    /// detector reports the ground, and since `Arming` it has not reported flight, nor has the
    /// vehicle risen.
    pub(super) fn is_before_lift_off(&self) -> bool {
        self.position_age < MAX_POSITION_AGE_ON_PAD
            && self.on_ground
            && !self.moves_vertically
            && !self.has_flown
    }

    /// Whether the vehicle is in the air, whatever the landing detector reports.
    pub(super) fn is_in_air(&self) -> bool {
        self.armed
            && (self.airborne
                || self.moves_vertically
                || self.height_if_ground_reported_m > SURELY_IN_AIR_M)
    }

    /// Whether the column below has not been free for `limit`, or a vehicle that is on the ground
    /// or lost has been in it for 5 s (`MAX_WAIT_ABOVE_RESTING`).
    pub(super) fn is_landing_blocked_for(&self, limit: Duration) -> bool {
        self.column_blocked_for >= limit
            || self.column_blocked_for_good_for >= MAX_WAIT_ABOVE_RESTING
    }

    /// Whether the way to its pad has been barred for `limit`, or for 5 s
    /// (`MAX_WAIT_ABOVE_RESTING`) by a vehicle that is on the ground or lost.
    pub(super) fn is_pad_blocked_for(&self, limit: Duration) -> bool {
        self.pad_blocked_for >= limit
            || self.way_back_blocked_for_good_for >= MAX_WAIT_ABOVE_RESTING
    }
}
