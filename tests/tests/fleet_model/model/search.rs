//! The model as Stateright searches it.

use companion::swarm::fleet::{OwnReport, VehicleReception};
use stateright::{Model, Property};

use super::{FleetModel, Flight, Known, MOST, NOW, Radio, State, Vehicle};
use crate::links::whole;

impl Model for FleetModel {
    type State = State;
    type Action = State;

    fn init_states(&self) -> Vec<State> {
        let known = &mut *self.known.lock().unwrap();
        let begin = |known: &mut Known, stands: usize| {
            let mut vehicles = [0; MOST];
            for (rank, number) in vehicles.iter_mut().enumerate().take(self.count) {
                let stands = stands >> rank & 1 != 0;
                let mut vehicle = Vehicle { flight: Flight::Flies, stands, ..self.dead(rank, 0) };
                vehicle.fleet.begin_flight(NOW);
                // All heard each other when they took off.
                let heard = VehicleReception {
                    heard_at: Some(NOW),
                    hears_us: true,
                    heard_by_others: true,
                    heard_bits: u32::MAX,
                };
                vehicle.fleet.step(
                    NOW,
                    &OwnReport { airborne: true, ..OwnReport::default() },
                    |_| heard,
                );
                vehicle.fleet.normalise_for_search(NOW, NOW);
                *number = self.number(known, vehicle);
            }
            vehicles
        };
        let changes = match self.radio {
            Radio::Any => 0,
            Radio::Links(changes) | Radio::Parts(changes) => changes,
        };
        let links = whole(self.count);
        let state = |vehicles| State { vehicles, losses: self.losses, links, changes };
        (0..1 << self.count).map(|stands| state(begin(known, stands))).collect()
    }

    fn actions(&self, state: &State, actions: &mut Vec<State>) {
        let known = &mut *self.known.lock().unwrap();
        self.tick(known, state, actions);
        if state.changes > 0 {
            let (to, changes) = (actions.len(), state.changes - 1);
            for links in self.all_links.iter().copied().filter(|links| *links != state.links) {
                (0..to).for_each(|k| actions.push(State { links, changes, ..actions[k] }));
            }
        }
    }

    fn next_state(&self, _: &State, action: State) -> Option<State> {
        Some(action)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always("one owner", |model: &Self, state| model.one_owner(state)),
            Property::always("nothing left out", |model: &Self, state| model.ends_well(state)),
        ]
    }
}
