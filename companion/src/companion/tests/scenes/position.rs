//! The position of the vehicle is not known, or not precisely enough.

use super::State::*;
use super::*;

pub(super) fn is_lost(scenes: &mut Scenes) {
    let lost = |b: &mut Bench| b.no_position = true;
    scenes.play(ready(), lost, WaitPosition, 4.0);
    scenes.play(to(Streaming), lost, Aborted, 4.0);
    scenes.play(flying(), lost, PositionLost, 3.0);
    scenes.play(flying(), lost, Aborted, 30.0);
    let for_a_while = |b: &mut Bench| {
        b.no_position = true;
        b.run(2.0);
        b.no_position = false;
    };
    scenes.play(flying(), for_a_while, Done, 60.0);
    let landed = |b: &mut Bench| {
        b.no_position = true;
        b.run(1.5);
        land(b);
    };
    scenes.play(flying(), landed, Aborted, 30.0);
}

/// The estimate is bad, the origin moves, or the position jumps.
pub(super) fn is_not_to_be_trusted(scenes: &mut Scenes) {
    let bad_before_the_start = |b: &mut Bench| {
        b.accuracy_m = Some(0.2);
        b.run(2.0);
        b.start();
    };
    scenes.play(ready(), bad_before_the_start, Aborted, 3.0);
    scenes.play(flying(), |b| b.accuracy_m = Some(0.3), Aborted, 60.0);
    let origin_moves = |b: &mut Bench| {
        b.origin.lat_deg += 1e-6;
        b.send_origin();
    };
    scenes.play(flying(), origin_moves, Land, 3.0);
    let jumps = |b: &mut Bench| {
        b.enu.y += 5.0;
        b.run_until(PositionLost, 0.2);
    };
    scenes.play(flying(), jumps, Aborted, 30.0);
}
