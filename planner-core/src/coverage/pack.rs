//! SIMPLE-BINPAT and BINPAT: the path is cut into contiguous routes, which are assigned to
//! vehicles.
//!
//! Source: paper CPP §3.2.2, Algorithms 1 and 2 as SPEC §7 reads them. CBinPack fills bin after bin
//! with tracks until the bin's share of the path's length is reached. The track that would exceed
//! the share goes in only if the result is nearer to the share. The last bin with a share gets the
//! rest. Bins are assigned to vehicles by linear sum assignment of transit lengths: from the
//! vehicle's place to the first waypoint and from the last one home, in the shorter of both
//! directions. The route that takes longest gets the lowest transit layer, and so on. Climb and
//! descent take `H_d = (h_m + Δh) / V_a + (h_m + Δh) / V_d` (paper CPP eq. 4).
//!
//! Δh, from picture height to the layer, is at least one layer spacing, so a vehicle in transit is
//! never at the height at which others photograph.
//!
//! Cost for K vehicles and n lanes: K · log n steps, K² transits, one assignment (K³).

mod extra_descent;
mod route_ends;

use heapless::Vec;
use libm::fmaxf;

use self::route_ends::RouteEnds;
use super::tracks::{Lane, Tracks};
use super::transit::TransitGraph;
use super::{CoverageError, Flat};
use crate::assignment::{AssignmentWorkspace, assign};
use crate::map::field::follow::TerrainFollowing;

/// A vehicle as packing sees it: ends of its transits, speeds, weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vehicle {
    /// Place where the vehicle begins its transit to the first waypoint, east and north.
    pub transit_start: Flat,
    /// Place where the vehicle's transit home ends, east and north.
    pub home: Flat,
    /// Cruise speed over ground, m/s.
    pub cruise_mps: f32,
    /// Speed of climb (V_a in the paper), m/s.
    pub climb_mps: f32,
    /// Speed of descent (V_d in the paper), m/s.
    pub descend_mps: f32,
    /// W_k: the vehicle's share of the path is this weight divided by the sum of all vehicles'
    /// weights.
    pub weight: f32,
}

/// Heights of a coverage mission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heights {
    /// h_m of paper CPP: height at which pictures are taken, metres up in the mission frame; above
    /// terrain the greatest that paths may have.
    pub max_picture_height_m: f32,
    /// Vertical distance between neighbouring transit layers, metres.
    pub layer_spacing_m: f32,
}

/// What a track is: the smallest part of the path that goes to one vehicle as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackUnit {
    /// A whole lane: the simple back-and-forth pattern, SIMPLE-BINPAT.
    Lane,
    /// A waypoint and the step that leads to it: the sampled pattern, BINPAT.
    Waypoint,
}

/// Direction in which a route is flown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RouteDirection {
    /// In ascending order of waypoint numbers.
    Forward,
    /// In descending order of waypoint numbers.
    Backward,
}

/// The route of one vehicle: all waypoints with numbers `lowest_waypoint` to `waypoint_end` − 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Route {
    /// Index of the vehicle in [`CoverageProblem::vehicles`].
    pub vehicle_index: u8,
    /// Lowest waypoint number of the route.
    pub lowest_waypoint: u32,
    /// Highest waypoint number of the route plus one.
    pub waypoint_end: u32,
    /// Direction in which the route is flown.
    pub direction: RouteDirection,
    /// Transit layer, from 1: it is this many times [`Heights::layer_spacing_m`] above the height
    /// of pictures.
    pub layer: u8,
    /// Length over ground, metres: transit to the first waypoint, route, transit home.
    pub ground_length_m: f32,
    /// `ground_length_m` with climb and descent, metres.
    pub cost_m: f32,
    /// C_k: `ground_length_m` at cruise speed, H_d, extra descent and climb over terrain, seconds.
    pub cost_s: f32,
}

impl Route {
    /// Numbers of the first and the last waypoint in the direction of flight.
    pub fn first_and_last(&self) -> (u32, u32) {
        let last = self.waypoint_end.saturating_sub(1);
        match self.direction {
            RouteDirection::Forward => (self.lowest_waypoint, last),
            RouteDirection::Backward => (last, self.lowest_waypoint),
        }
    }

    /// Waypoint numbers in the order in which they are flown.
    pub fn waypoints(&self) -> impl Iterator<Item = u32> + use<> {
        let Self { lowest_waypoint: first, waypoint_end: end, direction, .. } = *self;
        (first..end).map(move |i| match direction {
            RouteDirection::Forward => i,
            RouteDirection::Backward => end - 1 - (i - first),
        })
    }
}

/// The division of a path: at most one route per vehicle, in the order of the path. A vehicle
/// without a route stays on its pad, or flies home if it is in the air.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoutePlan<const K: usize> {
    /// The routes, in the order of the path.
    pub routes: Vec<Route, K>,
}

impl<const K: usize> RoutePlan<K> {
    /// Creates a plan without routes.
    pub const fn new() -> Self {
        Self { routes: Vec::new() }
    }

    /// max C_k, seconds: when the last vehicle lands if all take off at once.
    pub fn max_cost_s(&self) -> f32 {
        self.routes.iter().map(|route| route.cost_s).fold(0.0, fmaxf)
    }
}

/// Memory for packing with at most `K` vehicles.
pub struct PackWorkspace<const K: usize> {
    /// For each bin, by vehicle: length of both transits, metres; infinite for one not eligible.
    transits_m: Vec<f32, 1024>,
    /// For each bin that is not empty, the index of its vehicle.
    assigned_vehicles: [Option<u16>; K],
    assignment: AssignmentWorkspace<K>,
    /// For each bin, the number of its last waypoint plus one.
    bin_ends: [u32; K],
    pub(super) shares: [f32; K],
}

impl<const K: usize> PackWorkspace<K> {
    /// Creates an empty workspace: all zeros.
    pub const fn new() -> Self {
        assert!(K * K <= 1024, "the cost matrix has room for 32 vehicles");
        Self {
            transits_m: Vec::new(),
            assigned_vehicles: [None; K],
            assignment: AssignmentWorkspace::new(),
            bin_ends: [0; K],
            shares: [0.0; K],
        }
    }

    /// The shares of the path by which the bins were last filled; only their ratios count.
    pub fn shares(&self) -> &[f32; K] {
        &self.shares
    }
}

impl<const K: usize> Default for PackWorkspace<K> {
    fn default() -> Self {
        Self::new()
    }
}

/// What is to be divided: the path, the transits around no-fly zones, vehicles and heights.
#[derive(Clone, Copy)]
pub struct CoverageProblem<'a, const L: usize, const N: usize> {
    /// The lanes and the path along them.
    pub tracks: &'a Tracks<L>,
    /// Shortest paths around no-fly zones.
    pub transit: &'a TransitGraph<'a, N>,
    /// The vehicles among which the path is divided.
    pub vehicles: &'a [Vehicle],
    /// Heights of pictures and of transit layers.
    pub heights: Heights,
    /// What a track is: a lane or a waypoint.
    pub unit: TrackUnit,
    /// The surface that the vehicles follow above terrain; `None` above level ground.
    pub following: Option<TerrainFollowing<'a>>,
}

impl<const L: usize, const N: usize> CoverageProblem<'_, L, N> {
    /// Checks that all settings are in range.
    ///
    /// # Errors
    /// [`CoverageError::SettingOutOfRange`] with the setting's name; [`CoverageError::Vehicles`]
    /// for no vehicle or more than `K`; [`CoverageError::NothingToCover`] without lanes.
    pub fn check<const K: usize>(&self) -> Result<(), CoverageError> {
        if self.vehicles.is_empty() || self.vehicles.len() > K.min(usize::from(u8::MAX)) {
            return Err(CoverageError::Vehicles);
        }
        if self.tracks.lanes().is_empty() {
            return Err(CoverageError::NothingToCover);
        }
        let Heights { max_picture_height_m, layer_spacing_m } = self.heights;
        let heights = [("height_m", max_picture_height_m), ("layer_m", layer_spacing_m)];
        crate::check_positive(&heights).map_err(|e| CoverageError::SettingOutOfRange(e.0))?;
        for vehicle in self.vehicles {
            let speeds = [
                ("cruise_mps", vehicle.cruise_mps),
                ("climb_mps", vehicle.climb_mps),
                ("descend_mps", vehicle.descend_mps),
            ];
            crate::check_positive(&speeds).map_err(|e| CoverageError::SettingOutOfRange(e.0))?;
            if !(vehicle.weight >= 0.0 && vehicle.weight.is_finite()) {
                return Err(CoverageError::SettingOutOfRange("weight"));
            }
            if !(vehicle.transit_start.norm_squared() + vehicle.home.norm_squared()).is_finite() {
                return Err(CoverageError::SettingOutOfRange("place"));
            }
        }
        if self.vehicles.iter().all(|vehicle| vehicle.weight == 0.0) {
            return Err(CoverageError::SettingOutOfRange("weight"));
        }
        Ok(())
    }

    /// H_d: time that a vehicle takes to climb to a layer and to descend from it, seconds.
    pub fn altitude_delay_s(&self, vehicle: &Vehicle, layer: u8) -> f32 {
        let top_m =
            self.heights.max_picture_height_m + f32::from(layer) * self.heights.layer_spacing_m;
        top_m / vehicle.climb_mps + top_m / vehicle.descend_mps
    }

    /// The ends of the part of the path with waypoints `first` to `end` − 1.
    #[inline(never)]
    pub(super) fn route_ends(&self, first: u32, end: u32) -> RouteEnds {
        let place = |number| self.tracks.waypoint(number).unwrap_or_default();
        RouteEnds {
            lowest: place(first),
            highest: place(end - 1),
            between_m: self.tracks.distance_to_waypoint_m(end - 1)
                - self.tracks.distance_to_waypoint_m(first),
        }
    }

    /// Length over ground of a vehicle's flight along a route with these ends, metres, and the
    /// direction in which it takes less time.
    #[inline(never)]
    pub(super) fn ground_length_and_direction(
        &self,
        vehicle: &Vehicle,
        ends: &RouteEnds,
    ) -> (f32, RouteDirection) {
        let transit_m = |from: &Flat, to: &Flat| {
            self.transit.distance_m(&vehicle.transit_start, from)
                + self.transit.distance_m(to, &vehicle.home)
        };
        let forward = transit_m(&ends.lowest, &ends.highest);
        let backward = if vehicle.transit_start == vehicle.home {
            // Both transits have the same ends in either direction.
            forward
        } else {
            transit_m(&ends.highest, &ends.lowest)
        };
        let (forward_s, backward_s) = self.extra_vertical_times_s(vehicle, ends);
        match backward + backward_s * vehicle.cruise_mps < forward + forward_s * vehicle.cruise_mps
        {
            true => (backward + ends.between_m, RouteDirection::Backward),
            false => (forward + ends.between_m, RouteDirection::Forward),
        }
    }
}

/// BINPAT, or SIMPLE-BINPAT where a track is a lane, with the vehicles' weights as shares.
///
/// # Errors
/// Those of [`CoverageProblem::check`]; [`CoverageError::Unreachable`] if no path leads to a route.
pub fn binpat<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    ws: &mut PackWorkspace<K>,
    out: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    problem.check::<K>()?;
    for (share, vehicle) in ws.shares.iter_mut().zip(problem.vehicles) {
        *share = vehicle.weight;
    }
    let alike = problem.vehicles.iter().all(|vehicle| vehicle.weight == problem.vehicles[0].weight);
    let bins = if alike { BinEligibility::Anyone } else { BinEligibility::SameWeight };
    pack_routes(problem, bins, ws, out)
}

/// BINPAT with given shares, such as those that POWELL found: any vehicle may get any bin.
///
/// # Errors
/// Those of [`CoverageProblem::check`]; [`CoverageError::SettingOutOfRange`] unless there is one
/// share per vehicle, all finite and at least 0, and not all 0.
pub fn binpat_by_shares<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    shares: &[f32],
    ws: &mut PackWorkspace<K>,
    out: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    problem.check::<K>()?;
    let sound = |share: &f32| *share >= 0.0 && share.is_finite();
    let some = shares.iter().any(|share| *share > 0.0);
    if shares.len() != problem.vehicles.len() || !shares.iter().all(sound) || !some {
        return Err(CoverageError::SettingOutOfRange("shares"));
    }
    ws.shares[..shares.len()].copy_from_slice(shares);
    pack_routes(problem, BinEligibility::Anyone, ws, out)
}

/// Which vehicles may be assigned a bin.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum BinEligibility {
    /// Any vehicle.
    Anyone,
    /// Only vehicles of the weight by which the bin was filled.
    SameWeight,
}

/// Cuts the path into bins by `ws.shares`, assigns the bins to vehicles, and sets layers and costs.
pub(super) fn pack_routes<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    bins: BinEligibility,
    ws: &mut PackWorkspace<K>,
    out: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    let count = problem.vehicles.len();
    cbinpack(problem.tracks, problem.unit, &ws.shares[..count], &mut ws.bin_ends[..count]);
    assign_bins_to_vehicles(problem, bins, ws, out)?;
    set_layers_and_costs(problem, out);
    Ok(())
}

/// CBinPack of paper CPP: cuts the path into consecutive bins. Bin `k` gets the fraction
/// `shares[k]` / Σ `shares` of the path's length; `ends[k]` becomes the number of its last waypoint
/// plus one.
pub fn cbinpack<const L: usize>(
    tracks: &Tracks<L>,
    unit: TrackUnit,
    shares: &[f32],
    ends: &mut [u32],
) {
    let whole: f32 = shares.iter().sum();
    let total_m = tracks.length_m();
    let last = shares.iter().rposition(|share| *share > 0.0).unwrap_or(0);
    let mut end = 0;
    // Length of the path up to the end of the last track that was packed.
    let mut packed_m = 0.0;
    for (k, (share, slot)) in shares.iter().zip(ends).enumerate() {
        if k >= last {
            end = tracks.waypoint_count();
        } else if *share > 0.0 {
            (end, packed_m) = fill_bin(tracks, unit, end, packed_m + total_m * share / whole);
        }
        *slot = end;
    }
}

/// Fills a bin with tracks from waypoint `from` on, up to the length `full_m` of the path. Returns
/// the number of its last waypoint plus one, and the length of the path up to that waypoint.
fn fill_bin<const L: usize>(
    tracks: &Tracks<L>,
    unit: TrackUnit,
    from: u32,
    full_m: f32,
) -> (u32, f32) {
    let lanes = tracks.lanes();
    // The lane in which the bin becomes full.
    let lane = lanes.partition_point(|lane| lane.start_along_m + lane.length_m() <= full_m);
    let before = |lane: usize| {
        let end = lanes.get(lane).map_or(tracks.waypoint_count(), |lane| lane.first_waypoint);
        let last = lane.checked_sub(1).map(|lane| &lanes[lane]);
        (end, last.map_or(0.0, |lane| lane.start_along_m + lane.length_m()))
    };
    let (fits, more) = match (unit, lanes.get(lane)) {
        (_, None) => return before(lane),
        (TrackUnit::Lane, Some(_)) => (before(lane), before(lane + 1)),
        (TrackUnit::Waypoint, Some(inside)) => {
            let step_m = inside.length_m() / fmaxf((inside.waypoint_count - 1) as f32, 1.0);
            let into_m = full_m - inside.start_along_m;
            if into_m < 0.0 {
                (before(lane), (inside.first_waypoint + 1, inside.start_along_m))
            } else {
                let k = if step_m > 0.0 { (into_m / step_m) as u32 } else { 0 };
                let &Lane { first_waypoint, waypoint_count, start_along_m, .. } = inside;
                let at = |k: u32| (first_waypoint + k + 1, start_along_m + step_m * k as f32);
                let k = k.min(waypoint_count - 1);
                (at(k), at((k + 1).min(waypoint_count - 1)))
            }
        }
    };
    let nearer = more.1 - full_m < full_m - fits.1;
    let best = if nearer { more } else { fits };
    // A bin never ends before the end of the bin before it.
    if best.0 >= from {
        best
    } else {
        (from, if from > 0 { tracks.distance_to_waypoint_m(from - 1) } else { 0.0 })
    }
}

/// Assigns each bin that is not empty to a vehicle so that the sum of all transits is least.
fn assign_bins_to_vehicles<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    bins: BinEligibility,
    ws: &mut PackWorkspace<K>,
    out: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    let count = problem.vehicles.len();
    out.routes.clear();
    ws.transits_m.clear();
    let mut start = 0;
    for k in 0..count {
        let end = ws.bin_ends[k];
        if end <= start {
            continue;
        }
        let route = Route {
            vehicle_index: 0,
            lowest_waypoint: start,
            waypoint_end: end,
            direction: RouteDirection::Forward,
            layer: 0,
            ground_length_m: 0.0,
            cost_m: 0.0,
            cost_s: 0.0,
        };
        let ends = problem.route_ends(start, end);
        for vehicle in problem.vehicles {
            let may =
                bins == BinEligibility::Anyone || vehicle.weight == problem.vehicles[k].weight;
            let ground = problem.ground_length_and_direction(vehicle, &ends).0;
            let _ = ws.transits_m.push(if may { ground - ends.between_m } else { f32::INFINITY });
        }
        out.routes.push(route).map_err(|_| CoverageError::Vehicles)?;
        start = end;
    }
    let rows = out.routes.len();
    let columns = &mut ws.assigned_vehicles[..rows];
    let found = assign(&ws.transits_m, rows, count, &mut ws.assignment, columns);
    if found.map_err(|_| CoverageError::WorkspaceTooSmall)?.pair_count < rows {
        return Err(CoverageError::Unreachable);
    }
    for (row, route) in out.routes.iter_mut().enumerate() {
        let vehicle = usize::from(ws.assigned_vehicles[row].ok_or(CoverageError::Unreachable)?);
        route.vehicle_index = vehicle as u8;
        (route.ground_length_m, route.direction) = problem.ground_length_and_direction(
            &problem.vehicles[vehicle],
            &problem.route_ends(route.lowest_waypoint, route.waypoint_end),
        );
        if !route.ground_length_m.is_finite() {
            return Err(CoverageError::Unreachable);
        }
    }
    Ok(())
}

/// Gives the lowest layer to the route that takes longest over ground, the next one to the second
/// longest, and so on; then sets the costs.
pub(super) fn set_layers_and_costs<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    plan: &mut RoutePlan<K>,
) {
    let seconds = |route: &Route| {
        route.ground_length_m / problem.vehicles[usize::from(route.vehicle_index)].cruise_mps
    };
    for i in 0..plan.routes.len() {
        let own = seconds(&plan.routes[i]);
        let longer = plan.routes.iter().enumerate().filter(|(j, other)| {
            let theirs = seconds(other);
            theirs > own || (theirs == own && *j < i)
        });
        plan.routes[i].layer = longer.count() as u8 + 1;
    }
    set_costs(problem, plan);
}

/// Computes the costs of routes whose layers are set.
pub(super) fn set_costs<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    plan: &mut RoutePlan<K>,
) {
    for route in &mut plan.routes {
        let vehicle = &problem.vehicles[usize::from(route.vehicle_index)];
        let top_m = problem.heights.max_picture_height_m
            + f32::from(route.layer) * problem.heights.layer_spacing_m;
        let ends = problem.route_ends(route.lowest_waypoint, route.waypoint_end);
        let sink_s = problem.extra_vertical_times_s(vehicle, &ends);
        route.cost_m = route.ground_length_m
            + 2.0 * top_m
            + problem.extra_descent_m(&ends.lowest)
            + problem.extra_descent_m(&ends.highest);
        route.cost_s = route.ground_length_m / vehicle.cruise_mps
            + problem.altitude_delay_s(vehicle, route.layer)
            + if route.direction == RouteDirection::Forward { sink_s.0 } else { sink_s.1 };
    }
}
