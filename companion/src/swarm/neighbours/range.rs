//! Whether the neighbours are within the range of the radio.

use planner_core::Point;

use super::Neighbours;
use super::bounds::*;
use super::entry::NeighbourEntry;
use crate::config::REACHES_ALL_M;
use crate::link::intent::{LANDED, OUT_OF_PLAN};
use crate::margins::max_unheard_travel_m;

impl<const V: usize> Neighbours<V> {
    /// Sets this vehicle's position, ENU, and the range of the radio, metres.
    pub(crate) fn set_own_position_and_range(&mut self, place: Point, radio_range_m: f32) {
        let (all, known) = (radio_range_m >= REACHES_ALL_M, self.knows_radio_range());
        self.range_edge_m = if all { f32::INFINITY } else { RANGE_EDGE_SHARE * radio_range_m };
        self.own_position = place;
        if known != self.knows_radio_range() {
            let travel_m = self.max_unheard_travel_for_range_m();
            self.entries.iter_mut().for_each(|entry| entry.max_unheard_travel_m = travel_m);
        }
    }

    /// Distance along its path within which a vehicle that none hears comes to rest, metres.
    /// Greater with a known range: a vehicle that notices late that none hears it may then be out
    /// of range, and does not fly back.
    pub(super) fn max_unheard_travel_for_range_m(&self) -> f32 {
        let later_s = if self.knows_radio_range() { UNHEARD_NOTICED_LATER_S } else { 0.0 };
        max_unheard_travel_m(self.fastest_vehicle_mps) + later_s * self.fastest_vehicle_mps
    }

    /// Whether the operator has set the range of the radio (`FLK_RADIO_M`).
    pub(crate) fn knows_radio_range(&self) -> bool {
        self.range_edge_m.is_finite()
    }

    /// Whether every vehicle of the roster that has not ended its flight was last heard, if ever,
    /// where the radio may not reach: then silence is no failure.
    pub(crate) fn are_all_out_of_range_or_done(&self) -> bool {
        let beyond = |c: &NeighbourEntry| {
            c.at_range_edge || c.position_at.is_none() || c.reports_any(LANDED | OUT_OF_PLAN)
        };
        self.knows_radio_range() && self.entries[..self.roster_count].iter().all(beyond)
    }
}

#[cfg(test)]
mod tests;
