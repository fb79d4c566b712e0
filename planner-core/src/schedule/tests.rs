extern crate std;

pub(crate) mod checker;

use super::*;
use crate::Point;
use crate::flight::{Path, Task};
use proptest::prelude::*;

const CFG: ScheduleConfig = ScheduleConfig {
    separation_m: 2.0,
    parked_separation_m: 1.7,
    cruise_mps: 2.0,
    vertical_mps: 1.0,
};

fn flight(id: u8, points: &[(f32, f32)]) -> Flight<8> {
    let mut path = Path::new();
    for &(x, y) in points {
        path.push(Point::new(x, y, 1.5), 1.0).unwrap();
    }
    path.set_times_at_speed(1.5 / CFG.vertical_mps, CFG.cruise_mps);
    Flight {
        vehicle_id: id,
        task: Task::Goto(0),
        path,
        climb_m: 1.5,
        descent_m: 1.5,
        depart_s: 0.0,
        max_segment_m: DEFAULT_MAX_SEGMENT_M,
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
    /// Whatever the speeds, gates keep the timed segments apart and let both vehicles arrive.
    #[test]
    fn any_speeds_keep_apart_and_arrive(
        xs in proptest::collection::vec((0.0f32..12.0, 0.0f32..12.0), 6),
        speeds in (0.2f32..3.0, 0.2f32..3.0),
    ) {
        let mut pair = [flight(1, &xs[..3]), flight(2, &xs[3..])];
        let near =
            |a: (f32, f32), b: (f32, f32)| libm::hypotf(a.0 - b.0, a.1 - b.1) < CFG.separation_m;
        prop_assume!(!near(xs[0], xs[3]) && !near(xs[2], xs[5]));
        if schedule(&mut pair).is_ok() {
            let apart = checker::fly(&CFG, &pair, &[speeds.0, speeds.1], 8000);
            prop_assert!(
                apart.as_ref().is_ok_and(|&d| d >= CFG.parked_separation_m - 1e-3),
                "{apart:?} {pair:?}"
            );
        }
    }
}

/// A flight over a field.
fn field_flight(id: u8, corners: &[Point], climb_m: f32) -> Flight<8> {
    let mut path = Path::new();
    for corner in corners {
        path.push(*corner, 1.0).unwrap();
    }
    path.set_times_at_speed(climb_m / CFG.vertical_mps, CFG.cruise_mps);
    let mut flight = Flight { climb_m, descent_m: climb_m, path, ..flight(id, &[(0.0, 0.0)]) };
    flight.choose_segment_length();
    flight
}

/// The corners of a path over a field: all at one height, or corners at that height and others
/// between; and the height of the climb, metres.
fn field_paths() -> impl Strategy<Value = (std::vec::Vec<Point>, f32)> {
    let corners =
        proptest::collection::vec((-120.0f32..120.0, -120.0f32..120.0, 25.0f32..60.0), 1..8);
    (corners, any::<bool>(), 0.0f32..40.0).prop_map(|(corners, level, climb_m)| {
        let height_m = |z: f32| if level || z < 50.0 { 30.0 } else { z };
        let corners = corners.into_iter().map(|(x, y, z)| Point::new(x, y, height_m(z)));
        (corners.collect(), climb_m)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    /// A departure is that of a comparison of all segments with all, to the bit, and neither flight
    /// has more gates for the other than segments in conflict.
    #[test]
    fn departures_are_those_of_all_segments(
        own in field_paths(),
        other in field_paths(),
        (handover_s, depart_s) in (0.0f32..3.0, 0.0f32..60.0),
    ) {
        let own = field_flight(1, &own.0, own.1);
        let other = Flight { depart_s, ..field_flight(2, &other.0, other.1) };
        let mut ws = ScheduleWorkspace::new();
        let mut most = [0; 2];
        let departure = departure_with_conflict_counts(
            &CFG,
            &own,
            (0.0, handover_s),
            &mut [&other].into_iter(),
            &mut ws,
            &mut |_, met| most = met,
        );
        cut_into_segments(&CFG, &own, &mut ws.own).unwrap();
        cut_into_segments(&CFG, &other, &mut ws.other).unwrap();
        ws.forbidden.clear();
        for (q, p) in ws.other.iter().flat_map(|q| ws.own.iter().map(move |p| (q, p))) {
            if is_conflict(&CFG, p, q) {
                let from_s = depart_s + q.held_from_s - handover_s - p.held_until_s;
                add_forbidden_interval(
                    &mut ws.forbidden,
                    from_s,
                    depart_s + q.held_until_s + handover_s - p.held_from_s,
                );
            }
        }
        let allowed = first_allowed_departure(&ws.forbidden, 0.0);
        prop_assert_eq!(departure, allowed.ok_or(ScheduleError::Blocked));
        if let Ok(depart_s) = departure {
            let pair = [Flight { depart_s, ..own }, other];
            for index in 0..2 {
                let mut found: Vec<Gate, 400> = Vec::new();
                gates(&CFG, &pair, index, &mut ws, &mut found).unwrap();
                prop_assert!(found.len() as u32 <= most[index], "{found:?} {most:?}");
            }
        }
    }
}
