//! What passes between the companion and its shell beside bytes.

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

/// An event for the shell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Plan this, and answer with [`crate::Companion::handle_plan`].
    PlanRequested(PlanKind),
    /// Send what waits, then start the companion again, from the newest roadmap, mission and parameters.
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
    /// It is back on its path over a field, and leaves out so many waypoints that it flew around: the next start flies them.
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
