//! A row of the mission table, and the actions that rows have.

use super::guard::Guard;
use crate::link::severity::Severity;
use crate::state::State;
use crate::state::interruption::TargetState;
use crate::time::Duration;

/// What the companion does when a row is taken, in addition to the change of state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing.
    None,
    /// Request streams and limit parameters from the autopilot.
    Connect,
    /// Request the vehicle's plan from the shell.
    RequestPlan,
    /// Clear all pending commands, MISSION_START among them.
    ForgetStart,
    /// Hold the current position from now on.
    HoldHere,
    /// Request the mode that follows setpoints (Offboard or Guided) from the autopilot, every
    /// second.
    RequestSetpointMode,
    /// Request arming from the autopilot; a denied request is repeated after a second.
    RequestArming,
    /// Request NAV_TAKEOFF from the autopilot every four seconds, to the climb's height above where
    /// the vehicle stands.
    RequestTakeOff,
    /// Let the setpoint climb from the current position to the start of the path.
    BeginClimb,
    /// Hold where the landing was stopped, and request Offboard or Guided, every second.
    HoldLanding,
    /// Let the reference move on along the path.
    FollowPath,
    /// Brake the reference to a stop along the path.
    BrakeOnPath,
    /// Resume the interrupted state: from the nearest point of the path, in a climb or a descent
    /// from the current position.
    Rejoin,
    /// Reverse the path flown so far, and fly it back to the start.
    TurnBack,
    /// Request the landing mode from the autopilot (AUTO.LAND or LAND), every second.
    RequestLandMode,
    /// Request a detour to the goal from the shell, from where the vehicle stands.
    RequestDetour,
    /// Brake the reference to a stop along the path, to request a path home from there.
    TurnHome,
    /// Request a path home over the field of heights from the shell, from where the vehicle stands.
    RequestPathHome,
    /// Request from the shell a detour over the field of heights that leads back to the vehicle's
    /// own path.
    RequestDetourBackToPath,
    /// Brake, and request from the shell a path to a place aside, out of the column of a vehicle
    /// that lands.
    RequestDetourAside,
    /// Request from the shell a path to a place aside where the vehicle can land.
    RequestLanding,
    /// Count the request for a detour as failed: the shell has not answered in time.
    NoteDetourFailure,
    /// Fly the detour that the shell has returned.
    FlyDetour,
    /// Fly the path that the last division of the area gives this vehicle, or its own path again
    /// after a detour.
    FlyDivision,
    /// Request disarming from the autopilot: at once before take-off; after landing only if the
    /// autopilot has not disarmed by itself in nine seconds.
    RequestDisarming,
    /// Clear all pending commands, and request disarming from the autopilot, every second.
    CancelStart,
}

/// One row of the mission table.
#[derive(Clone, Copy, Debug)]
pub struct TransitionRow {
    /// States to which the row applies.
    pub from: &'static [State],
    /// `from` as a bit mask, one bit for each state.
    pub(crate) from_mask: u32,
    /// Condition under which the row is taken.
    pub guard: Guard,
    /// The duration that the guard compares with: how long its condition must have lasted; zero for
    /// at once. Guards without a duration ignore it.
    pub limit: Duration,
    /// State after the row.
    pub to: TargetState,
    /// What the companion does when the row is taken.
    pub action: Action,
    /// STATUSTEXT for the operator, at most 50 bytes; empty for none.
    pub text: &'static str,
    /// Severity of the text; a warning: the mission leaves its usual course.
    pub severity: Severity,
}

/// `limit` of a row that is taken in the first step in which its guard is met.
pub(crate) const AT_ONCE: Duration = Duration::from_millis(0);

/// Bit mask with one bit for each of these states.
pub(crate) const fn state_mask(states: &[State]) -> u32 {
    let (mut bits, mut i) = (0, 0);
    while i < states.len() {
        bits |= 1 << states[i] as u32;
        i += 1;
    }
    bits
}
