//! A vehicle of the mission that never starts is named while this one waits for it: nobody else may see why the swarm stands.
//!
//! Constant work, but for one look through the roster.

use crate::companion::Companion;
use crate::events::Event;
use crate::mission::State;
use crate::time::{Duration, Instant};

/// So long a vehicle waits for one that has not started before it says so, and again.
const NAMED_AFTER: Duration = Duration::from_secs(30);

/// For which vehicle this one waits, and since when, or since it was named last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Waits {
    id: u8,
    since: Instant,
}

impl<const V: usize, const W: usize, const G: usize> Companion<V, W, G> {
    /// After the guidance's step.
    pub(crate) fn name_who_never_starts(&mut self) {
        let flies = matches!(self.state, State::Scheduled | State::Follow | State::Blocked);
        let id = if flies { self.guidance.advice.waiting_for } else { 0 };
        if id != self.waits.id || id == 0 || !self.neighbours.is_not_started(id) {
            self.waits = Waits { id, since: self.now };
        } else if self.now - self.waits.since >= NAMED_AFTER {
            self.waits.since = self.now;
            self.links.say_count(true, "Waiting for vehicle #: it has not started", [u32::from(id), 0]);
            // Full only if the shell does not drain.
            let _ = self.events.push_back(Event::WaitsForStart { id });
        }
    }
}
