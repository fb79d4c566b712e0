//! The autopilot acts by itself, does not act, or is not heard.

use super::State::*;
use super::*;

/// A vehicle in `Disarm`, close to the ground, that falsely reports the ground, refuses to disarm
/// and does not descend.
fn hovers() -> Bench {
    let mut bench = flying();
    land(&mut bench);
    while bench.enu.z > 1.0 {
        bench.tick();
    }
    (bench.never_lands, bench.false_ground, bench.refused) = (true, true, std::vec![400]);
    bench.run_until(Disarm, 6.0);
    bench
}

/// A vehicle that is in the air when the companion starts.
fn found_in_the_air() -> Bench {
    let mut bench = Bench::new(config());
    (bench.armed, bench.mode, bench.enu.z) = (true, px4::OFFBOARD, 1.5);
    bench.run_until(Failsafe, 3.0);
    bench
}

/// The autopilot disarms, or its failsafe acts and ends.
pub(super) fn takes_over(scenes: &mut Scenes) {
    scenes.play(flying(), |b| b.armed = false, Aborted, 3.0);
    scenes.play(flying(), fails_safe, Failsafe, 3.0);
    scenes.play(landing(), fails_safe, Failsafe, 3.0);
    let lands_in_the_end = |b: &mut Bench| {
        fails_safe(b);
        b.run(302.0);
        b.armed = false;
    };
    scenes.play(flying(), lands_in_the_end, Aborted, 3.0);
    let while_engaging = |b: &mut Bench| {
        fails_safe(b);
        b.refused.push(176);
    };
    scenes.play(to(Engaging), while_engaging, Aborted, 5.0);
    let another_mode = |b: &mut Bench| {
        b.mode = px4::RTL;
        b.refused.push(176);
    };
    scenes.play(to(Streaming), another_mode, Aborted, 5.0);
    // The mission is aborted in the air: the companion lands the vehicle.
    let given_up = |b: &mut Bench| {
        b.armed = false;
        b.run_until(Aborted, 2.0);
        b.armed = true;
    };
    scenes.play(flying(), given_up, Land, 2.0);
}

pub(super) fn does_not_do_as_asked(scenes: &mut Scenes) {
    scenes.play(landing(), |b| b.run(125.0), Land, 1.0);
    scenes.play(to(Climb), |b| stuck(b, 61.0), Aborted, 30.0);
    scenes.play(flying(), |b| stuck(b, 25.0), Aborted, 30.0);
    let stays_armed = |b: &mut Bench| {
        b.stays_armed = true;
        b.refused.push(400);
        land(b);
    };
    scenes.play(flying(), stays_armed, Aborted, 60.0);
    scenes.play(hovers(), |b| b.mode = px4::OFFBOARD, Land, 2.0);
    scenes.play(hovers(), |b| b.false_ground = false, Land, 1.0);
    // An ArduCopter that refuses NAV_TAKEOFF.
    let mut grounded = Bench::ardupilot(config());
    grounded.refused = std::vec![22];
    grounded.run_until(Ready, 6.0);
    grounded.start();
    grounded.stays_armed = true;
    let disarms_at_last = |b: &mut Bench| {
        b.run(14.0);
        b.stays_armed = false;
    };
    scenes.play(grounded, disarms_at_last, Aborted, 30.0);
}

pub(super) fn is_not_heard(scenes: &mut Scenes) {
    let silent = |b: &mut Bench| b.silent = true;
    scenes.play(ready(), silent, WaitAutopilot, 5.0);
    scenes.play(to(Streaming), silent, Aborted, 5.0);
    scenes.play(flying(), silent, AutopilotSilent, 5.0);
    scenes.play(flying(), silent, Aborted, 125.0);
    scenes.play(landing(), silent, Aborted, 125.0);
    let for_a_while = |b: &mut Bench| {
        b.silent = true;
        b.run(6.0);
        b.silent = false;
    };
    scenes.play(flying(), for_a_while, Done, 60.0);
    let is_to_be_landed = |b: &mut Bench| {
        b.silent = true;
        b.run_until(AutopilotSilent, 5.0);
        b.run_until(Land, 65.0);
    };
    scenes.play(flying(), is_to_be_landed, Aborted, 130.0);
}

/// The companion sends no commands until NAV_LAND; the autopilot may land by itself.
pub(super) fn flies_when_the_companion_starts(scenes: &mut Scenes) {
    let lands_by_itself = |b: &mut Bench| {
        b.start();
        b.run(3.0);
        assert!(b.setpoints.is_empty() && b.commands.iter().all(|c| c.0 != 400 && c.0 != 176));
        (b.armed, b.enu.z) = (false, 0.0);
    };
    scenes.play(found_in_the_air(), lands_by_itself, Aborted, 3.0);
    scenes.play(found_in_the_air(), land, Land, 1.0);
}
