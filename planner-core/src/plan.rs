//! The plan of a whole swarm: who flies to which goal, along which path, in which order.
//!
//! Every companion computes this for the whole swarm from the mission's starts and goals, never from live positions, so all
//! agree; the CRC of the plan is what they compare. P3D §3.3: one roadmap, a shortest path per vehicle (labelled) or the
//! assignment of least total length over all pairs (unlabelled); what the paper leaves out is the order at shared stretches,
//! which [`crate::schedule`] settles.
//!
//! Cost: one search per vehicle, one assignment, then at most (vehicles + 1) rounds of one to three A*, up to a dozen searches
//! of the schedule (one for each departure looked at) and one pass over all scheduled pieces per vehicle.

mod departures;
mod order;

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::Vec;

use crate::ConfigError;
use crate::assignment::{self, AssignmentError, AssignmentWorkspace};
use crate::flight::{Flight, Path, PathError, VehiclePlan};
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::schedule::sipp::SippWorkspace;
use crate::schedule::{self, PIECE_M, ScheduleConfig, ScheduleError, ScheduleWorkspace};
use crate::search::{self, SearchError, SearchWorkspace};

/// What an assignment makes small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The sum of all path lengths.
    TotalDistance,
    /// The longest path.
    Makespan,
}

/// How goals are given out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Every vehicle has its goal.
    Labelled,
    /// Any vehicle may take any goal.
    Unlabelled(Objective),
}

/// One vehicle of the request; vehicle `i` starts at node `i` of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleTask {
    /// Id of the vehicle, unique in the swarm.
    pub id: u8,
    /// Radius + safety margin, metres: edges must have more clearance.
    pub required_clearance_m: f32,
    /// Height of the start above its pad, metres.
    pub climb_m: f32,
    /// Labelled: index of its goal.
    pub goal: Option<u16>,
}

/// A swarm's task.
#[derive(Clone, Copy, Debug)]
pub struct PlanRequest<'a> {
    /// The vehicles, in the order of the roadmap's starts.
    pub vehicles: &'a [VehicleTask],
    /// Height of each goal above the ground below it, metres; as many as the roadmap has goals.
    pub descents_m: &'a [f32],
    /// How goals are given out.
    pub mode: Mode,
    /// Separation and nominal speeds.
    pub schedule: ScheduleConfig,
    /// Most gates of one vehicle: the least `G` that [`vehicle_plan`] is to be called with.
    pub gates_most: usize,
}

impl PlanRequest<'_> {
    /// Whether every number is one that can be planned with, every id is one vehicle's and, labelled, every goal as well.
    pub fn check(&self) -> Result<(), PlanError> {
        self.schedule.check().map_err(PlanError::Config)?;
        let good = |number: f32| number >= 0.0 && number.is_finite();
        for (i, vehicle) in self.vehicles.iter().enumerate() {
            let before = &self.vehicles[..i];
            if !good(vehicle.required_clearance_m) || !good(vehicle.climb_m) {
                return Err(PlanError::BadTask(vehicle.id));
            }
            if before.iter().any(|other| other.id == vehicle.id) {
                return Err(PlanError::SameId(vehicle.id));
            }
            let labelled = self.mode == Mode::Labelled && vehicle.goal.is_some();
            if labelled && before.iter().any(|other| other.goal == vehicle.goal) {
                return Err(PlanError::SameGoal(vehicle.id));
            }
        }
        match self.descents_m.iter().position(|&height_m| !good(height_m)) {
            Some(goal) => Err(PlanError::BadDescent(goal as u16)),
            None => Ok(()),
        }
    }
}

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanError {
    /// The roadmap has other numbers of starts or goals than the request.
    Terminals,
    /// More vehicles or goals than `V`.
    SwarmFull,
    /// A setting of the schedule.
    Config(ConfigError),
    /// Height or clearance of the vehicle with this id is negative, NaN or infinite.
    BadTask(u8),
    /// The height of the goal with this index over its ground is.
    BadDescent(u16),
    /// Two vehicles have this id.
    SameId(u8),
    /// The vehicle with this id has a goal that is another one's too.
    SameGoal(u8),
    /// A labelled goal that is not in the roadmap, for the vehicle with this id.
    BadGoal(u8),
    /// A search failed for a reason other than "no path", for the vehicle with this id.
    Search(u8, SearchError),
    /// The costs could not be assigned.
    Assignment(AssignmentError),
    /// The path of the vehicle with this id was refused.
    Path(u8, PathError),
    /// The vehicle with this id cannot be scheduled among the others.
    Schedule(u8, ScheduleError),
}

/// The plan of a whole swarm: flight `i` is vehicle `i` of the request. A vehicle without a goal stays on its pad.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SwarmPlan<const V: usize, const W: usize> {
    /// One flight per vehicle.
    pub flights: Vec<Flight<W>, V>,
    /// CRC-32 over separation and speeds, ids, goals, climbs, descents, waypoints with their times, and departures.
    pub crc: u32,
}

impl<const V: usize, const W: usize> SwarmPlan<V, W> {
    /// Without vehicles.
    pub const fn new() -> Self {
        Self { flights: Vec::new(), crc: 0 }
    }

    /// Sum of the lengths of all paths, metres.
    pub fn total_m(&self) -> f64 {
        self.flights.iter().map(|f| f64::from(f.path.length_m())).sum()
    }
}

/// Scratch of [`plan_swarm`] and its steps, for roadmaps of `N` nodes, swarms of `V` vehicles and goals, and `P` pieces of flights among
/// which one steps aside.
pub struct PlanWorkspace<const N: usize, const V: usize, const P: usize> {
    /// Scratch of searches, also for [`crate::detour`].
    pub search: SearchWorkspace<N>,
    /// Scratch of [`schedule::sipp`].
    pub sipp: SippWorkspace<N, P>,
    /// Scratch of [`assignment`].
    pub assignment: AssignmentWorkspace<V>,
    /// Starts × goals, packed from the front.
    costs: [[f32; V]; V],
    /// Scratch of the schedule, also for [`vehicle_plan`].
    pub schedule: ScheduleWorkspace,
}

impl<const N: usize, const V: usize, const P: usize> PlanWorkspace<N, V, P> {
    /// All zeros.
    pub const fn new() -> Self {
        Self {
            search: SearchWorkspace::new(),
            sipp: SippWorkspace::new(),
            assignment: AssignmentWorkspace::new(),
            costs: [[0.0; V]; V],
            schedule: ScheduleWorkspace::new(),
        }
    }
}

impl<const N: usize, const V: usize, const P: usize> Default for PlanWorkspace<N, V, P> {
    fn default() -> Self {
        Self::new()
    }
}

/// Plans the whole swarm: [`costs`], then [`assign`], then [`schedule()`]. Vehicles and goals that cannot be served are
/// left out, the rest is served as well as can be.
pub fn plan_swarm<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let mut goals = Goals::new();
    costs(view, request, ws)?;
    assign(request, ws, &mut goals)?;
    schedule(view, request, &goals, ws, out)
}

/// The goal of each vehicle of a request, `None` for one that stays on its pad.
pub type Goals<const V: usize> = Vec<Option<u16>, V>;

/// First step: the length of the shortest path from every start to every goal, into the workspace; labelled, only to
/// the vehicle's own goal. One search a vehicle, or one cost matrix where all are of one size.
pub fn costs<const N: usize, const V: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
) -> Result<(), PlanError> {
    let (starts, goals) = (request.vehicles.len(), request.descents_m.len());
    request.check()?;
    let header = view.header();
    if usize::from(header.starts) != starts || usize::from(header.goals) != goals {
        return Err(PlanError::Terminals);
    }
    if starts > V || goals > V {
        return Err(PlanError::SwarmFull);
    }
    // Cannot overflow: both numbers are at most `V`.
    let nodes: Vec<u16, V> = (0..starts as u16).collect();
    let targets: Vec<u16, V> = (starts as u16..(starts + goals) as u16).collect();
    let costs = &mut ws.costs.as_flattened_mut()[..starts * goals];
    let Some(first) = request.vehicles.first() else { return Ok(()) };
    let labelled = request.mode == Mode::Labelled;
    if !labelled && request.vehicles.iter().all(|v| v.required_clearance_m == first.required_clearance_m) {
        let passable = |_: u16, edge: &HalfEdge| view.clears(edge, first.required_clearance_m);
        return search::cost_matrix(view, &nodes, &targets, passable, &mut ws.search, costs)
            .map_err(|e| PlanError::Search(first.id, e));
    }
    for (i, vehicle) in request.vehicles.iter().enumerate() {
        let row = &mut costs[i * goals..(i + 1) * goals];
        let wanted = match (labelled, vehicle.goal.map(usize::from)) {
            (false, _) => 0..goals,
            (true, Some(goal)) if goal < goals => goal..goal + 1,
            (true, Some(_)) => return Err(PlanError::BadGoal(vehicle.id)),
            (true, None) => continue,
        };
        let (targets, row) = (&targets[wanted.clone()], &mut row[wanted]);
        let passable = |_: u16, edge: &HalfEdge| view.clears(edge, vehicle.required_clearance_m);
        search::dijkstra_row(view, i as u16, targets, passable, &mut ws.search, row)
            .map_err(|e| PlanError::Search(vehicle.id, e))?;
    }
    Ok(())
}

/// Second step: who flies to which goal, from the costs left in the workspace by [`costs`].
pub fn assign<const N: usize, const V: usize, const P: usize>(
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    assigned: &mut Goals<V>,
) -> Result<(), PlanError> {
    let (starts, goals) = (request.vehicles.len(), request.descents_m.len());
    if starts > V || goals > V {
        return Err(PlanError::SwarmFull);
    }
    let costs = &ws.costs.as_flattened()[..starts * goals];
    assigned.clear();
    let _ = assigned.resize(starts, None);
    let solve = match request.mode {
        Mode::Unlabelled(Objective::TotalDistance) => assignment::assign,
        Mode::Unlabelled(Objective::Makespan) => assignment::bottleneck,
        Mode::Labelled => {
            for (i, vehicle) in request.vehicles.iter().enumerate() {
                let Some(goal) = vehicle.goal else { continue };
                let row = &costs[i * goals..(i + 1) * goals];
                let cost = row.get(usize::from(goal)).ok_or(PlanError::BadGoal(vehicle.id))?;
                assigned[i] = cost.is_finite().then_some(goal);
            }
            return Ok(());
        }
    };
    solve(costs, starts, goals, &mut ws.assignment, assigned).map_err(PlanError::Assignment)?;
    Ok(())
}

/// Third step: the paths to the `assigned` goals and their order at shared stretches.
pub fn schedule<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    assigned: &Goals<V>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let header = view.header();
    let counts = [usize::from(header.starts), usize::from(header.goals)];
    if assigned.len() != request.vehicles.len() || counts != [assigned.len(), request.descents_m.len()] {
        return Err(PlanError::Terminals);
    }
    request.check()?;
    out.flights.clear();
    for (i, (vehicle, &goal)) in request.vehicles.iter().zip(assigned).enumerate() {
        let mut path = Path::new();
        path.push(view.node(i as u16), 0.0).map_err(|e| PlanError::Path(vehicle.id, e))?;
        let descent_m = match goal {
            Some(goal) => *request.descents_m.get(usize::from(goal)).ok_or(PlanError::BadGoal(vehicle.id))?,
            None => 0.0,
        };
        let (id, climb_m) = (vehicle.id, vehicle.climb_m);
        let flight = Flight { id, goal, path, climb_m, descent_m, depart_s: 0.0, piece_m: PIECE_M };
        // Cannot overflow: as many as goals.
        out.flights.push(flight).map_err(|_| PlanError::SwarmFull)?;
    }
    order::schedule_all(view, request, ws, out)?;
    departures::improve(request, ws, out)?;
    for (index, flight) in out.flights.iter().enumerate() {
        schedule::merged_m(&request.schedule, &out.flights, index, request.gates_most, &mut ws.schedule)
            .map_err(|e| PlanError::Schedule(flight.id, e))?;
    }
    out.crc = crc(&request.schedule, out);
    Ok(())
}

/// What the companion of flight `index` needs of the swarm's plan.
pub fn vehicle_plan<const V: usize, const W: usize, const G: usize>(
    plan: &SwarmPlan<V, W>,
    index: usize,
    cfg: &ScheduleConfig,
    ws: &mut ScheduleWorkspace,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), ScheduleError> {
    let flight = plan.flights.get(index).ok_or(ScheduleError::BadIndex)?;
    out.goal = flight.goal;
    out.path = flight.path.clone();
    out.climb_m = flight.climb_m;
    out.descent_m = flight.descent_m;
    out.depart_s = flight.depart_s;
    out.plan_crc = plan.crc;
    schedule::gates(cfg, &plan.flights, index, ws, &mut out.gates)
}

/// CRC-32 over all that gates follow from.
fn crc<const V: usize, const W: usize>(cfg: &ScheduleConfig, plan: &SwarmPlan<V, W>) -> u32 {
    const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let mut digest = CRC32.digest();
    let mut numbers = |numbers: &[f32]| numbers.iter().for_each(|c| digest.update(&c.to_le_bytes()));
    numbers(&[cfg.separation_m, cfg.parked_separation_m, cfg.cruise_mps, cfg.vertical_mps]);
    for flight in &plan.flights {
        numbers(&[flight.climb_m, flight.descent_m, flight.depart_s, flight.piece_m]);
        for w in flight.path.waypoints() {
            numbers(&[w.position.x, w.position.y, w.position.z, w.at_s, w.leave_s]);
        }
    }
    for flight in &plan.flights {
        digest.update(&[flight.id]);
        digest.update(&flight.goal.unwrap_or(u16::MAX).to_le_bytes());
        digest.update(&(flight.path.waypoints().len() as u32).to_le_bytes());
    }
    digest.finalize()
}

#[cfg(test)]
mod tests;
