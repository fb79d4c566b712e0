//! The way home in a coverage mission. A vehicle that is ordered back, or whose path stays blocked,
//! does not fly its lanes back. It stops, requests from its shell the way straight home in its own
//! layer, and flies that. It is off the plan from the moment at which it turns: the others divide
//! what it leaves.
//!
//! Constant work.

use crate::replanning::view::DetourView;
use crate::time::{Duration, Instant};
use crate::timers::{Timer, Timers};

/// Time from a search that found no path home to the next search.
pub(super) const HOME_SEARCH_PAUSE: Duration = Duration::from_secs(5);
/// Maximum number of turns home in one flight: blocked after the last, a vehicle seeks no further
/// path home.
const MAX_TURNS_HOME: u8 = 4;

/// The search of a vehicle for its path home in a coverage mission.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HomewardSearch {
    /// Since when the vehicle has been stopping to seek a path home; `None` if it does not.
    seeks_since: Option<Instant>,
    /// Number of times that the vehicle has turned home, at most [`MAX_TURNS_HOME`].
    turns_home: u8,
}

impl HomewardSearch {
    /// Begins the search: the vehicle turns home.
    pub(crate) fn begin(&mut self, now: Instant, timers: &mut Timers) {
        let turns = self.turns_home.saturating_add(1);
        *self = Self { seeks_since: Some(now), turns_home: turns };
        timers.set(Timer::HomeSearch, now);
    }

    /// Ends the search: a path from the shell has come, or the vehicle flies back another way.
    pub(crate) fn end(&mut self) {
        self.seeks_since = None;
    }

    /// Whether the vehicle has turned home and has no path home yet.
    pub(crate) fn is_seeking(&self) -> bool {
        self.seeks_since.is_some()
    }

    /// Time for which the vehicle has been seeking its path home; `None` if it does not.
    pub(crate) fn seeking_for(&self, now: Instant) -> Option<Duration> {
        self.seeks_since.map(|since| now - since)
    }

    /// Whether the shell may be asked for the path home now: not within [`HOME_SEARCH_PAUSE`] of
    /// the last failure.
    pub(crate) fn may_request(&self, now: Instant, timers: &Timers) -> bool {
        self.is_seeking() && timers.is_due(Timer::HomeSearch, now)
    }

    /// Whether the vehicle can turn home: it is on its path in a coverage mission, and has turned
    /// fewer than `MAX_TURNS_HOME` times.
    pub(crate) fn can_turn_home<const V: usize, const W: usize, const G: usize>(
        &self,
        view: &DetourView<'_, V, W, G>,
    ) -> bool {
        let flies = view.mission.plan().is_some_and(|plan| plan.task.leaves_pad());
        let on_path = view.guidance.reference_along_m() >= 0.0 && !view.guidance.returning;
        view.config.lost_vehicle_down_after_s.is_some()
            && flies
            && on_path
            && self.turns_home < MAX_TURNS_HOME
    }
}
