//! A local search for the order of take-offs with which the last vehicle lands earliest.
//!
//! Paths do not change. For each pair of flights one interval covers all differences of their
//! take-off times at which they would come near each other. With these intervals, the take-off
//! times of an order cost a few comparisons per pair, so many orders can be tried, each made from
//! the best so far by moving one vehicle to another place in the order. The best order is then
//! scheduled exactly, and kept if the last vehicle lands earlier.
//!
//! Cost: the timed segments of each pair of flights, then [`MAX_COMPARISONS`] comparisons.

use heapless::Vec;
use libm::fmaxf;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::request::{PlanError, PlanRequest};
use super::workspace::{PlanWorkspace, SwarmPlan};
use crate::flight::Flight;
use crate::schedule::{self, ScheduleConfig, ScheduleError, ScheduleWorkspace};
use crate::sort;

/// Most comparisons of a take-off time with that of a scheduled flight, in the whole search for a
/// swarm of at most [`MAX_BOARD_VEHICLES`]: a third of a second on a board.
const MAX_COMPARISONS: u32 = 150_000;
/// Most comparisons in the search for a larger swarm, as a multiple of the squared number of
/// vehicles that fly; at least [`MAX_COMPARISONS`].
const COMPARISONS_PER_PAIR: u32 = 200;
/// Weight of the mean landing time relative to the last landing time: of two orders with the same
/// end of the mission, the one with less waiting wins.
const MEAN_LANDING_WEIGHT: f32 = 0.02;

/// For each pair of flights `i` and `j` the forbidden interval of the difference of their take-off
/// times, that of `i` minus that of `j`, seconds.
struct ForbiddenDepartureDifferences<'a> {
    /// For a pair i < j the interval's lower end is at `[i][j]`, its upper end at `[j][i]`.
    ends: &'a [f32],
    /// Number of flights: `ends` is a square matrix of this side.
    flight_count: usize,
}

impl ForbiddenDepartureDifferences<'_> {
    /// The interval of take-off time of `i` minus that of `j`, for `i` and `j` in either order.
    fn forbidden_interval(&self, i: usize, j: usize) -> (f32, f32) {
        let (low, high) = (i.min(j), i.max(j));
        let (from, to) =
            (self.ends[low * self.flight_count + high], self.ends[high * self.flight_count + low]);
        if i < j { (from, to) } else { (-to, -from) }
    }

    /// Computes `departs_s`, the take-off times of vehicles that are scheduled in this `order`,
    /// each as early as those before it allow. `lasts_s` are the flights' durations. Returns the
    /// order's cost in seconds: last landing time plus weighted mean landing time. Subtracts the
    /// comparisons made from `comparisons_left`.
    fn order_cost_s(
        &self,
        order: &[u16],
        lasts_s: &[f32],
        departs_s: &mut [f32],
        comparisons_left: &mut u32,
    ) -> f32 {
        let (mut makespan_s, mut sum_s) = (0.0, 0.0);
        for (place, &i) in order.iter().enumerate() {
            let i = usize::from(i);
            let mut depart_s = 0.0;
            // Each pass moves the take-off past the interval of at least one vehicle.
            for _ in 0..=place {
                let before_s = depart_s;
                for &j in &order[..place] {
                    let (from, to) = self.forbidden_interval(i, usize::from(j));
                    let after_s = depart_s - departs_s[usize::from(j)];
                    if from < after_s && after_s < to {
                        depart_s = departs_s[usize::from(j)] + to;
                    }
                }
                *comparisons_left = comparisons_left.saturating_sub(place as u32);
                if depart_s == before_s {
                    break;
                }
            }
            departs_s[i] = depart_s;
            makespan_s = fmaxf(makespan_s, depart_s + lasts_s[i]);
            sum_s += depart_s + lasts_s[i];
        }
        makespan_s + MEAN_LANDING_WEIGHT * sum_s / order.len() as f32
    }
}

/// Changes the take-off times to those of the best order that the local search finds, if the last
/// vehicle then lands earlier; else leaves them. The schedule lets a vehicle be at a place
/// `handover_s` after another one has left it.
pub(super) fn improve_departure_order<
    const N: usize,
    const V: usize,
    const W: usize,
    const P: usize,
>(
    request: &PlanRequest<'_>,
    handover_s: f32,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), PlanError> {
    let cfg = &request.schedule;
    let count = out.flights.len();
    let mut order: Vec<u16, V> = Vec::new();
    let mut lasts_s: Vec<f32, V> = Vec::new();
    let mut found_s: Vec<f32, V> = Vec::new();
    for (i, flight) in out.flights.iter().enumerate() {
        if flight.task.leaves_pad() {
            // Cannot overflow, nor can those below: `V` flights at most, an entry for each.
            let _ = order.push(i as u16);
        }
        let _ = (lasts_s.push(flight.duration_s(cfg)), found_s.push(flight.depart_s));
    }
    if order.len() < 2 {
        return Ok(());
    }
    let ends = &mut ws.costs.as_flattened_mut()[..count * count];
    find_forbidden_differences(cfg, &out.flights, handover_s, &mut ws.schedule, ends)?;
    let ends = &ws.costs.as_flattened()[..count * count];
    let differences = ForbiddenDepartureDifferences { ends, flight_count: count };
    let by_departure = |a: &u16, b: &u16| {
        found_s[usize::from(*a)].total_cmp(&found_s[usize::from(*b)]).then(a.cmp(b))
    };
    sort::heapsort_by(&mut order, by_departure);
    let pairs = (order.len() * order.len()) as u32;
    let mut comparisons_left = if count <= MAX_BOARD_VEHICLES {
        MAX_COMPARISONS
    } else {
        MAX_COMPARISONS.max(COMPARISONS_PER_PAIR * pairs)
    };
    let mut departs_s = lasts_s.clone();
    let mut best =
        differences.order_cost_s(&order, &lasts_s, &mut departs_s, &mut comparisons_left);
    let mut rng = Pcg32::seed_from_u64(order.len() as u64);
    let mut below = |bound: usize| ((u64::from(rng.next_u32()) * bound as u64) >> 32) as usize;
    while comparisons_left > 0 {
        let (from, to) = (below(order.len()), below(order.len()));
        move_element(&mut order, from, to);
        let cost =
            differences.order_cost_s(&order, &lasts_s, &mut departs_s, &mut comparisons_left);
        if cost <= best {
            best = cost;
        } else {
            move_element(&mut order, to, from);
        }
        // Each iteration counts as one more comparison, so that the search always ends.
        comparisons_left = comparisons_left.saturating_sub(1);
    }
    let makespan_s = |flights: &[Flight<W>]| {
        flights.iter().zip(&lasts_s).map(|(f, lasts_s)| f.depart_s + lasts_s).fold(0.0, fmaxf)
    };
    let before_s = makespan_s(&out.flights);
    if schedule_in_order(&order, request, handover_s, ws, out).is_err()
        || makespan_s(&out.flights) >= before_s
    {
        out.flights
            .iter_mut()
            .zip(&found_s)
            .for_each(|(flight, &depart_s)| flight.depart_s = depart_s);
    }
    Ok(())
}

/// Writes the forbidden interval of each pair of flights to `ends`, in the layout of
/// [`ForbiddenDepartureDifferences::ends`].
fn find_forbidden_differences<const W: usize>(
    cfg: &ScheduleConfig,
    flights: &[Flight<W>],
    handover_s: f32,
    ws: &mut ScheduleWorkspace,
    ends: &mut [f32],
) -> Result<(), PlanError> {
    let count = flights.len();
    for (i, a) in flights.iter().enumerate() {
        for (j, b) in flights.iter().enumerate().skip(i + 1) {
            let differences =
                schedule::forbidden_departure_differences_s(cfg, a, b, handover_s, ws);
            let (from, to) = differences.map_err(|e| PlanError::Schedule(a.vehicle_id, e))?;
            (ends[i * count + j], ends[j * count + i]) = (from, to);
        }
    }
    Ok(())
}

/// Largest swarm that is planned on a board.
const MAX_BOARD_VEHICLES: usize = 32;

/// Schedules the vehicles in this order, each to take off as early as those before it allow.
/// Vehicles that stay on their pads count as scheduled before all.
fn schedule_in_order<const N: usize, const V: usize, const W: usize, const P: usize>(
    order: &[u16],
    request: &PlanRequest<'_>,
    handover_s: f32,
    ws: &mut PlanWorkspace<N, V, P>,
    out: &mut SwarmPlan<V, W>,
) -> Result<(), ScheduleError> {
    for (place, &i) in order.iter().enumerate() {
        let scheduled = out.flights.iter().enumerate().filter(|&(j, flight)| {
            !flight.task.leaves_pad() || order[..place].contains(&(j as u16))
        });
        let (flight, scheduled) =
            (&out.flights[usize::from(i)], scheduled.map(|(_, flight)| flight));
        let cfg = &request.schedule;
        let departure = schedule::departure_with_handover(
            cfg,
            flight,
            (0.0, handover_s),
            scheduled,
            &mut ws.schedule,
        );
        out.flights[usize::from(i)].depart_s = departure?;
    }
    Ok(())
}

/// Moves the element at index `from` to index `to`.
fn move_element(order: &mut [u16], from: usize, to: usize) {
    if from < to {
        order[from..=to].rotate_left(1);
    } else {
        order[to..=from].rotate_right(1);
    }
}
