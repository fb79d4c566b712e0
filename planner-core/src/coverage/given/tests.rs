extern crate std;
use std::vec::Vec;

use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

use super::super::area::{Area, Ring, RingKind};
use super::super::footprint::Footprint;
use super::super::tracks::{self, LanePattern, LaneWorkspace};
use super::*;

/// Side of the square footprint, and greatest spacing of lanes and of waypoints, metres.
const LANE_M: f32 = 7.0;

fn spacing() -> Spacing {
    let footprint = Footprint { along_m: LANE_M, across_m: LANE_M };
    Spacing { footprint, max_lane_spacing_m: LANE_M, max_waypoint_spacing_m: LANE_M }
}

#[test]
fn lanes_in_any_order_become_one_way_as_short_as_the_planners_own() {
    let mut random = Pcg32::seed_from_u64(11);
    let mut unit = || random.next_u32() as f32 / u32::MAX as f32;
    for case in 0..200 {
        let (wide, high) = (60.0 + 200.0 * unit(), 60.0 + 200.0 * unit());
        let (x, y) = (wide * (0.2 + 0.3 * unit()), high * (0.2 + 0.3 * unit()));
        let (side, slant) = (10.0 + 20.0 * unit(), 30.0 * unit());
        let vertices = [
            Flat::new(0.0, 0.0),
            Flat::new(wide, slant),
            Flat::new(wide + slant, high + slant),
            Flat::new(0.0, high),
            Flat::new(x, y),
            Flat::new(x + side, y),
            Flat::new(x + side, y + side),
            Flat::new(x, y + side),
        ];
        let zone = Ring { end: 8, kind: RingKind::NoFly };
        let rings = [Ring { end: 4, kind: RingKind::Outer }, zone];
        let area = Area::new(&vertices, &rings).expect("an area");
        let mut transit = TransitGraph::<8>::empty();
        transit.set_area(area).expect("room");
        let angle_deg = (case % 2 == 0).then(|| 180.0 * unit());
        let pattern = LanePattern {
            spacing: spacing(),
            angle_from_east_deg: angle_deg,
            border_overshoot_m: 0.0,
            max_search_steps: 20_000,
        };
        let (mut ws, mut own) = (LaneWorkspace::<16>::new(), Tracks::<256>::new());
        tracks::build_lanes(&area, &pattern, &transit, &mut ws, &mut own).expect("lanes");

        let mut given: Vec<[Flat; 2]> =
            own.lanes().iter().map(|lane| [lane.from, lane.to]).collect();
        for k in (1..given.len()).rev() {
            given.swap(k, (unit() * k as f32) as usize);
            if unit() < 0.5 {
                given[k].reverse();
            }
        }
        let mut found = Tracks::<256>::new();
        order_given_lanes(&given, &spacing(), 20_000, &transit, &mut found).expect("an order");

        let ends = |lane: &Lane| [lane.from, lane.to];
        let is_same = |a: &[Flat; 2], b: &[Flat; 2]| {
            let apart = |c: &Flat, d: &Flat| (c - d).length();
            let straight = apart(&a[0], &b[0]).max(apart(&a[1], &b[1]));
            straight.min(apart(&a[0], &b[1]).max(apart(&a[1], &b[0]))) < 1e-3
        };
        assert_eq!(found.lanes().len(), given.len());
        for lane in &given {
            let times = found.lanes().iter().filter(|own| is_same(lane, &ends(own))).count();
            assert_eq!(times, 1, "{case}: {lane:?}");
        }
        assert_eq!(found.waypoint_count(), own.waypoint_count(), "{case}");
        assert!(
            found.length_m() <= 1.05 * own.length_m(),
            "{case}: {} {}",
            found.length_m(),
            own.length_m()
        );
    }
}

#[test]
fn lanes_that_are_none_are_refused() {
    let transit = TransitGraph::<1>::empty();
    let mut found = Tracks::<2>::new();
    let mut order =
        |given: &[[Flat; 2]]| order_given_lanes(given, &spacing(), 100, &transit, &mut found);
    let place = Flat::new(3.0, 4.0);
    assert_eq!(order(&[]), Err(CoverageError::NothingToCover));
    assert_eq!(order(&[[place, place]]), Err(CoverageError::NothingToCover));
    let lane = [place, Flat::new(9.0, 4.0)];
    assert_eq!(order(&[lane; 3]), Err(CoverageError::LanesFull));
    assert_eq!(order(&[lane, lane]), Ok(()));
    assert!(order(&[[Flat::new(f32::NAN, 0.0), place]]).is_err());
}
