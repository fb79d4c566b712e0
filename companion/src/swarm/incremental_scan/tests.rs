use planner_core::Point;
use planner_core::detour::ZoneKind;

use super::*;

/// Numbers of zones of seven sources. A zone's x is its source's index, its y its own index in that
/// source.
const ZONE_COUNTS: [usize; 7] = [0, 3, 16, 0, 1, 0, 2];

fn visit(source: usize, visit: &mut dyn FnMut(KeepOutZone)) {
    for i in 0..ZONE_COUNTS[source] {
        let at = Point::new(source as f32, i as f32, 0.0);
        visit(KeepOutZone { from: at, to: at, radius_m: 1.0, kind: ZoneKind::Static });
    }
}

/// The answer if the zone `at` (source, index) alone meets the condition, and the number of steps
/// until that answer.
fn ask(scan: &mut IncrementalScan, zone_cost: u16, at: Option<(f32, f32)>) -> (bool, usize) {
    for steps in 1.. {
        let mut budget = 5;
        let is =
            |k: &KeepOutZone| at.is_some_and(|(source, i)| k.from.x == source && k.from.y == i);
        if let Some(found) =
            scan.continue_scan(ZONE_COUNTS.len(), &mut budget, zone_cost, visit, is)
        {
            return (found, steps);
        }
        assert!(steps < 100);
    }
    unreachable!();
}

#[test]
fn every_zone_is_tested_however_small_the_budget() {
    for zone_cost in [1, 2, 5] {
        for (source, &zones) in ZONE_COUNTS.iter().enumerate() {
            for i in 0..zones {
                let mut scan = IncrementalScan::default();
                let at = Some((source as f32, i as f32));
                assert!(ask(&mut scan, zone_cost, at).0, "{zone_cost} {source} {i}");
                assert!(!ask(&mut scan, zone_cost, None).0);
            }
        }
    }
    assert_eq!(
        IncrementalScan::default().continue_scan(0, &mut 5, 1, visit, |_| true),
        Some(false),
        "nobody is there"
    );
}

#[test]
fn the_zone_that_met_the_condition_is_tested_first() {
    let mut scan = IncrementalScan::default();
    let at = Some((4.0, 0.0));
    assert!(ask(&mut scan, 5, at).1 > 10);
    assert_eq!(ask(&mut scan, 5, at), (true, 1));
    assert_eq!(ask(&mut scan, 5, None), (false, 22), "as many as there are things");
}

#[test]
fn where_sources_come_or_go_all_zones_are_tested_again() {
    let mut scan = IncrementalScan::default();
    assert_eq!(scan.continue_scan(7, &mut 12, 1, visit, |_| false), None);
    assert_eq!(scan.continue_scan(2, &mut 12, 1, visit, |_| false), Some(false));
    assert_eq!(scan.continue_scan(2, &mut 2, 1, visit, |_| false), None);
    // The first zones were checked already.
    let first = |k: &KeepOutZone| k.from.x == 1.0 && k.from.y == 0.0;
    assert_eq!(scan.continue_scan(7, &mut 99, 1, visit, first), Some(true));
}
