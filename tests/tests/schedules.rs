//! Random swarms, planned and then flown by progress alone: a vehicle obeys its gates and nothing
//! else. None may come nearer to another than the safety distance, none may wait forever, and a
//! plan that is `Ok` has a part for every vehicle. As companions do, a vehicle on its pad waits
//! there while another one is late.
//!
//! Rooms, corridors with side rooms, shafts, and paths of up to 1.5 km; climbs and descents of 0.5
//! m to 30 m; pads on one floor or anywhere; 2 to 32 vehicles of several sizes with the capacities
//! of a board; safety distances of 0.8 m to 3 m. Delays, speeds, pauses and the error of the
//! reported progress are random. `FLOCKMATE_SCHEDULES=N` flies N swarms in place of [`SWARMS`],
//! `FLOCKMATE_SCHEDULES_FROM=SEED` begins at another seed.

use std::collections::BTreeMap;

use flockmate_tests::number_from_env;
use flockmate_tests::swarms::{
    OwnPlan, Plan, Random, Swarm, WAYPOINTS, end_arc_length_m, position_at,
};
use planner_core::flight::{Flight, Gate, MAX_REPORTED_PROGRESS_LAG_M};
use planner_core::plan::PlanError;
use planner_core::schedule::ScheduleError;
use planner_core::track::deconflict::{self, DeconflictConfig, Method, Neighbour};
use rayon::prelude::*;

/// Number of swarms unless `FLOCKMATE_SCHEDULES` sets another.
const SWARMS: u64 = 200;
/// Hover from which the planner seeks another order, seconds.
const LONG_HOVER_S: f32 = 15.0;
/// Flight of the fastest vehicle in one step, metres.
const STEP_M: f32 = 0.3;

/// How one vehicle disturbs the schedule.
struct Manner {
    delay_s: f32,
    speed_mps: f32,
    /// Duration of its pauses, seconds, and the distance flown between two pauses, metres.
    pause: (f32, f32),
}

impl Manner {
    fn random(rng: &mut Random) -> Self {
        let mut drawn = |most: [f32; 3]| {
            let most = most[rng.below(3)];
            rng.uniform(0.0, most)
        };
        let (delay_s, pause_s) = (drawn([0.0, 40.0, 400.0]), drawn([0.0, 20.0, 200.0]));
        let speed_mps = 0.2 + drawn([0.5, 4.0, 12.0]);
        let between_m =
            if pause_s > 0.0 { rng.uniform(0.5, 15.0).max(0.02 * pause_s) } else { 1e9 };
        Self { delay_s, speed_mps, pause: (pause_s, between_m) }
    }
}

/// A gate, with the index of the flight that opens it.
struct Awaited {
    at_m: f32,
    other: usize,
    until_m: f32,
}

/// Flies a plan by progress; the error says which vehicles came too near, or are stuck.
fn fly(
    plan: &Plan,
    owns: &[OwnPlan],
    swarm: &Swarm,
    rng: &mut Random,
) -> Result<(f32, u64), String> {
    let (flights, safety_m) = (&plan.flights, swarm.safety_distance_m);
    let fastest_mps = (swarm.schedule.cruise_mps / 0.9).max(swarm.schedule.vertical_mps);
    let deconflict = DeconflictConfig {
        method: Method::Priority,
        safety_distance_m: safety_m,
        cruise_mps: fastest_mps,
        accel_mps2: 1.5,
    };
    let count = flights.len();
    let manners: Vec<Manner> = (0..count).map(|_| Manner::random(rng)).collect();
    let step_s = STEP_M / manners.iter().map(|m| m.speed_mps).fold(0.0, f32::max);
    let index = |id: u8| {
        flights.iter().position(|f| f.vehicle_id == id).expect("a gate names a vehicle of the plan")
    };
    let awaited = |g: &Gate| Awaited {
        at_m: g.at_m,
        other: index(g.wait_for_id),
        until_m: g.open_from_progress_m,
    };
    let gates: Vec<Vec<Awaited>> =
        owns.iter().map(|own| own.gates.iter().map(awaited).collect()).collect();
    assert!(
        gates.iter().all(|gates| gates.is_sorted_by_key(|g| g.at_m)),
        "gates come along the path"
    );
    let on_time = rng.one_in(2);
    let mut along: Vec<f32> = flights.iter().map(|f| -f.climb_m).collect();
    let (mut paused_s, mut next_pause_m) = (vec![0.0; count], vec![0.0; count]);
    for i in 0..count {
        next_pause_m[i] = along[i] + manners[i].pause.1;
    }
    let (mut smallest, mut still, mut held) = (f32::INFINITY, 0, 0_u64);
    for step in 0.. {
        let t_s = step as f32 * step_s;
        // The reported progress, too high or too low by the greatest error; on the ground it is
        // exact.
        let reported: Vec<f32> = (0..count)
            .map(|i| match along[i] {
                m if m <= -flights[i].climb_m => m,
                m if flights[i].task.leaves_pad() && m >= end_arc_length_m(&flights[i]) => m + 1.0,
                m => (m + rng.uniform(-1.0, 1.0).signum() * MAX_REPORTED_PROGRESS_LAG_M)
                    .min(end_arc_length_m(&flights[i])),
            })
            .collect();
        let states: Vec<Neighbour> = flights
            .iter()
            .zip(&reported)
            .map(|(f, &m)| Neighbour {
                id: f.vehicle_id,
                progress_m: Some(m),
                ..Neighbour::default()
            })
            .collect();
        let mut moved = false;
        for i in 0..count {
            let flight = &flights[i];
            let on_pad = along[i] <= -flight.climb_m;
            if on_pad
                && deconflict::has_late_neighbour(
                    &deconflict,
                    fastest_mps,
                    &owns[i].path,
                    &owns[i].gates,
                    &states,
                )
            {
                held += 1;
                continue;
            }
            let earliest_s = manners[i].delay_s + if on_time { flight.depart_s } else { 0.0 };
            let waits = on_pad && t_s < earliest_s;
            if along[i] >= next_pause_m[i] {
                next_pause_m[i] = along[i] + manners[i].pause.1;
                paused_s[i] = manners[i].pause.0;
            }
            if waits || paused_s[i] > 0.0 {
                paused_s[i] -= step_s;
                moved = true;
                continue;
            }
            let passed = gates[i].partition_point(|g| g.at_m < along[i] - 1e-3);
            let shut = |g: &&Awaited| reported[g.other] < g.until_m;
            let free = gates[i][passed..].iter().find(shut).map_or(f32::INFINITY, |g| g.at_m);
            let to_m =
                (along[i] + manners[i].speed_mps * step_s).min(free).min(end_arc_length_m(flight));
            if to_m > along[i] {
                along[i] = to_m;
                moved = true;
            }
        }
        let moves =
            |i: usize| along[i] > -flights[i].climb_m && along[i] < end_arc_length_m(&flights[i]);
        for i in 0..count {
            for j in (0..i).filter(|&j| moves(i) || moves(j)) {
                let apart = (position_at(&flights[i], along[i])
                    - position_at(&flights[j], along[j]))
                .norm();
                smallest = smallest.min(apart);
                if apart < safety_m - 1e-3 {
                    let [i, j] = [i, j]
                        .map(|i| format!("vehicle {} at {} m", flights[i].vehicle_id, along[i]));
                    return Err(format!("{apart:.2} m apart at {t_s:.1} s: {i}, {j}"));
                }
            }
        }
        if (0..count).all(|i| along[i] >= end_arc_length_m(&flights[i])) {
            return Ok((smallest, held));
        }
        // The error of a report changes each step: a gate may open later.
        still = if moved { 0 } else { still + 1 };
        if still > 40 {
            let stuck = |i: &usize| along[*i] < end_arc_length_m(&flights[*i]);
            let ids: Vec<u8> = (0..count).filter(stuck).map(|i| flights[i].vehicle_id).collect();
            return Err(format!("stuck at {t_s:.1} s: {ids:?}"));
        }
    }
    unreachable!("a flight ends or stands still")
}

#[derive(Debug, Default)]
struct Sum {
    swarms: u64,
    planned: u64,
    flights: u64,
    /// Number of plans that are `Ok` although a vehicle's part did not fit.
    unfit: u64,
    /// Number of steps in which a vehicle on its pad waited for a late one.
    held: u64,
    refused: BTreeMap<String, u64>,
    failures: Vec<String>,
    makespan_s: f64,
    /// Number of plans in which a vehicle hovers at one place for more than [`LONG_HOVER_S`].
    long_hovers: u64,
}

fn one(seed: u64) -> Sum {
    let mut rng = Random::new(seed);
    let swarm = Swarm::random(&mut rng);
    let mut sum = Sum { swarms: 1, ..Sum::default() };
    if swarm.tasks.len() < 2 {
        return sum;
    }
    let plan = match swarm.plan() {
        Ok(plan) => plan,
        Err(error) => {
            let name = match error {
                PlanError::Schedule(_, error) => format!("{error:?}"),
                error => format!("{error:?}").split('(').next().unwrap_or_default().to_owned(),
            };
            sum.refused.insert(name, 1);
            return sum;
        }
    };
    let owns: Result<Vec<OwnPlan>, ScheduleError> = swarm.vehicle_plans(&plan);
    let owns = match owns {
        Ok(owns) => owns,
        Err(error) => {
            sum.unfit = 1;
            sum.failures.push(format!("seed {seed}: Ok, but {error:?}"));
            return sum;
        }
    };
    sum.planned = 1;
    sum.flights = plan.flights.iter().filter(|f| f.task.leaves_pad()).count() as u64;
    let landed_s = |f: &Flight<WAYPOINTS>| {
        let last = f.path.waypoints().last().map_or(0.0, |w| w.leave_s);
        f.depart_s + last + f.descent_m / swarm.schedule.vertical_mps
    };
    let longest_hover_s = |f: &Flight<WAYPOINTS>| {
        f.path.waypoints().iter().map(|w| w.leave_s - w.arrive_s).fold(0.0, f32::max)
    };
    sum.long_hovers = u64::from(plan.flights.iter().any(|f| longest_hover_s(f) > LONG_HOVER_S));
    sum.makespan_s = f64::from(plan.flights.iter().map(landed_s).fold(0.0, f32::max));
    for _ in 0..2 {
        match fly(&plan, &owns, &swarm, &mut rng) {
            Ok((_, held)) => sum.held += held,
            Err(error) => {
                sum.failures.push(format!("seed {seed}: {error}"));
                break;
            }
        }
    }
    sum
}

#[test]
fn random_swarms_stay_apart_and_arrive_by_gates_alone() {
    let (first, count) = (
        number_from_env("FLOCKMATE_SCHEDULES_FROM", 1),
        number_from_env("FLOCKMATE_SCHEDULES", SWARMS),
    );
    let sums: Vec<Sum> = (first..first + count).into_par_iter().map(one).collect();
    let mut all = Sum::default();
    for sum in sums {
        all.swarms += sum.swarms;
        all.planned += sum.planned;
        all.flights += sum.flights;
        all.unfit += sum.unfit;
        all.held += sum.held;
        all.makespan_s += sum.makespan_s;
        all.long_hovers += sum.long_hovers;
        sum.refused
            .into_iter()
            .for_each(|(name, count)| *all.refused.entry(name).or_default() += count);
        all.failures.extend(sum.failures);
    }
    println!(
        "{} swarms, {} planned, {} flights, {} without all plans, {} steps held on pads, mean \
         makespan {:.2} s, {} with a hover of more than {LONG_HOVER_S} s, refused {:?}",
        all.swarms,
        all.planned,
        all.flights,
        all.unfit,
        all.held,
        all.makespan_s / all.planned.max(1) as f64,
        all.long_hovers,
        all.refused,
    );
    assert!(all.long_hovers * 20 < all.planned, "a vehicle hovers where another order avoids it");
    assert!(all.planned * 3 > all.swarms, "most swarms are refused: nothing is shown");
    assert!(all.held > all.flights, "no vehicle waits on its pad for a late one");
    let shown: Vec<_> = all.failures.iter().take(20).collect();
    assert!(all.failures.is_empty(), "{} of {}: {shown:#?}", all.failures.len(), all.swarms);
}
