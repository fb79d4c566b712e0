//! A roadmap with more edges than a board holds is cut down so that it fits: nodes that were
//! connected stay so, whatever clearance is required, and paths lengthen little.

use std::time::Instant;

use flockmate_tests::shared_data;
use host_sim::capacity::{BOARDS, BoardCapacity};
use host_sim::map::{self, Occupancy, OccupancyMap, UnknownSpace, VoxelMap};
use host_sim::roadmap::{self, BuiltRoadmap};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::map::voxel::GridShape;
use planner_core::roadmap::RoadmapView;
use planner_core::roadmap::prm::{PrmConfig, Sampling};
use planner_core::roadmap::search::{SearchWorkspace, dijkstra_all};

const CLEARANCES_M: [f32; 3] = [0.3, 0.8, 1.2];
/// Nodes from which all others are searched.
const SOURCES: u16 = 40;
/// Greatest ratio of a path's length after to before: of the median, and of the 95th percentile.
const MEDIAN: f32 = 1.03;
const MOST: f32 = 1.15;

fn config(nodes: usize) -> PrmConfig {
    PrmConfig {
        random_nodes: nodes,
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        clearance_m: 0.2,
        seed: 1,
        sampling: Sampling::Uniform,
    }
}

fn file(roadmap: &BuiltRoadmap, config: &PrmConfig) -> Vec<u8> {
    roadmap::encode(roadmap, &roadmap::header(config, Geodetic::default(), 0, 0))
        .expect("it is a roadmap")
}

/// Lengths of the shortest paths from a node to all others, metres.
fn ways(
    view: &RoadmapView<'_>,
    from: u16,
    required_m: f32,
    workspace: &mut SearchWorkspace<4096>,
) -> Vec<f32> {
    dijkstra_all(view, from, |_, edge| view.has_clearance(edge, required_m), workspace)
        .expect("it fits");
    (0..view.node_count() as u16).map(|node| workspace.distance_m(node)).collect()
}

/// Asserts that the same nodes reach one another, and that paths lengthen no more than the limits
/// allow.
fn paths_stay_short(name: &str, all: &RoadmapView<'_>, kept: &RoadmapView<'_>) {
    let mut workspace = Box::new(SearchWorkspace::<4096>::new());
    for required_m in CLEARANCES_M {
        let mut ratios = Vec::new();
        for i in 0..SOURCES {
            // A node other than those whose paths decide which edges are kept.
            let from =
                (u32::from(2 * i + 1) * all.node_count() as u32 / u32::from(2 * SOURCES)) as u16;
            let before = ways(all, from, required_m, &mut workspace);
            let after = ways(kept, from, required_m, &mut workspace);
            for (node, (before, after)) in before.iter().zip(&after).enumerate() {
                assert_eq!(
                    before.is_finite(),
                    after.is_finite(),
                    "{name}: {from} to {node}, {required_m} m"
                );
                if *before > 0.0 && before.is_finite() {
                    ratios.push(after / before);
                }
            }
        }
        ratios.sort_by(f32::total_cmp);
        if ratios.is_empty() {
            println!("{name}: no vehicle that needs {required_m} m gets anywhere");
            continue;
        }
        let at = |share: f32| ratios[((ratios.len() - 1) as f32 * share) as usize];
        println!(
            "{name}, {required_m} m: {} ways, longer by {:.2} % in the median, {:.2} % at the 95th percentile, \
             {:.1} % at most",
            ratios.len(),
            100.0 * (at(0.5) - 1.0),
            100.0 * (at(0.95) - 1.0),
            100.0 * (at(1.0) - 1.0)
        );
        assert!(at(0.5) <= MEDIAN && at(0.95) <= MOST, "{name}, {required_m} m");
    }
}

/// Builds a roadmap, cuts it down for a board and checks that its paths stay short.
fn holds(name: &str, map: &VoxelMap, config: PrmConfig, board: &BoardCapacity) {
    let began = Instant::now();
    let (all, parts) = roadmap::build(map, &[], &config).expect("there is free space");
    let built = began.elapsed();
    let count = all.edges.len();
    let kept = all.clone().fit_to_board(board).expect("it can be cut down");
    let fitted = began.elapsed() - built;
    let (all, kept) = (file(&all, &config), file(&kept, &config));
    println!(
        "{name}: {count} edges, {} bytes, built in {built:.2?} {parts:?}, for {} cut down to {} bytes in {fitted:.2?}",
        all.len(),
        board.name,
        kept.len()
    );
    let (all, kept) = (RoadmapView::parse(&all).unwrap(), RoadmapView::parse(&kept).unwrap());
    assert!(board.roadmap_excess(&all).is_some(), "{name}: it fits as it is");
    assert_eq!(board.roadmap_excess(&kept), None, "{name}");
    paths_stay_short(name, &all, &kept);
}

/// `FLOCKMATE_CAPS` sets the number of roadmaps per map.
#[test]
fn scanned_maps_fit_and_paths_stay_short() {
    let seeds: u64 =
        std::env::var("FLOCKMATE_CAPS").map_or(1, |count| count.parse().expect("a number"));
    for (name, resolution_m) in
        [("geb079", 0.08), ("manufacturing", 0.086_642_2), ("maze", 0.195_32)]
    {
        let Some(path) = shared_data(&format!("maps3d/{name}.bt")) else { return };
        let map = map::load(path.to_str().unwrap(), resolution_m)
            .unwrap()
            .to_voxel_map(UnknownSpace::Blocked);
        // The method of cutting down was chosen with the first seed.
        for seed in 1..=seeds {
            holds(name, &map, PrmConfig { seed, ..config(2300) }, &BOARDS[0]);
        }
    }
}

/// A hall of 36 × 28 × 8 m with rows of shelves, at 0.05 m.
fn hall() -> VoxelMap {
    let shape = GridShape { dims: [720, 560, 160], min: Point::zeros(), resolution_m: 0.05 };
    let mut map = OccupancyMap::all_unknown(shape, "hall").unwrap();
    map.fill([0; 3], shape.dims, Occupancy::Occupied);
    map.fill([4; 3], [716, 556, 156], Occupancy::Free);
    for row in 0..7 {
        for shelf in 0..3 {
            let (x, y) = (40 + 96 * row, 40 + 170 * shelf);
            map.fill([x, y, 4], [x + 16, y + 110, 40 + 10 * shelf], Occupancy::Occupied);
        }
    }
    map.to_voxel_map(UnknownSpace::Blocked)
}

/// Takes eight seconds in a release build.
#[test]
fn a_fine_hall_of_a_million_edges_fits() {
    let map = hall();
    let began = Instant::now();
    let config = config(4000);
    let (all, parts) = roadmap::build(&map, &[], &config).expect("there is free space");
    assert!(all.edges.len() >= 1_000_000, "only {} edges", all.edges.len());
    let kept = all.clone().fit_to_board(&BOARDS[0]).expect("it can be cut down");
    let bytes = file(&kept, &config);
    let took = began.elapsed();
    println!(
        "hall: {} edges, {} bytes for a board, {took:.2?}: {parts:?}",
        all.edges.len(),
        bytes.len()
    );
    assert_eq!(BOARDS[0].roadmap_excess(&RoadmapView::parse(&bytes).unwrap()), None);
}

/// The capacities that host-sim lists for the default board are those of its firmware.
#[test]
fn boards_are_what_their_firmware_is() {
    use firmware::capacity::{GATES, HALF_EDGES, ROADMAP_NODES, TIMED_SEGMENTS, VEHICLES};
    let BoardCapacity { nodes, half_edges, vehicles, gates, timed_segments: pieces, .. } =
        BOARDS[0];
    let held = [ROADMAP_NODES, HALF_EDGES, VEHICLES, GATES, TIMED_SEGMENTS];
    assert_eq!([nodes, half_edges, vehicles, gates, pieces], held);
    let halved = [nodes / 2, half_edges / 2, vehicles / 2, gates, pieces / 2];
    let BoardCapacity { nodes, half_edges, vehicles, gates, timed_segments: pieces, .. } =
        BOARDS[2];
    assert_eq!([nodes, half_edges, vehicles, gates, pieces], halved);
}
