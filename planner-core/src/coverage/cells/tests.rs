extern crate std;
use std::vec::Vec;

use super::*;
use crate::coverage::Flat;

fn lane(strip: u16, [from, to]: [f32; 2]) -> Lane {
    let v = 10.0 * f32::from(strip);
    Lane {
        from: Flat::new(from, v),
        to: Flat::new(to, v),
        first_waypoint: 0,
        waypoint_count: 0,
        start_along_m: 0.0,
        strip,
    }
}

/// Lanes around a zone in strips 2 to 5, two whole strips below and three above.
fn around_a_zone() -> Vec<Lane> {
    let whole = |strip| lane(strip, [0.0, 100.0]);
    let both = |strip| [lane(strip, [0.0, 40.0]), lane(strip, [60.0, 100.0])];
    let below = [0, 1].map(whole).into_iter();
    below.chain((2..6).flat_map(both)).chain([6, 7, 8].map(whole)).collect()
}

#[test]
fn a_zone_makes_four_cells() {
    let mut lanes = around_a_zone();
    group_into_cells(&mut lanes);
    let cells: Vec<u32> = lanes.iter().map(super::super::lanes::Lane::cell).collect();
    assert_eq!(cells, [0, 0, 1, 2, 1, 2, 1, 2, 1, 2, 3, 3, 3]);
    // A strip without lanes ends a cell, and so does a strip in which one lane becomes two.
    let mut lanes =
        [lane(0, [0.0, 9.0]), lane(2, [0.0, 9.0]), lane(3, [0.0, 4.0]), lane(3, [5.0, 9.0])];
    group_into_cells(&mut lanes);
    assert_eq!(lanes.map(|lane| lane.cell()), [0, 1, 2, 3]);
}

#[test]
fn each_cell_is_flown_back_and_forth_in_one_go() {
    let laid = around_a_zone();
    let mut lanes = laid.clone();
    group_into_cells(&mut lanes);
    order_cells(&mut lanes, &TransitGraph::<1>::empty());
    // Up on one side of the zone, on over the strips above it, then down on the other side.
    let strips: Vec<u16> = lanes.iter().map(|lane| lane.strip).collect();
    assert_eq!(strips, [0, 1, 2, 3, 4, 5, 6, 7, 8, 5, 4, 3, 2]);
    for pair in lanes.windows(2).filter(|pair| pair[0].cell() == pair[1].cell()) {
        assert!(((pair[1].from - pair[0].to).length() - 10.0).abs() < 1e-3, "{pair:?}");
    }
    for own in &laid {
        let same = |lane: &&Lane| {
            (lane.from, lane.to) == (own.from, own.to) || (lane.to, lane.from) == (own.from, own.to)
        };
        assert_eq!(lanes.iter().filter(same).count(), 1);
    }
}
