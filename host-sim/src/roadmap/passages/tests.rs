//! Passages: rooms behind narrow doors are joined, by clear edges, and what is walled off stays so.

use super::{ConnectedComponents, WantedConnection};
use crate::map::occupancy::{OccupancyMap, UnknownSpace};
use crate::map::{Occupancy, VoxelMap};
use crate::roadmap::{BuiltRoadmap, add_passages, build};
use planner_core::Point;
use planner_core::map::segment::segment_is_clear;
use planner_core::map::voxel::GridShape;
use planner_core::roadmap::prm::{PrmConfig, Sampling};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const REQUIRED_M: f32 = 0.24;

/// Rooms of 3 × 4 m in a row; each wall between two has a full-height door 0.5 m wide at a random
/// place.
fn rooms(rng: &mut Pcg32, count: u32) -> VoxelMap {
    let dims = [30 * count, 40, 20];
    let shape = GridShape { dims, min: Point::zeros(), resolution_m: 0.1 };
    let doors: Vec<u32> = (0..count).map(|_| 2 + rng.next_u32() % 32).collect();
    let mut map = OccupancyMap::all_unknown(shape, "rooms").unwrap();
    for k in 0..dims[2] {
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                let door = doors[(i / 30) as usize];
                let wall = i % 30 == 29 && i + 1 < dims[0] && !(door..door + 5).contains(&j);
                map.set(
                    [i, j, k],
                    if wall || k == 0 { Occupancy::Occupied } else { Occupancy::Free },
                );
            }
        }
    }
    map.to_voxel_map(UnknownSpace::Blocked)
}

#[test]
fn rooms_behind_narrow_doors_are_joined() {
    let mut rng = Pcg32::seed_from_u64(3);
    let mut missed = 0;
    for seed in 0..20 {
        let count = 2 + rng.next_u32() % 4;
        let map = rooms(&mut rng, count);
        let ends = [Point::new(1.0, 1.0, 1.0), Point::new(3.0 * count as f32 - 1.0, 3.0, 1.0)];
        let config = PrmConfig {
            random_nodes: 60,
            edge_min_m: 0.2,
            edge_max_m: 2.5,
            clearance_m: REQUIRED_M,
            seed,
            sampling: Sampling::Uniform,
        };
        let (mut roadmap, _) = build(&map, &ends, &config).unwrap();
        let before = roadmap.nodes.len();
        let joined = |roadmap: &BuiltRoadmap| {
            let mut parts =
                ConnectedComponents::new(roadmap.nodes.len(), &roadmap.edges, REQUIRED_M);
            parts.component_of(0) == parts.component_of(1)
        };
        missed += usize::from(!joined(&roadmap));
        let wanted =
            [WantedConnection { start_node: 0, goal_node: 1, required_clearance_m: REQUIRED_M }];
        let added = add_passages(&map, &mut roadmap, &config, &wanted).unwrap();
        assert!(joined(&roadmap), "seed {seed}");
        assert_eq!(roadmap.nodes.len(), before + added);
        assert_eq!(roadmap.heights_above_ground_m.len(), roadmap.nodes.len());
        for edge in &roadmap.edges {
            let (a, b) = (roadmap.nodes[usize::from(edge.a)], roadmap.nodes[usize::from(edge.b)]);
            assert!(segment_is_clear(&map.grid(), &a, &b, REQUIRED_M), "seed {seed}: {edge:?}");
        }
        assert_eq!(add_passages(&map, &mut roadmap, &config, &wanted).unwrap(), 0);
    }
    assert!(missed > 15, "random nodes alone joined {} of 20", 20 - missed);
}

#[test]
fn what_is_walled_off_stays_so() {
    let mut rng = Pcg32::seed_from_u64(4);
    let map = rooms(&mut rng, 2);
    let ends = [Point::new(1.0, 1.0, 1.0), Point::new(5.0, 3.0, 1.0)];
    let config = PrmConfig {
        random_nodes: 60,
        edge_min_m: 0.2,
        edge_max_m: 2.5,
        clearance_m: 0.26,
        seed: 1,
        sampling: Sampling::Uniform,
    };
    let (mut roadmap, _) = build(&map, &ends, &config).unwrap();
    let wanted = [WantedConnection { start_node: 0, goal_node: 1, required_clearance_m: 0.26 }];
    assert_eq!(add_passages(&map, &mut roadmap, &config, &wanted).unwrap(), 0);
}
