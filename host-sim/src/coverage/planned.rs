//! What a coverage plan holds.

use planner_core::coverage::area::Area;
use planner_core::coverage::pack::{Plan, Route, Vehicle};
use planner_core::coverage::tracks::Tracks;
use planner_core::coverage::transit::Transit;
use planner_core::field::follow::TerrainFollowing;

use crate::scenario::Scenario;
use crate::scenario::coverage::{self, Method};

/// Most vehicles of a coverage mission.
pub const MAX_VEHICLES: usize = 32;
/// Most lanes on the desk.
pub const MAX_LANES: usize = 8192;
/// Most outward corners of no-fly zones on the desk.
pub const MAX_CORNERS: usize = 256;

/// Flight of a vehicle on one battery.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sortie {
    /// The sortie's part of the vehicle's route.
    pub route: Route,
    /// Which one of its vehicle, from 1; also its round.
    pub number: u16,
    /// Number of sorties of the vehicle.
    pub of: u16,
    /// When its round begins, seconds.
    pub begin_s: f32,
    /// When it leaves its pad, seconds after that.
    pub depart_s: f32,
    /// Time from pad to pad, seconds.
    pub flown_s: f32,
}

impl Sortie {
    /// When its vehicle has landed, seconds.
    pub fn end_s(&self) -> f32 {
        self.begin_s + self.depart_s + self.flown_s
    }
}

/// A planned coverage mission.
pub struct CoveragePlan<'a> {
    /// Scenario of the plan.
    pub scenario: &'a Scenario,
    /// Section `[area]` of the scenario.
    pub wanted: &'a coverage::Area,
    /// Surface that vehicles follow above terrain.
    pub following: Option<TerrainFollowing<'a>>,
    /// Area of the plan.
    pub area: Area<'a>,
    /// How work was divided.
    pub method: Method,
    /// Vehicles as the planner sees them, in the scenario's order.
    pub vehicles: Vec<Vehicle>,
    /// The lanes.
    pub tracks: Box<Tracks<MAX_LANES>>,
    /// Ways around no-fly zones.
    pub transit: Box<Transit<'a, MAX_CORNERS>>,
    /// The routes.
    pub plan: Plan<MAX_VEHICLES>,
    /// The shares W that they are packed by, one a vehicle; none where they follow from nothing of
    /// the kind.
    pub shares: Option<Vec<f32>>,
    /// No division can end before, seconds.
    pub lower_bound_s: f32,
    /// Sorties of the vehicles, one for each battery, by round; without `batteries` each sortie is
    /// a whole route.
    pub sorties: Vec<Sortie>,
    /// The least distance between two vehicles, as planned; infinite for one.
    pub least_separation_m: f32,
    /// Computing time of lanes, transits and routes, seconds.
    pub seconds: [f64; 3],
}
