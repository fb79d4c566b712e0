//! The builder compared with the all-pairs loop, and what it refuses.

extern crate std;

use std::vec;
use std::vec::Vec;

use super::*;
use crate::map::voxel::{GridShape, Outside};

fn config(seed: u64) -> PrmConfig {
    PrmConfig {
        random_nodes: 300,
        edge_min_m: 0.5,
        edge_max_m: 4.0,
        clearance_m: 0.0,
        seed,
        sampling: Sampling::Uniform,
    }
}

/// Walls with openings and some clutter, 12 × 10 × 6 m at `resolution_m`.
fn rooms(rng: &mut Pcg32, resolution_m: f32) -> (GridShape, Vec<u64>) {
    let dims = [12.0, 10.0, 6.0].map(|m: f32| (m / resolution_m) as u32);
    let shape = GridShape { dims, min: Point::new(-3.0, 1.0, 0.5), resolution_m };
    let mut words = vec![0; shape.word_count()];
    let walls: Vec<(usize, u32, [u32; 3])> = (0..4)
        .map(|i| {
            let axis = i % 3;
            let door = [0, 1, 2].map(|a| rng.next_u32() % (dims[a] * 2 / 3));
            (axis, rng.next_u32() % dims[axis], door)
        })
        .collect();
    for i in 0..dims[0] {
        for j in 0..dims[1] {
            for k in 0..dims[2] {
                let cell = [i, j, k];
                let wall = walls.iter().any(|(axis, at, door)| {
                    let open = (0..3)
                        .all(|a| a == *axis || (door[a]..door[a] + dims[a] / 3).contains(&cell[a]));
                    cell[*axis] == *at && !open
                });
                if wall || rng.next_u32().is_multiple_of(500) {
                    let (word, mask) = shape.word_and_mask(cell);
                    words[word] |= mask;
                }
            }
        }
    }
    (shape, words)
}

/// Checks edges: the same set as the all-pairs loop gives, none twice.
fn check_edges(grid: &VoxelGrid<'_>, nodes: &[Point], config: &PrmConfig) -> usize {
    let mut workspace = NodeGrid::<400, 600>::new();
    let mut edges = vec![PrmEdge::default(); 50_000];
    let count = connect(grid, nodes, config, &mut workspace, &mut edges).unwrap();
    let mut split = Vec::new();
    for range in [0..97, 97..98, 98..nodes.len()] {
        connect_range(grid, &workspace, config, range, |e| {
            split.push(e);
            Ok(())
        })
        .unwrap();
    }
    assert_eq!(split, edges[..count], "ranges give the same edges in the same order");
    let mut all = Vec::new();
    connect_all_pairs(grid, nodes, config, |e| all.push(e)).unwrap();
    edges.truncate(count);
    edges.sort_unstable();
    assert_eq!(edges, all);
    count
}

#[test]
fn edges_are_those_of_all_pairs() {
    let mut total = 0;
    for seed in 0..20 {
        let mut rng = Pcg32::seed_from_u64(seed);
        let (shape, words) = rooms(&mut rng, [0.25, 0.2][seed as usize % 2]);
        for outside in [Outside::Blocked, Outside::Free] {
            let grid = VoxelGrid::new(shape, outside, &words).unwrap();
            for clearance_m in [0.0, 0.3] {
                let config = PrmConfig { clearance_m, ..config(seed) };
                let mut nodes = vec![Point::zeros(); 400];
                let count = sample_nodes(&grid, None, &[], &config, &mut nodes).unwrap();
                // Some nodes on cell corners, and two at one place.
                for node in &mut nodes[..20] {
                    *node = ((*node - shape.min) / shape.resolution_m).map(f32::round)
                        * shape.resolution_m
                        + shape.min;
                }
                nodes[21] = nodes[22];
                total += check_edges(&grid, &nodes[..count], &config);
            }
        }
    }
    assert!(total > 50_000, "{total} edges are too few to mean much");
}

/// A thin wall full of holes, nodes a hair to either side of its faces: rays leave the empty box at
/// shallow angles, often through a hole and into the cell beside it, which no shortcut may skip.
#[test]
fn rays_that_graze_a_wall_miss_no_cell_beside_them() {
    let (mut edges, mut pairs) = (0, 0);
    for seed in 0..15 {
        let mut rng = Pcg32::seed_from_u64(seed);
        let axis = seed as usize % 3;
        let shape =
            GridShape { dims: [40, 36, 32], min: Point::new(-1.0, 2.0, 0.5), resolution_m: 0.25 };
        let wall = shape.dims[axis] / 2;
        let mut words = vec![0; shape.word_count()];
        for i in 0..shape.dims[0] {
            for j in 0..shape.dims[1] {
                for k in 0..shape.dims[2] {
                    let in_wall = [i, j, k][axis] == wall && !rng.next_u32().is_multiple_of(3);
                    if in_wall || rng.next_u32().is_multiple_of(2000) {
                        let (word, mask) = shape.word_and_mask([i, j, k]);
                        words[word] |= mask;
                    }
                }
            }
        }
        let grid = VoxelGrid::new(shape, Outside::Blocked, &words).unwrap();
        const HAIRS: [f32; 8] =
            [0.0, 1.0 / 16384.0, 1.0 / 1024.0, 1.0 / 512.0, 1.0 / 300.0, 1.0 / 64.0, 0.1, 0.5];
        let nodes: Vec<Point> = (0..240)
            .map(|_| {
                let mut cells = uniform_point(&mut rng)
                    .component_mul(&Point::from(shape.dims.map(|d| d as f32)));
                let (hair, draw) = (HAIRS[(rng.next_u32() % 8) as usize], rng.next_u32());
                let face = (wall + (draw & 1)) as f32;
                cells[axis] = if draw & 2 == 0 { face - hair } else { face + hair };
                shape.min + cells * shape.resolution_m
            })
            .collect();
        let config = PrmConfig { edge_max_m: 6.0, ..config(seed) };
        edges += check_edges(&grid, &nodes, &config);
        pairs += nodes.len() * (nodes.len() - 1) / 2;
    }
    assert!(
        edges > 10_000 && edges < pairs / 2,
        "{edges} of {pairs}: too few of one kind to mean much"
    );
}

#[test]
fn nodes_are_free_and_repeat_with_the_seed() {
    let (shape, words) = rooms(&mut Pcg32::seed_from_u64(3), 0.25);
    let grid = VoxelGrid::new(shape, Outside::Blocked, &words).unwrap();
    let terminals = [Point::new(0.1, 2.0, 1.1), Point::new(2.0, 3.0, 1.0)];
    for sampling in [Sampling::Uniform, Sampling::Halton] {
        let config = PrmConfig { clearance_m: 0.2, sampling, ..config(5) };
        let mut nodes = vec![Point::zeros(); 302];
        assert_eq!(sample_nodes(&grid, None, &terminals, &config, &mut nodes), Ok(302));
        assert_eq!(nodes[..2], terminals);
        for node in &nodes[2..] {
            assert!(point_clearance(&grid, node, 1.0) > 0.2, "{node:?}");
        }
        let mut again = vec![Point::zeros(); 302];
        sample_nodes(&grid, None, &terminals, &config, &mut again).unwrap();
        assert_eq!(nodes, again);
        sample_nodes(&grid, None, &terminals, &PrmConfig { seed: 6, ..config }, &mut again)
            .unwrap();
        assert_ne!(nodes, again);
        // Even: about half of the 300 nodes lie in the western half of the map.
        let middle = (shape.min + shape.max()) / 2.0;
        let low = nodes[2..].iter().filter(|p| p.x < middle.x).count();
        assert!((100..200).contains(&low), "{low} of 300 in one half");
    }
}

/// A wall across the map with a door that leaves 0.2 m to fly in. Nodes of the bridge test also lie
/// along the edges of the rooms.
#[test]
fn bridges_lie_in_doors() {
    let (mut in_doors, mut by_chance) = (0, 0);
    for seed in 0..10 {
        let shape =
            GridShape { dims: [60, 40, 20], min: Point::new(-2.0, 1.0, 0.0), resolution_m: 0.1 };
        let mut words = vec![0; shape.word_count()];
        let door = 5 + seed as u32 * 2..13 + seed as u32 * 2;
        for (j, k) in
            (0..40).flat_map(|j| (0..20).map(move |k| (j, k))).filter(|(j, _)| !door.contains(j))
        {
            let (word, mask) = shape.word_and_mask([30, j, k]);
            words[word] |= mask;
        }
        let grid = VoxelGrid::new(shape, Outside::Blocked, &words).unwrap();
        let count = |sampling| {
            let config =
                PrmConfig { clearance_m: 0.3, random_nodes: 200, sampling, ..config(seed) };
            let mut nodes = vec![Point::zeros(); 200];
            sample_nodes(&grid, None, &[], &config, &mut nodes).unwrap();
            assert!(nodes.iter().all(|p| segment_is_clear(&grid, p, p, 0.3)));
            nodes.iter().filter(|p| (p.x - 1.05).abs() < 0.35).count()
        };
        in_doors += count(Sampling::Bridge);
        by_chance += count(Sampling::Uniform);
    }
    assert!(2 * in_doors > 3 * by_chance, "{in_doors} in doors, {by_chance} by chance");
}

#[test]
fn never_sampled_space_stays_empty() {
    let (shape, words) = rooms(&mut Pcg32::seed_from_u64(4), 0.25);
    let grid = VoxelGrid::new(shape, Outside::Free, &words).unwrap();
    // All but the lowest bricks.
    let [bx, by, _] = shape.brick_dims();
    let never: Vec<u64> =
        (0..words.len()).map(|i| if i < (bx * by) as usize { 0 } else { u64::MAX }).collect();
    let never = VoxelGrid::new(shape, Outside::Blocked, &never).unwrap();
    let mut nodes = vec![Point::zeros(); 300];
    sample_nodes(&grid, Some(&never), &[], &config(1), &mut nodes).unwrap();
    assert!(nodes.iter().all(|p| p.z < shape.min.z + 1.0));
}

#[test]
fn refusals_are_named() {
    let shape = GridShape { dims: [8, 8, 8], min: Point::zeros(), resolution_m: 0.5 };
    let (full, empty) = (vec![u64::MAX; 8], vec![0; 8]);
    let full = VoxelGrid::new(shape, Outside::Blocked, &full).unwrap();
    let empty = VoxelGrid::new(shape, Outside::Blocked, &empty).unwrap();
    let mut nodes = vec![Point::zeros(); 300];
    let good = config(1);
    assert_eq!(sample_nodes(&full, None, &[], &good, &mut nodes), Err(PrmError::NoFreeSpace(0)));
    let inside = Point::new(1.0, 1.0, 1.0);
    assert_eq!(
        sample_nodes(&full, None, &[inside], &good, &mut nodes),
        Err(PrmError::TooManyNodes)
    );
    let few = PrmConfig { random_nodes: 10, ..good };
    assert_eq!(
        sample_nodes(&full, None, &[inside], &few, &mut nodes),
        Err(PrmError::TerminalBlocked(0))
    );
    for bad in [
        Point::new(f32::NAN, 1.0, 1.0),
        Point::new(-0.1, 1.0, 1.0),
        Point::new(1.0, f32::INFINITY, 1.0),
    ] {
        assert_eq!(
            sample_nodes(&empty, None, &[inside, bad], &few, &mut nodes),
            Err(PrmError::TerminalBlocked(1))
        );
    }
    for (bad, name) in [
        (PrmConfig { edge_min_m: f32::NAN, ..few }, "edge_min_m"),
        (PrmConfig { edge_max_m: 0.4, ..few }, "edge_max_m"),
        (PrmConfig { edge_max_m: f32::INFINITY, ..few }, "edge_max_m"),
        (PrmConfig { clearance_m: -1.0, ..few }, "clearance_m"),
        (PrmConfig { random_nodes: 70_000, ..few }, "nodes"),
    ] {
        assert_eq!(sample_nodes(&empty, None, &[], &bad, &mut nodes), Err(PrmError::Config(name)));
    }
    let mut workspace = NodeGrid::<20, 8>::new();
    let count = sample_nodes(&empty, None, &[inside], &few, &mut nodes).unwrap();
    let mut edges = [PrmEdge::default(); 5];
    assert_eq!(
        connect(&empty, &nodes[..count], &few, &mut workspace, &mut edges),
        Err(PrmError::RoadmapFull)
    );
    assert_eq!(
        connect(&empty, &nodes[..21], &few, &mut workspace, &mut edges),
        Err(PrmError::TooManyNodes)
    );
    nodes[3].y = f32::NAN;
    assert_eq!(
        connect(&empty, &nodes[..count], &few, &mut workspace, &mut edges),
        Err(PrmError::NotFinite(3))
    );
    assert_eq!(connect(&empty, &[], &few, &mut workspace, &mut edges), Ok(0));
}

#[test]
fn an_edge_knows_its_clearance() {
    let shape = GridShape { dims: [16, 16, 16], min: Point::zeros(), resolution_m: 0.5 };
    let words = vec![0; shape.word_count()];
    let grid = VoxelGrid::new(shape, Outside::Blocked, &words).unwrap();
    let nodes = [Point::new(1.0, 2.0, 3.0), Point::new(4.0, 2.0, 3.0)];
    assert_eq!(edge_clearance(&grid, &nodes, PrmEdge { a: 0, b: 1 }, 4.0), Some(1.0));
    assert_eq!(edge_clearance(&grid, &nodes, PrmEdge { a: 0, b: 1 }, 0.5), Some(0.5));
    assert_eq!(edge_clearance(&grid, &nodes, PrmEdge { a: 0, b: 2 }, 0.5), None);
}
