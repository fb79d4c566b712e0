//! Areas that take more than one battery: each sortie comes home in time, and together they
//! photograph everything once.

use flockmate_tests::areas::{self, Shape};
use host_sim::coverage::check::{CoverageFindings, check_plan};
use host_sim::coverage::sorties::{BATTERY_SWAP_S, Sortie, USABLE_CHARGE};
use host_sim::coverage::{CoveragePlan, SortieFlight, export, flight};
use host_sim::scenario::coverage::CoverageMethod;
use host_sim::scenario::{self, Scenario};
use planner_core::coverage::pack::Route;
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Tolerance, as a factor: this test sums times in another order than the planner.
const ROUNDING: f32 = 1.0002;
/// Most lanes of a route for which every cut is tried.
const MOST_LANES: usize = 10;

/// The same scenario with batteries that last `endurance_s`.
fn with_batteries(text: &str, endurance_s: f32) -> String {
    let text = text.replace("[area]\n", "[area]\nbatteries = true\n");
    text.replace("speed_max_mps", &format!("endurance_s = {endurance_s}\nspeed_max_mps"))
}

/// Time of a route from pad to pad, with stops at both ends of each lane and over the pad, seconds.
fn flown_s(planned: &CoveragePlan<'_>, route: &Route) -> f32 {
    let points = flight::flight_points(planned, route);
    let steady_s = flight::passing_times_s(planned, route, &points)
        .last()
        .copied()
        .expect("a flight has points");
    let (speed, accel) = (planned.vehicles[usize::from(route.vehicle_index)].cruise_mps, 1.5f32);
    // Time lost by stops at both ends of a leg, seconds.
    let lost_s = |leg_m: f32| match leg_m < speed * speed / accel {
        true => 2.0 * (leg_m / accel).sqrt() - leg_m / speed,
        false => speed / accel,
    };
    let count = lanes(planned, route).len();
    let steps_s =
        (1..count).map(|_| lost_s(planned.area_settings.spacing.max_lane_spacing_m)).sum::<f32>();
    steady_s + (count + 2) as f32 * lost_s(f32::INFINITY) + steps_s
}

/// A route's lanes in path order, each cut to the waypoints that belong to the route.
fn lanes(planned: &CoveragePlan<'_>, route: &Route) -> Vec<Route> {
    let numbers: Vec<u32> = (route.lowest_waypoint..route.waypoint_end).collect();
    let lanes = numbers.chunk_by(|a, b| planned.tracks.lane_of(*a) == planned.tracks.lane_of(*b));
    lanes
        .map(|lane| Route {
            lowest_waypoint: lane[0],
            waypoint_end: lane[lane.len() - 1] + 1,
            ..*route
        })
        .collect()
}

/// The fewest sorties of at most `most_s` each: lanes are added to a sortie as long as they fit,
/// since no part takes longer than the whole. `None` if a lane alone does not fit.
fn fewest(planned: &CoveragePlan<'_>, route: &Route, most_s: f32) -> Option<usize> {
    let (mut count, mut first) = (1, route.lowest_waypoint);
    for lane in lanes(planned, route) {
        if flown_s(
            planned,
            &Route { lowest_waypoint: first, waypoint_end: lane.waypoint_end, ..*route },
        ) > most_s
        {
            (count, first) = (count + 1, lane.lowest_waypoint);
            if flown_s(planned, &lane) > most_s {
                return None;
            }
        }
    }
    Some(count)
}

/// The least total time of `count` sorties, by trying every cut, seconds.
fn least_s(planned: &CoveragePlan<'_>, route: &Route, count: usize, most_s: f32) -> f32 {
    let lanes = lanes(planned, route);
    let cuts = (0..1u32 << (lanes.len() - 1)).filter(|cut| cut.count_ones() as usize == count - 1);
    let total_s = |cut: u32| {
        let (mut sum_s, mut first) = (0.0, route.lowest_waypoint);
        for (i, lane) in lanes.iter().enumerate() {
            if i + 1 == lanes.len() || cut & (1 << i) != 0 {
                let own_s = flown_s(
                    planned,
                    &Route { lowest_waypoint: first, waypoint_end: lane.waypoint_end, ..*route },
                );
                sum_s += if own_s <= most_s { own_s } else { f32::INFINITY };
                first = lane.waypoint_end;
            }
        }
        sum_s
    };
    cuts.map(total_s).fold(f32::INFINITY, f32::min)
}

/// What was tested on one area.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    planned: usize,
    refused: usize,
    single: usize,
    several: usize,
    every_cut: usize,
}

fn judge_route(planned: &CoveragePlan<'_>, route: &Route, most_s: f32, seen: &mut Seen) {
    let sorties: Vec<_> = planned.sorties_of(route).collect();
    let flown: Vec<u32> = sorties.iter().flat_map(|sortie| sortie.route.waypoints()).collect();
    assert_eq!(
        flown,
        route.waypoints().collect::<Vec<_>>(),
        "the route's waypoints in their order"
    );
    for (sortie, number) in sorties.iter().zip(1..) {
        assert_eq!(
            (sortie.number, usize::from(sortie.sorties_of_vehicle)),
            (number, sorties.len())
        );
        assert_eq!((sortie.route.layer, sortie.route.direction), (route.layer, route.direction));
        let own_s = flown_s(planned, &sortie.route);
        assert!(own_s <= most_s * ROUNDING, "{own_s} s of {most_s}");
        assert!(
            (own_s - sortie.flight_duration_s).abs() <= own_s * (ROUNDING - 1.0),
            "{own_s} {sortie:?}"
        );
    }
    let few = [most_s * ROUNDING, most_s / ROUNDING].map(|most_s| fewest(planned, route, most_s));
    assert!(few[0].is_some_and(|few| few <= sorties.len()), "{few:?} {}", sorties.len());
    assert!(few[1].is_none_or(|few| few >= sorties.len()), "{few:?} {}", sorties.len());
    if sorties.len() == 1 {
        assert_eq!(sorties[0].route, *route);
        seen.single += 1;
        return;
    }
    seen.several += 1;
    if few[0] == few[1] && lanes(planned, route).len() <= MOST_LANES {
        let own_s: f32 = sorties.iter().map(|sortie| sortie.flight_duration_s).sum();
        let least_s = least_s(planned, route, sorties.len(), most_s * ROUNDING);
        assert!(own_s <= least_s * ROUNDING, "{own_s} s instead of {least_s}");
        seen.every_cut += 1;
    }
}

/// Asserts that all sorties of a round begin together, when the last one of the round before is
/// back.
fn judge_rounds(planned: &CoveragePlan<'_>) {
    let rounds: Vec<_> = planned.sorties.chunk_by(|a, b| a.number == b.number).collect();
    let mut begin_s = 0.0;
    for round in rounds {
        assert!(round.iter().all(|sortie| sortie.round_begin_s == begin_s), "{round:?}");
        assert!(round.iter().any(|sortie| sortie.departure_delay_s == 0.0), "{round:?}");
        begin_s = round.iter().map(Sortie::landing_s).fold(0.0, f32::max) + BATTERY_SWAP_S;
    }
}

fn written(planned: &CoveragePlan<'_>, flights: &[SortieFlight]) -> Vec<String> {
    let plan = |(sortie, points, _): &SortieFlight| {
        let items = export::flight_items(planned, sortie, points);
        export::qgc_plan(planned, &sortie.route, &items).to_string()
    };
    flights.iter().map(plan).chain([export::flights_csv(planned, flights)]).collect()
}

fn judge(seed: u64) -> Option<Seen> {
    let mut random = Pcg32::seed_from_u64(seed);
    let shape = if seed.is_multiple_of(2) { Shape::Any } else { Shape::Convex };
    let text = areas::scenario(&mut random, shape, 1 + (seed % 5) as usize);
    let methods =
        [CoverageMethod::SimpleBinpat, CoverageMethod::Binpat, CoverageMethod::PowellBinpat];
    let method = methods[(seed % 3) as usize];
    let plain = scenario::parse(&text, "plain").ok()?;
    let whole = CoveragePlan::new(&plain, method).ok()?;
    // Endurance from a little less than the longest lane takes alone to more than the longest route
    // takes.
    let routes = &whole.plan.routes;
    let alone = routes.iter().flat_map(|route| lanes(&whole, route));
    let least_s = 0.95 * alone.map(|lane| flown_s(&whole, &lane)).fold(0.0, f32::max);
    let longest_s = routes.iter().map(|route| flown_s(&whole, route)).fold(0.0, f32::max);
    let between_s = least_s + (1.1 * longest_s - least_s) * areas::unit_random(&mut random) as f32;
    let endurance_s = (between_s / USABLE_CHARGE * 10.0).round() / 10.0;
    let most_s = endurance_s * USABLE_CHARGE;
    let scenario: Scenario = scenario::parse(&with_batteries(&text, endurance_s), "batteries")
        .expect("only batteries are new");
    let mut seen = Seen::default();
    let planned = match CoveragePlan::new(&scenario, method) {
        Ok(planned) => planned,
        Err(error) => {
            let error = format!("{error:#}");
            assert!(error.contains("battery too small"), "seed {seed}: {error}");
            let short = |route: &&Route| fewest(&whole, route, most_s / ROUNDING).is_none();
            let routes: Vec<_> = whole.plan.routes.iter().filter(short).collect();
            let named = |route: &&Route| {
                error.contains(&format!(
                    "vehicle {} would fly",
                    plain.vehicles[usize::from(route.vehicle_index)].id
                ))
            };
            assert!(routes.iter().any(named), "seed {seed}: {error}");
            return Some(Seen { refused: 1, ..seen });
        }
    };
    assert_eq!(planned.plan, whole.plan, "seed {seed}: which vehicle flies what does not change");
    let findings = check_plan(&planned);
    assert!(
        findings.is_clean(),
        "seed {seed}: {:?}",
        CoverageFindings { new_cells_over_time: Vec::new(), ..findings }
    );
    for route in &planned.plan.routes {
        judge_route(&planned, route, most_s, &mut seen);
    }
    judge_rounds(&planned);
    if whole.sorties.iter().all(|sortie| sortie.flight_duration_s <= most_s) {
        let both = [&whole, &planned].map(|planned| written(planned, &planned.flights()));
        assert_eq!(both[0], both[1], "seed {seed}: one battery suffices");
        assert!(planned.sorties.iter().all(|sortie| sortie.sorties_of_vehicle == 1));
    }
    Some(Seen { planned: 1, ..seen })
}

/// `FLOCKMATE_SORTIES=N` judges N areas.
#[test]
fn each_sortie_comes_home_in_time_and_nothing_is_left_out() {
    let count = std::env::var("FLOCKMATE_SORTIES").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    let all: Vec<Seen> = (0..count).into_par_iter().filter_map(judge).collect();
    let sum = |of: fn(&Seen) -> usize| all.iter().map(of).sum::<usize>() as u64;
    let (planned, refused) = (sum(|s| s.planned), sum(|s| s.refused));
    let (single, several, every_cut) =
        (sum(|s| s.single), sum(|s| s.several), sum(|s| s.every_cut));
    println!(
        "{planned} areas planned, {refused} refused; {single} routes of one sortie, {several} of several, {every_cut} of \
         these beside every cut"
    );
    assert!(planned * 2 > count && refused > 0, "{planned} {refused}");
    assert!(
        single > count / 5 && several > count / 2 && every_cut > count / 5,
        "{single} {several} {every_cut}"
    );
}

#[test]
fn without_batteries_a_route_that_takes_longer_is_refused() {
    let text = "[area]\npolygon = [[0, 0], [300, 0], [300, 150], [0, 150]]\nlane_m = 10.0\nwaypoint_m = 8.0\n\
                [mission]\ncruise_mps = 5.0\n[[vehicles]]\nid = 7\nstart = [-10, 0, 0]\nspeed_max_mps = 9.0\n\
                endurance_s = 500\n";
    let sorties = |text: &str| -> Result<usize, String> {
        let scenario = scenario::parse(text, "one battery").expect("a scenario");
        let planned = CoveragePlan::new(&scenario, CoverageMethod::PowellBinpat)
            .map_err(|error| format!("{error:#}"))?;
        judge_route(&planned, &planned.plan.routes[0], 500.0 * USABLE_CHARGE, &mut Seen::default());
        Ok(planned.sorties.len())
    };
    let error = sorties(text).expect_err("it takes longer");
    assert!(error.contains("vehicle 7") && error.contains("batteries = true"), "{error}");
    assert_eq!(sorties(&text.replace("[area]\n", "[area]\nbatteries = true\n")), Ok(4));
    let short = text.replace("[area]\n", "[area]\nbatteries = true\n").replace("= 500", "= 100");
    let error = sorties(&short).expect_err("no lane fits");
    assert!(error.contains("battery too small") && error.contains("vehicle 7"), "{error}");
}
