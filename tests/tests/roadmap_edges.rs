//! The spatial index finds the same edges as the all-pairs loop of Algorithm 1 with the same
//! segment check.

use flockmate_tests::shared_data;
use host_sim::map::{self, BoxTree, UnknownSpace, VoxelMap};
use host_sim::roadmap::{self, MAX_STORED_CLEARANCE_M};
use planner_core::roadmap::prm::{self, NodeGrid, PrmConfig, Sampling};

const SEEDS: u64 = 20;

fn load(file: &str, resolution_m: f32) -> VoxelMap {
    map::load(file, resolution_m).expect("the map is good").to_voxel_map(UnknownSpace::Blocked)
}

fn same_edges(name: &str, map: &VoxelMap, nodes: usize, clearance_m: f32) {
    let mut fewest = usize::MAX;
    let mut workspace = Box::new(NodeGrid::<4096, 4096>::new());
    let grid = map.grid();
    let tree = BoxTree::new(&grid);
    for seed in 1..=SEEDS {
        let config = PrmConfig {
            random_nodes: nodes,
            edge_min_m: 0.5,
            edge_max_m: 8.0,
            clearance_m,
            seed,
            sampling: Sampling::Uniform,
        };
        let nodes = roadmap::sample(map, &[], &config).expect("there is free space");
        let joined =
            roadmap::connect_with_clearances(&grid, &tree, &nodes, &config, &mut workspace)
                .expect("it joins");
        let mut indexed: Vec<_> = joined.iter().map(|e| prm::PrmEdge { a: e.a, b: e.b }).collect();
        let mut all_pairs = Vec::new();
        prm::connect_all_pairs(&map.grid(), &nodes, &config, |edge| all_pairs.push(edge))
            .expect("it connects");
        indexed.sort_unstable_by_key(|e| (e.a, e.b));
        all_pairs.sort_unstable_by_key(|e| (e.a, e.b));
        assert!(indexed == all_pairs, "{name}, clearance {clearance_m} m, seed {seed}");
        if seed == 1 {
            for edge in &joined {
                let ends = prm::PrmEdge { a: edge.a, b: edge.b };
                let by_cells_m = prm::edge_clearance(&grid, &nodes, ends, MAX_STORED_CLEARANCE_M)
                    .expect("they are nodes");
                let apart_m = (by_cells_m - edge.clearance_m).abs();
                assert!(apart_m < 0.001, "{name}: {edge:?} has a clearance of {by_cells_m} m");
            }
        }
        fewest = fewest.min(indexed.len());
    }
    assert!(fewest > 100, "{name}: only {fewest} edges prove little");
}

#[test]
fn building_without_a_margin() {
    same_edges("building", &load("builtin:building", 0.25), 2300, 0.0);
}

#[test]
fn building_with_half_a_metre() {
    same_edges("building", &load("builtin:building", 0.25), 2300, 0.5);
}

#[test]
fn corridor_scan() {
    let Some(file) = shared_data("maps3d/geb079.bt") else { return };
    same_edges("geb079", &load(&file.to_string_lossy(), 0.08), 600, 0.25);
}

#[test]
fn manufacturing_hall() {
    let Some(file) = shared_data("maps3d/manufacturing.bt") else { return };
    same_edges("manufacturing", &load(&file.to_string_lossy(), 0.0866422), 600, 0.25);
}
