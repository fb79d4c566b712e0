//! What passes between the companion and its shell beside bytes.

use core::sync::atomic::{AtomicU8, Ordering};

use crate::mission::State;

/// One of the two ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// The serial port to the flight controller.
    Autopilot,
    /// The radio to the swarm and the ground station.
    Swarm,
}

/// The plan that the shell is to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanKind {
    /// The mission's plan.
    Mission,
    /// A detour, or aside: [`crate::Companion::detour_request`] says from where and around what.
    Detour,
    /// The mission's plan after losses: [`crate::Companion::losses`] says which.
    Division,
}

impl PlanKind {
    /// A vehicle that asks for a detour may be below one that comes down; one without a mission is
    /// on its pad.
    const BY_URGENCY: [Self; 3] = [Self::Detour, Self::Division, Self::Mission];

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// Plans that the shell has not begun: at most one of each kind, since it reads what to plan when
/// it begins.
#[derive(Debug, Default)]
pub struct PlanRequests {
    waiting: AtomicU8,
}

impl PlanRequests {
    /// Without a request.
    pub const fn new() -> Self {
        Self { waiting: AtomicU8::new(0) }
    }

    /// Notes that a plan is wanted.
    pub fn add(&self, wanted: PlanKind) {
        self.waiting.fetch_or(wanted.bit(), Ordering::Relaxed);
    }

    /// The most urgent plan, which is wanted no longer.
    pub fn take(&self) -> Option<PlanKind> {
        PlanKind::BY_URGENCY
            .into_iter()
            .find(|kind| self.waiting.fetch_and(!kind.bit(), Ordering::Relaxed) & kind.bit() != 0)
    }
}

/// An event for the shell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Plan this, and answer with [`crate::Companion::handle_plan`].
    PlanRequested(PlanKind),
    /// Send what waits, then start the companion again, from the newest roadmap, mission and
    /// parameters.
    RestartRequested,
    /// The mission moved on.
    StateChanged {
        /// Before.
        from: State,
        /// After.
        to: State,
        /// The row's text, empty if it has none.
        text: &'static str,
        /// Whether the row is a warning: the mission leaves its usual course.
        warning: bool,
    },
    /// It is back on its path over a field, and leaves out so many waypoints that it flew around:
    /// the next start flies them.
    FlownAround {
        /// Number of waypoints.
        left: u32,
    },
    /// The mission waits for a vehicle that has not started.
    WaitsForStart {
        /// The command's MAVLink system id.
        id: u8,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_request_of_a_plan_replaces_one_of_another_kind() {
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2], [1, 2, 0]] {
            let requests = PlanRequests::new();
            order
                .into_iter()
                .chain([1, 1])
                .for_each(|at: usize| requests.add(PlanKind::BY_URGENCY[at]));
            let [detour, division, mission] = PlanKind::BY_URGENCY.map(Some);
            let taken = [(); 4].map(|()| requests.take());
            assert_eq!(taken, [detour, division, mission, None], "{order:?}");
        }
    }
}
