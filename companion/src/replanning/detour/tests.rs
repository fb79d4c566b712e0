extern crate std;
use std::vec::Vec;

use super::searches::RetryOutlook;
use super::*;
use crate::PlanFailure;
use crate::link::intent::{BLOCKED, FLYING, GROUNDED, ON_DETOUR, ON_PLAN, OUT_OF_PLAN, WAITING};
use crate::replanning::obstacles::MAX_OBSTACLES;
use crate::replanning::obstacles::tests::sphere;
use crate::testing::fake_autopilot::*;
use mavlink::dialects::ardupilotmega::MavCmd;
use planner_core::detour::{KeepOutZone, ZoneKind};
use planner_core::flight::Gate;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn exclude(bench: &mut Bench, command: &Command) -> u8 {
    bench.companion.detours.handle_obstacle_command(
        command,
        &ORIGIN,
        bench.companion.config.required_clearance_m,
    )
}

#[test]
fn a_revoked_obstacle_does_not_block_any_more() {
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    bench.run_until(State::Follow, 20.0);
    let at = Point::new(14.0, 12.0, 1.5);
    assert_eq!(exclude(&mut bench, &sphere(Point::new(90.0, 90.0, 1.5), 0.5)), ACCEPTED);
    assert_eq!(exclude(&mut bench, &sphere(at, 0.5)), ACCEPTED);
    bench.run_until(State::Blocked, 5.0);
    assert_eq!(exclude(&mut bench, &sphere(at, -1.0)), ACCEPTED);
    assert_eq!(bench.companion.detours.obstacle_count(), 1);
    bench.run_until(State::Follow, 3.0);
    assert_eq!(
        exclude(&mut bench, &sphere(at, 0.0)),
        ACCEPTED,
        "nothing is there: so it is revoked"
    );
}

#[test]
fn a_sphere_on_the_path_is_flown_around_and_one_beside_it_is_none() {
    for (y, blocks) in [(16.0, false), (12.0, true)] {
        let mut bench = Bench::following(config());
        exclude(&mut bench, &sphere(Point::new(14.0, y, 1.5), 0.5));
        bench.run(1.0);
        assert_eq!(bench.state() == State::Blocked, blocks, "{y}");
        bench.run_until(State::Done, 60.0);
        assert_eq!(bench.texts.iter().any(|text| text == "Flying around"), blocks);
    }
}

#[test]
fn a_turn_is_claimed_before_it_is_taken_and_only_by_one() {
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    bench.run_until(State::Follow, 20.0);
    exclude(&mut bench, &sphere(Point::new(14.0, 12.0, 1.5), 0.5));
    let other = |flags: u8| Some((Point::new(8.0, 40.0, 9.0), FLYING | ON_PLAN | flags, 0.0, 5));
    bench.neighbour = other(BLOCKED | WAITING);
    bench.run_until(State::Blocked, 3.0);
    while bench.companion.detours.claimed_since.is_none() {
        bench.run(0.05);
    }
    // This vehicle claims the turn; the other vehicle began to claim it at the same time.
    bench.neighbour = other(BLOCKED);
    bench.run(4.0);
    assert_eq!(bench.state(), State::Blocked, "two would begin at once");
    assert!(
        !bench.companion.detours.is_waiting_for_others(&bench.companion.detour_view()),
        "the lower system id goes on claiming"
    );
    bench.neighbour = other(BLOCKED | WAITING);
    bench.run_until(State::Follow, 1.0);
}

/// A vehicle that follows its path, with a second vehicle of a lower system id.
fn beside_a_lower_id() -> Bench {
    let mut config = two_vehicles();
    config.roster[1].system_id = 7;
    config.roster.sort_unstable_by_key(|entry| entry.system_id);
    let mut bench = Bench::started_with_neighbour(config);
    bench.run_until(State::Follow, 20.0);
    bench
}

#[test]
fn a_vehicle_that_hears_a_lower_system_id_claim_waits_again() {
    let mut bench = beside_a_lower_id();
    exclude(&mut bench, &sphere(Point::new(14.0, 12.0, 1.5), 0.5));
    let other = |flags: u8| Some((Point::new(8.0, 40.0, 9.0), FLYING | ON_PLAN | flags, 0.0, 5));
    bench.neighbour = other(BLOCKED);
    bench.run_until(State::Blocked, 3.0);
    bench.run(8.0);
    assert!(
        bench.companion.detours.is_waiting_for_others(&bench.companion.detour_view())
            && bench.state() == State::Blocked
    );
    // The other vehicle flies its detour: not all stand any more.
    bench.neighbour = other(ON_DETOUR);
    bench.run(1.0);
    bench.neighbour = other(BLOCKED | WAITING);
    bench.run(4.0);
    assert!(
        bench.companion.detours.is_waiting_for_others(&bench.companion.detour_view())
            && bench.state() == State::Blocked,
        "it waits from the start again"
    );
    bench.run_until(State::Follow, 5.0);
}

#[test]
fn a_vehicle_stopped_on_its_way_down_lets_others_fly_around() {
    let mut bench = beside_a_lower_id();
    while bench.companion.guidance.is_setpoint_still_outside_descent() || bench.enu.z > 1.2 {
        bench.run(0.05);
    }
    assert_eq!(bench.state(), State::Follow);
    let at = Point::new(bench.enu.x + 0.3, bench.enu.y, 0.2);
    exclude(&mut bench, &sphere(at, 0.5));
    bench.neighbour = Some((Point::new(8.0, 40.0, 9.0), FLYING | ON_PLAN | BLOCKED, 0.0, 5));
    bench.run_until(State::Blocked, 3.0);
    bench.run(8.0);
    assert!(
        bench.companion.detours.is_waiting_for_others(&bench.companion.detour_view())
            && bench.state() == State::Blocked
    );
}

#[test]
fn a_vehicle_that_died_may_have_been_flown_back_to_its_pad() {
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    let pad = Point::new(8.0, 40.0, 0.2);
    bench.neighbour = Some((pad, GROUNDED | ON_PLAN, 0.0, 5));
    bench.run(1.0);
    bench.neighbour = Some((pad + Point::new(9.0, 0.0, 3.0), FLYING | ON_PLAN, 9.0, 5));
    bench.run(1.0);
    bench.neighbour = None;
    bench.run(60.0);
    let mut reported = Vec::new();
    bench
        .companion
        .neighbours
        .for_each_keep_out_zone(bench.now, [1.5; 3], |place| reported.push(place));
    assert!(
        reported.iter().any(|place| (place.from - pad).norm() < 0.1 && place.radius_m == 1.5),
        "{reported:?}"
    );
}

/// Positions that vehicle 77 reports.
#[derive(Clone, Copy, PartialEq)]
enum Positions {
    Fresh,
    /// It repeats an old one.
    Old,
}

/// Zones of vehicle 77, with these flags, after 30 s.
fn kept_off(flags: u8, positions: Positions) -> Vec<KeepOutZone> {
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    let at = Point::new(8.0, 40.0, 9.0);
    bench.neighbour = Some((at, flags, 0.0, 5));
    bench.run(1.0);
    if positions == Positions::Old {
        bench.neighbour_clock = Some(bench.now);
    }
    bench.run(30.0);
    let mut reported = Vec::new();
    bench
        .companion
        .neighbours
        .for_each_keep_out_zone(bench.now, [1.5; 3], |place| reported.push(place));
    reported
}

#[test]
fn a_vehicle_that_lies_where_it_does_not_know_is_kept_off_by_the_foot_of_its_column() {
    let known = kept_off(GROUNDED | OUT_OF_PLAN, Positions::Fresh);
    assert!(
        matches!(known[..], [KeepOutZone { kind: ZoneKind::Static, .. }])
            && known[0].from == known[0].to
    );
    let vague = kept_off(GROUNDED | OUT_OF_PLAN, Positions::Old);
    assert!(
        matches!(vague[..], [KeepOutZone { kind: ZoneKind::Grounded, .. }])
            && vague[0].to.z < -40.0
    );
}

#[test]
fn the_column_of_one_that_lands_is_deeper_the_older_its_place_is() {
    let depth_m = |moves: bool| {
        let mut bench = Bench::started_with_neighbour(two_vehicles());
        bench.neighbour = Some((Point::new(8.0, 40.0, 9.0), FLYING, 0.0, 5));
        bench.run(1.0);
        if !moves {
            bench.neighbour_clock = Some(bench.now);
        }
        bench.run(10.0);
        let mut depth_m = 0.0;
        bench
            .companion
            .neighbours
            .for_each_landing_column(bench.now, 2.0, |column| depth_m = 9.0 - column.to.z);
        depth_m
    };
    assert!((depth_m(true) - 15.0).abs() < 1.0, "{}", depth_m(true));
    assert!((depth_m(false) - 35.0).abs() < 2.0, "{}", depth_m(false));
}

#[test]
fn no_vehicle_takes_off_before_a_scan_for_obstacles_on_its_path() {
    for tenth in 0..8 {
        let mut bench = Bench::new(two_vehicles());
        bench.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
        // So many obstacles beside the path that the one on it is checked in a later step.
        for i in 0..MAX_OBSTACLES {
            exclude(&mut bench, &sphere(Point::new(40.0 + i as f32, 60.0, 1.5), 0.5));
        }
        bench.run_until(State::Ready, 8.0);
        bench.run(0.1 * tenth as f32);
        bench.start();
        bench.run(0.25);
        assert_eq!(bench.state(), State::Scheduled, "{tenth}");
        bench.run(0.8);
        assert_eq!(bench.state(), State::Scheduled, "{tenth}");
        assert!(bench.companion.detours.blocked, "{tenth}");
    }
}

#[test]
fn what_was_found_for_one_plan_opens_no_gate_of_the_next() {
    for tenth in 0..8 {
        let mut bench = Bench::new(two_vehicles());
        let mut plan = plan();
        plan.gates.push(Gate { at_m: -1.5, wait_for_id: 77, open_from_progress_m: 5.0 }).unwrap();
        bench.answer_plan = Some(Ok(plan.clone()));
        bench.neighbour = Some((Point::new(30.0, 40.0, 0.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
        bench.run_until(State::Ready, 8.0);
        bench.start();
        bench.run_until(State::Streaming, 5.0);
        bench.command(MavCmd::MAV_CMD_NAV_LAND, 0.0, SYSTEM, crate::COMPANION_COMPONENT);
        bench.run(0.3);
        bench.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
        bench.answer_plan = Some(Ok(plan));
        bench.run(1.0);
        bench.start();
        bench.run_until(State::Ready, 8.0);
        bench.run(0.3 + 0.1 * tenth as f32);
        bench.start();
        bench.run(0.7);
        assert_eq!(bench.state(), State::Scheduled, "{tenth}");
    }
}

#[test]
fn a_vehicle_flown_around_by_one_plan_is_looked_at_for_the_next() {
    let mut bench = Bench::new(two_vehicles());
    bench.no_position = true;
    bench.neighbour = Some((Point::new(14.5, 12.5, 1.0), GROUNDED | OUT_OF_PLAN, 0.0, 5));
    bench.run(3.0);
    bench.companion.neighbours.mark_out_of_plan_avoided(bench.now);
    bench.no_position = false;
    bench.run_until(State::Ready, 20.0);
    bench.start();
    bench.run(0.7);
    assert!(bench.companion.detours.obstructed, "{:?}", bench.state());
}

#[test]
fn a_look_among_many_takes_several_steps_and_finds_what_is_last() {
    let mut bench = Bench::following(config());
    // The first obstacles are far from the path; each costs a share of a step.
    for i in 0..MAX_OBSTACLES - 1 {
        exclude(&mut bench, &sphere(Point::new(40.0 + i as f32, 60.0, 1.5), 0.5));
    }
    bench.run(1.0);
    let mut steps = 0;
    while bench.companion.detours.scan_began.is_none() {
        bench.run(0.05);
    }
    while bench.companion.detours.scan_began.is_some() {
        bench.run(0.05);
        steps += 1;
    }
    assert!((1..4).contains(&steps), "{steps}");
    assert_eq!(bench.state(), State::Follow);
    exclude(&mut bench, &sphere(Point::new(15.9, 12.0, 1.5), 0.5));
    bench.run(1.0);
    assert_eq!(bench.state(), State::Blocked);
}

#[test]
fn a_way_is_asked_for_once_more_when_a_silent_vehicle_lies() {
    let mut rng = Pcg32::seed_from_u64(5);
    for _ in 0..500 {
        let (mut detours, mut now) = (Detours::default(), Instant::from_millis(100_000));
        let along_m = (rng.next_u32() % 20) as f32;
        for _ in 0..rng.next_u32() % 9 {
            now = now + Duration::from_millis(1_000 + u64::from(rng.next_u32() % 29_000));
            detours.note_failure(
                along_m,
                RetryOutlook::SilentVehicleComesDown,
                now,
                &mut Timers::default(),
            );
            let after = |ms: u64| now + Duration::from_millis(ms);
            let pause_s = TURN_DELAY_PER_VEHICLE_S * (2 + u64::from(rng.next_u32() % 6));
            let before = after(1000 * pause_s - 1);
            assert!(!detours.may_search_again(pause_s, before), "searches without a pause");
            assert!(detours.may_search_again(pause_s, after(1000 * pause_s)));
            assert!(!detours.has_given_up_detours(), "that vehicle may yet leave more room");
        }
        let (mut asked, outlook) = (
            0,
            if rng.next_u32() % 2 == 0 {
                RetryOutlook::OthersMayMove
            } else {
                RetryOutlook::NoneWillMove
            },
        );
        while !detours.has_given_up_detours() {
            detours.note_failure(along_m, outlook, now, &mut Timers::default());
            asked += 1;
        }
        assert!((1..=MAX_FAILED_SEARCHES).contains(&asked), "{asked}");
    }
}

/// Between two that hover, the full margin may leave no way. The search after one that failed here
/// keeps the smaller margin, but never less than what blocks a path; a search elsewhere, or for
/// another purpose, keeps the full one.
#[test]
fn after_a_failed_search_the_next_one_here_passes_nearer() {
    assert_next_search_passes_nearer(FLYING | ON_PLAN | WAITING, 0.0, 0.25);
}

/// A vehicle that its pilot holds, or that is no longer heard, does not keep its place so well.
#[test]
fn after_a_failed_search_one_under_its_pilot_or_unheard_is_passed_no_nearer() {
    assert_next_search_passes_nearer(FLYING | OUT_OF_PLAN, 0.0, 0.0);
    assert_next_search_passes_nearer(FLYING | ON_PLAN | WAITING, 1.5, 0.0);
}

/// A vehicle that stands `Blocked` before a new obstacle beside another with these flags, which
/// hovers at the place returned; the shell answers requests for detours by `answer`.
fn blocked_beside(flags: u8, answer: Option<Result<(), PlanFailure>>) -> (Bench, Point) {
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    bench.run_until(State::Follow, 20.0);
    exclude(&mut bench, &sphere(Point::new(14.0, 12.0, 1.5), 0.5));
    let hovers = Point::new(8.0, 40.0, 9.0);
    bench.neighbour = Some((hovers, flags, 0.0, 5));
    bench.answer_detour = answer;
    bench.run_until(State::Blocked, 5.0);
    bench.run(0.5);
    (bench, hovers)
}

/// Radius that a search for a detour to the goal would keep from the other now, metres.
fn radius_in_search_for_goal_m(bench: &Bench, hovers: &Point) -> f32 {
    let mut detours = bench.companion.detours.clone();
    detours.requested_purpose = Some(DetourPurpose::Goal);
    let mut radius_m = f32::INFINITY;
    detours.detour_request(&bench.companion.detour_view(), |zone| {
        if (zone.from - hovers).norm() < 0.1 {
            radius_m = radius_m.min(zone.radius_m);
        }
    });
    radius_m
}

/// Once the other has flown elsewhere, a search keeps the full margin first.
#[test]
fn another_vehicle_that_moved_is_passed_by_the_full_margin_first() {
    let (mut bench, hovers) =
        blocked_beside(FLYING | ON_PLAN | WAITING, Some(Err(PlanFailure::Unreachable)));
    let full_m = radius_in_search_for_goal_m(&bench, &hovers);
    while bench.companion.detours.failed_searches_here == 0 {
        bench.tick();
    }
    bench.run(0.1);
    let nearer_m = full_m - radius_in_search_for_goal_m(&bench, &hovers);
    assert!((nearer_m - 0.25).abs() < 0.01, "{nearer_m}");
    for i in 0..600 {
        let place = hovers + Point::new(0.1 * i as f32, 0.0, 0.0);
        bench.neighbour = Some((place, FLYING | ON_PLAN, 0.0, 5));
        bench.run(0.1);
    }
    let there = hovers + Point::new(59.9, 0.0, 0.0);
    bench.neighbour = Some((there, FLYING | ON_PLAN | WAITING, 0.0, 5));
    bench.run(2.0);
    let radius_m = radius_in_search_for_goal_m(&bench, &there);
    assert!((radius_m - full_m).abs() < 0.01, "{radius_m} m, {full_m} m");
}

/// Only a search that found no path shows that there is none with the full margin.
#[test]
fn a_search_without_an_answer_leaves_the_full_margin() {
    let (mut bench, hovers) = blocked_beside(FLYING | ON_PLAN | WAITING, None);
    let full_m = radius_in_search_for_goal_m(&bench, &hovers);
    bench.run_until(State::Replanning, 20.0);
    bench.run_until(State::Blocked, 20.0);
    assert_eq!(bench.companion.detours.failed_searches_here, 1);
    let radius_m = radius_in_search_for_goal_m(&bench, &hovers);
    assert!((radius_m - full_m).abs() < 0.01, "{radius_m} m, {full_m} m");
}

/// A search that fails only until a silent vehicle is down does not count, and what lies is kept
/// off by the same distance in each search.
#[test]
fn only_hovering_vehicles_are_passed_nearer_after_a_search_that_counts() {
    let now = Instant::from_millis(100_000);
    let goal = DetourPurpose::Goal;
    let mut detours = Detours { requested_purpose: Some(goal), ..Detours::default() };
    for outlook in [RetryOutlook::SilentVehicleComesDown, RetryOutlook::NotSearched] {
        detours.note_failure(0.0, outlook, now, &mut Timers::default());
        assert_eq!(detours.keep_out_radii_m(goal, 0.0, 1.5), [2.0, 2.0, 1.75]);
    }
    detours.note_failure(0.0, RetryOutlook::OthersMayMove, now, &mut Timers::default());
    assert_eq!(detours.keep_out_radii_m(goal, 0.0, 1.5), [2.0, 1.75, 1.75]);
}

/// Asserts that a search for a detour to the goal, if the last one failed at about the same place,
/// keeps `nearer_m` less from a hovering vehicle with these flags, silent for `silent_s` seconds;
/// any other search keeps the full distance.
fn assert_next_search_passes_nearer(flags: u8, silent_s: f32, nearer_m: f32) {
    let mut rng = Pcg32::seed_from_u64(6);
    let mut bench = Bench::started_with_neighbour(two_vehicles());
    bench.run_until(State::Follow, 20.0);
    let hovers = Point::new(14.0, 20.0, 2.0);
    bench.neighbour = Some((hovers, flags, 0.0, 5));
    bench.run(1.0);
    bench.neighbour = None;
    bench.run(silent_s);
    let now = bench.companion.detour_view().now;
    let radius_m = |detours: &Detours| {
        let mut radius_m = f32::INFINITY;
        let request = detours.detour_request(&bench.companion.detour_view(), |zone| {
            if zone.kind == ZoneKind::Static && (zone.from - hovers).norm() < 0.1 {
                radius_m = radius_m.min(zone.radius_m);
            }
        });
        assert!(request.is_some());
        radius_m
    };
    let first = Detours { requested_purpose: Some(DetourPurpose::Goal), ..Detours::default() };
    let full_m = radius_m(&first);
    assert!(full_m >= bench.companion.config.safety_distance_m + 0.5);
    let mut nearer = 0;
    for _ in 0..500 {
        let mut detours = Detours::default();
        let here_m = bench.companion.guidance.reference_along_m();
        let mut failed_here = false;
        for _ in 0..rng.next_u32() % 3 {
            detours.requested_purpose = Some(DetourPurpose::Goal);
            failed_here = rng.next_u32() % 2 == 0;
            let along_m = if failed_here { here_m + 0.5 } else { here_m + 5.0 };
            detours.note_failure(along_m, RetryOutlook::OthersMayMove, now, &mut Timers::default());
        }
        let goal = rng.next_u32() % 4 > 0;
        detours.requested_purpose =
            Some(if goal { DetourPurpose::Goal } else { DetourPurpose::LandingAside });
        let closer_m = full_m - radius_m(&detours);
        let expected_m = if goal && failed_here { nearer_m } else { 0.0 };
        assert!((closer_m - expected_m).abs() < 1e-3, "{closer_m} m nearer");
        nearer += usize::from(goal && failed_here);
    }
    assert!(nearer > 100, "{nearer}");
}
