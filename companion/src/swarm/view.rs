//! What decisions about other vehicles follow from, and what a vehicle reports to them.

use planner_core::Point;

use crate::autopilot::telemetry::Telemetry;
use crate::config::Config;
use crate::guidance::{Guidance, GuidanceInputs};
use crate::mission::course::Mission;
use crate::swarm::neighbours::Neighbours;
use crate::time::Instant;

/// The view that decisions about detours follow from.
pub(crate) struct DetourView<'a, const V: usize, const W: usize, const G: usize> {
    pub(crate) now: Instant,
    pub(crate) config: &'a Config<V>,
    pub(crate) mission: &'a Mission<W, G>,
    pub(crate) guidance: &'a Guidance,
    pub(crate) telemetry: &'a Telemetry,
    pub(crate) neighbours: &'a Neighbours<V>,
    pub(crate) scene: GuidanceInputs<'a, W, G>,
}

/// The place that the vehicle reports to the others.
pub(crate) struct ReportedPlace {
    pub(crate) position: Point,
    pub(crate) velocity: Point,
    /// When that was known.
    pub(crate) at: Instant,
}
