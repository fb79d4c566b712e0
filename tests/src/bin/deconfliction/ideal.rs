//! How early the last vehicle could land: a search over the order of the vehicles, with straight
//! paths and paths of two legs at right angles.
//!
//! This is no planner: it works in an open map only, and tries 152 orders, in each of which every
//! vehicle takes the path that lands it first. Separation, speeds, climbs and the schedule's rules
//! are those of the mission.

use host_sim::capacity::MAX_WAYPOINTS;
use host_sim::mission::{HostPlan, PreparedMission};
use planner_core::Point;
use planner_core::flight::{Flight, Path};
use planner_core::map::segment::segment_is_clear;
use planner_core::schedule::{DEFAULT_MAX_SEGMENT_M, ScheduleWorkspace, earliest_departure};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Number of orders tried.
const ORDERS: u64 = 152;

/// When the last vehicle lands by three schedules, seconds after the start.
#[derive(Clone, Copy, Debug, Default)]
pub struct LastLandings {
    /// If each vehicle flew alone.
    pub alone_s: f32,
    /// By the mission's plan.
    pub planned_s: f32,
    /// By the best order that this search found.
    pub ideal_s: f32,
}

/// The last landing by `plan`, by `alone`, and by the best order; `None` if a flight has no path
/// here.
pub fn last_landings(
    mission: &PreparedMission,
    plan: &HostPlan,
    alone: &HostPlan,
) -> Option<LastLandings> {
    let last = |plan: &HostPlan| {
        plan.flights.iter().map(|f| landing_time_s(mission, f)).fold(0.0, f32::max)
    };
    let ideal_s = best_last_landing_s(mission, plan)?;
    Some(LastLandings { alone_s: last(alone), planned_s: last(plan), ideal_s })
}

/// Time at which the vehicle stands on the ground, seconds after the start.
fn landing_time_s(mission: &PreparedMission, flight: &Flight<MAX_WAYPOINTS>) -> f32 {
    let over_goal_s = flight.path.waypoints().last().map_or(0.0, |w| w.leave_s);
    flight.depart_s + over_goal_s + flight.descent_m / mission.schedule().vertical_mps
}

/// Possible flights of a vehicle: straight, or with one corner at right angles, where the map is
/// clear.
fn candidate_flights(
    mission: &PreparedMission,
    flight: &Flight<MAX_WAYPOINTS>,
) -> Option<Vec<Flight<MAX_WAYPOINTS>>> {
    let waypoints = flight.path.waypoints();
    let (from, to) = (waypoints.first()?.position, waypoints.last()?.position);
    let (x_first, y_first) = (Point::new(to.x, from.y, from.z), Point::new(from.x, to.y, from.z));
    let index = mission.index_of(flight.vehicle_id).ok()?;
    let required_m = mission.tasks[index].required_clearance_m;
    let grid = mission.map.grid();
    let mut all = Vec::new();
    for corners in [vec![from, to], vec![from, x_first, to], vec![from, y_first, to]] {
        if !corners.windows(2).all(|leg| segment_is_clear(&grid, &leg[0], &leg[1], required_m)) {
            continue;
        }
        let mut path = Path::new();
        corners.iter().for_each(|&corner| path.push(corner, required_m).expect("three points fit"));
        path.set_times_at_speed(
            flight.climb_m / mission.schedule().vertical_mps,
            mission.schedule().cruise_mps,
        );
        all.push(Flight {
            path,
            depart_s: 0.0,
            max_segment_m: DEFAULT_MAX_SEGMENT_M,
            ..flight.clone()
        });
    }
    Some(all)
}

fn best_last_landing_s(mission: &PreparedMission, plan: &HostPlan) -> Option<f32> {
    let choices: Vec<_> =
        plan.flights.iter().map(|f| candidate_flights(mission, f)).collect::<Option<_>>()?;
    let mut ws = ScheduleWorkspace::default();
    let mut rng = Pcg32::seed_from_u64(1);
    let mut order: Vec<usize> = (0..choices.len()).collect();
    let mut best_s = f32::INFINITY;
    for _ in 0..ORDERS {
        let mut scheduled: Vec<Flight<MAX_WAYPOINTS>> = Vec::new();
        for &i in &order {
            let departs = choices[i].iter().filter_map(|flight| {
                let cfg = mission.schedule();
                let depart_s =
                    earliest_departure(cfg, flight, 0.0, scheduled.iter(), &mut ws).ok()?;
                Some(Flight { depart_s, ..flight.clone() })
            });
            let first = departs
                .min_by(|a, b| landing_time_s(mission, a).total_cmp(&landing_time_s(mission, b)));
            scheduled.extend(first);
        }
        if scheduled.len() == choices.len() {
            let last_s = scheduled.iter().map(|f| landing_time_s(mission, f)).fold(0.0, f32::max);
            best_s = best_s.min(last_s);
        }
        for i in (1..order.len()).rev() {
            order.swap(i, rng.next_u32() as usize % (i + 1));
        }
    }
    best_s.is_finite().then_some(best_s)
}
