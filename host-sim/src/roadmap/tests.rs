use super::*;
use crate::map::UnknownSpace;
use crate::map::building::building_map;
use planner_core::roadmap::prm::Sampling;

#[test]
fn any_number_of_threads_gives_the_same_edges() {
    let map = building_map(1, 0.5).unwrap().to_voxel_map(UnknownSpace::Blocked);
    let config = PrmConfig {
        random_nodes: 500,
        edge_min_m: 0.5,
        edge_max_m: 8.0,
        clearance_m: 0.0,
        seed: 1,
        sampling: Sampling::Uniform,
    };
    let nodes = sample(&map, &[], &config).unwrap();
    let mut workspace = Box::new(NodeGrid::<512, 4096>::new());
    let mut alone = vec![prm::PrmEdge::default(); 20_000];
    let count = prm::connect(&map.grid(), &nodes, &config, &mut workspace, &mut alone).unwrap();
    assert!(count > 500);
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let edges = pool.install(|| connect(&map.grid(), &nodes, &config, &mut workspace)).unwrap();
        assert_eq!(edges, alone[..count]);
    }
}
