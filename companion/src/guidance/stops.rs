//! Moves the place where a vehicle waits back along its path: out of the column below a vehicle
//! that descends, and in `SwarmLinkLost` to where others expect it. Notes when it is trapped below
//! a vehicle that descends.

use planner_core::flight::Path;
use planner_core::track::deconflict::Advice;

use super::acknowledged_path::{MAX_BEYOND_KNOWN_M, MAX_NEW_REPORT_AGE};
use super::{Guidance, Phase};
use crate::guidance::evade::{self, EvadeTarget, StepBack};
use crate::state::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::Instant;

/// A stop nearer ahead than this is the place where the vehicle will wait, metres.
const WAITS_AT_STOP_WITHIN_M: f32 = 8.0;
/// Drift in gusts of a vehicle that its autopilot lands from a standstill, with some reserve,
/// metres.
const UNHEARD_LANDING_DRIFT_M: f32 = 0.5;

/// Setpoint speed above which a vehicle below one that descends no longer counts as trapped, m/s.
const NOT_TRAPPED_MPS: f32 = 0.5;

impl Guidance {
    /// Notes that another vehicle has acknowledged the intent sent at `sent_at` from `at_m` along
    /// the path, whose points lead to `to_m` along it.
    pub(crate) fn note_acknowledged_path(&mut self, sent_at: Instant, at_m: f32, to_m: f32) {
        self.acknowledged_path.note_acknowledged(sent_at, at_m, to_m);
    }

    /// Ends the search for a place to evade to: the next state does not fly on, and the setpoint
    /// stops where it is.
    pub fn cancel_evasion(&mut self) {
        self.evade_search.reset();
    }

    /// Moves the place where the vehicle waits back along its path, out of the columns of vehicles
    /// that descend: the advised stop if it is ahead of the reference, else `step_back_to_m`. In
    /// `SwarmLinkLost`, before it lands, the vehicle steps back from above vehicles that may lie
    /// below, and onto the part of its path where others expect it; never before the first place
    /// where they do.
    pub(super) fn update_evasion<const V: usize, const W: usize>(
        &mut self,
        state: State,
        path: &Path<W>,
        advice: &mut Advice,
        neighbours: &mut Neighbours<V>,
        now: Instant,
    ) {
        let safety_m = self.deconflict.safety_distance_m;
        let along_m = self.reference.along_m;
        if neighbours.is_reported_heard_within(now, MAX_NEW_REPORT_AGE) {
            self.acknowledged_path.note_reported_heard(
                along_m,
                self.reference.speed_mps.max(0.0),
                now,
            );
        }
        let (alone, follows) = (state == State::SwarmLinkLost, state == State::Follow);
        // An unheard vehicle that the filter stopped short of its reference is not led on to it, to
        // fly back from there.
        let at_reference = along_m < self.setpoint_along_m + MAX_BEYOND_KNOWN_M;
        // A vehicle in its climb or descent, or on its way aside, is not moved.
        let waits = state.is_on_path()
            && (at_reference || !alone)
            && matches!(self.phase, Phase::Path | Phase::Join)
            && !(self.ends_away_from_goal && follows);
        let [from_m, upto_m] = self.expected_first_and_last_m(state, neighbours, now);
        let lands_m = along_m.min(upto_m);
        let beyond = alone && at_reference && along_m > lands_m + MAX_BEYOND_KNOWN_M;
        let wait_m = if follows { along_m + advice.stop_within_m.max(0.0) } else { lands_m };
        let beside_m = safety_m + evade::EVADE_MARGIN_M;
        let waits_there = waits && (!follows || advice.stop_within_m < WAITS_AT_STOP_WITHIN_M);
        if waits_there {
            self.evade_search.continue_search(path, wait_m, neighbours.len(), |i, visit| {
                if alone {
                    neighbours.visit_column_above(i, safety_m + UNHEARD_LANDING_DRIFT_M, visit);
                } else {
                    neighbours.visit_landing_column(i, now, beside_m, visit);
                }
            });
        } else {
            self.evade_search.reset();
        }
        let (to_m, nowhere) = match self.evade_search.last_target {
            EvadeTarget::Here => (None, false),
            EvadeTarget::Back(to_m) => (Some(to_m.min(wait_m)), false),
            EvadeTarget::Nowhere => (None, !alone),
        };
        let to_m = to_m.filter(|to_m| !alone || *to_m >= from_m).or(beyond.then_some(lands_m));
        self.evading = to_m.is_some();
        if let Some(to_m) = to_m {
            advice.stop_within_m = (to_m - along_m).max(0.0);
        }
        self.stop_ahead_m = advice.stop_within_m;
        self.step_back_to_m = to_m.filter(|to_m| *to_m < along_m);
        self.no_evade_place = nowhere;
    }

    /// First and last place along its path where others expect a vehicle in `SwarmLinkLost`,
    /// metres. The last is ∞ in any other state, in a coverage mission, and where the radio's range
    /// is known, so that others expect it further on.
    fn expected_first_and_last_m<const V: usize>(
        &self,
        state: State,
        neighbours: &Neighbours<V>,
        now: Instant,
    ) -> [f32; 2] {
        let limited = state == State::SwarmLinkLost
            && neighbours.fleet().is_none()
            && !neighbours.knows_radio_range();
        let hears = limited && !neighbours.hears_nobody(now);
        let delay_s = hears.then(|| neighbours.max_message_delay_s());
        let [first_m, last_m] = self.acknowledged_path.expected_first_and_last_m(
            self.fastest_vehicle_mps,
            delay_s,
            now,
        );
        [first_m, if limited { last_m } else { f32::INFINITY }]
    }

    /// Since when the vehicle has been below one that descends, unable to leave along its path.
    pub(crate) fn trapped_below_since(&self) -> Option<Instant> {
        self.trapped_below_since
    }

    /// Restarts the time for which the vehicle counts as trapped below one that descends.
    pub(crate) fn reset_trap_timer(&mut self) {
        self.trapped_below_since = None;
    }

    /// Forgets where the vehicle waits and what it reports of that: guidance no longer moves it.
    pub(super) fn forget_waiting(&mut self) {
        self.cancel_evasion();
        self.hold_changed |= self.hold.end();
        (self.evading, self.step_back_to_m, self.no_evade_place) = (false, None, false);
        self.trapped_below_since = None;
    }

    /// Notes whether the vehicle is trapped below one that descends: no place back along the path
    /// is better, or the way back is barred. `step_back`: whether a step back of this control
    /// step's raw points was barred.
    pub(super) fn update_trapped(&mut self, step_back: StepBack, now: Instant) {
        let barred = step_back == StepBack::Barred
            || (self.filter.scans_backwards() && self.filter.is_stopped());
        if self.no_evade_place || (self.step_back_to_m.is_some() && barred) {
            self.trapped_below_since.get_or_insert(now);
        } else if !self.evading
            || self.smoother.velocity().norm_squared() > NOT_TRAPPED_MPS * NOT_TRAPPED_MPS
        {
            self.trapped_below_since = None;
        }
    }
}
