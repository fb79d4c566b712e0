//! The way home over a field: a vehicle that is ordered back, or whose path stays blocked, does not fly its lanes back. It stops,
//! asks its shell for the way straight home in its own layer, and flies that. It is off the plan from the moment on at which it
//! turns: the others divide what it leaves.
//!
//! Constant work.

use crate::swarm::view::View;
use crate::time::{Duration, Instant};

/// After no way home was found the next is sought so much later.
const AGAIN: Duration = Duration::from_secs(5);
/// So often it turns home in one flight: whatever stops it then is not flown around.
const TURNS: u8 = 4;

/// Where a vehicle is on its way home.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Homeward {
    /// It stops and seeks its way since then.
    seeks_since: Option<Instant>,
    /// When it was last not found.
    missed_at: Option<Instant>,
    /// It flies it.
    flies: bool,
    turns: u8,
}

impl Homeward {
    /// What remains of it when a way around has come; `aside` if that leads aside only.
    pub(super) fn taken(self, aside: bool) -> Self {
        Self { flies: !aside && self.seeks_since.is_some(), turns: self.turns, ..Self::default() }
    }

    /// It turns home.
    pub(crate) fn turn(&mut self, now: Instant) {
        let turns = self.turns.saturating_add(1);
        *self = Self { seeks_since: Some(now), turns, ..Self::default() };
    }

    /// It flies back another way.
    pub(crate) fn forget(&mut self) {
        *self = Self { turns: self.turns, ..Self::default() };
    }

    /// The way home was not found.
    pub(crate) fn miss(&mut self, now: Instant) {
        self.missed_at = Some(now);
    }

    /// Whether it stops for its way home, seeks it, or flies it.
    pub(crate) fn is_on(&self) -> bool {
        self.seeks() || self.flies
    }

    /// Whether it stops for its way home, or seeks it.
    pub(crate) fn seeks(&self) -> bool {
        self.seeks_since.is_some()
    }

    /// For how long the vehicle has been seeking its path home.
    pub(crate) fn sought_for(&self, now: Instant) -> Option<Duration> {
        self.seeks_since.map(|since| now - since)
    }

    /// Whether the shell may be asked for the path home now: not within [`AGAIN`] of the last failure.
    pub(crate) fn may_ask(&self, now: Instant) -> bool {
        self.seeks() && self.missed_at.is_none_or(|at| now - at >= AGAIN)
    }

    /// Whether it can turn home: over a field, on a path, and not too often before.
    pub(crate) fn can_turn<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &View<'_, V, W, G>,
    ) -> bool {
        let flies = view.mission.plan().is_some_and(|plan| plan.task.flies());
        let on_path = view.guidance.along_m() >= 0.0 && !view.guidance.returning;
        view.config.division.is_some() && flies && on_path && self.turns < TURNS
    }
}
