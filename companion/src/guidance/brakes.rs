//! Where the reference stops on its path, and when it steps back from there.

use planner_core::deconflict::Advice;
use planner_core::flight::Path;

use super::{Guidance, Phase};
use crate::guidance::evade::{self, EvadeTarget};
use crate::mission::State;
use crate::swarm::neighbours::Neighbours;
use crate::time::{Duration, Instant};

/// Distance ahead within which a stop is a place to wait at, metres.
const WAIT_WITHIN_M: f32 = 8.0;
/// Age within which a report that a vehicle hears us shows that it is linked.
const LINKED_WITHIN: Duration = Duration::from_millis(800);
/// Drift in gusts of a vehicle that its autopilot lands from a standstill, with some reserve,
/// metres.
const UNHEARD_LANDING_DRIFT_M: f32 = 0.5;

/// Distance beyond the way that others know of for which a vehicle does not fly back, metres.
const BEYOND_KNOWN_M: f32 = 0.3;

/// Setpoint faster than this gets away from below a vehicle that comes down, m/s.
const ESCAPES_MPS: f32 = 0.5;

impl Guidance {
    /// An intent of `sent_at` has arrived, whose points lead to `ends_m` along the path.
    pub(crate) fn note_reported_way(&mut self, sent_at: Instant, ends_m: f32) {
        if sent_at > self.known_way.since {
            self.known_way.to_m = ends_m;
        }
    }

    /// Stops the setpoint where it is: the state that follows does not go.
    pub fn begin_braking(&mut self) {
        self.evade_search.reset();
    }

    /// Looks for a step back from below a vehicle that comes down, where it stands or would wait; a
    /// place ahead is flown on to. One that is alone steps back from above one that lies below, to
    /// land beside it, but not beyond where others last heard it to be: they look for it from there
    /// on.
    pub(super) fn evade<const V: usize, const W: usize>(
        &mut self,
        state: State,
        path: &Path<W>,
        advice: &mut Advice,
        neighbours: &mut Neighbours<V>,
        now: Instant,
    ) {
        let safety_m = self.deconflict.safety_distance_m;
        let along_m = self.tracker.along_m;
        if neighbours.linked_within(now, LINKED_WITHIN) {
            self.known_way.from_m =
                along_m - self.tracker.speed_mps.max(0.0) * LINKED_WITHIN.as_secs_f32();
        }
        let (alone, follows) = (state == State::Alone, state == State::Follow);
        // On its way down it continues, and on its way aside.
        let waits = state.holds_place()
            && matches!(self.phase, Phase::Path | Phase::Join)
            && !(self.ends_aside && follows);
        let lands_m = along_m.min(self.expected_up_to_m(alone, neighbours));
        let beyond = alone && along_m > lands_m + BEYOND_KNOWN_M;
        let wait_m = if follows { along_m + advice.stop_within_m.max(0.0) } else { lands_m };
        let beside_m = safety_m + evade::EVADE_MARGIN_M;
        let waits_there = waits && (!follows || advice.stop_within_m < WAIT_WITHIN_M);
        if waits_there {
            self.evade_search.continue_search(path, wait_m, neighbours.len(), |i, tell| {
                if alone {
                    neighbours.column_above(i, safety_m + UNHEARD_LANDING_DRIFT_M, tell);
                } else {
                    neighbours.landing_column(i, now, beside_m, tell);
                }
            });
        } else {
            self.evade_search.reset();
        }
        let (to_m, nowhere) = match self.evade_search.found {
            EvadeTarget::Here => (None, false),
            EvadeTarget::Back(to_m) => (Some(to_m.min(wait_m)), false),
            EvadeTarget::Nowhere => (None, !alone),
        };
        let from_m = self.known_way.from_m;
        let to_m = to_m.filter(|to_m| !alone || *to_m >= from_m).or(beyond.then_some(lands_m));
        self.evading = to_m.is_some();
        if let Some(to_m) = to_m {
            advice.stop_within_m = (to_m - along_m).max(0.0);
        }
        self.wait_distance_m = advice.stop_within_m;
        self.back_to_m = to_m.filter(|to_m| *to_m < along_m);
        self.no_better_place = nowhere;
    }

    /// Place along its path up to which others look for it once it is `alone`, metres. Gates that
    /// opened since may have led it further than it could tell. Over an area, and where the range
    /// is known, they expect it further on.
    fn expected_up_to_m<const V: usize>(&self, alone: bool, neighbours: &Neighbours<V>) -> f32 {
        let expected = alone && neighbours.fleet().is_none() && !neighbours.knows_range();
        if expected { self.known_way.from_m.max(self.known_way.to_m) } else { f32::INFINITY }
    }

    /// After the raw points of a step; `blocked` if one of them could not go back.
    pub(super) fn mark_trapped(&mut self, blocked: bool, now: Instant) {
        let barred = blocked || (self.filter.scans_backwards() && self.filter.is_stopped());
        if self.no_better_place || (self.back_to_m.is_some() && barred) {
            self.trapped_since.get_or_insert(now);
        } else if !self.evading
            || self.smoother.velocity().norm_squared() > ESCAPES_MPS * ESCAPES_MPS
        {
            self.trapped_since = None;
        }
    }
}
