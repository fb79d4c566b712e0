//! States of the mission, and which state an interruption resumes.

/// State of one vehicle's mission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// No HEARTBEAT of an autopilot was received yet.
    #[default]
    WaitAutopilot,
    /// Connected to the autopilot; its position or its EKF origin is not known yet.
    WaitPosition,
    /// The shell was asked for the vehicle's plan.
    Planning,
    /// The plan has come; waits for MISSION_START.
    Ready,
    /// Started; waits on the pad, disarmed, for departure time and gates (PX4 would disarm after 10
    /// s on the ground).
    Scheduled,
    /// Sends setpoints at the current position, before Offboard or Guided is requested.
    Streaming,
    /// Offboard or Guided was requested.
    Engaging,
    /// Arming was requested.
    Arming,
    /// NAV_TAKEOFF was requested from an autopilot that takes off by command only; with another
    /// autopilot the state is left at once.
    TakeOff,
    /// Climbs straight up to the start of the path.
    Climb,
    /// Flies along the path; advice and safety filter slow and stop it for neighbours.
    Follow,
    /// Stands after DO_PAUSE_CONTINUE 0, on the path or in the climb.
    Paused,
    /// Stands on the path, since no neighbour hears this vehicle or none is heard.
    Alone,
    /// HEARTBEAT is missing in flight; the setpoint stops on the path.
    AutopilotSilent,
    /// The position is missing in flight, or jumped; the setpoint stops.
    PositionLost,
    /// The autopilot lands the vehicle.
    Land,
    /// On the ground; waits until the motors are disarmed.
    Disarm,
    /// A pilot set a mode that the companion did not request; setpoints sent are the current
    /// position.
    PilotControl,
    /// The autopilot's own failsafe acts: no setpoints are sent until it has landed.
    Failsafe,
    /// Landed and disarmed.
    Done,
    /// The mission was given up; MISSION_START plans again.
    Aborted,
    /// Stands on the path, since a vehicle that left the plan, or an obstacle, blocks it; waits
    /// until all others stand.
    Blocked,
    /// Holds its place; the shell was asked for a detour, a path home or a place to land.
    Replanning,
    /// Waits on the pad, disarmed; the shell was asked for a detour.
    PadReplanning,
    /// Brakes along the path to a stop, then lands.
    Stopping,
    /// The autopilot is in Offboard or Guided again after its pilot: holds the position at which
    /// that was seen, until DO_PAUSE_CONTINUE 1.
    PilotReturned,
    /// The start was cancelled or paused after arming was requested: holds on the pad until the
    /// motors are certain to be disarmed.
    CancelStart,
    /// The landing was stopped, since another vehicle is below or may be: holds its place until the
    /// column below is free.
    LandingHeld,
    /// Holds on its path, in a coverage mission, until the rest of the area is divided among the
    /// vehicles again.
    Dividing,
}

impl State {
    /// Every state, in the order of its number, which HEARTBEAT carries as `custom_mode`.
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

    /// Whether setpoints are sent in this state: from before Offboard or Guided until the motors
    /// are disarmed, but not in a failsafe nor in a take-off by command.
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

    /// Whether a vehicle in this state flies on along its coverage path while its lease lasts, even
    /// if no other vehicle hears it, or is about to: it prepares its take-off or climbs.
    pub(crate) fn flies_on_lease(self) -> bool {
        self.is_on_path() || self.prepares_take_off() || self.takes_off()
    }

    /// Whether the vehicle was not started yet.
    pub(crate) fn is_before_start(self) -> bool {
        use State::*;
        matches!(self, WaitAutopilot | WaitPosition | Planning | Ready)
    }

    /// Whether the vehicle has been started and waits on its pad, disarmed.
    pub(crate) fn waits_on_pad(self) -> bool {
        matches!(self, Self::Scheduled | Self::PadReplanning)
    }

    /// Whether the autopilot is being brought to fly: setpoints, mode, arming.
    pub(crate) fn prepares_take_off(self) -> bool {
        matches!(self, Self::Streaming | Self::Engaging | Self::Arming)
    }

    /// Whether the vehicle rises from its pad to the start of its path.
    pub(crate) fn takes_off(self) -> bool {
        matches!(self, Self::TakeOff | Self::Climb)
    }

    /// Whether the setpoint advances: up the climb, or along the path.
    pub(crate) fn advances(self) -> bool {
        matches!(self, Self::Climb | Self::Follow)
    }

    /// Whether the vehicle follows its path, or would if nothing blocked it.
    pub(crate) fn follows_path(self) -> bool {
        self == Self::Follow || self.is_blocked()
    }

    /// Whether the vehicle stands on its path because something blocks it.
    pub(crate) fn is_blocked(self) -> bool {
        matches!(self, Self::Blocked | Self::Replanning)
    }

    /// Whether the shell was asked for a path other than the plan's.
    pub(crate) fn waits_for_detour(self) -> bool {
        matches!(self, Self::Replanning | Self::PadReplanning)
    }

    /// Whether the vehicle lands, or would if the column below were free.
    pub(crate) fn lands(self) -> bool {
        matches!(self, Self::Land | Self::LandingHeld)
    }

    /// Whether the vehicle is on the ground after its flight.
    pub(crate) fn has_landed(self) -> bool {
        matches!(self, Self::Disarm | Self::Done)
    }

    /// Whether the mission has ended, well or not.
    pub(crate) fn is_over(self) -> bool {
        matches!(self, Self::Done | Self::Aborted)
    }

    /// Whether somebody else flies the vehicle, or did and has not given it back.
    pub(crate) fn is_flown_by_another(self) -> bool {
        matches!(self, Self::PilotControl | Self::PilotReturned | Self::Failsafe)
    }

    /// Whether a vehicle in this state follows the plan that all share, and its gates.
    pub(crate) fn is_on_plan(self) -> bool {
        use State::*;
        match self {
            Ready | Follow | Paused | Dividing => true,
            _ => {
                self.waits_on_pad()
                    || self.prepares_take_off()
                    || self.takes_off()
                    || self.is_blocked()
            }
        }
    }

    /// Whether a vehicle in this state is on its path, flying or holding: once it holds, only its
    /// own mission moves it on.
    pub(crate) fn is_on_path(self) -> bool {
        use State::*;
        matches!(self, Follow | Paused | Alone | Blocked | Replanning | Dividing)
    }
}

/// Target state of a row of the mission table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetState {
    /// A given state.
    State(State),
    /// The state that was interrupted.
    Interrupted,
}

/// The interrupted states, to which the mission returns. A pause interrupts ([`State::Paused`]),
/// and so does a loss: a silent autopilot, a lost position, or the pilot. There are two, as a loss
/// may interrupt a pause.
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
    /// The state to which [`TargetState::Interrupted`] leads from `state`.
    pub fn target(&self, state: State) -> State {
        if state == State::Paused { self.by_pause } else { self.by_loss }
    }

    /// Stores the state that a change from `from` to `to` interrupts. `after_search`: the state
    /// that is resumed after a search under way, the landing if it is for a place to land.
    pub(crate) fn record_interruption(&mut self, from: State, to: State, after_search: State) {
        use State::*;
        // These states cannot be resumed half-way: a search begins again in the state before it, a
        // disarming in the landing, and so does a start that ended with the motors armed.
        let kept = match from {
            Replanning => after_search,
            Arming | CancelStart | Disarm | LandingHeld => Land,
            other => other,
        };
        if Self::is_loss(to) && !Self::is_loss(from) {
            self.by_loss = kept;
        } else if to == Paused && from != Paused && !Self::is_loss(from) {
            self.by_pause = kept;
        }
    }

    /// The STATUSTEXT that names the interrupted state; `None` if a change from `from` to `to`
    /// interrupts none.
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

    /// The state of the flight without pause and loss: `state` itself or the one that they
    /// interrupted.
    pub(crate) fn uninterrupted_state(&self, state: State) -> State {
        use State::*;
        let state = match state {
            AutopilotSilent | PositionLost | PilotControl | PilotReturned => self.by_loss,
            other => other,
        };
        if state == Paused { self.by_pause } else { state }
    }
}
