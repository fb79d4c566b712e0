//! The plan of a whole swarm: which vehicle flies to which goal, on which path, and in which order
//! at shared places.
//!
//! Every companion computes this plan, from the mission's starts and goals and never from live
//! positions, so all get the same plan; they compare its CRC. As in paper P3D §3.3 there is one
//! roadmap, and either a shortest path per vehicle (labelled) or the assignment of least total
//! length over all pairs (unlabelled). [`Objective::Makespan`], the least longest path, is not in
//! the paper. The paper leaves out the order at shared stretches, which [`crate::schedule`]
//! decides.
//!
//! Cost: one search per vehicle, one assignment, then at most 2 · (min(vehicles, 64) + 9) rounds,
//! and 9 more where a vehicle would hover for long. In a round each vehicle takes one to three A*,
//! up to a dozen searches of the schedule (one per departure tried) and one pass over all scheduled
//! timed segments. Twice that for more than `MAX_VEHICLES_WITHOUT_HANDOVER` vehicles that cannot be
//! planned with a handover.

mod departures;
mod order;
mod request;
mod workspace;

use heapless::Vec;

pub use self::request::{GoalMode, Objective, PlanError, PlanRequest, VehicleTask};
pub use self::workspace::{PlanWorkspace, SwarmPlan};
use crate::assignment;
use crate::file::CRC32;
use crate::flight::{Flight, Path, VehiclePlan};
use crate::roadmap::search;
use crate::roadmap::{HalfEdge, RoadmapView};
use crate::schedule::{
    self, DEFAULT_MAX_SEGMENT_M, ScheduleConfig, ScheduleError, ScheduleWorkspace,
};

/// Plans the whole swarm: [`compute_costs`], then [`assign_goals`], then [`schedule_flights()`]. A
/// vehicle that gets no goal, since none is left or none can be reached, stays on its pad.
pub fn plan_swarm<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let mut goals = AssignedGoals::new();
    compute_costs(view, request, ws)?;
    assign_goals(request, ws, &mut goals)?;
    schedule_flights(view, request, &goals, ws, out)
}

/// The goal of each vehicle of a request, as an index among the roadmap's goals; `None` for a
/// vehicle that stays on its pad.
pub type AssignedGoals<const V: usize> = Vec<Option<u16>, V>;

/// First step: writes the length of the shortest path from every start to every goal into the
/// workspace; with labelled goals only to the vehicle's own goal. One search per vehicle, or one
/// cost matrix if all need the same clearance.
pub fn compute_costs<const N: usize, const V: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
) -> Result<(), PlanError> {
    let (starts, goals) = (request.vehicles.len(), request.goal_descents_m.len());
    request.check()?;
    let header = view.header();
    if usize::from(header.start_count) != starts || usize::from(header.goal_count) != goals {
        return Err(PlanError::CountMismatch);
    }
    if starts > V || goals > V {
        return Err(PlanError::SwarmFull);
    }
    // Cannot overflow: both numbers are at most `V`.
    let nodes: Vec<u16, V> = (0..starts as u16).collect();
    let targets: Vec<u16, V> = (starts as u16..(starts + goals) as u16).collect();
    let costs = &mut ws.costs.as_flattened_mut()[..starts * goals];
    let Some(first) = request.vehicles.first() else { return Ok(()) };
    let labelled = request.mode == GoalMode::Labelled;
    if !labelled
        && request.vehicles.iter().all(|v| v.required_clearance_m == first.required_clearance_m)
    {
        let passable =
            |_: u16, edge: &HalfEdge| view.has_clearance(edge, first.required_clearance_m);
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
        let passable =
            |_: u16, edge: &HalfEdge| view.has_clearance(edge, vehicle.required_clearance_m);
        search::path_lengths_to(view, i as u16, targets, passable, &mut ws.search, row)
            .map_err(|e| PlanError::Search(vehicle.id, e))?;
    }
    Ok(())
}

/// Second step: assigns goals to vehicles by the costs that [`compute_costs`] left in the
/// workspace. A vehicle that gets no goal has `None`.
pub fn assign_goals<const N: usize, const V: usize, const P: usize>(
    request: &PlanRequest<'_>,
    ws: &mut PlanWorkspace<N, V, P>,
    assigned: &mut AssignedGoals<V>,
) -> Result<(), PlanError> {
    let (starts, goals) = (request.vehicles.len(), request.goal_descents_m.len());
    if starts > V || goals > V {
        return Err(PlanError::SwarmFull);
    }
    let costs = &ws.costs.as_flattened()[..starts * goals];
    assigned.clear();
    let _ = assigned.resize(starts, None);
    let solve = match request.mode {
        GoalMode::Unlabelled(Objective::TotalDistance) => assignment::assign,
        GoalMode::Unlabelled(Objective::Makespan) => assignment::assign_bottleneck,
        GoalMode::Labelled => {
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

/// Third step: finds the paths to the `assigned` goals, and schedules the order at shared
/// stretches.
pub fn schedule_flights<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    assigned: &AssignedGoals<V>,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let header = view.header();
    let counts = [usize::from(header.start_count), usize::from(header.goal_count)];
    if assigned.len() != request.vehicles.len()
        || counts != [assigned.len(), request.goal_descents_m.len()]
    {
        return Err(PlanError::CountMismatch);
    }
    request.check()?;
    out.flights.clear();
    for (i, (vehicle, &goal)) in request.vehicles.iter().zip(assigned).enumerate() {
        let mut path = Path::new();
        path.push(view.node(i as u16), 0.0).map_err(|e| PlanError::Path(vehicle.id, e))?;
        let descent_m = match goal {
            Some(goal) => *request
                .goal_descents_m
                .get(usize::from(goal))
                .ok_or(PlanError::BadGoal(vehicle.id))?,
            None => 0.0,
        };
        let (id, climb_m) = (vehicle.id, vehicle.climb_m);
        let flight = Flight {
            vehicle_id: id,
            task: goal.into(),
            path,
            climb_m,
            descent_m,
            depart_s: 0.0,
            max_segment_m: DEFAULT_MAX_SEGMENT_M,
        };
        // Cannot overflow: there are as many flights as entries in `assigned`.
        out.flights.push(flight).map_err(|_| PlanError::SwarmFull)?;
    }
    let handover_s =
        if request.vehicles.len() > MAX_VEHICLES_WITHOUT_HANDOVER { HANDOVER_S } else { 0.0 };
    let mut planned = schedule_with_handover(view, request, handover_s, ws, out);
    if handover_s > 0.0 && planned.is_err() {
        // A plan without handover, which makes vehicles late, is better than none.
        planned = schedule_with_handover(view, request, 0.0, ws, out);
    }
    planned?;
    out.set_crc(&request.schedule);
    Ok(())
}

/// Time from when a vehicle has left a place until the schedule lets another one be there, seconds:
/// the time that a vehicle waiting for the place takes until it flies in at full speed. The waiting
/// vehicle is up to a second behind the reference that stops it at gates, progress is reported five
/// times a second, and a vehicle that has to stop brakes before. Without this time each vehicle
/// falls further behind the schedule than the one before it, and vehicles that leave their pads on
/// time wait in the air. Gates do not depend on this time.
const HANDOVER_S: f32 = 2.0;
/// Swarms of up to this many vehicles are planned without [`HANDOVER_S`]: in them no vehicle waits
/// behind a long chain of vehicles that wait, and without the handover the swarm lands earlier.
const MAX_VEHICLES_WITHOUT_HANDOVER: usize = 12;

/// Plans paths and their order, then checks that each vehicle has at most `request.max_gates`
/// gates. The schedule lets a vehicle be at a place `handover_s` after another one has left it.
#[inline(never)]
fn schedule_with_handover<const N: usize, const V: usize, const W: usize, const P: usize>(
    view: &RoadmapView<'_>,
    request: &PlanRequest<'_>,
    handover_s: f32,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    order::schedule_all(view, request, handover_s, ws, out)?;
    departures::improve_departure_order(request, handover_s, ws, out)?;
    for (index, flight) in out.flights.iter().enumerate() {
        schedule::gate_merge_distance_m(
            &request.schedule,
            &out.flights,
            index,
            request.max_gates,
            &mut ws.schedule,
        )
        .map_err(|e| PlanError::Schedule(flight.vehicle_id, e))?;
    }
    Ok(())
}

/// Writes the part of the swarm's plan that the companion of flight `index` needs to `out`, gates
/// included.
pub fn vehicle_plan<const V: usize, const W: usize, const G: usize>(
    plan: &SwarmPlan<V, W>,
    index: usize,
    cfg: &ScheduleConfig,
    ws: &mut ScheduleWorkspace,
    out: &mut VehiclePlan<W, G>,
) -> Result<(), ScheduleError> {
    let flight = plan.flights.get(index).ok_or(ScheduleError::BadIndex)?;
    out.task = flight.task;
    out.path = flight.path.clone();
    out.climb_m = flight.climb_m;
    out.descent_m = flight.descent_m;
    out.depart_s = flight.depart_s;
    out.swarm_plan_crc = plan.crc;
    schedule::gates(cfg, &plan.flights, index, ws, &mut out.gates)
}

impl<const V: usize, const W: usize> SwarmPlan<V, W> {
    /// Computes the plan's CRC and stores it.
    pub(crate) fn set_crc(&mut self, cfg: &ScheduleConfig) {
        self.crc = crc(cfg, self);
    }
}

/// CRC-32 over ids, goals, and all numbers of settings and flights that determine the gates.
fn crc<const V: usize, const W: usize>(cfg: &ScheduleConfig, plan: &SwarmPlan<V, W>) -> u32 {
    let mut digest = CRC32.digest();
    let mut numbers =
        |numbers: &[f32]| numbers.iter().for_each(|c| digest.update(&c.to_le_bytes()));
    numbers(&[cfg.separation_m, cfg.parked_separation_m, cfg.cruise_mps, cfg.vertical_mps]);
    for flight in &plan.flights {
        numbers(&[flight.climb_m, flight.descent_m, flight.depart_s, flight.max_segment_m]);
        for w in flight.path.waypoints() {
            numbers(&[w.position.x, w.position.y, w.position.z, w.arrive_s, w.leave_s]);
        }
    }
    for flight in &plan.flights {
        digest.update(&[flight.vehicle_id]);
        digest.update(&flight.task.goal().unwrap_or(u16::MAX).to_le_bytes());
        digest.update(&(flight.path.waypoints().len() as u32).to_le_bytes());
    }
    digest.finalize()
}

#[cfg(test)]
mod tests;
