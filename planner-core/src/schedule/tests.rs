pub(crate) mod checker;

use super::*;
use crate::Point;
use crate::flight::{Path, Task};
use proptest::prelude::*;

const CFG: ScheduleConfig =
    ScheduleConfig { separation_m: 2.0, parked_separation_m: 1.7, cruise_mps: 2.0, vertical_mps: 1.0 };

fn flight(id: u8, points: &[(f32, f32)]) -> Flight<8> {
    let mut path = Path::new();
    for &(x, y) in points {
        path.push(Point::new(x, y, 1.5), 1.0).unwrap();
    }
    path.label_times(1.5 / CFG.vertical_mps, CFG.cruise_mps);
    Flight {
        id,
        task: Task::Goto(0),
        path,
        climb_m: 1.5,
        descent_m: 1.5,
        depart_s: 0.0,
        segment_m: MAX_TIMED_SEGMENT_M,
    }
}

fn schedule(pair: &mut [Flight<8>; 2]) -> Result<(), ScheduleError> {
    let mut ws = ScheduleWorkspace::new();
    let [first, second] = pair;
    second.depart_s = earliest_departure(&CFG, second, 0.0, [&*first].into_iter(), &mut ws)?;
    Ok(())
}

#[test]
fn far_apart_nobody_waits() {
    let mut pair = [flight(1, &[(0.0, 0.0), (9.0, 0.0)]), flight(2, &[(0.0, 5.0), (9.0, 5.0)])];
    schedule(&mut pair).unwrap();
    assert_eq!(pair[1].depart_s, 0.0);
    let apart = checker::fly(&CFG, &pair, &[2.0, 2.0], 4000).unwrap();
    assert!((apart - 5.0).abs() < 1e-3);
}

#[test]
fn head_on_onto_each_others_pads_is_blocked() {
    let mut pair = [flight(1, &[(0.0, 0.0), (9.0, 0.0)]), flight(2, &[(9.0, 0.0), (0.0, 0.0)])];
    assert_eq!(schedule(&mut pair), Err(ScheduleError::Blocked));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]
    /// Whatever the speeds, gates keep the pieces apart and let both arrive.
    #[test]
    fn any_speeds_keep_apart_and_arrive(
        xs in proptest::collection::vec((0.0f32..12.0, 0.0f32..12.0), 6),
        speeds in (0.2f32..3.0, 0.2f32..3.0),
    ) {
        let mut pair = [flight(1, &xs[..3]), flight(2, &xs[3..])];
        let near = |a: (f32, f32), b: (f32, f32)| libm::hypotf(a.0 - b.0, a.1 - b.1) < CFG.separation_m;
        prop_assume!(!near(xs[0], xs[3]) && !near(xs[2], xs[5]));
        if schedule(&mut pair).is_ok() {
            let apart = checker::fly(&CFG, &pair, &[speeds.0, speeds.1], 8000);
            prop_assert!(apart.as_ref().is_ok_and(|&d| d >= CFG.parked_separation_m - 1e-3), "{apart:?} {pair:?}");
        }
    }
}
