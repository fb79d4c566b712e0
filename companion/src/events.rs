//! Events from the companion to its shell: everything that it passes to the shell other than bytes.

use core::sync::atomic::{AtomicU8, Ordering};

use crate::state::State;

/// One of the two communication links of a companion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// The serial port to the flight controller.
    Autopilot,
    /// The radio to the swarm and the ground station.
    Swarm,
}

/// The plan that the shell is to compute: [`crate::Companion::read_plan_inputs`] gives what the
/// planner needs for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanKind {
    /// The plan of the whole mission, for the flight from the pad.
    Mission,
    /// A detour around an obstacle, a path home, or a path aside, out of a descending vehicle's
    /// column or to a place to land at: [`crate::Companion::detour_request`] has its start, its end
    /// and its keep-out zones.
    Detour,
    /// The plan that divides the rest of an area after losses:
    /// [`crate::Companion::division_inputs`] has the state of all vehicles at each division so far.
    Division,
}

impl PlanKind {
    /// The kinds, most urgent first. A detour comes first: the vehicle that needs it may be below
    /// one that descends. The mission's plan comes last: a vehicle without one is on its pad.
    const BY_URGENCY: [Self; 3] = [Self::Detour, Self::Division, Self::Mission];

    /// The bit of this kind in `PlanRequests::waiting_kinds`.
    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// Requests that the shell has not begun to plan: at most one of each kind, since the shell reads
/// the details only when it begins.
#[derive(Debug, Default)]
pub struct PlanRequests {
    /// `PlanKind::bit` of each kind with a waiting request.
    waiting_kinds: AtomicU8,
}

impl PlanRequests {
    /// Holds no request.
    pub const fn new() -> Self {
        Self { waiting_kinds: AtomicU8::new(0) }
    }

    /// Adds a request; nothing changes if one of this kind waits already.
    pub fn add(&self, wanted: PlanKind) {
        self.waiting_kinds.fetch_or(wanted.bit(), Ordering::Relaxed);
    }

    /// Removes and returns the most urgent request; `None` when none waits.
    pub fn take(&self) -> Option<PlanKind> {
        PlanKind::BY_URGENCY.into_iter().find(|kind| {
            self.waiting_kinds.fetch_and(!kind.bit(), Ordering::Relaxed) & kind.bit() != 0
        })
    }
}

/// An event for the shell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The shell is to compute this plan and to answer with [`crate::Companion::handle_plan`].
    PlanRequested(PlanKind),
    /// The shell is to send all queued messages, then to start a new companion from the newest
    /// roadmap, mission and parameters in flash.
    RestartRequested,
    /// The mission table made a transition.
    StateChanged {
        /// State before the transition.
        from: State,
        /// State after the transition.
        to: State,
        /// STATUSTEXT of the table's row, empty if the row has none.
        text: &'static str,
        /// Whether the row's text is a warning: the mission leaves its usual course.
        warning: bool,
    },
    /// This vehicle is back on its path in a coverage mission after a detour. Waypoints that the
    /// detour passed by are not photographed; the next start of the mission flies them.
    DetourSkippedWaypoints {
        /// Number of waypoints that the detour passed by.
        count: u32,
    },
    /// This vehicle has waited for 30 s for a vehicle that was not started; repeated every 30 s
    /// while it waits.
    WaitsForUnstartedVehicle {
        /// MAVLink system id of the vehicle that was not started.
        id: u8,
    },
}

#[cfg(test)]
mod tests;
