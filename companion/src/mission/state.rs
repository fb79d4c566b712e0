//! Where the mission is, and what was interrupted.

/// State of the mission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// No HEARTBEAT of the autopilot yet.
    #[default]
    WaitAutopilot,
    /// Connected; no position or no EKF origin yet.
    WaitPosition,
    /// The shell was asked for a plan.
    Planning,
    /// Planned; waits for MISSION_START.
    Ready,
    /// Started; waits on the ground for its gates, disarmed (PX4 disarms after 10 s on the ground).
    Scheduled,
    /// Setpoints at the current position, before Offboard or Guided is asked for.
    Streaming,
    /// Offboard or Guided was asked for.
    Engaging,
    /// Arming was asked for.
    Arming,
    /// NAV_TAKEOFF was asked for, of an autopilot that lifts off by command only; the others pass
    /// at once.
    TakeOff,
    /// Straight up to the start of the path.
    Climb,
    /// Along the path, slowed and stopped by the neighbours.
    Follow,
    /// Stopped by DO_PAUSE_CONTINUE, on the path or in the climb.
    Paused,
    /// Stopped on the path: no neighbour is heard.
    Alone,
    /// No HEARTBEAT in flight: stopped.
    AutopilotSilent,
    /// No position in flight.
    PositionLost,
    /// Landing, by the autopilot.
    Land,
    /// On the ground; waits until the motors are off.
    Disarm,
    /// A mode that we did not ask for: only the current position goes out.
    PilotControl,
    /// The autopilot's own failsafe acts: no setpoints until landed.
    Failsafe,
    /// Landed and disarmed.
    Done,
    /// Given up; MISSION_START plans again.
    Aborted,
    /// Stopped on the path: what left the plan is in its way. Waits until all others stand.
    Blocked,
    /// Hovers; the shell was asked for a detour.
    Replanning,
    /// Replanning on the ground, before the take-off.
    PadReplanning,
    /// Brakes along the path, then lands.
    Stopping,
    /// Offboard or Guided again after the pilot: holds the point where the mode came back until
    /// DO_PAUSE_CONTINUE 1.
    PilotReturned,
    /// The start was cancelled or paused after arming was requested: holds on the pad until the
    /// motors are surely off.
    CancelStart,
    /// A landing was stopped since another vehicle is below, or may be: holds until the column is
    /// free.
    LandingHeld,
    /// Holds on its path, in a coverage mission, until what a lost vehicle left is divided.
    Dividing,
}

impl State {
    /// Every state, in the order of the numbers that HEARTBEAT carries.
    pub const ALL: &'static [Self] = &[
        Self::WaitAutopilot,
        Self::WaitPosition,
        Self::Planning,
        Self::Ready,
        Self::Scheduled,
        Self::Streaming,
        Self::Engaging,
        Self::Arming,
        Self::TakeOff,
        Self::Climb,
        Self::Follow,
        Self::Paused,
        Self::Alone,
        Self::AutopilotSilent,
        Self::PositionLost,
        Self::Land,
        Self::Disarm,
        Self::PilotControl,
        Self::Failsafe,
        Self::Done,
        Self::Aborted,
        Self::Blocked,
        Self::Replanning,
        Self::PadReplanning,
        Self::Stopping,
        Self::PilotReturned,
        Self::CancelStart,
        Self::LandingHeld,
        Self::Dividing,
    ];

    /// Whether setpoints go out: from before Offboard until the motors are off, never in a
    /// failsafe, nor while an autopilot takes off by a command.
    pub fn streams_setpoints(self) -> bool {
        use State::*;
        matches!(
            self,
            Streaming
                | Engaging
                | Arming
                | Climb
                | Follow
                | Paused
                | Alone
                | Blocked
                | Replanning
                | Stopping
                | AutopilotSilent
                | PositionLost
                | Land
                | PilotControl
                | PilotReturned
                | CancelStart
                | Disarm
                | LandingHeld
                | Dividing
        )
    }

    /// Whether a vehicle in this state flies on over an area as long as its lease allows, or is
    /// about to take off.
    pub(crate) fn flies_on_lease(self) -> bool {
        use State::*;
        self.holds_place() || matches!(self, Streaming | Engaging | Arming | TakeOff | Climb)
    }

    /// Whether a vehicle that stands in this state stays there until it decides otherwise.
    pub(crate) fn holds_place(self) -> bool {
        use State::*;
        matches!(self, Follow | Paused | Alone | Blocked | Replanning | Dividing)
    }
}

/// Target of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetState {
    /// To this state.
    State(State),
    /// Back to the state that was interrupted.
    Interrupted,
}

/// The states that were interrupted. The states that interrupt are [`State::Paused`] on the one
/// hand, and on the other those in which autopilot, position or pilot take the vehicle: a pause may
/// itself be interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InterruptedStates {
    /// The state that the pause interrupted.
    pub by_pause: State,
    /// The state that a silent autopilot, a lost position or the pilot interrupted.
    pub by_loss: State,
}

impl Default for InterruptedStates {
    fn default() -> Self {
        Self { by_pause: State::Follow, by_loss: State::Follow }
    }
}

impl InterruptedStates {
    /// Target of [`TargetState::Interrupted`] from `state`.
    pub fn target(&self, state: State) -> State {
        if state == State::Paused { self.by_pause } else { self.by_loss }
    }

    /// Remembers what a change of state interrupts; `lands` if what it seeks is a place for a
    /// landing that was under way.
    pub(crate) fn record_interruption(&mut self, from: State, to: State, lands: bool) {
        use State::*;
        // A request to the shell, and a disarming, begin again.
        let kept = match from {
            Replanning if lands => Land,
            Replanning => Blocked,
            Disarm | LandingHeld => Land,
            other => other,
        };
        if Self::is_loss(to) && !Self::is_loss(from) {
            self.by_loss = kept;
        } else if to == Paused && from != Paused && !Self::is_loss(from) {
            self.by_pause = kept;
        }
    }

    /// The text for a change of state that interrupts another.
    pub(crate) fn interruption_text(&self, from: State, to: State) -> Option<&'static str> {
        use State::*;
        let kept = match to {
            Paused if matches!(from, PilotReturned | PositionLost) => return Some("Still paused"),
            Paused | PilotControl | AutopilotSilent | PositionLost if !Self::is_loss(from) => {
                self.target(to)
            }
            _ => return None,
        };
        Some(match kept {
            TakeOff => "Interrupted: TakeOff",
            Climb => "Interrupted: Climb",
            Follow => "Interrupted: Follow",
            Paused => "Interrupted: Paused",
            Alone => "Interrupted: Alone",
            Blocked => "Interrupted: Blocked",
            Dividing => "Interrupted: Dividing",
            Stopping => "Interrupted: Stopping",
            Land => "Interrupted: Land",
            _ => return None,
        })
    }

    fn is_loss(state: State) -> bool {
        use State::*;
        matches!(state, AutopilotSilent | PositionLost | PilotControl | PilotReturned)
    }

    /// The state of the flight itself, beneath pause and loss.
    pub(crate) fn uninterrupted_state(&self, state: State) -> State {
        use State::*;
        let state = match state {
            AutopilotSilent | PositionLost | PilotControl | PilotReturned => self.by_loss,
            other => other,
        };
        if state == Paused { self.by_pause } else { state }
    }
}
