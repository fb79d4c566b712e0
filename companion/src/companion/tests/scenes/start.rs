//! From the plan to the lift-off.

use planner_core::flight::{Gate, Task};

use super::State::*;
use super::*;

/// A vehicle whose planner answers the request for a plan by `answer`; `None`: not at all.
fn answered(answer: Option<Result<Plan, PlanFailure>>) -> Bench {
    let mut bench = Bench::new(config());
    bench.answer_plan = answer;
    bench
}

/// A started vehicle that waits at a gate for vehicle 77.
fn gated() -> Bench {
    let mut gated = plan();
    gated.gates.push(Gate { at_m: -1.5, wait_for_id: 77, open_from_progress_m: 6.0 }).unwrap();
    let mut bench = Bench::new(two_vehicles());
    bench.answer_plan = Some(Ok(gated));
    bench.run_until(Ready, 6.0);
    bench.start();
    bench.run(1.0);
    assert_eq!(bench.state(), Scheduled);
    bench
}

/// A vehicle in `Arming`, whose autopilot was changed by `script` before.
fn arming_after(script: impl FnOnce(&mut Bench)) -> Bench {
    let mut bench = to(Streaming);
    script(&mut bench);
    bench.run_until(Arming, 6.0);
    bench
}

/// The autopilot denies arming.
fn denied() -> Bench {
    arming_after(|b| b.refused.push(400))
}

/// The vehicle becomes armed after its start was paused.
fn armed_late(b: &mut Bench) {
    pause(b);
    b.armed = true;
    b.run(1.0);
    assert_eq!(b.state(), CancelStart);
}

/// The planner's answers.
pub(super) fn planned(scenes: &mut Scenes) {
    let late = |b: &mut Bench| {
        b.run(35.0);
        b.answer_plan = Some(Ok(plan()));
    };
    scenes.play(answered(None), late, Ready, 40.0);
    let start = |b: &mut Bench| {
        b.run_until(Ready, 6.0);
        b.start();
    };
    let idle = VehiclePlan { task: Task::Stay, path: Default::default(), ..plan() };
    scenes.play(answered(Some(Ok(idle))), start, Done, 1.0);
    for failure in [PlanFailure::RoadmapUnusable, PlanFailure::Unreachable] {
        scenes.play(answered(Some(Err(failure))), |b| b.run(6.0), Aborted, 1.0);
    }
}

/// Conditions on the pad at MISSION_START.
pub(super) fn started(scenes: &mut Scenes) {
    let dragged = |b: &mut Bench| {
        drag(b, Point::x());
        b.start();
    };
    scenes.play(ready(), dragged, Aborted, 1.0);
    let armed = |b: &mut Bench| {
        b.armed = true;
        b.run(1.5);
        b.start();
    };
    scenes.play(ready(), armed, Aborted, 1.0);
    let low = |b: &mut Bench| {
        b.battery = 9;
        b.run(1.5);
        b.start();
    };
    scenes.play(ready(), low, Aborted, 1.0);
    let high = fenced(config(), Point::new(0.0, 0.0, 1.0), Point::new(20.0, 30.0, 10.0));
    scenes.play(ready_with(high), Bench::start, Aborted, 1.0);
    let again = |b: &mut Bench| {
        b.start();
        b.run_until(Streaming, 3.0);
        land(b);
        b.start();
    };
    scenes.play(ready(), again, Ready, 6.0);
}

/// In `Scheduled`, while the vehicle waits for others.
pub(super) fn scheduled(scenes: &mut Scenes) {
    scenes.play(gated(), |b| b.armed = true, Aborted, 2.0);
    scenes.play(gated(), |b| b.battery = 9, Aborted, 2.0);
    scenes.play(gated(), |b| drag(b, Point::x()), Aborted, 2.0);
    let narrow = fenced(two_vehicles(), Point::new(7.0, 0.0, -1.0), Point::new(20.0, 30.0, 10.0));
    let mut outside = ready_with(narrow);
    outside.start();
    scenes.play(outside, |b| drag(b, Point::x() * -0.4), Aborted, 2.0);
    let hovers_over_the_pad = |b: &mut Bench| {
        b.neighbour = flies(Point::new(8.0, 12.0, 3.0), ON_PLAN);
        b.run_until(Ready, 6.0);
        b.start();
        b.run(25.0);
    };
    scenes.play(Bench::new(two_vehicles()), hovers_over_the_pad, Scheduled, 1.0);
    // Another vehicle comes above the pad once the gates are open, before arming is requested.
    for state in [Streaming, Engaging] {
        let comes_over_the_pad = |b: &mut Bench| {
            b.refused.push(176);
            b.neighbour = on_pad(ON_PLAN);
            b.run_until(Ready, 6.0);
            b.start();
            b.run_until(state, 10.0);
            b.neighbour = flies(Point::new(8.0, 12.0, 3.0), ON_PLAN);
        };
        scenes.play(Bench::new(two_vehicles()), comes_over_the_pad, Scheduled, 2.0);
    }
    // No neighbour hears the vehicle on the ground.
    let unheard = |b: &mut Bench| {
        b.start();
        b.run(12.0);
    };
    scenes.play(ready_with(two_vehicles()), unheard, Scheduled, 1.0);
}

/// From the first setpoint until arming.
pub(super) fn streaming(scenes: &mut Scenes) {
    scenes.play(to(Streaming), land, Aborted, 1.0);
    scenes.play(to(Streaming), back, Aborted, 1.0);
    scenes.play(to(Streaming), |b| b.refused.push(176), Aborted, 8.0);
    scenes.play(to(Streaming), |b| b.refused.push(400), Aborted, 30.0);
}

/// In `Arming` the start is paused or cancelled, arming is not answered or undone, or the vehicle
/// arms and lifts off in spite of a pause.
pub(super) fn arming(scenes: &mut Scenes) {
    scenes.play(denied(), pause, Scheduled, 4.0);
    scenes.play(denied(), land, Aborted, 4.0);
    scenes.play(denied(), back, Aborted, 4.0);
    scenes.play(denied(), |b| b.battery = 9, Aborted, 5.0);
    scenes.play(denied(), |b| b.no_position = true, Aborted, 5.0);
    scenes.play(denied(), |b| drag(b, Point::x()), Aborted, 5.0);
    let unanswered = arming_after(|b| (b.mute, b.refused) = (true, std::vec![400]));
    scenes.play(unanswered, nothing, Aborted, 9.0);
    scenes.play(arming_after(|b| b.never_arms = true), nothing, Aborted, 9.0);
    scenes.play(denied(), armed_late, Disarm, 6.0);
    arming_held(scenes);
    scenes.play(Bench::new(two_vehicles()), climb_barred, Done, 60.0);
    let lifted_off = |b: &mut Bench| {
        armed_late(b);
        b.enu.z = 1.0;
    };
    scenes.play(denied(), lifted_off, Land, 2.0);
}

/// Another vehicle comes above the pad of one that is armed and has not left the ground. The
/// companion disarms it before the autopilot would, and starts again once the column is free.
fn climb_barred(b: &mut Bench) {
    b.neighbour = on_pad(ON_PLAN);
    b.run_until(Ready, 6.0);
    b.start();
    b.run_until(Arming, 15.0);
    while b.commands.iter().all(|c| c.0 != 400) {
        b.run(0.05);
    }
    b.neighbour = flies(Point::new(8.0, 12.0, 1.5), ON_PLAN);
    b.run_until(CancelStart, 9.0);
    b.run(4.0);
    assert!(b.state() == Scheduled && !b.armed, "{:?}", b.texts);
    b.neighbour = on_pad(ON_PLAN);
    b.run_until(Follow, 20.0);
}

/// Another vehicle comes above the pad just as the setpoint mode is entered: arming is not
/// requested, and the start waits again.
fn arming_held(scenes: &mut Scenes) {
    let comes_after = |b: &mut Bench, steps: u32| {
        b.neighbour = on_pad(ON_PLAN);
        b.run_until(Ready, 6.0);
        b.start();
        b.run_until(Engaging, 10.0);
        b.run(0.05 * steps as f32);
        b.neighbour = flies(Point::new(8.0, 12.0, 3.0), ON_PLAN);
    };
    let is_held = |steps: &u32| {
        let mut b = Bench::new(two_vehicles());
        comes_after(&mut b, *steps);
        let unasked = |b: &Bench| b.state() == Arming && b.commands.iter().all(|c| c.0 != 400);
        (0..20).any(|_| {
            b.run(0.05);
            unasked(&b)
        })
    };
    let steps = (0..40).find(is_held).unwrap();
    scenes.play(Bench::new(two_vehicles()), |b| comes_after(b, steps), Scheduled, 2.0);
}

/// A vehicle flies by and falls silent. The places that it may reach would bar the climb, and the
/// autopilot disarms a vehicle that waits on the ground: arming is requested only if the neighbour
/// was heard just before.
#[test]
fn nobody_arms_where_one_beside_was_not_heard_just_now() {
    let (mut waits, mut latest_s) = (0, 0.0_f32);
    for steps in 0..50 {
        let mut b = Bench::new(two_vehicles());
        b.neighbour = flies(Point::new(13.0, 12.0, 3.0), ON_PLAN);
        b.run_until(Ready, 6.0);
        b.start();
        b.run_until(Streaming, 10.0);
        b.run(0.05 * steps as f32);
        b.neighbour = None;
        let asked = |b: &Bench| b.commands.iter().any(|c| c.0 == 400);
        if asked(&b) {
            break;
        }
        let silent_at = b.now;
        while !asked(&b) && b.now - silent_at < Duration::from_secs(5) {
            b.run(0.05);
        }
        match asked(&b) {
            true => latest_s = latest_s.max((b.now - silent_at).as_secs_f32()),
            false => waits += usize::from(b.state() == Scheduled && !b.armed),
        }
    }
    assert!(
        latest_s < 0.75 && waits > 15,
        "armed up to {latest_s} s after it was heard, {waits} wait"
    );
}
