//! How far a vehicle flies on while no other vehicle hears it, and how late it may be there.
//!
//! A vehicle reports a lower bound of its later progress: from its present progress it flies at
//! least at the assumed speed, after a delay of some seconds, as far as its gates are open or will
//! be. A gate adds to the delay only the time by which the vehicle leaves it later than that bound
//! passes it: a gate far ahead that opens soon adds nothing. So a vehicle that waits for a second
//! one, which waits for a third, knows how far the second flies meanwhile, and so on along the
//! chain.

use planner_core::flight::Gate;

use super::Neighbours;
use super::bounds::MAX_STAND_BEFORE_GATE_M;
use crate::time::Instant;

/// Longest time for which an unheard vehicle waits before a gate, seconds: less than row
/// `SwarmLinkLost` of the mission table waits.
const MAX_UNHEARD_GATE_WAIT_S: f32 = 14.0;

impl<const V: usize> Neighbours<V> {
    /// Place along the path of the first of `gates` before which this vehicle, unheard, would wait
    /// too long, metres, ∞ if there is none; and the seconds by which the gates before that one
    /// delay this vehicle, compared with a flight at the assumed speed from `progress_m`.
    pub(crate) fn own_unheard_reach(
        &self,
        gates: &[Gate],
        progress_m: f32,
        now: Instant,
    ) -> (f32, u8) {
        let mut delay_s = 0.0;
        let closed = gates.iter().find(|gate| {
            let Some(opens_s) = self.time_until_open_s(gate, now) else { return true };
            let ahead_m = gate.at_m - progress_m;
            let waits = opens_s - ahead_m / self.max_progress_mps > MAX_UNHEARD_GATE_WAIT_S;
            if !waits {
                let late_s =
                    opens_s - (ahead_m - MAX_STAND_BEFORE_GATE_M) / self.min_unheard_progress_mps;
                delay_s = libm::fmaxf(delay_s, late_s);
            }
            waits
        });
        (closed.map_or(f32::INFINITY, |gate| gate.at_m), libm::ceilf(delay_s) as u8)
    }

    /// Seconds until `gate` is surely open, even if no vehicle is heard until then; `None` where
    /// that is unknown.
    fn time_until_open_s(&self, gate: &Gate, now: Instant) -> Option<f32> {
        if self.is_open_for_good(gate, now) {
            return Some(0.0);
        }
        self.entries[self.roster_index(gate.wait_for_id)?]
            .time_until_passed_s(gate.open_from_progress_m, now)
    }
}

#[cfg(test)]
mod tests;
