//! The ground station pauses the mission.

use super::State::*;
use super::*;

pub(super) fn in_flight(scenes: &mut Scenes) {
    scenes.play(flying(), pause, Paused, 1.0);
    let resumed = |b: &mut Bench| {
        pause(b);
        b.run(3.0);
        resume(b);
    };
    scenes.play(flying(), resumed, Done, 60.0);
    let for_too_long = |b: &mut Bench| {
        pause(b);
        b.run(601.0);
    };
    scenes.play(flying(), for_too_long, Aborted, 30.0);
    // Paused in the climb, then commanded to return.
    let called_back = |b: &mut Bench| {
        b.run_until_lifted();
        pause(b);
        back(b);
    };
    scenes.play(to(Climb), called_back, Land, 1.0);
    // Paused before the vehicle has left the ground.
    scenes.play(to(Climb), pause, Scheduled, 6.0);
    // Paused and unheard: others assume after a while that the vehicle is down, so it lands.
    let unheard = |b: &mut Bench| {
        pause(b);
        b.neighbour = None;
    };
    scenes.play(accompanied(Follow, 1.0), unheard, Aborted, 60.0);
}

pub(super) fn on_the_ground(scenes: &mut Scenes) {
    let started_all_the_same = |b: &mut Bench| {
        pause(b);
        b.start();
        b.run(31.0);
    };
    scenes.play(ready(), started_all_the_same, Scheduled, 1.0);
}
