//! In a coverage mission: the vehicle flies straight home on command, or because its path stays
//! blocked.

use planner_core::flight::Gate;
use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

use super::State::*;
use super::losses::over_a_field;
use super::*;

/// The vehicle has landed on its pad.
fn is_home(b: &mut Bench) {
    b.run_until(Aborted, 240.0);
    assert!((b.enu - START).xy().norm() < 0.3, "at its pad: {:?} {:?}", b.enu, b.texts);
}

pub(super) fn is_ordered(scenes: &mut Scenes) {
    for state in [Follow, Paused, Dividing] {
        let ordered = |b: &mut Bench| {
            match state {
                Paused => pause(b),
                Dividing => {
                    b.answer_division = false;
                    losses::leaves(b);
                }
                _ => {}
            }
            b.run_until(state, 5.0);
            back(b);
            is_home(b);
        };
        scenes.play(over_a_field(Follow), ordered, Aborted, 1.0);
    }
}

/// It flies around a vehicle that lies on its path, and back to the path.
pub(super) fn flies_around(scenes: &mut Scenes) {
    let around = |b: &mut Bench| {
        b.neighbour = below_the_path(OUT_OF_PLAN);
        b.run_until(Blocked, 5.0);
        b.run_until(Dividing, 30.0);
    };
    scenes.play(over_a_field(Follow), around, Done, 120.0);
    let is_lost = |b: &mut Bench| {
        b.neighbour = below_the_path(OUT_OF_PLAN);
        b.undividable = true;
        b.run_until(Dividing, 40.0);
        is_home(b);
    };
    scenes.play(over_a_field(Follow), is_lost, Aborted, 1.0);
}

pub(super) fn is_blocked(scenes: &mut Scenes) {
    let blocked = |b: &mut Bench| {
        b.neighbour = below_the_path(OUT_OF_PLAN);
        b.answer_detour = detours::NO_WAY;
        b.run_until(Blocked, 5.0);
        b.run(119.0);
        b.answer_detour = Some(Ok(()));
        is_home(b);
    };
    scenes.play(over_a_field(Follow), blocked, Aborted, 1.0);
    // The other vehicle comes and goes: the path is clear for a moment now and then.
    let sways = |b: &mut Bench| {
        let reported = |b: &Bench, text: &str| b.texts.iter().any(|reported| reported == text);
        for _ in 0..20 {
            let turns = reported(b, "Path blocked for 2 min: planning the way home");
            b.answer_detour = if turns { Some(Ok(())) } else { detours::NO_WAY };
            b.neighbour = below_the_path(OUT_OF_PLAN);
            b.run(8.0);
            b.neighbour = on_pad(ON_PLAN);
            b.run(0.8);
        }
        assert!(reported(b, "Path clear again") && reported(b, "Flying home"), "{:?}", b.texts);
        is_home(b);
    };
    scenes.play(over_a_field(Follow), sways, Aborted, 1.0);
}

/// Another vehicle flies elsewhere, and never passes the place that opens the gate.
pub(super) fn waits_for_nothing(scenes: &mut Scenes) {
    let mut plan = field_plan();
    plan.gates.push(Gate { at_m: 4.0, wait_for_id: 77, open_from_progress_m: 60.0 }).unwrap();
    let mut bench = losses::over_a_field_with(plan, Follow);
    bench.neighbour = flies(Point::new(40.0, 40.0, 9.0), ON_PLAN);
    let waits = |b: &mut Bench| {
        b.run(600.0);
        is_home(b);
    };
    scenes.play(bench, waits, Aborted, 1.0);
}

/// Another vehicle flies on this one's path; on its path home this one yields to one on its plan.
pub(super) fn is_in_the_way_of_another(scenes: &mut Scenes) {
    let stays_in_front = |b: &mut Bench| {
        b.neighbour = flies(Point::new(14.0, 12.0, 1.5), ON_PLAN | crate::link::intent::ON_DETOUR);
        b.answer_detour = detours::NO_WAY;
        let turns = |b: &Bench| b.texts.iter().any(|text| text.contains("planning the way home"));
        while !turns(b) {
            b.run(0.1);
        }
        b.answer_detour = Some(Ok(()));
        is_home(b);
    };
    scenes.play(over_a_field(Follow), stays_in_front, Aborted, 1.0);
    let yields = |b: &mut Bench| {
        b.run(3.0);
        back(b);
        b.run(3.0);
        b.neighbour = flies(START - Point::new(1.0, 0.0, 0.0), ON_PLAN);
        b.run(75.0);
        b.neighbour = on_pad(ON_PLAN);
        is_home(b);
    };
    scenes.play(over_a_field(Follow), yields, Aborted, 1.0);
}

/// The planner finds no path home, or answers late.
pub(super) fn finds_no_way(scenes: &mut Scenes) {
    let no_way = |b: &mut Bench| {
        b.answer_detour = detours::NO_WAY;
        back(b);
        b.run_until(Blocked, 2.0);
        b.run_until(Land, 60.0);
        assert!((b.enu - START).xy().norm() < 0.5, "over its pad: {:?}", b.enu);
    };
    scenes.play(over_a_field(Follow), no_way, Aborted, 60.0);
    let late = |b: &mut Bench| {
        b.answer_detour = None;
        back(b);
        b.run_until(Replanning, 5.0);
        b.run_until(Blocked, 10.0);
        b.answer_detour = Some(Ok(()));
        is_home(b);
    };
    scenes.play(over_a_field(Follow), late, Aborted, 1.0);
}

/// An obstacle lies on the way back.
pub(super) fn meets_an_obstacle(scenes: &mut Scenes) {
    let turns_back = |b: &mut Bench| {
        b.run(4.0);
        b.answer_detour = detours::NO_WAY;
        back(b);
        b.run_until(Blocked, 2.0);
        b.run_until(Follow, 30.0);
        b.report_obstacle(&START, 0.5);
        b.answer_detour = Some(Ok(()));
        b.run_until(Land, 60.0);
    };
    scenes.play(over_a_field(Follow), turns_back, Aborted, 60.0);
}

/// Where an obstacle is reported, anywhere on the way back or at the pad, a vehicle that flies back
/// as it came touches nothing, and lands where nothing is below.
#[test]
fn a_vehicle_that_flies_back_keeps_off_reported_obstacles() {
    let mut met = 0;
    for seed in 0..if cfg!(debug_assertions) { 100 } else { 400 } {
        let mut rng = Pcg32::seed_from_u64(seed);
        let mut real =
            |low: f32, high: f32| low + (high - low) * (rng.next_u32() >> 8) as f32 / 16_777_216.0;
        let mut b = over_a_field(Follow);
        b.run(real(0.0, 14.0));
        let flown_m = b.companion.guidance.reference_along_m();
        let path = b.companion.mission.plan().expect("a plan").path.clone();
        let up = Point::new(0.0, 0.0, real(-1.5, 0.5));
        let place = path.point_at(real(-2.0, flown_m).max(0.0)).expect("it is on it") + up;
        let radius_m = real(0.3, 2.0);
        b.answer_detour = detours::NO_WAY;
        back(&mut b);
        b.run_until(Follow, 40.0);
        b.run(real(0.0, 2.0));
        if (b.enu - place).norm() < radius_m + 3.5 || b.state() != Follow {
            continue;
        }
        b.report_obstacle(&place, radius_m);
        b.answer_detour = Some(Ok(()));
        let mut least_m = f32::INFINITY;
        for _ in 0..20 * 240 {
            b.tick();
            least_m = least_m.min((b.enu - place).norm() - radius_m);
            if b.state() == Aborted {
                break;
            }
        }
        let turned = "Obstacle on the way back: seeking a place";
        met += usize::from(b.texts.iter().any(|text| text == turned));
        let beside_m = (b.enu - place).xy().norm();
        assert!(
            least_m > 0.3 && b.state() == Aborted && beside_m > radius_m,
            "seed {seed}: {least_m} m, {beside_m} m beside {radius_m} m: {:?} {:?}",
            b.state(),
            b.texts
        );
    }
    assert!(met > 10, "{met} met an obstacle");
}

/// A vehicle that is paused on its path home continues on it.
#[test]
fn an_interrupted_way_home_is_flown_to_its_end() {
    for at_s in [0.2, 1.5, 3.0] {
        let mut bench = over_a_field(Follow);
        back(&mut bench);
        bench.run(at_s);
        pause(&mut bench);
        bench.run_until(Paused, 5.0);
        bench.run(3.0);
        resume(&mut bench);
        is_home(&mut bench);
    }
}

/// Another vehicle stops this one on its detour for so long that the detour counts as blocked too,
/// and then flies on.
#[test]
fn a_vehicle_that_was_stopped_on_its_way_around_goes_on() {
    let mut b = over_a_field(Follow);
    b.neighbour = below_the_path(OUT_OF_PLAN);
    b.run_until(Blocked, 5.0);
    b.run_until(Follow, 30.0);
    b.run(0.5);
    let ahead_m = b.companion.guidance.reference_along_m() + 2.5;
    let ahead = b.companion.mission.plan().and_then(|plan| plan.path.point_at(ahead_m));
    b.answer_detour = detours::NO_WAY;
    b.neighbour = flies(ahead.unwrap(), ON_PLAN | crate::link::intent::ON_DETOUR);
    b.run_until(Blocked, 40.0);
    b.neighbour = below_the_path(OUT_OF_PLAN);
    b.answer_detour = Some(Ok(()));
    b.run_until(Dividing, 60.0);
    b.run_until(Follow, 5.0);
    assert!(b.texts.iter().any(|text| text == "Flown around: on its path again"), "{:?}", b.texts);
}

/// A vehicle that was commanded home is out of the plan. A new start is another flight, in which it
/// flies its part.
#[test]
fn a_vehicle_that_came_home_early_takes_part_again_after_a_new_start() {
    let mut b = over_a_field(Follow);
    b.run(2.0);
    back(&mut b);
    is_home(&mut b);
    b.run(2.0);
    b.start();
    b.run_until(Ready, 30.0);
    b.start();
    b.run_until(Done, 120.0);
}
