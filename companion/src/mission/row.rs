//! A row of the mission's table, and what it does.

use super::guard::Guard;
use super::state::{State, TargetState};
use crate::time::Duration;

/// Action of a row, in addition to the change of state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// No effect.
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
    RequestOffboard,
    /// Ask to arm, again every second.
    RequestArming,
    /// Ask for NAV_TAKEOFF to the height of the climb, again every four seconds.
    RequestTakeOff,
    /// Begin the climb.
    BeginClimb,
    /// Hold where the landing was stopped, and ask for Offboard or Guided, again every second.
    HoldOver,
    /// Let the reference run along the path.
    FollowPath,
    /// Brake the reference along the path.
    BrakeOnPath,
    /// Continue in the interrupted state: from the nearest point of the path, from here in a climb
    /// or a descent.
    Rejoin,
    /// Fly the path flown so far back to the start.
    TurnBack,
    /// Ask for AUTO.LAND or LAND, again every second.
    RequestLandMode,
    /// Ask the shell for a detour, from here.
    RequestDetour,
    /// Brake the reference along the path, to fly home from there.
    TurnHome,
    /// Ask the shell for the path home over a field, from here.
    RequestPathHome,
    /// Ask the shell for a detour and back to its own path over a field, from here.
    RequestDetourBackToPath,
    /// Ask the shell for a way aside, from here.
    RequestDetourAside,
    /// Ask the shell for a way aside, from here, to land there.
    RequestLanding,
    /// Give the shell up, this time.
    NoteDetourFailure,
    /// Fly it.
    FlyDetour,
    /// Fly the part of the area that the division gives.
    FlyDivision,
    /// Ask to disarm: at once before take-off; after landing only if the autopilot has not done so
    /// in four seconds.
    RequestDisarming,
    /// Forget MISSION_START, and ask to disarm, again every second.
    CancelStart,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct TransitionRow {
    /// States it applies to.
    pub from: &'static [State],
    /// States of the row, a bit for each.
    pub(crate) states: u32,
    /// Condition of the row.
    pub guard: Guard,
    /// How long it must have held; zero: at once.
    pub min_duration: Duration,
    /// The next state.
    pub to: TargetState,
    /// Effect of the row.
    pub action: Action,
    /// STATUSTEXT for a person, at most 50 bytes; empty: none.
    pub text: &'static str,
    /// Whether the text is a warning rather than information.
    pub warning: bool,
}

pub(crate) const AT_ONCE: Duration = Duration::from_millis(0);

/// Bit mask of the states.
pub(crate) const fn state_mask(states: &[State]) -> u32 {
    let (mut bits, mut i) = (0, 0);
    while i < states.len() {
        bits |= 1 << states[i] as u32;
        i += 1;
    }
    bits
}
