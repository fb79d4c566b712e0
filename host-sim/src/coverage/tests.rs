//! What keys of `[area]` do to the plan.

use super::*;
use crate::scenario;

/// A field of 200 × 120 m, three vehicles at its corner, and these lines of `[area]`.
fn field(keys: &str) -> Scenario {
    let text = format!(
        "[area]\npolygon = [[0, 0], [200, 0], [200, 120], [0, 120]]\nangle_deg = 0.0\n{keys}\n\
         [mission]\ncruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [-10, -10, 0]\n\
         [[vehicles]]\nid = 2\nstart = [-20, -10, 0]\n[[vehicles]]\nid = 3\nstart = [-30, -10, 0]\n"
    );
    scenario::parse(&text, "field.toml").unwrap()
}

const SPACING: &str = "height_m = 20.0\ncamera = { fov_deg = 73.7, aspect = 1.5 }\nlane_m = 11.0\n\
                       waypoint_m = 8.0\n";

/// Numbers of the first waypoints of the routes, and the largest cost, seconds.
fn division(method: &str) -> (Vec<u32>, f32) {
    let scenario = field(&format!("{SPACING}method = \"{method}\""));
    let planned = CoveragePlan::plan_as_companions(&scenario).unwrap();
    let mut firsts: Vec<u32> =
        planned.plan.routes.iter().map(|route| route.lowest_waypoint).collect();
    firsts.sort_unstable();
    (firsts, planned.max_sorties_and_swaps_cost_s())
}

#[test]
fn each_name_of_a_method_divides_by_its_algorithm() {
    let scenario = field(SPACING);
    let planned = CoveragePlan::plan_as_companions(&scenario).unwrap();
    let lane_begins: Vec<u32> =
        planned.tracks.lanes().iter().map(|lane| lane.first_waypoint).collect();
    let [simple, binpat, powell, exact] =
        ["simple-binpat", "binpat", "powell-binpat", "exact"].map(division);
    let whole_lanes =
        |(firsts, _): &(Vec<u32>, f32)| firsts.iter().all(|f| lane_begins.contains(f));
    assert!(whole_lanes(&simple) && simple.0.len() == 3, "{simple:?}");
    assert!(!whole_lanes(&binpat), "{binpat:?}");
    // BINPAT's shares are equal.
    let third = f64::from(planned.tracks.waypoint_count()) / 3.0;
    for (first, parts) in binpat.0.iter().zip(0..) {
        assert!((f64::from(*first) - third * f64::from(parts)).abs() < 3.0, "{binpat:?}");
    }
    let costs = [simple.1, binpat.1, powell.1, exact.1];
    assert!(costs[2] < costs[1] && costs[3] < costs[2], "{costs:?}");
    assert_eq!(division("powell"), powell);
    assert_eq!(division("simple"), simple);
    let usual =
        (CoveragePlan::plan_as_companions(&scenario).unwrap()).max_sorties_and_swaps_cost_s();
    assert_eq!(usual, powell.1, "the default");
}

#[test]
fn lanes_begin_and_end_a_margin_beyond_the_edge() {
    for margin_m in [0.0f32, 7.5, 40.0] {
        let scenario = field(&format!("{SPACING}margin_m = {margin_m:.1}"));
        let planned = CoveragePlan::plan_as_companions(&scenario).unwrap();
        let ends: Vec<Flat> =
            planned.tracks.lanes().iter().flat_map(|lane| [lane.from, lane.to]).collect();
        assert!(ends.len() >= 2 * 10, "{ends:?}");
        for end in ends {
            let beyond_m = (end.x - 100.0).abs() - 100.0;
            assert!((beyond_m - margin_m).abs() < 0.01, "{end} with a margin of {margin_m} m");
            assert!((0.0..=120.0).contains(&end.y), "{end}");
        }
    }
}

#[test]
fn a_sensor_and_a_ground_sampling_distance_give_height_and_spacing() {
    let camera = "camera = { sensor_mm = [23.5, 15.6], focal_mm = 16.0, pixels = [6000, 4000] }";
    let area = field(&format!("{camera}\ngsd_m = 0.02")).area.unwrap();
    // From this height a pixel of 23.5 mm / 6000, 16 mm behind the lens, shows 20 mm.
    let height_m = 0.02 * 16.0 / (23.5 / 6000.0);
    let near = |got: f32, want: f32| assert!((got - want).abs() < 1e-3 * want, "{got} {want}");
    near(area.picture_height_m, height_m);
    near(area.heights.max_picture_height_m, height_m);
    near(area.spacing.footprint.across_m, 6000.0 * 0.02);
    near(area.spacing.footprint.along_m, 15.6 / 16.0 * height_m);
    // The usual overlaps are 0.6 to the side and 0.7 ahead.
    near(area.spacing.max_lane_spacing_m, 0.4 * 120.0);
    near(area.spacing.max_waypoint_spacing_m, 0.3 * 15.6 / 16.0 * height_m);
}

#[test]
fn keys_that_need_a_camera_are_refused_without_it() {
    let parsed = |keys: &str| {
        let text = format!(
            "[area]\npolygon = [[0, 0], [200, 0], [200, 120]]\n{keys}\n[[vehicles]]\nid = 1\n\
             start = [-10, -10, 0]\n"
        );
        scenario::parse(&text, "x").map(|_| ()).map_err(|error| error.why)
    };
    for (keys, why) in [
        ("gsd_m = 0.02\nlane_m = 5.0", "area.gsd_m needs area.camera"),
        ("gsd_m = 0.02\ncamera = { fov_deg = 73.7 }", "area.gsd_m needs a camera with pixels"),
        (
            "camera = { sensor_mm = [23.5, 15.6], focal_mm = 16.0 }",
            "area.camera needs pixels beside sensor_mm",
        ),
        ("overlap_front = 0.5\nlane_m = 5.0", "area.overlap_front needs area.camera"),
    ] {
        assert_eq!(parsed(keys), Err(why.to_owned()));
    }
}

#[test]
fn a_start_inside_a_no_fly_zone_is_refused_by_the_name_of_the_zone() {
    let zone = |x: i32| format!("[[{x}, 20], [{}, 20], [{}, 40], [{x}, 40]]", x + 20, x + 20);
    let around_pad = "[[-25, -20], [-15, -20], [-15, 0], [-25, 0]]";
    for (zones, named) in [
        ([zone(20), zone(60), around_pad.to_owned()], 2),
        ([zone(20), around_pad.to_owned(), zone(60)], 1),
    ] {
        let scenario = field(&format!("{SPACING}no_fly = [{}]", zones.join(", ")));
        let refused =
            CoveragePlan::new(&scenario, CoverageMethod::Binpat).err().map(|e| e.to_string());
        let place = &scenario.vehicle_file_lines[1];
        let why = format!("bad vehicle: {place}: vehicle 2 starts inside no-fly zone {named}");
        assert_eq!(refused, Some(why));
    }
}

#[test]
fn a_pad_off_the_ground_is_refused() {
    for (start_z_m, is_refused) in
        [(1.4, false), (-0.9, false), (1.6, true), (-1.1, true), (15.0, true)]
    {
        let mut scenario = field(&format!(
            "{SPACING}origin = {{ lat_deg = 40.3, lon_deg = -3.7, alt_m = 700.0 }}"
        ));
        scenario.vehicles[1].start.z = start_z_m;
        let plan = CoveragePlan::new(&scenario, CoverageMethod::Binpat);
        let error = plan.err().map(|error| error.to_string());
        assert_eq!(error.is_some(), is_refused, "{start_z_m} m: {error:?}");
        assert!(error.is_none_or(|error| error.contains("vehicle 2 starts")));
    }
}
