//! Compares `exact` with brute force: all cuts, vehicles, layers and directions, with paths around
//! no-fly zones by a search of its own.

use flockmate_tests::areas::{self, Shape};
use host_sim::coverage::{CoveragePlan, divide_by_method};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario;
use host_sim::scenario::coverage::CoverageMethod;
use planner_core::coverage::Flat;
use planner_core::coverage::pack::{
    CoverageProblem, RouteDirection, RoutePlan, TrackUnit, Vehicle,
};
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Most waypoints of an area that is divided by brute force.
const MOST_WAYPOINTS: u32 = 12;

/// Lengths of the shortest paths among a plan's no-fly zones, metres.
struct Ways<'p, 'a> {
    planned: &'p CoveragePlan<'a>,
    /// Between each two corners of zones.
    corners_m: Vec<Vec<f64>>,
}

fn straight_m(a: &Flat, b: &Flat) -> f64 {
    f64::from(a.x - b.x).hypot(f64::from(a.y - b.y))
}

impl<'p, 'a> Ways<'p, 'a> {
    fn new(planned: &'p CoveragePlan<'a>) -> Self {
        let corners = planned.transit.corners();
        let row = |a: &Flat| corners.iter().map(|b| direct_m(planned, a, b)).collect();
        let mut corners_m: Vec<Vec<f64>> = corners.iter().map(row).collect();
        for over in 0..corners.len() {
            for from in 0..corners.len() {
                for to in 0..corners.len() {
                    let way_m = corners_m[from][over] + corners_m[over][to];
                    corners_m[from][to] = corners_m[from][to].min(way_m);
                }
            }
        }
        Self { planned, corners_m }
    }

    fn shortest_m(&self, a: &Flat, b: &Flat) -> f64 {
        let corners = self.planned.transit.corners();
        let ends = |place: &Flat| -> Vec<f64> {
            corners.iter().map(|corner| direct_m(self.planned, place, corner)).collect()
        };
        let (first_m, last_m) = (ends(a), ends(b));
        let mut least_m = direct_m(self.planned, a, b);
        for (first_m, row) in first_m.iter().zip(&self.corners_m) {
            for (between_m, last_m) in row.iter().zip(&last_m) {
                least_m = least_m.min(first_m + between_m + last_m);
            }
        }
        least_m
    }
}

/// Length of the straight line between two places, metres; infinite if it crosses a zone.
fn direct_m(planned: &CoveragePlan<'_>, a: &Flat, b: &Flat) -> f64 {
    if planned.transit.is_line_clear(a, b) { straight_m(a, b) } else { f64::INFINITY }
}

/// All that costs depend on: lengths in metres, by vehicle and waypoint.
struct Lengths {
    /// From the vehicle's place to each waypoint.
    out_m: Vec<Vec<f64>>,
    /// From each waypoint to the vehicle's home.
    home_m: Vec<Vec<f64>>,
    /// From each waypoint to the next.
    steps_m: Vec<f64>,
    /// Whether a zone lengthens a path between a waypoint and a vehicle's place or home.
    bent: bool,
}

impl Lengths {
    fn new(planned: &CoveragePlan<'_>, vehicles: &[Vehicle]) -> Self {
        let ways = Ways::new(planned);
        let places: Vec<Flat> = (0..planned.tracks.waypoint_count())
            .filter_map(|number| planned.tracks.waypoint(number))
            .collect();
        let mut bent = false;
        let mut all_m = |from: Flat| -> Vec<f64> {
            let way = |to: &Flat| {
                let way_m = ways.shortest_m(&from, to);
                bent |= way_m > straight_m(&from, to) * 1.001;
                way_m
            };
            places.iter().map(way).collect()
        };
        let out_m = vehicles.iter().map(|vehicle| all_m(vehicle.transit_start)).collect();
        let home_m = vehicles.iter().map(|vehicle| all_m(vehicle.home)).collect();
        let steps = places.windows(2).map(|pair| ways.shortest_m(&pair[0], &pair[1]));
        Self { out_m, home_m, steps_m: steps.collect(), bent }
    }
}

/// The smallest possible largest cost (s) of the waypoints from `from` on, divided among these
/// vehicles and layers, by brute force.
fn brute_force(
    lengths: &Lengths,
    work: &CoverageProblem<
        '_,
        { host_sim::coverage::MAX_LANES },
        { host_sim::coverage::MAX_NO_FLY_CORNERS },
    >,
    from: usize,
    vehicles: &[usize],
    layers: &[u8],
) -> f64 {
    let count = lengths.steps_m.len() + 1;
    if from == count {
        return 0.0;
    }
    let heights = work.heights;
    let mut best = f64::INFINITY;
    for (i, &v) in vehicles.iter().enumerate() {
        for (j, &layer) in layers.iter().enumerate() {
            let vehicle = &work.vehicles[v];
            let (out_m, home_m) = (&lengths.out_m[v], &lengths.home_m[v]);
            let top_m = f64::from(heights.max_picture_height_m)
                + f64::from(layer) * f64::from(heights.layer_spacing_m);
            let delay_s =
                top_m / f64::from(vehicle.climb_mps) + top_m / f64::from(vehicle.descend_mps);
            let mut inside_m = 0.0;
            for end in from + 1..=count {
                if end > from + 1 {
                    inside_m += lengths.steps_m[end - 2];
                }
                let forward_m = out_m[from] + home_m[end - 1];
                let backward_m = out_m[end - 1] + home_m[from];
                let transit_m = f64::min(forward_m, backward_m);
                let own_s = (inside_m + transit_m) / f64::from(vehicle.cruise_mps) + delay_s;
                let others = [&vehicles[..i], &vehicles[i + 1..]].concat();
                let above = [&layers[..j], &layers[j + 1..]].concat();
                best = best.min(own_s.max(brute_force(lengths, work, end, &others, &above)));
            }
        }
    }
    best
}

/// A random area, photographed from 100 m higher than drawn, so that it mostly has few waypoints.
fn drawn(seed: u64, shape: Shape) -> String {
    let mut random = Pcg32::seed_from_u64(seed);
    let text = areas::scenario(&mut random, shape, 1 + (seed % 3) as usize);
    text.replace("height_m = ", "height_m = 1")
}

/// The plan's vehicles with different speeds; except for every third area they end elsewhere than
/// they begin.
fn vehicles(seed: u64, planned: &CoveragePlan<'_>) -> Vec<Vehicle> {
    let mut random = Pcg32::seed_from_u64(seed ^ 0xE4AC7);
    let one = |vehicle: &Vehicle| {
        let mut speed = |low, high| areas::between(&mut random, low, high) as f32;
        let (cruise_mps, climb_mps, descend_mps) =
            (speed(1.0, 9.0), speed(0.5, 4.5), speed(0.5, 4.5));
        let moved = Flat::new(speed(-300.0, 300.0), speed(-300.0, 300.0));
        let elsewhere = !seed.is_multiple_of(3) && !planned.transit.is_in_no_fly_zone(&moved);
        let home = if elsewhere { moved } else { vehicle.home };
        Vehicle { home, cruise_mps, climb_mps, descend_mps, ..*vehicle }
    };
    planned.vehicles.iter().map(one).collect()
}

/// Counts of what was tested.
#[derive(Default)]
struct Tried {
    areas: usize,
    three: usize,
    bent: usize,
    backward: usize,
}

fn tried(seed: u64, shape: Shape) -> Option<Tried> {
    let text = drawn(seed, shape);
    let scenario = scenario::parse(&text, "random").ok()?;
    let planned = CoveragePlan::new(&scenario, CoverageMethod::Binpat).ok()?;
    if !(2..=MOST_WAYPOINTS).contains(&planned.tracks.waypoint_count()) {
        return None;
    }
    let vehicles = vehicles(seed, &planned);
    let work = CoverageProblem {
        tracks: &planned.tracks,
        transit: &planned.transit,
        vehicles: &vehicles,
        heights: planned.area_settings.heights,
        unit: TrackUnit::Waypoint,
        following: planned.terrain_following,
    };
    let mut plan = RoutePlan::<{ host_sim::coverage::MAX_AREA_VEHICLES }>::new();
    divide_by_method(&work, CoverageMethod::Exact, &mut plan).ok()?;
    let lengths = Lengths::new(&planned, &vehicles);
    let all: Vec<usize> = (0..vehicles.len()).collect();
    let layers: Vec<u8> = (1..=vehicles.len() as u8).collect();
    let best = brute_force(&lengths, &work, 0, &all, &layers);
    let found = f64::from(plan.max_cost_s());
    assert!((found - best).abs() <= best * 1e-4, "seed {seed}: {found} instead of {best}\n{text}");
    let backward = plan.routes.iter().any(|route| route.direction == RouteDirection::Backward);
    Some(Tried {
        areas: 1,
        three: usize::from(vehicles.len() == 3),
        bent: usize::from(lengths.bent),
        backward: usize::from(backward),
    })
}

#[test]
fn exact_is_what_trying_everything_finds() {
    let sum = |a: Tried, b: Tried| Tried {
        areas: a.areas + b.areas,
        three: a.three + b.three,
        bent: a.bent + b.bent,
        backward: a.backward + b.backward,
    };
    let of = |shape: Shape, seeds: u64| {
        let all = (0..seeds).into_par_iter().filter_map(|seed| tried(seed, shape));
        let Tried { areas, three, bent, backward } = all.reduce(Tried::default, sum);
        println!(
            "{shape:?}: {areas} areas tried, {three} by three, {bent} bent, {backward} backward"
        );
        [areas, three, bent, backward]
    };
    let [areas, three, _, backward] = of(Shape::Convex, 400);
    assert!(areas >= 50 && three >= 15 && backward >= 10);
    let [areas, three, bent, backward] = of(Shape::Any, 1200);
    assert!(areas >= 50 && three >= 15 && backward >= 10 && bent >= 20);
}

/// Companions plan from the vehicles' shares alone: they find an equally good division for an exact
/// one, or it is refused.
#[test]
fn exact_divisions_are_planned_by_companions_or_refused_by_name() {
    let one = |seed: u64| -> Option<bool> {
        let mut random = Pcg32::seed_from_u64(seed);
        let text = areas::scenario(&mut random, Shape::Convex, 2 + (seed % 4) as usize);
        let text = text
            .replacen("[area]\n", "[area]\nmethod = \"exact\"\n", 1)
            .replace("id = ", "endurance_s = 7200\nid = ");
        let scenario = scenario::parse(&text, "exact").ok()?;
        let best_s = CoveragePlan::plan_as_companions(&scenario).ok()?.plan.max_cost_s();
        match PreparedMission::prepare(scenario.clone(), &Progress::hidden()) {
            Ok(_) => {
                let powell = CoveragePlan::new(&scenario, CoverageMethod::PowellBinpat)
                    .expect("it was planned");
                assert!(best_s <= powell.plan.max_cost_s() * 1.0001, "seed {seed}");
                Some(true)
            }
            Err(error) => {
                let error = format!("{error:#}");
                let known = [
                    "least sum of their ways",
                    "too many corners",
                    "to land beside",
                    "cannot keep",
                    "pictures too low",
                ];
                assert!(known.iter().any(|why| error.contains(why)), "seed {seed}: {error}");
                error.contains(known[0]).then_some(false)
            }
        }
    };
    let all: Vec<bool> = (0..60_u64).into_par_iter().filter_map(one).collect();
    let flown = all.iter().filter(|flown| **flown).count();
    println!("{flown} of {} exact divisions are planned by companions", all.len());
    assert!(all.len() >= 20 && 2 * flown >= all.len(), "{flown} of {}", all.len());
}
