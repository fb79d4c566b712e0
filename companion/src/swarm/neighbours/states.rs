//! The neighbours as the advice sees them: state and age at a given time.

use planner_core::flight::Gate;
use planner_core::track::deconflict::Neighbour;

use super::Neighbours;
use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::link::intent::ON_DETOUR;
use crate::time::Instant;

impl<const V: usize> Neighbours<V> {
    /// State and age, at `now`, of every neighbour whose position or progress was ever heard, or
    /// that counts as dead. A vehicle out of the plan opens no gate until a scan has found that it
    /// does not block the path ([`Self::mark_path_clear`]).
    pub fn states_with_age(&mut self, now: Instant) -> &[Neighbour] {
        self.states.clear();
        self.forget_silent_strangers(now);
        for entry in &self.entries {
            let progress_m = entry.min_progress_m(now);
            let placed_at = entry.position_at;
            let dead = entry.is_dead(self.path_clear_at);
            if placed_at.is_none() && progress_m.is_none() && !dead {
                continue;
            }
            let state = Neighbour {
                // Of a vehicle known only by relays, only the progress is known.
                position: placed_at.map_or(FAR_AWAY, |_| entry.state.position),
                age_s: placed_at.map_or(0.0, |at| (now - at).as_secs_f32()),
                rank: entry.rank,
                progress_m,
                grounded: entry.state.grounded || dead,
                out_of_plan: entry
                    .out_of_plan_since
                    .is_some_and(|since| since <= self.path_clear_at)
                    || dead,
                on_detour: entry.reports_any(ON_DETOUR),
                ..entry.state
            };
            // Cannot overflow: there are as many slots as entries.
            let _ = self.states.push(state);
        }
        &self.states
    }

    /// Whether `gate` is open for good: the vehicle that it waits for has passed, or is out of the
    /// plan, and a scan has found since that it does not block the path.
    pub(crate) fn is_open_for_good(&self, gate: &Gate, now: Instant) -> bool {
        let entry = self.roster_index(gate.wait_for_id).map(|at| &self.entries[at]);
        entry.is_some_and(|c| {
            let passed = c
                .min_progress_m(now)
                .is_some_and(|progress_m| progress_m >= gate.open_from_progress_m);
            passed
                || c.out_of_plan_since.is_some_and(|since| since <= self.path_clear_at)
                || c.is_dead(self.path_clear_at)
        })
    }

    /// Whether the vehicle `id` was last heard to follow the shared plan; true for an unknown id.
    pub(crate) fn follows_plan(&self, id: u8) -> bool {
        self.entries.iter().find(|c| c.state.id == id).is_none_or(NeighbourEntry::on_plan)
    }
}
