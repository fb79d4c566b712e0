extern crate std;
use std::vec::Vec;

use super::*;
use crate::link::commands::EXCLUDE;
use crate::link::intent::{BLOCKED, DETOURS, FLYING, GROUNDED, ON_PLAN, OUT, WAITING};
use crate::testing::fake_autopilot::*;
use mavlink::dialects::ardupilotmega::MavCmd;
use planner_core::flight::Gate;

fn sphere(at: Point, radius_m: f32) -> Command {
    let place = frames::enu_to_geodetic(&ORIGIN, &at);
    Command {
        command: EXCLUDE,
        param1: radius_m,
        param2: 0.0,
        place: Some((
            (place.lat_deg * 1e7).round() as i32,
            (place.lon_deg * 1e7).round() as i32,
            place.alt_m as f32,
        )),
        from: (255, 190),
        to_us: true,
        to_component: true,
    }
}

#[test]
fn a_sphere_told_by_command_is_an_obstacle_with_the_clearance_around_it() {
    let mut bench = Bench::new(config());
    let at = Point::new(14.0, 12.0, 1.5);
    assert_eq!(bench.companion.exclude(&sphere(at, 0.5)), ACCEPTED);
    assert_eq!(bench.companion.exclude(&sphere(at, 0.5)), ACCEPTED, "told twice");
    let known = bench.companion.obstacles.known.clone();
    assert_eq!(known.len(), 1);
    assert!((known[0].from - at).norm() < 0.05 && known[0].to == known[0].from, "{known:?}");
    assert!((known[0].radius_m - 1.3).abs() < 1e-6, "radius and required clearance: {known:?}");
}

#[test]
fn what_is_no_sphere_is_refused_and_one_too_many_is_for_later() {
    let mut bench = Bench::new(config());
    let at = |x: f32| Point::new(x, 30.0, 1.5);
    for radius_m in [f32::NAN, f32::INFINITY, 20.1, 1000.0] {
        assert_eq!(bench.companion.exclude(&sphere(at(0.0), radius_m)), DENIED, "{radius_m}");
    }
    let nowhere = Command { place: None, ..sphere(at(0.0), 1.0) };
    assert_eq!(bench.companion.exclude(&nowhere), DENIED, "COMMAND_LONG has no place");
    let no_earth = Command { place: Some((i32::MAX, 0, 700.0)), ..nowhere };
    assert_eq!(bench.companion.exclude(&no_earth), DENIED);
    for i in 0..OBSTACLES {
        assert_eq!(bench.companion.exclude(&sphere(at(i as f32), 0.5)), ACCEPTED);
    }
    assert_eq!(bench.companion.exclude(&sphere(at(99.0), 0.5)), TEMPORARILY_REJECTED);
}

#[test]
fn a_revoked_obstacle_does_not_block_any_more() {
    let mut bench = Bench::accompanied(two_vehicles());
    bench.until(State::Follow, 20.0);
    let at = Point::new(14.0, 12.0, 1.5);
    assert_eq!(bench.companion.exclude(&sphere(Point::new(90.0, 90.0, 1.5), 0.5)), ACCEPTED);
    assert_eq!(bench.companion.exclude(&sphere(at, 0.5)), ACCEPTED);
    bench.until(State::Blocked, 5.0);
    assert_eq!(bench.companion.exclude(&sphere(at, -1.0)), ACCEPTED);
    assert_eq!(bench.companion.obstacles.count(), 1);
    bench.until(State::Follow, 3.0);
    assert_eq!(bench.companion.exclude(&sphere(at, 0.0)), ACCEPTED, "nothing is there: so it is revoked");
}

proptest::proptest! {
    /// Whatever is reported and revoked, those that a detour was planned for stay the first ones.
    #[test]
    fn obstacles_are_those_reported_and_not_revoked(
        orders in proptest::collection::vec((0u8..24, -1.0f32..25.0, proptest::prelude::any::<bool>()), 0..200),
    ) {
        let mut bench = Bench::new(config());
        let mut model: std::vec::Vec<(u8, bool)> = std::vec::Vec::new();
        for (x, radius_m, plans) in orders {
            let result = bench.companion.exclude(&sphere(Point::new(f32::from(x), 30.0, 1.5), radius_m));
            let known = model.iter().any(|(at, _)| *at == x);
            // A larger one at the same place is another; keep the model to one a place.
            if radius_m <= 0.0 {
                model.retain(|(at, _)| *at != x);
                proptest::prop_assert_eq!(result, ACCEPTED);
            } else if radius_m > OBSTACLE_MAX_M {
                proptest::prop_assert_eq!(result, DENIED);
            } else if result == ACCEPTED && !known {
                model.push((x, false));
            } else {
                let full = bench.companion.obstacles.count() == OBSTACLES;
                proptest::prop_assert!(known || (result == TEMPORARILY_REJECTED && full));
            }
            if plans {
                bench.companion.obstacles.avoided = bench.companion.obstacles.count();
                model.iter_mut().for_each(|(_, avoided)| *avoided = true);
            }
            let obstacles = &bench.companion.obstacles;
            proptest::prop_assert!(obstacles.avoided <= obstacles.count() && obstacles.count() <= OBSTACLES);
            let places: std::collections::BTreeSet<i32> =
                obstacles.known.iter().map(|o| libm::roundf(o.from.x) as i32).collect();
            let wanted: std::collections::BTreeSet<i32> = model.iter().map(|(x, _)| i32::from(*x)).collect();
            proptest::prop_assert_eq!(places, wanted);
            for (x, avoided) in &model {
                let new = obstacles.known[obstacles.avoided..].iter().any(|o| libm::roundf(o.from.x) as i32 == i32::from(*x));
                proptest::prop_assert!(*avoided || new, "{}", x);
            }
        }
    }
}

#[test]
fn a_sphere_on_the_path_is_flown_around_and_one_beside_it_is_none() {
    for (y, blocks) in [(16.0, false), (12.0, true)] {
        let mut bench = Bench::following(config());
        bench.companion.exclude(&sphere(Point::new(14.0, y, 1.5), 0.5));
        bench.run(1.0);
        assert_eq!(bench.state() == State::Blocked, blocks, "{y}");
        bench.until(State::Done, 60.0);
        assert_eq!(bench.texts.iter().any(|text| text == "Flying around"), blocks);
    }
}

#[test]
fn a_turn_is_claimed_before_it_is_taken_and_only_by_one() {
    let mut bench = Bench::accompanied(two_vehicles());
    bench.until(State::Follow, 20.0);
    bench.companion.exclude(&sphere(Point::new(14.0, 12.0, 1.5), 0.5));
    let other = |flags: u8| Some((Point::new(8.0, 40.0, 9.0), FLYING | ON_PLAN | flags, 0.0, 5));
    bench.neighbour = other(BLOCKED | WAITING);
    bench.until(State::Blocked, 3.0);
    while bench.companion.around.claimed_since.is_none() {
        bench.run(0.05);
    }
    // It claims; the other began to claim at the same time.
    bench.neighbour = other(BLOCKED);
    bench.run(4.0);
    assert_eq!(bench.state(), State::Blocked, "two would begin at once");
    assert!(!bench.companion.waits(), "the lower system id goes on claiming");
    bench.neighbour = other(BLOCKED | WAITING);
    bench.until(State::Follow, 1.0);
}

#[test]
fn who_hears_a_lower_system_id_claim_waits_again() {
    let mut config = two_vehicles();
    config.roster[1].system_id = 7;
    config.roster.sort_unstable_by_key(|entry| entry.system_id);
    let mut bench = Bench::accompanied(config);
    bench.until(State::Follow, 20.0);
    bench.companion.exclude(&sphere(Point::new(14.0, 12.0, 1.5), 0.5));
    let other = |flags: u8| Some((Point::new(8.0, 40.0, 9.0), FLYING | ON_PLAN | flags, 0.0, 5));
    bench.neighbour = other(BLOCKED);
    bench.until(State::Blocked, 3.0);
    bench.run(8.0);
    assert!(bench.companion.waits() && bench.state() == State::Blocked);
    // It flies: what was quiet is not any more.
    bench.neighbour = other(DETOURS);
    bench.run(1.0);
    bench.neighbour = other(BLOCKED | WAITING);
    bench.run(4.0);
    assert!(bench.companion.waits() && bench.state() == State::Blocked, "it waits anew");
    bench.until(State::Follow, 5.0);
}

/// What is kept off vehicle 77 half a minute on.
fn kept_off(flags: u8, moves: bool) -> Vec<KeepOff> {
    let mut bench = Bench::accompanied(two_vehicles());
    let at = Point::new(8.0, 40.0, 9.0);
    bench.neighbour = Some((at, flags, 0.0, 5));
    bench.run(1.0);
    if !moves {
        bench.neighbour_clock = Some(bench.now);
    }
    bench.run(30.0);
    let mut told = Vec::new();
    bench.companion.neighbours.places(bench.now, 1.5, |place| told.push(place));
    told
}

#[test]
fn who_lies_where_it_does_not_know_is_kept_off_by_the_foot_of_its_column() {
    let known = kept_off(GROUNDED | OUT, true);
    assert!(matches!(known[..], [KeepOff { nature: Nature::Solid, .. }]) && known[0].from == known[0].to);
    let vague = kept_off(GROUNDED | OUT, false);
    assert!(matches!(vague[..], [KeepOff { nature: Nature::Lying, .. }]) && vague[0].to.z < -40.0);
}

#[test]
fn the_column_of_one_that_lands_is_deeper_the_older_its_place_is() {
    let depth_m = |moves: bool| {
        let mut bench = Bench::accompanied(two_vehicles());
        bench.neighbour = Some((Point::new(8.0, 40.0, 9.0), FLYING, 0.0, 5));
        bench.run(1.0);
        if !moves {
            bench.neighbour_clock = Some(bench.now);
        }
        bench.run(10.0);
        let mut depth_m = 0.0;
        bench.companion.neighbours.landing_columns(bench.now, 2.0, |column| depth_m = 9.0 - column.to.z);
        depth_m
    };
    assert!((depth_m(true) - 15.0).abs() < 1.0, "{}", depth_m(true));
    assert!((depth_m(false) - 35.0).abs() < 2.0, "{}", depth_m(false));
}

#[test]
fn nobody_takes_off_before_it_was_looked_at_who_is_in_the_way() {
    for tenth in 0..8 {
        let mut bench = Bench::new(two_vehicles());
        bench.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT, 0.0, 5));
        // So many things beside the path that the one in the way is looked at in a later step.
        for i in 0..OBSTACLES {
            bench.companion.exclude(&sphere(Point::new(40.0 + i as f32, 60.0, 1.5), 0.5));
        }
        bench.until(State::Ready, 8.0);
        bench.run(0.1 * tenth as f32);
        bench.start();
        bench.run(0.25);
        assert_eq!(bench.state(), State::Scheduled, "{tenth}");
        bench.run(0.8);
        assert_eq!(bench.state(), State::Scheduled, "{tenth}");
        assert!(bench.companion.around.blocked, "{tenth}");
    }
}

#[test]
fn what_was_found_for_one_plan_opens_no_gate_of_the_next() {
    for tenth in 0..8 {
        let mut bench = Bench::new(two_vehicles());
        let mut plan = plan();
        plan.gates.push(Gate { at_m: -1.5, id: 77, until_m: 5.0 }).unwrap();
        bench.answer_plan = Some(Ok(plan.clone()));
        bench.neighbour = Some((Point::new(30.0, 40.0, 0.0), GROUNDED | OUT, 0.0, 5));
        bench.until(State::Ready, 8.0);
        bench.start();
        bench.until(State::Streaming, 5.0);
        bench.command(MavCmd::MAV_CMD_NAV_LAND, 0.0, SYSTEM, crate::COMPONENT);
        bench.run(0.3);
        bench.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT, 0.0, 5));
        bench.answer_plan = Some(Ok(plan));
        bench.run(1.0);
        bench.start();
        bench.until(State::Ready, 8.0);
        bench.run(0.3 + 0.1 * tenth as f32);
        bench.start();
        bench.run(0.7);
        assert_eq!(bench.state(), State::Scheduled, "{tenth}");
    }
}

#[test]
fn who_was_flown_around_by_one_plan_is_looked_at_for_the_next() {
    let mut bench = Bench::new(two_vehicles());
    bench.no_position = true;
    bench.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT, 0.0, 5));
    bench.run(3.0);
    bench.companion.neighbours.avoid(bench.now);
    bench.no_position = false;
    bench.until(State::Ready, 20.0);
    bench.start();
    bench.run(0.7);
    assert!(bench.companion.around.in_the_way, "{:?}", bench.state());
}

#[test]
fn a_look_among_many_takes_several_steps_and_finds_what_is_last() {
    let mut bench = Bench::following(config());
    // The first ones are far beside the path; each costs a share of a step.
    for i in 0..OBSTACLES - 1 {
        bench.companion.exclude(&sphere(Point::new(40.0 + i as f32, 60.0, 1.5), 0.5));
    }
    bench.run(1.0);
    let mut steps = 0;
    while bench.companion.around.look_began.is_none() {
        bench.run(0.05);
    }
    while bench.companion.around.look_began.is_some() {
        bench.run(0.05);
        steps += 1;
    }
    assert!((1..4).contains(&steps), "{steps}");
    assert_eq!(bench.state(), State::Follow);
    bench.companion.exclude(&sphere(Point::new(15.9, 12.0, 1.5), 0.5));
    bench.run(1.0);
    assert_eq!(bench.state(), State::Blocked);
}
