//! The division after the loss of a vehicle: the waypoints that are left go to the remaining
//! vehicles, each of which continues from where it holds.
//!
//! Beyond paper CPP, which names this as future work. The division is BINPAT over the remaining
//! lanes ([`super::divide`]): a pure function of the plan before and of the [`VehicleStatus`] of
//! every vehicle, on which all vehicles agree. So every vehicle computes the same bits. A further
//! loss is divided starting from the division before.

use heapless::Vec;

use super::divide;
use super::flights::{self, FlightInputs, Pad};
use super::lanes::Tracks;
use super::pack::{self, CoverageProblem, PackWorkspace, Route, RoutePlan, Vehicle};
use super::transit::TransitGraph;
use super::{CoverageError, Flat};
use crate::flight::{Task, WaypointRange, WaypointSet};
use crate::plan::{PlanError, SwarmPlan};
use crate::schedule::{ScheduleError, ScheduleWorkspace};

/// Most separate ranges of waypoints that are photographed or promised.
const MAX_DONE_RANGES: usize = 128;
/// Most times that vehicles exchange their routes where no take-off times keep them apart.
const MAX_ROUTE_ROTATIONS: usize = 3;

/// Status of one vehicle at a division. All vehicles agree on it before the area is divided again.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VehicleStatus {
    /// Whether the vehicle continues, and gets a part of the remaining lanes.
    pub continues: bool,
    /// Arc length of the vehicle's path up to which its pictures count as taken or promised,
    /// metres. A vehicle that continues holds there; at 0 it is still on its pad, unless its path
    /// begins in the air. If the vehicle does not continue, its last picture is taken again, since
    /// that picture may be missing. Infinite if the vehicle took all its pictures.
    pub photographed_to_m: f32,
}

/// Memory of divisions, for areas of at most `L` lanes and fleets of at most `K` vehicles.
pub struct LossesWorkspace<const L: usize, const K: usize> {
    /// Waypoints that are photographed or promised, by their numbers on the whole path.
    done: WaypointSet<MAX_DONE_RANGES>,
    /// The lanes without these waypoints.
    remaining: Tracks<L>,
    /// All vehicles, lost ones too, with the places from which they continue; `pads` alike.
    vehicles: Vec<Vehicle, K>,
    /// Pads of `vehicles`, in the same order.
    pads: Vec<Pad, K>,
    /// The division's routes; their vehicle indices count only the vehicles that continue.
    survivor_routes: RoutePlan<K>,
    /// Transit layers of lost vehicles, which may be flying home in them: bit `i` is layer `i`.
    occupied_layers: u64,
}

impl<const L: usize, const K: usize> LossesWorkspace<L, K> {
    /// Creates an empty workspace: all zeros.
    pub const fn new() -> Self {
        Self {
            done: WaypointSet::new(),
            remaining: Tracks::new(),
            vehicles: Vec::new(),
            pads: Vec::new(),
            survivor_routes: RoutePlan::new(),
            occupied_layers: 0,
        }
    }

    /// Starts a new plan, before its first division, with the waypoints `done` photographed already
    /// (numbers on the whole path). If these are all waypoints, the area is photographed once more.
    /// Returns the remaining lanes and the ranges of photographed waypoints.
    ///
    /// # Errors
    /// Those of [`divide::remaining_lanes`]; [`CoverageError::LanesFull`] for too many ranges.
    pub fn reset_with_done<'a, const N: usize>(
        &'a mut self,
        tracks: &'a Tracks<L>,
        transit: &TransitGraph<'_, N>,
        done: &[WaypointRange],
    ) -> Result<(&'a Tracks<L>, &'a [WaypointRange]), CoverageError> {
        self.done.clear();
        self.occupied_layers = 0;
        let all = tracks.waypoint_count();
        for range in done {
            let range = WaypointRange { first: range.first, end: range.end.min(all) };
            self.done.insert(range).map_err(|_| CoverageError::LanesFull)?;
        }
        if self.done.count() == all {
            self.done.clear();
        }
        if self.done.is_empty() {
            return Ok((tracks, &[]));
        }
        divide::remaining_lanes(tracks, self.done.ranges(), transit, &mut self.remaining)?;
        Ok((&self.remaining, self.done.ranges()))
    }

    /// Ranges of the waypoints that are photographed, or that a vehicle will still photograph
    /// before it holds: ascending, by their numbers on the path over the whole area.
    pub fn done(&self) -> &[WaypointRange] {
        self.done.ranges()
    }
}

impl<const L: usize, const K: usize> Default for LossesWorkspace<L, K> {
    fn default() -> Self {
        Self::new()
    }
}

/// Inputs of a division of the waypoints that are left, after a loss or at the end of a path that
/// covers only part of its route: the plan before any division, and the status of all vehicles.
#[derive(Clone, Copy)]
pub struct DivisionProblem<'a, const L: usize, const N: usize> {
    /// The lanes of the whole area and all vehicles, as before any division.
    pub problem: &'a CoverageProblem<'a, L, N>,
    /// Pads and settings with which the flights before any division were planned.
    pub flight_inputs: &'a FlightInputs<'a>,
    /// Status of each vehicle, in the order of [`CoverageProblem::vehicles`].
    pub statuses: &'a [VehicleStatus],
}

/// Reason why there is no division.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LossesError {
    /// Lanes or routes could not be computed.
    Coverage(CoverageError),
    /// The flights could not be planned.
    Plan(PlanError),
}

impl From<CoverageError> for LossesError {
    fn from(error: CoverageError) -> Self {
        Self::Coverage(error)
    }
}

impl From<PlanError> for LossesError {
    fn from(error: PlanError) -> Self {
        Self::Plan(error)
    }
}

/// Divides the remaining waypoints. On entry `routes` and `out` are the routes and flights of the
/// plan before; on success they are those of the division.
///
/// Room for `L` lanes, `N` corners of no-fly zones and `K` vehicles; `out` holds at most `V`
/// flights of at most `W` waypoints each.
///
/// Where no take-off times keep the vehicles apart, they exchange their routes, at most three
/// times.
///
/// # Errors
/// Those of [`divide::remaining_lanes`], [`pack::binpat`] and [`flights::plan_flights`];
/// [`CoverageError::Vehicles`] if statuses, routes and vehicles are inconsistent;
/// [`CoverageError::SettingOutOfRange`] for a [`VehicleStatus::photographed_to_m`] that is NaN or
/// negative.
pub fn redivide_work<
    const L: usize,
    const N: usize,
    const K: usize,
    const V: usize,
    const W: usize,
>(
    division: &DivisionProblem<'_, L, N>,
    ws: &mut LossesWorkspace<L, K>,
    pack: &mut PackWorkspace<K>,
    schedule: &mut ScheduleWorkspace,
    routes: &mut RoutePlan<K>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), LossesError> {
    let DivisionProblem { problem, flight_inputs, statuses } = *division;
    let known = |route: &Route| usize::from(route.vehicle_index) < statuses.len();
    if statuses.len() != problem.vehicles.len()
        || flight_inputs.pads.len() != statuses.len()
        || out.flights.len() != statuses.len()
        || !routes.routes.iter().all(known)
    {
        return Err(CoverageError::Vehicles.into());
    }
    if !statuses.iter().all(|fate| fate.photographed_to_m >= 0.0) {
        return Err(CoverageError::SettingOutOfRange("photographed_to_m").into());
    }
    add_done_waypoints(statuses, ws, out)?;
    set_start_places(division, ws, out)?;
    for route in
        routes.routes.iter().filter(|route| !statuses[usize::from(route.vehicle_index)].continues)
    {
        ws.occupied_layers |= layer_bit(route.layer);
    }
    routes.routes.clear();
    match divide::remaining_lanes(
        problem.tracks,
        ws.done.ranges(),
        problem.transit,
        &mut ws.remaining,
    ) {
        Ok(()) => divide_among_survivors(problem, statuses, ws, pack, routes)?,
        Err(CoverageError::NothingToCover) => {}
        Err(error) => return Err(error.into()),
    }
    let problem = CoverageProblem { tracks: &ws.remaining, vehicles: &ws.vehicles, ..*problem };
    let flight_inputs = FlightInputs {
        pads: &ws.pads,
        done_waypoints: ws.done.ranges(),
        occupied_layers: ws.occupied_layers,
        ..*flight_inputs
    };
    let mut exchanges = routes.routes.len().min(MAX_ROUTE_ROTATIONS + 1);
    loop {
        exchanges = exchanges.saturating_sub(1);
        match flights::plan_flights(&problem, routes, &flight_inputs, schedule, out) {
            // Two vehicles that hold close to each other may each bar the other's path.
            Err(PlanError::Schedule(_, ScheduleError::Blocked)) if exchanges > 0 => {
                rotate_routes(&problem, routes)?;
            }
            done => return Ok(done?),
        }
    }
}

/// Gives each route the vehicle of the next one, and the last that of the first.
fn rotate_routes<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    routes: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    let Some(mut vehicle) = routes.routes.first().map(|route| route.vehicle_index) else {
        return Ok(());
    };
    for route in routes.routes.iter_mut().rev() {
        core::mem::swap(&mut route.vehicle_index, &mut vehicle);
        (route.ground_length_m, route.direction) = problem.ground_length_and_direction(
            &problem.vehicles[usize::from(route.vehicle_index)],
            &problem.route_ends(route.lowest_waypoint, route.waypoint_end),
        );
        if !route.ground_length_m.is_finite() {
            return Err(CoverageError::Unreachable);
        }
    }
    pack::set_costs(problem, routes);
    Ok(())
}

/// The bit of a transit layer in `occupied_layers`.
const fn layer_bit(layer: u8) -> u64 {
    1u64.wrapping_shl(layer as u32)
}

/// Adds the waypoints that each vehicle has photographed, or promised to photograph, to `ws.done`.
fn add_done_waypoints<const L: usize, const K: usize, const V: usize, const W: usize>(
    statuses: &[VehicleStatus],
    ws: &mut LossesWorkspace<L, K>,
    before: &SwarmPlan<V, W>,
) -> Result<(), CoverageError> {
    for (fate, flight) in statuses.iter().zip(&before.flights) {
        let Task::Photograph(photographs) = &flight.task else { continue };
        let taken = photographs.taken_count(&flight.path, fate.photographed_to_m);
        let sure = fate.continues || fate.photographed_to_m.is_infinite();
        let count = if sure { taken } else { taken.saturating_sub(1) };
        for range in
            photographs.waypoints_of_pictures(&flight.path, WaypointRange { first: 0, end: count })
        {
            ws.done.insert(range).map_err(|_| CoverageError::LanesFull)?;
        }
    }
    Ok(())
}

/// Sets the place and height from which each vehicle continues.
fn set_start_places<
    const L: usize,
    const N: usize,
    const K: usize,
    const V: usize,
    const W: usize,
>(
    division: &DivisionProblem<'_, L, N>,
    ws: &mut LossesWorkspace<L, K>,
    before: &SwarmPlan<V, W>,
) -> Result<(), CoverageError> {
    let DivisionProblem { problem, flight_inputs, statuses } = *division;
    ws.vehicles.clear();
    ws.pads.clear();
    for (index, (vehicle, pad)) in problem.vehicles.iter().zip(flight_inputs.pads).enumerate() {
        let (mut vehicle, mut pad) = (*vehicle, *pad);
        let (fate, flight) = (&statuses[index], &before.flights[index]);
        pad.airborne = fate.continues
            && (fate.photographed_to_m > 0.0 || flight.climb_m == 0.0)
            && flight.task.leaves_pad();
        if pad.airborne {
            pad.path_start =
                flight.path.point_at(fate.photographed_to_m).ok_or(CoverageError::Vehicles)?;
            pad.climb_m = 0.0;
            vehicle.transit_start = Flat::new(pad.path_start.x, pad.path_start.y);
        }
        ws.vehicles.push(vehicle).map_err(|_| CoverageError::Vehicles)?;
        ws.pads.push(pad).map_err(|_| CoverageError::Vehicles)?;
    }
    Ok(())
}

/// Divides the remaining lanes among the vehicles that continue.
fn divide_among_survivors<const L: usize, const N: usize, const K: usize>(
    problem: &CoverageProblem<'_, L, N>,
    statuses: &[VehicleStatus],
    ws: &mut LossesWorkspace<L, K>,
    pack: &mut PackWorkspace<K>,
    routes: &mut RoutePlan<K>,
) -> Result<(), CoverageError> {
    let living =
        || statuses.iter().enumerate().filter(|(_, fate)| fate.continues).map(|(index, _)| index);
    let mut survivors: Vec<Vehicle, K> = living().map(|index| ws.vehicles[index]).collect();
    if survivors.iter().all(|vehicle| vehicle.weight == 0.0) {
        survivors.iter_mut().for_each(|vehicle| vehicle.weight = 1.0);
    }
    pack::binpat(
        &CoverageProblem { tracks: &ws.remaining, vehicles: &survivors, ..*problem },
        pack,
        &mut ws.survivor_routes,
    )?;
    for route in &ws.survivor_routes.routes {
        let vehicle =
            living().nth(usize::from(route.vehicle_index)).ok_or(CoverageError::Vehicles)?;
        let layer = flights::free_layers(ws.occupied_layers)
            .nth(usize::from(route.layer).saturating_sub(1));
        let layer = layer.ok_or(CoverageError::Vehicles)?;
        let route = Route { vehicle_index: vehicle as u8, layer, ..*route };
        routes.routes.push(route).map_err(|_| CoverageError::Vehicles)?;
    }
    Ok(())
}
