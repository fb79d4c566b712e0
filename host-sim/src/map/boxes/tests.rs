//! The tree against distances to every cell, one by one.

use super::*;
use planner_core::map::segment::segment_clearance;
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn uniform(rng: &mut Pcg32, from: f32, to: f32) -> f32 {
    from + (to - from) * (rng.next_u32() >> 8) as f32 / 16_777_216.0
}

/// Random blocks and single cells.
fn random_words(shape: &GridShape, rng: &mut Pcg32) -> Vec<u64> {
    let mut words = vec![0; shape.word_count()];
    for block in 0..rng.next_u32() % 12 {
        let low = shape.dims.map(|dim| rng.next_u32() % dim);
        let largest = if block % 3 == 0 { 1 } else { 9 };
        let high = [0, 1, 2].map(|a| (low[a] + 1 + rng.next_u32() % largest).min(shape.dims[a]));
        for k in low[2]..high[2] {
            for j in low[1]..high[1] {
                for i in low[0]..high[0] {
                    let (word, mask) = shape.word_and_mask([i, j, k]);
                    words[word] |= mask;
                }
            }
        }
    }
    words
}

proptest! {
    #[test]
    fn distances_are_those_of_the_walk_over_cells(
        seed in any::<u64>(),
        dims in [1u32..40, 1u32..40, 1u32..40],
        blocked in any::<bool>(),
    ) {
        let mut rng = Pcg32::seed_from_u64(seed);
        let shape = GridShape {
            dims,
            min: Point::new(-3.0, 2.0, 0.5),
            resolution_m: uniform(&mut rng, 0.05, 1.0),
        };
        let words = random_words(&shape, &mut rng);
        let outside = if blocked { Outside::Blocked } else { Outside::Free };
        let grid = VoxelGrid::new(shape, outside, &words).unwrap();
        let tree = BoxTree::new(&grid);
        let without_vectors = BoxTree { arch: Arch::Scalar, nodes: tree.nodes.clone(), ..tree };
        let size = shape.max() - shape.min;
        for case in 0..60 {
            let spill = if blocked { 0.0 } else { 0.2 };
            let mut place = || {
                let share = [0, 1, 2].map(|_| uniform(&mut rng, -spill, 1.0 + spill));
                shape.min + size.component_mul(&Point::from(share))
            };
            let a = place();
            let mut b = place();
            if case % 5 == 0 {
                b.x = a.x;
            }
            if case % 10 == 0 {
                b = a;
            }
            let most_m = uniform(&mut rng, 0.1, 12.0);
            let want = segment_clearance(&grid, &a, &b, most_m);
            let got = tree.clearance_m(&a, &b, most_m, 0.0);
            prop_assert!((want - got).abs() < 2e-4, "{a} {b}: {want} m, by the tree {got} m");
            prop_assert_eq!(got, without_vectors.clearance_m(&a, &b, most_m, 0.0));
            let enough_m = uniform(&mut rng, 0.0, 6.0);
            let early = tree.clearance_m(&a, &b, most_m, enough_m);
            prop_assert!(early == got || early >= got && early <= enough_m * 1.000_001);
        }
    }
}

#[test]
fn a_place_that_is_none_is_at_no_distance() {
    let shape = GridShape { dims: [4; 3], min: Point::zeros(), resolution_m: 1.0 };
    let grid = VoxelGrid::new(shape, Outside::Free, &[0]).unwrap();
    let tree = BoxTree::new(&grid);
    let here = Point::new(1.0, 1.0, 1.0);
    assert_eq!(tree.clearance_m(&here, &Point::new(f32::NAN, 1.0, 1.0), 5.0, 0.0), 0.0);
    assert_eq!(tree.clearance_m(&here, &here, 5.0, 0.0), 5.0);
}
