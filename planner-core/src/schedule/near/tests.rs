use super::*;
use crate::Point;
use crate::schedule::ScheduleConfig;
use crate::schedule::timed_segments::is_conflict;
use heapless::Vec;
use proptest::prelude::*;

fn segment((x, y, dx, dy): (f32, f32, f32, f32)) -> TimedSegment {
    let (from, to) = (Point::new(x, y, 1.0), Point::new(x + dx, y + dy, 1.0));
    let to_m = (to - from).norm();
    TimedSegment {
        from,
        to,
        wait_at_m: 0.0,
        end_m: to_m,
        held_from_s: 0.0,
        held_until_s: 1.0,
        parked: false,
    }
}

fn place() -> impl Strategy<Value = (f32, f32, f32, f32)> {
    (-40.0f32..40.0, -9.0f32..9.0, -1.5f32..1.5, -1.5f32..1.5)
}

proptest! {
    /// The cells around a timed segment hold every timed segment in conflict with it.
    #[test]
    fn none_in_conflict_is_missed(
        others in proptest::collection::vec(place(), 0..200),
        own in (-60.0f32..60.0, -20.0f32..20.0, -8.0f32..8.0, -8.0f32..8.0),
    ) {
        let cfg = ScheduleConfig {
            separation_m: 2.0,
            parked_separation_m: 1.7,
            cruise_mps: 2.0,
            vertical_mps: 1.0,
        };
        let mut segments: Vec<TimedSegment, 200> = others.into_iter().map(segment).collect();
        let mut cells = SegmentGrid::new();
        cells.sort_into_cells(&mut segments);
        let own = segment(own);
        let all = segments.iter().filter(|q| is_conflict(&cfg, &own, q)).count();
        let found = cells
            .candidates_near(&segments, &own, 2.0)
            .filter(|q| is_conflict(&cfg, &own, q))
            .count();
        prop_assert_eq!(found, all);
    }
}
