//! A planned coverage mission and its sorties.

use planner_core::coverage::area::Area;
use planner_core::coverage::pack::{Route, RoutePlan, Vehicle};
use planner_core::coverage::tracks::Tracks;
use planner_core::coverage::transit::TransitGraph;
use planner_core::map::field::follow::TerrainFollowing;

use crate::scenario::Scenario;
use crate::scenario::coverage::{self, CoverageMethod};

/// Most vehicles of a coverage mission.
pub const MAX_AREA_VEHICLES: usize = 32;
/// Most lanes over an area that the host plans.
pub const MAX_LANES: usize = 8192;
/// Most convex corners of no-fly zones that the host plans around.
pub const MAX_NO_FLY_CORNERS: usize = 256;

/// One flight of a vehicle on one battery.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sortie {
    /// The part of the vehicle's route that this sortie flies.
    pub route: Route,
    /// Number of this sortie among its vehicle's, from 1; also the number of its round.
    pub number: u16,
    /// Total number of sorties of the vehicle.
    pub sorties_of_vehicle: u16,
    /// Time at which the round of this sortie begins, seconds after the mission's start.
    pub round_begin_s: f32,
    /// Time at which the vehicle leaves its pad, seconds after the round begins.
    pub departure_delay_s: f32,
    /// Time from leaving the pad to landing on it, seconds.
    pub flight_duration_s: f32,
}

impl Sortie {
    /// Time at which the vehicle has landed, seconds after the mission's start.
    pub fn landing_s(&self) -> f32 {
        self.round_begin_s + self.departure_delay_s + self.flight_duration_s
    }
}

/// A planned coverage mission: its lanes, routes, sorties and figures.
pub struct CoveragePlan<'a> {
    /// The scenario that was planned.
    pub scenario: &'a Scenario,
    /// Section `[area]` of the scenario, with settings of the plan.
    pub area_settings: &'a coverage::AreaSection,
    /// Surface that paths follow over terrain; `None` over level ground.
    pub terrain_following: Option<TerrainFollowing<'a>>,
    /// The area's rings, checked.
    pub area: Area<'a>,
    /// Method by which the path was divided among vehicles.
    pub method: CoverageMethod,
    /// The planner's description of each vehicle, in the scenario's order.
    pub vehicles: Vec<Vehicle>,
    /// All lanes, in the order of the path.
    pub tracks: Box<Tracks<MAX_LANES>>,
    /// Shortest paths around no-fly zones.
    pub transit: Box<TransitGraph<'a, MAX_NO_FLY_CORNERS>>,
    /// Routes of the vehicles that fly, in the order of the path.
    pub plan: RoutePlan<MAX_AREA_VEHICLES>,
    /// The shares (W in paper CPP) by which companions divide the path into these routes, one for
    /// each vehicle; `None` if no shares give this plan.
    pub binpat_shares: Option<Vec<f32>>,
    /// Lower bound on the largest cost of any division of this path, seconds.
    pub lower_bound_s: f32,
    /// All sorties, by round: one for each battery; without the key `area.batteries` one for each
    /// route.
    pub sorties: Vec<Sortie>,
    /// Least planned distance between two vehicles in one round, metres; infinite for a single
    /// vehicle.
    pub closest_approach_m: f32,
    /// Computing times of lanes, of paths around no-fly zones, and of routes, seconds.
    pub computing_s: [f64; 3],
}
