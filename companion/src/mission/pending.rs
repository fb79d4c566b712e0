//! Commands of the operator to the mission: which are stored for its table, and until when.

use crate::autopilot::telemetry::MAX_POSITION_AGE;
use crate::link::commands::{
    ACCEPTED, Command, DENIED, LAND, MISSION_START, PAUSE_CONTINUE, RETURN_TO_LAUNCH,
    TEMPORARILY_REJECTED,
};
use crate::mission::{Action, Guard, GuardInputs, State, TransitionRow, has_row_for};

/// Commands of the operator that the mission table has not carried out yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PendingCommands {
    /// MISSION_START, until the mission ends or its start is given up.
    pub(crate) start: bool,
    /// DO_PAUSE_CONTINUE 0, until the operator resumes or turns the vehicle back, it lands, or its
    /// mission or start ends. On the pad it prevents the take-off.
    pub(crate) pause: bool,
    /// DO_PAUSE_CONTINUE 1, until the next row of the mission table is taken, whichever it is.
    pub(crate) resume: bool,
    /// NAV_LAND, until the vehicle stops to land, lands, or is flown by its pilot or a failsafe.
    pub(crate) land: bool,
    /// NAV_RETURN_TO_LAUNCH, until the vehicle turns back, lands, or is flown by its pilot or a
    /// failsafe.
    pub(crate) turn_back: bool,
}

impl PendingCommands {
    /// Clears the commands that this row of the table has carried out by entering `to`, and a
    /// resume; all of them if the mission ends or its start is given up.
    pub(crate) fn clear_carried_out(&mut self, row: &TransitionRow, to: State) {
        let guard = row.guard;
        self.resume = false;
        if to.is_over() || matches!(row.action, Action::ForgetStart | Action::CancelStart) {
            *self = Self::default();
        }
        let lands = to.stops_to_land_or_lands();
        let resumed =
            matches!(guard, Guard::ResumeCommanded | Guard::ResumedOnPath) && to != State::Paused;
        let returns = matches!(guard, Guard::ReturnCommanded | Guard::ReturnInCoverage);
        if lands || resumed || returns {
            self.pause = false;
        }
        if lands || to.is_flown_by_pilot_or_failsafe() {
            self.land = false;
        }
        if lands || returns || to.is_flown_by_pilot_or_failsafe() {
            self.turn_back = false;
        }
    }
}

/// Stores a mission command for the mission table and returns its `MAV_RESULT`. `None` for a
/// command that is not one of the mission's.
pub(super) fn apply_command(
    pending: &mut PendingCommands,
    state: State,
    inputs: &GuardInputs,
    command: &Command,
) -> Option<u8> {
    use State::*;
    let (flag, guard, already) = match command.command {
        // MISSION_START before the plan has come is stored; a repeated one changes nothing.
        MISSION_START if state == Planning => {
            pending.start = true;
            return Some(ACCEPTED);
        }
        // After its flight in a coverage mission, a vehicle starts again from its pad: it
        // photographs waypoints that other vehicles left.
        MISSION_START if state == Done && inputs.is_coverage => {
            pending.start = true;
            return Some(ACCEPTED);
        }
        MISSION_START => (
            &mut pending.start,
            if state == Aborted { Guard::StartAgain } else { Guard::StartCommanded },
            state.is_mission_under_way(),
        ),
        PAUSE_CONTINUE if command.param1 == 0.0 => {
            // Before the climb, and while the mission is interrupted, the pause is stored until a
            // row can act on it.
            if state.stores_pause() && (state != CancelStart || pending.start) {
                pending.pause = true;
                return Some(ACCEPTED);
            }
            (&mut pending.pause, Guard::PauseCommanded, state == Paused)
        }
        PAUSE_CONTINUE if command.param1 == 1.0 => {
            // Continuing needs a known position to continue from.
            if state == PilotReturned && inputs.position_age >= MAX_POSITION_AGE {
                return Some(TEMPORARILY_REJECTED);
            }
            let taken = state.is_left_to_pilot_or_failsafe();
            if pending.pause && !taken && !has_row_for(state, Guard::ResumeCommanded) {
                pending.pause = false;
                return Some(ACCEPTED);
            }
            let guard =
                if state == PilotReturned { Guard::ResumedOnPath } else { Guard::ResumeCommanded };
            (&mut pending.resume, guard, state.has_resumed())
        }
        PAUSE_CONTINUE => return Some(DENIED),
        LAND if state.has_given_up() => {
            // With motors off a landing needs nothing. With motors on the row acts only in Offboard
            // or Guided; else a pilot or a failsafe flies the vehicle.
            let acts = inputs.armed && inputs.in_setpoint_mode;
            pending.land = acts;
            return Some(if acts || !inputs.armed { ACCEPTED } else { TEMPORARILY_REJECTED });
        }
        LAND => {
            let already = state.stops_to_land_or_lands() || state.has_landed();
            (&mut pending.land, Guard::LandCommanded, already)
        }
        RETURN_TO_LAUNCH => (&mut pending.turn_back, Guard::ReturnCommanded, state == Done),
        _ => return None,
    };
    if has_row_for(state, guard) {
        *flag = true;
        return Some(ACCEPTED);
    }
    Some(if already { ACCEPTED } else { TEMPORARILY_REJECTED })
}
