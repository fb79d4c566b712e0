//! Advice for the flight ahead, and whether a vehicle departs.

use planner_core::track::deconflict::{self, OwnVehicle};

use super::{Guidance, GuidanceInputs};
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::{Duration, Instant};

/// Distance to the advised stop below which a vehicle on its pad does not depart, metres.
const MIN_FREE_PATH_TO_DEPART_M: f32 = 0.05;
/// Longest time for which a vehicle waits on its pad for a late one, beyond its departure by the
/// schedule: the late one may wait for something else than a gate, and others hover until this
/// vehicle has left.
const MAX_DEPARTURE_DELAY: Duration = Duration::from_secs(5);

impl Guidance {
    /// Whether advice lets the vehicle fly on far enough for its departure to be worth it.
    pub(crate) fn advice_allows_departure(&self) -> bool {
        self.advice.stop_within_m > MIN_FREE_PATH_TO_DEPART_M
    }

    /// Time after its scheduled departure until which the vehicle waits on its pad, rather than at
    /// a gate in the air, as a neighbour is late; zero if none is.
    pub(crate) fn departs_later_by(&self) -> Duration {
        self.departs_later_by
    }

    /// Updates the advice, and whether the vehicle departs later, where the state uses them.
    pub(super) fn update_advice<const V: usize, const W: usize, const G: usize>(
        &mut self,
        state: State,
        scene: &GuidanceInputs<'_, W, G>,
        neighbours: &mut Neighbours<V>,
        now: Instant,
    ) {
        let asks = state == State::Scheduled || state.follows_path_or_is_blocked();
        let Some(plan) = scene.plan.filter(|_| asks) else { return };
        let along_m = if self.has_begun_path { self.reference.along_m } else { -plan.climb_m };
        let own = OwnVehicle {
            rank: scene.rank,
            position: scene.telemetry.position,
            along_m,
            path: &plan.path,
            on_detour: scene.is_on_detour(),
        };
        // In a coverage mission the vehicles may climb at different speeds, and so come earlier:
        // there none waits on its pad for a late one.
        let to_goals = neighbours.fleet().is_none();
        let others = neighbours.states_with_age(now);
        self.advice = deconflict::advise(&self.deconflict, &own, &plan.gates, others);
        if self.has_begun_path {
            self.advice.stop_within_m =
                self.advice.stop_within_m.min((self.division_hold_m - along_m).max(0.0));
        }
        let mps =
            self.fastest_vehicle_mps.max(self.leg_track.climb_mps).max(self.leg_track.descend_mps);
        let late = state == State::Scheduled
            && to_goals
            && deconflict::has_late_neighbour(
                &self.deconflict,
                mps,
                &plan.path,
                &plan.gates,
                others,
            );
        self.departs_later_by = if late { MAX_DEPARTURE_DELAY } else { Duration::default() };
    }
}
