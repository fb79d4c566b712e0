//! Which state an interruption resumes.

use super::State;

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
    pub fn state_to_resume(&self, state: State) -> State {
        if state == State::Paused { self.by_pause } else { self.by_loss }
    }

    /// Stores the state that a change from `from` to `to` interrupts. `after_search`: the state
    /// that is resumed where `from` is a search for a path; it is the landing if the search is for
    /// a place to land.
    pub(crate) fn record_interruption(&mut self, from: State, to: State, after_search: State) {
        use State::*;
        // These states cannot be resumed half-way. A search for a path begins again from
        // `after_search`. A disarming, a held landing, and a start that ended with the motors armed
        // resume as a landing.
        let kept = match from {
            Replanning => after_search,
            Arming | CancelStart | Disarm | LandingHeld => Land,
            other => other,
        };
        let is_loss = to.is_interrupted_by_loss();
        let was_loss = from.is_interrupted_by_loss();
        if is_loss && !was_loss {
            self.by_loss = kept;
        } else if to == Paused && from != Paused && !was_loss {
            self.by_pause = kept;
        }
    }

    /// The STATUSTEXT that names the interrupted state; `None` if a change from `from` to `to`
    /// interrupts none.
    pub(crate) fn interruption_text(&self, from: State, to: State) -> Option<&'static str> {
        use State::*;
        let kept = match to {
            Paused if from.may_be_off_path_on_resume() => return Some("Still paused"),
            Paused | PilotControl | AutopilotSilent | PositionLost
                if !from.is_interrupted_by_loss() =>
            {
                self.state_to_resume(to)
            }
            _ => return None,
        };
        Some(match kept {
            TakeOff => "Interrupted: TakeOff",
            Climb => "Interrupted: Climb",
            Follow => "Interrupted: Follow",
            Paused => "Interrupted: Paused",
            SwarmLinkLost => "Interrupted: SwarmLinkLost",
            Blocked => "Interrupted: Blocked",
            Dividing => "Interrupted: Dividing",
            Stopping => "Interrupted: Stopping",
            Land => "Interrupted: Land",
            _ => return None,
        })
    }

    /// The state of the flight without pause and loss: `state` itself or the one that they
    /// interrupted.
    pub(crate) fn uninterrupted_state(&self, state: State) -> State {
        let state = if state.is_interrupted_by_loss() { self.by_loss } else { state };
        if state == State::Paused { self.by_pause } else { state }
    }
}
