//! The division after a loss: what is left of the area goes to the vehicles that fly on, from where
//! they hold.
//!
//! Beyond CPP, which has this as future work. It is BINPAT over what is left ([`super::divide`]), a
//! pure function of the plan before it and of what all vehicles agree on, their [`VehicleStatus`]s:
//! every vehicle computes the same bits. A further loss is divided from the division before.

use heapless::Vec;

use super::divide;
use super::flights::{self, FlightInputs, Pad};
use super::lanes::Tracks;
use super::pack::{self, PackWorkspace, Plan, Route, Vehicle, Work};
use super::transit::Transit;
use super::{CoverageError, Flat};
use crate::flight::{Task, WaypointRange, WaypointSet};
use crate::plan::{PlanError, SwarmPlan};
use crate::schedule::ScheduleWorkspace;

/// Most separate ranges of waypoints that are done.
const MAX_DONE_RANGES: usize = 128;

/// State of one vehicle. All vehicles agree on it before the area is divided again.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VehicleStatus {
    /// Whether it flies on.
    pub alive: bool,
    /// Place along its path up to which the pictures are the vehicle's own, taken or promised,
    /// metres. A vehicle that lives holds there; at 0 it still stands on its pad. Of a vehicle that
    /// does not live the last picture is taken again: it may be missing. Infinite: the vehicle took
    /// all pictures.
    pub along_m: f32,
}

/// Memory lent for areas of at most `L` lanes and `K` vehicles.
pub struct Workspace<const L: usize, const K: usize> {
    done: WaypointSet<MAX_DONE_RANGES>,
    remaining: Tracks<L>,
    vehicles: Vec<Vehicle, K>,
    pads: Vec<Pad, K>,
    rest: Plan<K>,
    /// Layers of vehicles that left: they may be on their way home there.
    held_layers: u64,
}

impl<const L: usize, const K: usize> Workspace<L, K> {
    /// Creates it empty: all zeros.
    pub const fn new() -> Self {
        Self {
            done: WaypointSet::new(),
            remaining: Tracks::new(),
            vehicles: Vec::new(),
            pads: Vec::new(),
            rest: Plan::new(),
            held_layers: 0,
        }
    }

    /// To be called before the first division of a plan: these waypoints are done, by their numbers
    /// on the whole path. Where that is all of it, the area is begun again. Returns the lanes that
    /// are left, and what is done.
    ///
    /// # Errors
    /// Those of [`divide::remaining_lanes`]; [`CoverageError::LanesFull`] for too many ranges.
    pub fn start_plan<'a, const N: usize>(
        &'a mut self,
        tracks: &'a Tracks<L>,
        transit: &Transit<'_, N>,
        done: &[WaypointRange],
    ) -> Result<(&'a Tracks<L>, &'a [WaypointRange]), CoverageError> {
        self.done.clear();
        self.held_layers = 0;
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

    /// Waypoints that are done or promised, in rising order, by their numbers on the whole path.
    pub fn done(&self) -> &[WaypointRange] {
        self.done.ranges()
    }
}

impl<const L: usize, const K: usize> Default for Workspace<L, K> {
    fn default() -> Self {
        Self::new()
    }
}

/// A loss: the plan before it, and what all agree on.
#[derive(Clone, Copy)]
pub struct Loss<'a, const L: usize, const N: usize> {
    /// The division before: the lanes of the whole area, all vehicles.
    pub work: &'a Work<'a, L, N>,
    /// Inputs of the flights.
    pub swarm: &'a FlightInputs<'a>,
    /// State of each vehicle.
    pub fates: &'a [VehicleStatus],
}

/// Reason why there is no division.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// The area.
    Coverage(CoverageError),
    /// The flights.
    Plan(PlanError),
}

impl From<CoverageError> for Error {
    fn from(error: CoverageError) -> Self {
        Self::Coverage(error)
    }
}

impl From<PlanError> for Error {
    fn from(error: PlanError) -> Self {
        Self::Plan(error)
    }
}

/// Divides what is left. `routes` are those of the plan before, `out` has its flights; afterwards
/// both are those of the division.
///
/// # Errors
/// Those of [`divide::remaining_lanes`], [`pack::binpat`] and [`flights::plan_flights`];
/// [`CoverageError::Vehicles`] where fates, routes and vehicles do not belong together;
/// [`CoverageError::Setting`] for an `along_m` that is NaN or negative.
pub fn redivide_work<
    const L: usize,
    const N: usize,
    const K: usize,
    const V: usize,
    const W: usize,
>(
    loss: &Loss<'_, L, N>,
    ws: &mut Workspace<L, K>,
    pack: &mut PackWorkspace<K>,
    schedule: &mut ScheduleWorkspace,
    routes: &mut Plan<K>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), Error> {
    let Loss { work, swarm, fates } = *loss;
    let known = |route: &Route| usize::from(route.vehicle) < fates.len();
    if fates.len() != work.vehicles.len()
        || swarm.pads.len() != fates.len()
        || out.flights.len() != fates.len()
        || !routes.routes.iter().all(known)
    {
        return Err(CoverageError::Vehicles.into());
    }
    if !fates.iter().all(|fate| fate.along_m >= 0.0) {
        return Err(CoverageError::Setting("along_m").into());
    }
    add_done_waypoints(fates, ws, out)?;
    set_start_places(loss, ws, out)?;
    for route in routes.routes.iter().filter(|route| !fates[usize::from(route.vehicle)].alive) {
        ws.held_layers |= layer_bit(route.layer);
    }
    routes.routes.clear();
    match divide::remaining_lanes(work.tracks, ws.done.ranges(), work.transit, &mut ws.remaining) {
        Ok(()) => divide_among_survivors(work, fates, ws, pack, routes)?,
        Err(CoverageError::NothingToCover) => {}
        Err(error) => return Err(error.into()),
    }
    let work = Work { tracks: &ws.remaining, vehicles: &ws.vehicles, ..*work };
    let swarm = FlightInputs {
        pads: &ws.pads,
        photographed: ws.done.ranges(),
        held_layers: ws.held_layers,
        ..*swarm
    };
    Ok(flights::plan_flights(&work, routes, &swarm, schedule, out)?)
}

/// The bit of a layer.
const fn layer_bit(layer: u8) -> u64 {
    1u64.wrapping_shl(layer as u32)
}

/// Adds the waypoints that each vehicle has photographed, or keeps as its commitment, to the
/// earlier ones.
fn add_done_waypoints<const L: usize, const K: usize, const V: usize, const W: usize>(
    fates: &[VehicleStatus],
    ws: &mut Workspace<L, K>,
    before: &SwarmPlan<V, W>,
) -> Result<(), CoverageError> {
    for (fate, flight) in fates.iter().zip(&before.flights) {
        let Task::Photograph(photographs) = &flight.task else { continue };
        let taken = photographs.taken_count(&flight.path, fate.along_m);
        let sure = fate.alive || fate.along_m.is_infinite();
        let count = if sure { taken } else { taken.saturating_sub(1) };
        for range in
            photographs.shown_waypoints(&flight.path, WaypointRange { first: 0, end: count })
        {
            ws.done.insert(range).map_err(|_| CoverageError::LanesFull)?;
        }
    }
    Ok(())
}

/// Sets the place from which each vehicle continues.
fn set_start_places<
    const L: usize,
    const N: usize,
    const K: usize,
    const V: usize,
    const W: usize,
>(
    loss: &Loss<'_, L, N>,
    ws: &mut Workspace<L, K>,
    before: &SwarmPlan<V, W>,
) -> Result<(), CoverageError> {
    let Loss { work, swarm, fates } = *loss;
    ws.vehicles.clear();
    ws.pads.clear();
    for (index, (vehicle, pad)) in work.vehicles.iter().zip(swarm.pads).enumerate() {
        let (mut vehicle, mut pad) = (*vehicle, *pad);
        let (fate, flight) = (&fates[index], &before.flights[index]);
        pad.airborne =
            fate.alive && (fate.along_m > 0.0 || flight.climb_m == 0.0) && flight.task.leaves_pad();
        if pad.airborne {
            pad.start = flight.path.point_at(fate.along_m).ok_or(CoverageError::Vehicles)?;
            pad.climb_m = 0.0;
            vehicle.place = Flat::new(pad.start.x, pad.start.y);
        }
        ws.vehicles.push(vehicle).map_err(|_| CoverageError::Vehicles)?;
        ws.pads.push(pad).map_err(|_| CoverageError::Vehicles)?;
    }
    Ok(())
}

/// Divides the remaining work among the vehicles that are alive.
fn divide_among_survivors<const L: usize, const N: usize, const K: usize>(
    work: &Work<'_, L, N>,
    fates: &[VehicleStatus],
    ws: &mut Workspace<L, K>,
    pack: &mut PackWorkspace<K>,
    routes: &mut Plan<K>,
) -> Result<(), CoverageError> {
    let living = || fates.iter().enumerate().filter(|(_, fate)| fate.alive).map(|(index, _)| index);
    let mut survivors: Vec<Vehicle, K> = living().map(|index| ws.vehicles[index]).collect();
    if survivors.iter().all(|vehicle| vehicle.weight == 0.0) {
        survivors.iter_mut().for_each(|vehicle| vehicle.weight = 1.0);
    }
    pack::binpat(
        &Work { tracks: &ws.remaining, vehicles: &survivors, ..*work },
        pack,
        &mut ws.rest,
    )?;
    for route in &ws.rest.routes {
        let vehicle = living().nth(usize::from(route.vehicle)).ok_or(CoverageError::Vehicles)?;
        let layer =
            flights::free_layers(ws.held_layers).nth(usize::from(route.layer).saturating_sub(1));
        let layer = layer.ok_or(CoverageError::Vehicles)?;
        let route = Route { vehicle: vehicle as u8, layer, ..*route };
        routes.routes.push(route).map_err(|_| CoverageError::Vehicles)?;
    }
    Ok(())
}
