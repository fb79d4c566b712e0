//! A vehicle as the referee sees it.

use companion::State;

use super::SimulatedVehicle;
use crate::swarm::board::RemoteCompanion;
use crate::swarm::referee::{Observation, RefereePhase};

impl SimulatedVehicle {
    /// The vehicle's true position and phase, for the referee.
    pub fn observation(&self) -> Observation {
        let truth = self.autopilot.true_state();
        let state = self.state();
        // A board's reported state is up to a second old; the autopilot's landing is known at once.
        let lands = self.board.is_some() && self.autopilot.is_in_land_mode();
        let on_path = state.is_on_path_or_stopping() || state.is_interrupted_by_loss();
        let phase = match (truth.touching, on_path && !lands) {
            (touching, _) if self.wrecked => {
                if touching {
                    RefereePhase::Wreck
                } else {
                    RefereePhase::Falling
                }
            }
            (true, _) if !truth.armed => RefereePhase::Grounded,
            (false, true) => RefereePhase::Flying,
            _ => RefereePhase::TakeOffOrLanding,
        };
        // A vehicle that stands by command of operator or pilot is not deadlocked.
        let ordered = state == State::Paused || state.is_left_to_pilot();
        let progress_m = self
            .board
            .as_ref()
            .map_or_else(|| Some(self.companion.progress_m()), RemoteCompanion::progress_m);
        Observation {
            position: truth.position,
            phase,
            holds_by_command: ordered,
            flown_by_pilot: state.is_left_to_pilot(),
            progress_m,
        }
    }
}
