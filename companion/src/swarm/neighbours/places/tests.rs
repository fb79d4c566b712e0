extern crate std;

use planner_core::track::safety::{Braking, MotionBounds, PlaceOnPoints};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::super::tests::{ORIGIN, intent, joined, place, uniform};
use super::super::{
    GROUNDED, MAX_STRETCH_SPACINGS, MIN_UNHEARD_STRETCH_SPACING_M, OUT_OF_PLAN,
    STALE_POSITION_ERROR_M,
};
use super::*;
use crate::link::intent::{Intent, MAX_POINTS};
use crate::margins::max_unheard_travel_m;
use crate::time::Duration;

/// Wherever a vehicle in a coverage mission is on the points that it reported before it fell
/// silent: no vehicle lands below, and no place below counts as free.
#[test]
fn over_an_area_what_an_unheard_vehicle_may_still_fly_is_kept_off() {
    let mut rng = Pcg32::seed_from_u64(14);
    let apart_m = 2.0;
    let (mut far, mut near) = (0, 0);
    for _ in 0..2000 {
        let mut table = joined(0);
        table.form_fleet(90.0, None, 1.0);
        // The other vehicle, which shows this one that its receiver works.
        let heard = Intent { system_id: 3, ..intent(0, 1, 2) };
        table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 40_000));
        let from = table.entries[1].state.position;
        let mut at = from;
        let count = 2 + rng.next_u32() % 7;
        let points: heapless::Vec<Point, MAX_POINTS> = (0..count)
            .map(|_| {
                at +=
                    Point::new(uniform(&mut rng, -60.0, 60.0), uniform(&mut rng, -60.0, 60.0), 0.0);
                at
            })
            .collect();
        let beyond = (rng.next_u32() % count) as u8;
        let reported = Intent {
            points: points.clone(),
            unheard_flight_point_count: beyond,
            ground_m: 0.0,
            ..intent(0, 1, 2)
        };
        table.handle_intent(Instant::ZERO, 1, &reported, 1, Some(2));
        let leg = rng.next_u32() as usize % points.len();
        let before = if leg == 0 { from } else { points[leg - 1] };
        let truly = before + (points[leg] - before) * uniform(&mut rng, 0.0, 1.0);
        let silent_s = uniform(&mut rng, 3.1, 60.0);
        let now = Instant::from_millis((1000.0 * silent_s) as u64);
        table.handle_intent(now, 1, &heard, 1, Some(2));
        let beside = Point::new(uniform(&mut rng, -1.0, 1.0), uniform(&mut rng, -1.0, 1.0), 0.0);
        let here = truly + beside.normalize() * (0.95 * apart_m);
        assert!(table.may_lie_below(1, &here, 0.0, apart_m, None), "{points:?}, {here:?}");
        for up_m in [-10.0, 10.0] {
            let (mut ends, mut columns) = (false, false);
            let place = here + Point::new(0.0, 0.0, up_m);
            table
                .for_each_landing_zone(now, [apart_m, place.z], |off| ends |= off.contains(&place));
            let low = place - Point::new(0.0, 0.0, 20.0);
            table.visit_landing_column(1, now, apart_m, |off| columns |= off.contains(&low));
            table.for_each_unavoided_zone_of(1, now, apart_m, |off| columns |= off.contains(&low));
            assert!(
                ends && (columns || silent_s < 40.0),
                "{silent_s} s, {points:?}, {here:?}: {ends} {columns}"
            );
        }
        // A place that is far from all of its points is free.
        let aside =
            from + Point::new(uniform(&mut rng, -60.0, 60.0), uniform(&mut rng, -60.0, 60.0), 0.0);
        let legs = core::iter::once(&from).chain(&points).zip(&points);
        let away_m = legs.fold(f32::INFINITY, |least, (a, b)| {
            let share = ((aside - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
            least.min((a + (b - a) * share - aside).norm())
        });
        let free = !table.may_lie_below(1, &aside, 0.0, apart_m, None);
        assert_eq!(free, away_m >= apart_m, "{away_m}");
        *(if free { &mut far } else { &mut near }) += 1;
    }
    assert!(far > 1000 && near > 10, "{far} {near}");
}

/// Wherever a vehicle whose motors stop falls, from any height and in any wind up to 3 m/s, however
/// long before that it was last heard: no vehicle lands beside it, and no place beside it counts as
/// free.
#[test]
fn where_a_vehicle_may_have_fallen_nobody_lands() {
    let mut rng = Pcg32::seed_from_u64(16);
    let apart_m = 2.0;
    let (mut off_its_way, mut free) = (0, 0);
    for case in 0..2000 {
        let mut table = joined(0);
        table.form_fleet(90.0, None, 1.0);
        let from = Point::new(0.0, 0.0, uniform(&mut rng, 5.0, 120.0));
        let mut velocity = Point::from_fn(|_, _| uniform(&mut rng, -6.0, 6.0));
        velocity.z = uniform(&mut rng, -1.0, 0.0);
        let points = [from, Point::new(0.0, 0.0, 0.0)].into_iter().collect();
        let reported = Intent { points, ground_m: 0.0, ..intent(0, 1, 2) };
        table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 0));
        table.handle_intent(Instant::ZERO, 1, &reported, 1, Some(2));
        let entry = &mut table.entries[1];
        (entry.state.position, entry.state.velocity) = (from, velocity);
        if case % 4 == 0 {
            entry.flags |= OUT_OF_PLAN;
        }
        // The fall as it is simulated: drag slows the vehicle, and half of the wind's speed carries
        // it.
        let wind =
            0.5 * 3.0 * Point::new(uniform(&mut rng, -0.7, 0.7), uniform(&mut rng, -0.7, 0.7), 0.0);
        let mut at = from + velocity * uniform(&mut rng, 0.0, 1.0);
        while at.z > 0.0 {
            velocity += (wind - velocity - Point::new(0.0, 0.0, 9.81)) * 0.01;
            at += velocity * 0.01;
        }
        let beside = Point::new(uniform(&mut rng, -1.0, 1.0), uniform(&mut rng, -1.0, 1.0), 0.0);
        let here = at + beside.normalize() * (0.9 * apart_m);
        let now = Instant::from_millis(3100 + u64::from(rng.next_u32() % 200_000));
        assert!(
            table.may_lie_below(1, &here, 0.0, apart_m, Some(now)),
            "{case}: {from:?}, {here:?}"
        );
        let mut ends = false;
        table.for_each_landing_zone(now, [apart_m, here.z], |off| ends |= off.contains(&here));
        assert!(ends, "{case}: {from:?}, {here:?}");
        off_its_way += usize::from(!table.may_lie_below(1, &here, 0.0, apart_m, None));
        // While the vehicle is heard it has not fallen; unheard, it has not fallen far away.
        let heard = Instant::from_millis(2900);
        assert!(
            here.xy().norm() < apart_m || !table.may_lie_below(1, &here, 0.0, apart_m, Some(heard))
        );
        let far = here.normalize() * 60.0;
        free += usize::from(!table.may_lie_below(1, &far, 0.0, apart_m, Some(now)));
    }
    assert!(off_its_way > 1000 && free == 2000, "{off_its_way} {free}");
}

/// Wherever on its unheard stretch a silent vehicle is, a keep-out place is at most half a spacing
/// away: up to the stretch's end, and around its corners. At no speed are there more places than a
/// search for a detour has room for.
#[test]
fn the_stretch_of_an_unheard_vehicle_is_kept_off_to_its_end() {
    let mut rng = Pcg32::seed_from_u64(15);
    let (mut at_the_end, mut most) = (0, 0);
    for case in 0..5000 {
        let mut table = joined(0);
        let entry = &mut table.entries[1];
        entry.message_delay.delay_s = uniform(&mut rng, 0.0, 1.0);
        entry.fastest_vehicle_mps = uniform(&mut rng, 0.5, 15.0);
        entry.max_unheard_travel_m = max_unheard_travel_m(entry.fastest_vehicle_mps);
        let mut at = entry.state.position;
        entry.points = (0..1 + rng.next_u32() % 8)
            .map(|_| {
                at += Point::from_fn(|_, _| uniform(&mut rng, -8.0, 8.0));
                at
            })
            .collect();
        let upto_m = entry.unheard_stopping_distance_m();
        let mut places = std::vec::Vec::new();
        entry.for_each_rest_place([0.0, upto_m], &mut |place, _| places.push(place));
        let flown_m = upto_m * uniform(&mut rng, 0.0, 1.2).min(1.0);
        let (mut left_m, mut from) = (flown_m, entry.state.position);
        for next in &entry.points {
            let leg: Point = next - from;
            let share = (left_m / leg.norm()).min(1.0);
            from += leg * share;
            left_m -= leg.norm() * share;
        }
        at_the_end += usize::from(flown_m >= upto_m && left_m <= 0.0);
        let nearest_m =
            places.iter().map(|place| (place - from).norm()).fold(f32::INFINITY, f32::min);
        let spacing_m = MIN_UNHEARD_STRETCH_SPACING_M.max(upto_m / MAX_STRETCH_SPACINGS);
        assert!(nearest_m <= 0.5 * spacing_m + 0.01, "{case}: {nearest_m} m beside {places:?}");
        most = most.max(places.len());
    }
    assert!(at_the_end > 300, "{at_the_end}");
    assert!((10..18).contains(&most), "{most}");
}

/// A gust carries a vehicle aside, but it comes to rest on its points: there the keep-out places
/// lie, however short its points are, and one is where it rests.
#[test]
fn a_silent_vehicle_that_a_gust_carried_aside_is_kept_off_on_its_points() {
    let mut rng = Pcg32::seed_from_u64(18);
    let (mut aside, mut short) = (0, 0);
    for case in 0..5000 {
        let mut table = joined(0);
        table.handle_intent(
            Instant::ZERO,
            1,
            &Intent { ground_m: 0.0, ..intent(0, 1, 2) },
            1,
            None,
        );
        let entry = &mut table.entries[1];
        entry.fastest_vehicle_mps = 2.0;
        entry.max_unheard_travel_m = max_unheard_travel_m(2.0);
        let mut at = entry.state.position + Point::new(0.0, 0.0, 2.0);
        let (mut way, mut points) = (Point::new(1.0, 0.0, 0.0), [at].to_vec());
        for _ in 0..1 + rng.next_u32() % 5 {
            at += way * uniform(&mut rng, 0.05, 3.0);
            points.push(at);
            // No sharp turn: else it is not known on which leg the vehicle is.
            let turn = Point::new(0.0, uniform(&mut rng, -0.5, 0.5), uniform(&mut rng, -0.2, 0.2));
            way = (way + turn).normalize();
        }
        // The setpoint, the first point, is a little ahead of the vehicle or behind it.
        let on = points[0] + Point::new(uniform(&mut rng, -0.3, 0.05), 0.0, 0.0);
        let blown = Point::new(0.0, uniform(&mut rng, -1.0, 1.0), uniform(&mut rng, -1.0, 1.0));
        let blown_m = uniform(&mut rng, 0.0, 0.24);
        entry.state.position = on + blown.normalize() * blown_m;
        entry.state.velocity = Point::new(uniform(&mut rng, 0.0, 2.0), 0.0, 0.0);
        entry.points = points.iter().copied().collect();
        entry.update_place_on_points();
        let (least_m, upto_m) = (entry.min_rest_distance_m(), entry.unheard_stopping_distance_m());
        let mut places = std::vec::Vec::new();
        entry.for_each_rest_place([least_m, upto_m], &mut |place, _| places.push(place));
        assert!(!places.is_empty(), "{case}: {least_m} m of {points:?}");
        let mut left_m = least_m + (upto_m - least_m) * uniform(&mut rng, 0.0, 1.0);
        let mut rest = on;
        for next in &points {
            let leg = next - rest;
            let share = (left_m / leg.norm().max(1e-6)).min(1.0);
            (rest, left_m) = (rest + leg * share, left_m - leg.norm() * share);
        }
        let nearest_m = places.iter().map(|p| (p - rest).norm()).fold(f32::INFINITY, f32::min);
        assert!(nearest_m <= 0.5 * MIN_UNHEARD_STRETCH_SPACING_M + 0.06, "{case}: {nearest_m} m");
        let off_points_m = |place: &Point| {
            let begins = [on].into_iter().chain(points.iter().copied());
            begins.zip(&points).fold(f32::INFINITY, |least_m, (a, b)| {
                let (leg, away) = (b - a, place - a);
                let share = (away.dot(&leg) / leg.norm_squared().max(1e-9)).clamp(0.0, 1.0);
                least_m.min((away - leg * share).norm())
            })
        };
        assert!(places.iter().all(|p| off_points_m(p) < 0.06), "{case}: {places:?}, {points:?}");
        aside += usize::from(blown_m > 0.1);
        short += usize::from(left_m > 0.0);
    }
    assert!(aside > 1000 && short > 300, "{aside} {short}");
}

/// A neighbour with the hull and speeds of a 2 m/s mission, heard at `at` with these points.
fn heard_at(points: &[Point], at: Point, velocity: Point) -> Neighbours<4> {
    let mut table = joined(0);
    let points = points.iter().copied().collect();
    let reported = Intent { ground_m: 0.0, points, ..intent(0, 1, 2) };
    table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 1000));
    table.handle_intent(Instant::ZERO, 1, &reported, 1, Some(2));
    let entry = &mut table.entries[1];
    (entry.fastest_vehicle_mps, entry.max_unheard_travel_m) = (2.0, max_unheard_travel_m(2.0));
    (entry.state.position, entry.state.velocity) = (at, velocity);
    entry.speed_mps = velocity.norm();
    entry.update_place_on_points();
    table
}

fn start_of_unheard_legs(table: &Neighbours<4>) -> Point {
    let mut start = None;
    table.entries[1].for_each_unheard_leg(0.0, &mut |[from, _], _| {
        start.get_or_insert(from);
    });
    start.unwrap()
}

/// Only a vehicle that flies level along its points, or holds its place, and is near its points is
/// expected on them.
#[test]
fn the_unheard_stretch_begins_on_the_points_only_in_level_flight_near_them() {
    let points = [Point::new(0.0, 0.0, 2.0), Point::new(10.0, 0.0, 2.0)];
    let (far, near) = (Point::new(1.0, 0.3, 2.0), Point::new(1.0, 0.2, 2.0));
    let start = |points: &[Point], at| start_of_unheard_legs(&heard_at(points, at, Point::zeros()));
    assert_eq!(start(&points, far), far);
    assert!((start(&points, near) - Point::new(1.0, 0.0, 2.0)).norm() < 1e-5);
    assert_eq!(start(&points[..1], Point::new(0.0, 0.2, 2.0)), points[0]);
    let aside = Point::new(0.0, 0.3, 2.0);
    assert_eq!(start(&points[..1], aside), aside);
    for (points_length_m, may_come_down) in [(10.0, false), (-1.0, true)] {
        let mut table = heard_at(&points, near, Point::zeros());
        let entry = &mut table.entries[1];
        (entry.points_length_m, entry.may_come_down) = (points_length_m, may_come_down);
        assert_eq!(start_of_unheard_legs(&table), near);
    }
}

/// Where a vehicle's points lead back beside themselves, it may be on either leg: the stretch
/// begins where the vehicle was heard, leads on along the points from the first leg, and is longer
/// by the way along the points from the first to the last place where it may be.
#[test]
fn an_unheard_vehicle_at_a_hairpin_is_kept_off_on_both_legs() {
    let points =
        [[0.0, 0.0], [1.5, 0.0], [1.5, 0.2], [-10.0, 0.2]].map(|[x, y]| Point::new(x, y, 2.0));
    let at = Point::new(0.5, 0.2, 2.0);
    let table = heard_at(&points, at, Point::new(-2.0, 0.0, 0.0));
    assert_eq!(start_of_unheard_legs(&table), at);
    let entry = &table.entries[1];
    let upto_m = table.max_unheard_flown_m(entry, Instant::from_millis(80_000));
    let reach = [entry.min_rest_distance_m(), upto_m];
    // On the way back it stops as far on as a vehicle does at most.
    let rest = Point::new(at.x - max_unheard_travel_m(2.0), 0.2, 2.0);
    let mut nearest_m = f32::INFINITY;
    entry.for_each_rest_place(reach, &mut |place, wider_m| {
        nearest_m = nearest_m.min((place - rest).norm() - wider_m);
    });
    assert!(nearest_m < 0.5 * MIN_UNHEARD_STRETCH_SPACING_M + 0.1, "{nearest_m} m");
}

/// A vehicle that fell lies below where it was heard, not on its points.
#[test]
fn a_landing_keeps_off_where_a_vehicle_may_have_fallen() {
    let mut rng = Pcg32::seed_from_u64(19);
    for _ in 0..2000 {
        let points = [Point::new(0.3, 0.0, 2.0), Point::new(10.0, 0.0, 2.0)];
        let along = uniform(&mut rng, 0.0, 3.0);
        let at = Point::new(along, uniform(&mut rng, -0.25, 0.25), 2.0);
        let table = heard_at(&points, at, Point::zeros());
        let now = Some(Instant::from_millis(5_000));
        let aside = uniform(&mut rng, -1.74, 1.74);
        let place = at + Point::new(0.0, aside, 0.0);
        assert!(table.may_lie_below(1, &place, 0.0, 1.75, now), "{at} {place}");
    }
}

/// However fast a vehicle reports to be, at least one place is kept off.
#[test]
fn a_silent_vehicle_leaves_at_least_one_place_at_any_speed() {
    let mut rng = Pcg32::seed_from_u64(77);
    for _ in 0..50_000 {
        let mut near = |m: f32| Point::from_fn(|_, _| uniform(&mut rng, -m, m));
        let position = near(50.0);
        let mut at = position;
        let points: std::vec::Vec<Point> = (0..7)
            .map(|_| {
                at += near(1.5);
                at
            })
            .collect();
        let velocity = (points[0] - position).normalize() * 9.0;
        let mut table = heard_at(&points, position, velocity);
        table.entries[1].message_delay.delay_s = 0.0;
        let entry = &table.entries[1];
        let reach = [entry.min_rest_distance_m(), entry.unheard_stopping_distance_m()];
        let mut count = 0;
        entry.for_each_rest_place(reach, &mut |_, _| count += 1);
        assert!(count > 0, "{points:?}");
    }
}

/// Beside a vehicle that stands, but not on the points that it reports, the safety filter lets no
/// vehicle pass as near as beside others, so no detour leads there.
#[test]
fn a_detour_keeps_as_far_from_a_vehicle_off_its_points_as_the_filter_does() {
    let mut rng = Pcg32::seed_from_u64(17);
    let braking = Braking { accel_mps2: 1.5, jerk_mps3: 8.0 };
    let bounds = MotionBounds { braking, speed_max_mps: 2.0, stopped_when_unheard_for_s: 3.0 };
    let (mut off_points, mut on_points) = (0, 0);
    for _ in 0..1000 {
        let mut table = joined(0);
        let now = Instant::from_millis(100);
        table.handle_position(now, &ORIGIN, 9, &place(50, 1000));
        table.handle_intent(now, 1, &intent(0, 1, 2), 1, Some(2));
        let entry = &mut table.entries[1];
        entry.state.velocity = Point::zeros();
        entry.speed_mps = 0.0;
        entry.message_delay.delay_s = uniform(&mut rng, 0.0, 1.0);
        let aside = Point::from_fn(|_, _| uniform(&mut rng, -2.0, 2.0));
        entry.points = [entry.state.position + aside].into_iter().collect();
        entry.update_place_on_points();
        let late = now + Duration::from_millis(u64::from(rng.next_u32() % 300));
        let beside = entry.place_on_points == PlaceOnPoints::Beside;
        let wider_m = entry.filter_neighbour(late).motion.reachable_set(&bounds, 0.0).widened_by_m;
        let apart_m = uniform(&mut rng, 1.0, 3.0);
        let mut radius_m = 0.0_f32;
        table.for_each_keep_out_zone(late, [apart_m; 3], |zone| {
            radius_m = radius_m.max(zone.radius_m);
        });
        if beside {
            assert!(radius_m >= apart_m + wider_m, "{radius_m} m, {apart_m} + {wider_m} m");
        } else {
            assert!(radius_m < apart_m + 0.2, "{radius_m} m, {apart_m} m");
        }
        *(if beside { &mut off_points } else { &mut on_points }) += 1;
    }
    assert!(off_points > 300 && on_points > 30, "{off_points} {on_points}");
}

#[test]
fn what_lies_is_kept_off_by_no_more_than_blocks_a_path() {
    let mut rng = Pcg32::seed_from_u64(13);
    let mut seen = [0; 3];
    for _ in 0..2000 {
        let flags = [0, OUT_OF_PLAN, GROUNDED, GROUNDED | OUT_OF_PLAN]
            [(uniform(&mut rng, 0.0, 3.999)) as usize];
        let mut table = joined(0);
        table.entries[0].flags = GROUNDED;
        table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 1000));
        table.handle_intent(Instant::ZERO, 1, &intent(flags, 1, 2), 1, Some(2));
        let silent_s = uniform(&mut rng, 1.0, 120.0);
        let now = Instant::from_millis((1000.0 * silent_s) as u64);
        let grounded_m = uniform(&mut rng, 1.0, 2.0);
        let apart_m = grounded_m + uniform(&mut rng, 0.1, 1.0);
        let lies = flags & GROUNDED != 0 || (flags & OUT_OF_PLAN == 0 && silent_s >= 75.0);
        let comes_down = flags & (GROUNDED | OUT_OF_PLAN) == 0 && (45.0..75.0).contains(&silent_s);
        table.for_each_keep_out_zone(now, [apart_m, apart_m, grounded_m], |off| {
            // The place of a silent vehicle is known to `STALE_POSITION_ERROR_M` only.
            let most_m = grounded_m + STALE_POSITION_ERROR_M;
            let fits = if lies { off.radius_m <= most_m } else { off.radius_m >= apart_m };
            assert!(fits && off.radius_m >= grounded_m, "{flags:#x}, {silent_s} s: {off:?}");
        });
        assert_eq!(table.any_comes_down_unheard(now), comes_down, "{flags:#x}, {silent_s} s");
        seen[if lies { 0 } else { 1 + usize::from(comes_down) }] += 1;
    }
    assert!(seen.iter().all(|count| *count > 100), "{seen:?}");
}

#[test]
fn a_vehicle_out_over_an_area_is_kept_off_by_what_estimates_may_err() {
    let mut rng = Pcg32::seed_from_u64(11);
    for _ in 0..500 {
        let (apart_m, stray_m) = (uniform(&mut rng, 1.0, 3.0), uniform(&mut rng, 0.0, 6.0));
        for (flags, in_air) in
            [(OUT_OF_PLAN, true), (0, true), (OUT_OF_PLAN | GROUNDED, false), (GROUNDED, false)]
        {
            let mut table = joined(0);
            table.form_fleet(64.0, None, stray_m);
            table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 1000));
            let reported = Intent { ground_m: 0.0, ..intent(flags, 1, 2) };
            table.handle_intent(Instant::ZERO, 1, &reported, 1, Some(2));
            // Whatever was reported, no place counts as free that may truly be too near.
            let away = Point::new(uniform(&mut rng, -1.0, 1.0), uniform(&mut rng, -1.0, 1.0), 0.0)
                .normalize();
            let truly_m = apart_m + if in_air { stray_m } else { 0.0 };
            let here = table.entries[1].state.position;
            let near = here + away * (0.99 * truly_m);
            let mut free = true;
            table.for_each_keep_out_zone(Instant::from_millis(100), [apart_m; 3], |off| {
                let down_m = (off.from.z - near.z).clamp(0.0, off.from.z - off.to.z);
                let nearest = off.from - Point::new(0.0, 0.0, down_m);
                free &= (near - nearest).norm() >= off.radius_m;
            });
            assert!(!free, "{flags:#x}: {apart_m} + {stray_m}");
        }
    }
}

#[test]
fn over_an_area_the_column_of_a_vehicle_that_left_it_in_the_air_is_kept_off_for_ten_minutes() {
    let mut rng = Pcg32::seed_from_u64(12);
    for _ in 0..200 {
        let mut table = joined(0);
        let over_area = uniform(&mut rng, 0.0, 4.0) > 1.0;
        if over_area {
            table.form_fleet(64.0, None, 1.0);
        }
        table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 1000));
        let reported = Intent { ground_m: -30.0, ..intent(OUT_OF_PLAN, 1, 2) };
        table.handle_intent(Instant::ZERO, 1, &reported, 1, Some(2));
        let here = table.entries[1].state.position;
        let below = here - Point::new(0.0, 0.0, uniform(&mut rng, 3.0, here.z + 25.0));
        let silent_s = uniform(&mut rng, 1.0, 1200.0);
        let (mut kept, mut lies) = (false, false);
        table.for_each_unavoided_zone_of(
            1,
            Instant::from_millis((1000.0 * silent_s) as u64),
            2.0,
            |off| {
                kept |= off.from.z >= below.z && off.to.z <= below.z;
                lies |= off.to.z <= -29.0;
            },
        );
        assert_eq!(kept, !over_area || silent_s < 600.0, "{silent_s} s, {here:?}, {below:?}");
        assert!(lies, "{silent_s} s: it lies there");
    }
}
