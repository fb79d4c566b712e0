//! What decisions about detours are made from, and the place that a vehicle reports to the others.

use planner_core::Point;

use crate::autopilot::telemetry::Telemetry;
use crate::config::Config;
use crate::guidance::{Guidance, GuidanceInputs};
use crate::mission::course::Mission;
use crate::swarm::neighbours::Neighbours;
use crate::time::Instant;

/// References to the companion's parts by which decisions about detours are made.
pub(crate) struct DetourView<'a, const V: usize, const W: usize, const G: usize> {
    pub(crate) now: Instant,
    pub(crate) config: &'a Config<V>,
    pub(crate) mission: &'a Mission<W, G>,
    pub(crate) guidance: &'a Guidance,
    pub(crate) telemetry: &'a Telemetry,
    pub(crate) neighbours: &'a Neighbours<V>,
    pub(crate) scene: GuidanceInputs<'a, W, G>,
}

/// Position and velocity that this vehicle reports to the others.
pub(crate) struct ReportedPlace {
    pub(crate) position: Point,
    pub(crate) velocity: Point,
    /// When the position was measured, or last known before a jump.
    pub(crate) at: Instant,
}
