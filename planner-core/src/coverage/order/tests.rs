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
            Lane { from, to, first_waypoint: 0, waypoint_count: 0, start_along_m: 0.0, strip }
        };
        let laid: Vec<Lane> = (0..count).map(&mut lane).collect();
        let mut sorted = laid.clone();
        let count = sorted.len();
        order_lanes(&mut sorted, count, &TransitGraph::<1>::empty(), 0);
        let ways = [0, 1].map(|first| {
            let mut lanes = laid.clone();
            lanes.iter_mut().skip(first).step_by(2).for_each(Lane::reverse);
            way_m(&lanes)
        });
        assert!(
            way_m(&sorted) <= ways[0].min(ways[1]) + 2.0 * MIN_GAIN_M,
            "{} of {ways:?}",
            way_m(&sorted)
        );
        assert!(sorted.iter().zip(&laid).all(|(lane, own)| lane.strip == own.strip));
        turned += usize::from(sorted[0].from != laid[0].from);
    }
    assert!((100..400).contains(&turned), "{turned}");
}

#[test]
fn a_search_makes_no_way_longer_and_knows_its_length() {
    let mut random = Pcg32::seed_from_u64(8);
    let mut unit = || random.next_u32() as f32 / u32::MAX as f32;
    let mut shorter = 0;
    for case in 0..200 {
        let count = 3 + (unit() * 30.0) as usize;
        let strips = 2 + (unit() * (count - 2) as f32) as usize;
        let mut laid = Vec::new();
        for k in 0..count {
            // The first lanes: two in each strip. The others: anywhere.
            let v = if k < strips {
                10.0 * (k / 2) as f32
            } else {
                10.0 * unit() * strips as f32 / 2.0
            };
            let u = if k < strips { 60.0 * (k % 2) as f32 + 30.0 * unit() } else { 100.0 * unit() };
            let (from, to) = (Flat::new(u, v), Flat::new(u + 20.0 * unit(), v));
            let strip = if k < strips { (k / 2) as u16 } else { (v / 10.0) as u16 };
            laid.push(Lane {
                from,
                to,
                first_waypoint: 0,
                waypoint_count: 0,
                start_along_m: 0.0,
                strip,
            });
        }
        crate::coverage::cells::group_into_cells(&mut laid[..strips]);
        let ways = [0, 300, 20_000].map(|search_steps| {
            let mut lanes = laid.clone();
            order_lanes(&mut lanes, strips, &TransitGraph::<1>::empty(), search_steps);
            for own in &laid {
                let same = |lane: &&Lane| {
                    (lane.from, lane.to) == (own.from, own.to)
                        || (lane.to, lane.from) == (own.from, own.to)
                };
                assert_eq!(lanes.iter().filter(same).count(), 1, "{case}: {own:?}");
            }
            let known: f32 = lanes.iter().map(super::super::lanes::Lane::link_to_next_m).sum();
            assert!((known - way_m(&lanes)).abs() < 0.01, "{case}: {known} of {}", way_m(&lanes));
            way_m(&lanes)
        });
        assert!(ways[2] <= ways[1] + 0.01 && ways[1] <= 1.2 * ways[0], "{case}: {ways:?}");
        shorter += usize::from(ways[2] < 0.9 * ways[0]);
    }
    assert!(shorter > 50, "{shorter}");
}
