extern crate std;

use planner_core::flight::Gate;
use planner_core::track::safety::{
    Braking, Legs, MotionBounds, OwnSet, ReachableSet, ReportedPathReach,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::filter_neighbour::ReachQuery;
use super::*;
use crate::link::intent::BLOCKED;

pub(super) const ORIGIN: Geodetic = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 600.0 };

fn table() -> Neighbours<4> {
    let entry = |system_id| RosterEntry { system_id, path_start: Point::zeros() };
    Neighbours::new(&[entry(3), entry(5), entry(9)], 5, 2.0, 2.0)
}

pub(super) fn place(boot_ms: u32, north_1e7: i32) -> GLOBAL_POSITION_INT_DATA {
    GLOBAL_POSITION_INT_DATA {
        time_boot_ms: boot_ms,
        lat: 400_000_000 + north_1e7,
        lon: -30_000_000,
        alt: 602_500,
        vx: 150,
        vy: -50,
        vz: 20,
        ..Default::default()
    }
}

pub(super) fn intent(flags: u8, mission_crc: u32, plan_crc: u32) -> Intent {
    Intent {
        system_id: 9,
        flags,
        mission_crc,
        plan_crc,
        progress_m: 4.0,
        gates_open_up_to_m: -1e6,
        heard_bits: 2,
        ..Intent::default()
    }
}

/// The table, after intents of vehicles 3 and 9 for mission 1 were heard at `at_ms`.
pub(super) fn joined(at_ms: u64) -> Neighbours<4> {
    let mut table = table();
    for system_id in [3, 9] {
        let reported = Intent { system_id, heard_bits: 0, ..intent(0, 1, 2) };
        table.handle_intent(Instant::from_millis(at_ms), 1, &reported, 1, None);
    }
    table
}

#[test]
fn a_position_reaches_the_mission_frame_and_ages() {
    let mut table = joined(0);
    assert!(table.states_with_age(Instant::ZERO).is_empty());
    table.handle_position(Instant::from_millis(100), &ORIGIN, 9, &place(50, 1000));
    let heard = table.states_with_age(Instant::from_millis(600))[0];
    assert_eq!((heard.id, heard.rank), (9, 2));
    // A ten-thousandth of a degree of latitude is 11.1 m.
    assert!((heard.position - Point::new(0.0, 11.1, 2.5)).norm() < 0.02, "{:?}", heard.position);
    assert!((heard.velocity - Point::new(-0.5, 1.5, -0.2)).norm() < 1e-5);
    assert!((heard.age_s - 0.5).abs() < 1e-6);
}

#[test]
fn below_is_lower_and_near_the_vertical() {
    let mut table = joined(0);
    let above = Point::new(0.0, 1.0, 9.0);
    assert!(!table.any_below(&above, 2.0), "nobody was heard");
    table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 0));
    assert!(table.any_below(&above, 2.0));
    assert!(
        !table.any_below(&Point::new(0.0, 3.0, 9.0), 2.0) && !table.any_below(&Point::zeros(), 2.0)
    );
}

#[test]
fn late_and_repeated_positions_change_nothing_but_a_restart_does() {
    let mut table = joined(0);
    table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(20_000, 1000));
    for late in [20_000, 19_900, 10_001] {
        table.handle_position(Instant::from_millis(500), &ORIGIN, 9, &place(late, 0));
        assert!(table.states_with_age(Instant::from_millis(500))[0].age_s > 0.4, "{late}");
    }
    table.handle_position(Instant::from_millis(500), &ORIGIN, 9, &place(100, 0));
    assert_eq!(table.states_with_age(Instant::from_millis(500))[0].age_s, 0.0);
}

#[test]
fn progress_counts_only_on_our_mission_and_plan() {
    let mut table = joined(0);
    table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(0, 0));
    for (flags, mission, plan, own_plan, progress) in [
        (ON_PLAN, 1, 2, Some(2), Some(4.0)),
        (0, 1, 2, Some(2), None),
        (ON_PLAN, 1, 2, Some(2), Some(4.0)),
        // Another mission: the intent changes nothing.
        (0, 7, 2, Some(2), Some(4.0)),
        (ON_PLAN, 1, 7, Some(2), None),
        (ON_PLAN, 1, 2, None, None),
    ] {
        table.handle_intent(Instant::ZERO, 1, &intent(flags, mission, plan), 1, own_plan);
        assert_eq!(table.states_with_age(Instant::ZERO)[0].progress_m, progress);
    }
}

#[test]
fn strangers_rank_last_are_capped_and_expire() {
    let at = Instant::from_millis;
    let mut table = joined(0);
    for id in [200, 201, 202] {
        table.handle_position(at(0), &ORIGIN, id, &place(0, 0));
    }
    assert_eq!((table.states_with_age(at(0)).len(), table.dropped_position_count()), (2, 1));
    assert!(table.states_with_age(at(0)).iter().all(|n| n.rank == u16::MAX));
    table.handle_position(at(59_000), &ORIGIN, 201, &place(59_000, 0));
    let ids = |table: &mut Neighbours<4>, ms| {
        let mut ids = Vec::<u8, 4>::new();
        table.states_with_age(at(ms)).iter().for_each(|n| ids.push(n.id).unwrap());
        ids
    };
    assert_eq!(ids(&mut table, 59_900), [200, 201]);
    assert_eq!(ids(&mut table, 60_000), [201]);
    table.handle_position(at(60_000), &ORIGIN, 202, &place(0, 0));
    assert_eq!(ids(&mut table, 60_000), [201, 202]);
    assert_eq!(ids(&mut table, 120_000), [], "none for good");
}

#[test]
fn a_position_of_the_roster_counts_only_with_the_missions_crc() {
    let at = Instant::from_millis;
    let mut table = table();
    table.handle_intent(at(0), 1, &intent(OUT_OF_PLAN | BLOCKED, 7, 8), 1, None);
    table.handle_position(at(0), &ORIGIN, 9, &place(0, 0));
    assert_eq!(
        table.states_with_age(at(0))[0].rank,
        u16::MAX,
        "another mission's vehicle is a stranger"
    );
    assert_eq!(
        (table.heard_bits(at(0)), table.blocked_count_below_id(200)),
        (0, 0),
        "nor do its flags"
    );
    table.handle_intent(at(100), 1, &intent(0, 1, 2), 1, None);
    assert!(table.states_with_age(at(100)).is_empty(), "it is no stranger any more");
    table.handle_position(at(200), &ORIGIN, 9, &place(200, 0));
    assert_eq!(table.states_with_age(at(200))[0].rank, 2);
    table.handle_position(at(5100), &ORIGIN, 9, &place(5100, 5000));
    let (rostered, stranger) =
        (table.states_with_age(at(5100))[0], table.states_with_age(at(5100))[1]);
    assert_eq!((rostered.rank, stranger.rank), (2, u16::MAX), "its mission was not heard for 5 s");
    assert!(rostered.position.y < 1.0 && stranger.position.y > 50.0);
}

proptest::proptest! {
    /// Whatever ids send whatever intents and positions, the roster's vehicles keep their entries
    /// and what is known of them.
    #[test]
    fn strangers_never_displace_the_roster(
        frames in proptest::collection::vec(
            (
                1u8..=255,
                proptest::prelude::any::<bool>(),
                0u64..2000,
                proptest::prelude::any::<u8>(),
                2u32..9,
            ),
            0..200,
        ),
    ) {
        let at = Instant::from_millis;
        let mut table = joined(0);
        let mut now = 0;
        for id in [3, 9] {
            table.handle_position(at(0), &ORIGIN, id, &place(1_000_000, 1000));
        }
        for (id, position, later, flags, mission) in frames {
            now += later;
            if position && id != 3 && id != 9 {
                table.handle_position(at(now), &ORIGIN, id, &place(now as u32, 0));
            } else {
                let reported = Intent { system_id: id, ..intent(flags, mission, 2) };
                table.handle_intent(at(now), 1, &reported, 1, Some(2));
            }
            let heard = table.states_with_age(at(now));
            proptest::prop_assert!(heard.len() <= 4);
            let own = |id: u8| {
                heard
                    .iter()
                    .find(|n| n.id == id)
                    .map(|n| (n.rank, n.position.y > 11.0, n.out_of_plan))
            };
            proptest::prop_assert_eq!(
                (own(3), own(9)),
                (Some((0, true, false)), Some((2, true, false)))
            );
            proptest::prop_assert_eq!(table.blocked_count_below_id(255), 0);
            proptest::prop_assert_eq!(
                table.unlinked_duration(at(now), at(0)),
                Duration::from_millis(now)
            );
        }
    }
}

#[test]
fn silence_is_that_of_the_vehicles_that_fly() {
    let mut table = table();
    let at = Instant::from_millis;
    assert_eq!(
        table.unlinked_duration(at(9000), at(2000)),
        Duration::from_millis(7000),
        "never heard"
    );
    table.handle_intent(at(5000), 1, &Intent { heard_bits: 0, ..intent(0, 1, 2) }, 1, None);
    assert_eq!(table.unlinked_duration(at(9000), at(2000)), Duration::from_millis(7000), "unheard");
    table.handle_intent(at(5000), 1, &intent(0, 1, 2), 1, None);
    assert_eq!(table.unlinked_duration(at(9000), at(2000)), Duration::from_millis(4000));
    assert!(table.linked_within(at(5500), Duration::from_millis(1000)));
    assert!(!table.linked_within(at(6500), Duration::from_millis(1000)));
    table.handle_intent(at(5000), 1, &intent(LANDED, 1, 2), 1, None);
    table.handle_intent(at(5000), 1, &Intent { system_id: 3, ..intent(LANDED, 1, 2) }, 1, None);
    assert_eq!(table.unlinked_duration(at(9000), at(2000)), Duration::default(), "all have landed");
}

#[test]
fn a_vehicle_out_of_the_plan_opens_gates_only_after_a_scan() {
    let at = Instant::from_millis;
    let mut table = table();
    let out = |table: &mut Neighbours<4>, now: Instant| table.states_with_age(now)[0].out_of_plan;
    table.handle_intent(at(1000), 1, &intent(0, 7, 8), 7, None);
    table.handle_position(at(1000), &ORIGIN, 9, &place(50, 1000));
    table.handle_intent(at(1000), 1, &intent(OUT_OF_PLAN, 7, 8), 7, None);
    assert!(!out(&mut table, at(1100)), "nobody has looked");
    table.mark_path_clear(at(900));
    assert!(!out(&mut table, at(1200)), "it went out while somebody looked");
    table.mark_path_clear(at(1000));
    assert!(out(&mut table, at(1300)));
    table.forget_plan();
    assert!(!out(&mut table, at(1400)), "another plan, another look");
    table.mark_path_clear(at(1400));
    table.handle_intent(at(1500), 1, &intent(0, 7, 8), 7, None);
    assert!(!out(&mut table, at(1600)), "it is not out any more");
    // Silent from now on: it counts as dead later, but not before the next scan.
    let dead = at(1500) + LOST_AFTER;
    assert!(!out(&mut table, dead) && !table.states_with_age(dead)[0].grounded);
    table.mark_path_clear(dead);
    assert!(out(&mut table, dead) && table.states_with_age(dead)[0].grounded);
}

#[test]
fn a_vehicle_silent_before_its_place_and_plan_were_heard_opens_gates_too() {
    let mut table = table();
    table.handle_intent(Instant::ZERO, 1, &intent(0, 7, 8), 7, None);
    table.forget_plan();
    let dead = Instant::ZERO + LOST_AFTER;
    assert!(table.states_with_age(dead).is_empty());
    table.mark_path_clear(dead);
    let gate = Gate { at_m: 1.0, wait_for_id: 9, open_from_progress_m: 5.0 };
    assert!(table.is_open_for_good(&gate, dead), "a promise may count on that");
    let state = table.states_with_age(dead)[0];
    assert!(
        (state.id, state.out_of_plan, state.grounded) == (9, true, true)
            && state.position == FAR_AWAY
    );
}

proptest::proptest! {
    /// Whatever is reported, the believed progress grows no faster than a vehicle flies, except for
    /// a message's delay. True reports, however late, are believed as they are; a jump is believed
    /// in the end.
    #[test]
    fn progress_grows_no_faster_than_a_vehicle_flies(
        delays_ms in proptest::collection::vec(0u64..1000, 2..60),
        lies_m in proptest::collection::vec(-50.0f32..200.0, 0..60),
        speed_mps in 0.0f32..2.0,
        begin_m in -30.0f32..0.0,
    ) {
        let place_of = |table: &Neighbours<4>| table.entries[1].state.progress_m;
        let (mut honest, mut lying) = (joined(0), joined(0));
        let reported = |progress_m| Intent { progress_m, ..intent(ON_PLAN, 1, 2) };
        let (mut last, mut heard_ms) = (None::<(f32, Instant)>, 0);
        for (i, delay_ms) in delays_ms.iter().enumerate() {
            // Messages that were overtaken are dropped before they get here.
            let sent_ms = 200 * (i as u64 + 1);
            heard_ms = heard_ms.max(sent_ms + delay_ms);
            let now = Instant::from_millis(heard_ms);
            let true_m = begin_m + speed_mps * sent_ms as f32 * 1e-3;
            honest.handle_intent(now, 1, &reported(true_m), 1, Some(2));
            proptest::prop_assert_eq!(place_of(&honest), Some(true_m));
            let reported_m = lies_m.get(i).copied().unwrap_or(true_m);
            lying.handle_intent(now, 1, &reported(reported_m), 1, Some(2));
            let believed_m = place_of(&lying).unwrap();
            proptest::prop_assert!(believed_m <= reported_m);
            if let Some((before_m, at)) = last {
                let most_m = before_m
                    + 2.0 * (now - at).as_secs_f32()
                    + 2.0 * MAX_MESSAGE_DELAY_S
                    + MAX_PROGRESS_JUMP_M
                    + 1e-3;
                proptest::prop_assert!(believed_m <= most_m, "{believed_m} m after {before_m} m");
            }
            last = Some((believed_m, now));
        }
        // A landing that reports its whole path is believed after the time that it takes to fly it.
        for second in 1..200 {
            let now = Instant::from_millis(heard_ms + second * 1000);
            lying.handle_intent(now, 1, &reported(250.0), 1, Some(2));
        }
        proptest::prop_assert_eq!(place_of(&lying), Some(250.0));
    }
}

#[test]
fn a_vehicle_is_deaf_that_hears_none_of_those_there_are() {
    let at = |seconds: u64| Instant::from_millis(seconds * 1000);
    assert!(
        !Neighbours::<4>::new(&[], 1, 2.0, 2.0).hears_nobody(at(100)),
        "alone there is nobody to hear"
    );
    let roster = [1, 2, 9].map(|system_id| RosterEntry { system_id, path_start: Point::zeros() });
    let mut table = Neighbours::<4>::new(&roster, 1, 2.0, 2.0);
    table.handle_intent(at(10), 0, &intent(0, 1, 2), 1, None);
    assert!(!table.hears_nobody(at(12)), "one is heard");
    assert!(table.hears_nobody(at(14)));
}

/// A number from low to high.
pub(super) fn uniform(rng: &mut Pcg32, low: f32, high: f32) -> f32 {
    low + (high - low) * (rng.next_u32() >> 8) as f32 / 16_777_216.0
}

#[test]
fn a_vehicle_beyond_reach_is_out_of_reach_of_the_filter_too() {
    let braking = Braking { accel_mps2: 1.5, jerk_mps3: 8.0 };
    let bounds = MotionBounds { braking, speed_max_mps: 2.0, stopped_when_unheard_for_s: 3.0 };
    let (mut beyond, mut reached, mut missed) = (0, 0, 0);
    for seed in 0..200_000 {
        let rng = &mut Pcg32::seed_from_u64(seed);
        let near = |rng: &mut Pcg32, m: f32| {
            Point::new(uniform(rng, -m, m), uniform(rng, -m, m), uniform(rng, -m, m))
        };
        let mut table = joined(0);
        let entry = &mut table.entries[1];
        entry.state.position = near(rng, 10.0);
        let fastest_mps = [2.0, 15.0][rng.next_u32() as usize % 2];
        entry.state.velocity = near(rng, fastest_mps);
        entry.speed_mps = entry.state.velocity.norm();
        entry.flags = rng.next_u32() as u8;
        entry.may_come_down = rng.next_u32().is_multiple_of(2);
        entry.ground_m = [f32::NAN, -3.0][rng.next_u32() as usize % 2];
        entry.state.progress_m = [None, Some(1.0)][rng.next_u32() as usize % 2];
        entry.message_delay.delay_s = uniform(rng, 0.0, 1.0);
        let beside_m = [0.3, 3.0][rng.next_u32() as usize % 2];
        let from = entry.state.position + near(rng, beside_m);
        entry.points = (0..rng.next_u32() % 9).map(|_| from + near(rng, 3.0)).collect();
        entry.points_length_m = [0.0, -1.0][rng.next_u32() as usize % 2];
        entry.unheard_flight_point_count =
            (rng.next_u32() % 9).min(entry.points.len().saturating_sub(1) as u32) as u8;
        let first = entry.points.first().copied().unwrap_or_default();
        let extent_m = |p: &Point| (p - first).norm();
        entry.points_extent_m = entry.points_to_stop().iter().map(extent_m).fold(0.0, f32::max);
        entry.update_place_on_points();
        let now = Instant::from_millis(200_000);
        let ages_ms = [100, 900, 1500, 5000, 46_000, 80_000];
        let age = |rng: &mut Pcg32| {
            let ms = ages_ms[rng.next_u32() as usize % 6] + u64::from(rng.next_u32() % 200);
            Instant::from_millis(200_000 - ms)
        };
        let placed_at = age(rng);
        entry.position_at = Some(placed_at);
        entry.intent_at = Some(age(rng));
        entry.heard_at = entry.position_at.max(entry.intent_at);
        entry.relayed_report_at = Some(age(rng)).filter(|_| seed % 3 == 0);
        entry.moved_at = age(rng);
        let lands = seed % 2 == 0;
        let stopped = rng.next_u32().is_multiple_of(3);
        let place = near(rng, 14.0);
        let end = place + if lands { Point::new(0.0, 0.0, -4.0) } else { near(rng, 3.0) };
        let set = ReachableSet::along(place, [place, end].into_iter(), 10.0);
        let mut legs = Legs::new();
        let reach = ReachQuery {
            own: &OwnSet::new(&set, &mut legs),
            within_m: 2.0 + uniform(rng, 0.0, 4.0),
            bounds: &bounds,
            ahead_s: if stopped { 3.0 } else { 0.0 },
            on_plan: rng.next_u32().is_multiple_of(2),
            hears_nobody: rng.next_u32().is_multiple_of(4),
            holds_lease: false,
            lands,
        };
        let lost = table.entries[1].is_lost_on_points(now - placed_at, now);
        let mut met = table.entries[1].filter_neighbour(now);
        met.lost = lost;
        table.apply_silence(&table.entries[1], now, &mut met);
        if met.on_plan && reach.on_plan {
            met.motion.delay_s = 0.0;
        }
        if met.lost && !lands && reach.hears_nobody {
            // For a vehicle that hears nobody, the other one has flown on.
            (met.motion.age_s, met.motion.grounded) = (bounds.stopped_when_unheard_for_s, false);
        }
        let silent = met.lost || met.motion.age_s > SILENT_AFTER_POSITION_AGE_S;
        if lands && silent {
            (met.motion.age_s, met.motion.speed_mps, met.motion.reported_points) = (0.0, 0.0, &[]);
            met.motion.reported_path_reach = ReportedPathReach::UNBOUNDED;
            met.motion.rests_within_m = 0.0;
        }
        let by_gates = met.on_plan && reach.on_plan;
        let leased = table.entries[1].would_fly_all_points_unheard();
        if leased && !(lands || by_gates || met.lost || reach.hears_nobody) {
            met.limit_to_points(&table.entries[1], &bounds);
        }
        let ahead_s = if met.stands { 0.0 } else { reach.ahead_s };
        let reach_m = reach.within_m + met.motion.max_reach_m(&bounds, ahead_s);
        let away = reach.own.box_distances(&met.motion.position);
        let above_m = if met.motion.column_bottom_z_m.is_some() { 0.0 } else { away.z };
        let out_of_reach = Point::new(away.x, away.y, above_m).norm() >= reach_m - 1e-4;
        let below = lands
            && silent
            && table.may_lie_below(1, &place, -DEFAULT_COLUMN_DEPTH_M, reach.within_m, Some(now));
        if table.next_within_reach(1, now, &reach).is_none() {
            assert!(out_of_reach && !below, "{seed}: {met:?}, {reach:?}");
            beyond += 1;
        } else {
            reached += usize::from(!out_of_reach || below);
            missed += usize::from(out_of_reach && !below);
        }
    }
    assert!(beyond > 2000 && reached > 1000 && missed < beyond, "{beyond} {reached} {missed}");
}

#[test]
fn nobody_falls_up() {
    let mut rng = Pcg32::seed_from_u64(7);
    let apart_m = 1.75;
    let (mut below, mut above) = (0, 0);
    for _ in 0..2000 {
        let mut table = joined(0);
        let here = Point::from_fn(|_, _| uniform(&mut rng, -4.0, 4.0));
        let points: heapless::Vec<Point, { crate::link::intent::MAX_POINTS }> =
            (0..3).map(|_| here + Point::from_fn(|_, _| uniform(&mut rng, -3.0, 3.0))).collect();
        let reported = Intent { points: points.clone(), ..intent(0, 1, 2) };
        table.handle_intent(Instant::from_millis(500), 1, &reported, 1, None);
        table.handle_position(Instant::from_millis(500), &ORIGIN, 9, &place(50, 0));
        // The neighbour's position in the mission frame.
        let from = table.entries[1].state.position;
        let mut place = Point::from_fn(|_, _| uniform(&mut rng, -6.0, 6.0));
        place.z = uniform(&mut rng, 0.0, 30.0);
        let floor_m = place.z - uniform(&mut rng, 0.5, 20.0);
        let says = table.may_lie_below(1, &place, floor_m, apart_m, None);
        let highest_m = points.iter().fold(from.z, |most, p| most.max(p.z));
        let near = table.may_lie_below(1, &place, -1e6, apart_m, None);
        assert!(near || !says);
        if says {
            below += 1;
            assert!(highest_m > floor_m - apart_m, "it would have to climb");
        } else if near {
            above += 1;
            // Each part of the neighbour's path within the column's reach is too far below the
            // floor.
            let (mut nearest, mut at) = (f32::INFINITY, from);
            let mut left_m = table.entries[1].max_unheard_distance_m();
            for next in &points {
                let leg_m = (next - at).norm();
                let share = (left_m / leg_m).clamp(0.0, 1.0);
                left_m -= leg_m;
                for step in 0..=50 {
                    let way = at + (next - at) * (share * step as f32 / 50.0);
                    if (way - place).xy().norm() < apart_m {
                        nearest = nearest.min((way - Point::new(place.x, place.y, floor_m)).norm());
                    }
                }
                at = *next;
            }
            assert!(nearest > apart_m - 1e-3 || nearest.is_infinite(), "{nearest}");
        }
    }
    assert!(below > 100 && above > 20, "{below} {above}");
}

/// A vehicle that its pilot flies after its mission reports its old plan still, and is no reason to
/// wait for its plan.
#[test]
fn a_vehicle_out_of_the_plan_follows_no_other_plan() {
    let mut table = table();
    let now = Instant::from_millis(100);
    for (flags, other) in
        [(ON_PLAN, true), (ON_PLAN | OUT_OF_PLAN, false), (ON_PLAN | LANDED, false)]
    {
        table.handle_intent(now, 1, &intent(flags, 1, 9), 1, Some(2));
        assert_eq!(table.hears_another_plan(now), other, "{flags:#x}");
    }
}
