//! Compares detours by the ground heights of the roadmap file, as host and board plan them, with
//! those of a planner that has the map.
//!
//! A vehicle flies from node to node; another one fell silent above its path and lies on the ground
//! there. With a file of version 1, which has no ground heights, detours keep clear of the whole
//! column below.

use flockmate_tests::meeting::dice::Dice;
use flockmate_tests::shared_data;
use heapless::Vec as Few;
use host_sim::capacity::BOARDS;
use host_sim::map::{self, UnknownSpace, VoxelMap, building};
use host_sim::roadmap::{self, BuiltRoadmap};
use planner_core::Point;
use planner_core::detour::{self, DetourError, DetourGoal, DetourRequest, KeepOutZone, ZoneKind};
use planner_core::flight::Path;
use planner_core::geo::frames::Geodetic;
use planner_core::roadmap::prm::{PrmConfig, Sampling};
use planner_core::roadmap::search::{SearchWorkspace, astar};
use planner_core::roadmap::{LANDMARK_COUNT, RoadmapView, encoded_len, write_with_landmarks};

/// Number of terminals (goals) of the roadmap: random nodes.
const GOALS: u16 = 40;
/// Radius of the hull of a vehicle that lies, metres.
const HULL_M: f32 = 0.3;
/// Greatest share of detours, percent, that pass nearer than [`KEPT_M`].
const TOO_NEAR_PERCENT: usize = 2;
/// Rounding of distances, metres.
const ROUNDING_M: f32 = 0.01;
/// Number of detours compared on each map.
const CASES: usize = 400;
/// Number of places on each map at which ground heights are compared.
const PLACES: usize = 20_000;
/// Distance that a companion keeps from the place where an unheard vehicle may lie, metres.
const KEPT_M: f32 = 2.5;
/// Least distance permitted in this test, metres: two hulls touch there. It is less than
/// [`KEPT_M`], since a vehicle that is nearer than that at first only must not come nearer.
const NEAREST_M: f32 = 0.6;
/// Least share of detours that are the same with the roadmap's ground as with the map, percent.
const SAME_PERCENT: usize = 85;
/// Greatest share of places, percent, where the ground is deeper than the file says, so that a
/// vehicle on it is not kept clear of.
const DEEPER_PERCENT: f64 = 0.25;
/// Nodes of a search workspace: of a board and of the host.
const BOARD: usize = 4096;
const HOST: usize = 16_384;

/// A map's roadmap as files of both versions: `new` has ground heights, `old` has none.
struct Files {
    new: Vec<u8>,
    old: Vec<u8>,
}

fn files(map: &VoxelMap, clearance_m: f32) -> Files {
    let config = PrmConfig {
        random_nodes: 2300,
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        clearance_m,
        seed: 1,
        sampling: Sampling::Uniform,
    };
    let (roadmap, _) = roadmap::build(map, &[], &config).expect("there is free space");
    let roadmap = roadmap.fit_to_board(&BOARDS[0]).expect("it can be cut down");
    let header = roadmap::header(&config, Geodetic::default(), 0, GOALS);
    let BuiltRoadmap { nodes, edges, .. } = &roadmap;
    let mut old =
        vec![0; encoded_len(nodes.len(), edges.len(), LANDMARK_COUNT).expect("it is small")];
    let mut ws = Box::new(SearchWorkspace::<HOST>::new());
    write_with_landmarks(&header, nodes, edges, &[], &mut ws, &mut old).expect("it is a roadmap");
    Files { new: roadmap::encode(&roadmap, &header).expect("it is a roadmap"), old }
}

/// A place on a random edge.
fn on_edge(view: &RoadmapView<'_>, dice: &mut Dice) -> Point {
    loop {
        let node = dice.below(view.node_count()) as u16;
        let degree = view.half_edges(node).len();
        if degree > 0 {
            let edge = view.half_edges(node).nth(dice.below(degree)).expect("it has so many");
            let (from, to) = (view.node(node), view.node(edge.target));
            return from + (to - from) * dice.real(0.0, 1.0);
        }
    }
}

/// Compares the ground heights known from nodes with the map's, at random places on edges.
fn grounds(name: &str, map: &VoxelMap, view: &RoadmapView<'_>, dice: &mut Dice) {
    let [mut unknown, mut deeper, mut higher] = [0; 3];
    let mut wide_m = 0.0;
    for _ in 0..PLACES {
        let place = on_edge(view, dice);
        let truth_m = map.ground_z_below_m(&place).unwrap_or(f32::NEG_INFINITY);
        match view.ground_z_range_near(&place) {
            None => unknown += 1,
            Some((low_m, high_m)) => {
                deeper += usize::from(truth_m < low_m - 0.5);
                higher += usize::from(truth_m > high_m + 0.5);
                wide_m += f64::from(high_m - low_m);
            }
        }
    }
    let share = |count: usize| 100.0 * count as f64 / PLACES as f64;
    println!(
        "{name}: ground unknown at {:.2} %, deeper than the file says at {:.2} %, higher at {:.2} %; lowest and highest known \
         are {:.2} m apart in the mean",
        share(unknown),
        share(deeper),
        share(higher),
        wide_m / PLACES as f64
    );
    assert!(share(deeper) <= DEEPER_PERCENT, "{name}");
}

type Planned = Result<Vec<Point>, DetourError>;

fn planned<const N: usize>(
    view: &RoadmapView<'_>,
    request: &DetourRequest,
    thing: KeepOutZone,
    ws: &mut SearchWorkspace<N>,
) -> Planned {
    let (mut nodes, mut path) = (Few::<u16, 64>::new(), Path::<64>::new());
    detour::plan_detour(view, request, &mut [thing], ws, &mut nodes, &mut path)?;
    Ok(path.waypoints().iter().map(|w| w.position).collect())
}

fn detours(name: &str, map: &VoxelMap, clearance_m: f32) {
    let files = files(map, clearance_m);
    let [new, old] =
        [&files.new, &files.old].map(|file| RoadmapView::parse(file).expect("just written"));
    let dice = &mut Dice::new(7);
    grounds(name, map, &new, dice);
    let mut board = Box::new(SearchWorkspace::<BOARD>::new());
    let mut host = Box::new(SearchWorkspace::<HOST>::new());
    let [mut cases, mut same, mut found, mut found_by_old] = [0; 4];
    let [mut found_by_board, mut too_near] = [0; 2];
    let mut nearest_m = f32::INFINITY;
    while cases < CASES {
        let start = dice.below(new.node_count()) as u16;
        let goal = dice.below(usize::from(GOALS)) as u16;
        let mut nodes = Few::<u16, 64>::new();
        let any = |_: u16, _: &planner_core::roadmap::HalfEdge| true;
        if astar(&new, start, goal, any, &mut host, &mut nodes).is_err() || nodes.len() < 4 {
            continue;
        }
        let here = new.node(start);
        let ahead = 1 + dice.below(nodes.len() - 2);
        let (a, b) = (new.node(nodes[ahead]), new.node(nodes[ahead + 1]));
        let silent = a + (b - a) * dice.real(0.0, 1.0);
        let Some(ground_m) = map.ground_z_below_m(&silent) else { continue };
        // Somewhere inside its hull is the position that a vehicle reports.
        let at =
            |height_m: f32| Point::new(silent.x, silent.y, (ground_m + height_m).min(silent.z));
        let lies = at(dice.real(0.0, HULL_M));
        let descent_m = map
            .ground_z_below_m(&new.node(goal))
            .map_or(1.0, |ground_m| new.node(goal).z - ground_m);
        if (lies - here).norm() < KEPT_M + 1.0 {
            continue;
        }
        cases += 1;
        let request = DetourRequest {
            land_aside: false,
            here,
            leg: [new.node(nodes[1]), here],
            leg_clearance_m: 1.0,
            goal: DetourGoal::RoadmapGoal(goal),
            descent_m,
            required_clearance_m: clearance_m,
            fence: None,
        };
        let deep = Point::new(silent.x, silent.y, silent.z - 60.0);
        let column =
            KeepOutZone { from: silent, to: deep, radius_m: KEPT_M, kind: ZoneKind::Grounded };
        let exact = KeepOutZone { from: at(HULL_M), to: at(0.0), kind: ZoneKind::Static, ..column };
        let by_host = planned(&new, &request, column, &mut host);
        let by_board = planned(&new, &request, column, &mut board);
        assert_eq!(by_host, by_board, "host and board fly other ways");
        let by_map = planned(&new, &request, exact, &mut host);
        let by_old = planned(&old, &request, column, &mut board);
        let is_found = |planned: &Planned| usize::from(planned.is_ok());
        found += is_found(&by_map);
        same += usize::from(by_map == by_board && by_map.is_ok());
        found_by_old += usize::from(by_map.is_ok() && by_map == by_old);
        let passed_m = |leg: &[Point]| {
            let along = leg[1] - leg[0];
            let share = ((lies - leg[0]).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (leg[0] + along * share - lies).norm()
        };
        let passed_m = by_board
            .iter()
            .flat_map(|path| path.windows(2).map(passed_m))
            .fold(f32::INFINITY, f32::min);
        nearest_m = passed_m.min(nearest_m);
        too_near += usize::from(passed_m < KEPT_M - ROUNDING_M);
        found_by_board += usize::from(by_board.is_ok());
    }
    println!(
        "{name}: of {cases} vehicles {found} find a way with the map; the same way {same} with the \
         ground of the roadmap, {found_by_old} without; the nearest passes what lies there at \
         {nearest_m:.2} m, {too_near} nearer than {KEPT_M} m"
    );
    // A vehicle that is nearer than KEPT_M to the zone at first only must not come nearer, so it
    // may pass nearer than KEPT_M.
    assert!(nearest_m > NEAREST_M, "{name}: {nearest_m}");
    assert!(
        too_near * 100 <= found_by_board * TOO_NEAR_PERCENT,
        "{name}: {too_near} of {found_by_board}"
    );
    assert!(same * 100 >= found * SAME_PERCENT, "{name}: {same} of {found}");
    assert!(found_by_old < same, "{name}: the ground makes no difference");
}

#[test]
fn host_and_board_find_the_detours_that_the_map_gives() {
    let map = building::building_map(building::DEFAULT_SEED, 0.25).expect("the building");
    detours("building", &map.to_voxel_map(UnknownSpace::Blocked), 0.8);
    for (name, resolution_m, clearance_m) in
        [("geb079", 0.08, 0.2), ("manufacturing", 0.086_642_2, 0.3), ("maze", 0.195_32, 0.3)]
    {
        let Some(path) = shared_data(&format!("maps3d/{name}.bt")) else { continue };
        let map = map::load(path.to_str().expect("UTF-8"), resolution_m).expect("a map");
        detours(name, &map.to_voxel_map(UnknownSpace::Blocked), clearance_m);
    }
}
