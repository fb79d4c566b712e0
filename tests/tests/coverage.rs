//! Coverage plans, judged by host-sim's checker of plans: everything photographed, every waypoint
//! once, no leg in a no-fly zone.

use flockmate_tests::areas::{self, Shape};
use flockmate_tests::costs::Costs;
use flockmate_tests::shared_data;
use host_sim::coverage::CoveragePlan;
use host_sim::coverage::check::{CoverageFindings, check_plan};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario::coverage::CoverageMethod;
use host_sim::scenario::{self, Scenario};
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Number of random areas: 1000, or `FLOCKMATE_AREAS`.
fn areas() -> u64 {
    std::env::var("FLOCKMATE_AREAS").ok().and_then(|n| n.parse().ok()).unwrap_or(1000)
}

fn findings(scenario: &Scenario, method: CoverageMethod) -> Result<CoverageFindings, String> {
    let planned = CoveragePlan::new(scenario, method).map_err(|error| format!("{error:#}"))?;
    Ok(check_plan(&planned))
}

#[test]
fn random_areas_are_covered() {
    const METHODS: [CoverageMethod; 3] =
        [CoverageMethod::SimpleBinpat, CoverageMethod::Binpat, CoverageMethod::PowellBinpat];
    let outcome = |seed: u64| -> Result<bool, String> {
        let mut random = Pcg32::seed_from_u64(seed);
        let mut text = areas::scenario(&mut random, Shape::Any, 1 + (seed % 10) as usize);
        if seed % 5 == 4 {
            text = areas::without_overlap(&mut random, &text);
        }
        let Ok(scenario) = scenario::parse(&text, "random") else { return Ok(false) };
        let findings = match findings(&scenario, METHODS[(seed % 3) as usize]) {
            Ok(findings) => findings,
            Err(error) if error.contains("no-fly zone") => return Ok(false),
            Err(error) => return Err(format!("seed {seed}: {error}\n{text}")),
        };
        if findings.is_clean() && findings.cells_to_cover > 0 {
            Ok(true)
        } else {
            Err(format!(
                "seed {seed}: {:?}\n{text}",
                CoverageFindings { new_cells_over_time: Vec::new(), ..findings }
            ))
        }
    };
    // Twice as many are drawn, since some are no valid areas, or zones close them.
    let all: Vec<_> = (0..areas() * 2).into_par_iter().map(outcome).collect();
    let wrong: Vec<_> = all.iter().filter_map(|outcome| outcome.as_ref().err()).collect();
    for wrong in wrong.iter().take(60) {
        println!("{}\n", wrong.chars().take(2500).collect::<String>());
    }
    let planned = all.iter().filter(|outcome| matches!(outcome, Ok(true))).count() as u64;
    println!("{planned} of {} areas planned, {} wrong", all.len(), wrong.len());
    assert!(wrong.is_empty() && planned >= areas(), "{planned} planned, {} wrong", wrong.len());
}

/// Fields a little wider than a whole number of lanes, with pictures that do not overlap; with and
/// without a zone in them.
#[test]
fn fields_a_little_wider_than_their_lanes_are_covered() {
    let mut random = Pcg32::seed_from_u64(0x51DE);
    let mut wrong = Vec::new();
    for case in 0..600 {
        let (lane_m, lanes) = (areas::between(&mut random, 2.0, 20.0), 1 + case % 4);
        // From less than a rounding error to a twentieth of a lane.
        let more_m = lane_m * 10f64.powf(areas::between(&mut random, -7.0, -1.3));
        let (width_m, long_m) = (lane_m * f64::from(lanes) + more_m, lane_m * 12.0);
        let [east_m, north_m] = [0, 1].map(|_| areas::between(&mut random, -200.0, 200.0));
        let box_of = |low: [f64; 2], high: [f64; 2]| {
            let [l, b, r, t] =
                [east_m + low[0], north_m + low[1], east_m + high[0], north_m + high[1]];
            format!("[[{l:.7}, {b:.7}], [{r:.7}, {b:.7}], [{r:.7}, {t:.7}], [{l:.7}, {t:.7}]]")
        };
        let at = [0.3 * long_m, areas::between(&mut random, 0.0, 0.8) * width_m];
        let zone = box_of(at, [at[0] + 0.1 * long_m, at[1] + 0.2 * lane_m]);
        let no_fly = if case % 2 == 0 { format!("no_fly = [{zone}]\n") } else { String::new() };
        let text = format!(
            "[area]\ncoordinates = \"metres\"\norigin = {{ lat_deg = 40.3, lon_deg = -3.7, alt_m = 700.0 }}\n\
             polygon = {}\n{no_fly}height_m = 20.0\nlane_m = {lane_m:.7}\nwaypoint_m = {lane_m:.7}\n\
             [[vehicles]]\nid = 1\nspeed_max_mps = 20.0\nstart = [{east_m:.2}, {:.2}, 0.0]\n",
            box_of([0.0; 2], [long_m, width_m]),
            north_m - 20.0
        );
        let scenario =
            scenario::parse(&text, "field").unwrap_or_else(|error| panic!("{error:#}\n{text}"));
        let findings = findings(&scenario, CoverageMethod::PowellBinpat)
            .unwrap_or_else(|error| panic!("{error}\n{text}"));
        if !findings.is_clean() {
            wrong.push((case, more_m / lane_m, findings.covered_share));
        }
    }
    assert!(wrong.is_empty(), "{} of 600: {:?}", wrong.len(), &wrong[..wrong.len().min(8)]);
}

/// `FLOCKMATE_AREAS=1000` takes minutes in a debug build: `exact` visits 2²⁰ states for ten
/// vehicles.
#[test]
fn powell_is_no_worse_than_binpat_and_exact_is_the_best() {
    let count = std::env::var("FLOCKMATE_AREAS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    let costs = Costs::of(0..count);
    println!("{costs:?}");
    assert!(costs.areas as u64 > count / 2, "{}", costs.areas);
    assert_eq!(costs.powell_over_binpat, 0, "POWELL is worse than BINPAT");
    assert_eq!(costs.plans_below_exact, 0, "`exact` is not the best");
    assert!(
        costs.powell_over_simple * 20 <= costs.areas && costs.median_gaps_percent[2] <= 8.0,
        "{costs:?}"
    );
}

/// A scenario without vehicles whose area is a real file, with the keys `area` besides.
fn real(file: &std::path::Path, area: &str) -> String {
    format!("[area]\nfile = '{}'\n{area}\n[mission]\ncruise_mps = 5.0\n", file.display())
}

#[test]
fn real_areas_are_covered() {
    let wide = "camera = { fov_deg = 73.7, aspect = 1.5 }\nheight_m = 35.0";
    let narrow = "coordinates = \"metres\"\nlane_m = 1.0\nwaypoint_m = 1.0";
    let files = [
        ("coverage/12.json", narrow),
        ("coverage/13.json", narrow),
        ("coverage/fiboa-example.json", wide),
        ("coverage/fields2cover_test.json", wide),
        ("coverage/fields2cover_test_2_cell.json", wide),
        ("plans/qgroundcontrol_sample_with_survey.plan", "lane_m = 10.0\nwaypoint_m = 5.0"),
    ];
    for (name, area) in files {
        let Some(path) = shared_data(name) else { return };
        let mut text = real(&path, area);
        for id in 1..=3 {
            text += &format!(
                "[[vehicles]]\nid = {id}\nspeed_max_mps = 20.0\nstart = [{}, 0.0, 0.0]\n",
                3 * id
            );
        }
        let scenario = scenario::parse(&text, name).unwrap_or_else(|error| panic!("{error}"));
        for method in [
            CoverageMethod::SimpleBinpat,
            CoverageMethod::Binpat,
            CoverageMethod::PowellBinpat,
            CoverageMethod::Exact,
        ] {
            let planned = CoveragePlan::new(&scenario, method)
                .unwrap_or_else(|error| panic!("{name}: {error:#}"));
            let found = check_plan(&planned);
            println!(
                "{name} {}: {} lanes, {} waypoints, {} cells, {:.1} s, bound {:.1} s",
                method.name(),
                planned.tracks.lanes().len(),
                found.photos,
                found.cells_to_cover,
                planned.plan.max_cost_s(),
                planned.lower_bound_s
            );
            assert!(
                found.is_clean(),
                "{name}: {:?}",
                CoverageFindings { new_cells_over_time: Vec::new(), ..found }
            );
        }
    }
}

#[test]
fn files_without_an_area_are_refused_by_name() {
    for (name, why) in [
        ("coverage/darp_inputVariables.json", "is not GeoJSON"),
        ("plans/qgroundcontrol_sample.plan", "holds no polygon"),
        ("plans/qgroundcontrol_sample_with_structured_scan.plan", "holds no polygon"),
        (
            "plans/qgroundcontrol_sample_wrong_overall_version.plan",
            "is not a plan of QGroundControl",
        ),
    ] {
        let Some(path) = shared_data(name) else { return };
        let text = real(&path, "lane_m = 10.0") + "[[vehicles]]\nid = 1\nstart = [0, 0, 0]\n";
        let error = scenario::parse(&text, name).expect_err(name);
        assert!(error.why.contains(why), "{name}: {error}");
    }
}

/// Invalid and extreme areas: the error says why one is refused, or the plan is right.
#[test]
fn bad_areas_are_refused_by_name_or_covered() {
    let many: Vec<String> = (0..10_000)
        .map(|i| {
            let angle = f64::from(i) / 10_000.0 * std::f64::consts::TAU;
            format!("[{:.4}, {:.4}]", 900.0 * angle.cos(), 700.0 * angle.sin())
        })
        .collect();
    let many = format!("[{}]", many.join(","));
    let degrees = "[{ lat_deg = -17.0, lon_deg = 179.999 }, { lat_deg = -17.0, lon_deg = -179.999 }, \
                   { lat_deg = -16.999, lon_deg = -179.999 }, { lat_deg = -16.999, lon_deg = 179.999 }]";
    let square = "[[0, 0], [100, 0], [100, 80], [0, 80]]";
    let cases = [
        (
            "[[0, 0], [100, 100], [100, 0], [0, 100]]",
            "",
            "vertex 0 of polygon 0 and from vertex 2 of",
        ),
        ("[[0, 0], [50, 50], [100, 100]]", "", "encloses nothing"),
        ("[[0, 0], [100, 0], [0, 0], [100, 0]]", "", "encloses nothing"),
        ("[[0, 0], [100, 0]]", "", "at least three places"),
        ("[[0, 0], [0, 0], [0, 0]]", "", "at least three places"),
        ("[]", "", "at least three places"),
        ("[[0, 0], [100, 0], [nan, 80]]", "", "must be a number"),
        ("[[0, 0], [100, 0], [inf, 80]]", "", "must be a number"),
        ("[[0, 0], [100, 0], [100, 80], [1e6, 5]]", "", "km from the origin"),
        ("[[0, 0], [0.004, 0], [0.004, 0.003]]", "", "area is 0.004"),
        (square, "holes = [[[200, 0], [210, 0], [210, 10]]]", "lies outside every polygon"),
        (square, "holes = [[[90, 10], [120, 10], [120, 20]]]", "cross"),
        (
            square,
            "holes = [[[20, 20], [50, 20], [50, 50]], [[20, 20], [50, 20], [50, 50]]]",
            "hole 0 and hole 1 overlap",
        ),
        (
            square,
            "holes = [[[20, 20], [60, 20], [60, 70]], [[40, 25], [55, 25], [55, 35]]]",
            "hole 0 and hole 1 overlap",
        ),
        (
            square,
            "holes = [[[-20, 0], [20, 0], [20, 80], [-20, 80]]]",
            "reaches out of its polygon",
        ),
        (
            square,
            "holes = [[[-20, -20], [120, -20], [120, 100], [-20, 100]]]",
            "reaches out of its polygon",
        ),
        (square, "holes = [[[0, 0], [100, 0], [100, 80], [0, 80]]]", "holes leave nothing"),
        (
            square,
            "holes = [[[10, 10], [20, 20], [20, 10], [10, 20]]]",
            "vertex 0 of hole 0 and from vertex 2 of",
        ),
        (
            square,
            "no_fly = [[[-10, -10], [-10, 90], [110, 90], [110, -10]]]",
            "hold the whole area",
        ),
        (
            square,
            "coordinates = \"wgs84\"\norigin = { lat_deg = 0, lon_deg = 0, alt_m = 0 }",
            "km from the origin",
        ),
        ("[[0, 0], [100, 0], [100, 99], [0, 99]]", "coordinates = \"wgs84\"", "no place on earth"),
        (square, "", ""),
        ("[[0, 0], [400, 0], [400, 0.05], [0, 0.05]]", "", ""),
        (
            square,
            "holes = [[[20, 20], [50, 20], [50, 50], [20, 50]], [[50, 20], [60, 20], [60, 50], [50, 50]]]",
            "",
        ),
        ("[[0, 0], [0, 0], [100, 0], [100, 0], [100, 80], [0, 80], [0, 0]]", "", ""),
        ("[[0, 0], [50, 0], [100, 0], [100, 80], [0, 80]]", "", ""),
        ("[[0, 0], [100, 0], [100, 3], [0, 3]]", "", ""),
        ("[[0, 0], [3, 0], [3, 2], [0, 2]]", "", ""),
        (square, "holes = [[[0, 10], [20, 10], [20, 20]]]", ""),
        (square, "no_fly = [[[-10, 10], [120, 10], [120, 20], [-10, 20]]]", ""),
        (degrees, "", ""),
        (&many, "", ""),
    ];
    for (polygon, more, why) in cases {
        let shown = &polygon[..polygon.len().min(80)];
        let text = format!(
            "[area]\npolygon = {polygon}\n{more}\nlane_m = 10.0\nwaypoint_m = 8.0\ncamera = {{ fov_deg = 73.7 }}\n\
             height_m = 15.0\n[[vehicles]]\nid = 1\nstart = [-30, -30, 0]\n[[vehicles]]\nid = 2\nstart = [-30, -40, 0]\n"
        );
        let planned = scenario::parse(&text, "bad").map_err(anyhow::Error::new);
        let found = match &planned {
            Ok(scenario) => findings(scenario, CoverageMethod::PowellBinpat),
            Err(error) => Err(error.to_string()),
        };
        match found {
            Ok(found) if why.is_empty() => {
                let judged = found.cells_to_cover > 0 && found.is_clean();
                assert!(
                    judged,
                    "{shown}: {:?}",
                    CoverageFindings { new_cells_over_time: Vec::new(), ..found }
                );
            }
            Err(error) if !why.is_empty() => {
                assert!(error.contains(why), "{shown} {more}: {error}");
            }
            other => panic!("{shown} {more}: {other:?}, expected {why:?}"),
        }
    }
}

/// Scenarios that the vehicles cannot fly: the error says why, for `cover` and `fly`.
#[test]
fn what_cannot_be_flown_is_refused_by_name() {
    let start = "start = [6, -10, 0]";
    let plan = |mission: &str, first: &str, more: &str| {
        let text = format!(
            "[area]\npolygon = [[0, 0], [120, 0], [120, 80], [0, 80]]\ncamera = {{ fov_deg = 73.7 }}\nheight_m = 35.0\n\
             [mission]\ncruise_mps = 5.0\n{mission}\n[[vehicles]]\nid = 7\n{first}\n[[vehicles]]\nid = 9\n\
             start = [0, -10, 0]\n{more}\n"
        );
        let scenario = scenario::parse(&text, "asked").map_err(|error| error.to_string())?;
        let planned = CoveragePlan::new(&scenario, CoverageMethod::PowellBinpat)
            .map_err(|error| error.to_string())?;
        let longest_s =
            planned.sorties.iter().map(|sortie| sortie.flight_duration_s).fold(0.0, f32::max);
        let costs_s = planned.max_sorties_and_swaps_cost_s();
        drop(planned);
        PreparedMission::prepare(scenario, &Progress::hidden())
            .map_err(|error| format!("flown: {error}"))?;
        Ok::<_, String>((longest_s, costs_s))
    };
    let (longest_s, costs_s) = plan("", start, "").expect("nothing is wrong");
    // The endurance is enough for the costs, which leave out turns, but not for the flight.
    assert!(costs_s < longest_s);
    let endurance = |seconds: f32| {
        let endurance = format!("endurance_s = {seconds:.2}");
        plan("", &format!("{start}\n{endurance}"), &endurance)
    };
    let error =
        endurance(0.5 * (costs_s + longest_s) / 0.85).expect_err("the battery is too small");
    assert!(error.contains("of that are for the landing"), "{error}");
    // A flight at speed needs more charge than a hover of that time: `fly` says how much, and
    // accepts no less.
    let error = endurance(longest_s / 0.84).expect_err("the battery is too small at speed");
    let (_, needed) = error.split_once("would need the charge of ").expect(&error);
    let needed_s: f32 = needed.split_once(" s").expect(&error).0.parse().expect(&error);
    assert!(needed_s > longest_s && needed_s < 1.3 * longest_s, "{error}");
    endurance((needed_s + 1.0) / (0.93 * 0.85)).expect("the battery lasts");
    // Layers end at 45 m, lanes at 120 m.
    let fence = |max: &str| {
        plan(&format!("geofence = {{ min = [-50, -50, -10], max = {max} }}"), start, "")
    };
    for max in ["[60, 200, 200]", "[200, 200, 20]", "[200, 200, 44]"] {
        let error = fence(max).expect_err(max);
        assert!(error.contains("outside mission.geofence"), "{max}: {error}");
    }
    fence("[121, 100, 46]").expect("it is around all that is flown");
    for (first, why) in [
        ("start = [6, -10, 35]", "pictures are taken at 35.0 m"),
        ("start = [6, -10, 20]", "bad vehicle: asked:10: vehicle 7 starts 20.0 m above the ground"),
        (
            "start = [6, -10, -20]",
            "bad vehicle: asked:10: vehicle 7 starts 20.0 m below the ground",
        ),
        ("start = [0, -10, 20]", "vehicles 7 and 9 start 0.00 m apart"),
        ("start = [6, -10, 0]\nweight = 0", "weight must be a number from"),
    ] {
        let error = plan("", first, "").expect_err(first);
        assert!(error.contains(why), "{first}: {error}");
    }
}

/// Over degrees without an origin the ground is at altitude 0: starts at their true altitude would
/// make all heights in the plans too low.
#[test]
fn starts_above_a_ground_of_unknown_altitude_are_refused() {
    let place = |lat: f64, lon: f64| format!("{{ lat_deg = {lat}, lon_deg = {lon} }}");
    let ring = [place(40.0, -3.0), place(40.001, -3.0), place(40.001, -2.999)].join(", ");
    let pad = "lat_deg = 39.9998, lon_deg = -3.0, alt_m";
    let text = |alt_m: f32| {
        format!(
            "[area]\npolygon = [{ring}]\ncamera = {{ fov_deg = 73.7, aspect = 1.5 }}\n\
             [[vehicles]]\nid = 1\nstart = {{ {pad} = {alt_m:.1} }}\n"
        )
    };
    let planned = |alt_m: f32| {
        let scenario = scenario::parse(&text(alt_m), "degrees").expect("a scenario");
        CoveragePlan::new(&scenario, CoverageMethod::PowellBinpat)
            .map(|_| ())
            .map_err(|e| e.to_string())
    };
    planned(0.0).expect("it is on the ground");
    let error = planned(20.0).expect_err("it is not");
    assert!(error.contains("vehicle 1 starts 20.0 m above the ground"), "{error}");
}
