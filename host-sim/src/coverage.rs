//! Coverage missions on the host: from a scenario to each vehicle's flight.
//!
//! `planner_core::coverage` plans in memory that this module provides. Its routes become flights
//! ([`flight`]), which are exported for ground stations ([`export`]) and checked ([`check`]).

pub mod check;
pub mod export;
pub mod flight;
pub mod heights;
mod methods;
pub mod obstacles;
pub mod page;
mod planned;
pub mod report_layers;
pub mod result;
pub mod separation;
pub mod sorties;
pub mod taken;

use std::time::Instant;

use anyhow::bail;
use planner_core::Point;
use planner_core::coverage::area::{Area, Ring, RingKind};
use planner_core::coverage::bound::lower_bound_s;
use planner_core::coverage::pack::{CoverageProblem, Route, RoutePlan, TrackUnit, Vehicle};
use planner_core::coverage::tracks::{self, LanePattern, Tracks};
use planner_core::coverage::transit::TransitGraph;
use planner_core::coverage::{CoverageError, Flat, exact};
use planner_core::geo::frames::{Geodetic, enu_to_geodetic};
use planner_core::map::field::follow::TerrainFollowing;

pub use self::methods::divide_by_method;
pub use self::planned::{CoveragePlan, MAX_AREA_VEHICLES, MAX_LANES, MAX_NO_FLY_CORNERS};
use self::sorties::{BATTERY_SWAP_S, LaneTooLong, Sortie, USABLE_CHARGE};
use crate::area::MAX_VERTICES;
use crate::scenario::coverage::{AreaSection, CoverageMethod, ORIGIN_HINT};
use crate::scenario::{Scenario, VehicleSection};

/// Most changes of the lanes' order that the host tries while it shortens the path.
pub const HOST_SEARCH_STEPS: u32 = 20_000_000;

/// Heights of a start above the ground that are accepted, metres. A companion takes off only near
/// the height of its start, and a simulated vehicle cannot leave the ground from far below it.
const START_HEIGHTS_M: std::ops::RangeInclusive<f32> = -1.0..=1.5;

/// A sortie, its points, and the time at which each point is passed, seconds after the mission's
/// start.
pub type SortieFlight = (Sortie, Vec<flight::FlightPoint>, Vec<f32>);

impl<'a> CoveragePlan<'a> {
    /// Plans the coverage mission of a scenario by the given method.
    ///
    /// # Errors
    /// No plan was found; the error says why, and names the place in the scenario.
    pub fn new(scenario: &'a Scenario, method: CoverageMethod) -> anyhow::Result<Self> {
        check_starts_on_ground(scenario)?;
        Self::plan_with_search(scenario, method, HOST_SEARCH_STEPS)
    }

    /// Plans as companions do: with the scenario's method and as few changes of the lanes' order as
    /// a board tries.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn plan_as_companions(scenario: &'a Scenario) -> anyhow::Result<Self> {
        let method = scenario.area.as_ref().map(|area| area.method).unwrap_or_default();
        Self::plan_with_search(scenario, method, companion::planner::coverage::BOARD_SEARCH_STEPS)
    }

    fn plan_with_search(
        scenario: &'a Scenario,
        method: CoverageMethod,
        search_steps: u32,
    ) -> anyhow::Result<Self> {
        let Some(wanted) = &scenario.area else {
            let hint = "add `[area]` with `file = \"field.geojson\"` or `polygon = [[x, y], …]`";
            bail!("area is missing: {}\nhint: {hint}", scenario.path);
        };
        let area = Area::new(&wanted.vertices, &wanted.rings)
            .map_err(|error| anyhow::anyhow!("bad area: {}: {error:?}", wanted.file_line))?;
        let vehicles: Vec<Vehicle> =
            scenario.vehicles.iter().map(|v| planner_vehicle(v, scenario)).collect();
        check_starts_outside_zones(scenario, &area, &vehicles)?;
        let failed = |error: CoverageError| explain_error(error, wanted, scenario.vehicles.len());
        let began = Instant::now();
        let mut transit = Box::new(TransitGraph::empty());
        transit.set_area(area).map_err(failed)?;
        let ways = began.elapsed().as_secs_f64();
        let began = Instant::now();
        let tracks = build_tracks(wanted, &area, &transit, search_steps).map_err(failed)?;
        let lanes = began.elapsed().as_secs_f64();
        let following = terrain_following(wanted)?;
        let began = Instant::now();
        let work = CoverageProblem {
            tracks: &tracks,
            transit: &transit,
            vehicles: &vehicles,
            heights: wanted.heights,
            unit: if method == CoverageMethod::SimpleBinpat {
                TrackUnit::Lane
            } else {
                TrackUnit::Waypoint
            },
            following,
        };
        let mut plan = RoutePlan::new();
        let shares = divide_by_method(&work, method, &mut plan).map_err(failed)?;
        let routes = began.elapsed().as_secs_f64();
        let lower_bound_s = lower_bound_s(&work).map_err(failed)?;
        let seconds = [lanes, ways, routes];
        let mut planned = Self {
            scenario,
            area_settings: wanted,
            terrain_following: following,
            area,
            method,
            vehicles,
            tracks,
            transit,
            sorties: Vec::new(),
            closest_approach_m: f32::INFINITY,
            plan,
            binpat_shares: shares,
            lower_bound_s,
            computing_s: seconds,
        };
        planned.sorties = match wanted.allows_battery_swaps {
            true => planned.cut_into_sorties()?,
            false => planned.one_sortie_per_route()?,
        };
        planned.check_fence()?;
        planned.set_departures()?;
        Ok(planned)
    }

    /// Latitude and longitude of a point of the plan, taken at the origin's altitude; `place.z` is
    /// not used. ENU heights cannot be used far away: the plane that touches the earth at the
    /// origin is 780 m above the ground 100 km away.
    pub fn geodetic_at_origin_altitude(&self, place: &Point) -> Geodetic {
        let origin = &self.area_settings.origin;
        let mut up_m = 0.0;
        let mut found = enu_to_geodetic(origin, &Point::new(place.x, place.y, up_m));
        for _ in 0..3 {
            up_m -= (found.alt_m - origin.alt_m) as f32;
            found = enu_to_geodetic(origin, &Point::new(place.x, place.y, up_m));
        }
        found
    }

    /// The flight of each sortie: its points, and the time at which each is passed, seconds after
    /// the mission's start.
    pub fn flights(&self) -> Vec<SortieFlight> {
        let flight = |sortie: &Sortie| {
            let points = flight::flight_points(self, &sortie.route);
            let mut times_s = flight::passing_times_s(self, &sortie.route, &points);
            let departure_s = sortie.round_begin_s + sortie.departure_delay_s;
            times_s.iter_mut().for_each(|time| *time += departure_s);
            (*sortie, points, times_s)
        };
        self.sorties.iter().map(flight).collect()
    }

    /// The sorties of a route's vehicle, in the order in which they are flown.
    pub fn sorties_of(&self, route: &Route) -> impl Iterator<Item = &Sortie> {
        self.sorties.iter().filter(|sortie| sortie.route.vehicle_index == route.vehicle_index)
    }

    /// Cost of a route: all its sorties and the battery swaps between them, seconds.
    pub fn sorties_and_swaps_cost_s(&self, route: &Route) -> f32 {
        let swaps = self.sorties_of(route).count().saturating_sub(1) as f32;
        self.sorties_of(route).map(|sortie| sortie.route.cost_s).sum::<f32>()
            + swaps * BATTERY_SWAP_S
    }

    /// Cost of a route: the lengths of all its sorties, metres.
    pub fn sorties_cost_m(&self, route: &Route) -> f32 {
        self.sorties_of(route).map(|sortie| sortie.route.cost_m).sum()
    }

    /// The largest cost of a route, seconds.
    pub fn max_sorties_and_swaps_cost_s(&self) -> f32 {
        let cost_s = |route: &Route| self.sorties_and_swaps_cost_s(route);
        self.plan.routes.iter().map(cost_s).fold(0.0, f32::max)
    }

    /// Cuts each route into sorties that a battery lasts for; sorted by round.
    fn cut_into_sorties(&self) -> anyhow::Result<Vec<Sortie>> {
        let mut sorties = Vec::new();
        for route in &self.plan.routes {
            let index = usize::from(route.vehicle_index);
            let vehicle = &self.scenario.vehicles[index];
            let lasts_s = vehicle.battery_hover_s();
            let too_long = |error: LaneTooLong| {
                anyhow::anyhow!(
                    "battery too small: {}: vehicle {} would fly {:.0} s for lane {} alone; its battery lasts {lasts_s:.0} s, \
                     and {:.0} % of that are for the landing\nhint: a place nearer to the area, another angle_deg, or a higher \
                     cruise_mps",
                    self.scenario.vehicle_file_lines[index],
                    vehicle.id,
                    error.takes_s,
                    error.lane + 1,
                    100.0 * (1.0 - USABLE_CHARGE)
                )
            };
            let parts =
                sorties::cut_route(self, route, USABLE_CHARGE * lasts_s).map_err(too_long)?;
            let of = parts.len() as u16;
            let numbered = parts.into_iter().zip(1..);
            sorties.extend(numbered.map(|(route, number)| Sortie {
                number,
                sorties_of_vehicle: of,
                ..sorties::whole_route_sortie(self, route)
            }));
        }
        sorties.sort_by_key(|sortie| sortie.number);
        Ok(sorties)
    }

    /// Delays the departures of each round until planned flights keep the separation from each
    /// other; sets the times of the rounds.
    fn set_departures(&mut self) -> anyhow::Result<()> {
        let flights = self.flights();
        let separation_m = self.scenario.deconfliction.separation_m;
        let mut begin_s = 0.0;
        for round in flights.chunk_by(|a, b| a.0.number == b.0.number) {
            let timed: Vec<_> = round
                .iter()
                .map(|(_, points, times_s)| separation::DepartureFlight { points, times_s })
                .collect();
            let Some((departures_s, least_m)) = separation::plan_departures(&timed, separation_m)
            else {
                bail!(
                    "cannot keep vehicles apart: {}: no order of departures keeps {separation_m} m between them\nhint: \
                     fewer vehicles, or places further apart",
                    self.area_settings.file_line
                );
            };
            self.closest_approach_m = self.closest_approach_m.min(least_m);
            let own = self.sorties.iter_mut().filter(|sortie| sortie.number == round[0].0.number);
            let mut end_s = begin_s;
            for (sortie, depart_s) in own.zip(departures_s) {
                (sortie.round_begin_s, sortie.departure_delay_s) = (begin_s, depart_s);
                end_s = sortie.landing_s().max(end_s);
            }
            begin_s = end_s + BATTERY_SWAP_S;
        }
        Ok(())
    }

    /// Refuses a plan in which a vehicle would leave the geofence: companions, and autopilots with
    /// that fence, would land there.
    fn check_fence(&self) -> anyhow::Result<()> {
        let Some(fence) = &self.scenario.mission.geofence else { return Ok(()) };
        for sortie in &self.sorties {
            let points = flight::flight_points(self, &sortie.route);
            let Some(point) = points.iter().find(|point| !fence.contains(&point.position)) else {
                continue;
            };
            let (place, index) = (point.position, usize::from(sortie.route.vehicle_index));
            bail!(
                "outside mission.geofence: {}: vehicle {} would fly to [{:.1}, {:.1}, {:.1}]\nhint: a geofence around area \
                 and pads, up to the highest layer, or a smaller area",
                self.scenario.vehicle_file_lines[index],
                self.scenario.vehicles[index].id,
                place.x,
                place.y,
                place.z
            );
        }
        Ok(())
    }

    /// One sortie for each route. Refuses a route that takes longer than the usable share of its
    /// vehicle's `endurance_s`, where the scenario gives one.
    fn one_sortie_per_route(&self) -> anyhow::Result<Vec<Sortie>> {
        for route in &self.plan.routes {
            let index = usize::from(route.vehicle_index);
            let vehicle = &self.scenario.vehicles[index];
            let takes_s = sorties::route_duration_s(self, route);
            let too_long = |endurance_s: &f32| takes_s > USABLE_CHARGE * endurance_s;
            let Some(endurance_s) = vehicle.hover_endurance_s.filter(too_long) else { continue };
            bail!(
                "area too large: {}: vehicle {} would fly {takes_s:.0} s; its endurance_s is {endurance_s:.0}, and {:.0} % of \
                 that are for the landing\nhint: more vehicles, wider lanes, a higher cruise_mps and speed_max_mps take less time; \
                 area.batteries = true plans sorties",
                self.scenario.vehicle_file_lines[index],
                vehicle.id,
                100.0 * (1.0 - USABLE_CHARGE)
            );
        }
        Ok(self.plan.routes.iter().map(|route| sorties::whole_route_sortie(self, *route)).collect())
    }
}

/// The surface that vehicles follow above terrain; none above level ground.
fn terrain_following(wanted: &AreaSection) -> anyhow::Result<Option<TerrainFollowing<'_>>> {
    let following =
        wanted.terrain.as_ref().map(|t| t.following(wanted.picture_height_m)).transpose();
    following.map_err(|error| anyhow::anyhow!("bad field: {}: {error}", wanted.file_line))
}

/// The lanes of an area, in the best order of those that are tried.
fn build_tracks(
    wanted: &AreaSection,
    area: &Area<'_>,
    transit: &TransitGraph<'_, MAX_NO_FLY_CORNERS>,
    max_search_steps: u32,
) -> Result<Box<Tracks<MAX_LANES>>, CoverageError> {
    let (spacing, angle_from_east_deg) = (wanted.usable_spacing, wanted.lane_angle_deg);
    let border_overshoot_m = wanted.border_overshoot_m;
    let pattern =
        LanePattern { spacing, angle_from_east_deg, border_overshoot_m, max_search_steps };
    let mut tracks = Box::new(Tracks::new());
    let mut workspace = Box::new(tracks::LaneWorkspace::<MAX_VERTICES>::new());
    tracks::build_lanes(area, &pattern, transit, &mut workspace, &mut tracks)?;
    Ok(tracks)
}

/// Checks that every vehicle starts at most 1.5 m above and 1 m below the ground: with more error
/// of its height a companion does not take off, and heights in written plans count from the pad.
///
/// # Errors
/// A vehicle starts too far above or below the ground; the error names it.
pub fn check_starts_on_ground(scenario: &Scenario) -> anyhow::Result<()> {
    let Some(area) = &scenario.area else { return Ok(()) };
    let above_m = |v: &VehicleSection| v.start.z - area.ground_height_m(&v.start.xy());
    let stray = |v: &VehicleSection| !START_HEIGHTS_M.contains(&above_m(v));
    if let Some(index) = scenario.vehicles.iter().position(stray) {
        let vehicle = &scenario.vehicles[index];
        bail!(
            "bad vehicle: {}: vehicle {} starts {:.1} m {} the ground\nhint: pads stand on the ground; z of a start counts from the origin; {ORIGIN_HINT}",
            scenario.vehicle_file_lines[index],
            vehicle.id,
            above_m(vehicle).abs(),
            if above_m(vehicle) < 0.0 { "below" } else { "above" }
        );
    }
    Ok(())
}

/// Checks that no vehicle starts inside a no-fly zone.
fn check_starts_outside_zones(
    scenario: &Scenario,
    area: &Area<'_>,
    vehicles: &[Vehicle],
) -> anyhow::Result<()> {
    let ids = scenario.vehicles.iter().map(|vehicle| vehicle.id);
    let given = scenario.area.as_ref().map_or(0, |area| area.given_no_fly_zones);
    for ((vehicle, place), id) in vehicles.iter().zip(&scenario.vehicle_file_lines).zip(ids) {
        match no_fly_zone_at(area, &vehicle.transit_start) {
            None => {}
            Some(zone) if zone < given => {
                bail!("bad vehicle: {place}: vehicle {id} starts inside no-fly zone {zone}")
            }
            Some(_) => bail!(
                "bad vehicle: {place}: vehicle {id} starts inside the no-fly zone around an \
                 obstacle of the map"
            ),
        }
    }
    Ok(())
}

/// Index of the first no-fly zone that contains a place, among the area's no-fly zones; `None` if
/// none does.
fn no_fly_zone_at(area: &Area<'_>, place: &Flat) -> Option<usize> {
    let zones = area.rings().iter().enumerate().filter(|(_, ring)| ring.kind == RingKind::NoFly);
    let holds = |(index, _): (usize, &Ring)| {
        let corners = area.ring(index);
        let alone = [Ring { end: corners.len() as u16, kind: RingKind::Outer }];
        Area::new(corners, &alone).is_ok_and(|zone| zone.contains(place))
    };
    zones.map(holds).position(|holds| holds)
}

/// The planner's description of a vehicle: pad, speeds and weight.
fn planner_vehicle(vehicle: &VehicleSection, scenario: &Scenario) -> Vehicle {
    let place = vehicle.start.xy();
    let [climb_mps, descend_mps] = vehicle.climb_and_descent_mps();
    Vehicle {
        transit_start: place,
        home: place,
        cruise_mps: scenario.mission.cruise_mps.min(vehicle.speed_max_mps),
        climb_mps,
        descend_mps,
        weight: vehicle.weight.unwrap_or(1.0),
    }
}

/// The error text for a coverage plan that failed, with the place in the scenario.
fn explain_error(error: CoverageError, wanted: &AreaSection, vehicles: usize) -> anyhow::Error {
    let place = &wanted.file_line;
    let why = match error {
        CoverageError::Area(area) => format!("{area:?}"),
        CoverageError::SettingOutOfRange(name) => format!("{name} is out of its range"),
        CoverageError::Gaps => "the spacings leave gaps between the pictures".to_owned(),
        CoverageError::LanesFull => {
            format!(
                "it takes more than {MAX_LANES} lanes\nhint: a greater height_m or lane_m takes fewer"
            )
        }
        CoverageError::NoFlyFull => {
            format!(
                "no-fly zones have more than {MAX_NO_FLY_CORNERS} convex corners\nhint: draw them with fewer"
            )
        }
        CoverageError::NothingToCover if wanted.obstacles.is_some() => {
            "no-fly zones hold the whole area: the map's obstacles are as high as the pictures\nhint: a greater height_m"
                .to_owned()
        }
        CoverageError::NothingToCover => "no-fly zones hold the whole area".to_owned(),
        CoverageError::InsideNoFly(index) => format!("vehicle {index} starts inside a no-fly zone"),
        CoverageError::Unreachable => "no-fly zones leave no way to a part of it".to_owned(),
        CoverageError::Vehicles => {
            let is_too_many = vehicles > MAX_AREA_VEHICLES;
            let most = if is_too_many { MAX_AREA_VEHICLES } else { exact::MAX_EXACT_VEHICLES };
            format!("it takes 1 to {most} vehicles, not {vehicles}")
        }
        CoverageError::WorkspaceTooSmall => "the planner's memory is too small for it".to_owned(),
    };
    anyhow::anyhow!("cannot cover the area: {place}: {why}")
}

#[cfg(test)]
mod tests;
