//! Random swarms, planned and then flown by progress alone: a vehicle obeys its gates and nothing else. None may come nearer
//! to another than the safety distance, none may wait forever, and a plan that is `Ok` has a part for every vehicle.
//!
//! Rooms, corridors with side rooms, and shafts; climbs and descents of 0.5 m to 30 m; pads on one floor or anywhere; 2 to 32
//! vehicles with the capacities of a board. Delays, speeds, pauses and the error of the reported progress are random.
//! `FLOCKMATE_SCHEDULES=N` flies N swarms in place of [`SWARMS`], `FLOCKMATE_SCHEDULES_FROM=SEED` begins at another seed.

use heapless::Vec as Bounded;
use planner_core::Point;
use planner_core::frames::Geodetic;
use planner_core::plan::{
    self, Mode, Objective, PlanError, PlanRequest, PlanWorkspace, SwarmPlan, VehicleTask,
};
use planner_core::roadmap::{self, Edge, RoadmapHeader, RoadmapView};
use planner_core::schedule::{Flight, ScheduleConfig, ScheduleError, ScheduleWorkspace, VehiclePlan};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Swarms flown where nothing else is asked for.
const SWARMS: u64 = 1500;
/// A board's capacities.
const NODES: usize = 4096;
const VEHICLES: usize = 32;
const WAYPOINTS: usize = 64;
const GATES: usize = 128;
const PIECES: usize = 2048;
/// What is kept between centres, metres; the schedule keeps [`STRAY_M`] more.
const SAFETY_M: f32 = 1.5;
const STRAY_M: f32 = 0.5;
/// What a reported progress may be wrong by, metres.
const PROGRESS_ERROR_M: f32 = 0.25;
/// One step of the flight, seconds.
const STEP_S: f32 = 0.1;

type Plan = SwarmPlan<VEHICLES, WAYPOINTS>;
type Own = VehiclePlan<WAYPOINTS, GATES>;

struct Random(Pcg32);

impl Random {
    fn uniform(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.0.next_u32() as f32 / u32::MAX as f32)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.0.next_u32() as usize) % bound
    }

    fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }
}

/// Boxes of free space that overlap.
struct Space(Vec<(Point, Point)>);

impl Space {
    fn random(rng: &mut Random) -> Self {
        let height = rng.uniform(1.0, 3.0);
        match rng.below(3) {
            // A room, every other one high.
            0 => {
                let height = if rng.one_in(2) { rng.uniform(3.0, 32.0) } else { height };
                let size = Point::new(rng.uniform(8.0, 35.0), rng.uniform(8.0, 35.0), height);
                Self(vec![(Point::zeros(), size)])
            }
            1 => {
                let (length, width) = (rng.uniform(15.0, 45.0), rng.uniform(0.5, 3.5));
                let mut boxes = vec![(Point::zeros(), Point::new(length, width, height))];
                for _ in 0..rng.below(3) {
                    let (at, wide) = (rng.uniform(2.0, length - 6.0), rng.uniform(1.5, 4.0));
                    boxes.push((Point::new(at, 0.0, 0.0), Point::new(at + wide, width + 5.0, height)));
                }
                Self(boxes)
            }
            _ => {
                let size = Point::new(rng.uniform(1.0, 5.0), rng.uniform(1.0, 5.0), rng.uniform(8.0, 35.0));
                // Rooms beside it at the bottom and at the top.
                let (low, high) = (Point::new(-10.0, -4.0, 0.0), Point::new(10.0, 8.0, 2.0));
                let lift = Point::new(0.0, 0.0, size.z - 2.0);
                Self(vec![(Point::zeros(), size), (low, high), (low + lift, high + lift)])
            }
        }
    }

    fn point(&self, rng: &mut Random) -> Point {
        let (low, high) = self.0[rng.below(self.0.len())];
        Point::new(rng.uniform(low.x, high.x), rng.uniform(low.y, high.y), rng.uniform(low.z, high.z))
    }

    fn holds(&self, p: &Point) -> bool {
        let inside = |(low, high): &(Point, Point)| (0..3).all(|a| low[a] <= p[a] && p[a] <= high[a]);
        self.0.iter().any(inside)
    }

    fn sees(&self, a: &Point, b: &Point) -> bool {
        let steps = ((b - a).norm() / 0.5).ceil() as usize;
        (1..steps).all(|i| self.holds(&(a + (b - a) * (i as f32 / steps as f32))))
    }
}

/// A swarm and the roadmap it is planned on.
struct Swarm {
    roadmap: Vec<u8>,
    tasks: Vec<VehicleTask>,
    descents_m: Vec<f32>,
    mode: Mode,
    schedule: ScheduleConfig,
}

impl Swarm {
    fn random(rng: &mut Random) -> Self {
        let space = Space::random(rng);
        let wanted = if rng.one_in(20) { 9 + rng.below(24) } else { 2 + rng.below(7) };
        let parked_separation_m = [1.7, 1.75, 1.9, 2.3][rng.below(4)];
        // Between centres that stand: mostly such that a plan can be expected.
        let apart_m = [0.6, 1.8, 2.05, 2.35, 2.6, 3.0][rng.below(6)];
        let highest_m = [1.5, 8.0, 30.0][rng.below(3)];
        let one_floor = rng.one_in(2);
        let mut places = || {
            let (mut places, mut heights): (Vec<Point>, Vec<f32>) = Default::default();
            for _ in 0..40 * wanted {
                let place = space.point(rng);
                let height = 0.5 + rng.uniform(0.0, 1.0) * (highest_m - 0.5);
                let height = if one_floor { place.z + 0.5 } else { height };
                let ground = place - Point::new(0.0, 0.0, height);
                let apart =
                    |(p, h): (&Point, &f32)| (p - Point::new(0.0, 0.0, *h) - ground).norm() >= apart_m;
                if height <= 30.0 && places.iter().zip(&heights).all(apart) {
                    places.push(place);
                    heights.push(height);
                }
                if places.len() == wanted {
                    break;
                }
            }
            (places, heights)
        };
        let ((mut nodes, mut climbs_m), (mut goals, mut descents_m)) = (places(), places());
        let count = nodes.len().min(goals.len());
        nodes.truncate(count);
        climbs_m.truncate(count);
        goals.truncate(count);
        descents_m.truncate(count);
        nodes.append(&mut goals);
        nodes.extend((0..40 + rng.below(80)).map(|_| space.point(rng)));
        let mut edges = Vec::new();
        for a in 0..nodes.len() {
            for b in a + 1..nodes.len() {
                let length = (nodes[a] - nodes[b]).norm();
                if (0.1..8.0).contains(&length) && space.sees(&nodes[a], &nodes[b]) {
                    edges.push(Edge { a: a as u16, b: b as u16, clearance_m: 1.0 });
                }
            }
        }
        let header = RoadmapHeader {
            origin: Geodetic::default(),
            edge_min_m: 0.1,
            edge_max_m: 8.0,
            tested_clearance_m: 0.0,
            max_clearance_m: 4.0,
            starts: count as u16,
            goals: count as u16,
        };
        let mut bytes = vec![0; roadmap::encoded_len(nodes.len(), edges.len(), 0).unwrap()];
        roadmap::write(&header, &nodes, &edges, &mut bytes).unwrap();
        let labelled = rng.one_in(2);
        let task = |(i, &climb_m): (usize, &f32)| VehicleTask {
            id: 1 + i as u8,
            required_clearance_m: 0.8,
            climb_m,
            goal: labelled.then_some(i as u16),
        };
        let mode = if labelled { Mode::Labelled } else { Mode::Unlabelled(Objective::TotalDistance) };
        let schedule = ScheduleConfig {
            separation_m: SAFETY_M + STRAY_M,
            parked_separation_m,
            cruise_mps: rng.uniform(0.5, 5.0),
            vertical_mps: rng.uniform(0.5, 2.0),
        };
        Self {
            roadmap: bytes,
            tasks: climbs_m.iter().enumerate().map(task).collect(),
            descents_m,
            mode,
            schedule,
        }
    }

    fn plan(&self, ws: &mut PlanWorkspace<NODES, VEHICLES, PIECES>, out: &mut Plan) -> Result<(), PlanError> {
        let view = RoadmapView::parse(&self.roadmap).expect("written above");
        let request = PlanRequest {
            vehicles: &self.tasks,
            descents_m: &self.descents_m,
            mode: self.mode,
            schedule: self.schedule,
            gates_most: GATES,
        };
        plan::plan_swarm(&view, &request, ws, out)
    }
}

/// How one vehicle disturbs the schedule.
struct Manner {
    delay_s: f32,
    speed_mps: f32,
    /// It stands for this long whenever it has flown as far as the second number, metres.
    pause: (f32, f32),
}

/// Where a vehicle is at an arc length.
fn place(flight: &Flight<WAYPOINTS>, along_m: f32) -> Point {
    let below_m = (-along_m).max(along_m - flight.path.length_m()).max(0.0);
    flight.path.point_at(along_m).unwrap() - Point::new(0.0, 0.0, below_m)
}

fn end_m(flight: &Flight<WAYPOINTS>) -> f32 {
    if flight.goal.is_some() { flight.path.length_m() + flight.descent_m } else { -flight.climb_m }
}

/// Flies a plan by progress; the error says which vehicles came too near, or are stuck.
fn fly(plan: &Plan, owns: &[Own], rng: &mut Random) -> Result<f32, String> {
    let flights = &plan.flights;
    let count = flights.len();
    let manners: Vec<Manner> = (0..count)
        .map(|_| Manner {
            delay_s: if rng.one_in(2) { rng.uniform(0.0, 40.0) } else { 0.0 },
            speed_mps: rng.uniform(0.3, 4.0),
            pause: if rng.one_in(3) { (rng.uniform(0.0, 20.0), rng.uniform(0.5, 15.0)) } else { (0.0, 1e9) },
        })
        .collect();
    let on_time = rng.one_in(2);
    let mut along: Vec<f32> = flights.iter().map(|f| -f.climb_m).collect();
    let (mut paused_s, mut next_pause_m) = (vec![0.0; count], vec![0.0; count]);
    for i in 0..count {
        next_pause_m[i] = along[i] + manners[i].pause.1;
    }
    let (mut smallest, mut still) = (f32::INFINITY, 0);
    for step in 0.. {
        let t_s = step as f32 * STEP_S;
        // What was reported: wrong by as much as may be; on the ground it is known.
        let reported: Vec<f32> = (0..count)
            .map(|i| match along[i] {
                m if m <= -flights[i].climb_m => m,
                m if flights[i].goal.is_some() && m >= end_m(&flights[i]) => m + 1.0,
                m => m + rng.uniform(-1.0, 1.0).signum() * PROGRESS_ERROR_M,
            })
            .collect();
        let mut moved = false;
        for i in 0..count {
            let flight = &flights[i];
            let earliest_s = manners[i].delay_s + if on_time { flight.depart_s } else { 0.0 };
            let waits = along[i] <= -flight.climb_m && t_s < earliest_s;
            if along[i] >= next_pause_m[i] {
                next_pause_m[i] = along[i] + manners[i].pause.1;
                paused_s[i] = manners[i].pause.0;
            }
            if waits || paused_s[i] > 0.0 {
                paused_s[i] -= STEP_S;
                moved = true;
                continue;
            }
            let shut =
                |id: u8, until_m: f32| reported[flights.iter().position(|f| f.id == id).unwrap()] < until_m;
            let free = owns[i]
                .gates
                .iter()
                .filter(|g| g.at_m >= along[i] - 1e-3 && shut(g.id, g.until_m))
                .map(|g| g.at_m)
                .fold(f32::INFINITY, f32::min);
            let to_m = (along[i] + manners[i].speed_mps * STEP_S).min(free).min(end_m(flight));
            if to_m > along[i] {
                along[i] = to_m;
                moved = true;
            }
        }
        let moves = |i: usize| along[i] > -flights[i].climb_m && along[i] < end_m(&flights[i]);
        for i in 0..count {
            for j in (0..i).filter(|&j| moves(i) || moves(j)) {
                let apart = (place(&flights[i], along[i]) - place(&flights[j], along[j])).norm();
                smallest = smallest.min(apart);
                if apart < SAFETY_M - 1e-3 {
                    let [i, j] = [i, j].map(|i| format!("vehicle {} at {} m", flights[i].id, along[i]));
                    return Err(format!("{apart:.2} m apart at {t_s:.1} s: {i}, {j}"));
                }
            }
        }
        if (0..count).all(|i| along[i] >= end_m(&flights[i])) {
            return Ok(smallest);
        }
        // The error of a report changes each step: a gate may open later.
        still = if moved { 0 } else { still + 1 };
        if still > 40 {
            let stuck = |i: &usize| along[*i] < end_m(&flights[*i]);
            let ids: Vec<u8> = (0..count).filter(stuck).map(|i| flights[i].id).collect();
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
    /// `Ok`, but a vehicle's part did not fit.
    unfit: u64,
    refused: std::collections::BTreeMap<String, u64>,
    failures: Vec<String>,
    makespan_s: f64,
}

fn one(seed: u64) -> Sum {
    let mut rng = Random(Pcg32::seed_from_u64(seed));
    let swarm = Swarm::random(&mut rng);
    let mut sum = Sum { swarms: 1, ..Sum::default() };
    if swarm.tasks.len() < 2 {
        return sum;
    }
    let mut ws = host_sim::capacity::on_heap(PlanWorkspace::<NODES, VEHICLES, PIECES>::new);
    let mut plan = Box::new(Plan::new());
    if let Err(error) = swarm.plan(&mut ws, &mut plan) {
        let name = match error {
            PlanError::Schedule(_, error) => format!("{error:?}"),
            error => format!("{error:?}").split('(').next().unwrap_or_default().to_owned(),
        };
        sum.refused.insert(name, 1);
        return sum;
    }
    let mut workspace = ScheduleWorkspace::default();
    let owns: Result<Vec<Own>, ScheduleError> = (0..plan.flights.len())
        .map(|index| {
            let mut own = Own { gates: Bounded::new(), ..Own::default() };
            plan::vehicle_plan(&plan, index, &swarm.schedule, &mut workspace, &mut own).map(|()| own)
        })
        .collect();
    let owns = match owns {
        Ok(owns) => owns,
        Err(error) => {
            sum.unfit = 1;
            sum.failures.push(format!("seed {seed}: Ok, but {error:?}"));
            return sum;
        }
    };
    sum.planned = 1;
    sum.flights = plan.flights.iter().filter(|f| f.goal.is_some()).count() as u64;
    let landed_s = |f: &Flight<WAYPOINTS>| {
        let last = f.path.waypoints().last().map_or(0.0, |w| w.leave_s);
        f.depart_s + last + f.descent_m / swarm.schedule.vertical_mps
    };
    sum.makespan_s = f64::from(plan.flights.iter().map(landed_s).fold(0.0, f32::max));
    for _ in 0..2 {
        if let Err(error) = fly(&plan, &owns, &mut rng) {
            sum.failures.push(format!("seed {seed}: {error}"));
            break;
        }
    }
    sum
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

#[test]
fn random_swarms_stay_apart_and_arrive_by_gates_alone() {
    let (first, count) = (number("FLOCKMATE_SCHEDULES_FROM", 1), number("FLOCKMATE_SCHEDULES", SWARMS));
    let sums: Vec<Sum> = (first..first + count).into_par_iter().map(one).collect();
    let mut all = Sum::default();
    for sum in sums {
        all.swarms += sum.swarms;
        all.planned += sum.planned;
        all.flights += sum.flights;
        all.unfit += sum.unfit;
        all.makespan_s += sum.makespan_s;
        sum.refused.into_iter().for_each(|(name, count)| *all.refused.entry(name).or_default() += count);
        all.failures.extend(sum.failures);
    }
    println!(
        "{} swarms, {} planned, {} flights, {} without all plans, mean makespan {:.2} s, refused {:?}",
        all.swarms,
        all.planned,
        all.flights,
        all.unfit,
        all.makespan_s / all.planned.max(1) as f64,
        all.refused,
    );
    assert!(all.planned * 3 > all.swarms, "most swarms are refused: nothing is shown");
    let shown: Vec<_> = all.failures.iter().take(20).collect();
    assert!(all.failures.is_empty(), "{} of {}: {shown:#?}", all.failures.len(), all.swarms);
}
