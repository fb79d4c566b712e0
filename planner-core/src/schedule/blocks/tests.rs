extern crate std;

use std::vec::Vec as List;

use super::*;
use crate::flight::{Path, Task};
use crate::schedule::timed_segments::{cut_into_segments, is_conflict};
use proptest::prelude::*;

const CFG: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.7,
    cruise_mps: 2.0,
    vertical_mps: 1.0,
};

/// A place, and steps from there: each a vector, and whether to repeat the last vector instead.
type Steps = ((f32, f32), List<(f32, f32, f32, bool)>);

/// A flight of steps from a place, some of which are holds and some go straight on.
fn flight((from, steps): &Steps) -> List<TimedSegment> {
    let mut at = Point::new(from.0, from.1, 1.0);
    let mut way = Point::zeros();
    let mut along_m = 0.0;
    let segment = |&(x, y, z, on): &(f32, f32, f32, bool)| {
        way = if on { way } else { Point::new(x, y, z) };
        let (from, from_m) = (at, along_m);
        at += way;
        along_m += way.norm();
        TimedSegment {
            from,
            to: at,
            wait_at_m: from_m,
            end_m: along_m,
            held_from_s: 0.0,
            held_until_s: 1.0,
            parked: false,
        }
    };
    steps.iter().map(segment).collect()
}

fn steps() -> impl Strategy<Value = Steps> {
    let step = (-24.0f32..24.0, -24.0f32..24.0, -3.0f32..3.0, any::<bool>());
    ((-3000.0f32..3000.0, -50.0f32..50.0), proptest::collection::vec(step, 1..MAX_TIMED_SEGMENTS))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Blocks leave out no pair in conflict, give each once, and in order.
    #[test]
    fn none_in_conflict_is_missed(
        own in steps(),
        mut other in steps(),
        apart in (-90.0f32..90.0, -90.0f32..90.0),
    ) {
        other.0 = (own.0.0 + apart.0, own.0.1 + apart.1);
        let (own, other) = (flight(&own), flight(&other));
        let mut blocks = OwnBlocks::new();
        blocks.rebuild(&CFG, &own);
        let all =
            |own: &mut dyn Iterator<Item = &TimedSegment>, q: &TimedSegment| -> List<f32> {
                own.filter(|p| is_conflict(&CFG, p, q)).map(|p| p.wait_at_m).collect()
            };
        for some in other.chunks(SEGMENTS_PER_BLOCK) {
            let near = blocks.blocks_near(some);
            for q in some {
                let expected = all(&mut own.iter(), q);
                prop_assert_eq!(
                    all(&mut segments_in_blocks(near, &own).map(|(_, p)| p), q),
                    expected
                );
            }
        }
    }
}

fn whole(points: &[(f32, f32, f32)], descent_m: f32) -> Flight<8> {
    let mut path = Path::new();
    points.iter().for_each(|(x, y, z)| path.push(Point::new(*x, *y, *z), 1.0).unwrap());
    path.set_times_at_speed(1.5, CFG.cruise_mps);
    let mut flight = Flight {
        vehicle_id: 1,
        task: Task::Goto(0),
        path,
        climb_m: 1.5,
        descent_m,
        depart_s: 0.0,
        max_segment_m: crate::schedule::DEFAULT_MAX_SEGMENT_M,
    };
    flight.choose_segment_length();
    flight
}

fn points() -> impl Strategy<Value = List<(f32, f32, f32)>> {
    proptest::collection::vec((-90.0f32..90.0, -90.0f32..90.0, 2.0f32..60.0), 1..8)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    /// A flight that is left out as too far away has no segment in conflict.
    #[test]
    fn a_vehicle_that_is_far_is_in_no_conflict(
        own in points(),
        mut other in points(),
        apart in (-150.0f32..150.0, -150.0f32..150.0),
        descent_m in 0.0f32..60.0,
    ) {
        other
            .iter_mut()
            .for_each(|point| (point.0, point.1) = (point.0 + apart.0, point.1 + apart.1));
        let (own, other) = (whole(&own, 1.5), whole(&other, descent_m));
        let (mut own_segments, mut other_segments) = (Vec::new(), Vec::new());
        cut_into_segments(&CFG, &own, &mut own_segments).unwrap();
        cut_into_segments(&CFG, &other, &mut other_segments).unwrap();
        let mut blocks = OwnBlocks::new();
        blocks.rebuild(&CFG, &own_segments);
        let far = blocks.parts_near(&CFG, &other).next().is_none();
        let meet =
            other_segments.iter().any(|q| own_segments.iter().any(|p| is_conflict(&CFG, p, q)));
        prop_assert!(!(far && meet));
    }
}
