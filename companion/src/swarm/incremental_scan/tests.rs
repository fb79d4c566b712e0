use planner_core::Point;
use planner_core::detour::ZoneKind;

use super::*;

/// Numbers of zones of seven sources. The x coordinate of a zone is its source's index, y its
/// own.
const THINGS: [usize; 7] = [0, 3, 16, 0, 1, 0, 2];

fn visit(source: usize, visit: &mut dyn FnMut(KeepOutZone)) {
    for i in 0..THINGS[source] {
        let at = Point::new(source as f32, i as f32, 0.0);
        visit(KeepOutZone { from: at, to: at, radius_m: 1.0, kind: ZoneKind::Static });
    }
}

/// The answer where the zone `at` is on the path, and the number of steps that it took.
fn ask(sweep: &mut IncrementalScan, each: u16, at: Option<(f32, f32)>) -> (bool, usize) {
    for steps in 1.. {
        let mut budget = 5;
        let is =
            |k: &KeepOutZone| at.is_some_and(|(source, i)| k.from.x == source && k.from.y == i);
        if let Some(found) = sweep.continue_scan(THINGS.len(), &mut budget, each, visit, is) {
            return (found, steps);
        }
        assert!(steps < 100);
    }
    unreachable!();
}

#[test]
fn everything_is_asked_about_however_small_the_budget() {
    for each in [1, 2, 5] {
        for (source, &things) in THINGS.iter().enumerate() {
            for i in 0..things {
                let mut sweep = IncrementalScan::default();
                let at = Some((source as f32, i as f32));
                assert!(ask(&mut sweep, each, at).0, "{each} {source} {i}");
                assert!(!ask(&mut sweep, each, None).0);
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
fn what_was_in_the_way_is_asked_about_first() {
    let mut sweep = IncrementalScan::default();
    let at = Some((4.0, 0.0));
    assert!(ask(&mut sweep, 5, at).1 > 10);
    assert_eq!(ask(&mut sweep, 5, at), (true, 1));
    assert_eq!(ask(&mut sweep, 5, None), (false, 22), "as many as there are things");
}

#[test]
fn where_sources_come_or_go_all_are_asked_again() {
    let mut sweep = IncrementalScan::default();
    assert_eq!(sweep.continue_scan(7, &mut 12, 1, visit, |_| false), None);
    assert_eq!(sweep.continue_scan(2, &mut 12, 1, visit, |_| false), Some(false));
    assert_eq!(sweep.continue_scan(2, &mut 2, 1, visit, |_| false), None);
    // The first zones were checked already.
    let first = |k: &KeepOutZone| k.from.x == 1.0 && k.from.y == 0.0;
    assert_eq!(sweep.continue_scan(7, &mut 99, 1, visit, first), Some(true));
}
