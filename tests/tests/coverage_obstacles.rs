//! Coverage missions with a map of obstacles: flights lead around those that reach their height.

use std::path::Path;
use std::sync::Arc;

use flockmate_tests::areas::{self, Shape};
use flockmate_tests::{covered, number_from_env};
use host_sim::coverage::CoveragePlan;
use host_sim::coverage::check::check_plan;
use host_sim::coverage::obstacles::MapObstacles;
use host_sim::map::{Occupancy, OccupancyMap, UnknownSpace, bt};
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::scenario::coverage::CoverageMethod;
use host_sim::scenario::{self, Scenario};
use planner_core::Point;
use planner_core::coverage::area::RingKind;
use planner_core::map::voxel::GridShape;
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// Two opposite corners of a box, metres.
type Block = [[f64; 3]; 2];

/// A map of the smallest extent that holds these boxes, whose sides lie between cells.
fn map_of(boxes: &[Block], cell_m: f64) -> OccupancyMap {
    let end = |which: usize, axis: usize, pick: fn(f64, f64) -> f64| {
        boxes.iter().map(|block| block[which][axis]).reduce(pick).expect("a box")
    };
    let low = [0, 1, 2].map(|axis| end(0, axis, f64::min));
    let cells = |place: [f64; 3]| [0, 1, 2].map(|a| ((place[a] - low[a]) / cell_m).round() as u32);
    let shape = GridShape {
        dims: cells([0, 1, 2].map(|axis| end(1, axis, f64::max))),
        min: Point::from(low.map(|x| x as f32)),
        resolution_m: cell_m as f32,
    };
    let mut map = OccupancyMap::all_unknown(shape, "boxes").expect("a map");
    for [from, to] in boxes {
        map.fill(cells(*from), cells(*to), Occupancy::Occupied);
    }
    map
}

fn write(boxes: &[Block], cell_m: f64, path: &Path) {
    bt::write(&map_of(boxes, cell_m).to_octree("boxes").expect("an octree"), path).expect("a file");
}

fn with_map(text: &str, path: &Path, cell_m: f64) -> String {
    format!("{text}[map]\nfile = '{}'\nresolution_m = {cell_m}\n", path.display())
}

/// Distance between a point and a box, metres.
fn distance_m(place: [f64; 3], [low, high]: &Block) -> f64 {
    let beyond = |axis: usize| (low[axis] - place[axis]).max(place[axis] - high[axis]).max(0.0);
    beyond(0).hypot(beyond(1)).hypot(beyond(2))
}

fn random_boxes(random: &mut Pcg32, cell_m: f64, height_m: f64) -> Vec<Block> {
    let cells = |metres: f64| (metres / cell_m).round() * cell_m;
    let count = 1 + random.next_u32() % 8;
    let one = |_| {
        let low = [0, 1].map(|_| cells(areas::between(random, -150.0, 150.0)));
        let size = [0, 1].map(|_| cells(areas::between(random, 1.0, 25.0)));
        // Some blocks hang in the air, some reach the lanes or layers, many are lower.
        let from_m = [0.0, 0.0, 0.0, areas::between(random, 0.0, 1.2)];
        let from_m = cells(height_m * from_m[(random.next_u32() % 4) as usize]);
        let tall_m = cells(height_m * areas::between(random, 0.1, 1.8)) + cell_m;
        let high = [low[0] + size[0], low[1] + size[1], from_m + tall_m];
        [[low[0], low[1], from_m], high]
    };
    (0..count).map(one).collect()
}

/// What is wrong with a plan beside these boxes.
fn wrong(scenario: &Scenario, planned: &CoveragePlan<'_>, boxes: &[Block]) -> Option<String> {
    let area = scenario.area.as_ref().expect("an area");
    let obstacles = area.obstacles.as_ref().expect("a map");
    // By default the radius, 0.3 m, and half of the 2.4 m between separation and safety distance.
    if (obstacles.required_clearance_m - 1.5).abs() > 1e-5 {
        return Some(format!("the clearance is {} m", obstacles.required_clearance_m));
    }
    for (_, points, _) in planned.flights() {
        for leg in points.windows(2) {
            let [a, b] = [0, 1].map(|end| leg[end].position.cast::<f64>());
            let parts = ((b - a).norm() / 0.1).ceil().max(1.0);
            for part in 0..=parts as u32 {
                let place = a + (b - a) * (f64::from(part) / parts);
                let near = |block: &&Block| distance_m(place.into(), block) < 1.49;
                if let Some(block) = boxes.iter().find(near) {
                    return Some(format!("{place:?} is too near to {block:?}"));
                }
            }
        }
    }
    let findings = check_plan(planned);
    if !findings.is_clean() {
        return Some(format!(
            "missing {:?}, {} in zones",
            findings.first_missing_cell_centre, findings.legs_in_no_fly_zones
        ));
    }
    // What is not photographed must be little more than what no vehicle may fly over.
    let low_m = f64::from(area.heights.max_picture_height_m) - 1.5 - 0.02;
    let tall: Vec<_> = boxes.iter().filter(|block| block[1][2] > low_m).collect();
    let own = scenario.text.lines().find(|line| line.starts_with("no_fly"));
    let own = own.map_or(0, |line| line.matches("[[").count().saturating_sub(1));
    let own = own + usize::from(scenario.text.contains("no_fly = [[["));
    let zones: Vec<_> = area.rings_of(RingKind::NoFly).skip(own).collect();
    let (mut all, mut free) = (0.0, 0.0);
    for [x, y] in (-200..200).flat_map(|x| (-200..200).map(move |y| [f64::from(x), f64::from(y)])) {
        let crossed = |ring: &&&[planner_core::coverage::Flat]| {
            let ends = ring.iter().zip(ring.iter().cycle().skip(1));
            ends.filter(|(a, b)| {
                let [ax, ay, bx, by] = [a.x, a.y, b.x, b.y].map(f64::from);
                (ay <= y) != (by <= y) && x < ax + (y - ay) * (bx - ax) / (by - ay)
            })
            .count()
                % 2
                == 1
        };
        if zones.iter().any(|zone| crossed(&zone)) {
            all += 1.0;
            let near = |block: &&Block| distance_m([x, y, block[0][2]], block) < 2.0;
            free += f64::from(u8::from(!tall.iter().any(near)));
        }
    }
    (free > 0.5 * all).then(|| format!("{free} of {all} m² of the zones are free"))
}

/// `FLOCKMATE_OBSTACLES=N` plans N areas.
#[test]
fn plans_keep_clear_of_all_that_a_map_holds_at_their_height() {
    let folder = tempfile::tempdir().expect("a folder");
    let one = |seed: u64| -> Result<Option<bool>, String> {
        let mut random = Pcg32::seed_from_u64(seed);
        let shape = if seed.is_multiple_of(2) { Shape::Any } else { Shape::Convex };
        let text = areas::scenario(&mut random, shape, 1 + (seed % 4) as usize);
        let Ok(plain) = scenario::parse(&text, "random") else { return Ok(None) };
        let height_m =
            plain.area.as_ref().map_or(0.0, |area| f64::from(area.heights.max_picture_height_m));
        let cell_m = [0.5, 1.0, 2.0][(seed % 3) as usize];
        let boxes = random_boxes(&mut random, cell_m, height_m);
        let path = folder.path().join(format!("{seed}.bt"));
        write(&boxes, cell_m, &path);
        let text = with_map(&text, &path, cell_m);
        let refused = |error: String| {
            let known = ["no-fly zone", "from an obstacle of the map"];
            match known.iter().any(|known| error.contains(known)) {
                true => Ok(None),
                false => Err(format!("seed {seed}: {error}\n{text}{boxes:?}")),
            }
        };
        let scenario = match scenario::parse(&text, "random") {
            Ok(scenario) => scenario,
            Err(error) => return refused(error.to_string()),
        };
        let planned = match CoveragePlan::new(&scenario, CoverageMethod::PowellBinpat) {
            Ok(planned) => planned,
            Err(error) => return refused(format!("{error:#}")),
        };
        match wrong(&scenario, &planned, &boxes) {
            Some(why) => Err(format!("seed {seed}: {why}\n{text}{boxes:?}")),
            None => {
                let rings = |of: &Scenario| of.area.as_ref().map_or(0, |area| area.rings.len());
                Ok(Some(rings(&scenario) > rings(&plain)))
            }
        }
    };
    let count = number_from_env("FLOCKMATE_OBSTACLES", 100);
    let all: Vec<_> = (0..count).into_par_iter().map(one).collect();
    let wrong: Vec<_> = all.iter().filter_map(|outcome| outcome.as_ref().err()).collect();
    let of = |what: bool| all.iter().filter(|all| **all == Ok(Some(what))).count() as u64;
    println!("{} planned with zones, {} without, {} wrong", of(true), of(false), wrong.len());
    for wrong in wrong.iter().take(5) {
        println!("{}\n", wrong.chars().take(3000).collect::<String>());
    }
    assert!(wrong.is_empty() && 4 * of(true) >= count && of(false) > 0);
}

const FIELD: &str = "[area]\npolygon = [[0, 0], [90, 0], [90, 60], [0, 60]]\nheight_m = 25.0\n\
    camera = { fov_deg = 73.7, aspect = 1.5 }\n[mission]\ncruise_mps = 5.0\n\
    [simulation]\ngust_mps = 2.0\n\
    [[vehicles]]\nid = 1\nspeed_max_mps = 8.0\nstart = [20, -20, 0]\n\
    [[vehicles]]\nid = 2\nspeed_max_mps = 8.0\npersonality = \"ardupilot\"\nstart = [26, -20, 0]\n\
    [[vehicles]]\nid = 3\nspeed_max_mps = 8.0\nstart = [32, -20, 0]\n";

/// A tower in the area, one at its border, a wall between it and the pads, and a low roof.
const BLOCKS: [Block; 4] = [
    [[40.0, 25.0, 0.0], [48.0, 31.0, 60.0]],
    [[85.0, 40.0, 0.0], [95.0, 46.0, 30.0]],
    [[10.0, -9.0, 0.0], [40.0, -8.0, 45.0]],
    [[10.0, 10.0, 0.0], [30.0, 20.0, 18.0]],
];

#[test]
fn an_area_with_towers_is_photographed_without_contact() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("towers.bt");
    write(&BLOCKS, 0.5, &path);
    let text = with_map(FIELD, &path, 0.5);
    let prepared = || {
        let scenario = scenario::parse(&text, "area").expect("a scenario");
        PreparedMission::prepare(scenario, &Progress::hidden()).expect("a mission")
    };
    let flight = covered::fly_with_record(&mut prepared(), &mut Vec::new()).expect("it is flown");
    if let Some(faults) = covered::faults_text(&flight.result) {
        panic!("{faults}\n{}", covered::log_lines(&flight.log));
    }
    let places = flight.tracks.iter().flatten().map(|(_, place)| place.cast::<f64>());
    let far_m = |place: [f64; 3]| {
        BLOCKS.iter().map(|block| distance_m(place, block)).fold(f64::INFINITY, f64::min)
    };
    let nearest_m = places.map(|place| far_m(place.into())).fold(f64::INFINITY, f64::min);
    println!("{nearest_m:.2} m from the nearest, {:.0} s", flight.result.totals.makespan_s);
    assert!(nearest_m > 1.0 && nearest_m < 4.0, "{nearest_m}");
    // The same flight with a mast on its path that the plan does not know: the referee sees the
    // contact.
    let mut mission = prepared();
    let mast = [[60.0, 0.0, 0.0], [61.0, 60.0, 45.0]];
    let map = map_of(&[&BLOCKS[..], &[mast]].concat(), 0.5);
    let obstacles = MapObstacles::new(&map, UnknownSpace::Free, 1.5);
    mission.scenario.area.as_mut().expect("an area").obstacles = Some(Arc::new(obstacles));
    let (result, _) = covered::fly(&mut mission).expect("it is flown");
    assert!(result.safety.wall_contacts > 0);
}

#[test]
fn what_a_map_leaves_no_room_for_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("map.bt");
    let plan = |text: &str| {
        let scenario = scenario::parse(text, "area").map_err(|error| error.to_string())?;
        let rings = scenario.area.as_ref().map_or(0, |area| area.rings.len());
        CoveragePlan::new(&scenario, CoverageMethod::PowellBinpat)
            .map_err(|error| format!("{error:#}"))?;
        Ok::<_, String>(rings)
    };
    let beside = |boxes: &[Block]| {
        write(boxes, 0.5, &path);
        plan(&with_map(FIELD, &path, 0.5))
    };
    let column = |x: f64, y: f64, top: f64| [[x, y, 0.0], [x + 1.0, y + 1.0, top]];
    let error = beside(&[[[-10.0, -10.0, 0.0], [100.0, 70.0, 30.0]]]).expect_err("it is full");
    assert!(error.contains("the map's obstacles are as high as the pictures"), "{error}");
    let error = beside(&[[[-40.0, -40.0, 10.0], [100.0, 70.0, 11.0]]]).expect_err("a roof");
    assert!(error.contains("vehicle 1 starts 0.00 m from an obstacle of the map"), "{error}");
    let error = beside(&[column(20.0, -19.0, 4.0)]).expect_err("a low wall by the pad");
    assert!(error.contains("vehicle 1 starts 1.00 m from an obstacle"), "{error}");
    let many: Vec<Block> = (0..9)
        .flat_map(|i| (0..9).map(move |j| [i, j]))
        .map(|[i, j]| column(f64::from(i) * 10.0, f64::from(j) * 7.0, 30.0))
        .collect();
    let error = beside(&many).expect_err("too many");
    assert!(error.contains("324 corners with those around the map's obstacles"), "{error}");
    assert_eq!(beside(&[column(40.0, 20.0, 22.0), column(60.0, 20.0, 0.5)]), Ok(1), "all is low");
    assert_eq!(beside(&[column(40.0, 20.0, 24.0), column(300.0, 20.0, 30.0)]), Ok(2));
    // Lanes that reach further beyond the border meet an obstacle there.
    let longer = FIELD.replacen("[area]\n", "[area]\nangle_deg = 0.0\nmargin_m = 60.0\n", 1);
    write(&[column(134.0, 28.0, 60.0)], 0.5, &path);
    assert_eq!(plan(&with_map(&longer, &path, 0.5)), Ok(2));
    // Where the area is in degrees, the map has to say where it is.
    write(&[column(40.0, 20.0, 30.0)], 0.5, &path);
    let origin = "origin = { lat_deg = 40.3, lon_deg = -3.7, alt_m = 700.0 }\n";
    let text = FIELD.replacen("[area]\n", &format!("[area]\n{origin}"), 1);
    let error = plan(&with_map(&text, &path, 0.5)).expect_err("no origin");
    assert!(error.contains("map.origin is missing"), "{error}");
    assert_eq!(plan(&(with_map(&text, &path, 0.5) + origin)), Ok(2));
    assert_eq!(plan(&(with_map(FIELD, &path, 0.5) + origin)), Ok(2), "it is that of both");
    let other = with_map(&text, &path, 0.5) + &origin.replace("40.3", "40.4");
    let error = plan(&other).expect_err("two origins");
    assert!(error.contains("map.origin is not area.origin"), "{error}");
    let error = plan(&with_map(FIELD, &folder.path().join("no.bt"), 0.5)).expect_err("no file");
    assert!(error.contains("map.file") && error.contains("no.bt"), "{error}");
}
