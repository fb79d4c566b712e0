//! The way home over a field: a vehicle that is ordered back, or whose path stays blocked, does not
//! fly its lanes back. It stops, asks its shell for the way straight home in its own layer, and
//! flies that. It is off the plan from the moment on at which it turns: the others divide what it
//! leaves.
//!
//! Constant work.

use crate::swarm::view::DetourView;
use crate::time::{Duration, Instant};

/// Time from a search that found no way home to the next search.
const RETURN_RETRY: Duration = Duration::from_secs(5);
/// Most times that a vehicle turns home in one flight: a block after the last time is not flown
/// around.
const MAX_RETURNS: u8 = 4;

/// Progress of a vehicle that seeks its path home.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HomewardFlight {
    /// Time since which the vehicle stands and seeks its way.
    seeks_since: Option<Instant>,
    /// When it was last not found.
    missed_at: Option<Instant>,
    attempts: u8,
}

impl HomewardFlight {
    /// The vehicle turns home.
    pub(crate) fn begin(&mut self, now: Instant) {
        let turns = self.attempts.saturating_add(1);
        *self = Self { seeks_since: Some(now), attempts: turns, ..Self::default() };
    }

    /// The vehicle flies the path that it sought, or back another way.
    pub(crate) fn cancel(&mut self) {
        *self = Self { attempts: self.attempts, ..Self::default() };
    }

    /// Notes that no path home was found.
    pub(crate) fn note_failure(&mut self, now: Instant) {
        self.missed_at = Some(now);
    }

    /// Whether it stops for its path home, or seeks it.
    pub(crate) fn is_seeking(&self) -> bool {
        self.seeks_since.is_some()
    }

    /// Time for which the vehicle has been seeking its path home.
    pub(crate) fn seeking_for(&self, now: Instant) -> Option<Duration> {
        self.seeks_since.map(|since| now - since)
    }

    /// Whether the shell may be asked for the path home now: not within [`RETURN_RETRY`] of the
    /// last failure.
    pub(crate) fn may_request(&self, now: Instant) -> bool {
        self.is_seeking() && self.missed_at.is_none_or(|at| now - at >= RETURN_RETRY)
    }

    /// Whether it can turn home: over a field, on a path, and not too often before.
    pub(crate) fn can_turn<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let flies = view.mission.plan().is_some_and(|plan| plan.task.leaves_pad());
        let on_path = view.guidance.along_m() >= 0.0 && !view.guidance.returning;
        view.config.division.is_some() && flies && on_path && self.attempts < MAX_RETURNS
    }
}
