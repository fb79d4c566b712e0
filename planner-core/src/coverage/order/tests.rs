extern crate std;
use std::vec::Vec;

use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

use super::*;

fn way_m(lanes: &[Lane]) -> f32 {
    lanes.windows(2).map(|pair| (pair[1].from - pair[0].to).norm()).sum()
}

#[test]
fn back_and_forth_begins_at_the_end_that_joins_lanes_by_less() {
    let mut random = Pcg32::seed_from_u64(7);
    let mut unit = || random.next_u32() as f32 / u32::MAX as f32;
    let mut turned = 0;
    for _ in 0..500 {
        let count = 1 + (unit() * 12.0) as u16;
        let mut lane = |strip: u16| {
            let v = 10.0 * f32::from(strip);
            let (from, to) = (Flat::new(30.0 * unit(), v), Flat::new(60.0 + 30.0 * unit(), v));
            Lane { from, to, first: 0, count: 0, start_m: 0.0, strip }
        };
        let laid: Vec<Lane> = (0..count).map(&mut lane).collect();
        let mut sorted = laid.clone();
        order_lanes(&mut sorted, &Transit::<1>::empty(), 0);
        let ways = [0, 1].map(|first| {
            let mut lanes = laid.clone();
            lanes.iter_mut().skip(first).step_by(2).for_each(Lane::reverse);
            way_m(&lanes)
        });
        assert!(way_m(&sorted) <= ways[0].min(ways[1]) + 2.0 * MIN_GAIN_M, "{} of {ways:?}", way_m(&sorted));
        assert!(sorted.iter().zip(&laid).all(|(lane, own)| lane.strip == own.strip));
        turned += usize::from(sorted[0].from != laid[0].from);
    }
    assert!((100..400).contains(&turned), "{turned}");
}
