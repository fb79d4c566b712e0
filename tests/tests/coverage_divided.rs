//! Divisions of an area, computed without flights: whichever vehicles are lost, they leave no
//! waypoint out and give none twice.
//!
//! With `FLOCKMATE_DIVIDED=N` each test divides N areas.

use companion::swarm::fleet::VehicleDivisionInput;
use flockmate_tests::areas::Shape;
use flockmate_tests::{areas, number_from_env};
use host_sim::capacity::MAX_WAYPOINTS;
use host_sim::coverage::CoveragePlan;
use host_sim::mission::PreparedMission;
use host_sim::mission::stretches::next_division_inputs;
use host_sim::progress::Progress;
use host_sim::scenario;
use planner_core::Point;
use planner_core::flight::{Flight, Task};
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Whether a flight covers the first lanes of its route only: the next division gives the rest.
fn is_first_part(flight: &Flight<MAX_WAYPOINTS>) -> bool {
    matches!(&flight.task, Task::Photograph(photographs) if photographs.is_first_part)
}

/// Places of the pictures that a flight takes up to `along_m` of its path, metres ENU.
fn pictures(flight: &Flight<MAX_WAYPOINTS>, along_m: f32) -> Vec<Point> {
    let Task::Photograph(photographs) = &flight.task else { return Vec::new() };
    let places = photographs.stretches(&flight.path);
    let places =
        places.flat_map(|shots| (0..shots.count).map(move |k| shots.picture_arc_length_m(k)));
    places
        .filter(|at_m| *at_m <= along_m + 0.01)
        .filter_map(|at_m| flight.path.point_at(at_m))
        .collect()
}

/// Whichever vehicles are lost, and wherever the others hold, each waypoint is photographed once:
/// by the vehicle that kept it, or by the one that has it now.
#[test]
fn divisions_leave_nothing_out_and_give_nothing_twice() {
    // Number of divisions, and 1 if vehicles cannot pass each other in a further one.
    let one = |seed: u64| -> [usize; 2] {
        let mut random = Pcg32::seed_from_u64(seed);
        let vehicles = 2 + (random.next_u32() % 5) as usize;
        let text = areas::lossy_radio_scenario(&mut random, vehicles, 0.0);
        let scenario = scenario::parse(&text, "area").expect("a scenario");
        let Ok(mut mission) = PreparedMission::prepare(scenario, &Progress::hidden()) else {
            return [0; 2];
        };
        let Ok(mut plan) = mission.plan() else { return [0; 2] };
        if plan.flights.iter().any(is_first_part) {
            return [0; 2];
        }
        let mut whole: Vec<Point> =
            plan.flights.iter().flat_map(|f| pictures(f, f32::INFINITY)).collect();
        let (mut kept, mut divisions) = (Vec::new(), Vec::<Vec<VehicleDivisionInput>>::new());
        let mut lives = vec![true; vehicles];
        let mut divided = 0;
        for _ in 0..3 {
            let living: Vec<usize> = (0..vehicles).filter(|i| lives[*i]).collect();
            if living.len() < 2 {
                break;
            }
            lives[living[random.next_u32() as usize % living.len()]] = false;
            let input = |i: usize, random: &mut Pcg32| {
                let flight = &plan.flights[i];
                let dm = (flight.path.length_m() * 10.0) as u32;
                let on_pad = flight.climb_m > 0.0 && random.next_u32().is_multiple_of(5);
                let flown = if on_pad || dm == 0 { 0 } else { 1 + random.next_u32() % dm };
                VehicleDivisionInput { alive: lives[i], along_dm: flown.min(65_535) as u16 }
            };
            let inputs: Vec<VehicleDivisionInput> =
                (0..vehicles).map(|i| input(i, &mut random)).collect();
            let before = plan;
            divisions.push(inputs.clone());
            // There is no plan if vehicles hold so near to each other that no order of departures
            // is possible, or if a path would need more corners than it may have.
            match mission.plan_remaining(&[], divisions.iter().map(|inputs| &inputs[..])) {
                Ok(divided) => plan = divided,
                Err(error) => {
                    let text = format!("{error:#}");
                    let blocked = text.contains("cannot pass");
                    assert!(blocked || text.contains("too many corners"), "seed {seed}: {text}");
                    return [divided, usize::from(blocked)];
                }
            }
            if plan.flights.iter().any(is_first_part) {
                return [divided, 0];
            }
            divided += 1;
            for (flight, input) in before.flights.iter().zip(&inputs) {
                let mut done = pictures(flight, f32::from(input.along_dm) / 10.0);
                if !input.alive {
                    done.pop();
                }
                kept.extend(done);
            }
            for (i, flight) in plan.flights.iter().enumerate() {
                assert!(lives[i] || !flight.task.leaves_pad(), "seed {seed}: {i} is lost");
            }
            let mut all = kept.clone();
            all.extend(plan.flights.iter().flat_map(|f| pictures(f, f32::INFINITY)));
            let key = |p: &Point| [p.x, p.y];
            let order = |a: &Point, b: &Point| key(a).partial_cmp(&key(b)).expect("finite");
            assert_eq!(all.len(), whole.len(), "seed {seed}");
            whole.sort_by(order);
            for place in &all {
                let near = whole.iter().filter(|p| (*p - place).xy().norm() < 0.02).count();
                assert!(near >= 1, "seed {seed}: {place:?} is no waypoint");
            }
            for place in &whole {
                let taken = all.iter().filter(|p| (*p - place).xy().norm() < 0.02).count();
                let twins = whole.iter().filter(|p| (*p - place).xy().norm() < 0.02).count();
                assert_eq!(taken, twins, "seed {seed}: {place:?}");
            }
        }
        [divided, 0]
    };
    let count = number_from_env("FLOCKMATE_DIVIDED", 40);
    let all: Vec<[usize; 2]> = (0..count).into_par_iter().map(one).collect();
    let [divided, blocked] = [0, 1].map(|k| all.iter().map(|n| n[k]).sum::<usize>());
    println!("{divided} divisions of {count} areas, in {blocked} vehicles cannot pass each other");
    assert!(divided as u64 > count && 500 * blocked <= divided);
}

/// Routes that take more than one path each: no vehicle is lost, and all hold again and again.
#[test]
fn stretches_leave_nothing_out_and_give_nothing_twice() {
    let one = |seed: u64| -> usize {
        let mut random = Pcg32::seed_from_u64(seed);
        let text = areas::many_lanes_scenario(&mut random, Shape::Convex, 1 + (seed % 3) as usize);
        let Ok(scenario) = scenario::parse(&text, "area") else { return 0 };
        let Ok(mut mission) = PreparedMission::prepare(scenario, &Progress::hidden()) else {
            return 0;
        };
        let mut plan = mission.plan().expect("it was planned");
        let planned = CoveragePlan::plan_as_companions(&mission.scenario).expect("it was planned");
        let whole = (0..planned.tracks.waypoint_count())
            .filter_map(|number| planned.tracks.waypoint(number));
        let (mut kept, mut divisions) = (Vec::new(), Vec::<Vec<VehicleDivisionInput>>::new());
        while let Some(inputs) = next_division_inputs(&plan) {
            for (flight, input) in plan.flights.iter().zip(&inputs) {
                kept.extend(pictures(flight, input.along_m()));
            }
            divisions.push(inputs);
            plan = mission
                .plan_remaining(&[], divisions.iter().map(|inputs| &inputs[..]))
                .expect("it was divided before");
        }
        kept.extend(plan.flights.iter().flat_map(|flight| pictures(flight, f32::INFINITY)));
        let mut count = 0;
        for place in whole {
            count += 1;
            let taken = kept.iter().filter(|p| (p.xy() - place).norm() < 0.02).count();
            assert_eq!(taken, 1, "seed {seed}: {place:?}");
        }
        assert_eq!(kept.len(), count, "seed {seed}");
        divisions.len()
    };
    let count = number_from_env("FLOCKMATE_DIVIDED", 40);
    let divided: Vec<usize> = (0..count).into_par_iter().map(one).collect();
    let all: usize = divided.iter().sum();
    println!("{all} divisions of {count} areas, at most {:?}", divided.iter().max());
    assert!(all >= count as usize / 4);
}
