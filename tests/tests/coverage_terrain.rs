//! Coverage plans above random and real terrain, judged without the planner's code: never nearer to
//! the ground than the pictures' height, no higher above what must be flown over than the
//! tolerance, no steeper than vehicles fly, all photographed.

use flockmate_tests::areas::{self, Shape};
use flockmate_tests::hills::Hills;
use flockmate_tests::shared_data;
use host_sim::coverage::check::{CoverageFindings, check_plan};
use host_sim::coverage::flight::{FlightPoint, WaypointAction};
use host_sim::coverage::{CoveragePlan, SortieFlight, heights};
use host_sim::margins;
use host_sim::scenario::{self, Scenario};
use host_sim::terrain::HeightGrid;
use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::map::field::FieldView;
use rand_core::SeedableRng as _;
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Seeds of the random areas: `FLOCKMATE_TERRAINS=N` many, from `FLOCKMATE_TERRAINS_FROM` on.
fn seeds() -> std::ops::Range<u64> {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let from = number("FLOCKMATE_TERRAINS_FROM").unwrap_or(0);
    from..from + number("FLOCKMATE_TERRAINS").unwrap_or(60)
}

/// A random area on random hills, as a user would write it.
fn drawn(seed: u64, folder: &std::path::Path) -> String {
    let mut random = Pcg32::seed_from_u64(seed);
    let hills = Hills::new(&mut random, 80.0);
    let mut text = areas::scenario(&mut random, Shape::Any, 1 + (seed % 4) as usize);
    let tolerance_m = 0.5 + 5.0 * areas::unit_random(&mut random);
    let trigger = ["distance", "waypoint", "none"][(seed % 3) as usize];
    text = text.replace("camera = ", &format!("trigger = \"{trigger}\"\ncamera = "));
    let [climb, descend] = [0, 1].map(|_| 0.5 + 4.0 * areas::unit_random(&mut random));
    let speeds = format!(
        "climb_mps = {climb:.1}\ndescend_mps = {descend:.1}\nendurance_s = 36000.0\nspeed_max_mps"
    );
    text = text.replace("speed_max_mps", &speeds);
    hills.put_under_scenario(&text, &folder.join(format!("hills-{seed}.asc")), tolerance_m)
}

/// The ceiling of a plan without the tolerance: the highest ground near, or higher ground far away,
/// less the slope from it.
struct Ceiling<'a> {
    grid: &'a HeightGrid,
    near_m: f32,
    /// Slope along east or north; both add up. The field's steps of 0.1 m make it up to a fifth
    /// less than vehicles fly.
    slope: f32,
}

impl<'a> Ceiling<'a> {
    fn of(planned: &CoveragePlan<'a>) -> Self {
        let terrain = planned.area_settings.terrain.as_ref().unwrap();
        let field = FieldView::parse(&terrain.field_file).unwrap();
        let margin_m = margins::required_distances(
            &planned.scenario.simulation,
            0.0,
            &planned.scenario.vehicles,
        )
        .wall_margin_m;
        let near_m = 3.0 * field.shape().cell_m + margin_m + 2.0 * terrain.grid.cell_m();
        Self {
            grid: &terrain.grid,
            near_m,
            slope: terrain.max_slope * 0.8 / std::f32::consts::SQRT_2,
        }
    }

    fn over(&self, place: &Flat) -> f32 {
        let [columns, rows] = self.grid.size();
        let mut over = f32::NEG_INFINITY;
        for row in 0..rows {
            for column in 0..columns {
                let cell = [column, row];
                let Some(height_m) =
                    self.grid.cell_height(cell).filter(|height_m| *height_m > over)
                else {
                    continue;
                };
                let away = (self.grid.cell_centre(cell) - place).abs();
                let far_m = (away.x - self.near_m).max(0.0) + (away.y - self.near_m).max(0.0);
                over = over.max(height_m - self.slope * far_m);
            }
        }
        over
    }
}

/// Number of random places near pictures that are shown if a camera's height counts from the ground
/// below it, but not if it counts from the ground at the place. The plan need not show these, but
/// overlaps should.
fn hidden(planned: &CoveragePlan<'_>, points: &[&FlightPoint], places: usize) -> usize {
    let (area, along) = (planned.area_settings, planned.tracks.lane_direction());
    let pictures: Vec<Point> = points
        .iter()
        .filter(|point| matches!(point.action, WaypointAction::Photo(_)))
        .map(|point| point.position)
        .collect();
    let mut random = Pcg32::seed_from_u64(pictures.len() as u64);
    let mut beside = |side: f32| (areas::unit_random(&mut random) as f32 - 0.5) * side;
    let hidden = (0..places).filter(|k| {
        let near = pictures[k * pictures.len() / places].xy();
        let (u, v) =
            (beside(area.spacing.max_waypoint_spacing_m), beside(area.spacing.max_lane_spacing_m));
        let place = near + along * u + Flat::new(-along.y, along.x) * v;
        let shown = |ground_m: &dyn Fn(&Point) -> f32| {
            pictures.iter().any(|camera| {
                let (off, half) = (
                    place - camera.xy(),
                    (camera.z - ground_m(camera)) / area.picture_height_m / 2.0,
                );
                let footprint = area.spacing.footprint;
                off.dot(&along).abs() <= footprint.along_m * half
                    && off.perp(&along).abs() <= footprint.across_m * half
            })
        };
        let ground_m = area.ground_height_m(&place);
        shown(&|camera| area.ground_height_m(&camera.xy())) && !shown(&|_| ground_m)
    });
    hidden.count()
}

/// Checks that a route's cost is the time of its flight, but for what the cost leaves out: the
/// way from the layer to the height of the highest pictures and back (as in the paper), what lies
/// between the lanes' lowest and highest heights, and the height of the pad.
fn check_cost(planned: &CoveragePlan<'_>, flight: &SortieFlight) -> Result<(), String> {
    let (sortie, points, times_s) = flight;
    let (area, route) = (planned.area_settings, &sortie.route);
    let vehicle = &planned.vehicles[usize::from(route.vehicle_index)];
    let vertical_s = |up_m: f32| match up_m > 0.0 {
        true => up_m / vehicle.climb_mps,
        false => -up_m / vehicle.descend_mps,
    };
    let there_and_back_s = |height_m: f32| vertical_s(height_m) + vertical_s(-height_m);
    let along_lanes_s: f32 = points
        .windows(2)
        .filter(|pair| pair.iter().all(heights::is_at_lane_height))
        .map(|pair| vertical_s(pair[1].position.z - pair[0].position.z))
        .sum();
    let pad_m = points[0].position.z;
    let left_out_s = there_and_back_s(f32::from(route.layer) * area.heights.layer_spacing_m)
        + along_lanes_s
        - there_and_back_s(pad_m).copysign(pad_m);
    let flown_s = times_s[times_s.len() - 1] - times_s[0];
    let most_s = there_and_back_s(area.terrain.as_ref().unwrap().tolerance_m) + 0.01 * flown_s;
    match (flown_s - left_out_s - route.cost_s).abs() <= most_s {
        true => Ok(()),
        false => Err(format!("flown in {flown_s} s, {left_out_s} s left out: {route:?}")),
    }
}

/// Checks a plan; the error says what is wrong.
fn judge(scenario: &Scenario, looks: usize) -> Result<CoverageFindings, String> {
    let method = scenario.area.as_ref().unwrap().method;
    let planned = CoveragePlan::new(scenario, method).map_err(|error| format!("{error:#}"))?;
    let findings = check_plan(&planned);
    if !findings.is_clean() {
        return Err(format!(
            "{:?}",
            CoverageFindings { new_cells_over_time: Vec::new(), ..findings }
        ));
    }
    let (ceiling, area) = (Ceiling::of(&planned), planned.area_settings);
    let tolerance_m = area.terrain.as_ref().unwrap().tolerance_m;
    let flights = planned.flights();
    let low: Vec<_> = flights
        .iter()
        .flat_map(|(_, points, _)| points)
        .filter(|s| heights::is_at_lane_height(s))
        .collect();
    for flight in &flights {
        check_cost(&planned, flight)?;
    }
    let hidden = hidden(&planned, &low, 500);
    if hidden > 0 {
        return Err(format!("{hidden} of 500 places are hidden by their own height"));
    }
    for point in low.iter().step_by(1 + low.len() / looks) {
        let most_m = ceiling.over(&point.position.xy()) + area.picture_height_m + tolerance_m + 0.2;
        if point.position.z > most_m {
            return Err(format!("too high: {:?}, not {most_m}", point.position));
        }
    }
    Ok(findings)
}

#[test]
fn plans_above_random_terrain_keep_their_heights() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = |seed: u64| -> Result<bool, String> {
        let text = drawn(seed, folder.path());
        let scenario = match scenario::parse(&text, "random") {
            Ok(scenario) => scenario,
            Err(error) if error.to_string().contains("area.terrain") => {
                return Err(format!("{seed}: {error}"));
            }
            Err(_) => return Ok(false),
        };
        match judge(&scenario, 60) {
            Ok(findings) => Ok(findings.heights.is_some()),
            Err(error) if error.contains("no-fly zone") => Ok(false),
            Err(error) => Err(format!("seed {seed}: {error}")),
        }
    };
    let all: Vec<_> = seeds().into_par_iter().map(outcome).collect();
    let wrong: Vec<_> = all.iter().filter_map(|outcome| outcome.as_ref().err()).collect();
    for wrong in wrong.iter().take(20) {
        println!("{}\n", wrong.chars().take(600).collect::<String>());
    }
    let planned = all.iter().filter(|outcome| matches!(outcome, Ok(true))).count();
    println!("{planned} of {} areas planned, {} wrong", all.len(), wrong.len());
    assert!(
        wrong.is_empty() && planned * 2 >= all.len(),
        "{planned} planned, {} wrong",
        wrong.len()
    );
}

#[test]
fn plans_above_real_terrain_keep_their_heights() {
    // Hills north of Bilbao, its roofs above level ground, and trees in Oregon.
    let places = [
        ("height/bilbao_DEM.tif", 43.2980, -2.9860, [400.0, 300.0], 40.0),
        ("height/bilbao_BDSM.tif", 43.3050, -2.9900, [300.0, 200.0], 40.0),
        ("height/autzen_trim.las", 44.05039, -123.07233, [30.0, 24.0], 20.0),
    ];
    for (name, lat, lon, [wide, tall], height_m) in places {
        let Some(path) = shared_data(name) else { continue };
        let area = format!(
            "[area]\npolygon = [[0, 0], [{wide}, 0], [{wide}, {tall}], [0, {tall}]]\nterrain = \"{}\"\n\
             origin = {{ lat_deg = {lat}, lon_deg = {lon}, alt_m = ALT }}\ncamera = {{ fov_deg = 73.7, aspect = 1.5 }}\n\
             height_m = {height_m:.1}\n[mission]\ncruise_mps = 5.0\n",
            path.display()
        );
        let vehicle = |id: usize, up_m: f64| {
            format!(
                "[[vehicles]]\nid = {id}\nendurance_s = 7200.0\ndescend_mps = 2.0\nstart = [{}, 2, {up_m}]\n",
                4 * id
            )
        };
        // The pad heights that the program's error states are accepted then.
        let mut heights_m = [0.0, 0.0];
        let mut altitude_m = 0.0;
        let mut scenario = None;
        for _ in 0..4 {
            let pads: String = (0..2).map(|k| vehicle(k + 1, heights_m[k])).collect();
            let text = area.replace("ALT", &format!("{altitude_m:.1}")) + &pads;
            match scenario::parse(&text, name) {
                Ok(found) => {
                    scenario = Some(found);
                    break;
                }
                Err(error) => {
                    let hint = error.hint.unwrap_or_else(|| panic!("{name}: {}", error.why));
                    let number = |after: &str| -> Option<f64> {
                        let text = &hint[hint.find(after)? + after.len()..];
                        text.split([',', ' ', 'm']).find(|word| !word.is_empty())?.parse().ok()
                    };
                    let up_m = number("the ground is ").unwrap_or_else(|| panic!("{name}: {hint}"));
                    altitude_m += up_m;
                    heights_m = [0.0, 0.0];
                }
            }
        }
        let findings =
            judge(&scenario.expect(name), 200).unwrap_or_else(|error| panic!("{name}: {error}"));
        let heights = findings.heights.unwrap();
        println!("{name}: {heights:?}");
        assert!(
            heights.min_above_ground_m >= height_m - 0.02
                && heights.max_above_ground_m > height_m + 3.0,
            "{name}: {heights:?}"
        );
    }
}

/// A pad near a step of the ground is refused, and accepted where the hint moves it.
#[test]
fn a_pad_beside_a_step_is_refused_and_its_hint_leads_to_a_level_place() {
    let folder = tempfile::tempdir().unwrap();
    let heights: String = (0..60)
        .map(|_| {
            (0..60).map(|column| if column < 30 { "300 " } else { "302 " }).collect::<String>()
                + "\n"
        })
        .collect();
    let grid = format!("ncols 60\nnrows 60\nxllcorner -150\nyllcorner -150\ncellsize 5\n{heights}");
    let file = folder.path().join("step.asc");
    std::fs::write(&file, grid).unwrap();
    let scenario = |x: f64| {
        let up_m = if x < 0.0 { 0.0 } else { 2.0 };
        let text = format!(
            "[area]\npolygon = [[-60, 20], [60, 20], [60, 80], [-60, 80]]\ncoordinates = \"metres\"\n\
             origin = {{ lat_deg = 40.0, lon_deg = -3.7, alt_m = 300.0 }}\nterrain = \"{}\"\n\
             camera = {{ fov_deg = 73.7, aspect = 1.5 }}\nheight_m = 40.0\n[mission]\ncruise_mps = 5.0\n\
             [[vehicles]]\nid = 1\nstart = [{x:.2}, 0, {up_m}]\n",
            file.display()
        );
        scenario::parse(&text, "step")
    };
    let mut random = Pcg32::seed_from_u64(7);
    let (mut refused, mut farthest_m) = (0, 0.0f64);
    for _ in 0..200 {
        let x = 6.0 * areas::unit_random(&mut random) - 3.0;
        let Err(error) = scenario(x) else {
            assert!(x.abs() > 0.5, "{x} m from the step");
            continue;
        };
        assert!(error.to_string().contains("a step of 2.0 m"), "{error}");
        (refused, farthest_m) = (refused + 1, farthest_m.max(x.abs()));
        let hint = error.hint.expect("a hint");
        let by_m: f64 = hint.split(' ').find_map(|word| word.parse().ok()).expect("a number");
        assert!(scenario(x + by_m).is_ok(), "{x}: {hint}");
    }
    println!("{refused} of 200 refused, up to {farthest_m} m from the step");
    assert!(refused > 20 && farthest_m < 2.5);
}

#[test]
fn what_cannot_be_planned_or_flown_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    // A tenth of the seeds give no valid area: the first one that does.
    let texts = (100..140).map(|seed| drawn(seed, folder.path()));
    let text =
        texts.into_iter().find(|text| scenario::parse(text, "random").is_ok()).expect("an area");
    let line = |start: &str| text.lines().find(|line| line.starts_with(start)).unwrap().to_owned();
    let first = line("start = ");
    let place = &first[..first.rfind(", ").unwrap()];
    for (from, to, why) in [
        (line("terrain = "), "terrain = \"none.asc\"".to_owned(), "cannot be read"),
        (line("terrain = "), "terrain = \"none.png\"".to_owned(), "no known format"),
        (line("terrain = ") + "\n", String::new(), "needs area.terrain"),
        (first.clone(), format!("{place}, 900.0]"), "from the ground of area.terrain"),
        (line("terrain_tol"), "terrain_tolerance_m = 0.0".to_owned(), "terrain_tolerance_m"),
        (first.clone(), "start = [5000, 0, 0]".to_owned(), "it has no height at"),
        (
            line("camera"),
            line("camera") + "\norigin = { lat_deg = 0, lon_deg = 0, alt_m = 9000 }",
            "alt_m near the ground",
        ),
    ] {
        let error =
            scenario::parse(&text.replacen(&from, &to, 1), "random").unwrap_err().to_string();
        assert!(error.contains(why), "{why}: {error}");
    }
}
