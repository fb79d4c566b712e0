use super::*;
use planner_core::map::voxel::{GridShape, Outside};

/// Runs a test with a referee in a 10 m cube of 1 m cells, with a floor at z < 1 and a wall at
/// x > 8.
fn with_referee(test: impl FnOnce(Referee<'_>)) {
    let shape = GridShape { dims: [10; 3], min: Point::zeros(), resolution_m: 1.0 };
    let mut words = vec![0; shape.word_count()];
    for i in 0..10 {
        for j in 0..10 {
            for k in 0..10 {
                if k == 0 || i >= 8 {
                    let (word, mask) = shape.word_and_mask([i, j, k]);
                    words[word] |= mask;
                }
            }
        }
    }
    let grid = VoxelGrid::new(shape, Outside::Free, &words).unwrap();
    let field = ClearanceField::new(&grid);
    test(Referee::new(grid, &field, 1.5, &[(7, 0.5), (9, 0.5)]));
}

fn at(x: f32, y: f32, z: f32, phase: RefereePhase) -> Observation {
    Observation {
        position: Point::new(x, y, z),
        phase,
        holds_by_command: false,
        flown_by_pilot: false,
        progress_m: Some(x),
    }
}

#[test]
fn a_body_in_the_wall_is_one_contact_however_long() {
    with_referee(|mut referee| {
        let far = at(2.0, 8.0, 5.0, RefereePhase::Flying);
        for (step, x) in [7.0, 7.6, 7.7, 7.0, 7.6].into_iter().enumerate() {
            referee.observe(step as f64 * 0.004, &[at(x, 2.0, 5.0, RefereePhase::Flying), far]);
        }
        assert_eq!(referee.wall_contacts, 2);
        assert!((referee.min_clearance_m - 0.3).abs() < 1e-5, "{}", referee.min_clearance_m);
    });
}

#[test]
fn the_floor_is_none_while_landing_but_a_wall_is() {
    with_referee(|mut referee| {
        let far = at(2.0, 8.0, 5.0, RefereePhase::Flying);
        referee.observe(0.0, &[at(4.0, 2.0, 1.4, RefereePhase::TakeOffOrLanding), far]);
        assert_eq!(referee.wall_contacts, 0);
        referee.observe(0.1, &[at(4.0, 2.0, 1.4, RefereePhase::Flying), far]);
        assert_eq!(referee.wall_contacts, 1);
        referee.observe(0.2, &[at(4.0, 2.0, 5.0, RefereePhase::Flying), far]);
        referee.observe(0.3, &[at(7.7, 2.0, 1.6, RefereePhase::TakeOffOrLanding), far]);
        assert_eq!(referee.wall_contacts, 2);
    });
}

/// What a vehicle touches under its pilot is a contact as any other, and is counted apart too.
#[test]
fn contacts_under_its_pilot_are_counted_apart_too() {
    with_referee(|mut referee| {
        let rests = at(5.0, 5.0, 5.0, RefereePhase::Grounded);
        for (step, flown_by_pilot) in [false, true, true, false].into_iter().enumerate() {
            for (tenth, x) in [(0, 7.0), (1, 7.6)] {
                let flies = Observation { flown_by_pilot, ..at(x, 2.0, 5.0, RefereePhase::Flying) };
                referee.observe((10 * step + tenth) as f64 * 0.1, &[flies, rests]);
            }
        }
        assert_eq!((referee.wall_contacts, referee.wall_contacts_under_pilot()), (4, 2));
        let texts: Vec<_> = referee.incidents.iter().map(|i| i.text.contains("pilot")).collect();
        assert_eq!(texts, [false, true, true, false]);
    });
}

#[test]
fn a_near_pair_is_one_violation_unless_both_stand() {
    with_referee(|mut referee| {
        let pair = |apart: f32, phase| {
            [at(2.0, 2.0, 5.0, phase), at(2.0, 2.0 + apart, 5.0, RefereePhase::Grounded)]
        };
        referee.observe(0.0, &pair(1.0, RefereePhase::Grounded));
        assert_eq!(referee.violations, 0);
        referee.observe(0.1, &pair(1.4, RefereePhase::Flying));
        referee.observe(0.2, &pair(1.3, RefereePhase::Flying));
        assert_eq!(referee.violations, 1);
        // The text names the other vehicle of the pair by its id.
        assert_eq!(
            (referee.incidents[0].vehicle, &*referee.incidents[0].text),
            (1, "nearer than the safety distance to vehicle 7")
        );
        assert!((referee.min_separation_m - 1.3).abs() < 1e-6);
    });
}

#[test]
fn a_wreck_may_be_passed_near_but_not_touched() {
    with_referee(|mut referee| {
        let wreck = at(2.0, 2.0, 1.5, RefereePhase::Wreck);
        for (step, z) in [3.0, 2.6, 2.4, 2.3, 2.6].into_iter().enumerate() {
            referee.observe(step as f64 * 0.004, &[at(2.0, 2.0, z, RefereePhase::Flying), wreck]);
        }
        assert_eq!((referee.wall_contacts, referee.violations), (1, 0));
    });
}

#[test]
fn hovering_on_for_twenty_seconds_is_a_deadlock() {
    with_referee(|mut referee| {
        let seen =
            [at(2.0, 2.0, 5.0, RefereePhase::Flying), at(5.0, 5.0, 5.0, RefereePhase::Grounded)];
        for step in 0..300 {
            referee.observe(f64::from(step) * 0.1, &seen);
        }
        assert_eq!(referee.deadlocks, 1);
    });
}

#[test]
fn a_vehicle_that_reports_no_progress_makes_some_by_flying_on() {
    with_referee(|mut referee| {
        let silent = |x| Observation { progress_m: None, ..at(x, 2.0, 5.0, RefereePhase::Flying) };
        let rests = at(5.0, 5.0, 5.0, RefereePhase::Grounded);
        for step in 0..300 {
            referee.observe(f64::from(step) * 0.1, &[silent(2.0 + step as f32 * 0.02), rests]);
        }
        assert_eq!(referee.deadlocks, 0);
        for step in 300..600 {
            let sways = if step % 20 < 10 { 0.2 } else { -0.2 };
            referee.observe(f64::from(step) * 0.1, &[silent(5.0 + sways), rests]);
        }
        assert_eq!(referee.deadlocks, 1);
    });
}

#[test]
fn where_faults_strike_a_standstill_that_ends_is_a_wait() {
    with_referee(|mut referee| {
        referee.retracts_ended_deadlocks = true;
        let on_path =
            |x| [at(x, 2.0, 5.0, RefereePhase::Flying), at(5.0, 5.0, 5.0, RefereePhase::Grounded)];
        for step in 0..300 {
            referee.observe(f64::from(step) * 0.1, &on_path(2.0));
        }
        assert_eq!(referee.deadlocks, 1);
        referee.observe(30.0, &on_path(2.5));
        assert_eq!(referee.deadlocks, 0);
        assert_eq!(
            (&*referee.incidents[0].text, referee.incidents[0].retracted),
            ("stood for 30 s", true)
        );
        for step in 301..600 {
            referee.observe(f64::from(step) * 0.1, &on_path(2.5));
        }
        assert_eq!(referee.deadlocks, 1);
        let lands = [
            at(2.5, 2.0, 5.0, RefereePhase::TakeOffOrLanding),
            at(5.0, 5.0, 5.0, RefereePhase::Grounded),
        ];
        referee.observe(60.0, &lands);
        assert_eq!(referee.deadlocks, 0);
        for step in 601..900 {
            referee.observe(f64::from(step) * 0.1, &on_path(3.5));
        }
        assert_eq!(referee.deadlocks, 1);
        let falls =
            [at(3.5, 2.0, 5.0, RefereePhase::Falling), at(5.0, 5.0, 5.0, RefereePhase::Grounded)];
        referee.observe(90.0, &falls);
        assert_eq!(referee.deadlocks, 0);
    });
}

#[test]
fn out_of_radio_range_only_a_short_wait_that_flying_on_ends_is_no_deadlock() {
    let phases = [RefereePhase::Flying, RefereePhase::TakeOffOrLanding];
    for (stands_s, phase, deadlocks) in [(40, phases[0], 0), (80, phases[0], 1), (40, phases[1], 1)]
    {
        with_referee(|mut referee| {
            referee.retracts_out_of_range_waits = true;
            let rests = at(5.0, 5.0, 5.0, RefereePhase::Grounded);
            for step in 0..10 * stands_s {
                let hovers = at(2.0, 2.0, 5.0, RefereePhase::Flying);
                referee.observe(f64::from(step) * 0.1, &[hovers, rests]);
            }
            assert_eq!(referee.deadlocks, 1);
            let x = if phase == RefereePhase::Flying { 2.5 } else { 2.0 };
            referee.observe(f64::from(stands_s), &[at(x, 2.0, 5.0, phase), rests]);
            assert_eq!(referee.deadlocks, deadlocks, "{stands_s} s, {phase:?}");
        });
    }
}

/// A standstill of `stands_s` in flight, `held_s` by command and `stands_on_s` more, which then
/// ends: flying on, or in `last` if that is another phase. Returns the deadlocks counted before and
/// after that, and the last incident's text.
fn deadlocks_with_pause(
    referee: &mut Referee<'_>,
    [stands_s, held_s, stands_on_s]: [i32; 3],
    last: RefereePhase,
) -> (u32, u32, String) {
    let rests = at(5.0, 5.0, 5.0, RefereePhase::Grounded);
    let hovers = at(2.0, 2.0, 5.0, RefereePhase::Flying);
    let steps = 10 * (stands_s + held_s + stands_on_s);
    for step in 0..steps {
        let holds_by_command = (10 * stands_s..10 * (stands_s + held_s)).contains(&step);
        let seen = Observation { holds_by_command, ..hovers };
        referee.observe(f64::from(step) * 0.1, &[seen, rests]);
    }
    let before = referee.deadlocks;
    let x = if last == RefereePhase::Flying { 2.5 } else { 2.0 };
    referee.observe(f64::from(steps) * 0.1, &[at(x, 2.0, 5.0, last), rests]);
    let text = referee.incidents.last().map_or(String::new(), |seen| seen.text.clone());
    (before, referee.deadlocks, text)
}

/// A command to stand neither ends a deadlock nor is one: what counts is whether the vehicle flies
/// on afterwards, and how long it stood without that command.
#[test]
fn a_wait_that_ends_after_a_pause_is_no_deadlock() {
    let [flies, lands] = [RefereePhase::Flying, RefereePhase::TakeOffOrLanding];
    for (seconds, last, [before, after], text) in [
        ([25, 5, 0], flies, [1, 0], "stood for 25 s"),
        ([25, 50, 10], flies, [1, 0], "stood for 35 s"),
        ([25, 50, 30], flies, [1, 0], "stood for 55 s"),
        ([25, 50, 10], lands, [1, 0], "stood for 35 s"),
        ([15, 100, 15], flies, [0, 0], ""),
        ([15, 100, 25], flies, [1, 0], "stood for 25 s"),
    ] {
        with_referee(|mut referee| {
            referee.retracts_ended_deadlocks = true;
            let found = deadlocks_with_pause(&mut referee, seconds, last);
            assert_eq!(found, (before, after, text.to_owned()), "{seconds:?}, {last:?}");
        });
    }
    for (seconds, after) in [([25, 100, 10], 0), ([25, 100, 40], 1), ([61, 10, 0], 1)] {
        with_referee(|mut referee| {
            referee.retracts_out_of_range_waits = true;
            let found = deadlocks_with_pause(&mut referee, seconds, flies);
            assert_eq!((found.0, found.1), (1, after), "{seconds:?}");
        });
    }
}

/// What a pilot does with a vehicle in a deadlock does not show that it would have flown on.
#[test]
fn a_vehicle_that_its_pilot_moves_is_still_in_its_deadlock() {
    with_referee(|mut referee| {
        referee.retracts_ended_deadlocks = true;
        let rests = at(5.0, 5.0, 5.0, RefereePhase::Grounded);
        for step in 0..900 {
            let under_pilot = (300..600).contains(&step);
            let x = 2.0 + 0.01 * (step.clamp(300, 600) - 300) as f32;
            let seen = Observation {
                progress_m: None,
                holds_by_command: under_pilot,
                flown_by_pilot: under_pilot,
                ..at(x, 2.0, 5.0, RefereePhase::Flying)
            };
            referee.observe(f64::from(step) * 0.1, &[seen, rests]);
        }
        assert_eq!((referee.deadlocks, referee.incidents.len()), (1, 1));
        let flies_on = Observation { progress_m: None, ..at(6.5, 2.0, 5.0, RefereePhase::Flying) };
        referee.observe(90.0, &[flies_on, rests]);
        assert_eq!(referee.deadlocks, 0);
    });
}
