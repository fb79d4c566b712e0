use rand_core::{Rng, SeedableRng};

use super::*;

/// A rectangle by its corners in whole metres.
fn rectangle([x0, y0, x1, y1]: [u32; 4]) -> Vec<Flat> {
    [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| Flat::new(x as f32, y as f32)).to_vec()
}

fn random(pcg: &mut rand_pcg::Pcg32, most: u32) -> [u32; 4] {
    let mut span = || {
        let from = pcg.next_u32() % most;
        (from, from + 1 + pcg.next_u32() % (most - from))
    };
    let ((x0, x1), (y0, y1)) = (span(), span());
    [x0, y0, x1, y1]
}

/// Every square metre of rectangles on a grid can be counted.
#[test]
fn rectangles_overlap_where_a_square_metre_says_so() {
    let mut seen = [0; 5];
    for seed in 0..20_000 {
        let mut pcg = rand_pcg::Pcg32::seed_from_u64(seed);
        let outers: Vec<[u32; 4]> = (0..1 + seed % 2).map(|_| random(&mut pcg, 6)).collect();
        let holes: Vec<[u32; 4]> = (0..seed % 3).map(|_| random(&mut pcg, 6)).collect();
        let holds = |r: &[u32; 4], x: u32, y: u32| r[0] <= x && x < r[2] && r[1] <= y && y < r[3];
        let count = |all: &[[u32; 4]], x, y| all.iter().filter(|r| holds(r, x, y)).count();
        let cells = || (0..6).flat_map(|x| (0..6).map(move |y| (x, y)));
        let within = |hole: &[u32; 4], outer: &[u32; 4]| {
            cells().all(|(x, y)| !holds(hole, x, y) || holds(outer, x, y))
        };
        let full =
            |outer: &[u32; 4]| cells().all(|(x, y)| !holds(outer, x, y) || count(&holes, x, y) > 0);
        let right = if cells().any(|(x, y)| count(&outers, x, y) > 1) {
            1
        } else if cells().any(|(x, y)| count(&holes, x, y) > 1) {
            2
        } else if holes.iter().any(|hole| !outers.iter().any(|outer| within(hole, outer))) {
            3
        } else {
            4 * usize::from(outers.iter().any(full))
        };
        let [outer_rings, hole_rings] =
            [&outers, &holes].map(|all| all.iter().copied().map(rectangle).collect::<Vec<_>>());
        let [o, h] = [&outer_rings, &hole_rings]
            .map(|all| all.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let found = match find_ring_fault(&o, &h) {
            None => 0,
            Some(RingFault::OutersOverlap(..)) => 1,
            Some(RingFault::HolesOverlap(..)) => 2,
            Some(RingFault::HoleNotInsideOuter(_)) => 3,
            Some(RingFault::OuterFilledByHoles(_)) => 4,
            Some(RingFault::OuterTooThin(_)) => panic!("seed {seed}: {outers:?}"),
        };
        assert_eq!(found, right, "seed {seed}: {outers:?} without {holes:?}");
        seen[found] += 1;
    }
    assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
}
